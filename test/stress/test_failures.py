"""Failures that have words of their own, and answers that once were wrong."""
from __future__ import annotations

import numpy as np
import pytest
import stress_cases as cases
import stress_run as runs
from stress_models import frequencies, interface, slider


@pytest.mark.parametrize("solver", cases.SOLVERS)
def test_a_resonance_that_nothing_limits_is_no_solution(solver):
    joint = interface(1, loss=0.0)
    free = joint.with_(side_1=np.zeros((0, 3), int))
    end = runs.run(cases.make("test", "mode", free, solver, omegas=frequencies(joint)[1]))
    assert end.verdict == "words"
    assert end.n_converged == 0
    assert "grows without bound" in end.text


def test_friction_limits_the_resonance_of_a_slider():
    """F < 4/pi mu N: the response is bounded, and found."""
    end = runs.run(cases.make("test", "slider", slider(normal_load=2.5, damping=0.0), omegas=1.0,
                              n_harmonics=5))
    assert end.verdict == "converged"


def test_a_stiff_penalty_is_no_lack_of_support():
    """The search for a position at rest began where the vibration would have been linear."""
    joint = interface(2).with_(contact_stiffness=1e9)
    end = runs.run(cases.make("test", "stiff", joint, law="penalty"))
    assert end.verdict == "words"
    assert "of the vibratory load" in end.text and "law = 'dlft'" in end.text
    assert runs.run(cases.make("test", "rigid", joint)).verdict == "converged"


@pytest.mark.parametrize("method", ["tcm", "tcm_least_squares"])
def test_forces_of_a_collocation_balance_the_displacements(method):
    case = cases.make("test", method, interface(2, preload=0.5), n_harmonics=2, n_time=17,
                      harmonics={"method": method})
    assert runs.run(case).verdict == "converged"


def test_a_sweep_that_fails_in_part_says_what_to_try():
    # Without fallbacks nothing leads over the jump to slip.
    joint = interface(2, preload=1e-3, loss=1e-3)
    case = cases.make("test", "sweep", joint, omegas=(0.3, 1.5, 12))
    case.groups["solver"] = {"fallback": False, "max_iterations": 4}
    end = runs.run(case)
    assert end.verdict == "words"
    assert 0 < end.n_converged < end.n_points
    assert "not converged: try a finer sweep" in end.text
