"""Sweeps over a load or another parameter at a fixed frequency: against the same cases run one by
one, and against closed forms along a branch with folds."""
import h5py
import numpy as np
import pytest
from cases import merged, read, run
from sensitivity_family import random_case

import fretwear as fw
from fretwear.plot import plot_response

#: Solutions of the same equations to residuals of 1e-12.
SAME = 1e-9
#: Of a balance of one harmonic, whose closed form holds but for the residual.
CLOSED = 1e-9
DUFFING = {
    "case": {"analysis": "frf"},
    "model": {"n_dof": 1, "mass": [1.0], "stiffness": [1.0], "damping": [0.05]},
    "spring": {"n_springs": 1, "side_1": 1, "coefficient": 0.5},
    "load": {"cosine": [1.0]}, "harmonics": {"n_harmonics": 1},
    "sweep": {"parameter": "load%harmonic_scale", "frequency": 1.3, "start": 0.05, "end": 1.5,
              "n_points": 8},
    "solver": {"tolerance": 1e-12}}


def load_of(a, omega=1.3, c=0.05, alpha=0.5):
    """Load of the amplitude a of one harmonic."""
    return a * np.hypot(1.0 - omega**2 + 0.75 * alpha * a**2, c * omega)


def first(found):
    return np.hypot(found["coefficients"][:, 1, 0], found["coefficients"][:, 2, 0])


@pytest.mark.parametrize(("parameter", "seed", "values"), [
    ("load%harmonic_scale", 2, [0.4, 0.9, 0.7, 1.6]), ("load%static_scale", 0, [0.8, 1.0, 1.3]),
    ("contact%mu", 1, [0.5, 1.0, 1.5]), ("contact%normal_load", 2, [0.6, 1.1, 2.0]),
    ("contact%gap", 0, [0.6, 1.2]), ("contact%tangential_stiffness", 5, [0.7, 1.3]),
    ("contact%normal_stiffness", 6, [0.7, 1.3]), ("spring%coefficient", 1, [0.0, 0.8, 1.4])])
def test_factors_are_cases_of_their_own(tmp_path, parameter, seed, values):
    """All laws and parameters: a sweep over factors gives what cases with these values give."""
    while True:
        groups, known = random_case(seed)
        if parameter in known or (parameter == "contact%normal_load"
                                  and "normal_load" in groups["contact"]):
            break
        seed += 1
    group, key = parameter.split("%")
    base = groups[group][key]
    sweep = merged(groups, {"case": {"analysis": "frf"}, "sweep": {
        "start": None, "frequency": groups["sweep"]["start"], "parameter": parameter,
        "as": "factor", "values": values}})
    run(tmp_path, sweep)
    found = read(tmp_path / "case.h5")
    assert np.allclose(found["parameter"], values)
    assert found["omega"] == pytest.approx(groups["sweep"]["start"])
    for k, value in enumerate(values):
        own = [value * b for b in base] if isinstance(base, list) else value * base
        run(tmp_path, merged(groups, {group: {key: own}}), name="own")
        alone = read(tmp_path / "own.h5")
        size = np.abs(alone["coefficients"]).max()
        assert np.abs(found["coefficients"][k] - alone["coefficients"][0]).max() < SAME * size
        assert np.allclose(found["contact/force"][k], alone["contact/force"][0],
                           atol=1e-8 * np.abs(alone["contact/force"]).max())


def test_natural_load_sweep(tmp_path):
    run(tmp_path, DUFFING)
    found = read(tmp_path / "case.h5")
    a = first(found)
    assert np.allclose(found["parameter"], np.linspace(0.05, 1.5, 8))
    assert np.allclose(found["load/scale"], found["parameter"])
    assert load_of(a) == pytest.approx(found["parameter"], rel=CLOSED)
    assert "peak/omega" not in found
    with h5py.File(tmp_path / "case.h5") as file:
        assert file["parameter"].attrs["name"] in (b"load%harmonic_scale", "load%harmonic_scale")


def test_branch_through_the_folds_of_the_load(tmp_path):
    done = run(tmp_path, merged(DUFFING, {"sweep": {"continuation": "arclength"},
                                          "case": {"threads": 1}}))
    found = read(tmp_path / "case.h5")
    a = first(found)
    assert load_of(a) == pytest.approx(found["parameter"], rel=CLOSED)
    # Where dF/da vanishes, of the closed form.
    fine = np.linspace(0.05, 2.0, 400001)
    f = load_of(fine)
    turns = fine[1:-1][(np.diff(f)[1:] * np.diff(f)[:-1]) < 0.0]
    folds = found["fold"].astype(bool)
    assert a[folds] == pytest.approx(turns, rel=1e-4)
    assert found["parameter"][folds] == pytest.approx(load_of(turns), rel=1e-8)
    assert found["bifurcation/parameter"] == pytest.approx(load_of(turns), rel=1e-8)
    assert found["bifurcation/omega"] == pytest.approx(1.3)
    assert (np.diff(a) > 0.0).all()
    tangent = found["tangent/parameter"]
    assert (np.sign(tangent[~folds][1:]) != 0).all()
    assert "fold at load%harmonic_scale" in done.stdout or not done.stdout


def test_branch_of_friction_over_mu_meets_single_runs(tmp_path):
    groups, _ = random_case(2)
    groups = merged(groups, {"case": {"analysis": "frf"}, "sweep": {
        "start": 0.5, "end": 1.5, "frequency": groups["sweep"]["start"], "as": "factor",
        "parameter": "contact%mu", "continuation": "arclength", "n_points": 6}})
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    assert found["parameter"][-1] == pytest.approx(1.5)
    run(tmp_path, merged(groups, {"sweep": {
        "start": None, "end": None, "n_points": None, "continuation": None,
        "values": found["parameter"].tolist()}}), name="own")
    alone = read(tmp_path / "own.h5")
    size = np.abs(alone["coefficients"]).max()
    assert np.abs(found["coefficients"] - alone["coefficients"]).max() < SAME * size


def test_stability_over_the_load(tmp_path):
    """The middle of three solutions is the unstable one."""
    run(tmp_path, merged(DUFFING, {"harmonics": {"n_harmonics": 7}, "sweep": {
        "continuation": "arclength", "stability": True}}))
    found = read(tmp_path / "case.h5")
    between = found["tangent/parameter"] < 0.0
    sure = found["floquet/stable"] >= 0
    assert (found["floquet/stable"][sure & between & ~found["fold"].astype(bool)] == 0).all()
    assert (found["floquet/stable"][sure & ~between & ~found["fold"].astype(bool)] == 1).all()


def test_accuracy_chooses_harmonics_at_every_load(tmp_path):
    groups = merged(DUFFING, {"harmonics": {"n_harmonics": None, "accuracy": 1e-6}})
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    run(tmp_path, merged(groups, {"harmonics": {"n_harmonics": 31, "accuracy": None}}), name="own")
    alone = read(tmp_path / "own.h5")
    assert found["amplitude"] == pytest.approx(alone["amplitude"], rel=1e-5)


def test_values_are_frequencies_in_any_order(tmp_path):
    plain = merged(DUFFING, {"sweep": dict.fromkeys(DUFFING["sweep"]),
                             "load": {"harmonic_scale": 0.1}})
    values = [1.9, 0.4, 1.7]
    run(tmp_path, merged(plain, {"sweep": {"values": values}}))
    run(tmp_path, merged(plain, {"sweep": {"frequencies": values}}), name="own")
    found, alone = read(tmp_path / "case.h5"), read(tmp_path / "own.h5")
    for name in ("omega", "coefficients", "peak/omega"):
        assert np.array_equal(found[name], alone[name])


@pytest.mark.parametrize(("changes", "words"), [
    ({"sweep": {"parameter": "contact%mu"}}, "there are no contact pairs"),
    ({"sweep": {"parameter": "load%static_scale"}}, "there is no static load"),
    ({"sweep": {"frequency": None}}, "frequency"),
    ({"sweep": {"frequencies": [1.0]}}, "give values"),
    ({"sweep": {"refine": True}}, "no maxima are looked for"),
    ({"sweep": {"values": [0.1, 0.2]}}, "keep one of the two"),
    ({"case": {"analysis": "point"}}, "goes with analysis = 'frf'"),
    ({"load": {"harmonic_scale": 0.0}}, "load%harmonic_scale is 0"),
    ({"sensitivity": {"parameters": ["load%harmonic_scale"]}}, "does not go with sensitivity"),
    ({"sweep": {"parameter": None}}, "goes with a parameter other than the frequency"),
])
def test_what_is_refused(tmp_path, changes, words):
    done = run(tmp_path, merged(DUFFING, changes), status=3)
    assert words in done.stderr


def test_python(tmp_path):
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], cosine=[1.0],
                     springs=[fw.Spring(side_1=1, coefficient=0.5, power=3)])
    settings = {"harmonics": {"n_harmonics": 1},
                "solver": {"tolerance": 1e-12}}
    result = fw.frf(model, values=[0.1, 0.2], parameter="load%harmonic_scale", frequency=0.5,
                    **settings)
    assert result.parameter_name == "load%harmonic_scale"
    assert np.array_equal(result.parameter, [0.1, 0.2])
    a = np.hypot(result.coefficients[:, 1, 0], result.coefficients[:, 2, 0])
    assert load_of(a, 0.5) == pytest.approx(result.load_scale, rel=CLOSED)
    branch = fw.frf(model, 0.05, 1.5, 8, parameter="load%harmonic_scale", frequency=1.3,
                    sweep={"continuation": "arclength"}, **settings)
    fold = branch.bifurcations[0]
    assert fold.kind == "fold"
    assert fold.parameter == pytest.approx(branch.parameter[branch["fold"].astype(bool)][0])
    figure = plot_response(branch)
    assert figure.axes[0].get_xlabel() == "load%harmonic_scale"
    plain = fw.frf(model, 0.5, 0.9, 3, **settings)
    assert plain.parameter_name == "frequency"
    with pytest.raises(fw.AbsentError):
        _ = plain.parameter
