"""Every engine that factors gives the same reduced model and refuses the same models.

SuperLU is always there, in all its ways; tests of another engine are skipped where it is missing.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from small_sector import small_sector
from test_reduction import N_MODES, two_bodies

from fretwear import factors, reduction
from fretwear.errors import InputError
from fretwear.factors import chosen_engine, factor, node_order
from fretwear.reduction import ReducedSystem, reduce

skfem = pytest.importorskip("skfem")

#: Of the largest entry: K_rr by way of S, whose digits kappa keeps; M_rr loses some by S^-1 on both
#: sides.
STIFFNESS, MASS = 1e-12, 1e-9
#: Of a response well away from any pole of the model.
RESPONSE = 1e-7
OTHERS = [pytest.param(name, marks=pytest.mark.skipif(
    find_spec(module) is None, reason=f"{module} is not installed: {name} is not tested"))
    for name, module in (("mumps", "mumps"), ("cholmod", "sksparse"), ("pardiso", "pypardiso"))]
ALL = ["superlu", *OTHERS]


@pytest.fixture(scope="module", name="sector")
def make_sector() -> dict[str, object]:
    return small_sector()


@pytest.fixture(scope="module", name="known")
def reduce_by_superlu(sector: dict[str, object]) -> ReducedSystem:
    return reduce(**sector, damping=1e-6 * sector["stiffness"], factor="superlu")


def same(found: ReducedSystem, known: ReducedSystem) -> None:
    """Matrices, frequencies and a response."""
    contact = known.contact
    for name, accuracy in (("stiffness", STIFFNESS), ("mass", MASS), ("damping", MASS)):
        ours, theirs = (getattr(system, name)[contact, contact] for system in (found, known))
        assert np.abs(ours - theirs).max() <= accuracy * np.abs(theirs).max()
    assert found.reduction.omega == pytest.approx(known.reduction.omega, rel=MASS)
    omega = 0.7 * known.reduction.omega[0]
    answers = [np.linalg.solve(system.stiffness * (1.0 + 1e-3j) - omega**2 * system.mass
                               + 1e7 * np.eye(len(system.mass)) * (np.arange(len(system.mass))
                                                                   < contact.stop),
                               system.loads)[contact]
               for system in (found, known)]
    assert np.abs(answers[0] - answers[1]).max() <= RESPONSE * np.abs(answers[1]).max()


def test_matrices_are_those_of_the_shapes(sector: dict[str, object], known: ReducedSystem) -> None:
    """By definition, with SciPy alone: shapes as long as the model, and products with them."""
    stiffness, mass, rows = (sector[name] for name in ("stiffness", "mass", "contact"))
    kappa = known.reduction.bonded.kappa
    solve = spl.splu(sp.csc_matrix(stiffness + kappa * rows.T @ rows)).solve
    flexible = solve(rows.toarray().T)
    compliance = rows @ flexible
    shapes = np.linalg.solve(compliance, flexible.T).T
    contact = known.contact
    for ours, theirs, accuracy in (
            (known.stiffness, np.linalg.inv(compliance) - kappa * np.eye(len(compliance)),
             STIFFNESS),
            (known.mass, shapes.T @ (mass @ shapes), MASS),
            (known.damping, 1e-6 * shapes.T @ (stiffness @ shapes), MASS)):
        assert np.abs(ours[contact, contact] - theirs).max() <= accuracy * np.abs(theirs).max()
    force = shapes.T @ sector["loads"]
    assert known.loads[contact, 0] == pytest.approx(force, abs=MASS * np.abs(force).max())


def test_solutions_that_are_not_kept_are_found_again(
        sector: dict[str, object], known: ReducedSystem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reduction, "_KEPT", 0.0)
    found = reduce(**sector, damping=1e-6 * sector["stiffness"], factor="superlu")
    same(found, known)
    few = sp.csr_array(sp.csr_array(sp.identity(len(sector["loads"])))[[7, 8, 9]])
    coordinates = np.linspace(-1.0, 1.0, len(known.mass))
    shown = few @ (known.reduction.basis @ coordinates)
    size = MASS * np.abs(known.reduction.basis @ np.diag(coordinates)).max()
    assert few @ found.reduction.expand(coordinates) == pytest.approx(shown, abs=size)
    assert found.reduction.row(few) @ coordinates == pytest.approx(shown, abs=size)


def test_minimum_degree_gives_the_same(sector: dict[str, object], known: ReducedSystem,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(factors, "node_order", lambda _: None)
    same(reduce(**sector, damping=1e-6 * sector["stiffness"], factor="superlu"), known)


@pytest.mark.parametrize("engine", OTHERS)
def test_engines_agree(engine: str, sector: dict[str, object], known: ReducedSystem) -> None:
    found = reduce(**sector, damping=1e-6 * sector["stiffness"], factor=engine)
    assert found.reduction.bonded.engine == engine
    same(found, known)


@pytest.mark.parametrize("engine", ALL)
def test_engines_refuse_alike(engine: str) -> None:
    k, m, rows = two_bodies()
    free = k.copy()
    free[0, 0] -= 1e4
    with pytest.raises(InputError, match="neither the contact nor the supports hold"):
        reduce(m, free, rows, n_modes=N_MODES, factor=engine)
    negative = k.copy()
    negative[7, 7] = -5e4
    with pytest.raises(InputError, match=r"not positive semidefinite.*degree of freedom"):
        reduce(m, negative, rows, n_modes=N_MODES, factor=engine)
    with pytest.raises(InputError, match="1 of 4 contact rows depend on the others"):
        reduce(m, k, np.vstack((rows, -rows[1])), n_modes=N_MODES, factor=engine)


@pytest.mark.parametrize("engine", OTHERS)
def test_large_refusals_go_without_the_place(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where SuperLU would take too long to say which degree of freedom it is."""
    monkeypatch.setattr(factors, "_EXPLAINED", 0)
    k, _, rows = two_bodies()
    held = k + 3e3 * rows.T @ rows
    for change, words in ((-1e4, "neither the contact nor the supports hold"),
                          (-9e4, "not positive semidefinite")):
        matrix = held.copy()
        matrix[0, 0] += change
        with pytest.raises(InputError, match=words):
            factor(sp.csc_matrix(matrix), engine)


@pytest.mark.parametrize("engine", ALL)
def test_contact_beyond_the_memory_is_refused_by_each(engine: str,
                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the work; MUMPS knows the size of its factors beforehand too."""
    k, m, rows = two_bodies()
    with monkeypatch.context() as patch:
        patch.setattr(reduction, "memory", lambda: 1e3)
        with pytest.raises(InputError, match=r"3 contact coordinates of .* need .* GB, and this"):
            reduce(m, k, rows, n_modes=N_MODES, factor=engine)
    if engine != "mumps":
        return
    monkeypatch.setattr(factors, "memory", lambda: 1e3)
    with pytest.raises(InputError, match=r"need .* GB for their factors, and this"):
        reduce(m, k, rows, n_modes=N_MODES, factor=engine)
    with pytest.raises(InputError, match=r"degrees of freedom need .* GB for their factors"):
        factor(sp.csc_matrix(k + 3e3 * rows.T @ rows), engine)


#: Room for the matrix and little more, in MB: its factors take two to three times as much.
ROOM = 60
OUT_OF_MEMORY = """
import resource, sys
from test_factors import brick
from fretwear.errors import InputError
from fretwear.factors import factor

engine, room = sys.argv[1], int(sys.argv[2])
few = brick(4)
factor(few, engine).solve(few[:, [0]].toarray())   # loads what is loaded at the first use
many = brick(20)
size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (size + room * 1000000,) * 2)
try:
    factor(many, engine)
except InputError as error:
    print("refused:", error)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="limits of memory by Linux")
@pytest.mark.parametrize("engine", ALL)
def test_factors_that_find_no_room_end_in_words(engine: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", OUT_OF_MEMORY, engine, str(ROOM)], capture_output=True, text=True,
        check=False, env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
                                       "PYTHONPATH": os.pathsep.join(sys.path)})
    assert done.returncode == 0, done.stderr
    assert "refused:" in done.stdout
    assert "do not fit into the memory" in done.stdout or "found no room" in done.stdout


@pytest.mark.parametrize("engine", ALL)
def test_hermitian_matrices(engine: str) -> None:
    """A sector tied in a nodal diameter."""
    k, m, rows = two_bodies()
    phase = np.exp(0.3j * np.arange(len(k)))
    turned = sp.csr_array(np.outer(phase.conj(), phase) * k)
    found = reduce(sp.csr_array(np.diag(np.diag(m))), turned, sp.csr_array(rows * phase),
                   n_modes=N_MODES, factor=engine)
    known = reduce(np.diag(np.diag(m)), k, rows, n_modes=N_MODES, factor="superlu")
    for name in ("stiffness", "mass"):
        ours, theirs = (getattr(system, name)[:3, :3] for system in (found, known))
        assert ours == pytest.approx(theirs, abs=MASS * np.abs(theirs).max())
    assert found.reduction.omega == pytest.approx(known.reduction.omega, rel=MASS)


@pytest.mark.skipif(find_spec("mumps") is None, reason="mumps is not installed: not tested")
def test_step_in_the_complex_plane_changes_nothing(sector: dict[str, object]) -> None:
    from fretwear.schur import STEP, contact_compliances

    contact = sector["contact"]
    held = sp.csc_matrix(sector["stiffness"] + 1e7 * (contact.T @ contact))
    answers = factor(held, "superlu").solve(contact.toarray().T)
    known = contact @ answers, answers.T @ (sector["mass"] @ answers)
    for size in (1.0, 100.0, 0.01):
        found = contact_compliances(held, contact, sector["mass"], size * STEP)
        for ours, theirs, accuracy in zip(found, known, (STIFFNESS, MASS)):
            assert np.abs(ours - theirs).max() <= accuracy * np.abs(theirs).max()


def brick(n: int) -> sp.csc_matrix:
    """A matrix of n^3 nodes with three components each, coupled as those of brick elements."""
    line = sp.diags_array([-np.ones(n - 1), 2.1 * np.ones(n), -np.ones(n - 1)],
                          offsets=[-1, 0, 1])
    space = sp.kron(sp.kron(line, line), line)
    return sp.csc_matrix(sp.kron(space, np.array([[2.0, 0.5, 0.1], [0.5, 2.0, 0.3],
                                                  [0.1, 0.3, 2.0]])))


def test_nested_dissection_fills_less() -> None:
    pytest.importorskip("pymetis")
    matrix = brick(14)
    order = node_order(matrix)
    assert order is not None and np.array_equal(np.sort(order), np.arange(matrix.shape[0]))
    # The components of a node stay together.
    assert (np.diff(order.reshape(-1, 3), axis=1) == 1).all()
    options = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    ours = spl.splu(sp.csc_matrix(matrix[order][:, order]), permc_spec="NATURAL", **options)
    theirs = spl.splu(matrix, permc_spec="MMD_AT_PLUS_A", **options)
    assert ours.nnz < theirs.nnz
    load = np.cos(np.arange(3.0 * matrix.shape[0])).reshape(-1, 3)
    found = factor(matrix, "superlu").solve(load)
    assert found == pytest.approx(theirs.solve(load), rel=1e-10, abs=1e-10)


def test_engines_that_are_not_there_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"factor = 'mump' is not accepted; expected one of auto"):
        chosen_engine("mump")
    monkeypatch.setattr(factors, "find_spec", lambda name: None if name != "scipy" else True)
    with pytest.raises(InputError, match=r"needs the package mumps.*pip install python-mumps"):
        chosen_engine("mumps")
    assert chosen_engine("auto") == "superlu"
    matrix = sp.csc_matrix(la.toeplitz([2.0, -1.0, 0.0, 0.0]))
    assert node_order(matrix) is None
