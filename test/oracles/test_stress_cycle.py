"""Stress and endurance of a cycle (&stress).

test/reference/blades/b7_stress.json is a sector at speed with contact, by a dense harmonic balance
of other origin. Random cycles are judged from the coefficients of their components: every pair of
instants of a grid, then a minimiser that knows no curvature.
"""
import json
from itertools import pairwise

import h5py
import numpy as np
import pytest
from cases import run, run_reference, with_model, write_parts
from project import ROOT
from scipy.optimize import minimize

REFERENCE = json.loads((ROOT / "test/reference/blades/b7_stress.json").read_text())
INSTANTS = 360
#: Cycles of each number of harmonics: 500 in all.
BY_RANGE, SIGNED = 80, 60


@pytest.mark.parametrize("number", range(len(REFERENCE["runs"])))
def test_sector_at_speed(tmp_path, number):
    run_reference(tmp_path, REFERENCE, number)


def structure(seed, n_points, n_harmonics):
    """A diagonal structure under loads in several harmonics, with random rows of stress."""
    random = np.random.default_rng(seed)
    n = 6
    datasets = {"mass": np.eye(n), "stiffness": np.diag(random.uniform(1.0, 3.0, n)),
                "damping": 0.2 * np.eye(n), "load/static": random.normal(size=n),
                "load/harmonic": np.arange(1, n_harmonics + 1, dtype=np.int32),
                "load/harmonic_cosine": random.normal(size=(n_harmonics, n)),
                "load/harmonic_sine": random.normal(size=(n_harmonics, n)),
                "stress/matrix": random.normal(size=(n_points, 6, n)),
                "stress/static": random.normal(size=(n_points, 6)),
                "stress/endurance": random.uniform(2.0, 5.0, n_points),
                "stress/ultimate": random.uniform(5.0, 9.0, n_points)}
    case = {"case": {"analysis": "point"}, "harmonics": {"n_harmonics": n_harmonics},
            "sweep": {"start": 0.7}, "stress": {"output": "tensor"}}
    return datasets, case


def mises(s):
    """Of the last axis (xx, yy, zz, xy, yz, zx)."""
    xx, yy, zz, *shear = np.moveaxis(s, -1, 0)
    return np.sqrt(0.5 * ((xx - yy)**2 + (yy - zz)**2 + (zz - xx)**2)
                   + 3.0 * sum(t**2 for t in shear))


def signed(s):
    return np.where(s[..., :3].sum(-1) < 0.0, -1.0, 1.0) * mises(s)


def at(coefficients, tau):
    """Stress at instants (.., 6)."""
    n = np.arange(1, (len(coefficients) + 1) // 2)
    tau = np.asarray(tau)[..., None]
    waves = np.concatenate([np.ones_like(tau), np.stack(
        [np.cos(n * tau), np.sin(n * tau)], axis=-1).reshape(*tau.shape[:-1], -1)], axis=-1)
    return waves @ coefficients


def by_search(coefficients):
    """Amplitude and mean by range."""
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    s = at(coefficients, tau)
    far = mises(s[:, None] - s[None, :])
    i, j = np.unravel_index(far.argmax(), far.shape)
    best = minimize(lambda t: -mises(at(coefficients, t[0]) - at(coefficients, t[1])),
                    [tau[i], tau[j]], method="Nelder-Mead",
                    options={"xatol": 1e-9, "fatol": 1e-13, "initial_simplex": [
                        [tau[i], tau[j]], [tau[i] + 1e-2, tau[j]], [tau[i], tau[j] + 1e-2]]})
    return -0.5 * best.fun, signed(0.5 * (at(coefficients, best.x[0]) + at(coefficients, best.x[1])))


@pytest.mark.parametrize("n_harmonics", [1, 2, 3, 5])
def test_random_cycles_by_range(tmp_path, n_harmonics):
    datasets, case = structure(n_harmonics, BY_RANGE, n_harmonics)
    write_parts(tmp_path / "model.h5", datasets)
    run(tmp_path, with_model(case))
    with h5py.File(tmp_path / "case.h5") as file:
        found = {name: file[f"stress/{name}"][0] for name in file["stress"]}
    wanted = np.array([by_search(found["coefficients"][:, i]) for i in range(BY_RANGE)])
    # The minimiser leaves the instants to the root of the round-off, 1e-8, which the mean sees.
    assert found["amplitude"] == pytest.approx(wanted[:, 0], rel=1e-10)
    assert found["mean"] == pytest.approx(wanted[:, 1], abs=1e-6 * wanted[:, 0].max())
    share = (found["amplitude"] / datasets["stress/endurance"]
             + np.maximum(found["mean"], 0.0) / datasets["stress/ultimate"])
    assert found["utilisation"] == pytest.approx(share, rel=1e-12)
    assert found["worst"] == share.argmax()


@pytest.mark.parametrize("n_harmonics", [1, 3, 5])
def test_random_cycles_with_their_sign(tmp_path, n_harmonics):
    datasets, case = structure(10 + n_harmonics, SIGNED, n_harmonics)
    case["stress"] |= {"method": "signed", "diagram": "gerber"}
    write_parts(tmp_path / "model.h5", datasets)
    run(tmp_path, with_model(case))
    with h5py.File(tmp_path / "case.h5") as file:
        found = {name: file[f"stress/{name}"][0] for name in file["stress"]}
    tau = 2.0 * np.pi * np.arange(100 * INSTANTS) / (100 * INSTANTS)
    jumping = 0
    for i in range(SIGNED):
        s = signed(at(found["coefficients"][:, i], tau))
        jumping += any(a * b < 0.0 for a, b in pairwise(s))
        # From instant to instant the stress changes by h times the slope, and more nowhere.
        within = 2.0 * np.pi / len(tau) * n_harmonics * np.abs(s).max()
        assert abs(found["amplitude"][i] - 0.5 * (s.max() - s.min())) < within
        assert abs(found["mean"][i] - 0.5 * (s.max() + s.min())) < within
    assert jumping > 0
    share = (found["amplitude"] / datasets["stress/endurance"]
             + (np.maximum(found["mean"], 0.0) / datasets["stress/ultimate"])**2)
    assert found["utilisation"] == pytest.approx(share, rel=1e-12)


def test_stress_of_a_speed_that_follows(tmp_path):
    """Each row as a point of its own speed, with what grows with its square."""
    datasets, case = structure(7, 3, 2)
    random = np.random.default_rng(8)
    datasets |= {"stress/static_rotation": random.normal(size=(3, 6)),
                 "stiffness_rotation": 0.1 * np.eye(6),
                 "load/static_rotation": random.normal(size=6)}
    write_parts(tmp_path / "model.h5", datasets)
    omega = [0.5, 0.9, 1.4]
    groups = with_model(case)
    groups["case"] = {"analysis": "frf"}
    groups["sweep"] = {"values": omega, "speed_order": 2.0}
    run(tmp_path, groups)
    names = [f"stress/{name}" for name in ("amplitude", "mean", "utilisation", "coefficients")]
    with h5py.File(tmp_path / "case.h5") as file:
        followed = {name: file[name][()] for name in names}
    for i, w in enumerate(omega):
        groups["case"], groups["sweep"] = {"analysis": "point"}, {"start": w}
        groups["model"]["rotation_speed"] = w / 2.0
        run(tmp_path, groups)
        with h5py.File(tmp_path / "case.h5") as file:
            for name in names:
                one = file[name][0]
                assert np.abs(followed[name][i] - one).max() < 1e-9 * np.abs(one).max(), name


def test_nothing_else_changes(tmp_path):
    """Rows of stress leave the response as it is, along a branch and to an accuracy too."""
    case = REFERENCE["runs"][0]["case"]
    write_parts(tmp_path / "model.h5", REFERENCE["file"])
    ways = ({"harmonics": {"n_harmonics": 3}}, {"harmonics": {"accuracy": 1e-3}},
            {"harmonics": {"n_harmonics": 3}, "sweep": {
                "start": 1.0, "end": 1.2, "n_points": 5, "continuation": "arclength"},
             "case": {"analysis": "frf"}})
    for way in ways:
        results = []
        for stress in (True, False):
            groups = with_model(case) | way
            if not stress:
                groups["stress"] = {"output": "none"}
            run(tmp_path, groups)
            with h5py.File(tmp_path / "case.h5") as done:
                results.append(done["coefficients"][()])
                assert ("stress" in done) == stress
        assert np.array_equal(*results)


@pytest.mark.parametrize(("change", "words"), [
    ({"stress/matrix": None}, "no stress/matrix"),
    ({"stress/matrix": np.ones((3, 5, 6))}, "has shape"),
    ({"stress/static": np.ones((3, 6))}, "has shape"),
    ({"stress/ultimate": None}, "&stress ultimate is missing"),
    ({"stress/endurance": -np.ones(2)}, "must be a finite real above 0"),
    ({"stress/matrixx": np.ones(2)}, "matrixx"),
])
def test_wrong_models_are_refused(tmp_path, change, words):
    datasets, case = structure(1, 2, 1)
    datasets = {name: values for name, values in (datasets | change).items() if values is not None}
    if "stress/matrix" not in datasets:
        datasets = {name: values for name, values in datasets.items() if "stress" not in name}
    write_parts(tmp_path / "model.h5", datasets)
    done = run(tmp_path, with_model(case), status=3)
    assert words in done.stderr


def test_natural_frequencies_have_none(tmp_path):
    datasets, case = structure(1, 2, 1)
    write_parts(tmp_path / "model.h5", datasets)
    del case["stress"]
    run(tmp_path, with_model(case | {"case": {"analysis": "modes"}}))
    with h5py.File(tmp_path / "case.h5") as file:
        assert "modes" in file and "stress" not in file


@pytest.mark.parametrize(("groups", "words"), [
    ({"case": {"analysis": "time"}}, "use 'frf' or 'point'"),
    ({"harmonics": {"n_harmonics": 3, "method": "hdhb"}}, "use 'hbm'"),
    ({"stress": {"endurance": 0.0}}, "must be a finite real above 0"),
    ({"stress": {"endurance": [1.0, 2.0, 3.0]}}, "must be 2, or one"),
    ({"stress": {"method": "tresca"}}, "'range'"),
])
def test_wrong_cases_are_refused(tmp_path, groups, words):
    datasets, case = structure(1, 2, 1)
    write_parts(tmp_path / "model.h5", datasets)
    done = run(tmp_path, with_model(case | groups), status=3)
    assert words in done.stderr
