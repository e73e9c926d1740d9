"""Optimisation: the tests with all of it, and results with and without it side by side."""
import subprocess
import tempfile
from pathlib import Path

import h5py
import numpy as np
from common import ROOT, build, run_tests

#: Sweeps and histories whose points are given by the input; a branch has its own for each build.
EXAMPLES = ("blade_sector/frf.nml", "blade_sector/frf_stuck.nml", "coulomb/coulomb.nml",
            "duffing/duffing.nml", "gap/gap.nml", "jenkins/jenkins.nml",
            "separation/separation.nml", "wear/oscillator.nml", "wear/two_pairs.nml")
#: Points stop at a residual of 1e-8 of the load; near a resonance with a modal damping of 1e-3
#: that is up to 1e-5 of the response, and each build comes to rest at another place within it.
TOLERANCE = 1e-5


def plain_build(setting):
    """The program without optimisation, for instructions that every processor has."""
    return build(setting, "plain", "-DCMAKE_Fortran_FLAGS=-O0 -g", "-DFRETWEAR_PYTHON=OFF",
                 "-DFRETWEAR_SHARED=OFF", "-DFRETWEAR_TESTS=OFF")


def builds(setting):
    """The tests with all optimisation, then the largest difference of any response from none."""
    plain, _ = plain_build(setting)
    native, warnings = build(setting, "native", "-DCMAKE_Fortran_FLAGS=-O3 -g",
                             "-DFRETWEAR_NATIVE=ON")
    lines, same = compare([plain / "fw_run", native / "fw_run"])
    counts = run_tests(setting, native)
    return ["| tests | warnings | passed | failed | skipped |", "|---|---|---|---|---|",
            f"| all | {warnings} | {counts.row()} |", "", *lines], \
        counts.good and not warnings and same


def compare(programs):
    """Largest difference of the coefficients, over the largest coefficient, of every example."""
    lines, worst = ["| example | difference |", "|---|---|"], 0.0
    for example in EXAMPLES:
        one, other = (coefficients(program, example) for program in programs)
        difference = np.abs(one - other).max() / np.abs(one).max()
        worst = max(worst, difference)
        lines.append(f"| `{example}` | {difference:.1e} |")
    return lines, worst <= TOLERANCE


def coefficients(program, example):
    """What a build computes: coefficients of all points."""
    with tempfile.TemporaryDirectory(prefix="fw_builds_") as folder:
        result = Path(folder) / "result.h5"
        subprocess.run([program, "-q", "-o", result, ROOT / "example" / example], check=True)
        with h5py.File(result) as file:
            return file["coefficients"][()]
