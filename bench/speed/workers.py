"""A sweep of 401 points by one worker and by two, written to a page.

    python -m bench.speed.workers [--build build/release] [--cases 1 2 3 4] [--turns 3] [--quick]
        [--page docs/benchmarks/workers.md]

Wall times of the whole command `fretwear run CASE.nml --workers N`, by turns; a worker has one
thread. Then one more sweep by two workers, taken apart. Wants two idle cores.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import fretwear as fw
from bench.common.layout import table
from bench.common.measure import ROOT, Groups, write_namelist
from bench.common.sector import COARSE, case, sector_file
from bench.speed.sector_modes import write
from fretwear.pieces.overlap import Part
from fretwear.pieces.running import run_in_pieces

PAGE = ROOT / "docs" / "benchmarks" / "workers.md"
MARKS = ("<!-- workers: begin -->", "<!-- workers: end -->")
LIMIT_MARKS = ("<!-- workers, limits: begin -->", "<!-- workers, limits: end -->")
N_POINTS, QUICK_POINTS, WANTED = 401, 41, 1.8
#: Difference of two rows, relative to the largest of the sweep, that is none: as in
#: fretwear.pieces.overlap.
SAME = 1e-5
#: Pairs, harmonics and range [Hz] with the peak in the middle, of 96 pairs at two thirds.
SWEEPS = ((48, 7, 1009.8, 1025.8), (96, 7, 1017.7, 1033.7), (192, 7, 1023.0, 1039.0),
          (192, 17, 1023.0, 1039.0))


@dataclass
class Turns:
    """Wall times of the command [s] by one worker and by two, and how far rows differ."""

    name: str
    one: list[float] = field(default_factory=list)
    two: list[float] = field(default_factory=list)
    difference: float = 0.0

    @property
    def ratio(self) -> float:
        """Of the medians."""
        return statistics.median(self.one) / statistics.median(self.two)

    @property
    def row(self) -> tuple[str, ...]:
        """Of the table."""
        times = (f"{statistics.median(times):.2f} ({min(times):.2f})"
                 for times in (self.one, self.two))
        return (self.name, *times,
                f"{self.ratio:.2f}: " + ("met" if self.ratio >= WANTED else "missed"),
                f"{min(self.one) / min(self.two):.2f}",
                f"{self.difference:.0e}" + ("" if self.difference <= SAME else ", NOT the same"))


def sweep(pairs: int, n_harmonics: int, start: float, end: float, quick: bool) -> Groups:
    """The blade sector through its peak."""
    coarse = COARSE if pairs > 48 else None
    return case(pairs, n_harmonics, {"start": start, "end": end, "unit": "Hz", "n_points":
                                     QUICK_POINTS if quick else N_POINTS},
                file=sector_file(pairs, ROOT / "build" / "bench", coarse))


def command(build: Path, folder: Path, workers: int) -> float:
    """Wall time of the whole command [s]."""
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'python'}:{build / 'python'}"}
    started = time.perf_counter()
    subprocess.run([sys.executable, "-m", "fretwear", "run", folder / "case.nml", "-q",
                    "--workers", str(workers), "-o", folder / f"{workers}.h5"], check=True,
                   env=environment)
    return time.perf_counter() - started


def measure(name: str, build: Path, folder: Path, n_turns: int) -> Turns:
    """One worker and two by turns."""
    turns = Turns(name)
    for _ in range(n_turns):
        turns.one.append(command(build, folder, 1))
        turns.two.append(command(build, folder, 2))
    one, two = (fw.Result(folder / f"{workers}.h5").coefficients for workers in (1, 2))
    turns.difference = float(np.abs(one - two).max() / np.abs(one).max())
    return turns


def limits(name: str, build: Path, folder: Path) -> tuple[str, ...]:
    """Where the time of a sweep by two workers goes, in a row of the table."""
    sweep_case = fw.Case.from_file(folder / "case.nml")
    parts: list[Part] = []
    solved: list[float] = []

    def see(found: Sequence[Part]) -> None:
        parts.extend(found)
        solved.append(time.monotonic())

    started = time.monotonic()
    run_in_pieces(sweep_case, 2, "threads", None, None, in_memory=True, see=see)
    joined = time.monotonic() - solved[0]
    whole = fw.run(sweep_case, workers=1, in_memory=True)
    own = beyond = 0.0
    for part in parts:
        with part.open() as file:
            seconds = file["seconds"][()]
        skipped = part.piece.first - part.piece.solved[0]
        mine = seconds[skipped:skipped + part.piece.last - part.piece.first + 1].sum()
        own, beyond = own + mine, beyond + seconds.sum() - mine
    spans = [part.seconds for part in parts]
    begun = min(span[0] for span in spans)
    busy = sum(end - begin for begin, end in spans)
    pieces = "; ".join(f"{part.piece.first} to {part.piece.last}: {end - begin:.2f}"
                       for part, (begin, end) in zip(parts, spans))
    times = (float(whole["seconds"].sum()), own, beyond, busy - own - beyond, waiting(spans),
             begun - started + joined, start_of_python(build))
    return (name, pieces, *(f"{seconds:.2f}" for seconds in times))


def waiting(spans: Sequence[tuple[float, float]]) -> float:
    """Time that two workers have nothing to do between the first begin and the last end [s]."""
    whole = max(end for _, end in spans) - min(begin for begin, _ in spans)
    return 2.0 * whole - sum(end - begin for begin, end in spans)


def start_of_python(build: Path) -> float:
    """Of a command that does nothing [s]; the fastest of five."""
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'python'}:{build / 'python'}"}
    times = []
    for _ in range(5):
        started = time.perf_counter()
        subprocess.run([sys.executable, "-m", "fretwear", "run", "--help"], check=True,
                       env=environment, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - started)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--cases", type=int, nargs="+", default=list(range(1, len(SWEEPS) + 1)),
                        help="numbers of those to measure")
    parser.add_argument("--quick", action="store_true",
                        help="41 points, once, onto the screen alone: tries the script")
    arguments = parser.parse_args()
    turns, parts = [], []
    with tempfile.TemporaryDirectory() as place:
        for number in arguments.cases:
            pairs, n_harmonics, start, end = SWEEPS[number - 1]
            name = f"{pairs} pairs, H = {n_harmonics}"
            write_namelist(Path(place) / "case.nml",
                           sweep(pairs, n_harmonics, start, end, arguments.quick))
            turns.append(measure(name, arguments.build.resolve(), Path(place),
                                 1 if arguments.quick else arguments.turns))
            print(*turns[-1].row, sep=" | ", flush=True)
            parts.append(limits(name, arguments.build.resolve(), Path(place)))
            print(*parts[-1], sep=" | ", flush=True)
    if arguments.quick:
        return
    write(arguments.page, MARKS, table(
        ["case", "one worker [s]", "two [s]", f"ratio, at least {WANTED}", "of the fastest",
         "largest difference of rows"], [one.row for one in turns]))
    write(arguments.page, LIMIT_MARKS, table(
        ["case", "rows of each piece and its time [s]", "rows by one worker [s]",
         "the same by two", "rows beyond the cuts", "leads, set-up, peaks", "waiting for the other",
         "reading and joining", "start of Python"], parts))


if __name__ == "__main__":
    main()
