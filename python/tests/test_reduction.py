"""Reduction on relative displacements, against dense algebra on a small truss of two bodies."""

from __future__ import annotations

import io

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from fretwear._progress import stages
from fretwear.errors import InputError
from fretwear.reduction import Bonded, ReducedSystem, reduce

# Dense algebra with the full stiffness: round-off times its condition number of some 1e4.
ROUND_OFF = 1e-9
# The largest change of the reduced model when the stiffness between the sides changes tenfold.
KAPPA = 1e-8
N_BODY, N_MODES = 30, 6


def chain(n: int, stiffness: float, mass: float) -> tuple[np.ndarray, np.ndarray]:
    """Free chain of n masses, with springs to the second neighbour too."""
    k = np.zeros((n, n))
    for step, share in ((1, 1.0), (2, 0.3)):
        for i in range(n - step):
            k[np.ix_([i, i + step], [i, i + step])] += share * stiffness * np.array(
                [[1.0, -1.0], [-1.0, 1.0]])
    return k, mass * np.diag(1.0 + 0.1 * np.sin(np.arange(n)))


def two_bodies() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A chain held at its end, a free one, and three contact rows between them (K, M, B)."""
    k1, m1 = chain(N_BODY, 1e4, 2.0)
    k1[0, 0] += 1e4
    k2, m2 = chain(N_BODY, 7e3, 1.0)
    rows = np.zeros((3, 2 * N_BODY))
    rows[0, [N_BODY, N_BODY - 1]] = 1.0, -1.0
    rows[1, [N_BODY + 1, N_BODY - 2]] = 1.0, -1.0
    rows[2, [N_BODY + 4, N_BODY + 5, N_BODY - 5]] = 0.5, 0.5, -1.0  # a patch average
    return la.block_diag(k1, k2), la.block_diag(m1, m2), rows


@pytest.fixture(name="loads")
def loads_fixture() -> np.ndarray:
    forces = np.zeros((2 * N_BODY, 2))
    forces[-1, 0] = 1.0
    forces[N_BODY + 10, 1], forces[3, 1] = 2.0, -0.5
    return forces


def reduced(loads: np.ndarray, **options: object) -> ReducedSystem:
    k, m, rows = two_bodies()
    return reduce(sp.csr_array(m), sp.csr_array(k), sp.csr_array(rows), loads=loads,
                  n_modes=N_MODES, **options)  # type: ignore[arg-type]


def test_bonded_modes_and_static_answers_are_exact(loads: np.ndarray) -> None:
    k, m, rows = two_bodies()
    system = reduced(loads)
    null = la.null_space(rows)
    stuck = la.eigh(null.T @ k @ null, null.T @ m @ null, eigvals_only=True)[:N_MODES]
    assert system.reduction.omega == pytest.approx(np.sqrt(stuck), rel=ROUND_OFF)
    n_r = len(rows)
    assert system.mass.shape == (n_r + N_MODES + 2,) * 2
    assert rows @ system.reduction.basis == pytest.approx(
        np.eye(n_r, len(system.mass)), abs=ROUND_OFF)
    eta = slice(n_r, None)
    assert system.mass[eta, eta] == pytest.approx(np.eye(N_MODES + 2), abs=ROUND_OFF)
    # Compliance of both loads on the bonded structure, and the multipliers that hold it.
    saddle = np.block([[k, 1e4 * rows.T], [1e4 * rows, np.zeros((n_r, n_r))]])
    answer = np.linalg.solve(saddle, np.vstack((loads, np.zeros((n_r, 2)))))
    exact = loads.T @ answer[:len(k)]
    found = system.loads[eta].T @ np.linalg.solve(system.stiffness[eta, eta], system.loads[eta])
    assert found == pytest.approx(exact, rel=ROUND_OFF, abs=ROUND_OFF * np.abs(exact).max())
    assert system.loads[:n_r] == pytest.approx(1e4 * answer[len(k):], abs=ROUND_OFF * 10)


def test_projections_agree_with_products(loads: np.ndarray) -> None:
    k, m, _ = two_bodies()
    damping = 1e-3 * k + 0.2 * m
    system = reduced(loads, damping=sp.csr_array(damping))
    basis = system.reduction.basis
    for found, full in ((system.stiffness, k), (system.mass, m), (system.damping, damping)):
        expected = basis.T @ full @ basis
        assert found == pytest.approx(expected, abs=ROUND_OFF * np.abs(expected).max())
    assert system.loads == pytest.approx(basis.T @ loads, rel=ROUND_OFF, abs=ROUND_OFF)


def test_dense_and_sparse_matrices_and_any_kappa_give_the_same(loads: np.ndarray) -> None:
    k, m, rows = two_bodies()
    reference = reduced(loads)
    dense = reduce(m, k, rows, loads=loads, n_modes=N_MODES)
    assert dense.stiffness == pytest.approx(reference.stiffness, rel=1e-12, abs=1e-9)
    for kappa in (3e2, 3e3, 3e4):
        other = reduced(loads, kappa=kappa)
        for name in ("mass", "stiffness"):
            scale = np.abs(getattr(reference, name)).max()
            assert getattr(other, name) == pytest.approx(getattr(reference, name),
                                                         abs=KAPPA * scale)


def test_a_factored_structure_serves_twice(loads: np.ndarray) -> None:
    k, _, rows = two_bodies()
    bonded = Bonded(sp.csr_array(k), sp.csr_array(rows), 3e3)
    first = reduced(loads, bonded=bonded)
    kept = first.reduction.basis.copy()
    fewer = reduced(loads[:, :1], bonded=bonded)
    assert np.array_equal(first.reduction.basis, kept)
    assert fewer.reduction.basis[:, :-1] == pytest.approx(kept[:, :fewer.mass.shape[0] - 1],
                                                         abs=ROUND_OFF)


def test_soft_joint_of_stiff_parts_keeps_its_digits() -> None:
    """The stiffness that the rows meet locally is 1e6 times that of the joint."""
    k, m, rows = two_bodies()
    k = 1e6 * k
    k[0, 0] -= 1e10 - 1e2  # held softly
    # Its order of elimination ends at the soft support, where the digits are; others keep those
    # that the ratio of both leaves.
    system = reduce(m, k, rows[:1], n_modes=N_MODES, factor="superlu")
    # One row: the free chain behind it carries nothing statically.
    assert abs(system.stiffness[0, 0]) < 1e-6 * 1e10
    motion = system.stiffness[1:, 1:]
    null = la.null_space(rows[:1])
    stuck = la.eigh(null.T @ m @ null, null.T @ k @ null, eigvals_only=True)[::-1][0]
    assert motion[0, 0] == pytest.approx(1.0 / stuck, rel=1e-7)


def test_loads_that_are_answered_already_add_no_vector(loads: np.ndarray) -> None:
    twice = np.column_stack((loads, 3.0 * loads[:, 0], np.zeros(len(loads))))
    system = reduced(twice)
    assert len(system.mass) == len(reduced(loads).mass)
    assert system.loads.shape == (len(system.mass), 4)


def test_massless_degrees_of_freedom(loads: np.ndarray) -> None:
    k, m, rows = two_bodies()
    m[N_BODY - 1, N_BODY - 1] = m[N_BODY, N_BODY] = 0.0
    system = reduce(m, k, rows, loads=loads, n_modes=N_MODES)
    null = la.null_space(rows)
    inverse = la.eigh(null.T @ m @ null, null.T @ k @ null, eigvals_only=True)[::-1][:N_MODES]
    assert system.reduction.omega == pytest.approx(1.0 / np.sqrt(inverse), rel=ROUND_OFF)


def test_a_structure_that_nothing_holds_is_refused(loads: np.ndarray) -> None:
    k, m, rows = two_bodies()
    k[0, 0] -= 1e4
    with pytest.raises(InputError, match="neither the contact nor the supports hold"):
        reduce(m, k, rows, loads=loads)


def test_a_negative_stiffness_is_refused(loads: np.ndarray) -> None:
    k, m, rows = two_bodies()
    k[7, 7] = -5e4
    with pytest.raises(InputError, match=r"not positive semidefinite.*degree of freedom"):
        reduce(m, k, rows)


def test_dependent_rows_are_refused() -> None:
    k, m, rows = two_bodies()
    with pytest.raises(InputError, match="1 of 4 contact rows depend on the others"):
        reduce(m, k, np.vstack((rows, -rows[1])))
    with pytest.raises(InputError, match="contact row 4 is zero"):
        reduce(m, k, np.vstack((rows, 0.0 * rows[1])))


@pytest.mark.parametrize(("change", "message"), [
    ({"n_modes": 0}, "n_modes = 0 is not accepted; expected 1 to 56"),
    ({"n_modes": 57}, "n_modes = 57 is not accepted; expected 1 to 56"),
    ({"loads": np.ones(3)}, r"loads has the shape \(3,\)"),
    ({"damping": np.eye(3)}, "damping is 3 x 3; expected 60 x 60"),
    ({"mass": np.eye(3)}, "mass is 3 x 3; expected 60 x 60"),
    ({"contact": np.eye(3)}, "contact is 3 x 3"),
])
def test_wrong_arguments(change: dict[str, object], message: str) -> None:
    k, m, rows = two_bodies()
    with pytest.raises(InputError, match=message):
        reduce(**{"mass": m, "stiffness": k, "contact": rows, **change})  # type: ignore[arg-type]


def test_progress_of_the_stages_ends_where_it_should(loads: np.ndarray) -> None:
    told: list[tuple[str, int, int]] = []
    reduced(loads, progress=lambda *stage: told.append(stage))
    assert told[0][0] == "factors"
    assert told[-1] == ("contact shapes", 1, 1)


class Terminal(io.StringIO):
    """Text that says that somebody looks at it."""

    def isatty(self) -> bool:
        return True


def test_bars_of_stages_in_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    show = stages(quiet=False)
    assert show is not None and terminal.getvalue() == ""  # nothing before there is a stage
    for stage in (("factors", 0, 1), ("shapes", 1, 2), ("shapes", 2, 2), ("factors", 0, 1)):
        show(*stage)
    assert terminal.getvalue().count("factors") == 2
    assert "shapes" in terminal.getvalue()
    assert stages(quiet=True) is None


def test_shapes_beyond_the_memory_are_refused_before_the_work(
        loads: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fretwear.reduction.memory", lambda: 1e3)
    with pytest.raises(InputError, match=r"3 contact coordinates of 60 degrees .* patches"):
        reduced(loads)
