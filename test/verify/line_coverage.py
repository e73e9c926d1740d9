"""Lines of src that the tests run, counted by gcovr, folder by folder."""
import csv
import shutil
import sys
from collections import defaultdict
from pathlib import Path

from common import build, run, run_tests

LEAST = 0.90
#: The tests of the Python package are left out: they run the same lines again.
TESTS = ("test/cli", "test/legacy", "test/oracles", "test/robustness", "test/stress")
# A file is listed with its lines that no test runs if they are more than this share of it.
LISTED = 0.15
#: Why lines of a file are not run, as far as it has been looked into.
REASONS = {
    "src/base/memory.f90": "memory that is refused",
    "src/balance/flow.f90": "scales of pseudo-time other than the default",
    "src/balance/guess.f90": "start without contact, a fallback",
    "src/driver/observer.f90": "empty procedures of the observer that ignores what it is told",
    "src/driver/vibration.f90": "fallbacks after a solver has failed",
    "src/io/hdf5_dataset.f90": "failures of HDF5, datasets of other types",
    "src/io/hdf5_read.f90": "ranks that no file of the tests has",
    "src/io/hdf5_text.f90": "ranks that no file of the tests has",
    "src/io/hdf5_write.f90": "ranks that no file of the tests has, a full disk",
    "src/io/restart_trial.f90": "runs in a process that ends before it writes its counts",
    "src/io/trial.f90": "runs in a process that ends before it writes its counts; damaged files",
    "src/math/fft.F90": "transforms of a copied system",
    "src/time/contact_step.f90": "fallback of a step of integration that does not converge",
}


def coverage(setting):
    """Unit tests and tests of the program on a build without optimisation that counts lines."""
    flags = ("EXE", "SHARED", "MODULE")
    directory, _ = build(setting, "coverage", "-DCMAKE_Fortran_FLAGS=-O0 -g --coverage",
                         *(f"-DCMAKE_{kind}_LINKER_FLAGS=--coverage" for kind in flags))
    for path in directory.rglob("*.gcda"):  # of an earlier run
        path.unlink()
    # Programs of the tests that link the static library need the counters' library too.
    counts = run_tests(setting, directory, *TESTS, environment={"LDFLAGS": "--coverage"})
    return summary(directory, counts)


def summary(directory, counts):
    """The section, and whether enough lines were run."""
    files = count_lines(directory)
    folders = defaultdict(lambda: [0, 0])
    for name, (lines, run_lines) in files.items():
        for key in (name.parts[1] if len(name.parts) > 2 else "src", "all"):
            folders[key][0] += lines
            folders[key][1] += run_lines
    total = folders.pop("all")
    table = ["| folder | lines | run | share |", "|---|---|---|---|"]
    for key, (lines, run_lines) in [*sorted(folders.items()), ("all", total)]:
        table.append(f"| {key} | {lines} | {run_lines} | {share(lines, run_lines)} |")
    low = sorted((1.0 - run_lines / lines, name) for name, (lines, run_lines) in files.items()
                 if lines and run_lines < (1.0 - LISTED) * lines)
    table += ["", f"Tests under this build: {counts.passed} passed, {counts.failed} failed, "
              f"{counts.skipped} skipped. Files below {1.0 - LISTED:.0%}:", "",
              "| file | lines not run | share run | what they are |", "|---|---|---|---|"]
    for _, name in reversed(low):
        lines, run_lines = files[name]
        table.append(f"| `{name}` | {lines - run_lines} of {lines} | {share(lines, run_lines)} | "
                     f"{REASONS.get(name.as_posix(), '')} |")
    return table, counts.good and total[1] >= LEAST * total[0]


def count_lines(directory):
    """Lines and lines run of every source, by its path.

    The objects name the preprocessed sources that Ninja builds from; gcov maps them back.
    """
    gcovr = shutil.which("gcovr") or Path(sys.executable).with_name("gcovr")
    report = directory / "coverage.csv"
    run([gcovr, "--root", ".", "--filter", "src/", "--merge-mode-functions", "separate",
         "--gcov-ignore-errors", "no_working_dir_found",
         "--gcov-ignore-parse-errors", "suspicious_hits.warn_once_per_file",
         "--csv", report, directory])
    with report.open(encoding="utf-8", newline="") as file:
        return {Path(row["filename"]): (int(row["line_total"]), int(row["line_covered"]))
                for row in csv.DictReader(file)}


def share(lines, run_lines):
    return f"{100.0 * run_lines / lines:.1f} %" if lines else ""
