"""Times on the bladed-disk sector: harmonics, pairs, linear solvers, threads, whole sweeps."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bench.common.measure import ROOT, Bench, Groups, Run
from bench.common.oscillators import two_dof

__all__ = ["COARSE", "FAST", "HARMONICS", "LARGEST_LU", "PAIRS", "THREADED", "Crossing",
           "PointTime", "Sweep", "ThreadTimes", "case", "measure_crossing", "measure_points",
           "measure_sweeps", "measure_threads", "model_file", "near_peak", "sector_file"]

HARMONICS = (1, 3, 7, 17)
PAIRS = (16, 48)
#: Dense LU is left out beyond this many unknowns, to keep the whole measurement short.
LARGEST_LU = 1100
#: Peaks [Hz] at 4400 rpm, where the joint slips and every point is usable.
PEAKS = {8: 1017.6, 16: 1022.7, 48: 1017.8, 96: 1029.0}
#: Pairs of the joint on which threads are measured: those of fewer than 64 stay in one.
THREADED = 96
#: Mesh away from the flanks, for every size the same. Half the elements of the default there:
#: 768 pairs on the default mesh take a quarter of an hour and 16 GB to generate.
COARSE = {"blade-columns": 2, "post-columns": 1, "slot-columns": 2, "airfoil-rows": 4,
          "disk-rows": 2}
HALF_WIDTH, N_NEAR = 2.0, 9
SLOW, FAST = 261.8, 460.8
WHOLE = {"start": 1000.0, "end": 1015.0, "n_points": 41, "unit": "Hz"}


@dataclass(frozen=True)
class PointTime:
    """Time of a frequency point [s]; NaN where it was not measured."""

    pairs: int
    n_harmonics: int
    linear: str
    seconds: float
    unknowns: int
    run: Run | None


@dataclass(frozen=True)
class Sweep:
    """A sweep: time of the whole run [s] and how many points are usable."""

    title: str
    seconds: float
    run: Run


@dataclass(frozen=True)
class ThreadTimes:
    """Time of a point [s] with one thread, with two, and with two that sleep while they wait."""

    n_harmonics: int
    one: float
    two: float
    two_passive: float


@dataclass(frozen=True)
class Crossing:
    """Time of a point with either linear solver [s] against the unknowns left."""

    case: str
    n_harmonics: int
    unknowns_left: int
    lu: float
    krylov: float


def near_peak(pairs: int) -> dict[str, object]:
    """A short sweep through the peak."""
    return {"start": PEAKS[pairs] - HALF_WIDTH, "end": PEAKS[pairs] + HALF_WIDTH,
            "n_points": N_NEAR, "unit": "Hz"}


def case(pairs: int, n_harmonics: int, sweep: dict[str, object], linear: str = "auto",
         file: Path | None = None, speed: float = FAST) -> Groups:
    """The sector under a tip force of 0.5 N."""
    model = file or ROOT / "example" / "blade_sector" / f"sector_{pairs}.h5"
    return {"case": {"title": f"sector, {pairs} pairs", "analysis": "frf"},
            "model": {"source": "hdf5", "file": model, "rotation_speed": speed,
                      "modal_damping": 1e-3},
            "load": {"harmonic_scale": 0.5},
            "harmonics": {"n_harmonics": n_harmonics, "n_time": 128},
            "sweep": sweep,
            "solver": {"linear": linear}}


def measure_points(bench: Bench) -> list[PointTime]:
    """Mean time of a point near the peak, with either linear solver."""
    points = []
    for pairs in PAIRS:
        for n_harmonics in HARMONICS[:2] if bench.quick else HARMONICS:
            for linear in ("krylov", "lu"):
                unknowns = 3 * pairs * (2 * n_harmonics + 1)
                if linear == "lu" and unknowns > LARGEST_LU:
                    points.append(PointTime(pairs, n_harmonics, linear, float("nan"), unknowns,
                                            None))
                    continue
                seconds, run = bench.repeat(case(pairs, n_harmonics, near_peak(pairs), linear),
                                            lambda run: float(run.seconds.mean()), most=3)
                points.append(PointTime(pairs, n_harmonics, linear, seconds, run.unknowns, run))
    return points


def measure_threads(bench: Bench) -> list[ThreadTimes]:
    """Mean time of a point near the peak with one and two threads."""
    if len(os.sched_getaffinity(0)) < 2:
        return []
    rows = []
    for n_harmonics in (3,) if bench.quick else (3, 7, 17):
        groups = case(THREADED, n_harmonics, near_peak(THREADED),
                      file=sector_file(THREADED, bench.folder, COARSE))
        times = [bench.repeat(groups, lambda run: float(run.seconds.mean()), threads, 3, 4.0,
                              wait)[0]
                 for threads, wait in ((1, None), (2, None), (2, "passive"))]
        rows.append(ThreadTimes(n_harmonics, *times))
    return rows


def measure_sweeps(bench: Bench) -> list[Sweep]:
    """The two sweeps that have a target, up and down."""
    down = WHOLE | {"start": WHOLE["end"], "end": WHOLE["start"]}
    sweeps = []
    for pairs, n_harmonics in ((48, 7), (16, 3)):
        for direction, sweep in (("down", down), ("up", WHOLE)):
            seconds, run = bench.repeat(case(pairs, n_harmonics, sweep, speed=SLOW),
                                        lambda run: run.elapsed, most=3)
            sweeps.append(Sweep(f"{pairs} pairs, H = {n_harmonics}, {direction}", seconds, run))
    return sweeps


def measure_crossing(bench: Bench) -> list[Crossing]:
    """Time of a point of growing size with LU and with GMRES."""
    grid = {8: (1, 2, 3, 5, 7), 16: (1, 2, 3, 5, 7), 48: (1, 3)}
    rows = []
    for pairs, harmonics in grid.items():
        file = sector_file(pairs, bench.folder)
        for n_harmonics in harmonics[:2] if bench.quick else harmonics:
            groups = case(pairs, n_harmonics, near_peak(pairs), file=file)
            rows.append(cross(bench, f"sector, {pairs} pairs", n_harmonics, groups))
    small = two_dof("A_stickslip").groups
    for n_harmonics in (1, 31) if bench.quick else (1, 3, 7, 15, 31):
        groups = small | {"harmonics": {"n_harmonics": n_harmonics, "n_time": 128}}
        rows.append(cross(bench, "two dofs", n_harmonics, groups))
    return sorted(rows, key=lambda row: row.unknowns_left)


def cross(bench: Bench, name: str, n_harmonics: int, groups: Groups) -> Crossing:
    """One case with both linear solvers."""
    times, left = {}, 0
    for linear in ("lu", "krylov"):
        times[linear], run = bench.repeat(groups | {"solver": {"linear": linear}},
                                          lambda run: float(run.seconds.mean()), budget=2.5)
        left = run.unknowns_left
    return Crossing(name, n_harmonics, left, times["lu"], times["krylov"])


def model_file(pairs: int, folder: Path, coarse: Mapping[str, int] | None = None) -> Path:
    """Where a generated model is kept."""
    return folder / f"sector_{pairs}{'_coarse' if coarse else ''}.h5"


def sector_file(pairs: int, folder: Path, coarse: Mapping[str, int] | None = None) -> Path:
    """The model with so many pairs, generated where it is no example.

    `coarse` holds parameters of the mesh away from the flanks, as `fretwear.sector` takes them.
    """
    example = ROOT / "example" / "blade_sector" / f"sector_{pairs}.h5"
    if example.exists() and not coarse:
        return example
    path = model_file(pairs, folder, coarse)
    if not path.exists():
        options = [f"--{key}={value}" for key, value in (coarse or {}).items()]
        path.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run([sys.executable, "-m", "fretwear.sector", "--pairs", str(pairs), "-q",
                        *options, "-o", path], check=True,
                       env=os.environ | {"PYTHONPATH": str(ROOT / "python")})
    return path
