"""Derivatives of the load of a given amplitude, and of what comes with it: closed forms,
differences of controlled runs, one way against the other; responses of given amplitude along a
parameter."""
import h5py
import numpy as np
import pytest
from cases import merged, read, run
from control_family import linear_amplitude
from sensitivity_family import random_case

#: Of a balance of one harmonic, whose closed form holds but for the residual.
CLOSED = 1e-9
#: Of differences of fourth order of runs to residuals of 1e-13, over the largest of a quantity.
DIFFERENCE, STEP = 1e-7, 2e-3
STENCIL = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
DUFFING = {
    "case": {"analysis": "frf"},
    "model": {"n_dof": 1, "mass": [1.0], "stiffness": [1.0], "rayleigh_mass": 0.05},
    "spring": {"n_springs": 1, "side_1": 1, "coefficient": 0.5},
    "load": {"cosine": [1.0]}, "harmonics": {"n_harmonics": 1}, "solver": {"tolerance": 1e-13},
    "sweep": {"start": 0.6, "end": 2.2, "n_points": 33},
    "control": {"amplitude": [0.3, 1.0, 2.0]}}


def load_of(a, omega, c=0.05, alpha=0.5):
    return a * np.hypot(1.0 - omega**2 + 0.75 * alpha * a**2, c * omega)


@pytest.mark.parametrize("continuation", ["natural", "arclength"])
def test_load_of_a_duffing_oscillator(tmp_path, continuation):
    """By the spring and by the damping, through places where a given load has folds."""
    run(tmp_path, merged(DUFFING, {
        "sweep": {"continuation": continuation},
        "sensitivity": {"parameters": ["spring%coefficient", "model%rayleigh_mass"]}}))
    found = read(tmp_path / "case.h5")
    a, omega, f = found["control/amplitude"], found["omega"], found["load/scale"]
    d = 1.0 - omega**2 + 0.375 * a**2
    assert found["sensitivity/load_scale/spring_coefficient"][:, 0] == pytest.approx(
        a**2 / f * d * 0.75 * a**2, rel=1e-8, abs=1e-8)
    assert found["sensitivity/load_scale/model_rayleigh_mass"] == pytest.approx(
        a**2 / f * 0.05 * omega**2, rel=1e-8)
    # The amplitude is given.
    assert np.abs(found["sensitivity/first_harmonic/model_rayleigh_mass"]).max() < 1e-12


def controlled(seed):
    """A random case at an amplitude where pairs slip, and its parameters."""
    groups, parameters = random_case(seed)
    groups = merged(groups, {"output": {"observe": None}, "load": {"harmonic_scale": 1.0}})
    parameters.remove("load%harmonic_scale")
    omega = groups["sweep"]["start"]
    n = groups["model"]["n_dof"]
    place = {"observed": n, "of": ("first_harmonic", "largest")[seed % 2]}
    groups["control"] = place
    amplitude = 0.5 * linear_amplitude(merged(groups, {"sweep": {"values": [omega]}}))
    return merged(groups, {"control": {"amplitude": [amplitude]}}), parameters, omega


@pytest.mark.parametrize("seed", [0, 2, 5, 7])
def test_differences_of_controlled_runs(tmp_path, seed):
    """Every parameter, all pairs together: the sweep over a factor gives the differences."""
    groups, parameters, omega = controlled(seed)
    run(tmp_path, merged(groups, {"sensitivity": {"parameters": parameters}}))
    exact = read(tmp_path / "case.h5")
    factors = (1.0 + STEP * np.arange(-2, 3)).tolist()
    for parameter in parameters:
        group, key = parameter.split("%")
        run(tmp_path, merged(groups, {"case": {"analysis": "frf"}, "sweep": {
            "start": None, "frequency": omega, "parameter": parameter, "as": "factor",
            "values": factors}}), name="moved")
        moved = read(tmp_path / "moved.h5")
        assert moved["converged"].all()
        u = moved["coefficients"]
        made = {"load_scale": moved["load/scale"][:, None], "largest": moved["amplitude"],
                "first_harmonic": np.hypot(u[:, 1], u[:, 2]),
                "dissipation": moved["contact/dissipation"].sum(1)[:, None]}
        base = np.atleast_1d(groups[group][key])
        for quantity, values in made.items():
            slope = exact[f"sensitivity/{quantity}/{parameter.replace('%', '_')}"][0]
            slope = np.reshape(slope, (values.shape[1], -1)) @ np.broadcast_to(
                base, np.size(slope) // values.shape[1])
            size = max(np.abs(values).max(), np.abs(slope).max())
            assert np.abs(slope - STENCIL @ values / STEP).max() < DIFFERENCE * size, (
                parameter, quantity)


def test_both_ways_agree(tmp_path):
    """Few quantities of many parameters by the transposed matrix, and each by itself."""
    groups, parameters, _ = controlled(2)
    groups = merged(groups, {"output": {"observe": [groups["control"]["observed"]]},
                             "control": {"observed": None}})
    quantities = ["first_harmonic", "dissipation"]
    run(tmp_path, merged(groups, {"sensitivity": {"parameters": parameters,
                                                  "quantities": quantities}}))
    with h5py.File(tmp_path / "case.h5") as file:
        adjoint = {name: item[()] for name, item in file["sensitivity/load_scale"].items()}
        adjoint_d = {name: item[()] for name, item in file["sensitivity/dissipation"].items()}
    for parameter in parameters:
        run(tmp_path, merged(groups, {"sensitivity": {"parameters": [parameter]}}), name="own")
        own = read(tmp_path / "own.h5")
        name = parameter.replace("%", "_")
        for together, quantity in ((adjoint, "load_scale"), (adjoint_d, "dissipation")):
            size = max(np.abs(v).max() for v in together.values())
            alone = own[f"sensitivity/{quantity}/{name}"]
            assert np.abs(alone - together[name]).max() < 1e-9 * size


@pytest.mark.parametrize(("parameter", "values"), [
    ("model%modal_damping", [0.03, 0.01, 0.05]), ("contact%mu", [0.2, 0.5, 0.3]),
    ("load%static_scale", [0.8, 1.2, 1.0])])
def test_values_are_controlled_cases_of_their_own(tmp_path, parameter, values):
    """In any order; and along a branch, whose ends are those of such cases."""
    groups, known, omega = controlled(0)
    assert parameter in known
    group, key = parameter.split("%")
    groups = merged(groups, {group: {key: values[0]}, "case": {"analysis": "frf"}})
    over = {"start": None, "frequency": omega, "parameter": parameter, "values": values}
    run(tmp_path, merged(groups, {"sweep": over}))
    found = read(tmp_path / "case.h5")
    for k, value in enumerate(values):
        run(tmp_path, merged(groups, {group: {key: value}, "case": {"analysis": "point"}}),
            name="own")
        own = read(tmp_path / "own.h5")
        assert found["load/scale"][k] == pytest.approx(own["load/scale"][0], rel=1e-10)
        size = np.abs(own["coefficients"]).max()
        assert np.abs(found["coefficients"][k] - own["coefficients"][0]).max() < 1e-10 * size
    run(tmp_path, merged(groups, {"sweep": dict(over, values=None, start=values[0], end=values[1],
                                                continuation="arclength", n_points=5)}))
    along = read(tmp_path / "case.h5")
    assert along["parameter"][[0, -1]] == pytest.approx(values[:2])
    assert along["load/scale"][[0, -1]] == pytest.approx(found["load/scale"][:2], rel=1e-8)


def test_load_over_the_damping_in_closed_form(tmp_path):
    """Natural and along a branch, from no damping on."""
    for continuation in ("natural", "arclength"):
        run(tmp_path, merged(DUFFING, {"sweep": {
            "parameter": "model%rayleigh_mass", "frequency": 1.2, "start": 0.0, "end": 0.4,
            "n_points": 5, "continuation": continuation}}))
        found = read(tmp_path / "case.h5")
        c, a = found["parameter"], found["control/amplitude"]
        assert found["load/scale"] == pytest.approx(load_of(a, 1.2, c), rel=CLOSED)
        assert (c == 0.4).sum() == 3


@pytest.mark.parametrize(("changes", "words"), [
    ({"sensitivity": {"parameters": ["load%harmonic_scale"]}}, "load_scale"),
    ({"sensitivity": {"parameters": ["spring%coefficient"]}, "harmonics": {"n_harmonics": None}},
     "n_harmonics is missing"),
    ({"sweep": {"parameter": "load%harmonic_scale", "frequency": 1.0}}, "another parameter")])
def test_what_is_refused(tmp_path, changes, words):
    assert words in run(tmp_path, merged(DUFFING, changes), status=3).stderr
