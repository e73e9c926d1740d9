"""Numbers of modes: heavy dampers, equal frequencies, and structures of many dofs."""
import h5py
import numpy as np
import pytest
import scipy.linalg
from cases import merged, run
from mode_cases import follow, mode_groups

PAIR = {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "side_2": [0, 0, 0], "mu": 1.0,
        "normal_load": 1.0, "tangential_stiffness": 1.0}


def dofs(stiffness, damping):
    """Dofs of unit mass that are not coupled; the pair is on the first."""
    n = len(stiffness)
    return {"model": {"n_dof": n, "mass": np.eye(n).ravel().tolist(),
                      "stiffness": np.diag(stiffness).ravel().tolist(),
                      "damping": np.diag(damping).ravel().tolist()},
            "contact": PAIR, "output": {"observe": list(range(1, n + 1))}}


def test_overdamped_modes_have_no_number(tmp_path):
    groups = dofs([1.0, 4.0, 9.0], [0.02, 6.0, 0.1])
    found = follow(tmp_path, groups, 1e-3, 2e-3, 1, number=2)
    assert found["attributes of mode"]["stuck_omega"] == pytest.approx(3.0, rel=1e-12)
    found = follow(tmp_path, groups, 1e-3, 2e-3, 1, near=2.1)
    assert found["attributes of mode"]["number"] == 1
    done = run(tmp_path, mode_groups(groups, 1e-3, 2e-3, 1, number=3), status=3)
    assert "has 2 elastic modes that oscillate; 1 with damping ratios of 1 and more" in done.stderr


def test_nothing_that_oscillates(tmp_path):
    done = run(tmp_path, mode_groups(dofs([1.0, 4.0], [5.0, 6.0]), 1e-3, 2e-3, 1), status=3)
    assert "no elastic mode that oscillates (2 are overdamped): lower the damping" in done.stderr


def test_equal_frequencies_of_other_damping(tmp_path):
    """Only modes that have all in common leave the plane of the motion free."""
    groups = dofs([1.0, 2.0], [0.02, 0.06])
    for number, damping in ((1, 0.02), (2, 0.06)):
        found = follow(tmp_path, groups, 1e-3, 2e-3, 1, number=number)
        ratio = found["attributes of mode"]["stuck_damping_ratio"]
        assert ratio == pytest.approx(0.5 * damping / np.sqrt(2.0), rel=1e-6)
    same = merged(groups, {"model": {"damping": [0.02, 0.0, 0.0, 0.02]}})
    done = run(tmp_path, mode_groups(same, 1e-3, 2e-3, 1), status=3)
    assert "have one frequency" in done.stderr


def test_many_dofs(tmp_path):
    """A chain with Coriolis forces and two dashpots, whose modes are first sought among the lowest
    ones at rest: of theta of (K + i omega C, M) one passes omega^2 at each number."""
    n = 150
    k = 100.0 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    m = np.diag(np.random.default_rng(3).uniform(0.5, 2.0, n))
    g = np.kron(np.eye(n // 2), [[0.0, 1.0], [-1.0, 0.0]])
    c = 1e-3 * k
    c[n // 3, n // 3] += 8.0
    c[n // 2, n // 2] += 8.0
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        file["mass"], file["stiffness"], file["damping"], file["coriolis"] = m, k, c, g
        file.create_group("cyclic").attrs["n_sectors"] = 1
    groups = {"model": {"source": "hdf5", "file": "model.h5", "rotation_speed": 1.0},
              "cyclic": {"engine_order": 0}, "contact": PAIR, "output": {"observe": [1]}}
    stuck = k + np.diag([1.0] + [0.0] * (n - 1))
    for number in (1, 2, 4):
        found = follow(tmp_path, groups, 1e-5, 2e-5, 1, number=number)
        omega = found["attributes of mode"]["stuck_omega"]
        for place, below in ((1.0 - 1e-6, number - 1), (1.0 + 1e-6, number)):
            theta = scipy.linalg.eigvals(stuck + 1j * place * omega * (c + g), m)
            assert np.count_nonzero(theta.real < (place * omega)**2) == below
