"""Iterations against frequency with every solver on the sector, as in the paper's figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bench.common.layout import COLOURS, milliseconds, table
from bench.common.measure import Bench, Run
from bench.paper.methods import INSTANTS, first_bending
from bench.solvers.many_starts import Solver

__all__ = ["draw_iterations", "iterations_table", "measure_iterations", "write_iterations"]

N_HARMONICS = 3
SHOWN = (Solver("newton"), Solver("powell"), Solver("kinsol"),
         Solver("pseudo_time", "rotated", "implicit_euler"),
         Solver("pseudo_time", "rotated", "bdf"),
         Solver("pseudo_time", "preconditioned", "implicit_euler"))


def measure_iterations(bench: Bench) -> dict[Solver, Run]:
    """The sweep of the table of methods, H = 3, from point to point without any fallback."""
    runs = {}
    for solver in SHOWN[:2] if bench.quick else SHOWN:
        groups = first_bending(N_HARMONICS, INSTANTS) | solver.groups
        groups["solver"] = groups["solver"] | {"fallback": False}
        runs[solver] = bench.run(groups)
    return runs


def write_iterations(images: Path, runs: dict[Solver, Run]) -> str:
    """Draw the picture; the text of the part."""
    draw_iterations(images / "benchmark_iterations.png", runs)
    return "\n".join([
        "## Iterations against frequency", "",
        f"The 50 frequencies of the table before, H = {N_HARMONICS}, {INSTANTS} instants, each "
        "point from the last one that converged (Newton, Powell and KINSOL: from the "
        "extrapolation of those before), `fallback = .false.`. Iterations are linear solutions; "
        "Powell's are exact derivatives, between which it updates. Points that did "
        "not converge are crosses at the iterations that were spent.", "",
        *iterations_table(runs), "",
        "![Iterations against frequency](images/benchmark_iterations.png)"])


def iterations_table(runs: dict[Solver, Run]) -> list[str]:
    """Lines of the table: iterations and times of every solver."""
    rows = [(solver.name, f"{int(run.converged.sum())} of {len(run.converged)}",
             int(run.iterations.sum()), int(run.iterations[run.converged].max(initial=0)),
             milliseconds(float(np.median(run.seconds)))) for solver, run in runs.items()]
    return table(["solver", "converged", "iterations", "most at a point",
                  "median time [ms/point]"], rows)


def draw_iterations(path: Path, runs: dict[Solver, Run]) -> None:
    """Iterations above the response."""
    figure = Figure(figsize=(7.4, 6.0), dpi=130, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    for (solver, run), colour, marker in zip(runs.items(), COLOURS, "os^Dvp"):
        hertz = run.omega / (2.0 * np.pi)
        good = run.converged
        upper.plot(hertz[good], np.maximum(run.iterations[good], 0.8), marker + "-", color=colour,
                   markersize=4, linewidth=1.0, label=solver.name)
        upper.plot(hertz[~good], run.iterations[~good], "x", color=colour)
    reference = next(iter(runs.values()))
    lower.plot(reference.omega / (2.0 * np.pi), reference.amplitude[:, 0], color="0.2")
    upper.set(yscale="log", ylabel="iterations")
    lower.set(xlabel="frequency [Hz]", ylabel="tip displacement [mm]")
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=3,
                  frameon=False, fontsize=8)
    figure.savefig(path)
