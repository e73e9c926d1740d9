"""Time of 50 frequencies with every method, as in table 1 of Salles et al. (2011)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bench.common.layout import table
from bench.common.measure import Bench, Floats, Groups, Run
from bench.common.sector import case

__all__ = ["HARMONICS", "INSTANTS", "METHODS", "PAPER_H17", "Cell", "find_cell", "first_bending",
           "measure_methods", "methods_table", "write_methods"]

HARMONICS = (1, 3, 7, 17)
#: Instants of the paper where they are not 2H+1.
INSTANTS = 105
METHODS = {"hbm": "HBM", "tcm": "TCM", "tcm_least_squares": "TCM, least squares", "hdhb": "HDHB"}
#: HBM, H = 17 in the paper's table, of HBM, H = 1.
PAPER_H17 = 521.0
N_POINTS = 50
#: Runs of each cell. Of every point the fastest counts: what else the machine does only adds.
SAMPLES = 5
#: Method, whether with 2H+1 instants, H.
Sort = tuple[str, bool, int]


@dataclass(frozen=True)
class Cell:
    """Time of a sweep [s]."""

    method: str
    few_instants: bool
    n_harmonics: int
    seconds: float
    run: Run


def first_bending(n_harmonics: int, n_time: int, method: str = "hbm") -> Groups:
    """50 frequencies around the first bending mode of the sector with 16 pairs, 4400 rpm."""
    sweep = {"start": 1016.0, "end": 1029.0, "n_points": N_POINTS, "unit": "Hz"}
    groups = case(16, n_harmonics, sweep)
    groups["harmonics"] = {"method": method, "n_harmonics": n_harmonics, "n_time": n_time}
    groups["output"] = {"observe": "tip"}
    return groups


def measure_methods(bench: Bench) -> list[Cell]:
    """Every cell in turn, several times over, so that a change of the load meets all of them."""
    samples: dict[Sort, list[Floats]] = {sort: [] for sort in sorts(bench.quick)}
    runs: dict[Sort, Run] = {}
    for _ in range(1 if bench.quick else SAMPLES):
        for method, few_instants, n_harmonics in samples:
            n_time = 2 * n_harmonics + 1 if few_instants else INSTANTS
            run = bench.run(first_bending(n_harmonics, n_time, method))
            samples[method, few_instants, n_harmonics].append(run.seconds)
            runs[method, few_instants, n_harmonics] = run
    return [Cell(*sort, float(np.min(samples[sort], axis=0).sum()), runs[sort])
            for sort in samples]


def find_cell(cells: list[Cell], method: str, few_instants: bool, n_harmonics: int) -> Cell | None:
    """A cell of the table, None where it was not measured."""
    return next((cell for cell in cells if (cell.method, cell.few_instants, cell.n_harmonics)
                 == (method, few_instants, n_harmonics)), None)


def sorts(quick: bool) -> list[Sort]:
    """Methods with as many instants as they take. With 2H+1 of them least squares is collocation,
    and HDHB takes no other number."""
    return [(method, few_instants, n_harmonics)
            for method in METHODS for few_instants in (False, True)
            if not (method == "hdhb" and not few_instants)
            and not (method == "tcm_least_squares" and few_instants)
            for n_harmonics in (HARMONICS[:2] if quick else HARMONICS)]


def unit_of(cells: list[Cell]) -> float:
    """Time of HBM, H = 1, 105 instants [s], to which the table is normalised."""
    unit = find_cell(cells, "hbm", False, 1)
    return unit.seconds if unit else math.nan


def methods_table(cells: list[Cell]) -> list[str]:
    """Lines of table 1: normalised times."""
    unit = unit_of(cells)
    rows = []
    for method, name in METHODS.items():
        for few_instants in (False, True):
            found = [find_cell(cells, method, few_instants, h) for h in HARMONICS]
            if any(found):
                rows.append((name, "2H+1" if few_instants else INSTANTS,
                             *(cell_text(cell, unit) for cell in found)))
    return table(["method", "n_time", *(f"H = {h}" for h in HARMONICS)], rows)


def write_methods(cells: list[Cell]) -> str:
    """The text of the part."""
    unit = unit_of(cells)
    largest = find_cell(cells, "hbm", False, HARMONICS[-1])
    ours = largest.seconds / unit if largest else math.nan
    return "\n".join([
        "## Methods: time of 50 frequencies", "",
        "The paper's table 1 on the sector with 16 pairs: 50 frequencies from 1016 to 1029 Hz "
        "around the first bending mode at 4400 rpm, tip force 0.5 N, Newton's method. Time of "
        f"the solutions over that of HBM with H = 1 and {INSTANTS} instants ({1e3 * unit:.3g} ms), "
        f"of every point the fastest of {SAMPLES} runs; "
        "then points converged where not all did, and iterations. With 2H+1 instants the methods "
        "are the same equations in other unknowns; with so few instants at H = 1 they say "
        "little about the joint (see [aliasing](#aliasing)).", "",
        *methods_table(cells), "",
        f"HBM, H = 17: {ours:.3g} here, {PAPER_H17:g} in the paper's table. Here stuck pairs "
        "leave the linear problems, and GMRES with a preconditioner for each harmonic solves what "
        "remains: the cost grows about linearly with H, that of a dense Jacobian with H**3."])


def cell_text(cell: Cell | None, unit: float) -> str:
    """Normalised time, and what it was spent on."""
    if cell is None:
        return "-"
    converged = int(cell.run.converged.sum())
    text = f"{cell.seconds / unit:.2f} ("
    if converged < len(cell.run.converged):
        text += f"{converged} of {len(cell.run.converged)} converged, "
    return text + f"{int(cell.run.iterations.sum())} it)"
