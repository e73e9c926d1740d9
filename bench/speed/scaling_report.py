"""The page of how time and memory grow with pairs and harmonics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from bench.common.layout import COLOURS, table
from bench.common.sector import COARSE
from bench.speed.scaling import (
    FEWEST_POINTS,
    HARMONICS,
    MORE_PAIRS,
    MORE_RUNS,
    MOST_POINTS,
    MOST_UNKNOWNS,
    N_TIME,
    PAPER_TIME,
    REPEATS,
    SMALL,
    SPACING,
    THREADED_RUNS,
    Measured,
    Scaling,
    Threads,
)
from bench.speed.small import write_small

__all__ = ["write_scaling"]

#: The ratio of 17 harmonics to one that is wanted, and the paper's.
WANTED_RATIO, PAPER_RATIO = 4.0, 521.0
#: Pairs and harmonics that have targets: seconds of a frequency and memory [MB]; speed-up wanted.
LARGEST, WANTED_SECONDS, WANTED_MEMORY, WANTED_THREADS = (768, 7), 3.0, 500.0, 1.7
#: Pairs and harmonics whose lines show where the growth comes from.
MIDDLE = 192, 7
#: Size of a real matrix of the order of the unknowns [MB] from where memory tells that none is.
TELLING = 200.0


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of a straight line through the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0]) if len(x) > 1 else math.nan


def write_scaling(images: Path, found: Scaling) -> str:
    """The part of the document."""
    rows = found.rows
    draw(images / "benchmark_scaling.png", rows)
    columns = ("pairs", "H", "unknowns", "in linear problems", "usable", "Newton steps",
               "GMRES iterations", "time [ms]", "set-up [s]", "memory [MB]", "full matrix [MB]",
               "time before [ms]", "steps before", "iterations before", "memory before [MB]")
    return "\n".join([
        "## Scaling", "",
        "Bladed-disk sector at 4400 rpm with finer and finer flanks and a mesh away from them that "
        f"is coarser than the default (`python -m fretwear.sector --pairs N {coarse_options()}`), "
        f"tip force 0.5 N, `n_time = {N_TIME}`, `linear = 'krylov'`, one thread; {MOST_POINTS} "
        f"frequencies around the peak, {SPACING:g} Hz apart ({FEWEST_POINTS} above {SMALL} "
        f"unknowns). Sizes of more than {MOST_UNKNOWNS} unknowns are left out: a frequency takes "
        f"minutes; {MORE_PAIRS} pairs are measured where their model has been generated. Steps, "
        "iterations and times are means of a frequency, times in processor seconds without the "
        "first frequency, which starts from the linear solution; "
        f"up to {SMALL} unknowns medians of {REPEATS} runs. "
        "Set-up is everything that is done once: reading the model, modes, room. Memory is "
        "the peak of the process; a real matrix of the order of the unknowns would take the "
        "column beside it alone. `Before` is another program in the same run, where one was given "
        "(`--before`).",
        "",
        *table(columns, ((r.pairs, r.n_harmonics, r.unknowns, r.unknowns_left,
                          f"{r.usable} of {r.points}", f"{r.newton:.1f}", f"{r.krylov:.0f}",
                          f"{1e3 * r.seconds:.3g}", f"{r.setup:.2f}", f"{r.memory:.0f}",
                          f"{r.full_matrix:.3g}", shown(1e3 * r.before),
                          shown(r.newton_before), shown(r.krylov_before),
                          shown(r.memory_before)) for r in rows)),
        "", "![Time and memory against pairs and harmonics](images/benchmark_scaling.png)", "",
        *largest_matrix(rows), "",
        *largest_size(rows),
        "### Exponents", "",
        "Least-squares slopes of the logarithms over all sizes of a line; beside them the slope "
        "of one GMRES iteration, which is free of how many steps and iterations a size takes. "
        "Targets: linear in H, no worse than quadratic in the pairs, 1.7 up to 384.",
        "", *exponents(rows), "", *reasons(rows), "",
        "### Many harmonics against one", "", *over_harmonics(found.paper), "",
        *two_threads(found.threads),
        *write_small(found.small),
        "### Finer flanks", "", *finer_flanks(rows)])


def shown(value: float) -> str:
    """Three digits, nothing where nothing was measured."""
    return "" if math.isnan(value) else f"{value:.3g}"


def largest_size(rows: list[Measured]) -> list[str]:
    """The largest size that has targets."""
    mine = [r for r in rows if (r.pairs, r.n_harmonics) == LARGEST]
    if not mine:
        return []
    (largest,) = mine
    said = [f"{value:.3g} {unit} ({'met' if value <= wanted else f'missed by {value - wanted:.2g}'}"
            f", at most {wanted:g})" for value, wanted, unit in
            ((largest.seconds, WANTED_SECONDS, "s a frequency"),
             (largest.memory, WANTED_MEMORY, "MB"))]
    return [f"{largest.pairs} pairs, H = {largest.n_harmonics}: {said[0]}, {said[1]}.", ""]


def two_threads(rows: list[Threads]) -> list[str]:
    """Wall times of one thread and of two."""
    if not rows:
        return []
    return ["### Two threads", "",
            f"Wall time of a frequency, the fastest of {THREADED_RUNS} runs each by turns "
            f"({MORE_RUNS} up to {SMALL} unknowns). Joints of fewer than 64 pairs stay in one "
            f"thread. Target: {WANTED_THREADS:g} times from 96 pairs on, never slower by more than "
            "2 %.", "",
            *table(("pairs", "H", "one thread [ms]", "two [ms]", "times"),
                   ((r.pairs, r.n_harmonics, f"{1e3 * r.one:.3g}", f"{1e3 * r.two:.3g}",
                     f"{r.one / r.two:.2f}") for r in rows)), ""]


def coarse_options() -> str:
    """The mesh away from the flanks, on the command line of the generator."""
    return " ".join(f"--{key} {value}" for key, value in COARSE.items())


def largest_matrix(rows: list[Measured]) -> list[str]:
    """Whether memory allows a matrix of the order of the unknowns."""
    large = [r for r in rows if r.full_matrix > TELLING]
    if not large:
        return []
    worst = max(large, key=lambda r: r.memory / r.full_matrix)
    if worst.memory >= worst.full_matrix:
        return [f"Memory does not rule out a matrix of the order of the unknowns at {worst.pairs} "
                f"pairs, H = {worst.n_harmonics}."]
    share = 100.0 * worst.memory / worst.full_matrix
    return ["There is no matrix of the order of the unknowns: where one would take more than "
            f"{TELLING:g} MB, the whole process takes {share:.0f} % of it at most ({worst.pairs} "
            f"pairs, H = {worst.n_harmonics})."]


def exponents(rows: list[Measured]) -> list[str]:
    """Tables of slopes over pairs for each H, and over H for each number of pairs."""
    lines = []
    for fixed, varied, target, most in (("n_harmonics", "pairs", 2.0, math.inf),
                                        ("n_harmonics", "pairs", 1.7, 384),
                                        ("pairs", "n_harmonics", 1.0, math.inf)):
        cells = []
        for value in sorted({getattr(r, fixed) for r in rows}):
            mine = [r for r in rows if getattr(r, fixed) == value and getattr(r, varied) <= most]
            x = [getattr(r, varied) for r in mine]
            slopes = [exponent(x, y) for y in ([r.seconds for r in mine],
                                               [r.seconds / max(r.krylov, 1.0) for r in mine],
                                               [r.memory for r in mine])]
            verdict = "met" if slopes[0] <= target else f"missed by {slopes[0] - target:.2f}"
            cells.append((value, *(f"{slope:.2f}" for slope in slopes), f"{target:g}: {verdict}"))
        names = {"pairs": "pairs", "n_harmonics": "H"}
        over = names[varied] + (f" up to {most:g}" if math.isfinite(most) else "")
        lines += [*table((names[fixed], f"time over {over}", f"time of an iteration over {over}",
                          f"memory over {over}", "target of the time"), cells), ""]
    return lines[:-1]


def reasons(rows: list[Measured]) -> list[str]:
    """What of the growth is no work of an iteration."""
    pairs = [r for r in rows if r.n_harmonics == MIDDLE[1]]
    harmonics = [r for r in rows if r.pairs == MIDDLE[0]]
    if len(pairs) < 2 or len(harmonics) < 2:
        return []
    (few, many), (low, high) = ((line[0], line[-1]) for line in (pairs, harmonics))
    return [f"What is above the targets is the number of steps and iterations: from {few.pairs} to "
            f"{many.pairs} pairs (H = {few.n_harmonics}) the Newton steps of a frequency grow from "
            f"{few.newton:.1f} to {many.newton:.1f}, because more pairs change between stick and "
            f"slip on the way, and the GMRES iterations of a step from "
            f"{few.krylov / few.newton:.0f} to {many.krylov / many.newton:.0f}. From H = "
            f"{low.n_harmonics} to {high.n_harmonics} ({low.pairs} pairs) the steps grow from "
            f"{low.newton:.1f} to {high.newton:.1f}, and the iterations of a step from "
            f"{low.krylov / low.newton:.0f} to {high.krylov / high.newton:.0f}: the preconditioner "
            "takes each harmonic by itself, and slip couples them."]


def over_harmonics(paper: list[Measured]) -> list[str]:
    """What many harmonics cost with the instants of the paper."""
    few, many = paper
    ratio = many.seconds / few.seconds
    verdict = "met" if ratio <= WANTED_RATIO else "missed"
    return [f"{few.pairs} pairs, `n_time = {PAPER_TIME}`: H = {many.n_harmonics} takes "
            f"{1e3 * many.seconds:.3g} ms, H = {few.n_harmonics} takes {1e3 * few.seconds:.3g} ms, "
            f"{ratio:.1f} times less (target at most {WANTED_RATIO:g}: {verdict}; "
            f"{PAPER_RATIO:g} in the paper's table)."]


def finer_flanks(rows: list[Measured]) -> list[str]:
    """That all sizes are the same sector: stuck frequency and peak, H = 3."""
    mine = [r for r in rows if r.n_harmonics == HARMONICS[1]]
    finest = mine[-1]
    return ["All sizes are the same sector on meshes that follow the flanks: first frequency with "
            "every pair stuck, and peak of the tip at the frequencies measured, H = 3.", "",
            *table(("pairs", "stuck [Hz]", "of the finest", "peak [mm]", "of the finest"),
                   ((r.pairs, f"{r.stuck:.1f}", f"{100 * (r.stuck / finest.stuck - 1):+.2f} %",
                     f"{r.peak:.4f}", f"{100 * (r.peak / finest.peak - 1):+.1f} %")
                    for r in mine))]


def draw(path: Path, rows: list[Measured]) -> None:
    """Time against pairs and against harmonics, memory against pairs."""
    figure = Figure(figsize=(9.6, 3.6), dpi=130, layout="constrained")
    over_pairs, over_h, memory = figure.subplots(1, 3)
    by_harmonics = [(f"H = {n}", [r for r in rows if r.n_harmonics == n])
                    for n in sorted({r.n_harmonics for r in rows})]
    by_pairs = [(f"{n} pairs", [r for r in rows if r.pairs == n])
                for n in sorted({r.pairs for r in rows})]
    plot(over_pairs, by_harmonics, "pairs", "seconds", 2.0)
    plot(over_h, by_pairs, "n_harmonics", "seconds", 1.0)
    plot(memory, by_harmonics, "pairs", "memory", None)
    over_pairs.set(xlabel="contact pairs", ylabel="time of a frequency [s]")
    over_h.set(xlabel="harmonics H", ylabel="time of a frequency [s]")
    memory.set(xlabel="contact pairs", ylabel="memory of the process [MB]")
    for axes in (over_pairs, over_h):
        axes.legend(frameon=False, fontsize=7, ncol=3, loc="lower center",
                    bbox_to_anchor=(0.5, 1.0), columnspacing=1.0)
    figure.savefig(path)


def plot(axes: Axes, lines: list[tuple[str, list[Measured]]], x: str, y: str,
         slope: float | None) -> None:
    """Lines in double logarithmic axes, and the slope that is wanted as a dashed one."""
    for colour, (label, mine) in zip(COLOURS, lines):
        axes.loglog([getattr(r, x) for r in mine], [getattr(r, y) for r in mine], "o-", ms=3.5,
                    lw=1.2, color=colour, label=label)
    ticks = sorted({getattr(r, x) for _, mine in lines for r in mine})
    if slope is not None:
        # Below the lowest line, so that it crosses none.
        lowest = min(getattr(r, y) / getattr(r, x)**slope for _, mine in lines for r in mine)
        ends = np.array([ticks[0], ticks[-1]], dtype=float)
        axes.loglog(ends, 0.6 * lowest * ends**slope, "--", color="0.5", lw=1.0,
                    label=f"slope {slope:g}")
    axes.set_xticks(ticks, [str(t) for t in ticks])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(alpha=0.3)
