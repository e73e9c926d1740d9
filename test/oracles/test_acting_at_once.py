"""Smooth friction and curved pressures integrated in time, and their Floquet multipliers.

The integration against solutions from elsewhere (test/reference/laws), the multipliers by
Liouville's formula: their product is what the damping leaves of a volume of states after a period.
"""
import json

import numpy as np
import pytest
import test_normal_laws
import test_sliding_friction
from cases import merged, read, run
from oracle_runs import run_case
from project import ROOT
from test_several_laws import coefficients_of, difference

SLIDING = json.loads((ROOT / "test/reference/laws/law_regularised.json").read_text())["cases"]
PRESSING = json.loads((ROOT / "test/reference/laws/law_normal.json").read_text())["cases"]
#: Steps of a period, and the error of the motion that they leave: of second order, and measured
#: below half of it.
STEPS, ERROR = 2000, 4e-4


def in_time(groups, steps=STEPS):
    return merged(groups, {"case": {"analysis": "time"}, "time": {"steps_per_period": steps},
                           "solver": {"tolerance": 1e-9}})


@pytest.mark.parametrize("name", ["tanh_0.9", "tanh_1.3", "stribeck_1", "stribeck_2_viscous",
                                  "stribeck_drift"])
def test_smooth_friction_in_time(tmp_path, name):
    case = SLIDING[name]
    found = run_case(tmp_path, in_time(test_sliding_friction.groups(case["params"], 7)))
    wanted = coefficients_of(case["u1"], 7)[:15]
    assert difference(found.coefficients[0][:15, 0], wanted) < ERROR
    # The reference has what friction takes from the structure.
    taken = found.dissipation[0, 0]
    if found.obstacle_work is not None:
        taken -= found.obstacle_work[0, 0]
    assert abs(taken / case["work_per_cycle"][0] - 1.0) < 10.0 * ERROR


@pytest.mark.parametrize("law", ["penalty", "regularised"])
@pytest.mark.parametrize("name", ["hertz_closed", "hertz_opens", "exponential", "table"])
def test_curved_pressures_in_time(tmp_path, name, law):
    case = PRESSING[name]
    found = run_case(tmp_path, in_time(test_normal_laws.groups(case["params"], 7, law=law)))
    assert difference(found.coefficients[0][:15, 0], coefficients_of(case["u1"], 7)[:15]) < ERROR
    assert difference(found.force[0][:15, 0, 2],
                      coefficients_of(case["force_1"], 7)[:15]) < 10.0 * ERROR


def test_friction_with_a_curve_is_refused_in_time(tmp_path):
    case = in_time(test_normal_laws.chain(**test_normal_laws.CURVED))
    del case["harmonics"]["n_time"], case["harmonics"]["sampling"]
    assert "is not integrated in time" in run(tmp_path, case, status=3).stderr
    case = merged(test_normal_laws.chain(**test_normal_laws.CURVED), {"sweep": {"stability": True}})
    assert "without Floquet multipliers" in run(tmp_path, case, status=3).stderr


@pytest.mark.parametrize("name", ["tanh_1.3", "stribeck_2_viscous", "stribeck_drift"])
def test_product_of_multipliers_is_the_volume_that_is_left(tmp_path, name):
    p = SLIDING[name]["params"]
    case = merged(test_sliding_friction.groups(p, 15), {"sweep": {"stability": True}})
    run(tmp_path, case)
    found = read(tmp_path / "case.h5")
    # Mean slope of friction by the velocity along the motion, by differences.
    tau = 2.0 * np.pi * np.arange(4096) / 4096
    c = found["coefficients"][0][:, 0]
    h = np.arange(1, 16)[:, None]
    v = p["omega"] * (h * (c[2::2, None] * np.cos(h * tau) - c[1::2, None] * np.sin(h * tau))
                      ).sum(axis=0) + p.get("drift", 0.0)

    def friction(v):
        mu = p["mu"]
        if p["kind"] == "stribeck":
            mu = p["mu_dynamic"] + (p["mu"] - p["mu_dynamic"]) * np.exp(
                -(abs(v) / p["vs"])**p["exponent"]) + p.get("mu_viscous", 0.0) * abs(v)
        return mu * p["normal_load"] * np.tanh(v / p["v0"])

    slope = ((friction(v + 1e-6) - friction(v - 1e-6)) / 2e-6).mean()
    wanted = np.exp(-2.0 * np.pi / p["omega"] * (p["c"] + slope) / p["m"])
    product = np.prod(found["floquet/multipliers"][0] @ [1.0, 1.0j])
    assert abs(product - wanted) < 2e-3 * max(1.0, wanted)


def test_a_dof_without_mass_that_rubs_is_refused(tmp_path):
    case = test_normal_laws.chain("regularised", **test_normal_laws.CURVED)
    case["model"]["mass"] = np.diag([1.0, 0.0, 1.2])
    case["model"]["damping"] = np.diag([0.05, 0.0, 0.05])
    case["sweep"]["stability"] = True
    assert "dof without mass and damping" in run(tmp_path, case, status=3).stderr
