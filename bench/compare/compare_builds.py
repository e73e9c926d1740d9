#!/usr/bin/env python3
"""Two builds side by side: the same numbers, the same work, and paired times.

    compare_builds.py [--of FW_RUN] --with OTHER_FW_RUN [--group GROUP ...] [--times N]
                      [--instructions]

Runs the cases of comparison_cases.py (every example, the paper's tables, the sweeps of
docs/benchmarks.md, wear, a case for every other feature) with both programs and compares every
dataset of the results: reals to 1e-12 of the largest number of their dataset, all others exactly,
iterations among them. What depends on the clock is left out; residuals, which are round-off at the
end, may differ by a tenth of the tolerance that they are held to. Datasets that only one build
writes are named; one that is gone counts as a difference, one that is new does not.

With --times the sweeps are run N times by each build in turn: medians of the ratios of processor
time and of peak memory, which other programs on the machine disturb little. With --instructions
each sweep is run once by each build under callgrind, and the instructions are counted: nothing
disturbs these, and those of the search for peaks between the points, which is work of its own, are
told apart. (Valgrind has to know the instructions: builds for older processors than the newest,
such as CMAKE_Fortran_FLAGS=-march=x86-64-v3.) Ends with status 1 where numbers or counts differ.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from bench.common.measure import ROOT, processor_time, watch_memory
from bench.compare.comparison_cases import GROUPS, Case

#: Largest difference of a real, over the largest of its dataset: round-off of the same operations
#: in another order.
TOLERANCE = 1e-12
#: Of residuals: a tenth of the 1e-8 that points are solved to.
RESIDUAL_TOLERANCE = 1e-9
#: What the clock makes.
CLOCK = ("seconds",)
#: What looks for peaks between the points, by its names in a program of gfortran.
SEARCH = "__fw_peak_finder_MOD_search", "__fw_joint_modes_MOD_find_joint_modes"
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Outcome:
    """A run: exit status, counts of its summary by name, and datasets."""

    status: int
    work: dict[str, int]
    data: dict[str, np.ndarray]


@dataclass(frozen=True)
class Verdict:
    """A case with both builds: the largest difference, its dataset, and what else there is."""

    difference: float
    dataset: str
    iterations: int
    wrong: tuple[str, ...]
    remarks: tuple[str, ...]


def execute(program: Path, case: Case, folder: Path) -> tuple[str, int, Path]:
    """Run a case; its summary, its status and its result."""
    result = folder / "result.h5"
    result.unlink(missing_ok=True)
    done = subprocess.run([program, "-o", result, *case.arguments], env=ENVIRONMENT, text=True,
                          capture_output=True, check=False)
    if done.returncode not in (0, 4):
        raise SystemExit(f"{program}, {case.name}: status {done.returncode}\n{done.stderr}")
    return done.stdout, done.returncode, result


def outcome(program: Path, case: Case, folder: Path) -> Outcome:
    """Run a case and read what it left."""
    summary, status, result = execute(program, case, folder)
    work = {name: int(number) for number, name in re.findall(
        r"(\d+) (LU factorizations|Krylov iterations|preconditioners)", summary)}
    data = {}
    with h5py.File(result) as file:
        file.visititems(lambda name, item: data.update(
            {name: item[()]} if isinstance(item, h5py.Dataset) else {}))
    return Outcome(status, work, data)


def compare(ours: Outcome, other: Outcome) -> Verdict:
    """Every dataset of the other build with ours."""
    wrong, remarks, worst, where = [], [], 0.0, ""
    if ours.status != other.status:
        wrong.append(f"status {other.status}, now {ours.status}")
    for name in sorted(set(other.data) - set(CLOCK)):
        if name not in ours.data:
            wrong.append(f"no {name}")
            continue
        old, new = np.asarray(other.data[name]), np.asarray(ours.data[name])
        if old.shape != new.shape:
            wrong.append(f"{name} of shape {old.shape}, now {new.shape}")
        elif old.dtype.kind != "f":
            if not np.array_equal(old, new):
                wrong.append(f"{name} differs")
        elif name == "residual":
            if not np.allclose(old, new, rtol=0.0, atol=RESIDUAL_TOLERANCE, equal_nan=True):
                wrong.append("residuals differ")
        elif (found := difference(old, new)) > worst:
            worst, where = found, name
    if worst > TOLERANCE:
        wrong.append(f"{where} differs")
    remarks += [f"{name} {other.work[name]}, now {ours.work.get(name)}" for name in other.work
                if other.work[name] != ours.work.get(name)]
    if new_names := sorted(set(ours.data) - set(other.data)):
        remarks.append("new: " + ", ".join(new_names))
    return Verdict(worst, where, int(other.data["iterations"].sum()), tuple(wrong), tuple(remarks))


def difference(old: np.ndarray, new: np.ndarray) -> float:
    """Largest difference over the largest number; infinite where one is no number and the other
    is."""
    if not np.array_equal(np.isfinite(old), np.isfinite(new)):
        return float("inf")
    finite = np.isfinite(old)
    if not finite.any():
        return 0.0
    scale = np.abs(old[finite]).max()
    return float(np.abs(new[finite] - old[finite]).max() / (scale if scale > 0.0 else 1.0))


def compare_numbers(cases: list[Case], ours: Path, other: Path, folder: Path) -> bool:
    """Print the table of all cases; whether nothing differs."""
    good = True
    print("| case | iterations | largest difference | of | verdict |\n|---|---|---|---|---|")
    for case in cases:
        found = compare(outcome(ours, case, folder), outcome(other, case, folder))
        good = good and not found.wrong
        words = "; ".join((*(f"**{word}**" for word in found.wrong), *found.remarks)) or "equal"
        print(f"| {case.name} | {found.iterations} | {found.difference:.1e} | {found.dataset} "
              f"| {words} |", flush=True)
    print("\nNothing differs." if good else "\n**There are differences.**", flush=True)
    return good


def weigh(program: Path, case: Case, folder: Path) -> tuple[float, float]:
    """Processor time [s] and peak memory [MB] of a run."""
    before = processor_time()
    with watch_memory(program) as peak:
        execute(program, case, folder)
    return processor_time() - before, peak[0]


def compare_times(cases: list[Case], programs: tuple[Path, Path], repeats: int,
                  folder: Path) -> None:
    """Print the table of paired times; the builds take turns in going first."""
    print("\n| case | runs | processor time [s] | ratio | smallest to largest | memory [MB] "
          "| ratio |\n|---|---|---|---|---|---|---|")
    for case in cases:
        pairs = [pair(case, programs, bool(k % 2), folder) for k in range(repeats)]
        time, memory = ([one[0][i] / one[1][i] for one in pairs] for i in (0, 1))
        middle = [statistics.median(one[0][i] for one in pairs) for i in (0, 1)]
        print(f"| {case.name} | {repeats} | {middle[0]:.3g} | {statistics.median(time):.3f} "
              f"| {min(time):.3f} to {max(time):.3f} | {middle[1]:.1f} "
              f"| {statistics.median(memory):.3f} |", flush=True)


def count_instructions(program: Path, case: Case, folder: Path) -> tuple[float, float]:
    """Instructions of a run, and those of them in the search for peaks."""
    profile = folder / "callgrind.out"
    subprocess.run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={profile}", program,
                    "-q", "-o", folder / "result.h5", *case.arguments],
                   env=ENVIRONMENT, capture_output=True, check=True)
    listing = subprocess.run(["callgrind_annotate", "--inclusive=yes", "--threshold=100", profile],
                             text=True, capture_output=True, check=True).stdout

    def read(pattern: str) -> float:
        found = re.search(rf"^ *([\d,]+) .*{pattern}", listing, re.MULTILINE)
        return float(found[1].replace(",", "")) if found else 0.0

    return read("PROGRAM TOTALS"), sum(map(read, SEARCH))


def compare_instructions(cases: list[Case], programs: tuple[Path, Path], folder: Path) -> None:
    """Print the table of instructions."""
    print("\n| case | instructions [1e9] | ratio | in the search for peaks | ratio without it "
          "|\n|---|---|---|---|---|")
    for case in cases:
        (ours, searching), (other, before) = (
            count_instructions(program, case, folder) for program in programs)
        print(f"| {case.name} | {1e-9*ours:.3f} | {ours/other:.3f} | {searching/ours:.1%} "
              f"| {(ours - searching)/(other - before):.3f} |", flush=True)


def pair(case: Case, programs: tuple[Path, Path], swapped: bool,
         folder: Path) -> list[tuple[float, float]]:
    """One run of each, the second first where swapped."""
    order = programs[::-1] if swapped else programs
    found = [weigh(program, case, folder) for program in order]
    return found[::-1] if swapped else found


def chosen(groups: list[str]) -> Iterator[Case]:
    """Cases of these groups, without those that two of them share."""
    seen = set()
    for name in groups:
        for case in GROUPS[name]():
            if case.name not in seen:
                seen.add(case.name)
                yield case


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Compare two builds.")
    parser.add_argument("--of", type=Path, default=ROOT / "build" / "release" / "fw_run",
                        help="fw_run (default: build/release/fw_run)")
    parser.add_argument("--with", type=Path, required=True, dest="other", help="the other fw_run")
    parser.add_argument("--group", nargs="+", choices=list(GROUPS), default=list(GROUPS))
    parser.add_argument("--times", type=int, default=0, metavar="N",
                        help="also N paired runs of each sweep")
    parser.add_argument("--instructions", action="store_true",
                        help="also the instructions of each sweep, under callgrind")
    parser.add_argument("--only-times", action="store_true", help="no numbers")
    parser.add_argument("--case", default="", help="only cases with this in their name")
    options = parser.parse_args()
    programs = options.of.absolute(), options.other.absolute()
    timed = [case for case in GROUPS["sweeps"]() if options.case in case.name]
    good = True
    with tempfile.TemporaryDirectory(prefix="fw_compare_") as name:
        if not options.only_times:
            good = compare_numbers([case for case in chosen(options.group)
                                    if options.case in case.name], *programs, Path(name))
        if options.times:
            compare_times(timed, programs, options.times, Path(name))
        if options.instructions:
            compare_instructions(timed, programs, Path(name))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
