"""Sweeps in one thread and in two beside busy loops, written to a page.

    python -m bench.speed.busy [--program build/release/fw_run] [--turns 5] [--loops 5] [--quick]
        [--page docs/benchmarks/busy.md]

Wall times of `fw_run` on two processors that five other programs want too, by turns, after a turn
that is not counted. The loops run at the same priority and end with this command.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from bench.common.layout import table, wrapped
from bench.common.measure import ROOT, Groups, write_namelist
from bench.common.pages import write_overview
from bench.common.sector import COARSE, case, sector_file

PAGE = ROOT / "docs" / "benchmarks" / "busy.md"
#: Two threads may take so many times the time of one.
WANTED = 1.5
#: Processors, of those that this command may use.
PROCESSORS = 2
#: Pairs, harmonics, points, and range [Hz] with the peak in the middle.
SWEEPS = ((16, 7, 161, 1014.7, 1030.7), (48, 7, 81, 1009.8, 1025.8), (96, 7, 41, 1017.7, 1033.7),
          (192, 7, 21, 1023.0, 1039.0))
TEXT = """# Threads on a busy machine

Sweeps of the blade sector through its peak (4400 rpm, 0.5 N, `n_time = 128`; from 96 pairs on the
mesh of the scaling page) by `fw_run` with `threads = 1` and `threads = 2`, on {processors}
processors on which {loops} endless loops run too: wall time of the whole command by turns, the
median of {turns} and in parentheses the fastest and the slowest. The same with the loops ended,
for comparison. Joints of fewer than 64 pairs stay in one thread. Wanted: beside the loops two
threads take at most {wanted} times the time of one. `python -m bench.speed.busy`.
"""


@dataclass
class Times:
    """Wall times [s] in one thread and in two."""

    one: list[float] = field(default_factory=list)
    two: list[float] = field(default_factory=list)

    @property
    def ratio(self) -> float:
        """Of the medians."""
        return statistics.median(self.two) / statistics.median(self.one)


@contextmanager
def busy(loops: int, processors: set[int]) -> Iterator[None]:
    """Endless loops on processors, ended by their own handles."""
    running = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(loops)]
    try:
        for loop in running:
            os.sched_setaffinity(loop.pid, processors)
        yield
    finally:
        for loop in running:
            loop.kill()
            loop.wait()


def sweep(pairs: int, n_harmonics: int, n_points: int, start: float, end: float) -> Groups:
    """The blade sector through its peak."""
    coarse = COARSE if pairs > 48 else None
    return case(pairs, n_harmonics, {"start": start, "end": end, "unit": "Hz",
                                     "n_points": n_points},
                file=sector_file(pairs, ROOT / "build" / "bench", coarse))


def command(program: Path, folder: Path, threads: int) -> float:
    """Wall time of a run [s]."""
    started = time.perf_counter()
    subprocess.run([program, "-q", f"{threads}.nml"], cwd=folder, check=True,
                   env={**os.environ, "OMP_NUM_THREADS": str(threads)})
    return time.perf_counter() - started


def measure(program: Path, folder: Path, turns: int) -> Times:
    """By turns; the first one warms up."""
    times = Times()
    for turn in range(turns + 1):
        one, two = command(program, folder, 1), command(program, folder, 2)
        if turn > 0:
            times.one.append(one)
            times.two.append(two)
    return times


def cells(times: Times) -> tuple[str, str]:
    """Median, fastest and slowest."""
    one, two = (f"{statistics.median(found):.2f} ({min(found):.2f}, {max(found):.2f})"
                for found in (times.one, times.two))
    return one, two


def rows(options: argparse.Namespace, processors: set[int]) -> list[tuple[str, ...]]:
    """Of the table, one a joint."""
    found: list[tuple[str, ...]] = []
    with tempfile.TemporaryDirectory() as place:
        for pairs, n_harmonics, n_points, start, end in SWEEPS:
            groups = sweep(pairs, n_harmonics, 5 if options.quick else n_points, start, end)
            for threads in (1, 2):
                groups["case"]["threads"] = threads
                write_namelist(Path(place) / f"{threads}.nml", groups)
            alone = measure(options.program, Path(place), options.turns)
            with busy(options.loops, processors):
                beside = measure(options.program, Path(place), options.turns)
            verdict = "met" if beside.ratio <= WANTED else "missed"
            found.append((f"{pairs} pairs, H = {n_harmonics}", *cells(beside),
                          f"{beside.ratio:.2f}: {verdict}", *cells(alone), f"{alone.ratio:.2f}"))
            print(*found[-1], sep=" | ", flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--loops", type=int, default=5)
    parser.add_argument("--quick", action="store_true",
                        help="5 points, once, onto the screen alone: tries the script")
    options = parser.parse_args()
    options.program = options.program.resolve()
    if options.quick:
        options.turns = 1
    processors = set(sorted(os.sched_getaffinity(0))[:PROCESSORS])
    os.sched_setaffinity(0, processors)
    lines = table(
        ["case", "beside the loops, one thread [s]", "two [s]", f"ratio, at most {WANTED}",
         "alone, one thread [s]", "two [s]", "ratio"], rows(options, processors))
    if options.quick:
        return
    text = TEXT.format(processors=len(processors), loops=options.loops, turns=options.turns,
                       wanted=WANTED)
    options.page.write_text(wrapped("\n".join([text, *lines])) + "\n", encoding="utf-8")
    if options.page == PAGE:
        write_overview(PAGE.parent.parent)


if __name__ == "__main__":
    main()
