"""Cyclic models in memory and in files, and the sectors of a result."""
import json

import h5py
import numpy as np
import pytest
from project import ROOT

import fretwear as fw


def reference():
    return json.loads((ROOT / "test/reference/cyclic_v2_shroud_backward.json").read_text())


def model(case, **changes):
    parts, contact = case["model"], case["contact"]
    pairs = {"side_1": contact["side_1"], "side_2": contact["side_2"],
             "sector_2": contact["sector_2"], "mu": contact["mu"], "gap": contact["gap"],
             "tangential_stiffness": contact["tangential_stiffness"],
             "normal_stiffness": contact["normal_stiffness"]} | changes
    return fw.Model(parts["mass"], parts["damping"], parts["stiffness"],
                    contact=fw.ContactPairs(**pairs), **case["load"],
                    sectors=fw.Sectors(case["n_sectors"], parts["left"], parts["right"]))


def solve(structure, case, omega, **settings):
    return fw.run(fw.Case(structure, case={"analysis": "point"}, sweep={"start": omega},
                          cyclic={"engine_order": case["engine_order"]},
                          harmonics={"n_harmonics": 7, "sampling": "events"},
                          contact={"law": "penalty"} | settings, solver={"tolerance": 1e-12}))


def test_a_model_in_memory_meets_the_reference():
    case = reference()
    point = case["points"][3]
    result = solve(model(case), case, point["omega"])
    expected = np.array(point["events"]["u"])
    assert np.abs(result.coefficients[0] - expected).max() < 1e-8 * np.abs(expected).max()


def test_sectors_are_delayed_and_tied():
    case = reference()
    result = solve(model(case), case, case["points"][3]["omega"])
    n, left, right = case["n_sectors"], case["model"]["left"], case["model"]["right"]
    assert np.allclose(result.sector(0), result.coefficients)
    assert np.allclose(result.sector(n), result.coefficients)
    for j in range(n):
        here, following = result.sector(j), result.sector(j + 1)
        # The right interface is the left one of the next sector.
        assert np.allclose(here[:, :, np.array(right) - 1], following[:, :, np.array(left) - 1])
    assert result.sector(1, "contact/force").shape == result["contact/force"].shape
    with pytest.raises(fw.InputError, match="contact/force"):
        result.sector(1, "omega")


def test_model_files_hold_sectors(tmp_path):
    case = reference()
    model(case).to_hdf5(tmp_path / "model.h5")
    with h5py.File(tmp_path / "model.h5") as file:
        assert file["cyclic"].attrs["n_sectors"] == 7
    again = fw.Model.from_hdf5(tmp_path / "model.h5")
    assert list(again.sectors.left) == case["model"]["left"]
    point = case["points"][3]
    for structure in (again, tmp_path / "model.h5"):
        result = solve(structure, case, point["omega"])
        expected = np.array(point["events"]["u"])
        assert np.abs(result.coefficients[0] - expected).max() < 1e-8 * np.abs(expected).max()


def test_what_is_refused():
    case = reference()
    with pytest.raises(fw.InputError, match="n_sectors"):
        fw.Model(np.eye(2), None, np.eye(2), sectors=fw.Sectors(0))
    with pytest.raises(fw.InputError, match="right"):
        fw.Model(np.eye(2), None, np.eye(2), sectors=fw.Sectors(4, [1], []))
    with pytest.raises(fw.InputError, match="sector_2"):
        model(case, sector_2=0.5)


def test_results_without_sectors():
    structure = fw.Model(np.eye(1), None, np.eye(1), cosine=[1.0])
    result = fw.run(fw.Case(structure, case={"analysis": "point"}, sweep={"start": 2.0}))
    with pytest.raises(fw.AbsentError, match="engine_order"):
        result.sector(1)


def test_sectors_that_differ():
    """Each has its own motion, tied to that of its neighbours."""
    case = reference()
    n, left, right = case["n_sectors"], case["model"]["left"], case["model"]["right"]
    pairs = len(case["contact"]["side_1"])
    mu = np.tile(case["contact"]["mu"], n) * np.linspace(0.5, 1.5, n * pairs)
    result = fw.run(fw.Case(model(case), case={"analysis": "point"},
                            sweep={"start": case["points"][3]["omega"]},
                            cyclic={"engine_order": case["engine_order"], "mistuned": True},
                            harmonics={"n_harmonics": 7, "sampling": "events"},
                            contact={"law": "penalty", "mu": mu.tolist()},
                            solver={"tolerance": 1e-12}))
    n_dof = len(case["model"]["mass"])
    assert result.is_mistuned and result.observed[0] == "u1@0"
    assert result.sector_amplitude.shape == (1, n, n_dof)
    assert np.ptp(result.sector_amplitude, axis=1).max() > 1e-3 * result.amplitude.max()
    for j in range(n):
        here, following = result.sector(j), result.sector(j + 1)
        assert np.allclose(here[:, :, np.array(right) - 1], following[:, :, np.array(left) - 1])
    assert result.sector(1, "contact/force").shape[2] == pairs
