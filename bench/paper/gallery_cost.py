"""Cost of a wear profile by every scheme: linear solutions and time against its error."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.ticker import LogLocator, NullLocator

from bench.common.layout import table
from bench.common.measure import Bench
from bench.common.wear_runs import (
    Scheme,
    WearRun,
    difference,
    rosenbrock,
    run_wear,
    stage_order,
    steps_of,
)
from bench.paper.gallery_text import beside, new_figure, percent, picture, save
from fretwear.plot.style import PALETTE, tidy

__all__ = ["Cost", "measure_cost", "write_cost"]

#: Error of the runs that the others are judged by, and of a second one that judges these.
TOLERANCE, SECOND_TOLERANCE, QUICK_TOLERANCE = 1e-4, 1e-3, 1e-2
#: Parts of the final depth by which steps of first order grow.
PARTS = (5, 10, 20, 40)
#: Tolerances of the schemes of high order.
TOLERANCES = (3e-1, 1e-1, 3e-2, 1e-2, 3e-3)
#: Numbers of steps of the implicit scheme whose error the others have to reach.
MEASURES = (20, 40)
#: Share of linear solutions that was aimed at with high order.
AIM = 0.15
IMPLICIT = "implicit Euler"


@dataclass(frozen=True)
class Cost:
    """Runs of every scheme by name and setting.

    Attributes
    ----------
    reference : WearRun
        Fine steps of order 2.
    floor : float
        Difference of a second fine run, of order 4, from the reference: errors below it
        mean nothing.
    runs : dict
        Runs of a scheme, by its setting.
    """

    reference: WearRun
    floor: float
    runs: dict[str, dict[str, WearRun]]

    def error(self, run: WearRun) -> float:
        """Of the final profile, as a part of its largest depth."""
        return difference(run.depth, self.reference.depth)

    def cheapest(self, scheme: str, error: float) -> tuple[str, WearRun] | None:
        """The setting of fewest linear solutions whose error is no larger."""
        good = [item for item in self.runs[scheme].items() if self.error(item[1]) <= error]
        return min(good, key=lambda item: item[1].n_solves, default=None)


def measure_cost(bench: Bench) -> Cost:
    """Every scheme with every setting."""
    tolerance = QUICK_TOLERANCE if bench.quick else TOLERANCE
    reference = run_wear(bench, "cost_reference", stage_order(2, tolerance))
    second = run_wear(bench, "cost_second", stage_order(
        4, QUICK_TOLERANCE if bench.quick else SECOND_TOLERANCE))
    runs: dict[str, dict[str, WearRun]] = {}
    for number, (scheme, setting) in enumerate(settings(reference.deepest, bench.quick)):
        runs.setdefault(scheme.name, {})[setting] = run_wear(bench, f"cost_{number}", scheme)
    return Cost(reference, difference(second.depth, reference.depth), runs)


def settings(depth: float, quick: bool) -> list[tuple[Scheme, str]]:
    """Schemes with their settings, and what a setting is called."""
    parts = PARTS[1:3] if quick else PARTS
    tolerances = TOLERANCES[1:2] if quick else TOLERANCES
    controlled: list[Callable[[float], Scheme]] = [
        lambda t: stage_order(2, t), lambda t: stage_order(3, t), lambda t: stage_order(4, t),
        rosenbrock]
    found = [(steps_of(scheme, depth / part), f"1/{part}")
             for scheme in ("implicit", "pseudo_time") for part in parts]
    return found + [(scheme(t), f"{t:g}") for scheme in controlled for t in tolerances]


def write_cost(folder: Path, data: Cost) -> str:
    """Draw the picture; the text of the part."""
    draw(folder / "wear_cost.png", data)
    return "\n".join([
        "## Cost of a wear profile", "",
        "The case of 3600 rpm by every scheme. The error is the largest difference of the final "
        "profile from that of an error-controlled run of order 2 with "
        f"{data.reference.n_steps} steps, as a part of the largest depth. A run of order 4 with "
        f"another tolerance ends {percent(data.floor)} from it: the steady state is a continuum "
        "whose end depends a little on the path, and errors near that level scatter.",
        *picture("wear_cost.png", "linear solutions and time against the error of the profile"),
        *runs_table(data), "", "### At the same error", "",
        "The cheapest setting of each scheme whose error is at most that of the implicit scheme of "
        "first order with 20 and with 40 steps to the final depth:", "",
        *equal_table(data), "", *beside(*rows_of(data))])


def draw(path: Path, data: Cost) -> None:
    """Linear solutions and processor time against the error."""
    figure = new_figure(9.0, 4.4)
    panels = figure.subplots(1, 2, sharey=True)
    for (name, runs), colour, marker in zip(data.runs.items(), PALETTE, "osD^vp"):
        errors = [100.0 * data.error(run) for run in runs.values()]
        for axes, cost in zip(panels, ([run.n_solves for run in runs.values()],
                                       [run.cpu for run in runs.values()])):
            axes.plot(cost, errors, marker + "-", color=colour, linewidth=1.0, markersize=5,
                      label=name)
    for axes, text in zip(panels, ("linear solutions", "processor time [s]")):
        axes.set(xscale="log", yscale="log", xlabel=text)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.axhline(100.0 * data.floor, color="0.6", linestyle=":", label="scatter of the path")
        tidy(axes)
    panels[0].set_ylabel("error of the profile [% of the largest depth]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4,
                  frameon=False, fontsize=9)
    save(figure, path)


def runs_table(data: Cost) -> list[str]:
    """Lines of a table: every run."""
    rows = [(name, setting, run.n_steps, run.n_rejected, run.n_solves, run.n_krylov,
             f"{run.cpu:.2f}", percent(data.error(run)))
            for name, runs in data.runs.items() for setting, run in runs.items()]
    return table(["scheme", "depth step or tolerance", "steps", "rejected", "linear solutions",
                  "Krylov iterations", "processor time [s]", "error"], rows)


def equal_table(data: Cost) -> list[str]:
    """Lines of a table: the cheapest setting of every scheme at two errors."""
    rows = []
    for name in data.runs:
        cells: list[str] = []
        for part in MEASURES:
            measure = data.runs[IMPLICIT].get(f"1/{part}")
            found = data.cheapest(name, data.error(measure)) if measure else None
            cells.append("-" if found is None or measure is None else
                         f"{found[0]}: {found[1].n_solves} "
                         f"({percent(found[1].n_solves / measure.n_solves)} of the linear "
                         f"solutions, {percent(found[1].cpu / measure.cpu)} of the time)")
        rows.append((name, *cells))
    return table(["scheme", *(f"error of {part} steps" for part in MEASURES)], rows)


def best_share(data: Cost, names: list[str]) -> tuple[float, str]:
    """Smallest share of the linear solutions of 20 implicit steps at their error, by schemes."""
    measure = data.runs[IMPLICIT]["1/20"]
    found = {name: data.cheapest(name, data.error(measure)) for name in names}
    shares = {name: item[1].n_solves / measure.n_solves for name, item in found.items() if item}
    name = min(shares, key=lambda key: shares[key], default="")
    return (shares[name], name) if name else (float("nan"), "none")


def share_text(share: float) -> str:
    """A share in percent, or that no setting got there."""
    return "error not reached" if math.isnan(share) else percent(share)


def rows_of(data: Cost) -> list[tuple[str, str, str]]:
    """What the costs say."""
    high, name = best_share(data, [n for n in data.runs if "order" in n])
    first, _ = best_share(data, ["pseudo-time"])
    cheaper = "first" if not high < first else "high"
    return [
        ("of the orders tested, the first one did best",
         f"pseudo-time of first order: {share_text(first)} of the linear solutions of 20 implicit "
         f"steps at no larger error; best of high order, {name}: {share_text(high)}",
         "agrees" if cheaper == "first" else "disagrees, in favour of high order"),
        (f"(the aim here: high order below {percent(AIM)})", share_text(high),
         "reached" if high < AIM else "missed: every stage of a step costs a linear solution, and "
         "errors fall less with the tolerance than on a smooth problem, since pairs that start to "
         "slip, stop or lift off make kinks in the rate"),
    ]
