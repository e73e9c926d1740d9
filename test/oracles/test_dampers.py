"""Nonlinear dampers, c u**q |v|**(p - 1) v.

test/reference/laws/law_damper.json is one mass with such dampers, integrated in time from switch to
switch; a damper of power 1 is viscous damping; derivatives against differences; and what is
refused.
"""
import json

import h5py
import numpy as np
import pytest
from cases import merged, read, run
from oracle_runs import run_case
from project import ROOT
from test_several_laws import coefficients_of, difference

REFERENCE = json.loads((ROOT / "test/reference/laws/law_damper.json").read_text())
#: Solver tolerance, and what two runs of one problem may differ by: the residual times the
#: condition of the structures (below 100), and a margin of ten.
TOLERANCE, WITHIN = 1e-11, 1e-8


def groups(p, n_harmonics):
    c, power, position = zip(*p["elements"], strict=True)
    return {
        "case": {"title": "dampers", "analysis": "point"},
        "model": {"n_dof": 1, "mass": p["m"], "damping": p["c"], "stiffness": p["k"]},
        "damper": {"n_dampers": len(c), "side_1": 1, "coefficient": list(c),
                   "power": [float(e) for e in power], "position_power": list(position)},
        "load": {"cosine": p["F"]}, "harmonics": {"n_harmonics": n_harmonics},
        "sweep": {"start": p["omega"]}, "solver": {"tolerance": TOLERANCE},
    }


# Relative errors of the motion at H = 3, 7 and 15, about twice what is measured, and at least what
# the numbers of the reference leave.
@pytest.mark.parametrize(("name", "bounds"), [
    ("quadratic", (8e-4, 2e-5, 6e-7)), ("position_dependent", (2e-3, 2e-6, 1e-11)),
    ("cubic_and_power_1.5", (4e-4, 2e-5, 5e-7))])
def test_motion_and_work_are_as_integrated(tmp_path, name, bounds):
    case = REFERENCE["cases"][name]
    for n_harmonics, bound in zip((3, 7, 15), bounds, strict=True):
        run(tmp_path, groups(case["params"], n_harmonics))
        found = read(tmp_path / "case.h5")
        kept = 2 * min(n_harmonics, len(case["u1"]["xc"])) + 1
        u = coefficients_of(case["u1"], n_harmonics)
        # Odd dampers leave even harmonics out.
        assert difference(found["coefficients"][0][:kept, 0], u[:kept]) < bound, n_harmonics
        np.testing.assert_allclose(found["damper/dissipation"][0], case["work_per_cycle"],
                                   rtol=10.0 * bound + 1e-9)


def chain(**damper):
    """Three masses with a damper between the first two and one of the third to the ground."""
    k = 1.3 * np.diag([2.0, 2.0, 2.0]) - np.diag([1.0, 1.1], 1) - np.diag([1.0, 1.1], -1)
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": 3, "mass": np.diag([1.0, 0.8, 1.2]), "stiffness": k,
                  "damping": 0.02 * k},
        "damper": {"n_dampers": 2, "side_1": [1, -3], "side_2": [2, 0],
                   "coefficient": [0.2, 0.1], **damper},
        "load": {"cosine": [0.4, 0.5, 0.6], "sine": [0.0, 0.3, 0.0]},
        "harmonics": {"n_harmonics": 5},
        "sweep": {"start": 1.1}, "solver": {"tolerance": TOLERANCE},
    }


def test_power_1_is_viscous_damping(tmp_path):
    case = chain()
    found = run_case(tmp_path, case)
    viscous = dict(case, model=dict(case["model"]))
    del viscous["damper"]
    more = np.zeros((3, 3))
    more[:2, :2] = 0.2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    more[2, 2] = 0.1
    viscous["model"]["damping"] = case["model"]["damping"] + more
    assert difference(found.coefficients, run_case(tmp_path, viscous).coefficients) < WITHIN


@pytest.mark.parametrize("linear", ["lu", "krylov"])
def test_units_and_linear_solver_do_not_matter(tmp_path, linear):
    case = chain(power=[1.7, 2.0], position_power=[0, 2])
    metres = run_case(tmp_path, case)
    # Lengths in mm, masses in tonnes: forces in N.
    mm = 1000.0
    scaled = merged(case, {"solver": {"linear": linear}, "damper": {
        "coefficient": [0.2 * mm**-1.7, 0.1 * mm**-4.0]}})
    scaled["model"] = {**case["model"], **{key: np.asarray(case["model"][key]) / mm
                                           for key in ("mass", "stiffness", "damping")}}
    found = run_case(tmp_path, scaled)
    assert difference(found.coefficients / mm, metres.coefficients) < WITHIN


def test_what_the_loads_give_the_dampers_take(tmp_path):
    """Work of the loads over a period is that of all damping."""
    case = chain(power=[1.5, 2.0], position_power=[2, 0])
    case["harmonics"]["n_harmonics"] = 9
    run(tmp_path, case)
    found = read(tmp_path / "case.h5")
    u = found["coefficients"][0]
    cosine, sine = (np.asarray(case["load"][key]) for key in ("cosine", "sine"))
    given = np.pi * (cosine @ u[2] - sine @ u[1])
    c = np.asarray(case["model"]["damping"])
    viscous = sum(np.pi * h**2 * case["sweep"]["start"] * (u[k] @ c @ u[k])
                  for h in range(1, 10) for k in (2 * h - 1, 2 * h))
    assert abs(given - viscous - found["damper/dissipation"][0].sum()) < 1e-9 * given


def test_derivatives_are_differences(tmp_path):
    case = chain(power=[1.5, 3.0], position_power=[2, 0])
    case["solver"]["tolerance"] = 1e-13
    run(tmp_path, {**case, "sensitivity": {"parameters": ["damper%coefficient"]}})
    found = read(tmp_path / "case.h5")
    slope = found["sensitivity/first_harmonic/damper_coefficient"][0]
    for i, value in enumerate(case["damper"]["coefficient"]):
        ends = []
        for sign in (1.0, -1.0):
            values = list(case["damper"]["coefficient"])
            values[i] = value + sign * 1e-5
            run(tmp_path, merged(case, {"damper": {"coefficient": values}}))
            ends.append(np.hypot(*read(tmp_path / "case.h5")["coefficients"][0][1:3]))
        np.testing.assert_allclose(slope[:, i], (ends[0] - ends[1]) / 2e-5, rtol=1e-5, atol=1e-8)


def test_a_model_file_holds_them(tmp_path):
    case = chain(power=[1.5, 3.0], position_power=[2, 0])
    typed = run_case(tmp_path, case)
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file.attrs.update(format="fretwear-model", format_version=1)
        for name in ("mass", "stiffness", "damping"):
            file[name] = case["model"][name]
        for name, values in case["damper"].items():
            if name != "n_dampers":
                file[f"damper/{name}"] = values
        for name, values in case["load"].items():
            file[f"load/{name}"] = values
    filed = {**case, "model": {"source": "hdf5", "file": "model.h5"}, "damper": {}, "load": {}}
    assert difference(run_case(tmp_path, filed).coefficients, typed.coefficients) == 0.0


@pytest.mark.parametrize(("changes", "words"), [
    ({"damper": {"power": 0.5}}, "power(1) = 0.5: must be a finite real from 1 to 99"),
    ({"damper": {"side_2": [1, 0]}}, "damper 1 has dof 1 on both sides"),
    ({"damper": {"coefficient": None}}, "coefficient is missing"),
    ({"damper": {"side_1": [1, 4]}}, "side_1"),
    ({"damper": {"position_power": [1, 0]}, "harmonics": {"parity": "odd"}}, "use 'auto' or 'all'"),
    ({"damper": {"n_dampers": None}}, "n_dampers is missing")])
def test_what_does_not_go_together_is_told(tmp_path, changes, words):
    assert words in run(tmp_path, merged(chain(), changes), status=3).stderr
