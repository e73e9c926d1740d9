"""Traps, sanitizers and valgrind."""
import os
import re
import tempfile
from pathlib import Path

from common import ROOT, build, report, run, run_tests
from optimisation import plain_build

SECTOR = ROOT / "example" / "blade_sector"
#: Tests of the program alone: the package would load an instrumented library into an interpreter
#: that is not instrumented.
OF_THE_PROGRAM = ("test/cli", "test/oracles", "test/modes", "test/resonance")
HEAD = ["| tests | warnings | passed | failed | skipped |", "|---|---|---|---|---|"]


def traps(setting):
    """Every test with traps on invalid operations, division by zero and overflow."""
    directory, warnings = build(setting, "traps", "-DCMAKE_BUILD_TYPE=Debug")
    counts = run_tests(setting, directory)
    return [*HEAD, f"| all | {warnings} | {counts.row()} |"], counts.good and not warnings


def sanitize(setting):
    """Unit tests, program and reference solutions with address and undefined sanitizers."""
    directory, warnings = build(
        setting, "sanitize", "-DFRETWEAR_SANITIZE=address,undefined",
        "-DCMAKE_Fortran_FLAGS=-O1 -g", "-DFRETWEAR_PYTHON=OFF", "-DFRETWEAR_SHARED=OFF")
    counts = run_tests(setting, directory, *OF_THE_PROGRAM,
                       environment={"UBSAN_OPTIONS": "print_stacktrace=1"})
    names = ", ".join(f"`{name}`" for name in OF_THE_PROGRAM)
    return [*HEAD, f"| unit tests, {names} | {warnings} | {counts.row()} |"], counts.good


def memcheck(setting):
    """A point of the sector under valgrind."""
    directory, _ = plain_build(setting)
    lines, clean = ["| run | errors | bytes definitely lost |", "|---|---|---|"], True
    for name, options in (("Newton", ()), ("pseudo-time, BDF", (
            "--set", "solver%kind='pseudo_time'", "--set", "pseudo_time%scheme='bdf'"))):
        errors, lost = under_valgrind(directory, options)
        lines.append(f"| {name} | {errors} | {lost} |")
        clean = clean and errors == 0 and lost == 0
    return lines, clean


def under_valgrind(directory, options):
    """Errors and lost bytes of a run of 16 pairs at one frequency.

    OpenBLAS is kept to kernels whose instructions valgrind knows.
    """
    with tempfile.TemporaryDirectory(prefix="fw_memcheck_") as folder:
        result = Path(folder) / "point.h5"
        done = run(["valgrind", "--leak-check=full", "--error-limit=no", directory / "fw_run",
                    "-q", "-o", result, "--set", "case%analysis='point'",
                    "--set", "sweep%start=1020", "--set", "case%threads=1", *options,
                    SECTOR / "frf.nml"],
                   env=dict(os.environ, OPENBLAS_CORETYPE="Nehalem"))
        if not result.exists():
            raise SystemExit(f"{done.stdout}\nthe run under valgrind wrote no result")
    errors = re.search(r"ERROR SUMMARY: ([\d,]+) errors", done.stdout)[1]
    lost = re.search(r"definitely lost: ([\d,]+) bytes", done.stdout)
    if errors != "0":
        report(done.stdout)
    return (int(errors.replace(",", "")), int(lost[1].replace(",", "")) if lost else 0)
