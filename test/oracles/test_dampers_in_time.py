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
#: The same of twelve random joints, of which one has 1e-5.
WIDE = 1e-4


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


def random_joint(seed):
    """Two to four masses in a row, the first of which rubs, with dampers and potentials."""
    size = np.random.default_rng(7300 + seed)
    n = int(size.integers(2, 5))
    k = np.diag(size.uniform(0.5, 2.0, n))
    for i in range(n - 1):
        k[i:i + 2, i:i + 2] += size.uniform(0.2, 1.5) * np.array([[1, -1], [-1, 1]])
    law = str(size.choice(["penalty", "dlft", "regularised"]))
    contact = {"n_pairs": 1, "law": law, "side_1": [1, 0, 0], "mu": 0.4,
               "normal_load": float(size.uniform(0.2, 1.0))}
    if law == "penalty":
        contact["tangential_stiffness"] = float(size.uniform(0.5, 3.0))
    if law == "regularised":
        contact["slip_speed"] = float(size.uniform(0.05, 0.3))
    n_dampers, n_terms = int(size.integers(1, 3)), int(size.integers(1, 4))
    factors = np.zeros((n_terms, 8), int)
    for term in factors:
        if size.random() < 0.5:
            term[:4] = int(size.integers(1, n + 1))
        else:
            term[:4] = np.repeat(size.choice(np.arange(1, n + 1), 2, replace=False), 2)
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": n, "mass": np.diag(size.uniform(0.5, 1.5, n)), "stiffness": k,
                  "damping": 0.04 * k},
        "contact": contact,
        "damper": {"n_dampers": n_dampers, "side_1": size.integers(1, n + 1, n_dampers),
                   "coefficient": size.uniform(0.05, 0.4, n_dampers),
                   "power": size.choice([1.0, 1.5, 2.0, 3.0], n_dampers),
                   "position_power": size.choice([0, 2], n_dampers)},
        "polynomial": {"n_terms": n_terms, "coefficient": size.uniform(0.02, 0.3, n_terms),
                       "factors": factors.ravel()},
        "load": {"cosine": size.uniform(-1, 1, n), "sine": size.uniform(-0.5, 0.5, n)},
        "harmonics": {"n_harmonics": 31}, "sweep": {"start": float(size.uniform(0.6, 2.0))},
        "solver": {"tolerance": 1e-9}}


@pytest.mark.parametrize("seed", range(12))
def test_random_joints_are_as_balanced(tmp_path, seed):
    case = random_joint(seed)
    found = run_case(tmp_path, in_time(case))
    assert found.converged.all()
    if case["contact"]["law"] == "dlft":
        # Of the balance of rigid friction that the harmonics do not truncate.
        case["contact"]["law"] = "rigid"
    balanced = run_case(tmp_path, case)
    assert difference(found.coefficients[0][:15], balanced.coefficients[0][:15]) < WIDE


def test_a_damper_without_mass_is_refused(tmp_path):
    case = in_time(joint())
    case["model"] = case["model"] | {"mass": np.diag([1.0, 0.0])}
    done = run(tmp_path, case, status=3)
    assert "element 1 of &damper acts on a dof without mass" in done.stderr
