"""Wear at 3600 rpm, as in the paper: depth of every pair by the implicit scheme and by pseudo-time,
the tip before and after, the way there, and the response of the worn joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from bench.common.layout import table
from bench.common.measure import Bench, Floats, Run
from bench.common.sector import case
from bench.common.wear_runs import (
    FAST,
    N_PAIRS,
    WearRun,
    difference,
    first_tangent,
    run_wear,
    stage_order,
    steps_of,
)
from bench.paper.gallery_text import beside, new_figure, percent, picture, save
from fretwear.plot import plot_wear_evolution, plot_wear_maps
from fretwear.plot.style import PALETTE, tidy
from fretwear.rows import synthesis

__all__ = ["Wear", "draw_profiles", "measure_wear", "write_wear"]

#: Steps of the largest depth, as a part of the final one.
STEPS = 20
#: Error of the run that says what the final depth is.
TOLERANCE, QUICK_TOLERANCE = 1e-4, 1e-2
#: Part of the time of the implicit scheme that pseudo-time takes in the paper.
PAPER_SHARE = 0.29
#: Times that were aimed at [s].
AIM_IMPLICIT, AIM_PSEUDO = 2.0, 0.5


@dataclass(frozen=True)
class Wear:
    """Runs to the steady state, and responses before and after."""

    reference: WearRun
    implicit: WearRun
    pseudo: WearRun
    unworn: Run
    worn: Run

    @property
    def share_of_solves(self) -> float:
        """Linear solutions of pseudo-time over those of the implicit scheme."""
        return self.pseudo.n_solves / self.implicit.n_solves

    @property
    def pair(self) -> int:
        """The pair that wears most, from 0."""
        return int(np.argmax(self.implicit.depth))


def measure_wear(bench: Bench) -> Wear:
    """The three runs and the two sweeps."""
    tolerance = QUICK_TOLERANCE if bench.quick else TOLERANCE
    reference = run_wear(bench, "wear_reference", stage_order(2, tolerance))
    step = reference.deepest / STEPS
    implicit = run_wear(bench, "wear_implicit", steps_of("implicit", step))
    pseudo = run_wear(bench, "wear_pseudo_time", steps_of("pseudo_time", step))
    return Wear(reference, implicit, pseudo, sweep(bench, np.zeros(N_PAIRS)),
                sweep(bench, implicit.depth))


def sweep(bench: Bench, depth: Floats) -> Run:
    """Response around the resonance of a joint that is worn and wears no further."""
    groups = case(N_PAIRS, 3, {"start": FAST.resonance - 4.0, "end": FAST.resonance + 6.0,
                               "n_points": 11 if bench.quick else 101, "unit": "Hz"},
                  speed=FAST.speed)
    # The gap of the unworn sector is zero everywhere.
    groups["contact"] = {"gap": [float(value) for value in depth]}
    groups["output"] = {"observe": "tip"}
    return bench.run(groups)


def write_wear(folder: Path, data: Wear) -> str:
    """Draw the pictures; the text of the part."""
    for run in (data.reference, data.implicit, data.pseudo):
        if not run.is_steady:
            raise RuntimeError(f"{run.result.path}: steady state {run.result.steady_state}")
    draw_profiles(folder / "wear_depth.png", {"implicit scheme": data.implicit,
                                              "pseudo-time": data.pseudo})
    save(plot_wear_maps(data.implicit.result), folder / "wear_maps.png")
    save(plot_wear_evolution(data.implicit.result), folder / "wear_evolution.png")
    draw_tip(folder / "wear_tip.png", data)
    draw_way(folder / "wear_way.png", data)
    draw_responses(folder / "wear_response.png", data)
    return "\n".join([
        "## Wear at 3600 rpm", "",
        f"{N_PAIRS} pairs (24 per flank), H = 3, 0.5 N at the tip, at {FAST.resonance:g} Hz, the "
        "resonance of the unworn joint, to the steady state (largest rate below 1e-6 of the "
        f"first). Steps let the largest depth grow by 1/{STEPS} of what it ends with.", "",
        "### Depth of every pair",
        *picture("wear_depth.png", "wear depth of every pair on both flanks by either scheme"),
        *picture("wear_maps.png", "wear depth on the flanks"),
        *work_table(data), "", *beside(*profile_rows(data)), "",
        "### The way to the steady state",
        *picture("wear_way.png", "largest depth and first tangential harmonic against linear "
                 "solutions"),
        *beside(*way_rows(data)), "",
        "Over real cycles, which the implicit scheme follows:",
        *picture("wear_evolution.png", "depth, rate and amplitude over the cycles"),
        "### The tip before and after",
        *picture("wear_tip.png", "tip displacement over a cycle before and after wear"),
        *picture("wear_response.png", "frequency response before and after wear"),
        *beside(*tip_rows(data))])


#: Runs that stand side by side as bars; of more each is a curve over the pairs.
MOST_BARS = 3


def draw_profiles(path: Path, runs: dict[str, WearRun],
                  starts: Mapping[str, Floats] | None = None) -> None:
    """Bars of every pair, a panel for each flank; on top of what the runs started from."""
    first = next(iter(runs.values()))
    patch = first.result["contact/patch"]
    names = list(dict.fromkeys(str(name) for name in patch))
    figure = new_figure(9.0, 2.5 * len(names) + 0.7)
    panels = figure.subplots(len(names), 1, sharey=True, squeeze=False).ravel()
    width = 0.84 / len(runs)
    as_bars = len(runs) <= MOST_BARS
    for axes, name in zip(panels, names):
        pairs = np.flatnonzero(patch == name)
        for k, (title, run) in enumerate(runs.items()):
            profile = run.depth + (starts[title] if starts else 0.0)
            if not as_bars:
                axes.plot(pairs + 1, 1e3 * profile[pairs], ("-", "--", "-.", ":", "-")[k % 5],
                          marker="osD^vP"[k % 6], markersize=4, linewidth=1.0,
                          color=PALETTE[k % len(PALETTE)], label=title)
                continue
            axes.bar(pairs + 1 + (k - 0.5 * (len(runs) - 1)) * width, 1e3 * profile[pairs],
                     width, color=PALETTE[k % len(PALETTE)], label=title)
        axes.set_title(name, fontsize=10, loc="left")
        axes.set_ylabel("wear depth [µm]")
        axes.set_ylim(bottom=0.0)
        axes.set_xlim(pairs[0] + 0.4, pairs[-1] + 1.6)
        axes.set_xticks(pairs[::2] + 1)
        tidy(axes)
    panels[-1].set_xlabel("pair")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center",
                  ncols=min(4, len(runs)), frameon=False)
    save(figure, path)


def draw_tip(path: Path, data: Wear) -> None:
    """Displacement of the tip over a cycle, first and last step."""
    degrees = np.linspace(0.0, 360.0, 361)
    result = data.implicit.result
    series = synthesis(result.coefficients.shape[1], np.radians(degrees))
    figure = new_figure(7.0, 3.8)
    axes = figure.subplots()
    axes.plot(degrees, result.coefficients[0, :, 0] @ series, color=PALETTE[0], label="unworn")
    for title, run, style in (("worn, implicit scheme", data.implicit, "-"),
                              ("worn, pseudo-time", data.pseudo, "--")):
        axes.plot(degrees, run.result.coefficients[-1, :, 0] @ series, style,
                  color=PALETTE[1 if style == "-" else 2], label=title)
    axes.set(xlabel="phase of the excitation [degrees]", ylabel="tip displacement [mm]",
             xlim=(0.0, 360.0), xticks=range(0, 361, 60))
    tidy(axes)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3,
                  frameon=False)
    save(figure, path)


def draw_way(path: Path, data: Wear) -> None:
    """Largest depth and first tangential harmonic against the linear solutions so far."""
    figure = new_figure(7.0, 5.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for title, run, colour in (("implicit scheme", data.implicit, PALETTE[0]),
                               ("pseudo-time", data.pseudo, PALETTE[1])):
        solves = np.cumsum(run.result.iterations) - run.result.iterations[0]
        upper.plot(solves, 1e3 * run.result.depth.max(axis=1), ".-", color=colour, label=title)
        lower.plot(solves, 1e3 * first_tangent(run, data.pair), ".-", color=colour)
    upper.set_ylabel("largest depth [µm]")
    lower.set(xlabel="linear solutions",
              ylabel=f"first tangential harmonic\nof pair {data.pair + 1} [µm]")
    for axes in (upper, lower):
        tidy(axes)
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=2,
                  frameon=False)
    save(figure, path)


def draw_responses(path: Path, data: Wear) -> None:
    """Frequency response of the unworn and of the worn joint."""
    figure = new_figure(7.0, 3.8)
    axes: Axes = figure.subplots()
    for (title, run), colour in zip({"unworn": data.unworn, "worn": data.worn}.items(), PALETTE):
        good = run.converged
        axes.plot(run.omega[good] / (2.0 * np.pi), run.amplitude[good, 0], color=colour,
                  label=title)
    axes.axvline(FAST.resonance, color="0.6", linestyle=":", label="frequency of the wear")
    axes.set(xlabel="frequency [Hz]", ylabel="tip displacement [mm]")
    tidy(axes)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3,
                  frameon=False)
    save(figure, path)


def work_table(data: Wear) -> list[str]:
    """Lines of a table: what each run took and left."""
    rows = [(title, run.n_steps, run.n_rejected, run.n_solves, run.n_krylov, f"{run.cpu:.2f}",
             f"{1e3 * run.deepest:.4f}", run.n_worn, percent(difference(run.depth,
                                                                        data.reference.depth)))
            for title, run in (("implicit scheme", data.implicit), ("pseudo-time", data.pseudo),
                               ("reference: order 2, error-controlled", data.reference))]
    return table(["run", "steps", "rejected", "linear solutions", "Krylov iterations",
                  "processor time [s]", "largest depth [µm]", "worn pairs",
                  "largest difference from the reference"], rows)


def profile_rows(data: Wear) -> list[tuple[str, str, str]]:
    """What the profiles and their cost say."""
    apart = difference(data.pseudo.depth, data.implicit.depth)
    time_share = data.pseudo.cpu / data.implicit.cpu
    return [
        ("the implicit scheme and pseudo-time end at the same depths",
         f"they differ by {percent(apart)} of the largest depth",
         "agrees" if apart < 0.01 else "disagrees"),
        (f"pseudo-time takes {percent(PAPER_SHARE)} of the time of the implicit scheme",
         f"{percent(data.share_of_solves)} of its linear solutions, "
         f"{percent(data.pseudo.n_krylov / data.implicit.n_krylov)} of its Krylov iterations and "
         f"{percent(time_share)} of its processor time (whole programs)",
         " ".join((agreement(data.share_of_solves), "in linear solutions,",
                   agreement(time_share), "in time"))),
        ("(the aim here: below 2 s and 0.5 s)",
         f"implicit {data.implicit.cpu:.2f} s, pseudo-time {data.pseudo.cpu:.2f} s in one thread",
         "reached" if data.implicit.cpu < AIM_IMPLICIT and data.pseudo.cpu < AIM_PSEUDO
         else "missed"),
    ]


def agreement(share: float) -> str:
    """Whether pseudo-time takes as small a share as in the paper, or nearly."""
    return "agrees" if share < 1.15 * PAPER_SHARE else "disagrees"


def way_rows(data: Wear) -> list[tuple[str, str, str]]:
    """What the way says."""
    return [("shows the largest depth and the first tangential harmonic of a pair against "
             "iterations",
             f"{data.pseudo.n_solves} against {data.implicit.n_solves} linear solutions, over the "
             "same depths; steps in pseudo-time are no cycles, so only the end of that way means "
             "something", "pseudo-time arrives first" if data.share_of_solves < 1.0
             else "pseudo-time arrives last")]


def tip_rows(data: Wear) -> list[tuple[str, str, str]]:
    """What the tip says."""
    before, after = data.implicit.swing[[0, -1]]
    (low, first), (high, last) = (peak_of(run) for run in (data.unworn, data.worn))
    return [("shows the tip displacement over a cycle",
             f"half its swing goes from {before:.3f} to {after:.3f} mm "
             f"({100.0 * (after / before - 1.0):+.0f} %) at the frequency of the wear; the peak "
             f"of the response moves from {first:.1f} to {last:.1f} Hz and from {low:.3f} to "
             f"{high:.3f} mm, so that a worn joint is {'worse' if high > low else 'better'} off "
             "where the excitation follows it",
             "wear detunes the blade" if after < before else "wear tunes the blade")]


def peak_of(run: Run) -> tuple[float, float]:
    """Largest amplitude [mm], and where [Hz]."""
    point = int(np.argmax(np.where(run.converged, run.amplitude[:, 0], 0.0)))
    return float(run.amplitude[point, 0]), float(run.omega[point] / (2.0 * np.pi))
