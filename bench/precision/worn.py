"""Time against the error of the worn profile for every scheme of wear, on the sector."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from matplotlib.ticker import LogLocator, NullFormatter

from bench.common.layout import COLOURS, new_figure, table
from bench.common.measure import Bench, Groups
from bench.common.wear_runs import (
    FAST,
    N_PAIRS,
    Scheme,
    WearRun,
    difference,
    rosenbrock,
    run_wear,
    stage_order,
)

__all__ = ["WearPoint", "measure_wear_precision", "time_at", "times_at_equal_error",
           "write_wear_precision"]

#: Parts of the final depth that the largest depth grows by in a step.
STEPS = (5, 10, 20, 40, 80)
#: Errors that set the steps of the higher orders [of the largest depth].
TOLERANCES = (0.3, 0.1, 0.03, 0.01, 0.003)
#: Error of the run that says what the final profile is.
REFERENCE, QUICK_REFERENCE = 1e-5, 1e-2
#: Part of the largest rate at which a joint counts as steady. At the default of 1e-6 depths are
#: still some 1e-4 short of the steady state where steps are short, and less so where the last one
#: is long: the tables would show that, and no error of a scheme.
STEADY: Groups = {"wear": {"steady_tolerance": 1e-8}}
#: Errors at which times are compared, and what the pseudo-time of order 1 and the best of all
#: schemes may take at most, over the time of the implicit scheme of order 1.
EQUAL_ERRORS = (3e-3, 2e-3, 1e-3)
PSEUDO, IMPLICIT, SECOND = "pseudo-time, order 1", "implicit, order 1", "implicit, order 2"
MOST_PSEUDO, MOST_BEST = 0.30, 0.20


@dataclass(frozen=True)
class WearPoint:
    """A run to the steady state; error and cpu [s] are NaN where none was reached."""

    scheme: str
    setting: str
    n_steps: int
    n_solves: int
    error: float
    cpu: float


def measure_wear_precision(bench: Bench) -> list[WearPoint]:
    """Every scheme over its settings."""
    reference = run_wear(bench, "precision_reference",
                         stage_order(2, QUICK_REFERENCE if bench.quick else REFERENCE),
                         changes=STEADY)
    if not reference.is_steady:
        raise RuntimeError("the reference of the wear runs has no steady state")
    return [point(scheme, setting, run_wear(bench, "precision_wear", scheme, changes=STEADY),
                  reference)
            for scheme, setting in settings(reference.deepest, bench.quick)]


def settings(deepest: float, quick: bool) -> Iterator[tuple[Scheme, str]]:
    """Schemes with their steps or tolerances."""
    steps, tolerances = (STEPS[:2], TOLERANCES[:2]) if quick else (STEPS, TOLERANCES)
    for n in steps:
        step = {"max_depth_step": deepest / n}
        yield Scheme("explicit, order 1", {"scheme": "explicit"} | step), f"1/{n}"
        yield Scheme("explicit, order 2", {"scheme": "explicit", "order": 2} | step), f"1/{n}"
        yield Scheme("implicit, order 1", {"scheme": "implicit"} | step), f"1/{n}"
        yield Scheme("pseudo-time, order 1", {"scheme": "pseudo_time"} | step), f"1/{n}"
    for tolerance in tolerances:
        for order in (2, 3, 4):
            yield stage_order(order, tolerance), f"{tolerance:g}"
        chosen = rosenbrock(tolerance)
        yield Scheme("pseudo-time, Rosenbrock", chosen.wear, chosen.pseudo_time), f"{tolerance:g}"
        yield Scheme("pseudo-time, BDF", chosen.wear, {"scheme": "bdf"}), f"{tolerance:g}"


def point(scheme: Scheme, setting: str, run: WearRun, reference: WearRun) -> WearPoint:
    """What a run is worth."""
    error = difference(run.depth, reference.depth) if run.is_steady else math.nan
    return WearPoint(scheme.name, setting, run.n_steps, run.n_solves, error,
                     run.cpu if run.is_steady else math.nan)


def write_wear_precision(images: Path, points: list[WearPoint]) -> str:
    """Draw the picture; the text of the part."""
    names = list(dict.fromkeys(p.scheme for p in points))
    draw(images / "benchmark_wear.png", points, names)
    rows = [(p.scheme, p.setting, p.n_steps, p.n_solves,
             "no steady state" if math.isnan(p.error) else f"{p.error:.1e}",
             "-" if math.isnan(p.cpu) else f"{p.cpu:.2f}")
            for name in names for p in points if p.scheme == name]
    return "\n".join([
        "### Wear: error of the profile against run time", "",
        f"The sector with {N_PAIRS} pairs at {FAST.name}, H = 3, from the unworn joint to its "
        "steady state (`steady_tolerance = 1e-8`). The error is the largest difference of the "
        "depth of a pair from the profile "
        "of order 2 with an error tolerance of 1e-5, as a part of the largest depth; the time is "
        "that of the processor for the whole program, in one thread. First-order schemes (and the "
        "explicit one of order 2) take steps in which the largest depth grows by the part of its "
        "final value in the table; the others set their steps by the tolerance there.", "",
        "![Error of the worn profile against run time](images/benchmark_wear.png)", "",
        *table(["scheme", "step or tolerance", "steps", "linear solutions", "error",
                "time [s]"], rows), "",
        *times_at_equal_error(points)])


def times_at_equal_error(points: list[WearPoint]) -> list[str]:
    """What schemes take for the same error, with the targets."""
    names = list(dict.fromkeys(p.scheme for p in points))
    rows = []
    for error in EQUAL_ERRORS:
        times = {name: time_at(error, [p for p in points if p.scheme == name]) for name in names}
        known = {name: cpu for name, cpu in times.items() if not math.isnan(cpu)}
        best = min(known, key=lambda name: known[name], default="-")
        pseudo, first, second = (times.get(name, math.nan) for name in (PSEUDO, IMPLICIT, SECOND))
        least = known.get(best, math.nan)
        rows.append((f"{error:.0e}", *map(cell, (pseudo, first, second)),
                     judged(pseudo / first, MOST_PSEUDO), cell(pseudo / second),
                     f"{best}, {cell(least)}", judged(least / first, MOST_BEST),
                     cell(least / second)))
    return [
        "Times at the same error, from the points above: between two of them the logarithm of the "
        "time is taken as linear in that of the error, along those points that no other one of the "
        "scheme beats in both. Where the fastest run of a scheme has less error already, its time "
        "counts. A dash is an error that the scheme did not come to.", "",
        *table(["error", "pseudo-time, order 1 [s]", "implicit, order 1 [s]",
                "implicit, order 2 [s]", f"pseudo-time to order 1, at most {MOST_PSEUDO:.2f}",
                "to order 2", "best of all [s]", f"best to order 1, at most {MOST_BEST:.2f}",
                "to order 2"], rows)]


def time_at(error: float, points: list[WearPoint]) -> float:
    """Time that a scheme takes for an error at most [s]; NaN where it did not come to it."""
    frontier: list[WearPoint] = []
    for p in sorted((p for p in points if not math.isnan(p.error)), key=lambda p: p.cpu):
        if not frontier or p.error < frontier[-1].error:
            frontier.append(p)
    if frontier and frontier[0].error <= error:
        return frontier[0].cpu
    for a, b in zip(frontier, frontier[1:]):
        if b.error <= error:
            share = math.log(a.error / error) / math.log(a.error / b.error)
            return a.cpu * (b.cpu / a.cpu)**share
    return math.nan


def cell(number: float) -> str:
    """Two digits; a dash where there is none."""
    return "-" if math.isnan(number) else f"{number:.2f}"


def judged(ratio: float, most: float) -> str:
    """A ratio and what it says of its target."""
    if math.isnan(ratio):
        return "-"
    return f"{ratio:.2f}: " + ("met" if ratio <= most else "missed")


def draw(path: Path, points: list[WearPoint], names: list[str]) -> None:
    """One line for each scheme."""
    figure, axes = new_figure()
    marks = ("o-", "s-", "^-", "v--", "D--", "x--", "*:", "P:", "<-.")
    for k, (name, mark) in enumerate(zip(names, marks)):
        found = [p for p in points if p.scheme == name and not math.isnan(p.error)]
        axes.plot([p.cpu for p in found], [p.error for p in found], mark,
                  color=COLOURS[k % len(COLOURS)], markersize=5, linewidth=1.1, label=name)
    axes.set(xscale="log", yscale="log", xlabel="processor time [s]",
             ylabel="error of the profile / largest depth")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.3)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8)
    figure.savefig(path)
