"""Where the time of a sweep goes, against the floor of it, and what idle threads cost. Processor
times, which other programs disturb less than times by the clock."""

from __future__ import annotations

import os
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bench.common.layout import milliseconds, table
from bench.common.measure import Bench, Groups, write_namelist
from bench.common.programs import run_program
from bench.common.sector import PAIRS, case, near_peak
from bench.speed import scaling

__all__ = ["Limit", "Part", "ThreadCost", "downwards", "measure_limit",
           "processor", "write_limit"]

#: Of the second thread.
THREAD_HARMONICS = (3, 7, 17)
REPEATS = 3
N_POINTS = 21
#: A sweep is to take at most this multiple of its floor.
TARGET = 1.3
#: What a second thread may cost on joints too small for it.
THREAD_TARGET = 1.05
#: Run before a point is solved; not part of a sweep.
CONSTRUCTION = "first matrices"


@dataclass(frozen=True)
class Part:
    """A part of a frequency: its calls, its processor time and that of its floor [s]."""

    name: str
    calls: float
    seconds: float
    floor: float


@dataclass(frozen=True)
class ThreadCost:
    """Processor time of a sweep with one thread, with two allowed, and with two of BLAS too [s]."""

    pairs: int
    n_harmonics: int
    one: float
    two: float
    two_of_blas: float


@dataclass(frozen=True)
class Limit:
    """All of it; splits by (pairs, harmonics)."""

    splits: dict[tuple[int, int], list[Part]]
    threads: list[ThreadCost]


def measure_limit(bench: Bench, program: Path, step: Callable[[str], None]) -> Limit:
    """Run the program of the floor, and fw_run with threads."""
    splits = {}
    for pairs in scaling.PAIRS[:2] if bench.quick else scaling.PAIRS:
        step(f"{pairs} pairs")
        for n in scaling.HARMONICS[:2] if bench.quick else scaling.HARMONICS:
            if scaling.unknowns_of(pairs, n) <= scaling.MOST_UNKNOWNS:
                splits[pairs, n] = measure_split(bench, program, pairs, n)
    step("a second thread")
    threads = []
    if len(os.sched_getaffinity(0)) > 1:
        for pairs in PAIRS:
            for n in THREAD_HARMONICS[:1] if bench.quick else THREAD_HARMONICS:
                groups = case(pairs, n, near_peak(pairs))
                threads.append(ThreadCost(pairs, n, processor(bench, groups),
                                          processor(bench, groups, threads=2),
                                          processor(bench, groups, threads=2, blas_threads=2)))
    return Limit(splits, threads)


def measure_split(bench: Bench, program: Path, pairs: int, n_harmonics: int) -> list[Part]:
    """A frequency of a sweep through the peak, by its parts: medians over repeated sweeps."""
    is_small = scaling.unknowns_of(pairs, n_harmonics) <= scaling.SMALL and not bench.quick
    n_points = N_POINTS if is_small else scaling.FEWEST_POINTS
    path = bench.folder / "limit.nml"
    write_namelist(path, scaling.groups_of(bench, pairs, n_harmonics, n_points)[0])
    runs = [run_program(program, path) for _ in range(REPEATS if is_small else 1)]
    return [Part(rows[0]["part"], int(rows[0]["calls"]) / n_points,
                 statistics.median(float(row["seconds"]) for row in rows) / n_points,
                 statistics.median(float(row["floor"]) for row in rows) / n_points)
            for rows in zip(*runs)]


def downwards(pairs: int) -> dict[str, object]:
    """Through the peak from above, where the linear solution is a guess that serves."""
    up = near_peak(pairs)
    return up | {"start": up["end"], "end": up["start"], "n_points": N_POINTS}


def processor(bench: Bench, groups: Groups, threads: int = 1, blas_threads: int = 1) -> float:
    """Least processor time of a few runs [s]: what others add is never negative."""
    return min(bench.execute(groups, bench.folder / "limit.h5", threads,
                             blas_threads=blas_threads)[1]
               for _ in range(1 if bench.quick else REPEATS))


def write_limit(found: Limit) -> str:
    """The section of the document."""
    return "\n\n".join(part for part in (floor_part(found.splits), split_part(found.splits),
                                         threads_part(found.threads)) if part)


def floor_part(splits: dict[tuple[int, int], list[Part]]) -> str:
    """Frequencies against their floors, and what the target lacks."""
    rows = []
    missed = []
    for (pairs, n_harmonics), parts in splits.items():
        whole = sum(part.seconds for part in parts if part.name != CONSTRUCTION)
        least = sum(part.floor for part in parts)
        rows.append((pairs, n_harmonics, milliseconds(whole), milliseconds(least),
                     f"{whole / least:.2f}"))
        if whole > TARGET * least:
            missed.append(whole / least)
    verdict = f"Target: at most {TARGET:g} times the floor; met everywhere."
    if missed:
        verdict = (f"Target: at most {TARGET:g} times the floor; missed in {len(missed)} of "
                   f"{len(rows)} cases, {max(missed):.2f} times at worst.")
    return "\n".join([
        "## Close to the limit", "",
        f"Sweeps down through the peak of the blade sector, models and frequencies of the scaling "
        f"({N_POINTS} frequencies, {scaling.FEWEST_POINTS} above {scaling.SMALL} unknowns); "
        "processor time of a frequency, the first one included. The floor is the arithmetic that "
        "the method cannot do without, alone: after each frequency the calls of its solution are "
        "done once more, as often, in the same order and of the same sizes, with nothing between "
        "them, on matrices that lie ready in memory. It is done by BLAS and LAPACK and again by "
        "the kernels of the library that read packed matrices; of each part the faster way counts.",
        "", *table(["pairs", "H", "frequency [ms]", "floor [ms]", "ratio"], rows), "", verdict])


#: What the floor of each part is made of.
FLOORS = (
    ("condensation", "few coordinates: Z_r of each harmonic, the sum of K, M and C and half of a "
     "product that is symmetric; many: the matrix of the patterns of each harmonic; both with the "
     "internal block factored where damping fills it"),
    ("residual", "the product with Z_r of all coordinates (few: a complex one a harmonic; many: "
     "K, M and C once for all harmonics), two transforms, the marches that the pairs took, two "
     "turns with their derivatives for each pair whose limit was looked for"),
    ("derivative of the forces", "one turn of the derivative for each mixed pair, and its "
     "projection, unless that waits (then it is done again where the blocks are formed); for one "
     "that has gone to its limit, that by the start besides"),
    ("preconditioner: build", "LU factors in single precision (few coordinates: one complex matrix "
     "a harmonic; many: a real and a complex one, solutions and products for the patterns)"),
    ("product with the derivative", "in single precision; few coordinates: a complex product a "
     "harmonic; many: one real product for all harmonics, and the patterns; both with the "
     "derivatives of the mixed pairs, by blocks, or by transforms and marches where the sweep "
     "marches them"),
    ("preconditioner: solve", "triangular solutions with these factors, and the patterns"),
    ("Newton and GMRES", "Gram and Schmidt's products with the basis so far, twice, and a norm"),
    ("recovery", "the internal modes"),
)


def split_part(splits: dict[tuple[int, int], list[Part]]) -> str:
    """Shares of the parts, with their own floors."""
    names = [part.name for part in next(iter(splits.values()))]
    rows = []
    for (pairs, n_harmonics), parts in splits.items():
        whole = sum(part.seconds for part in parts)
        rows.append((pairs, n_harmonics, *(f"{100.0 * part.seconds / whole:.0f} "
                                           f"({100.0 * part.floor / whole:.0f})"
                                           for part in parts)))
    return "\n".join([
        "### Where the time goes", "", *table(["part", "its floor"], FLOORS), "",
        "Packing, copies, sorting of coordinates and what else no part names has no floor. Share "
        "of each part, and of its floor in parentheses [% of all].", "",
        *table(["pairs", "H", *names], rows)])


def threads_part(rows: list[ThreadCost]) -> str:
    """What a second thread costs where there is no work for it."""
    if not rows:
        return ""
    worst = max(row.two / row.one for row in rows)
    lines = [(row.pairs, row.n_harmonics, milliseconds(row.one), milliseconds(row.two),
              f"{row.two / row.one:.2f}", milliseconds(row.two_of_blas)) for row in rows]
    verdict = "met" if worst <= THREAD_TARGET else "missed"
    return "\n".join([
        "### A second thread", "",
        "Threads that wait spin for a moment. Joints of fewer than 64 pairs therefore stay in one "
        "thread, however many are allowed. Processor time of a whole run:", "",
        *table(["pairs", "H", "1 thread [ms]", "2 threads [ms]", "ratio",
                "2 threads, 2 of OpenBLAS [ms]"], lines), "",
        f"Target: at most {THREAD_TARGET:g}; {verdict} ({worst:.2f} at worst). The threads that "
        "OpenBLAS starts by itself in other programs get no work from the library, but wait "
        "actively for a moment as a program begins: `OPENBLAS_NUM_THREADS=1` in the environment "
        "saves that, and `fw_run` sets it for itself."])
