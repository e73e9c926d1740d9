"""Time and memory of a frequency against the number of pairs and of harmonics, and of two threads.

Another program, one from before a change, runs every case right before this one does.
"""

from __future__ import annotations

import math
import os
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from scipy.linalg import eigh

from bench.common.measure import Bench, Cost, Groups, Run
from bench.common.sector import COARSE, FAST, case, model_file, sector_file
from bench.speed.small import SmallCase, measure_small

__all__ = ["Measured", "Scaling", "Threads", "measure_scaling"]

PAIRS = (16, 48, 96, 192, 384, 768)
#: Measured as well where its model is there, which takes half an hour to generate; without the
#: other program, whose set-up takes minutes.
MORE_PAIRS = 1536
HARMONICS = (1, 3, 7, 17, 31)
#: Most unknowns that are measured: beyond, a frequency takes minutes.
MOST_UNKNOWNS = 41000
N_TIME = 128
#: Instants and harmonics of the paper's table.
PAPER_TIME, PAPER_HARMONICS = 105, (1, 17)
#: Pairs and harmonics that two threads are measured on, and how often each is run: up to SMALL
#: unknowns a run takes a tenth of a second, and more of them are needed.
THREADED_PAIRS, THREADED_HARMONICS = (48, 96, 192, 384), (3, 7, 17)
THREADED_RUNS, MORE_RUNS = 3, 15
#: Most harmonics that the other program is measured on: what it took longest for.
OTHER_HARMONICS = 17
#: Friction moves the peak from the stuck frequency by this share of it.
PEAK_SHIFT = -5e-4
#: Spacing of the frequencies [Hz]; how many there are falls with the size of the problem.
SPACING, MOST_POINTS, FEWEST_POINTS = 0.25, 9, 3
#: Unknowns up to which there are the most points, and a median of several runs.
SMALL, REPEATS = 6000, 3


@dataclass(frozen=True)
class Measured:
    """A size: seconds of a frequency and of everything before, memory [MB], and counts.

    `stuck` is the first natural frequency [Hz] with every pair stuck, `peak` the largest tip
    amplitude found [mm]; Newton steps and GMRES iterations are means of a frequency. What ends in
    `before` is the other program's, NaN where there is none.
    """

    pairs: int
    n_harmonics: int
    seconds: float
    setup: float
    memory: float
    unknowns: int
    unknowns_left: int
    newton: float
    krylov: float
    usable: int
    points: int
    stuck: float
    peak: float
    before: float = math.nan
    memory_before: float = math.nan
    newton_before: float = math.nan
    krylov_before: float = math.nan

    @property
    def full_matrix(self) -> float:
        """Size of one real matrix of the order of the unknowns [MB]."""
        return 8e-6 * self.unknowns**2


@dataclass(frozen=True)
class Threads:
    """Wall time of a frequency [s] in one thread and in two."""

    pairs: int
    n_harmonics: int
    one: float
    two: float


@dataclass(frozen=True)
class Scaling:
    """Every size, the ends of the paper's table with its number of instants, threads, a small case.
    """

    rows: list[Measured]
    paper: list[Measured]
    threads: list[Threads]
    small: list[SmallCase]


def measure_scaling(bench: Bench, step: Callable[[str], None], other: Bench | None = None
                    ) -> Scaling:
    """All of it; the other program, where there is one, up to OTHER_HARMONICS harmonics."""
    sizes = PAIRS[:2] if bench.quick else sizes_there(bench.folder)
    rows = []
    for pairs in sizes:
        step(f"{pairs} pairs")
        beside = other if pairs < MORE_PAIRS else None
        rows += [measure_size(bench, pairs, n, other=beside if n <= OTHER_HARMONICS else None)
                 for n in HARMONICS[:2 if bench.quick else None]
                 if unknowns_of(pairs, n) <= MOST_UNKNOWNS]
    paper = [measure_size(bench, PAIRS[0], n, PAPER_TIME) for n in PAPER_HARMONICS]
    step("two threads")
    threads = measure_two_threads(bench)
    step("a small case")
    return Scaling(rows, paper, threads, measure_small(bench, other))


def sizes_there(folder: Path) -> tuple[int, ...]:
    """All sizes, the largest one where its model has been generated."""
    return PAIRS + ((MORE_PAIRS,) if model_file(MORE_PAIRS, folder, COARSE).exists() else ())


def measure_two_threads(bench: Bench) -> list[Threads]:
    """One thread and two by turns, the fastest of each."""
    if len(os.sched_getaffinity(0)) < 2:
        return []
    rows = []
    for pairs in THREADED_PAIRS[:1] if bench.quick else THREADED_PAIRS:
        for n in THREADED_HARMONICS[:1] if bench.quick else THREADED_HARMONICS:
            if unknowns_of(pairs, n) > MOST_UNKNOWNS:
                continue
            groups = groups_of(bench, pairs, n, FEWEST_POINTS)[0]
            repeats = MORE_RUNS if unknowns_of(pairs, n) <= SMALL else THREADED_RUNS
            runs = [[bench.run(groups, threads).seconds.mean() for threads in (1, 2)]
                    for _ in range(1 if bench.quick else repeats)]
            rows.append(Threads(pairs, n, *(float(min(times)) for times in zip(*runs))))
    return rows


def unknowns_of(pairs: int, n_harmonics: int) -> int:
    """Contact coordinates times coefficients; the modes are condensed."""
    return 3 * pairs * (2 * n_harmonics + 1)


def stuck_frequency(path: Path) -> float:
    """First natural frequency [Hz] at the speed of the bench, every pair stuck."""
    with h5py.File(path) as file:
        first = file["contact/side_1"].size
        mass = file["mass"][first:, first:]
        stiffness = (file["stiffness"][first:, first:]
                     + FAST**2 * file["stiffness_rotation"][first:, first:])
    return float(np.sqrt(eigh(stiffness, mass, eigvals_only=True)[0]) / (2.0 * math.pi))


def groups_of(bench: Bench, pairs: int, n_harmonics: int, n_points: int) -> tuple[Groups, float]:
    """A sweep down through the peak, and the stuck frequency [Hz]."""
    path = sector_file(pairs, bench.folder, COARSE)
    stuck = stuck_frequency(path)
    centre, half = stuck * (1.0 + PEAK_SHIFT), 0.5 * SPACING * (n_points - 1)
    sweep = {"start": centre + half, "end": centre - half, "n_points": n_points, "unit": "Hz"}
    return case(pairs, n_harmonics, sweep, "krylov", path), stuck


def measure_size(bench: Bench, pairs: int, n_harmonics: int, n_time: int = N_TIME,
                 other: Bench | None = None) -> Measured:
    """The first frequency of a sweep starts from nothing and is left out."""
    small = unknowns_of(pairs, n_harmonics) <= SMALL and not bench.quick
    n_points = MOST_POINTS if small else FEWEST_POINTS
    groups, stuck = groups_of(bench, pairs, n_harmonics, n_points)
    groups["harmonics"]["n_time"] = n_time
    repeats = REPEATS if small else 1
    before, found = [], []
    for _ in range(repeats):
        if other:
            before.append(other.run_and_weigh(groups))
        found.append(bench.run_and_weigh(groups))
    run, cost = sorted(found, key=lambda one: processor_seconds(*one))[repeats // 2]
    return Measured(pairs, n_harmonics, processor_seconds(run, cost),
                    cost.processor - cost.share * float(run.seconds.sum()),
                    cost.memory, run.unknowns, run.unknowns_left, float(run.iterations.mean()),
                    cost.krylov_iterations / n_points, run.usable, n_points, stuck,
                    float(run.amplitude[:, 0].max()),
                    *(of_the_other(before, n_points) if before else ()))


def of_the_other(runs: list[tuple[Run, Cost]], n_points: int) -> tuple[float, float, float, float]:
    """Time of a frequency [s], memory [MB], Newton steps and GMRES iterations of a frequency."""
    run, cost = runs[0]
    return (statistics.median(processor_seconds(*one) for one in runs), cost.memory,
            float(run.iterations.mean()), cost.krylov_iterations / n_points)


def processor_seconds(run: Run, cost: Cost) -> float:
    """Of one frequency behind the first: its wall time times the share that the run had."""
    return float(run.seconds[1:].mean()) * cost.share
