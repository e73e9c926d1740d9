"""Populations of the shrouded disk: 100 disks at 81 frequencies, maxima between them included.

    python -m bench.speed.populations [--program build/release/fw_run] [--patterns 100]
                                      [--friction 4]

Of disks with their shrouds apart, with one and two blade modes and with modal damping, the time of
one thread; of disks whose four pairs rub, at one harmonic and several loads, how many are solved in
twenty minutes by two processors, from a few of them. Writes the tables between their marks in
docs/benchmarks/populations.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.linalg import eigh

from bench.common.measure import ROOT
from bench.speed.sectors import groups, read_disk, write
from fretwear._namelist import write_namelist

DISK = ROOT / "example" / "shrouded_disk" / "disk.h5"
PAGE = ROOT / "docs" / "benchmarks" / "populations.md"
N_SECTORS, SEED, DEVIATION, ORDER = 36, 7, 0.02, 4
RAYLEIGH = {"rayleigh_mass": 4.0489, "rayleigh_stiffness": 6.1745e-8}
#: Loads of disks with friction, frequencies around their resonance [Hz], time and processors.
LOADS, RANGE, SECONDS, PROCESSORS = (2.0, 5.0), (1215.0, 1255.0), 1200.0, 2


@dataclass(frozen=True)
class Solved:
    """Of a run: points, those that converged, the largest amplification, processor time [s] and
    that of the wall."""

    points: int
    converged: int
    largest: float
    seconds: float
    wall: float


def with_rows(path: Path, n_rows: int, n_patterns: int) -> None:
    """The disk with rows of its lowest modes, interfaces held, and patterns."""
    path.write_bytes(DISK.read_bytes())
    with h5py.File(path, "r+") as file:
        stiffness, mass = file["stiffness"][()], file["mass"][()]
        edge = np.abs(np.concatenate([file["cyclic/left"][()], file["cyclic/right"][()]])) - 1
        inside = np.setdiff1d(np.arange(len(mass)), edge)
        theta, modes = eigh(stiffness[np.ix_(inside, inside)], mass[np.ix_(inside, inside)],
                            subset_by_index=(0, n_rows - 1))
        omega = np.sqrt(theta)
        file["mistuning/rows"] = modes.T @ stiffness[inside] / theta[:, None]
        file["mistuning/row_omega"] = omega
        rng = np.random.default_rng(SEED)
        shape = (n_patterns, N_SECTORS, n_rows)
        file["mistuning/patterns"] = DEVIATION * rng.standard_normal(shape)


def apart(n_points: int, damping: dict[str, float]) -> dict[str, Any]:
    """Disks whose shrouds do not touch."""
    return {"case": {"analysis": "population", "threads": 1},
            "model": {"source": "hdf5", "file": "disk.h5"} | damping,
            "cyclic": {"engine_order": ORDER, "mistuned": True}, "contact": {"n_pairs": 0},
            "harmonics": {"n_harmonics": 1},
            "sweep": {"start": 365.0, "end": 411.0, "unit": "Hz", "n_points": n_points}}


def rubbing(n_points: int, load: float) -> dict[str, Any]:
    """Disks whose shrouds are pressed on each other."""
    loaded = int(np.abs(read_disk(DISK)["load/cosine"]).argmax()) + 1
    case = groups(Path("disk.h5"), 1, loaded)
    return case | {
        "case": {"analysis": "population", "threads": 1}, "load": {"harmonic_scale": load},
        "cyclic": {"engine_order": ORDER, "mistuned": True},
        "sweep": {"start": RANGE[0], "end": RANGE[1], "unit": "Hz", "n_points": n_points}}


def solve(program: Path, n_rows: int, n_patterns: int, case: dict[str, Any]) -> Solved:
    """One population, in one thread."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with_rows(folder / "disk.h5", n_rows, n_patterns)
        (folder / "case.nml").write_text(write_namelist(case))
        started = time.perf_counter()
        process = subprocess.Popen([program, "-q", "case.nml"], cwd=folder, env={
            **os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - started
        with h5py.File(folder / "case.h5") as file:
            points, converged = (int(file[f"population/{key}"][()].sum())
                                 for key in ("solved", "converged"))
            largest = float(np.nanmax(file["population/amplification"][()]))
    return Solved(points, converged, largest, used.ru_utime + used.ru_stime, wall)


def linear_table(program: Path, n_patterns: int, n_points: int) -> str:
    lines = ["| blade modes | damping | disks | points | of them solved | processor time [s] "
             "| largest amplification |", "|---" * 7 + "|"]
    for n_rows, word, damping in ((1, "Rayleigh", RAYLEIGH), (2, "Rayleigh", RAYLEIGH),
                                  (1, "modal", {"modal_damping": 5e-4})):
        found = solve(program, n_rows, n_patterns, apart(n_points, damping))
        lines.append(f"| {n_rows} | {word} | {n_patterns} | {found.points} | {found.converged} | "
                     f"{found.seconds:.1f} | {found.largest:.2f} |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def friction_table(program: Path, n_patterns: int, n_points: int) -> str:
    lines = ["| load | disks | points | of them found | processor time [s] | disks in 20 minutes "
             "of two processors | largest amplification |", "|---" * 7 + "|"]
    for load in LOADS:
        found = solve(program, 1, n_patterns, rubbing(n_points, load))
        # The tuned disk is solved once, as one more.
        disks = SECONDS * PROCESSORS / found.seconds * (n_patterns + 1)
        lines.append(f"| {load:.0f} | {n_patterns} | {found.points} | "
                     f"{100.0 * found.converged / found.points:.1f} % | {found.seconds:.0f} | "
                     f"{disks:.0f} | {found.largest:.2f} |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def main() -> None:
    """Measure, print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--patterns", type=int, default=100)
    parser.add_argument("--points", type=int, default=81)
    parser.add_argument("--friction", type=int, default=4, help="disks with friction; 0: none")
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    program = options.program.resolve()
    linear = linear_table(program, options.patterns, options.points)
    write(options.page, "<!-- linear: begin -->", "<!-- linear: end -->", linear)
    if options.friction > 0:
        write(options.page, "<!-- friction: begin -->", "<!-- friction: end -->",
              friction_table(program, options.friction, options.points))


if __name__ == "__main__":
    main()
