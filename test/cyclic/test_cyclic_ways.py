"""Branches, accuracy, collocation, waves in phase, wear that goes on, modes."""
import numpy as np
import pytest
from cases import read, run
from cyclic_cases import TIGHT, difference, model_groups, read_reference, run_at


def groups_of(name, n_harmonics=7, **sweep):
    return model_groups(read_reference(name)) | {
        "case": {"analysis": "frf"}, "harmonics": {"n_harmonics": n_harmonics}, "sweep": sweep}


def test_points_of_a_branch_are_those_of_a_sweep(tmp_path):
    run(tmp_path, groups_of("v2", start=2.6, end=1.8, continuation="arclength")
        | {"solver": {"tolerance": 1e-10}})
    branch = read(tmp_path / "case.h5")
    assert branch["omega"].min() <= 1.8 and branch["converged"].all()
    # Where the branch comes down from above, and where the shrouds lift off.
    chosen = [1, int(np.abs(branch["omega"] - 2.2).argmin())]
    points = run_at(tmp_path, read_reference("v2"), branch["omega"][chosen],
                    solver={"tolerance": 1e-10})
    assert difference(points["coefficients"], branch["coefficients"][chosen]) < 1e-7


def test_higher_harmonics_bring_new_nodal_diameters(tmp_path):
    """With v2 harmonics 1, 2, 3 and 7 have nodal diameters 2, 3, 1 and 0."""
    frequencies = [2.4, 2.3, 2.2]
    found = {}
    for name, harmonics in {"all": {"n_harmonics": 31},
                            "accuracy": {"accuracy": 1e-4}}.items():
        run(tmp_path, groups_of("v2", values=frequencies) | {"harmonics": harmonics})
        found[name] = read(tmp_path / "case.h5")
        assert found[name]["converged"].all()
    n = 2 * 3 + 1
    exact = found["all"]["coefficients"][:, :n]
    assert difference(found["accuracy"]["coefficients"][:, :n], exact) < 1e-4


def test_collocation_in_both_variables(tmp_path):
    found = []
    for method in ("tcm", "hdhb"):
        groups = groups_of("v2", 5, values=[2.4, 2.3])
        groups["harmonics"] |= {"method": method, "n_time": 11}
        run(tmp_path, groups | {"solver": {"tolerance": 1e-11}})
        found.append(read(tmp_path / "case.h5")["coefficients"])
    assert difference(*found) < 1e-8


def test_all_sectors_alike(tmp_path):
    """In phase the load moves no pair: what is left is the preload, and the joint is stuck."""
    groups = groups_of("v3", 5, start=0.5, end=0.8, n_points=4)
    groups["cyclic"]["engine_order"] = 0
    groups["harmonics"]["sampling"] = "uniform"
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    assert found["converged"].all()
    assert np.allclose(found["contact/fraction"], [1.0, 0.0, 0.0])


@pytest.mark.parametrize("name", ["v1", "v7"])
def test_undamped_sectors(tmp_path, name):
    """Modes without damping become coordinates, each in its nodal diameter: the answer follows from
    the limit of small damping."""
    found = []
    for share in (0.0, 1e-9):
        groups = groups_of(name, 5, values=[2.0, 2.5])
        damping = np.array(groups["model"]["damping"])
        groups["model"]["damping"] = (share * damping).tolist()
        groups["load"] |= {key: (0.05 * np.array(groups["load"][key])).tolist()
                           for key in ("cosine", "sine")}
        run(tmp_path, groups | {"solver": {"tolerance": 1e-11}})
        found.append(read(tmp_path / "case.h5"))
        assert found[-1]["converged"].all()
    assert difference(found[1]["coefficients"], found[0]["coefficients"]) < 1e-6


def test_wear_goes_on(tmp_path):
    case = read_reference("v2")
    wear = case["wear"]
    groups = model_groups(case) | {
        "case": {"analysis": "wear"}, "sweep": {"start": wear["omega"]},
        "harmonics": {"n_harmonics": 5}, "solver": {"tolerance": TIGHT},
        "wear": {"coefficient": wear["coefficient"], "n_cycles": 500.0, "max_depth_step": 1e-3}}
    groups["contact"]["area"] = wear["area"]
    run(tmp_path, groups, name="whole")
    half = groups | {"wear": groups["wear"] | {"n_cycles": 250.0}}
    run(tmp_path, half, name="half")
    run(tmp_path, groups, "--restart", "half.h5", name="rest")
    whole, rest = read(tmp_path / "whole.h5"), read(tmp_path / "rest.h5")
    assert np.allclose(rest["wear/depth"][-1], whole["wear/depth"][-1], rtol=2e-3)


def test_frequencies_of_a_plain_structure(tmp_path):
    """Two masses on springs, one of them on a stop of 1; rigid contact holds it."""
    groups = {"case": {"analysis": "modes"},
              "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0],
                        "stiffness": [2.0, -1.0, -1.0, 2.0]},
              "contact": {"n_pairs": 1, "side_1": [2, 0, 0], "mu": 0.3, "normal_load": 1.0}}
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    assert list(found["modes/nodal_diameter"]) == [0]
    assert np.allclose(found["modes/open"], [[1.0, np.sqrt(3.0)]])
    assert np.isclose(found["modes/closed"][0, 0], np.sqrt(2.0))
    assert np.isnan(found["modes/closed"][0, 1])
    groups["contact"] |= {"law": "penalty", "tangential_stiffness": 1.0}
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    exact = np.sqrt(np.linalg.eigvalsh([[2.0, -1.0], [-1.0, 3.0]]))
    assert np.allclose(found["modes/closed"], [exact])


@pytest.mark.parametrize("mistuned", [False, True])
def test_resonance_without_damping(tmp_path, mistuned):
    """Where nothing limits a mode amplitudes are round-off of the stiffness, and no answer; next to
    it, at amplitudes of 1e7, they are one."""
    omega = float(np.sqrt(2.0))
    groups = {"cyclic": {"n_sectors": 3, "engine_order": 1, "mistuned": mistuned},
              "model": {"n_dof": 1, "mass": [1.0], "stiffness": [2.0]},
              "load": {"cosine": [1.0]},
              "contact": {"n_pairs": 1, "side_1": [0, 0, 1], "law": "penalty", "mu": 0.0,
                          "gap": 1e30, "normal_stiffness": 1.0},
              "harmonics": {"n_harmonics": 2},
              "sweep": {"values": [omega * (1.0 - 1e-8), omega], "refine": False}}
    run(tmp_path, groups, status=4)
    found = read(tmp_path / "case.h5")
    assert list(found["converged"]) == [True, False]
