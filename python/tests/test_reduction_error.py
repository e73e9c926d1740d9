"""The estimated error of a reduced joint against the one that the full matrices show."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io as sio
import scipy.sparse as sp
from small_sector import small_sector
from test_reduction import two_bodies

from fretwear.errors import InputError
from fretwear.reduction import ReducedSystem, reduce
from fretwear.reduction_error import error_of_modes, true_error

pytest.importorskip("skfem")

#: What an estimate is good for: the number of modes, which goes with the fourth root of the error.
FACTOR = 3.0
N_MODES = 20
ACCURACY = 1e-3


@pytest.fixture(scope="module", name="system")
def reduce_sector() -> ReducedSystem:
    return reduce(**small_sector(), n_modes=N_MODES + 1, factor="superlu")


def estimate(system: ReducedSystem, n_modes: int, frequency: float) -> float:
    reduction = system.reduction
    return float(error_of_modes(reduction.bonded, small_sector()["mass"],
                                reduction.omega[:n_modes + 1],
                                reduction.shapes[:, :n_modes + 1], frequency)[-1])


@pytest.mark.parametrize("times", [3.0, 7.0, 17.0])
def test_estimate_is_near_the_error(times: float, system: ReducedSystem) -> None:
    parts: dict[str, Any] = small_sector()
    n = system.contact.stop
    kept = np.arange(n + N_MODES)   # without the attachment vector, which is no mode
    frequency = times * system.reduction.omega[0]
    exact = true_error(system.mass[np.ix_(kept, kept)], system.stiffness[np.ix_(kept, kept)],
                       parts["mass"], parts["stiffness"], parts["contact"], frequency)
    assert exact / FACTOR < estimate(system, N_MODES, frequency) < exact * FACTOR


def test_an_accuracy_takes_as_few_modes_as_it_needs(system: ReducedSystem) -> None:
    parts = small_sector()
    up_to = 7.0 * system.reduction.omega[0]
    found = reduce(**parts, accuracy=ACCURACY, up_to=up_to)
    n_modes = len(found.reduction.omega)
    assert found.frequency == up_to and found.error is not None and found.error <= ACCURACY
    assert estimate(system, n_modes, up_to) == pytest.approx(found.error, rel=1e-3)
    assert (estimate(system, n_modes - 1, up_to) > ACCURACY
            or system.reduction.omega[n_modes - 1] < 1.4 * up_to)
    exact = true_error(found.mass, found.stiffness, parts["mass"], parts["stiffness"],
                       parts["contact"], up_to)
    assert exact < FACTOR * ACCURACY
    assert reduce(**parts, n_modes=5).error is None


def test_accuracies_that_mean_nothing_are_refused() -> None:
    k, m, rows = two_bodies()
    with pytest.raises(InputError, match=r"give --up-to HZ"):
        reduce(m, k, rows, accuracy=1e-3)
    for accuracy, up_to in ((2.0, 1.0), (0.0, 1.0), (1e-3, -1.0)):
        with pytest.raises(InputError, match="is not accepted"):
            reduce(m, k, rows, accuracy=accuracy, up_to=up_to)
    with pytest.raises(InputError, match=r"modes leave an error of .* ask for less"):
        reduce(m, k, rows, accuracy=1e-3, up_to=1e4)


def run_import(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "fretwear", "import", "--stiffness", "k.mtx", "--mass", "m.mtx",
         "--pairs", "pairs.csv", "--contact-rows", "rows.mtx", "-o", "model.h5", *options],
        cwd=folder, capture_output=True, text=True, check=False)


def test_the_command_keeps_what_it_reached(tmp_path: Path) -> None:
    k, m, rows = two_bodies()
    for name, matrix in (("k", k), ("m", m), ("rows", rows)):
        sio.mmwrite(tmp_path / f"{name}.mtx", sp.coo_matrix(matrix))
    (tmp_path / "pairs.csv").write_text("mu\n0.3\n")
    first = reduce(m, k, rows, n_modes=1).reduction.omega[0] / (2.0 * np.pi)
    done = run_import(tmp_path, "--accuracy", "1e-3", "--up-to", f"{2.0 * first:.6g}", "--verify",
                      "--factor", "superlu")
    assert done.returncode == 0, done.stderr
    assert "estimated error of the stiffness of the joint up to" in done.stderr
    assert "by the full matrices" in done.stderr and "factors by superlu" in done.stderr
    with h5py.File(tmp_path / "model.h5") as file:
        assert file["reduction/frequency"][0] == pytest.approx(2.0 * first, rel=1e-5)
        assert 0.0 < file["reduction/error"][0] <= 1e-3
        assert len(file["mass"]) < len(k)
    for options, words in ((("--accuracy", "1e-3"), "--accuracy needs --up-to HZ"),
                           (("--reduce", "5", "--accuracy", "1e-3"), "does not go with --reduce"),
                           (("--reduce", "5", "--up-to", "10"), "--up-to goes with"),
                           (("--reduce", "5", "--verify"), "--verify needs --up-to HZ")):
        done = run_import(tmp_path, *options)
        assert done.returncode == 3 and words in done.stderr, done.stderr


def random_bodies(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stiffness, mass and rows of two nets of springs, held at one end each, with a few pairs."""
    sizes = rng.integers(30, 80, 2)
    n, n_pairs = int(sizes.sum()), int(rng.integers(1, 6))
    stiffness = np.zeros((n, n))
    for first, size in ((0, sizes[0]), (sizes[0], sizes[1])):
        ends = [(k, k + 1) for k in range(size - 1)]
        ends += [tuple(rng.choice(size, 2, replace=False)) for _ in range(size // 3)]
        for i, j in ends:
            both = [first + i, first + j]
            stiffness[np.ix_(both, both)] += rng.uniform(0.1, 2.0) * np.array([[1, -1], [-1, 1]])
    stiffness[0, 0] += 1.0
    stiffness[-1, -1] += 1.0
    rows = np.zeros((n_pairs, n))
    pairs = np.arange(n_pairs)
    rows[pairs, rng.permutation(sizes[0])[:n_pairs]] = 1.0
    rows[pairs, sizes[0] + rng.permutation(sizes[1])[:n_pairs]] = -1.0
    return stiffness, np.diag(rng.uniform(0.5, 2.0, n)), rows


def test_estimates_of_random_models_are_near_their_errors() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        stiffness, mass, rows = random_bodies(rng)
        n_modes, n_rows = int(rng.integers(5, 20)), len(rows)
        system = reduce(mass, stiffness, rows, n_modes=n_modes + 1, factor="superlu")
        found = system.reduction
        frequency = found.omega[n_modes] / rng.uniform(1.4, 5.0)
        ours = error_of_modes(found.bonded, sp.csr_array(mass), found.omega, found.shapes,
                              frequency)[-1]
        kept = np.ix_(*[np.arange(n_rows + n_modes)] * 2)
        exact = true_error(system.mass[kept], system.stiffness[kept], sp.csr_array(mass),
                           sp.csr_array(stiffness), sp.csr_array(rows), frequency)
        assert exact / FACTOR < ours < exact * FACTOR
