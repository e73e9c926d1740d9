"""Friction that depends on the sliding speed, against integration in time from switch to switch.

test/reference/laws/law_regularised.json: one mass with tanh(v/v_0), with weakening over the speed
(exponents 1 and 2), with a viscous part, and on a moving side.
"""
import json

import numpy as np
import pytest
from cases import merged, read, run
from oracle_runs import run_case
from project import ROOT
from test_several_laws import coefficients_of, difference

REFERENCE = json.loads((ROOT / "test/reference/laws/law_regularised.json").read_text())


def groups(p, n_harmonics):
    contact = {"n_pairs": 1, "law": "regularised", "side_1": [1, 0, 0], "mu": p["mu"],
               "normal_load": p["normal_load"], "slip_speed": p["v0"]}
    if p["kind"] == "stribeck":
        contact |= {"mu_dynamic": p["mu_dynamic"], "weakening_speed": p["vs"],
                    "weakening_exponent": p["exponent"], "mu_viscous": p.get("mu_viscous", 0.0),
                    "speed_1": -p.get("drift", 0.0)}
    return {
        "case": {"title": "sliding friction", "analysis": "point"},
        "model": {"n_dof": 1, "mass": p["m"], "damping": p["c"], "stiffness": p["k"]},
        "contact": contact, "load": {"cosine": p["F"]},
        "harmonics": {"n_harmonics": n_harmonics, "n_time": 2048},
        "sweep": {"start": p["omega"]}, "solver": {"tolerance": 1e-10},
    }


# Relative errors of the motion at H = 3, 7 and 15, about twice what is measured (those of the force
# are up to five times, those of the work up to twice as large): what truncation leaves of a force
# that turns round within v_0.
@pytest.mark.parametrize(("name", "bounds"), [
    ("tanh_0.9", (0.02, 0.01, 4e-3)), ("tanh_1.3", (0.014, 2.2e-3, 8e-5)),
    ("stribeck_1", (0.044, 0.022, 8e-3)), ("stribeck_2_viscous", (0.025, 0.014, 6e-3)),
    ("stribeck_drift", (0.043, 9e-3, 5e-4))])
def test_motion_and_force_are_as_integrated(tmp_path, name, bounds):
    case = REFERENCE["cases"][name]
    for n_harmonics, bound in zip((3, 7, 15), bounds, strict=True):
        found = run_case(tmp_path, groups(case["params"], n_harmonics))
        kept = 2 * min(n_harmonics, len(case["u1"]["xc"])) + 1
        u = coefficients_of(case["u1"], n_harmonics)[:kept]
        f = coefficients_of(case["force_1"], n_harmonics)[:kept]
        assert difference(found.coefficients[0][:kept, 0], u) < bound
        assert difference(found.force[0][:kept, 0, 0], f) < 5.0 * bound
        # The reference has what friction takes from the structure.
        taken = found.dissipation[0, 0]
        if found.obstacle_work is not None:
            taken -= found.obstacle_work[0, 0]
        assert abs(taken / case["work_per_cycle"][0] - 1.0) < 2.0 * bound


def test_a_moving_side_has_even_harmonics(tmp_path):
    case = groups(REFERENCE["cases"]["stribeck_drift"]["params"], 5)
    found = run_case(tmp_path, case)
    assert abs(found.coefficients[0][0, 0]) > 0.1  # the belt takes the mass along
    case["harmonics"]["parity"] = "odd"
    done = run(tmp_path, case, status=3)
    assert "a moving side" in done.stderr and "use 'auto' or 'all'" in done.stderr


def rubbing(law=("regularised", "regularised"), **contact):
    """Two masses, each on ground that it rubs: the second on a belt, in two directions."""
    return {
        "case": {"title": "two that rub", "analysis": "point"},
        "model": {"n_dof": 3, "mass": np.diag([1.0, 0.8, 0.8]), "stiffness": np.array([
            [2.4, -0.9, 0.1], [-0.9, 1.9, 0.0], [0.1, 0.0, 1.4]]),
            "damping": np.diag([0.06, 0.05, 0.05])},
        "contact": {"n_pairs": 2, "law": list(law), "side_1": [1, 0, 0, 2, 3, 0],
                    "mu": [0.5, 0.4], "normal_load": [0.9, 0.7], "slip_speed": [0.6, 0.5],
                    "mu_dynamic": [0.2, 0.15], "weakening_speed": [2.0, 1.6],
                    "weakening_exponent": [1.0, 2.0], "mu_viscous": [0.0, 0.1],
                    "speed_1": [0.0, 0.3], **contact},
        "load": {"cosine": [1.1, 0.0, 0.4], "sine": [0.0, 0.7, 0.0]},
        "harmonics": {"n_harmonics": 5, "n_time": 512}, "sweep": {"start": 1.2},
        "solver": {"tolerance": 1e-13},
    }


#: Central differences of a step of 1e-5: their own error is about 1e-10 of the third derivative.
STEP, NEAR = 1e-5, 1e-6


@pytest.mark.parametrize("law", [("regularised", "regularised"), ("penalty", "regularised")])
def test_derivatives_by_constants_are_differences(tmp_path, law):
    """Pair by pair, of amplitudes and work; the pair of another law has no such constants."""
    case = rubbing(law)
    if law[0] == "penalty":
        case["contact"]["tangential_stiffness"] = [2.0, 0.0]
        case["harmonics"]["n_time"] = 4096
    names = ["mu", "slip_speed", "mu_dynamic"]
    run(tmp_path, {**case, "sensitivity": {"parameters": [f"contact%{name}" for name in names]}})
    found = read(tmp_path / "case.h5")
    for name in names:
        of_motion = found[f"sensitivity/first_harmonic/contact_{name}"][0]
        of_work = found[f"sensitivity/dissipation/contact_{name}"][0]
        for i in range(2):
            if law[i] == "penalty":
                if name != "mu":
                    assert not of_motion[..., i].any()
                continue
            ends = []
            for sign in (1.0, -1.0):
                values = list(case["contact"][name])
                values[i] += sign * STEP
                run(tmp_path, merged(case, {"contact": {name: values}}))
                moved = read(tmp_path / "case.h5")
                c = moved["coefficients"][0]
                ends.append((np.hypot(c[1], c[2]), moved["contact/dissipation"][0].sum()))
            motion, work = ((a - b) / (2.0 * STEP) for a, b in zip(*ends, strict=True))
            np.testing.assert_allclose(of_motion[..., i], motion, rtol=0.0, atol=NEAR)
            np.testing.assert_allclose(of_work.ravel()[i], work, rtol=0.0, atol=10.0 * NEAR)
            assert np.abs(motion).max() > 1e-3


@pytest.mark.parametrize(("name", "start", "end"), [("slip_speed", 0.1, 0.6),
                                                    ("mu_dynamic", 0.05, 0.5), ("mu", 0.2, 1.0)])
def test_branches_over_constants_have_the_points(tmp_path, name, start, end):
    case = rubbing(**{name: 0.3})
    branch = run_case(tmp_path, merged(case, {"case": {"analysis": "frf"}, "sweep": {
        "parameter": f"contact%{name}", "start": start, "end": end, "n_points": 5,
        "frequency": 1.2, "continuation": "arclength"}}))
    value = read(tmp_path / "case.h5")["parameter"]
    at = len(value) // 2
    one = run_case(tmp_path, merged(case, {"contact": {name: float(value[at])}}))
    assert abs(value[-1] - end) < 1e-9 and branch.converged.all()
    assert difference(branch.coefficients[at], one.coefficients[0]) < 1e-9


@pytest.mark.parametrize(("parameter", "contact", "words"), [
    ("contact%mu_dynamic", {"mu_dynamic": None, "weakening_speed": None,
                            "weakening_exponent": None}, "mu_dynamic is not given"),
    ("contact%slip_speed", {"law": "penalty", "tangential_stiffness": 1.0, "slip_speed": None,
                            "mu_dynamic": None, "weakening_speed": None, "speed_1": None,
                            "weakening_exponent": None, "mu_viscous": None},
     "has no slip_speed")])
def test_constants_that_are_not_there_have_no_derivative(tmp_path, parameter, contact, words):
    case = merged(rubbing(), {"contact": contact, "sensitivity": {"parameters": parameter}})
    assert words in run(tmp_path, case, status=3).stderr


@pytest.mark.parametrize(("contact", "words"), [
    ({"weakening_exponent": 2.0}, "weakening_exponent has no meaning without mu_dynamic"),
    ({"weakening_speed": 0.3}, "weakening_speed has no meaning without mu_dynamic"),
    ({"mu_dynamic": 0.2}, "weakening_speed is missing"),
    ({"mu_dynamic": 0.2, "weakening_speed": 0.3, "weakening_exponent": 3.0},
     "weakening_exponent(1) = 3.0: must be a finite real from 1 to 2"),
    ({"law": "penalty", "tangential_stiffness": 1.0, "mu_viscous": 0.1},
     "mu_viscous belongs to law = 'regularised'"),
    ({"law": "iwan", "tangential_stiffness": 1.0, "iwan_chi": 0.0, "speed_1": 0.1},
     "speed_1 belongs to law = 'dlft'")])
def test_what_does_not_go_together_is_told(tmp_path, contact, words):
    case = groups(REFERENCE["cases"]["tanh_0.9"]["params"], 3)
    if contact.get("law") in ("penalty", "iwan"):
        del case["contact"]["slip_speed"]
    case["contact"] |= contact
    assert words in run(tmp_path, case, status=3).stderr
