"""Slow stick-slip: easier balances of the same case lead to points that nothing else reaches."""
import subprocess

import pytest
from cases import write_namelist
from limits import limit
from project import PATIENT, PROGRAM
from slow_family import random_case, verdict

#: Cases of the family whose own balance is reached by none of its other ways: the first from fewer
#: harmonics; the second not at all.
FROM_FEWER, NOT_AT_ALL = 0, 15


def test_from_fewer_harmonics(tmp_path):
    """Judged by its own equations."""
    converged, right, _, served = verdict(tmp_path, random_case(FROM_FEWER), PROGRAM)
    assert converged
    assert right
    assert served == "other balance"


def test_the_message_names_time(tmp_path):
    """Where no balance is reached."""
    write_namelist(tmp_path / "case.nml", random_case(NOT_AT_ALL))
    done = subprocess.run([PROGRAM, "case.nml"], cwd=tmp_path, text=True, capture_output=True,
                          timeout=limit(120), check=False, env=PATIENT)
    assert done.returncode == 4
    assert "analysis = 'time'" in done.stdout + done.stderr


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_family(tmp_path, seed):
    """The first of the family that docs/robustness.md counts."""
    converged, right, _, _ = verdict(tmp_path, random_case(seed), PROGRAM)
    assert converged
    assert right
