"""A rotation speed that follows the frequency along an engine order (&sweep speed_order).

test/reference/blades/b5_speed.json is a dense harmonic balance of other origin: a sector with
Coriolis forces and a stiffness and a static load that grow with the square of the speed.
"""
import json

import h5py
import numpy as np
import pytest
from cases import merged, read, run
from oracle_runs import run_case
from project import ROOT

REFERENCE = json.loads((ROOT / "test/reference/blades/b5_speed.json").read_text())
#: Residuals of 1e-12 times the condition of the structure (below 100), and a margin of ten.
WITHIN = 1e-9
#: What grows with the speed of the contact is not served, and the linear run has no pairs.
LEFT_OUT = ("contact/gap_rotation", "contact/normal_load_rotation")


def write_model(path, turn=1.0):
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name, values in REFERENCE["file"].items():
            group, _, attribute = name.partition("@")
            if attribute:
                file.require_group(group or "/").attrs[attribute] = values
            elif name not in LEFT_OUT:
                file[name] = turn * np.array(values) if name == "coriolis" else np.array(values)


def case_of(number, **changes):
    groups = {group: dict(keys) for group, keys in REFERENCE["runs"][number]["case"].items()}
    groups["model"] = {"source": "hdf5", "file": "model.h5"}
    frequencies = groups["sweep"].pop("frequencies")
    groups["sweep"]["values"] = frequencies
    return merged(groups, changes)


def test_an_engine_order_against_a_dense_balance(tmp_path):
    write_model(tmp_path / "model.h5")
    (wanted,) = REFERENCE["runs"][1]["expect"]
    assert wanted["dataset"] == "coefficients"
    found = run_case(tmp_path, case_of(1))
    values = np.array(wanted["value"])
    assert np.abs(found.coefficients - values).max() <= wanted["limit"] * np.abs(values).max()


@pytest.mark.parametrize("law", ["penalty", "regularised", "dlft"])
@pytest.mark.parametrize("engine_order", [4, -2])
def test_rows_are_points_of_their_own_speed(tmp_path, engine_order, law):
    """With contact, waves both ways; friction of a law without a stiffness of the method."""
    write_model(tmp_path / "model.h5")
    keys = {"law": law}
    if law == "regularised":
        keys |= {"slip_speed": 0.2}
    omega = [0.8, 1.05, 1.4]
    case = case_of(0, cyclic={"engine_order": engine_order}, contact=keys,
                   harmonics={"n_time": 128, "sampling": None})
    with h5py.File(tmp_path / "model.h5", "a") as file:
        del file["contact"].attrs["law"]
        if law == "dlft":
            # Its stiffness of the method is that at the speed: the same without what changes it.
            file["stiffness_rotation"][()] = 0.0
        if law != "penalty":
            del file["contact/tangential_stiffness"]
        if law == "dlft":
            del file["contact/normal_stiffness"]
    case["sweep"] = {"values": omega, "speed_order": abs(engine_order)}
    followed = run_case(tmp_path, case)
    speeds = read(tmp_path / "case.h5")["speed"]
    assert np.abs(speeds - np.array(omega) / abs(engine_order)).max() < 1e-15
    for i, w in enumerate(omega):
        one = run_case(tmp_path, merged(case, {
            "case": {"analysis": "point"}, "model": {"rotation_speed": w / abs(engine_order)},
            "sweep": {"values": None, "speed_order": None, "start": w}}))
        size = np.abs(one.coefficients).max()
        assert np.abs(followed.coefficients[i] - one.coefficients[0]).max() < WITHIN * size
        assert np.abs(followed.force[i] - one.force[0]).max() < 100.0 * WITHIN * max(
            size, np.abs(one.force).max())


@pytest.mark.parametrize("engine_order", [4, -2])
def test_a_branch_has_the_rows_of_a_sweep(tmp_path, engine_order):
    """By arc length the derivative by the frequency holds that by the speed."""
    write_model(tmp_path / "model.h5")
    case = case_of(0, cyclic={"engine_order": engine_order})
    case["sweep"] = {"start": 0.7, "end": 1.3, "n_points": 7, "continuation": "arclength",
                     "speed_order": 4}
    branch = run_case(tmp_path, case)
    assert branch.converged.all() and abs(branch.omega[-1] - 1.3) < 1e-9
    values = branch.omega[1:-1:5].tolist()
    case["sweep"] = {"values": values, "speed_order": 4}
    rows = run_case(tmp_path, case)
    assert np.abs(rows.coefficients - branch.coefficients[1:-1:5]).max() < \
        10.0 * WITHIN * np.abs(rows.coefficients).max()


def test_turned_coriolis_forces_are_another_structure(tmp_path):
    """They matter: G turned round is another structure along the same engine order."""
    write_model(tmp_path / "model.h5")
    one = run_case(tmp_path, case_of(1))
    write_model(tmp_path / "model.h5", turn=-1.0)
    other = run_case(tmp_path, case_of(1))
    # The Coriolis forces matter, and more where the speed is higher.
    change = np.abs(one.coefficients - other.coefficients).max(axis=(1, 2))
    assert (change > 1e-3 * np.abs(one.coefficients).max()).any()


@pytest.mark.parametrize(("order", "said"), [(4, False), (5, False), (13, False), (3, True),
                                             (4.5, True)])
def test_another_order_is_remarked(tmp_path, order, said):
    """Nine sectors and the engine order 4: 5 is -4, 13 is 4 and all sectors."""
    write_model(tmp_path / "model.h5")
    run(tmp_path, case_of(1, sweep={"speed_order": order}))
    names = read(tmp_path / "case.h5").get("remarks/name", np.array([], dtype=object))
    assert (b"another order" in names.tolist()) == said


@pytest.mark.parametrize(("changes", "words"), [
    ({"model": {"modal_damping": 0.01}}, "does not go with model%modal_damping"),
    ({"model": {"rotation_speed": 0.3}}, "does not go with model%rotation_speed"),
    ({"case": {"analysis": "resonance"}, "resonance": {
        "parameter": "model%rayleigh_stiffness", "start": 0.01, "end": 0.02, "n_points": 3},
      "sweep": {"values": None, "start": 0.7, "end": 1.2, "n_points": 9}},
     "does not go with a resonance%parameter of the matrices")])
def test_what_does_not_go_is_refused(tmp_path, changes, words):
    write_model(tmp_path / "model.h5")
    assert words in run(tmp_path, case_of(1, **changes), status=3).stderr


@pytest.mark.parametrize("engine_order", [4, -2])
def test_a_resonance_along_an_engine_order(tmp_path, engine_order):
    """Each row of a resonance is the highest point of its line, at its own speed."""
    write_model(tmp_path / "model.h5")
    case = case_of(0, case={"analysis": "resonance"}, cyclic={"engine_order": engine_order},
                   harmonics={"n_time": 1024, "sampling": None})
    case["sweep"] = {"start": 0.6, "end": 1.6, "n_points": 41, "speed_order": 4}
    case["resonance"] = {"parameter": "load%harmonic_scale", "start": 1.0, "end": 1.6,
                         "n_points": 3}
    run_case(tmp_path, case)
    found = read(tmp_path / "case.h5")
    assert found["converged"].all() and len(found["omega"]) == 3
    assert np.abs(found["speed"] * 4.0 / found["omega"] - 1.0).max() < 1e-14
    del case["resonance"]
    for omega, scale, height in zip(found["omega"], found["parameter"],
                                    found["resonance/first_harmonic"]):
        values = (omega * (1.0 + 1e-3 * np.arange(-2, 3))).tolist()
        rows = run_case(tmp_path, merged(case, {
            "case": {"analysis": "frf"}, "load": {"harmonic_scale": float(scale)},
            "sweep": {"values": values, "speed_order": 4, "start": None, "end": None,
                      "n_points": None}}))
        line = np.hypot(rows.coefficients[:, 1, 0], rows.coefficients[:, 2, 0])
        assert abs(line[2] / np.ravel(height)[0] - 1.0) < 1e-7
        # Contact decided at instants jumps by about the square of their distance.
        assert line.max() < line[2] * (1.0 + 1e-5)
        assert line[[0, 4]].max() < line[2]
