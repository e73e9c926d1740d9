"""Structures with a part that nothing holds, beside one that is held: dense solutions."""
import numpy as np
import pytest
from cases import read, run

OMEGA = 0.36


def structure(seed):
    """Stiffness and mass, the dofs in random order: a held chain, and a free one or a ring."""
    random = np.random.default_rng(seed)
    held, free = random.integers(1, 4), random.integers(2, 5)
    stiffness = np.zeros((held + free, held + free))
    springs = random.integers(1, 4, held + free) * (1.0 if seed % 2 else random.uniform(0.3, 3.0))
    for i in range(held):
        add_spring(stiffness, i, i - 1 if i else None, springs[i])
    for i in range(held + 1, held + free):
        add_spring(stiffness, i, random.integers(held, i), springs[i])
    order = random.permutation(held + free)
    return stiffness[np.ix_(order, order)], random.uniform(0.5, 2.0, held + free)


def add_spring(stiffness, i, j, value):
    """Between two dofs, or one and the ground."""
    stiffness[i, i] += value
    if j is not None:
        stiffness[j, j] += value
        stiffness[i, j] -= value
        stiffness[j, i] -= value


@pytest.mark.parametrize("first", range(0, 60, 15))
def test_a_free_part_spoils_no_other(tmp_path, first):
    """A stiffness that is singular may have a pivot of round-off where it should have none."""
    for seed in range(first, first + 15):
        stiffness, mass = structure(seed)
        n = len(mass)
        load = np.random.default_rng(seed + 1000).normal(size=n)
        run(tmp_path, {
            "case": {"analysis": "point"},
            "model": {"n_dof": n, "mass": np.diag(mass).ravel().tolist(),
                      "stiffness": stiffness.ravel().tolist()},
            "load": {"cosine": load.tolist()}, "harmonics": {"n_harmonics": 1},
            "sweep": {"start": OMEGA}})
        dynamic = stiffness - OMEGA**2 * np.diag(mass)
        found = read(tmp_path / "case.h5")["coefficients"][0, 1]
        size = np.abs(stiffness).max() * np.abs(found).max() + np.abs(load).max()
        assert np.abs(dynamic @ found - load).max() < 1e-9 * size, seed


def test_the_last_pivot_is_round_off(tmp_path):
    """Row after row of this free part cancels to a positive last pivot."""
    run(tmp_path, {
        "case": {"analysis": "point"},
        "model": {"n_dof": 5, "mass": np.eye(5).ravel().tolist(),
                  "stiffness": [7, 0, 0, 0, -1, 0, 2, -1, -1, 0, 0, -1, 1, 0, 0, 0, -1, 0, 1, 0,
                                -1, 0, 0, 0, 6]},
        "load": {"cosine": [1, 0, 0, 0, 0]}, "harmonics": {"n_harmonics": 1},
        "sweep": {"start": OMEGA}})
    found = read(tmp_path / "case.h5")["coefficients"][0, 1, 0]
    grounded = np.array([[7.0, -1.0], [-1.0, 6.0]]) - OMEGA**2 * np.eye(2)
    assert found == pytest.approx(np.linalg.solve(grounded, [1.0, 0.0])[0], rel=1e-9)
