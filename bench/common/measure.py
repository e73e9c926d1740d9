"""Run fw_run, read the times that it writes, and say on what they were measured."""

from __future__ import annotations

import os
import platform
import re
import resource
import statistics
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

__all__ = ["ROOT", "Bench", "Cost", "Floats", "Groups", "Run", "describe_machine",
           "write_namelist"]

ROOT = Path(__file__).resolve().parents[2]
Floats = NDArray[np.float64]
Groups = dict[str, dict[str, object]]


@dataclass(frozen=True)
class Run:
    """What one run left.

    Attributes
    ----------
    omega : (n_points,)
        Frequencies [rad/s].
    seconds : (n_points,)
        Time spent on each point [s].
    iterations : (n_points,)
        Newton steps.
    converged : (n_points,) bool
    is_loose : (n_points,) bool
        Points where every pair is open all the time: the blade has left its slot. The equations
        allow it, an engine does not, and such points cost next to nothing.
    coefficients : (n_points, 2H+1, n_observed)
    amplitude : (n_points, n_observed)
        Largest absolute value over the period.
    residual : (n_points,)
        Relative, at the end; of an integration in time, the change over the last period.
    elapsed : float
        Time of the whole run without reading the input [s].
    unknowns, unknowns_left : int
        Unknowns, and their mean number in the linear problems.
    harmonics, instants : (n_points,)
        What points chose that keep an accuracy; empty without one.
    estimate : (n_points,)
        Bound of the relative error that they claim.
    """

    omega: Floats
    seconds: Floats
    iterations: NDArray[np.int64]
    converged: NDArray[np.bool_]
    is_loose: NDArray[np.bool_]
    coefficients: Floats
    amplitude: Floats
    residual: Floats
    elapsed: float
    unknowns: int
    unknowns_left: int
    harmonics: NDArray[np.int64]
    instants: NDArray[np.int64]
    estimate: Floats

    @property
    def usable(self) -> int:
        """Number of points that converged to a joint that holds."""
        return int((self.converged & ~self.is_loose).sum())


@dataclass(frozen=True)
class Cost:
    """What a run took of the machine.

    Attributes
    ----------
    processor : float
        Time in the program and for it in the system [s].
    share : float
        The same over the wall time: below one where other programs had the processor meanwhile.
    memory : float
        At its peak [MB].
    krylov_iterations, preconditioners : int
    """

    processor: float
    share: float
    memory: float
    krylov_iterations: int
    preconditioners: int


class Bench:
    """Runs cases in a folder of their own.

    Parameters
    ----------
    program : Path
        fw_run.
    folder : Path
        Where namelists and results go.
    quick : bool
        One short run of everything: to try the scripts, not to measure.
    """

    def __init__(self, program: Path, folder: Path, quick: bool = False) -> None:
        self.program, self.folder, self.quick = program, folder, quick
        folder.mkdir(parents=True, exist_ok=True)

    def run(self, groups: Groups, threads: int = 1, wait: str | None = None) -> Run:
        """Run a case once; points that do not converge are no error.

        `wait` is OMP_WAIT_POLICY: whether idle threads spin ("active") or sleep ("passive").
        """
        result = self.folder / "case.h5"
        return read_run(result, self.execute(groups, result, threads, wait)[0])

    def execute(self, groups: Groups, result: Path, threads: int = 1,
                wait: str | None = None, blas_threads: int = 1, *,
                statuses: tuple[int, ...] = (0, 4)) -> tuple[str, float]:
        """Run a case into a result file: what fw_run printed, and its processor time [s].

        The library uses no threads of BLAS; those that OpenBLAS starts wait for work all the same.
        A run that ends with another of the `statuses` is an error.
        """
        namelist = result.with_suffix(".nml")
        write_namelist(namelist, groups)
        environment = os.environ | {"OMP_NUM_THREADS": str(threads),
                                    "OPENBLAS_NUM_THREADS": str(blas_threads)}
        if wait:
            environment["OMP_WAIT_POLICY"] = wait
        before = processor_time()
        done = subprocess.run([self.program, "-o", result, namelist], env=environment,
                              capture_output=True, text=True, check=False)
        if done.returncode not in statuses:
            raise RuntimeError(f"fw_run ended with {done.returncode}:\n{done.stderr}")
        return done.stdout, processor_time() - before

    def run_and_weigh(self, groups: Groups) -> tuple[Run, Cost]:
        """Run a case in one thread, and what it took."""
        result = self.folder / "case.h5"
        start = time.perf_counter()
        with watch_memory(self.program) as peak:
            summary, processor = self.execute(groups, result)
        wall = time.perf_counter() - start
        counts = re.search(r"(\d+) Krylov iterations, (\d+) preconditioners", summary)
        return read_run(result, summary), Cost(processor, min(processor / wall, 1.0), peak[0],
                                               *map(int, counts.groups()))

    def repeat(self, groups: Groups, value: Callable[[Run], float], threads: int = 1,
               most: int = 5, budget: float = 5.0, wait: str | None = None) -> tuple[float, Run]:
        """Median of a value over repeated runs, as many as fit into the budget [s]."""
        values, start = [], time.perf_counter()
        while True:
            run = self.run(groups, threads, wait)
            values.append(value(run))
            if self.quick or len(values) == most or time.perf_counter() - start > budget:
                return statistics.median(values), run


@contextmanager
def watch_memory(program: Path) -> Iterator[list[float]]:
    """Peak memory [MB] of a child that runs the program, read while it runs.

    Not that of getrusage, which counts what this program held when it started the child.
    """
    peak, done = [0.0], threading.Event()

    def watch() -> None:
        while not done.wait(0.002):
            for child in children():
                peak[0] = max(peak[0], high_water(child, program))

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        yield peak
    finally:
        done.set()
        watcher.join()


def children() -> list[str]:
    """Processes that this one has started."""
    try:
        return [number for task in Path("/proc/self/task").iterdir()
                for number in (task / "children").read_text().split()]
    except OSError:
        return []


def high_water(number: str, program: Path) -> float:
    """Largest memory [MB] that a process has held, if it runs the program by now."""
    try:
        if not os.path.samefile(f"/proc/{number}/exe", program):
            return 0.0
        status = Path(f"/proc/{number}/status").read_text()
    except OSError:
        return 0.0
    found = re.search(r"VmHWM:\s+(\d+) kB", status)
    return int(found[1]) / 1024.0 if found else 0.0


def processor_time() -> float:
    """Of all programs that this one has started and that have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def read_run(path: Path, summary: str) -> Run:
    """A result file and the summary that fw_run printed."""
    with h5py.File(path, "r") as file:
        omega = file["omega"][()]
        loose = np.zeros(len(omega), dtype=bool)
        if "contact/fraction" in file:
            loose = file["contact/fraction"][:, :, 2].min(axis=1) > 1.0 - 1e-12
        found = re.search(r"^unknowns +(\d+)", summary, re.MULTILINE)
        unknowns = int(found[1]) if found else 0
        skipped = re.search(r"stuck pairs, (\d+) %", summary)
        share = int(skipped[1]) / 100.0 if skipped else 0.0
        return Run(file["omega"][()], file["seconds"][()], file["iterations"][()],
                   file["converged"][()].astype(bool), loose, file["coefficients"][()],
                   file["amplitude"][()], file["residual"][()], float(file.attrs["elapsed"]),
                   unknowns, round(unknowns * (1.0 - share)),
                   *(file[name][()] if name in file else np.zeros(0)
                     for name in ("harmonics", "instants", "error_estimate")))


def write_namelist(path: Path, groups: Groups) -> None:
    """Write {group: {key: value}} as a namelist."""
    lines = []
    for group, keys in groups.items():
        entries = (f"   {key} = {literal(value)}" for key, value in keys.items())
        lines += [f"&{group}", *entries, "/"]
    path.write_text("\n".join(lines) + "\n")


def literal(value: object) -> str:
    """A value as a namelist takes it."""
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, (str, Path)):
        return f"'{value}'"
    if isinstance(value, (list, tuple)):
        return ", ".join(literal(item) for item in value)
    return repr(value)


def describe_machine(build: Path) -> dict[str, str]:
    """Processor, compiler, flags, commit and load, for the head of the report."""
    cores = len(os.sched_getaffinity(0))
    return {
        "processor": f"{processor_name()}, {cores} core{'s' if cores > 1 else ''} usable",
        "compiler": compiler_version(build),
        "flags": build_flags(build),
        "commit": commit(),
        "date": date.today().isoformat(),
        "load before": f"{os.getloadavg()[0]:.1f} (a quiet machine is near 0)",
    }


def processor_name() -> str:
    """Model name as the system gives it."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return found[1].strip() if found else platform.machine()


def compiler_version(build: Path) -> str:
    """First line that the compiler of the build says about itself."""
    cache = (build / "CMakeCache.txt").read_text(encoding="utf-8")
    path = re.search(r"^CMAKE_Fortran_COMPILER:\w+=(.+)$", cache, re.MULTILINE)[1]
    return subprocess.run([path, "--version"], capture_output=True, text=True,
                          check=True).stdout.splitlines()[0]


def build_flags(build: Path) -> str:
    """Options that decide on speed, as the compiler got them."""
    ninja = (build / "build.ninja").read_text(encoding="utf-8")
    found = re.search(r"build [^\n]*newton[^\n]*\n(?:  [^\n]*\n)*?  FLAGS = ([^\n]*)", ninja)
    words = found[1].split() if found else []
    return " ".join(word for word in words if re.match(r"-(O|g$|m|f(openmp|fast))", word))


def commit() -> str:
    """Short hash, with a mark where the sources differ from it."""
    def git(*arguments: str) -> str:
        return subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True,
                              check=False).stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", "--", "src", "app")
    return (git("rev-parse", "--short", "HEAD") or "unknown") + (" with changes" if changed else "")
