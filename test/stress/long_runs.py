"""Long runs: memory stays flat, and a point late in a run costs what an early one does.

    long_runs.py [--points 10000] [--steps 5000] [-o docs/robustness.md]

Memory is what the process holds of its own (resident, without the pages of the program and its
libraries, which come in when a procedure is first called), read as it reports its points: neither
its start nor the closing of its file, which holds a megabyte for a moment, is among them however
busy the machine. The cost of a point is what the result file says. Ends with status 1 where one of
them grows.
"""
from __future__ import annotations

import argparse
import fcntl
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
import stress_cases as cases
import stress_run as runs
from stress_models import interface

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from revision import revision
from sections import write_section

# Growth that counts: of memory from half way on, when HDF5 has what it keeps of a file [MB], and
# of the median time.
MEMORY_GROWTH, TIME_GROWTH = 1.0, 1.5
# Memory is read at these shares of a run's points, of which the last leaves room for those that
# the program reports before they are read.
SHARES = np.arange(0.05, 0.96, 0.05)
# F_SETPIPE_SZ of Linux, which Python has from 3.10 on.
SET_PIPE_SIZE = 1031


def sweep(n_points):
    """A joint that slips and sticks again, swept across its first modes."""
    return cases.make("long", "sweep", interface(2, preload=1.0), omegas=(0.2, 1.8, n_points))


def wear(n_steps):
    """A joint that wears by small steps."""
    case = cases.make("long", "wear", interface(2, preload=3.0),
                      wear={"scheme": "implicit", "coefficient": 1e-6, "max_depth_step": 1e-5,
                            "max_steps": n_steps, "steady_tolerance": 1e-12})
    case.groups["case"]["analysis"] = "wear"
    return case


def resident(pid):
    """Resident memory of a running process of its own [MB]."""
    status = Path(f"/proc/{pid}/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("RssAnon"))
    return int(line.split()[1]) / 1024


def measure(case, n_points):
    """Resident memory [MB] at SHARES of the points, seconds of every point, whether converged."""
    with tempfile.TemporaryDirectory(prefix="fw_long_") as name:
        folder = Path(name)
        runs.write_case(case, folder)
        marks = {f"point {round(share * n_points)}" for share in SHARES}
        with subprocess.Popen([runs.PROGRAM, "-v", str(folder / "case.nml")], text=True,
                              env=runs.ENVIRONMENT, stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE) as process:
            # A pipe of one page: the program is at most some fifty points ahead of what is read.
            fcntl.fcntl(process.stderr, SET_PIPE_SIZE, 4096)
            memory = [resident(process.pid) for line in process.stderr
                      if re.split(" of |:", line, maxsplit=1)[0] in marks]
        if process.returncode not in (0, 4):
            raise RuntimeError(f"{case.title}: status {process.returncode}")
        if len(memory) != len(marks):
            raise RuntimeError(f"{case.title}: {len(memory)} of {len(marks)} readings of memory")
        with h5py.File(folder / "case.h5") as file:
            return memory, file["seconds"][()], file["converged"][()].astype(bool)


def judge(name, case, n_points):
    """A row of the table, and whether anything grows."""
    memory, seconds, converged = measure(case, n_points)
    tenth = max(1, len(seconds) // 10)
    early = memory[len(memory) // 2]
    first, last = np.median(seconds[tenth:2 * tenth]), np.median(seconds[-tenth:])
    grows = memory[-1] - early > MEMORY_GROWTH or last > TIME_GROWTH * first
    return (f"| {name} | {len(seconds)} | {converged.sum()} | {early:.1f} | {memory[-1]:.1f} | "
            f"{1e3 * first:.2f} | {1e3 * last:.2f} |", grows)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=10000)
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("-o", "--output", type=Path, help="document whose table is replaced")
    arguments = parser.parse_args()
    lines = [f"At commit {revision()}.", "",
             "| run | points | converged | MB half way | MB near the end | ms a point, second "
             "tenth | ms a point, last tenth |", "|---" * 7 + "|"]
    bad = False
    for name, make, n_points in (("sweep", sweep, arguments.points),
                                 ("wear", wear, arguments.steps)):
        line, grows = judge(name, make(n_points), n_points)
        lines.append(line)
        print(line, flush=True)
        bad = bad or grows
    if arguments.output:
        write_section("long runs", lines, arguments.output)
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
