"""Dampers and polynomials integrated in time.

Against solutions from elsewhere (test/reference/laws), springs of the same force, and the balance
of a joint with all of them; in test/unit/test_time_elements.pf against a free decay.
"""
import json

import numpy as np
import pytest
import test_dampers
import test_polynomial
from cases import merged, run
from oracle_runs import run_case
from project import ROOT
from test_several_laws import coefficients_of, difference

DAMPERS = json.loads((ROOT / "test/reference/laws/law_damper.json").read_text())["cases"]
#: Periods that repeat to 1e-8, the least that is asked for, and a margin of ten.
REPEATS = 1e-7
#: Midpoint steps of a period, and the motion's error of second order that they leave: 3e-6, and a
#: margin of ten.
STEPS, ERROR = 1000, 3e-5


def in_time(groups, steps=STEPS):
    return merged(groups, {"case": {"analysis": "time"}, "time": {"steps_per_period": steps}})


@pytest.mark.parametrize("name", ["quadratic", "position_dependent", "cubic_and_power_1.5"])
def test_dampers_as_integrated_elsewhere(tmp_path, name):
    case = DAMPERS[name]
    found = run_case(tmp_path, in_time(test_dampers.groups(case["params"], 7)))
    assert found.converged.all()
    assert difference(found.coefficients[0][:15, 0], coefficients_of(case["u1"], 7)[:15]) < REPEATS


def test_potential_as_integrated_elsewhere(tmp_path):
    case = test_polynomial.EXACT["coupled"]
    p = case["params"]
    for form in (test_polynomial.energy, test_polynomial.forces):
        found = run_case(tmp_path, in_time(test_polynomial.groups(p, form(p["potential"]), 7)))
        assert found.converged.all()
        assert difference(found.coefficients[0], test_polynomial.exact(case, 7)) < REPEATS


SPRINGS = {"spring": {"n_springs": 2, "side_1": [1, 2], "coefficient": [0.5, 0.3], "power": [3, 2]}}
TERMS = {"polynomial": {"n_terms": 2, "coefficient": [0.125, 0.1],
                        "factors": [1, 1, 1, 1, 0, 0, 0, 0, 2, 2, 2, 0, 0, 0, 0, 0]}}


@pytest.mark.parametrize("mass", [0.8, 0.0])
def test_polynomials_that_are_springs(tmp_path, mass):
    """With and without inertia: by formulas of high order, and by midpoint steps."""
    k = np.array([[3.0, -1.0], [-1.0, 2.0]])
    groups = {"case": {"analysis": "time"},
              "model": {"n_dof": 2, "mass": np.diag([1.0, mass]), "stiffness": k,
                        "damping": 0.05 * np.diag([1.0, mass])},
              "load": {"cosine": [0.8, 0.3]}, "harmonics": {"n_harmonics": 5},
              "sweep": {"start": 1.3}, "time": {"steps_per_period": 256}}
    springs, terms = (run_case(tmp_path, merged(groups, elements)).coefficients[0]
                      for elements in (SPRINGS, TERMS))
    assert difference(terms, springs) < REPEATS


def joint(**damper):
    """A mass that rubs, with a damper and a potential to the next one."""
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": np.diag([1.0, 0.8]), "damping": 0.04 * np.eye(2),
                  "stiffness": np.array([[2.0, -1.0], [-1.0, 2.2]])},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "normal_load": 0.5,
                    "mu": 0.4, "tangential_stiffness": 1.5},
        "damper": {"n_dampers": 2, "side_1": [1, 2], "side_2": [2, 0], "coefficient": [0.2, 0.1],
                   "power": [2.0, 1.0], "position_power": [0, 2], **damper},
        "polynomial": {"n_terms": 1, "coefficient": [0.2], "factors": [1, 1, 2, 2, 0, 0, 0, 0]},
        "load": {"cosine": [0.8, 0.3]}, "harmonics": {"n_harmonics": 31},
        "sweep": {"start": 1.1}, "solver": {"tolerance": 1e-9}}


def test_joint_is_as_balanced(tmp_path):
    balanced = run_case(tmp_path, joint())
    errors = []
    for steps in (STEPS, 2 * STEPS):
        found = run_case(tmp_path, in_time(joint(), steps))
        assert found.converged.all()
        errors.append(difference(found.coefficients[0][:15], balanced.coefficients[0][:15]))
    assert errors[0] < ERROR
    # Of second order, but for where friction switches between the smallest steps.
    assert errors[1] < 0.4 * errors[0]


def test_a_damper_without_mass_is_refused(tmp_path):
    case = in_time(joint())
    case["model"] = case["model"] | {"mass": np.diag([1.0, 0.0])}
    done = run(tmp_path, case, status=3)
    assert "element 1 of &damper acts on a dof without mass" in done.stderr
