"""Other processors than that of whoever wrote a tolerance: builds for the oldest and the newest
instructions, and the kernels that OpenBLAS takes on each of them.

The last digits of a sum depend on both, and a test that hangs on them fails elsewhere.
"""
from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from common import build, run_tests

#: Tests whose numbers come from the program.
NUMBERS = ("test/cli", "test/oracles", "test/modes", "test/resonance")
HEAD = ["| build | warnings | kernels | tests | passed | failed | skipped |",
        "|---|---|---|---|---|---|---|"]
#: Kernels of OpenBLAS on x86-64 and what a processor needs for them, as /proc/cpuinfo names it.
#: Prescott is what it falls back to on a processor that it does not know.
KERNELS = {"Prescott": (), "Nehalem": ("sse4_2",), "Sandybridge": ("avx",),
           "Haswell": ("avx2", "fma"), "Zen": ("avx2", "fma"),
           "SkylakeX": ("avx512f", "avx512bw", "avx512dq", "avx512vl")}
#: Its name for the kernel that it has taken.
ASK = ("import ctypes; lib = ctypes.CDLL('libopenblas.so.0'); "
       "lib.openblas_get_corename.restype = ctypes.c_char_p; "
       "print(lib.openblas_get_corename().decode())")


def march(setting):
    """All optimisation for the oldest processor, with the kernels of that; none for this one."""
    rows, clean = list(HEAD), True
    for name, flags, kernel in (("oldest", "-O3 -g -march=x86-64", "Prescott"),
                                ("unoptimised", "-O0 -g -march=native", None)):
        directory, warnings = build(setting, name, f"-DCMAKE_Fortran_FLAGS={flags}",
                                    "-DFRETWEAR_PYTHON=OFF", "-DFRETWEAR_SHARED=OFF")
        clean = row(setting, rows, (directory, warnings), flags, kernel, NUMBERS) and clean
    return rows, clean


def kernels(setting):
    """The optimised build with every kernel that this processor can run."""
    built = build(setting, "native", "-DCMAKE_Fortran_FLAGS=-O3 -g", "-DFRETWEAR_NATIVE=ON")
    rows, clean = list(HEAD), True
    for kernel in usable():
        tests = NUMBERS if kernel == "Prescott" else ()
        clean = row(setting, rows, built, "-O3 -g -march=native", kernel, tests) and clean
    return rows, clean


def row(setting, rows, built, flags, kernel, tests):
    """Run the unit tests and these of pytest, add a row; whether it is clean.

    `built` is the directory of the build, and how often the compiler warned where it compiled.
    """
    directory, warnings = built
    environment = {"OPENBLAS_CORETYPE": kernel} if kernel else {}
    counts = run_tests(setting, directory, *(tests or ["--unit-only"]), environment=environment)
    names = ", ".join(("unit tests", *(f"`{name}`" for name in tests)))
    rows.append(f"| `{flags}` | {warnings} | {taken(environment)} | {names} | {counts.row()} |")
    return counts.good and not warnings


def usable():
    """Kernels that this processor has the instructions for; none where it is another kind."""
    text = Path("/proc/cpuinfo").read_text()
    flags = set(next((line.split(":")[1].split() for line in text.splitlines()
                      if line.startswith("flags")), ()))
    return [name for name, needed in KERNELS.items() if "sse2" in flags and flags >= set(needed)]


def taken(environment):
    """What OpenBLAS itself says that it runs."""
    return subprocess.run([sys.executable, "-c", ASK], env={**os.environ, **environment},
                          capture_output=True, text=True, check=True).stdout.strip()
