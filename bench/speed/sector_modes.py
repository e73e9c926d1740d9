"""A nonlinear mode of the blade sector against one sweep at one load: processor time of whole runs.

    python -m bench.speed.sector_modes [--program build/release/fw_run]

41 amplitudes over four decades (1e-4 to 1 mm at the tip) against 41 frequencies around the peak at
0.5 N, one after the other in turn, so that a busy machine slows both; the smallest of several runs.
Writes the table between its marks in docs/benchmarks/modes.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from bench.common.measure import ROOT, Groups, write_namelist

PAGE = ROOT / "docs" / "benchmarks" / "modes.md"
BEGIN, END = "<!-- sector modes: begin -->", "<!-- sector modes: end -->"
#: Pairs, harmonics, and the range of the sweep [Hz].
CASES = ((16, 3, 1017.0, 1029.0), (48, 3, 1013.0, 1025.0), (48, 7, 1013.0, 1025.0))
N_POINTS = 41
REPEATS = 5


@dataclass(frozen=True)
class Cost:
    """Processor time of a run [s], its Newton steps, and points that converged."""

    seconds: float
    steps: int
    converged: int


def groups(pairs: int, n_harmonics: int) -> Groups:
    """What both runs have."""
    model = ROOT / "example" / "blade_sector" / f"sector_{pairs}.h5"
    return {"model": {"source": "hdf5", "file": model, "modal_damping": 1e-3,
                      "rotation_speed": 460.8},
            "contact": {"law": "dlft", "mu": 0.5}, "load": {"harmonic_scale": 0.5},
            "harmonics": {"n_harmonics": n_harmonics}, "output": {"observe": "tip"}}


def run(program: Path, folder: Path, case: Groups) -> Cost:
    """One run in one thread."""
    write_namelist(folder / "case.nml", case)
    process = subprocess.Popen([program, "-q", "case.nml"], cwd=folder, env={
        **os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 4):
        raise RuntimeError(f"fw_run ended with status {process.returncode}")
    with h5py.File(folder / "case.h5") as file:
        return Cost(used.ru_utime + used.ru_stime, int(file["iterations"][()].sum()),
                    int(np.sum(file["converged"][()])))


def measure(program: Path, pairs: int, n_harmonics: int, start: float,
            end: float) -> tuple[Cost, Cost]:
    """Mode and sweep in turn, the fastest of each."""
    both = groups(pairs, n_harmonics)
    mode = both | {"case": {"analysis": "mode"},
                   "mode": {"start": 1e-4, "end": 1.0, "n_points": N_POINTS,
                            "continuation": "natural"}}
    sweep = both | {"case": {"analysis": "frf"},
                    "sweep": {"start": start, "end": end, "n_points": N_POINTS, "unit": "Hz"}}
    with tempfile.TemporaryDirectory() as place:
        pair = [(run(program, Path(place), mode), run(program, Path(place), sweep))
                for _ in range(REPEATS)]
    return (min((p[0] for p in pair), key=lambda cost: cost.seconds),
            min((p[1] for p in pair), key=lambda cost: cost.seconds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    lines = ["| pairs | harmonics | mode [s] | Newton steps | sweep [s] | Newton steps | "
             "mode to sweep |", "|---|---|---|---|---|---|---|"]
    for pairs, n_harmonics, start, end in CASES:
        mode, sweep = measure(arguments.program.resolve(), pairs, n_harmonics, start, end)
        if mode.converged != N_POINTS or sweep.converged != N_POINTS:
            raise RuntimeError(f"{pairs} pairs: not every point converged")
        lines.append(f"| {pairs} | {n_harmonics} | {mode.seconds:.3f} | {mode.steps} | "
                     f"{sweep.seconds:.3f} | {sweep.steps} | {mode.seconds / sweep.seconds:.2f} |")
        print(lines[-1], flush=True)
    table = "\n".join(lines)
    text = arguments.page.read_text()
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    arguments.page.write_text(f"{before}{BEGIN}\n\n{table}\n\n{END}{after}")


if __name__ == "__main__":
    main()
