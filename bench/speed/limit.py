"""Where the time of a sweep goes, against the floor of it, and what idle threads cost. Processor
times, which other programs disturb less than times by the clock."""

from __future__ import annotations

import os
import statistics
from dataclasses import dataclass
from pathlib import Path

from bench.common.layout import milliseconds, table
from bench.common.measure import Bench, Groups, write_namelist
from bench.common.programs import run_program
from bench.common.sector import PAIRS, case, near_peak

__all__ = ["Limit", "Part", "ThreadCost", "downwards", "measure_limit",
           "processor", "write_limit"]

HARMONICS = (3, 7, 17)
REPEATS = 3
N_POINTS = 21
#: A sweep is to take at most this multiple of its floor.
TARGET = 1.5
#: What a second thread may cost on joints too small for it.
THREAD_TARGET = 1.05
#: Run before a point is solved; not part of a sweep.
CONSTRUCTION = "first matrices"


@dataclass(frozen=True)
class Part:
    """Calls of a part of a sweep, its processor time and that of its floor [s]."""

    name: str
    calls: int
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


def measure_limit(bench: Bench, program: Path) -> Limit:
    """Run the program of the floor, and fw_run with threads."""
    sizes = [(pairs, n) for pairs in PAIRS for n in (HARMONICS[:1] if bench.quick else HARMONICS)]
    splits = {size: measure_split(bench, program, *size) for size in sizes}
    threads = []
    if len(os.sched_getaffinity(0)) > 1:
        for pairs, n_harmonics in sizes:
            groups = case(pairs, n_harmonics, near_peak(pairs))
            threads.append(ThreadCost(pairs, n_harmonics, processor(bench, groups),
                                      processor(bench, groups, threads=2),
                                      processor(bench, groups, threads=2, blas_threads=2)))
    return Limit(splits, threads)


def measure_split(bench: Bench, program: Path, pairs: int, n_harmonics: int) -> list[Part]:
    """Medians of every part over repeated sweeps through the peak."""
    path = bench.folder / "limit.nml"
    write_namelist(path, case(pairs, n_harmonics, downwards(pairs)))
    runs = [run_program(program, path) for _ in range(1 if bench.quick else REPEATS)]
    return [Part(rows[0]["part"], int(rows[0]["calls"]),
                 statistics.median(float(row["seconds"]) for row in rows),
                 statistics.median(float(row["floor"]) for row in rows))
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
    """Sweeps against their floors, and what the target lacks."""
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
                   f"{len(rows)} cases, {max(missed):.2f} times at worst. The floor finds its "
                   "matrices in the cache, because each kernel runs right after the part that "
                   "it stands for; a sweep brings each of them from memory.")
    return "\n".join([
        "## Close to the limit", "",
        f"Sweeps of {N_POINTS} points down through the peak of the blade sector. The floor is what "
        "such a sweep cannot do without, by the library's own kernels and LAPACK, each call done "
        "once more, alone: one turn of the derivative for each mixed pair, the marches that the "
        "pairs took, "
        "the transforms, the products with the matrices in use, the factorisations and solutions "
        "of the preconditioner, the condensation (its internal block factored and solved, and half "
        "of a product that is symmetric) and the products of the Krylov basis. "
        "Processor times.", "",
        *table(["pairs", "H", "sweep [ms]", "floor [ms]", "ratio"], rows), "", verdict])


def split_part(splits: dict[tuple[int, int], list[Part]]) -> str:
    """Shares of the parts, with their own floors."""
    header = ["part", *(f"{pairs} pairs, H = {n}" for pairs, n in splits)]
    rows = []
    for k, name in enumerate(part.name for part in next(iter(splits.values()))):
        cells = []
        for parts in splits.values():
            whole = sum(part.seconds for part in parts)
            cells.append(f"{100.0 * parts[k].seconds / whole:.0f} "
                         f"({100.0 * parts[k].floor / whole:.0f})")
        rows.append((name, *cells))
    return "\n".join(["### Where the time goes", "",
                      "Share of each part, and of its floor in parentheses [% of the sweep]. The "
                      "Krylov basis belongs to the rest of GMRES.", "", *table(header, rows)])


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
