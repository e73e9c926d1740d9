"""A joint of so many coordinates that steps of Newton's method take products and preconditioners
of low rank: the same answers as with matrices formed at each frequency."""
from __future__ import annotations

import subprocess

import h5py
import numpy as np
import pytest
from cases import write_namelist
from limits import limit
from oracle_runs import run_case
from project import PROGRAM
from scipy.linalg import block_diag

# From 7e4 entries of all complex matrices on (260 coordinates, 8 harmonics) none is formed; with
# many internal modes all of them are. The answer has odd harmonics alone.
N_PAIRS, H = 130, 7
# Both solutions stop at 1e-11 of the load; near the resonance that is a hundred times more of the
# displacements.
SAME = 1e-8


def write_model(path, n_idle=0):
    """Two rows of light nodes with springs along them, hung on four heavy masses.

    Idle masses beside them touch nothing: with more than half as many of them as coordinates the
    program forms matrices.
    """
    n = 2 * N_PAIRS + 4
    stiffness = np.zeros((n, n))

    def spring(i, j, k):
        stiffness[i, i] += k
        if j >= 0:
            stiffness[j, j] += k
            stiffness[[i, j], [j, i]] -= k

    for direction in range(2):
        rows = np.arange(N_PAIRS) * 2 + direction
        for left, right in zip(rows[:-1], rows[1:], strict=True):
            spring(left, right, 5e3)
        for place, row in enumerate(rows):
            spring(row, n - 4 + direction + 2 * (place >= N_PAIRS // 3), 2e3)
    for heavy in range(n - 4, n):
        spring(heavy, -1, 1e3 * (1 + heavy - n + 4))
    spring(n - 4, n - 3, 2e4)
    mass = np.diag(np.r_[np.full(n - 4, 1e-7), 1.0, 1.2, 1.5, 0.9])
    rng = np.random.default_rng(5)
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        # Of the masses alone: damping in every node would be no matrix of low rank.
        damping = np.diag(np.r_[np.zeros(n - 4), 2.0, 1.0, 3.0, 2.0])
        for name, matrix, idle in (("mass", mass, 1.0), ("stiffness", stiffness, 1e9),
                                   ("damping", damping, 10.0)):
            file[name] = block_diag(matrix, idle * np.eye(n_idle))
        file["contact/side_1"] = np.c_[2 * np.arange(N_PAIRS) + 1, 2 * np.arange(N_PAIRS) + 2,
                                       np.zeros(N_PAIRS, int)]
        file["contact/side_2"] = np.zeros((N_PAIRS, 3), int)
        file["contact/mu"] = np.full(N_PAIRS, 0.4)
        file["contact/normal_load"] = rng.uniform(0.2, 2.0, N_PAIRS)
        load = np.zeros(n)
        load[-4:] = [20.0, 6.0, 12.0, 9.0]
        idle = np.zeros(n_idle)
        file["load/cosine"] = np.r_[load, idle]
        file["load/sine"] = np.r_[load[::-1] * np.r_[np.zeros(n - 4), 0.0, 0.0, 0.4, 0.5][::-1],
                                  idle]
        file["observe/name"] = np.array(["a", "b"], dtype=h5py.string_dtype())
        file["observe/dof"] = [n - 3, n - 1]
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model") / "joint.h5")


@pytest.fixture(scope="module")
def formed_model(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model") / "joint.h5", N_PAIRS + 10)


def groups(model, parity, threads=1, **solver):
    return {
        "case": {"analysis": "frf", "threads": threads},
        "model": {"source": "hdf5", "file": str(model)},
        "contact": {"law": "dlft"},
        "harmonics": {"n_harmonics": H, "n_time": 64, "parity": parity},
        "sweep": {"start": 190.0, "end": 215.0, "n_points": 4},
        "solver": {"tolerance": 1e-11, "linear": "krylov", **solver},
    }


@pytest.fixture(scope="module")
def formed(formed_model, tmp_path_factory):
    return run_case(tmp_path_factory.mktemp("formed"), groups(formed_model, "odd"))


@pytest.mark.parametrize("threads", [1, 2])
def test_low_rank_gives_the_same_answer(tmp_path, model, formed, threads):
    found = run_case(tmp_path, groups(model, "all", threads))
    slips = formed.fraction[..., 1]
    assert (slips.max(axis=1) > 0.1).all() and (slips.min(axis=1) == 0.0).all()
    for name in ("coefficients", "force"):
        expected, here = getattr(formed, name), getattr(found, name)
        assert np.abs(here - expected).max() < SAME * np.abs(expected).max()
    with h5py.File(tmp_path / "case.h5") as file:
        assert file["iterations"][()].max() < 25


def test_low_rank_is_what_runs(tmp_path, model, formed_model):
    for file, parity, expected in ((model, "all", True), (formed_model, "odd", False)):
        write_namelist(tmp_path / "case.nml", groups(file, parity))
        done = subprocess.run([PROGRAM, "--set", "sweep%n_points=2", "case.nml"], cwd=tmp_path,
                              capture_output=True, text=True, timeout=limit(60), check=True)
        assert ("patterns of motion" in done.stdout) == expected
