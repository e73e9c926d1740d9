"""Pairs of the velocity law that stop slipping: one answer, that of a judge, whatever the way."""
import pytest
from project import PROGRAM
from rest_cases import N_TIME, judged, random_rest
from shakedown import ONE_ANSWER, SAME_IN_TIME, answer, verdict

#: Instants of the judge where the program locates events. Its way is a polygon then, of first order
#: where two directions slide: measured 2e-5 of the position.
MANY = 16 * N_TIME
SAME_BY_EVENTS = 2e-4


@pytest.mark.parametrize("seed", range(6))
def test_one_answer(tmp_path, seed):
    """The first of the family that docs/robustness.md counts."""
    case = random_rest(seed)
    true = judged(case)
    assert true is not None
    spread, off, in_time, missed = verdict(tmp_path, case, true, PROGRAM)
    assert missed == 0
    assert spread < ONE_ANSWER
    assert off < ONE_ANSWER
    assert in_time < SAME_IN_TIME


@pytest.mark.parametrize("seed", [1, 2])
def test_by_events(tmp_path, seed):
    """The march of a path without instants."""
    case = random_rest(seed)
    found, converged = answer(tmp_path, case, {"harmonics": {"sampling": "events",
                                                             "n_time": None}}, PROGRAM)
    true = judged(case, MANY)
    assert converged
    assert abs(found - true).max() < SAME_BY_EVENTS * abs(true).max()
