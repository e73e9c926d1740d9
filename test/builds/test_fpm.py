"""The library and the program as fpm builds them: `fpm test`, and an example with its number.

Built with the flags of tools/check_builds.sh, so that `.ci/run` builds it once. What fpm builds
stays in build/gfortran_*.
"""
import os
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "example" / "jenkins" / "jenkins.nml"
#: Of the closed form in the README of the example; tolerance of what 1024 instants leave.
AMPLITUDE, AT, TOLERANCE = 9.468233129, 1.0, 1e-6
FLAGS = ("--flag", "-O0")
#: Seconds for a first build on two cores that are busy with others.
SLOW = 900


def fpm(*words):
    """Run fpm with no variable that it or a compiler looks at; what it says."""
    environment = {name: value for name, value in os.environ.items()
                   if not name.startswith(("FPM_", "LD_", "FC", "CC", "F90"))
                   and name not in ("LDFLAGS", "FFLAGS", "CFLAGS", "CPATH", "LIBRARY_PATH")}
    done = subprocess.run([sys.executable, "-m", "fpm", *words], cwd=ROOT, env=environment,
                          text=True, capture_output=True, check=False, timeout=SLOW)
    assert done.returncode == 0, f"fpm {words[0]}: {done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done.stdout


@pytest.fixture(scope="module", autouse=True)
def fresh_archive():
    """fpm adds to the library of an earlier build and leaves sources in it that have moved."""
    for path in (ROOT / "build").glob("gfortran_*/fretwear/libfretwear.a"):
        path.unlink()


def test_closed_forms():
    """`fpm test` compares with closed forms and ends with a status where they do not hold."""
    said = fpm("test", *FLAGS)
    assert said.count("tolerance") == 4, said


def test_example(tmp_path):
    """An example with the program of fpm, and the number that its README promises."""
    result = tmp_path / "jenkins.h5"
    said = fpm("run", *FLAGS, "fw_run", "--", "-o", str(result), str(EXAMPLE))
    assert "converged" in said
    with h5py.File(result) as file:
        nearest = abs(file["omega"][:] - AT).argmin()
        found = file["amplitude"][nearest, 0]
    assert found == pytest.approx(AMPLITUDE, rel=TOLERANCE)
