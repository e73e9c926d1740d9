"""A nonlinear mode of the blade sector against one sweep at one load: processor time of whole runs.

    python -m bench.speed.sector_modes [--program build/release/fw_run] [--peaks]

41 amplitudes over four decades (1e-4 to 1 mm at the tip) against 41 frequencies around the peak at
0.5 N, one after the other in turn, so that a busy machine slows both; the smallest of several runs.
The sweep takes instants, as it does where nothing is said, and in another column events, as modes
do.
And the peaks of sweeps at five loads against those that one mode gives without a load. Writes both
tables between their marks in docs/benchmarks/modes.md.
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
MARKS = ("<!-- sector modes: begin -->", "<!-- sector modes: end -->")
PEAK_MARKS = ("<!-- sector peaks: begin -->", "<!-- sector peaks: end -->")
#: Pairs, harmonics, and the range of the sweep [Hz].
CASES = ((16, 3, 1017.0, 1029.0), (48, 3, 1013.0, 1025.0), (48, 7, 1013.0, 1025.0))
N_POINTS = 41
REPEATS = 5
#: Of the peaks, in units of the load of the model.
LOADS = (0.1, 0.2, 0.4, 0.6, 0.9)


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
            end: float) -> tuple[Cost, Cost, Cost]:
    """Mode, sweep, and sweep with events in turn, the fastest of each."""
    both = groups(pairs, n_harmonics)
    mode = both | {"case": {"analysis": "mode"},
                   "mode": {"start": 1e-4, "end": 1.0, "n_points": N_POINTS,
                            "continuation": "natural"}}
    sweep = both | {"case": {"analysis": "frf"},
                    "sweep": {"start": start, "end": end, "n_points": N_POINTS, "unit": "Hz"}}
    events = sweep | {"harmonics": {"n_harmonics": n_harmonics, "sampling": "events"}}
    with tempfile.TemporaryDirectory() as place:
        turns = [[run(program, Path(place), case) for case in (mode, sweep, events)]
                 for _ in range(REPEATS)]
    best = [min(costs, key=lambda cost: cost.seconds) for costs in zip(*turns, strict=True)]
    return best[0], best[1], best[2]


def peaks(program: Path, folder: Path, pairs: int) -> list[str]:
    """Lines of a table: peaks of sweeps at five loads, and those put together from one mode."""
    both = groups(pairs, 3) | {"solver": {"tolerance": 1e-9}}
    run(program, folder, both | {"case": {"analysis": "mode"}, "load": {"harmonic_scale": 1.0},
                                 "mode": {"start": 0.1, "end": 1.5, "n_points": 61,
                                          "continuation": "natural"}})
    with h5py.File(folder / "case.h5") as file:
        scale, amplitude, omega = (file[name][()] for name in (
            "mode/resonant_scale", "mode/first_harmonic", "omega"))
    lines = []
    for load in LOADS:
        height = float(np.interp(load, scale, amplitude[:, 0]))
        place = float(np.interp(load, scale, omega))
        run(program, folder, both | {
            "case": {"analysis": "frf"}, "load": {"harmonic_scale": load},
            "sweep": {"start": place - 10.0, "end": place + 10.0, "n_points": 81}})
        with h5py.File(folder / "case.h5") as file:
            at, found = file["omega"][()], file["coefficients"][()]
        first = np.hypot(found[:, 1, 0], found[:, 2, 0])
        top = first.argmax()
        # The parabola through the highest points: sweeps have none at the peak itself.
        fit = np.polyfit(at[top - 1:top + 2] - at[top], first[top - 1:top + 2], 2)
        forced, forced_at = fit[2] - fit[1]**2 / (4 * fit[0]), at[top] - fit[1] / (2 * fit[0])
        lines.append(f"| {pairs} | {load} | {forced:.5f} | {100 * (height / forced - 1):+.2f} % | "
                     f"{forced_at / (2 * np.pi):.3f} | {1e6 * (place / forced_at - 1):+.1f} |")
        print(lines[-1], flush=True)
    return lines


def write(page: Path, marks: tuple[str, str], lines: list[str]) -> None:
    """A table between its marks."""
    text, table = page.read_text(), "\n".join(lines)
    before, rest = text.split(marks[0])
    after = rest.split(marks[1])[1]
    page.write_text(f"{before}{marks[0]}\n\n{table}\n\n{marks[1]}{after}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--peaks", action="store_true", help="the peaks alone, which take no time")
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    with tempfile.TemporaryDirectory() as place:
        lines = ["| pairs | load [N] | peak of the sweep [mm] | of the mode | at [Hz] | of the "
                 "mode [1e-6] |", "|---|---|---|---|---|---|"]
        for pairs in (16, 48):
            lines += peaks(program, Path(place), pairs)
    write(arguments.page, PEAK_MARKS, lines)
    if arguments.peaks:
        return
    lines = ["| pairs | harmonics | mode [s] | Newton steps | sweep [s] | Newton steps | "
             "mode to sweep | sweep with events [s] | mode to that |",
             "|---|---|---|---|---|---|---|---|---|"]
    for pairs, n_harmonics, start, end in CASES:
        mode, sweep, events = measure(program, pairs, n_harmonics, start, end)
        if mode.converged != N_POINTS or sweep.converged != N_POINTS:
            raise RuntimeError(f"{pairs} pairs: not every point converged")
        lines.append(f"| {pairs} | {n_harmonics} | {mode.seconds:.3f} | {mode.steps} | "
                     f"{sweep.seconds:.3f} | {sweep.steps} | {mode.seconds / sweep.seconds:.2f} | "
                     f"{events.seconds:.3f} | {mode.seconds / events.seconds:.2f} |")
        print(lines[-1], flush=True)
    write(arguments.page, MARKS, lines)


if __name__ == "__main__":
    main()
