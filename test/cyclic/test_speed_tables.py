"""Matrices at several rotation speeds (/speed), and engine orders of sectors that differ.

test/reference/blades/b6_speeds.json is an annulus by a dense harmonic balance of other origin.
Random disks are judged by points of fixed speed, and tables by the polynomials that they come from.
"""
import json

import h5py
import numpy as np
import pytest
from annulus import random_case
from cases import read, run, run_reference, with_model, write_parts
from deviations import draw, write
from project import ROOT

REFERENCE = json.loads((ROOT / "test/reference/blades/b6_speeds.json").read_text())
#: Both ways are solved to residuals of 1e-12; conditioning takes the rest.
EQUAL = 1e-9
ORDER = 3.0


@pytest.mark.parametrize("number", range(len(REFERENCE["runs"])))
def test_another_program(tmp_path, number):
    run_reference(tmp_path, REFERENCE, number)


def polynomials(rng, case, n_powers):
    """Stiffness and load for Omega**2, Omega**4, .. (n_powers, n, n), (n_powers, n); at rest."""
    stiffness = np.array(case["model"]["stiffness"])
    n = len(stiffness)
    grown = [0.5**p * rng.uniform(0.0, 1.0) * (stiffness + 0.3 * np.eye(n))
             for p in range(n_powers)]
    loads = [0.5**p * 0.05 * rng.normal(size=n) for p in range(n_powers)]
    return np.array(grown), np.array(loads), 0.02 * rng.normal(size=n)


def put_speeds(path, stiffness, values, polynomial):
    """Tables at the speeds in place of the stiffness."""
    grown, loads, at_rest = polynomial
    with h5py.File(path, "a") as file:
        del file["stiffness"]
        file["speed/value"] = values
        for i, speed in enumerate(values):
            powers = np.array([speed**(2 * p + 2) for p in range(len(grown))])
            file[f"speed/{i}/stiffness"] = stiffness + np.tensordot(powers, grown, 1)
            file[f"speed/{i}/static"] = at_rest + powers @ loads


def disk(tmp_path, seed):
    """A random disk with tables, Coriolis forces and deviations of every kind; its groups."""
    rng = np.random.default_rng([83, seed])
    law = str(rng.choice(["penalty", "regularised"]))
    case = random_case(rng, n_sectors=int(rng.integers(2, 7)), n_pairs=int(rng.integers(0, 3)),
                       law=law)
    case["n_harmonics"] = int(rng.integers(1, 4))
    way = str(rng.choice(["rows", "blade", "sectors", "together"]))
    parts, scale, _ = draw(rng, case, way, 0.08)
    write(tmp_path / "model.h5", case, parts)
    n_powers = int(rng.integers(1, 4))
    values = np.sort(rng.uniform(0.1, 0.9, n_powers + 1))
    values[0] = 0.0 if rng.random() < 0.5 else values[0]
    stiffness = np.array(case["model"]["stiffness"])
    put_speeds(tmp_path / "model.h5", stiffness, values, polynomials(rng, case, n_powers))
    if rng.random() < 0.7:
        with h5py.File(tmp_path / "model.h5", "a") as file:
            skew = 0.05 * rng.normal(size=stiffness.shape)
            file["coriolis"] = skew - skew.T
    groups = {"case": {"analysis": "frf"}, "model": {"rayleigh_stiffness": 1e-3},
              "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
              "mistuning": {"scale": scale}, "solver": {"tolerance": 1e-12},
              "harmonics": {"n_harmonics": case["n_harmonics"], "sampling": "uniform",
                            "n_time": 96}}
    if rng.random() < 0.5:
        groups["model"]["loss_factor"] = 0.01
    if case["contact"]["mu"]:
        groups["contact"] = {"law": law}
    omega = ORDER * rng.uniform(values[0], values[-1], 3)
    return groups, np.sort(omega)


@pytest.mark.parametrize("seed", range(8))
def test_rows_along_an_order_are_points_of_their_speed(tmp_path, seed):
    groups, omega = disk(tmp_path, seed)
    run(tmp_path, with_model(groups | {"sweep": {"values": omega, "speed_order": ORDER}}))
    followed = read(tmp_path / "case.h5")
    assert np.abs(followed["speed"] - omega / ORDER).max() < 1e-14
    for i, w in enumerate(omega):
        fixed = with_model(groups | {"case": {"analysis": "point"}, "sweep": {"start": w}})
        fixed["model"] = fixed["model"] | {"rotation_speed": w / ORDER}
        run(tmp_path, fixed, name="point")
        one = read(tmp_path / "point.h5")["coefficients"][0]
        size = np.abs(one).max()
        assert np.abs(followed["coefficients"][i] - one).max() < EQUAL * size


def by_both_ways(tmp_path, case, speeds, grown, load, groups):
    """The case by matrices per square of the speed, and by a table that says the same."""
    stiffness = np.array(case["model"]["stiffness"])
    for way in ("square", "table"):
        folder = tmp_path / way
        folder.mkdir()
        write(folder / "model.h5", case, {})
        if way == "table":
            put_speeds(folder / "model.h5", stiffness, speeds,
                       (grown[None], load[None], 0.0 * load))
        else:
            with h5py.File(folder / "model.h5", "a") as file:
                file["stiffness_rotation"], file["load/static_rotation"] = grown, load
        run(folder, with_model(groups))
        yield read(folder / "case.h5")


@pytest.mark.parametrize("mistuned", [False, True])
def test_a_table_of_two_speeds_is_stiffening_by_the_square(tmp_path, mistuned):
    rng = np.random.default_rng(5)
    case = random_case(rng, n_sectors=5, n_pairs=1, engine_order=2)
    grown, loads, _ = polynomials(rng, case, 1)
    square, table = by_both_ways(tmp_path, case, [0.2, 0.7], grown[0], loads[0], {
        "case": {"analysis": "frf"}, "cyclic": {"engine_order": 2, "mistuned": mistuned},
        "contact": {"law": "penalty"}, "sweep": {"values": [0.9, 1.5], "speed_order": 3},
        "solver": {"tolerance": 1e-12}, "harmonics": {"n_harmonics": 3}})
    size = np.abs(square["coefficients"]).max()
    assert np.abs(square["coefficients"] - table["coefficients"]).max() < EQUAL * size


def test_a_campbell_diagram_of_a_table(tmp_path):
    rng = np.random.default_rng(6)
    case = random_case(rng, n_sectors=6, n_pairs=0, engine_order=2)
    grown, _, _ = polynomials(rng, case, 1)
    square, table = by_both_ways(
        tmp_path, case, [0.0, 1.2], grown[0], np.zeros(len(grown[0])), {
            "case": {"analysis": "campbell"}, "campbell": {
                "start": 0.1, "end": 1.1, "n_speeds": 6, "orders": [2, 3]}})
    for name in ("campbell/open", "campbell/crossing/speed"):
        assert np.allclose(square[name], table[name], rtol=1e-8, equal_nan=True), name
    # The largest of the rows near a crossing, which round-off moves beside the peak that they
    # close in on: 4e-5 on some processors.
    name = "campbell/peak/amplitude"
    assert np.allclose(square[name], table[name], rtol=5e-4, equal_nan=True)
    assert len(square["campbell/crossing/speed"]) > 0


def test_the_branch_along_an_order_meets_its_points(tmp_path):
    """Arc-length continuation takes the derivative by the frequency of all that follows it."""
    groups, _ = disk(tmp_path, 3)
    with h5py.File(tmp_path / "model.h5") as file:
        low, high = ORDER * file["speed/value"][[0, -1]]
    sweep = {"start": 0.9 * low + 0.1 * high, "end": high, "speed_order": ORDER,
             "continuation": "arclength"}
    run(tmp_path, with_model(groups | {"solver": {"tolerance": 1e-11}, "sweep": sweep}))
    branch = read(tmp_path / "case.h5")
    assert len(branch["omega"]) > 3
    for i in (1, len(branch["omega"]) // 2):
        run(tmp_path, with_model(groups | {"sweep": {"values": [branch["omega"][i]],
                                                     "speed_order": ORDER}}), name="row")
        row = read(tmp_path / "row.h5")["coefficients"][0]
        assert np.abs(branch["coefficients"][i] - row).max() < 1e-7 * np.abs(row).max()


@pytest.mark.parametrize("n_values", [2, 3, 4])
def test_a_plain_structure_has_its_speeds_too(tmp_path, n_values):
    """One mass on a spring of k0 + k1 Omega**2 + ..: u = F/(k - m omega**2)."""
    values = np.linspace(0.0, 2.0, n_values)
    powers = [0.7, -0.2, 0.03][:n_values - 1]

    def stiffness(speed):
        return 3.0 + sum(k * speed**(2 * p + 2) for p, k in enumerate(powers))

    datasets = {"mass": [[1.0]], "load/cosine": [0.5], "speed/value": values}
    for i, speed in enumerate(values):
        datasets[f"speed/{i}/stiffness"] = [[stiffness(speed)]]
    write_parts(tmp_path / "model.h5", datasets)
    run(tmp_path, with_model({"case": {"analysis": "point"}, "model": {"rotation_speed": 1.3},
                              "harmonics": {"n_harmonics": 1}, "sweep": {"start": 0.8}}))
    found = read(tmp_path / "case.h5")["coefficients"][0, 1, 0]
    assert abs(found - 0.5 / (stiffness(1.3) - 0.64)) < 1e-12


def broken(datasets, **changes):
    return {key: value for key, value in (datasets | changes).items() if value is not None}


GOOD = {"mass": [[1.0]], "load/cosine": [0.5], "speed/value": [0.0, 1.0],
        "speed/0/stiffness": [[3.0]], "speed/1/stiffness": [[4.0]]}
POINT = {"case": {"analysis": "point"}, "sweep": {"start": 0.8}, "harmonics": {"n_harmonics": 1}}


@pytest.mark.parametrize(("changes", "groups", "told"), [
    ({"speed/value": [0.0]}, {}, "1 values of speed/value: must be 2 to 4"),
    ({"speed/value": [1.0, 1.0]}, {}, "does not ascend"),
    ({"speed/value": None}, {}, "without speed/value"),
    ({"speed/1/stiffness": None}, {}, "speed/1"),
    ({"speed/2/stiffness": [[5.0]]}, {}, "group speed/2, but 2 values"),
    ({"speed/1/static": [0.1]}, {}, "same of stiffness and static"),
    ({"stiffness": [[3.5]]}, {}, "differs from what speed/I/stiffness say"),
    ({"stiffness_rotation": [[1.0]]}, {}, "must be one of both"),
    ({"speed/1/stiffness": [[4.0, 0.0]]}, {}, "speed/1/stiffness has shape"),
    ({"speed/1/velocity": [[4.0]]}, {}, "speed/1/velocity is nothing that is read"),
    ({}, {"model": {"rotation_speed": 1.5}}, "must be one of these"),
    ({"speed/value": [0.5, 1.0]}, {}, "must be one of these"),
    ({}, {"case": {"analysis": "frf"}, "sweep": {"values": [0.8, 2.2], "start": None,
                                                 "speed_order": 2}},
     "known from 0.00000 to 1.00000 rad/s")])
def test_wrong_tables_are_refused_in_words(tmp_path, changes, groups, told):
    write_parts(tmp_path / "model.h5", broken(GOOD, **changes))
    case = with_model({key: POINT.get(key, {}) | groups.get(key, {}) for key in POINT | groups})
    for group in case.values():
        for key in [key for key, value in group.items() if value is None]:
            del group[key]
    words = run(tmp_path, case, status=3).stderr
    assert told in words


def test_a_resonance_stays_between_the_speeds(tmp_path):
    """It may leave the sweep by half of it; sectors that differ have one highest point."""
    groups, _ = disk(tmp_path, 2)
    with h5py.File(tmp_path / "model.h5") as file:
        low, high = ORDER * file["speed/value"][[0, -1]]
    resonance = {"parameter": "load%harmonic_scale", "start": 1.0, "end": 1.2, "n_points": 2}
    asked = groups | {"case": {"analysis": "resonance"}, "resonance": resonance}
    done = run(tmp_path, with_model(asked | {"sweep": {
        "start": low + 1e-3, "end": high, "n_points": 9, "speed_order": ORDER}}), status=3)
    assert "asks for speeds" in done.stderr
    width = high - low
    sweep = {"start": low + 0.3 * width, "end": high - 0.3 * width, "n_points": 41,
             "speed_order": ORDER}
    run(tmp_path, with_model(asked | {"sweep": sweep}), status=(0, 4))
    found = read(tmp_path / "case.h5")
    assert found["converged"].any()
    for k in np.flatnonzero(found["converged"]):
        omega = found["omega"][k]
        assert abs(found["speed"][k] * ORDER / omega - 1.0) < 1e-14
        run(tmp_path, with_model(groups | {
            "load": {"harmonic_scale": float(found["parameter"][k])},
            "sweep": {"values": [omega], "speed_order": ORDER}}), name="point")
        c = read(tmp_path / "point.h5")["coefficients"][0]
        height = np.ravel(found["resonance/first_harmonic"][k])[0]
        assert abs(np.hypot(c[1], c[2])[0] / height - 1.0) < 1e-6
