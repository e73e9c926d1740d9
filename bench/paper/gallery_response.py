"""The paper's responses of the first bending mode: methods, harmonics, time, a cycle at resonance,
iterations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.common.layout import table
from bench.common.measure import Bench, Floats, Run
from bench.paper.aliasing import draw_cycles, measure_cycles
from bench.paper.gallery_text import beside, new_figure, percent, picture, save
from bench.paper.methods import (
    HARMONICS,
    INSTANTS,
    METHODS,
    PAPER_H17,
    Cell,
    find_cell,
    measure_methods,
    methods_table,
)
from bench.solvers.iterations import draw_iterations, iterations_table, measure_iterations
from bench.solvers.many_starts import Solver
from fretwear.plot.style import PALETTE, tidy

__all__ = ["Response", "measure_response", "write_response"]

#: Curves of the picture: method, whether with 2H+1 instants, line.
CURVES = (("hbm", False, "-"), ("tcm", False, "--"), ("tcm_least_squares", False, "-."),
          ("hdhb", True, "o"))


@dataclass(frozen=True)
class Response:
    """Sweeps of table 1, cycles of a pair at resonance, and sweeps of every solver."""

    cells: list[Cell]
    cycles: dict[tuple[str, int], Floats]
    pair: int
    solvers: dict[Solver, Run]

    @property
    def best(self) -> Run:
        """HBM with the most harmonics, the measure of all others."""
        return next(cell.run for cell in reversed(self.cells)
                    if (cell.method, cell.few_instants) == ("hbm", False))

    def deviation(self, cell: Cell) -> float:
        """Largest difference of a curve from the best, as a part of the peak."""
        good = cell.run.converged & self.best.converged
        gap = np.abs(cell.run.amplitude[good, 0] - self.best.amplitude[good, 0])
        return float(gap.max() / self.best.amplitude[:, 0].max())


def measure_response(bench: Bench) -> Response:
    """All of it."""
    cells = measure_methods(bench)
    response = Response(cells, {}, 0, {})
    peak = float(response.best.omega[np.argmax(response.best.amplitude[:, 0])])
    return Response(cells, *measure_cycles(bench, peak), measure_iterations(bench))


def write_response(folder: Path, data: Response) -> str:
    """Draw the pictures; the text of the part."""
    draw_curves(folder / "response.png", data)
    draw_cycles(folder / "cycle.png", data.cycles)
    draw_iterations(folder / "iterations.png", data.solvers)
    return "\n".join([
        "## Response of the first bending mode", "",
        f"16 pairs (8 per flank), 4400 rpm, 0.5 N at the tip, 50 frequencies, {INSTANTS} instants "
        "a period for HBM and TCM, 2H+1 for HDHB.",
        *picture("response.png", "tip displacement against frequency by every method"),
        "Largest difference of a curve from HBM with the most harmonics, as a part of the peak:",
        "", *deviation_table(data), "", *beside(*response_rows(data)), "",
        "### Table 1: time of 50 frequencies", "",
        f"Over that of HBM with H = 1 and {INSTANTS} instants; in brackets the iterations.", "",
        *methods_table(data.cells), "", *beside(*time_rows(data)), "",
        "### Tangential displacement of a pair over a cycle at resonance", "",
        f"Pair {data.pair + 1}, which moves most; the mean is where the static load holds it.",
        *picture("cycle.png", "tangential displacement over a cycle by HBM and HDHB"),
        *beside(*cycle_rows(data)), "",
        "### Iterations against frequency", "",
        "H = 3, every point from the one before, no fallback. Iterations are linear solutions.",
        *picture("iterations.png", "iterations against frequency with every solver"),
        *iterations_table(data.solvers), "", *beside(*solver_rows(data))])


def draw_curves(path: Path, data: Response) -> None:
    """One panel for each H."""
    harmonics = sorted({cell.n_harmonics for cell in data.cells})
    figure = new_figure(9.0, 3.2 * ((len(harmonics) + 1) // 2) + 0.6)
    panels = figure.subplots((len(harmonics) + 1) // 2, 2, sharex=True, sharey=True, squeeze=False)
    for axes, h in zip(panels.flat, harmonics):
        for (method, few, style), colour in zip(CURVES, PALETTE):
            cell = find_cell(data.cells, method, few, h)
            if cell is None:
                continue
            good = cell.run.converged
            axes.plot(cell.run.omega[good] / (2.0 * np.pi), cell.run.amplitude[good, 0], style,
                      color=colour, markersize=3, linewidth=1.4, label=METHODS[method])
        axes.set_title(f"H = {h}", fontsize=10)
        axes.set_ylim(bottom=0.0)
        tidy(axes)
    for axes in panels[-1]:
        axes.set_xlabel("frequency [Hz]")
    for axes in panels[:, 0]:
        axes.set_ylabel("tip displacement [mm]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4,
                  frameon=False)
    save(figure, path)


def deviation_table(data: Response) -> list[str]:
    """Lines of a table: how far every method is from the best curve."""
    rows = []
    for method, few, _ in CURVES:
        found = [find_cell(data.cells, method, few, h) for h in HARMONICS]
        rows.append((METHODS[method], *(percent(data.deviation(cell)) if cell else "-"
                                        for cell in found)))
    return table(["method", *(f"H = {h}" for h in HARMONICS)], rows)


def value_of(data: Response, method: str, few_instants: bool, n_harmonics: int) -> float:
    """Difference from the best; nan where it was not measured."""
    cell = find_cell(data.cells, method, few_instants, n_harmonics)
    return data.deviation(cell) if cell else np.nan


def response_rows(data: Response) -> list[tuple[str, str, str]]:
    """What the curves say."""
    first, last = (value_of(data, "hdhb", True, h) for h in (HARMONICS[0], HARMONICS[-1]))
    single = value_of(data, "hbm", False, HARMONICS[0])
    collocated = value_of(data, "tcm", False, HARMONICS[0])
    return [
        ("the aliasing of HDHB vanishes as H grows (figures for H = 1, 3, 7, 17)",
         f"with H = {HARMONICS[-1]}, HDHB is within {percent(last)} of HBM",
         "agrees" if last < 0.02 else "disagrees"),
        ("HDHB with few harmonics is wrong by its aliasing",
         f"with H = {HARMONICS[0]}, HDHB is off by {percent(first)}, HBM by {percent(single)}",
         "agrees" if first > 5.0 * single else "disagrees"),
        (f"TCM with {INSTANTS} instants is compared too",
         f"with H = {HARMONICS[0]}, TCM is off by {percent(collocated)}: what it collocates is "
         "2H+1 instants out of many, so it aliases too",
         "between the two" if single <= collocated <= first else "worst of all"),
    ]


def time_rows(data: Response) -> list[tuple[str, str, str]]:
    """What table 1 says."""
    unit = find_cell(data.cells, "hbm", False, 1)
    most = find_cell(data.cells, "hbm", False, HARMONICS[-1])
    ours = most.seconds / unit.seconds if most and unit else np.nan
    few = find_cell(data.cells, "hdhb", True, 7)
    many = find_cell(data.cells, "hbm", False, 7)
    ratio = few.seconds / many.seconds if few and many else np.nan
    return [
        (f"HBM with H = 17 takes {PAPER_H17:g} times as long as with H = 1",
         f"{ours:.3g} times: stuck pairs leave the linear problems, and GMRES with a "
         "preconditioner for each harmonic solves the rest, so that no matrix of all unknowns is "
         "factorised", "disagrees, in our favour"),
        ("2H+1 instants are compared with 105",
         f"HDHB with H = 7 takes {percent(ratio)} of the time of HBM",
         "cheaper" if ratio < 1.0 else "no cheaper"),
    ]


def cycle_rows(data: Response) -> list[tuple[str, str, str]]:
    """What the cycles say."""
    best = data.cycles.get(("hbm", 17))
    if best is None:
        return []
    swing = np.linalg.norm(best[1:])

    def distance(method: str, n_harmonics: int) -> float:
        found = data.cycles[method, n_harmonics]
        shared = min(len(found), len(best))
        return float(np.linalg.norm((found[:shared] - best[:shared])[1:]) / swing)

    seven, more = distance("hdhb", 7), distance("hdhb", 17)
    return [("compares HBM-7, HDHB-7 and HDHB-17",
             f"away from HBM with H = 17 (norm of the harmonics): HBM-7 "
             f"{percent(distance('hbm', 7))}, HDHB-7 {percent(seven)}, HDHB-17 {percent(more)}",
             "the aliasing vanishes with H" if more < seven else "the aliasing stays")]


def solver_rows(data: Response) -> list[tuple[str, str, str]]:
    """What the iterations say."""
    newton = data.solvers[Solver("newton")]
    pseudo = data.solvers.get(Solver("pseudo_time", "rotated", "implicit_euler"))
    if pseudo is None:
        return []
    ratio = float(np.median(pseudo.seconds) / np.median(newton.seconds))
    return [("pseudo-time is faster than Newton solvers",
             f"from a good start it takes {pseudo.iterations.sum()} linear solutions against "
             f"{newton.iterations.sum()} of Newton's method, and {ratio:.0f} times its time; what "
             "it buys is starts from which Newton's method fails (see "
             "[benchmarks](../benchmarks/solvers.md))",
             "disagrees" if ratio > 1.0 else "agrees")]
