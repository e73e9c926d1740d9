"""Populations of the shrouded disk with its shrouds apart: 100 disks at 81 frequencies, maxima
between them included.

    python -m bench.speed.populations [--program build/release/fw_run] [--patterns 100]

The table goes to the screen: wall time of one thread, points, for one and two blade modes.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np
from scipy.linalg import eigh

from bench.common.measure import ROOT
from fretwear._namelist import write_namelist

DISK = ROOT / "example" / "shrouded_disk" / "disk.h5"
N_SECTORS, SEED, DEVIATION = 36, 7, 0.02


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


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--patterns", type=int, default=100)
    options = parser.parse_args()
    print("| blade modes | disks | points | of them solved | time [s] | largest amplification |")
    print("|---" * 6 + "|")
    for n_rows in (1, 2):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            with_rows(folder / "disk.h5", n_rows, options.patterns)
            (folder / "case.nml").write_text(write_namelist({
                "case": {"analysis": "population", "threads": 1},
                "model": {"source": "hdf5", "file": "disk.h5", "rayleigh_mass": 4.0489,
                          "rayleigh_stiffness": 6.1745e-8},
                "cyclic": {"engine_order": 4, "mistuned": True}, "contact": {"n_pairs": 0},
                "harmonics": {"n_harmonics": 1},
                "sweep": {"start": 365.0, "end": 411.0, "unit": "Hz", "n_points": 81}}))
            started = time.perf_counter()
            subprocess.run([options.program, "-q", "case.nml"], cwd=folder, check=True)
            seconds = time.perf_counter() - started
            with h5py.File(folder / "case.h5") as file:
                solved, converged = (file[f"population/{key}"][()].sum()
                                     for key in ("solved", "converged"))
                largest = np.nanmax(file["population/amplification"][()])
        print(f"| {n_rows} | {options.patterns} | {solved} | {converged} | {seconds:.1f} "
              f"| {largest:.2f} |", flush=True)


if __name__ == "__main__":
    main()
