"""Loads of any harmonic on a plain structure: linear responses against dense complex solves, the
integration in time, arc length, and every way to give them."""
import h5py
import numpy as np
import pytest
from cases import merged, read, run
from project import HAS_EXTENSION

import fretwear
from fretwear import Case, Model, Result
from fretwear.export.recovery import recover_displacement

#: Complex solves of order 3; conditioning of the matrices takes the rest.
LINEAR = 1e-11
#: Solutions of the same equations to residuals of 1e-12.
SAME = 1e-9
K = np.array([[3.0, -1.0, 0.0], [-1.0, 2.5, -0.7], [0.0, -0.7, 1.4]])
M = np.diag([1.0, 0.8, 1.2])
C = 0.02 * K + 0.01 * M
TERMS = {"n_terms": 4, "term_dof": [1, -3, 2, 2], "term_harmonic": [1, 2, 5, 0],
         "term_amplitude": [0.3, 0.2, 0.1, 0.4], "term_phase": [0.0, 30.0, -90.0, 180.0],
         "term_power": [0, 2, 1, 0]}
GROUPS = {
    "case": {"analysis": "frf"},
    "model": {"n_dof": 3, "mass": M.tolist(), "stiffness": K.tolist(), "damping": C.tolist()},
    "load": {"static": 0.0, "cosine": [0.0, 0.5, 0.0], "sine": [0.0, 0.0, 0.2], **TERMS},
    "harmonics": {"n_harmonics": 6}, "sweep": {"values": [0.3, 0.8, 1.3]},
    "solver": {"tolerance": 1e-12}}
CUBIC = {"spring": {"n_springs": 1, "side_1": 2, "side_2": 3, "coefficient": 0.5}}


def force(n, omega):
    """Complex amplitude of the load in harmonic n."""
    found = np.zeros(3, complex)
    if n == 1:
        found += np.array([0.0, 0.5, -0.2j])
    for dof, h, amplitude, phase, power in zip(*(TERMS[f"term_{key}"] for key in (
            "dof", "harmonic", "amplitude", "phase", "power"))):
        if h == n:
            found[abs(dof) - 1] += (np.sign(dof) * amplitude * (n * omega) ** power
                                    * np.exp(1j * np.radians(phase)))
    return found


def amplitude(row, n):
    return row[0].astype(complex) if n == 0 else row[2 * n - 1] - 1j * row[2 * n]


def close(a, b, within):
    assert np.abs(a - b).max() < within * np.abs(b).max()


@pytest.mark.parametrize("scale", [1.0, 0.5])
@pytest.mark.parametrize("method", ["hbm", "tcm"])
def test_linear_response(tmp_path, method, scale):
    run(tmp_path, merged(GROUPS, {"harmonics": {"method": method},
                                  "load": {"harmonic_scale": scale}}))
    found = read(tmp_path / "case.h5")
    for omega, row in zip(found["omega"], found["coefficients"]):
        for n in range(7):
            z = K - (n * omega)**2 * M + 1j * n * omega * C
            expected = np.linalg.solve(z, (scale if n else 1.0) * force(n, omega))
            assert np.abs(amplitude(row, n) - expected).max() < LINEAR * np.abs(row).max()


def test_first_harmonic_is_the_load_as_ever(tmp_path):
    plain = merged(GROUPS, {"load": {key: None for key in TERMS}, **CUBIC})
    run(tmp_path, plain)
    expected = read(tmp_path / "case.h5")["coefficients"]
    run(tmp_path, merged(plain, {"load": {
        "cosine": 0.0, "sine": 0.0, "n_terms": 2, "term_dof": [2, 3], "term_amplitude": [0.5, 0.2],
        "term_phase": [0.0, -90.0]}}))
    close(read(tmp_path / "case.h5")["coefficients"], expected, SAME)


def test_integration_in_time(tmp_path):
    """Cubic and quadratic terms of the response come from all loads."""
    groups = merged(GROUPS, {**CUBIC, "harmonics": {"n_harmonics": 25, "n_time": 256},
                             "sweep": {"values": [0.8]}, "output": {"histories": True}})
    run(tmp_path, groups)
    balance = read(tmp_path / "case.h5")
    run(tmp_path, merged(groups, {"case": {"analysis": "time"}}), name="time")
    time = read(tmp_path / "time.h5")
    n = time["coefficients"].shape[1]
    # The integration is closed to 1e-8, and 25 harmonics leave less.
    close(time["coefficients"], balance["coefficients"][:, :n], 1e-6)


def test_steps_of_the_integration(tmp_path):
    """With a pair, by steps of second order: four times the steps, a sixteenth of the error."""
    groups = merged(GROUPS, {
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [3, 0, 0], "mu": 0.3,
                    "normal_load": 0.5, "tangential_stiffness": 1.0},
        "harmonics": {"n_harmonics": 61, "sampling": "events"}, "sweep": {"values": [0.8]}})
    run(tmp_path, groups)
    balance = read(tmp_path / "case.h5")["coefficients"][:, :13]
    error = []
    for steps in (200, 800):
        run(tmp_path, merged(groups, {"case": {"analysis": "time"}, "harmonics": {
            "n_harmonics": 6, "sampling": None}, "time": {"steps_per_period": steps}}), name="time")
        time = read(tmp_path / "time.h5")["coefficients"]
        error.append(np.abs(time[:, :13] - balance).max() / np.abs(balance).max())
    assert error[1] < 1e-4 and error[1] < error[0] / 8.0


def test_branch_of_a_load_that_grows(tmp_path):
    """Points of an arc-length branch solve the natural sweep, the slope of the load included."""
    groups = merged(GROUPS, {"spring": {**CUBIC["spring"], "coefficient": 0.01},
                             "sweep": {"values": None, "start": 0.5, "end": 1.1,
                                       "continuation": "arclength"}})
    run(tmp_path, groups)
    branch = read(tmp_path / "case.h5")
    assert branch["converged"].all()
    run(tmp_path, merged(groups, {"sweep": {
        "start": None, "end": None, "continuation": None,
        "values": branch["omega"].tolist()}}), name="sweep")
    sweep = read(tmp_path / "sweep.h5")
    close(branch["coefficients"], sweep["coefficients"], 1e-6)


def test_harmonics_begin_with_those_of_the_load(tmp_path):
    run(tmp_path, merged(GROUPS, {**CUBIC, "harmonics": {"n_harmonics": 31, "accuracy": 1e-4}}))
    found = read(tmp_path / "case.h5")
    assert found["harmonics"].min() >= 5
    run(tmp_path, merged(GROUPS, {**CUBIC, "harmonics": {"n_harmonics": 31}}), name="full")
    full = read(tmp_path / "full.h5")
    assert np.abs(found["amplitude"] - full["amplitude"]).max() < 1e-2 * full["amplitude"].max()


def test_parity_follows_the_harmonics(tmp_path):
    """Odd loads alone leave the even harmonics at zero, one even load does not."""
    odd = merged(GROUPS, {**CUBIC, "load": {
        "n_terms": 1, "term_dof": 1, "term_harmonic": 3, "term_amplitude": 0.3, "term_phase": 0.0,
        "term_power": 0}, "harmonics": {"parity": "odd"}})
    run(tmp_path, odd)
    found = read(tmp_path / "case.h5")["coefficients"]
    assert np.abs(found[:, 5]).max() > 0.0 and not found[:, [0, 3, 4, 7, 8]].any()
    even = merged(odd, {"load": {"term_harmonic": 2}})
    assert "even" in run(tmp_path, even, status=3).stderr
    run(tmp_path, merged(even, {"harmonics": {"parity": None}}))
    assert np.abs(read(tmp_path / "case.h5")["coefficients"][:, 3]).max() > 0.0


@pytest.mark.skipif(not HAS_EXTENSION, reason="this build has no extension for Python")
def test_model_file_and_memory(tmp_path):
    groups = merged(GROUPS, {**CUBIC, "load": {"term_power": 0}})
    run(tmp_path, groups)
    expected = read(tmp_path / "case.h5")["coefficients"]
    harmonics = [0, 2, 5, 1]
    rows = np.zeros((4, 3), complex)
    for dof, h, size, phase in zip(*(TERMS[f"term_{key}"] for key in (
            "dof", "harmonic", "amplitude", "phase"))):
        rows[harmonics.index(h), abs(dof) - 1] = (np.sign(dof) * size
                                                  * np.exp(1j * np.radians(phase)))
    waves = {h: (row.real, -row.imag) for h, row in zip(harmonics, rows)}
    model = Model(M, C, K, cosine=[0.0, 0.5, 0.0], sine=[0.0, 0.0, 0.2], harmonic=waves)
    model.to_hdf5(tmp_path / "model.h5")
    with h5py.File(tmp_path / "model.h5") as file:
        assert sorted(file["load/harmonic"][()]) == sorted(harmonics)
    bare = {key: groups[key] for key in ("case", "harmonics", "sweep", "solver", "spring")}
    run(tmp_path, bare | {"model": {"source": "hdf5", "file": "model.h5"}}, name="file")
    close(read(tmp_path / "file.h5")["coefficients"], expected, SAME)
    # Orders would make the harmonics of the file others than it says.
    orders = bare | {"model": {"source": "hdf5", "file": "model.h5"}, "load": {
        "n_terms": 1, "term_dof": 1, "term_order": 2, "term_amplitude": 1.0}}
    assert "multiples of 2" in run(tmp_path, orders, name="orders", status=3).stderr
    again = Model.from_hdf5(tmp_path / "model.h5")
    assert again.harmonic.keys() == waves.keys()
    case = Case(again, **{key: value for key, value in bare.items() if key != "case"})
    close(np.asarray(fretwear.run(case).coefficients), expected, SAME)


@pytest.mark.parametrize("changes, words", [
    ({"term_harmonic": [1, 2, 9, 0]}, ["n_harmonics = 6", "at least 9"]),
    ({"term_order": [2, 2, 4, 6]}, ["term_order", "term_harmonic"]),
    ({"term_order": [2, 2, 4, 6], "term_harmonic": None}, ["multiples of 2", "order 1"]),
    ({"term_dof": [1, 0, 2, 2]}, ["term_dof", "ground"]),
    ({"term_dof": [1, 7, 2, 2]}, ["term_dof", "7"]),
    ({"term_power": [0, 0, 0, 1]}, ["term_power", "harmonic 0"]),
    ({"term_harmonic": [1, 2, -5, 0]}, ["term_harmonic", "-5"]),
    ({"term_amplitude": None}, ["term_amplitude", "missing"]),
    ({"n_terms": None}, ["n_terms", "missing"]),
    ({"n_terms": None, "term_amplitude": None}, ["n_terms", "missing"]),
])
def test_refusals(tmp_path, changes, words):
    done = run(tmp_path, merged(GROUPS, {"load": changes}), status=3)
    for word in words:
        assert word in done.stderr


@pytest.mark.parametrize("parts, words", [
    ({"harmonic": [-1], "harmonic_cosine": np.zeros((1, 3))}, ["/load/harmonic", "-1"]),
    ({"harmonic": [2], "harmonic_cosine": np.zeros((2, 3))}, ["harmonic_cosine", "shape"]),
    ({"harmonic_sine": np.zeros((1, 3))}, ["harmonic_sine", "/load/harmonic"]),
    ({"harmonic": [2], "harmonic_sine": np.full((1, 3), np.nan)}, ["harmonic_sine", "finite"]),
    ({"harmonic": [7], "harmonic_sine": np.ones((1, 3))}, ["at least 7"]),
])
def test_refusals_of_model_files(tmp_path, parts, words):
    Model(M, C, K).to_hdf5(tmp_path / "model.h5")
    with h5py.File(tmp_path / "model.h5", "a") as file:
        for name, values in parts.items():
            file[f"load/{name}"] = values
    groups = {"model": {"source": "hdf5", "file": "model.h5"}, "harmonics": {"n_harmonics": 6},
              "sweep": {"values": [1.0]}}
    done = run(tmp_path, groups, status=3)
    for word in words:
        assert word in done.stderr


@pytest.mark.skipif(not HAS_EXTENSION, reason="this build has no extension for Python")
def test_displacements_are_recovered(tmp_path):
    """What is not observed follows from the loads of every harmonic."""
    run(tmp_path, merged(GROUPS, {"output": {"observe": [2]}}))
    run(tmp_path, GROUPS, name="all")
    found = recover_displacement(Result(tmp_path / "case.h5"))
    close(found, read(tmp_path / "all.h5")["coefficients"], SAME)
