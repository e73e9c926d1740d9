"""Overhead of the Python layer on a frequency response of the sector.

    python -m bench.speed.python_layer [--repeats N]

Measures fretwear.run, and within the same calls the library itself (reading the case, running it).
Overhead is what is left, as a part of the library's time. Processor time is what other programs on
the machine disturb least; the elapsed time, that of the program fw_run, a process of its own, and
the time to read every array of the result are shown beside it. The best of the repeated runs
counts, of the overhead their median.
"""

from __future__ import annotations

import argparse
import subprocess
import time
from pathlib import Path

import numpy as np

import fretwear as fw
from fretwear._native import Session

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "example" / "blade_sector"


def now() -> np.ndarray:
    """Processor time of this process and elapsed time [s]."""
    return np.array([time.process_time(), time.perf_counter()])


class TimedSession(Session):
    """Adds up the time spent in the library."""

    seconds = np.zeros(2)

    def read(self, *arguments, **named):
        """Read the case."""
        start = now()
        super().read(*arguments, **named)
        TimedSession.seconds += now() - start

    def run(self, *arguments, **named):
        """Run the case."""
        start = now()
        status = super().run(*arguments, **named)
        TimedSession.seconds += now() - start
        return status


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=20, help="runs of each kind (default 20)")
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    fw.case.Session = TimedSession
    print("case        processor time [ms]                      elapsed time [ms]")
    print("            call  library  overhead   reading       call  library   fw_run")
    for name in ("frf", "frf_48"):
        times = 1e3 * measure(EXAMPLE / f"{name}.nml", options)
        overhead = np.median(times[:, 0, 0] / times[:, 1, 0] - 1.0)
        call, library, program, reading = times.min(axis=0)
        print(f"{name:8}{call[0]:8.1f} {library[0]:8.1f} {100.0 * overhead:7.2f} % "
              f"{reading[0]:9.1f}{call[1]:11.1f} {library[1]:8.1f} {program[1]:8.1f}")


def measure(namelist: Path, options: argparse.Namespace) -> np.ndarray:
    """Times of the call, of the library within it, of the program, and of reading [s],
    processor and elapsed, for every repetition (n_repeats, 4, 2).
    """
    times = []
    case = fw.Case.from_file(namelist)
    for _ in range(options.repeats):
        TimedSession.seconds = np.zeros(2)
        start = now()
        result = fw.run(case, options.work / "python.h5")
        call = now() - start
        start = now()
        for dataset in result:
            assert len(result[dataset])
        reading = now() - start
        start = now()
        subprocess.run([options.program, "-q", "-o", options.work / "program.h5", namelist],
                       check=True)
        times.append((call, TimedSession.seconds, now() - start, reading))
    return np.array(times)


if __name__ == "__main__":
    main()
