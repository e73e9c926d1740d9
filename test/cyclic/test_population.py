"""The largest amplitude of many disks (analysis 'population').

test/reference/blades/b4_population.json are twenty disks by a dense harmonic balance of other
origin. Disks with friction are judged by sweeps of one disk each.
"""
import json

import h5py
import numpy as np
import pytest
from annulus import random_case
from cases import read, run, run_reference, with_model
from deviations import write
from project import ROOT
from test_blades import sector, with_rows

REFERENCE = json.loads((ROOT / "test/reference/blades/b4_population.json").read_text())
REFERENCE["file"]["observe/name"] = [
    name.encode() for name in REFERENCE["file"]["observe/name"]]
#: The same equations from the same start: round-off.
SAME = 1e-12
#: Frequencies of peaks: of heights known to 1e-10 the root, times the width in parts of omega.
PLACE = 1e-6


@pytest.mark.parametrize("number", range(len(REFERENCE["runs"])))
def test_other_programs(tmp_path, number):
    with h5py.File(run_reference(tmp_path, REFERENCE, number)) as file:
        assert "amplitude" not in file
        assert np.array_equal(file["population/converged"][()], file["population/solved"][()])


def with_friction(peaks, **more):
    """A case of a random sector with a pair that slips, whose blades have two modes."""
    rng, case = sector()
    parts = with_rows(rng, case)
    patterns = 0.05 * rng.uniform(-1.0, 1.0, (3, case["n_sectors"], 2))
    groups = {"case": {"analysis": "population"}, "model": {"source": "hdf5", "file": "model.h5"},
              "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
              "contact": {"law": case["law"]},
              "sweep": {"start": 0.9, "end": 1.3, "n_points": 17},
              "solver": {"tolerance": 1e-12}, "population": {"peaks": peaks},
              "harmonics": {"n_harmonics": 3, "sampling": "uniform", "n_time": 80}} | more
    return case, parts, patterns, groups


@pytest.mark.parametrize("quantity", ["first_harmonic", "largest"])
def test_rows_of_disks_with_friction_are_those_of_sweeps(tmp_path, quantity):
    case, parts, patterns, groups = with_friction(False)
    write(tmp_path / "model.h5", case, parts | {"patterns": patterns})
    run(tmp_path, groups | {"population": {"peaks": False, "quantity": quantity}})
    found = read(tmp_path / "case.h5")
    del groups["population"]
    groups["case"] = {"analysis": "frf"}
    n = case["n_sectors"]

    def largest(changes):
        run(tmp_path, groups | changes, name="one")
        rows = read(tmp_path / "one.h5")
        assert rows["converged"].all()
        high = rows["amplitude"] if quantity == "largest" else np.hypot(
            rows["coefficients"][:, 1], rows["coefficients"][:, 2])
        high = high.reshape(len(high), n, -1)
        at = high.max(axis=1).argmax(axis=0)
        return high.max(axis=(0, 1)), rows["omega"][at], high.max(axis=0).argmax(axis=0)

    for k, pattern in enumerate(patterns):
        amplitude, omega, blade = largest({"mistuning": {"frequency": pattern.ravel().tolist()}})
        assert np.abs(found["population/amplitude"][k] / amplitude - 1.0).max() <= SAME
        assert np.array_equal(found["population/sector"][k], blade)
        assert np.abs(found["population/omega"][k] - omega).max() <= SAME
    tuned = largest({"mistuning": {"scale": 0.0}})[0]
    assert np.abs(found["population/tuned"] / tuned - 1.0).max() <= 1e3 * SAME
    assert np.allclose(found["population/amplification"],
                       found["population/amplitude"] / found["population/tuned"], rtol=SAME)


def test_peaks_of_disks_with_friction_are_those_of_fine_sweeps(tmp_path):
    case, parts, patterns, groups = with_friction(True)
    write(tmp_path / "model.h5", case, parts)
    groups["population"] |= {"patterns": patterns.ravel().tolist(), "n_patterns": len(patterns)}
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    del groups["population"]
    groups["case"] = {"analysis": "frf"}
    groups["sweep"] |= {"n_points": 401}
    for k, pattern in enumerate(patterns):
        run(tmp_path, groups | {"mistuning": {"frequency": pattern.ravel().tolist()}}, name="one")
        rows = read(tmp_path / "one.h5")["coefficients"]
        fine = np.hypot(rows[:, 1], rows[:, 2]).reshape(len(rows), case["n_sectors"], -1)
        fine = fine.max(axis=(0, 1))
        assert (found["population/amplitude"][k] >= fine * (1.0 - 1e-9)).all()
        # Rows of the sweep miss a summit by the square of half a step in half widths.
        assert (found["population/amplitude"][k] <= fine * 1.01).all()


def test_pairs_of_the_tuned_disk_are_alike(tmp_path):
    """Friction that differs from sector to sector: its mean."""
    case, parts, patterns, groups = with_friction(False)
    mu = 0.3 + 0.02 * np.arange(case["n_sectors"])
    write(tmp_path / "model.h5", case, parts | {"patterns": patterns[:1]})
    run(tmp_path, groups | {"contact": {"law": case["law"], "mu": mu.tolist()}})
    tuned = read(tmp_path / "case.h5")["population/tuned"]
    run(tmp_path, groups | {"contact": {"law": case["law"], "mu": float(mu.mean())}})
    assert np.abs(read(tmp_path / "case.h5")["population/tuned"] / tuned - 1.0).max() <= 1e3 * SAME


@pytest.mark.parametrize("n_pairs", [0, 1])
def test_disks_along_an_engine_order(tmp_path, n_pairs):
    """A speed that follows the frequency, in the solution that disks without joints share too."""
    rng = np.random.default_rng([61, n_pairs])
    case = random_case(rng, n_sectors=5, n_pairs=n_pairs, engine_order=2)
    parts = with_rows(rng, case)
    patterns = 0.05 * rng.uniform(-1.0, 1.0, (2, 5, 2))
    write(tmp_path / "model.h5", case, parts | {"patterns": patterns})
    stiffness = np.array(case["model"]["stiffness"])
    with h5py.File(tmp_path / "model.h5", "a") as file:
        file["stiffness_rotation"] = 0.4 * stiffness
        skew = 0.1 * rng.normal(size=stiffness.shape)
        file["coriolis"] = skew - skew.T
    groups = with_model({
        "case": {"analysis": "population"}, "population": {"peaks": False},
        "cyclic": {"engine_order": 2, "mistuned": True},
        "sweep": {"start": 0.9, "end": 1.3, "n_points": 9, "speed_order": 2},
        "solver": {"tolerance": 1e-12}, "harmonics": {"n_harmonics": 1}}) | (
        {"contact": {"law": case["law"]}} if n_pairs else {})
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")["population/amplitude"]
    del groups["population"]
    groups["case"] = {"analysis": "frf"}
    for k, pattern in enumerate(patterns):
        run(tmp_path, groups | {"mistuning": {"frequency": pattern.ravel().tolist()}}, name="one")
        rows = read(tmp_path / "one.h5")["coefficients"]
        high = np.hypot(rows[:, 1], rows[:, 2]).reshape(len(rows), 5, -1).max(axis=(0, 1))
        assert np.abs(found[k] / high - 1.0).max() <= 1e3 * SAME


def test_patterns_of_a_sector_each_hold_for_all_rows(tmp_path):
    case, parts, patterns, groups = with_friction(False)
    groups["population"]["n_patterns"] = 2
    write(tmp_path / "model.h5", case, parts | {"patterns": patterns[:, :, 0]})
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")["population/amplitude"]
    both = np.repeat(patterns[:2, :, :1], 2, axis=2)
    groups["population"]["patterns"] = both.ravel().tolist()
    run(tmp_path, groups)
    assert len(found) == 2
    assert np.array_equal(read(tmp_path / "case.h5")["population/amplitude"], found)


@pytest.mark.parametrize(("changes", "told"), [
    ({"population": {}}, "is missing: must be blade frequencies"),
    ({"cyclic": {"engine_order": 2}}, "&cyclic mistuned is missing"),
    ({"population": {"patterns": [0.1] * 7}}, "has 7 values with n_patterns = 0"),
    ({"population": {"patterns": [0.1] * 10, "n_patterns": 3}}, "has 10 values"),
    ({"population": {"patterns": [0.1] * 9 + [-1.5], "n_patterns": 2}}, "of sector 4 in pattern 1"),
    ({"mistuning": {"scale": 0.0}}, "makes every disk the tuned one"),
    ({"sweep": {"start": 0.9, "end": 1.3, "continuation": "arclength"}}, "use 'natural'"),
    ({"output": {"histories": True}}, "points are not kept"),
    ({"harmonics": {"accuracy": 1e-3}}, "give n_harmonics"),
    ({"sweep": {"start": 0.9, "end": 1.3, "n_points": 2, "frequency": 1.0,
                "parameter": "contact%mu"}}, "sweep over the frequency")])
def test_wrong_populations_are_refused(tmp_path, changes, told):
    case, parts, patterns, groups = with_friction(False)
    groups["population"] = {"patterns": patterns.ravel().tolist(), "n_patterns": 3}
    write(tmp_path / "model.h5", case, parts)
    assert told in run(tmp_path, groups | changes, status=3).stderr


def test_rows_are_needed(tmp_path):
    case, _, patterns, groups = with_friction(False)
    write(tmp_path / "model.h5", case, {})
    groups["population"] = {"patterns": patterns.ravel().tolist(), "n_patterns": 6}
    assert "need rows of blade modes" in run(tmp_path, groups, status=3).stderr
    write(tmp_path / "model.h5", case, {"patterns": patterns[:, :, 0]})
    assert run(tmp_path, groups, status=3).stderr
