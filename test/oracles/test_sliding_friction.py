"""Friction that depends on the sliding speed, against integration in time from switch to switch.

test/reference/laws/law_regularised.json: one mass with tanh(v/v_0), with weakening over the speed
(exponents 1 and 2), with a viscous part, and on a moving side.
"""
import json

import numpy as np
import pytest
from cases import run
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
        assert abs(found.dissipation[0, 0] / case["work_per_cycle"][0] - 1.0) < 2.0 * bound


def test_a_moving_side_has_even_harmonics(tmp_path):
    case = groups(REFERENCE["cases"]["stribeck_drift"]["params"], 5)
    found = run_case(tmp_path, case)
    assert abs(found.coefficients[0][0, 0]) > 0.1  # the belt takes the mass along
    case["harmonics"]["parity"] = "odd"
    done = run(tmp_path, case, status=3)
    assert "a moving side" in done.stderr and "use 'auto' or 'all'" in done.stderr


@pytest.mark.parametrize(("contact", "words"), [
    ({"weakening_exponent": 2.0}, "weakening_exponent has no meaning without mu_dynamic"),
    ({"weakening_speed": 0.3}, "weakening_speed has no meaning without mu_dynamic"),
    ({"mu_dynamic": 0.2}, "weakening_speed is missing"),
    ({"mu_dynamic": 0.2, "weakening_speed": 0.3, "weakening_exponent": 3.0},
     "weakening_exponent(1) = 3.0: must be a finite real from 1 to 2"),
    ({"law": "penalty", "tangential_stiffness": 1.0, "speed_1": 0.1},
     "speed_1 belongs to law = 'regularised'")])
def test_what_does_not_go_together_is_told(tmp_path, contact, words):
    case = groups(REFERENCE["cases"]["tanh_0.9"]["params"], 3)
    if contact.get("law") == "penalty":
        del case["contact"]["slip_speed"]
    case["contact"] |= contact
    assert words in run(tmp_path, case, status=3).stderr
