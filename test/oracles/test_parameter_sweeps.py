"""Sweeps over a load or another parameter at a fixed frequency: against the same cases run one by
one, and against closed forms along a branch with folds."""
import subprocess

import h5py
import numpy as np
import pytest
from cases import merged, read, run, write_namelist
from project import HAS_EXTENSION, PATIENT, PROGRAM
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
    found = read(tmp_path / "case.h5")
    assert np.array_equal(found["omega"], values)
    run(tmp_path, merged(plain, {"sweep": {"start": 0.4, "end": 1.9, "n_points": 2}}), name="own")
    alone = read(tmp_path / "own.h5")
    assert found["amplitude"][[1, 0]] == pytest.approx(alone["amplitude"], rel=1e-5)


def turning(folder, static=0.0, **more):
    """The Duffing oscillator with stiffness, and a static load, that grow with the speed."""
    with h5py.File(folder / "model.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        file["mass"], file["stiffness"], file["damping"] = [[1.0]], [[1.0]], [[0.05]]
        file["stiffness_rotation"] = [[0.4]]
        file["load/static_rotation"] = [static]
    return merged(DUFFING, {"model": {"n_dof": None, "mass": None, "stiffness": None,
                                      "damping": None, "source": "hdf5", "file": "model.h5"},
                            "load": {"harmonic_scale": 0.07}, "sweep": {
        "parameter": "model%rotation_speed", "start": 0.2, "end": 1.6, **more}})


@pytest.mark.parametrize(("parameter", "damping"), [
    ("model%modal_damping", 2.0), ("model%rayleigh_mass", 1.0), ("model%rayleigh_stiffness", 1.0)])
def test_damping_in_closed_form(tmp_path, parameter, damping):
    """The load that an amplitude asks for holds with the damping of each value; without any the
    first is undamped."""
    groups = merged(DUFFING, {
        "model": {"damping": None}, "load": {"harmonic_scale": 0.3}, "sweep": {
            "parameter": parameter, "start": 0.0, "end": 0.3, "frequency": 0.8, "n_points": 7}})
    run(tmp_path, groups)
    natural = read(tmp_path / "case.h5")
    assert natural["parameter"] == pytest.approx(np.linspace(0.0, 0.3, 7))
    run(tmp_path, merged(groups, {"sweep": {"continuation": "arclength"}}))
    along = read(tmp_path / "case.h5")
    assert along["parameter"][-1] == pytest.approx(0.3)
    for found in (natural, along):
        load = load_of(first(found), 0.8, damping * found["parameter"])
        assert load == pytest.approx(0.3, rel=CLOSED)


def test_branch_through_the_folds_of_the_speed(tmp_path):
    """Of one frequency and one load: the speed that an amplitude has is known."""
    run(tmp_path, turning(tmp_path, continuation="arclength"))
    found = read(tmp_path / "case.h5")
    a, folds = first(found), found["fold"].astype(bool)

    def force(a, square, omega=1.3):
        return a * np.hypot(1.0 + 0.4 * square - omega**2 + 0.375 * a**2, 0.05 * omega)

    assert force(a, found["parameter"]**2) == pytest.approx(0.07, rel=CLOSED)
    fine = np.linspace(0.05, 0.07 / (0.05 * 1.3), 400001)[:-1]
    half = np.sqrt((0.07 / fine)**2 - (0.05 * 1.3)**2)
    turns = []
    for side in (-1.0, 1.0):
        square = (0.69 - 0.375 * fine**2 + side * half) / 0.4
        turn = np.diff(square)[1:] * np.diff(square)[:-1] < 0.0
        turns += [v for v in square[1:-1][turn] if 0.2**2 < v < 1.6**2]
    assert folds.sum() == len(turns) == 2
    assert np.sort(found["parameter"][folds]**2) == pytest.approx(np.sort(turns), rel=1e-7)
    assert found["bifurcation/parameter"] == pytest.approx(found["parameter"][folds], rel=1e-8)


@pytest.mark.parametrize(("law", "normal"), [("penalty", True), ("rigid", False), ("dlft", True)])
def test_speeds_are_cases_of_their_own(tmp_path, law, normal):
    """From rest, where no static load acts yet, in any order; along a branch what does not depend
    on eps."""
    rng = np.random.default_rng(4)
    a, b, c = rng.normal(size=(3, 5, 5))
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        file["mass"], file["stiffness"] = np.eye(5) + 0.05 * a @ a.T, np.eye(5) + 0.4 * b @ b.T
        file["stiffness_rotation"], file["load/static_rotation"] = 0.1 * c @ c.T, [0, 0, -.2, 0, 0]
    groups = {"case": {"analysis": "frf"},
              "model": {"source": "hdf5", "file": "model.h5", "modal_damping": 0.02},
              "contact": {"n_pairs": 2, "law": law, "mu": 0.4,
                          "side_1": [1, 0, 3, 2, 0, 4] if normal else [1, 0, 0, 2, 0, 0]},
              "load": {"cosine": [0.4, 0.1, 0.1, 0.0, 0.0]}, "harmonics": {"n_harmonics": 5},
              "solver": {"tolerance": 1e-13},
              "sweep": {"parameter": "model%rotation_speed", "frequency": 1.1,
                        "values": [0.0, 1.4, 0.5, 0.9]}}
    groups["contact"].update({"gap": -0.1} if normal else {"normal_load": 0.3})
    if law == "penalty":
        groups["contact"].update(tangential_stiffness=1.0, normal_stiffness=2.0)
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    for k, speed in enumerate(found["parameter"]):
        run(tmp_path, merged(groups, {"model": {"rotation_speed": float(speed)}, "sweep": {
            "values": None, "parameter": None, "frequency": None, "start": 1.1},
            "case": {"analysis": "point"}}), name="own")
        alone = read(tmp_path / "own.h5")
        size = np.abs(alone["coefficients"]).max()
        assert np.abs(found["coefficients"][k] - alone["coefficients"][0]).max() < 1e-10 * size
        assert np.allclose(found["contact/force"][k], alone["contact/force"][0], atol=1e-9)
    run(tmp_path, merged(groups, {"sweep": {"values": None, "start": 0.0, "end": 1.4, "n_points": 8,
                                            "continuation": "arclength"}}), name="along")
    along = read(tmp_path / "along.h5")
    ends = along["coefficients"][[0, -1]] - found["coefficients"][:2]
    # The eps of a rigid law is that of the first value: harmonics that are left out feel it.
    assert np.abs(ends).max() < (SAME if law == "penalty" else 1e-2) * size


def test_undamped_modes_of_a_sweep_over_damping(tmp_path):
    """Without damping, modes that the contact holds are coordinates, in the same way throughout."""
    groups = {"case": {"analysis": "frf"},
              "model": {"n_dof": 3, "mass": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0],
                        "stiffness": [3.0, -1.0, 0, -1.0, 2.5, -0.5, 0, -0.5, 1.2]},
              "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "mu": 0.3,
                          "normal_load": 0.4, "tangential_stiffness": 2.0},
              "load": {"cosine": [0.3, 0.2, 0.1]}, "harmonics": {"n_harmonics": 3},
              "solver": {"tolerance": 1e-13},
              # The mode that hangs on the held ones.
              "sweep": {"parameter": "model%modal_damping", "frequency": 0.55,
                        "values": [0.05, 0.0, 0.01]}}
    for frequency in (0.55, 1.03, 1.66):
        run(tmp_path, merged(groups, {"sweep": {"frequency": frequency}}))
        found = read(tmp_path / "case.h5")
        for k, ratio in enumerate(found["parameter"]):
            run(tmp_path, merged(groups, {
                "model": {"modal_damping": float(ratio)}, "case": {"analysis": "point"}, "sweep": {
                    "values": None, "parameter": None, "frequency": None, "start": frequency}}),
                name="own")
            alone = read(tmp_path / "own.h5")["coefficients"][0]
            assert np.abs(found["coefficients"][k] - alone).max() < 1e-10 * np.abs(alone).max()


def test_stability_follows_the_speed(tmp_path):
    """Multipliers are those of the matrices of each value."""
    groups = turning(tmp_path, start=None, end=None, n_points=None, values=[0.3, 1.2],
                     stability=True)
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    for k, speed in enumerate([0.3, 1.2]):
        run(tmp_path, merged(groups, {
            "model": {"rotation_speed": speed}, "case": {"analysis": "point"}, "sweep": {
                "values": None, "parameter": None, "frequency": None, "start": 1.3}}), name="own")
        alone = read(tmp_path / "own.h5")["floquet/multipliers"][0]
        assert np.abs(found["floquet/multipliers"][k] - alone).max() < 1e-8


def test_a_branch_that_is_cut_says_so(tmp_path):
    write_namelist(tmp_path / "case.nml", turning(tmp_path, continuation="arclength", max_points=3))
    done = subprocess.run([PROGRAM, "case.nml"], cwd=tmp_path, text=True, capture_output=True,
                          check=False, env=PATIENT)
    assert done.returncode == 4
    assert "max_points" in done.stderr
    assert len(read(tmp_path / "case.h5")["parameter"]) == 3


@pytest.mark.parametrize(("changes", "words"), [
    ({"sweep": {"parameter": "model%rotation_speed"}}, "no stiffness_rotation"),
    ({"sweep": {"parameter": "model%modal_damping", "start": -0.1}}, "must be at least 0"),
    ({"sweep": {"parameter": "model%rayleigh_mass", "as": "factor"}}, "use 'value'"),
    ({"sweep": {"parameter": "contact%mu"}}, "there are no contact pairs"),
    ({"sweep": {"parameter": "load%static_scale"}}, "there is no static load"),
    ({"sweep": {"frequency": None}}, "frequency"),
    ({"sweep": {"refine": True}}, "no maxima are looked for"),
    ({"sweep": {"values": [0.1, 0.2]}}, "keep one of the two"),
    ({"case": {"analysis": "point"}}, "goes with analysis = 'frf'"),
    ({"load": {"harmonic_scale": 0.0}}, "load%harmonic_scale is 0"),
    ({"sensitivity": {"parameters": ["load%harmonic_scale"]}}, "does not go with group &sensitivity"),
    ({"sweep": {"parameter": None}}, "goes with a parameter other than the frequency"),
])
def test_what_is_refused(tmp_path, changes, words):
    done = run(tmp_path, merged(DUFFING, changes), status=3)
    assert words in done.stderr


@pytest.mark.skipif(not HAS_EXTENSION, reason="this build has no extension for Python")
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
