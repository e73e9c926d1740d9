"""Sectors of many pairs, whose steps multiply in single precision: against LU of the whole
derivative, which takes the matrices as they are."""
import numpy as np
import pytest
from cases import read, run
from cyclic_cases import difference

#: Both are solved to residuals of 1e-11; conditioning takes the rest.
EQUAL = 1e-8
N_PAIRS, N_DOF = 16, 56


def random_sector(seed, law):
    """Pairs on the ground and in the sector, the last one on the next sector; two dofs tied."""
    rng = np.random.default_rng([48, seed])
    root = rng.normal(size=(2, N_DOF, N_DOF)) / np.sqrt(N_DOF)
    mass, stiffness = (factor @ factor.T for factor in root)
    mass = 0.02 * mass + 0.2 * np.eye(N_DOF)
    stiffness = stiffness + 2.0 * np.eye(N_DOF)
    side_1 = np.arange(1, 3 * N_PAIRS + 1).reshape(-1, 3)
    side_2 = np.zeros_like(side_1)
    side_2[-2], side_2[-1] = [49, 50, 51], [52, 53, 54]
    flat = {"static": 0.0 * np.ones(N_DOF), "cosine": rng.normal(size=N_DOF),
            "sine": rng.normal(size=N_DOF)}
    return {
        "model": {"n_dof": N_DOF, "mass": mass.ravel().tolist(),
                  "stiffness": stiffness.ravel().tolist(), "rayleigh_mass": 0.02,
                  "rayleigh_stiffness": 0.02},
        "cyclic": {"n_sectors": 7, "engine_order": 2, "n_interface": 1, "left": [55],
                   "right": [-56]},
        "load": {key: value.tolist() for key, value in flat.items()},
        "contact": {"n_pairs": N_PAIRS, "law": law, "side_1": side_1.ravel().tolist(),
                    "side_2": side_2.ravel().tolist(), "sector_2": [0] * (N_PAIRS - 1) + [1],
                    "mu": 0.4, "gap": rng.uniform(-0.8, 0.1, N_PAIRS).tolist(),
                    **({"tangential_stiffness": 3.0, "normal_stiffness": 4.0}
                       if law == "penalty" else {})},
        "harmonics": {"n_harmonics": 2, "n_time": 64},
        "sweep": {"values": [1.1, 1.6, 2.3], "refine": False}}


@pytest.mark.parametrize("law", ["penalty", "dlft"])
@pytest.mark.parametrize("seed", range(3))
def test_near_products_change_no_row(tmp_path, law, seed):
    found = {}
    for linear in ("krylov", "lu"):
        run(tmp_path, random_sector(seed, law) | {
            "case": {"analysis": "frf"}, "solver": {"tolerance": 1e-11, "linear": linear}})
        found[linear] = read(tmp_path / "case.h5")
        assert found[linear]["converged"].all()
    assert found["krylov"]["contact/fraction"][..., 1].max() > 0.1   # some slip
    for name in ("coefficients", "contact/force"):
        assert difference(found["krylov"][name], found["lu"][name]) < EQUAL
