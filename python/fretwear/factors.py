"""Factors of sparse symmetric positive definite matrices, by the engine that is there.

SuperLU of SciPy is always there; with pymetis it orders the nodes by nested dissection, which
fills a third of what minimum degree does in a compact body. MUMPS (python-mumps), CHOLMOD
(scikit-sparse) and PARDISO (pypardiso) are used where they are installed and wanted.

Every engine refuses the same matrices with the same words: those with a negative pivot, and those
with a motion that nothing holds.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ._mumps import mumps_instance, run_mumps
from .errors import InputError

__all__ = ["ENGINES", "Factor", "check_room", "chosen_engine", "factor", "memory",
           "node_order", "real_form"]

Floats = NDArray[Any]

#: Engines by name: the module that has to be there, and how it is installed.
_MODULES = {
    "mumps": ("mumps", "apt install libmumps-seq-dev pkg-config; pip install python-mumps"),
    "cholmod": ("sksparse", "apt install libsuitesparse-dev; pip install scikit-sparse==0.4.16"),
    "superlu": ("scipy", "pip install scipy"),
    "pardiso": ("pypardiso", "pip install pypardiso"),
}
#: What `auto` takes, the first that is there; PARDISO only by its name.
_AUTO = ("mumps", "cholmod", "superlu")
#: Words of the key that chooses the engine.
ENGINES = ("auto", *_MODULES)
# A pivot that elimination leaves at this share of its diagonal entry is round-off.
_SINGULAR = 1e-12
# Where another engine only says that something is wrong, SuperLU says where, up to this size.
_EXPLAINED = 60_000
# Below so many degrees of freedom minimum degree fills as little as nested dissection.
_DISSECTED = 2000
# Steps of inverse iteration towards the softest motion: each gains all digits between it and the
# next one, and a motion that nothing holds is 1e4 times softer than any other.
_STEPS = 3
_FREE = ("motions remain that neither the contact nor the supports hold (rigid-body modes of the "
         "bonded structure); add supports or pairs")
_NO_ROOM = ("the factors of {} degrees of freedom by {} do not fit into the memory that is left; "
            "take another --factor (cholmod needs the least), or a coarser mesh away from the "
            "contact")
_NEGATIVE = "the stiffness is not positive semidefinite: {}; check signs and units, and leave " \
            "spin softening to stiffness_rotation"


class Factor(Protocol):
    """A factored matrix.

    Attributes
    ----------
    name : str
        The engine.
    """

    name: str

    def solve(self, load: Floats) -> Floats:
        """Solution of loads (n,) or (n, k)."""


def chosen_engine(engine: str = "auto") -> str:
    """The engine that a word of the key means on this machine.

    Raises
    ------
    InputError
        No such word, or the engine is not installed; the message says how to install it.
    """
    if engine not in ENGINES:
        raise InputError(f"factor = '{engine}' is not accepted; expected one of "
                         + ", ".join(ENGINES))
    if engine == "auto":
        return next(name for name in _AUTO if find_spec(_MODULES[name][0]))
    module, line = _MODULES[engine]
    if find_spec(module) is None:
        raise InputError(f"factor = '{engine}' needs the package {module}, which is not "
                         f"installed: {line}; or take --factor superlu, which is always there")
    return engine


def factor(matrix: sp.csc_matrix, engine: str = "auto") -> Factor:
    """Factors of a positive definite matrix, real symmetric or complex Hermitian.

    Parameters
    ----------
    matrix : (n, n) sparse
        All of it, not a triangle alone.
    engine : str
        One of `ENGINES`.

    Raises
    ------
    InputError
        The matrix has a negative pivot, or a motion that nothing holds; its factors do not fit into
        the memory; or the engine is not there.
    """
    name = chosen_engine(engine)
    makers: dict[str, Callable[[Any], Factor]] = {
        "mumps": _Mumps, "cholmod": _Cholmod, "superlu": _SuperLU, "pardiso": _Pardiso}
    maker = makers[name]
    whole = sp.csc_matrix(matrix)
    try:
        if whole.dtype.kind == "c" and name in ("mumps", "pardiso"):
            return _Doubled(maker(real_form(whole)))
        return maker(whole)
    except _Refused as refused:
        if whole.shape[0] <= _EXPLAINED:
            _SuperLU(whole)   # names the degree of freedom
        raise InputError(str(refused)) from None
    except MemoryError:
        raise InputError(_NO_ROOM.format(whole.shape[0], name)) from None


class _Refused(Exception):
    """Why a matrix has no factors, without a place."""


def real_form(matrix: sp.csc_matrix) -> sp.csc_matrix:
    """A complex Hermitian matrix as a real symmetric one of twice its size: real parts of the
    unknowns, then imaginary ones."""
    real, imaginary = matrix.real, matrix.imag
    return sp.csc_matrix(sp.block_array([[real, -imaginary], [imaginary, real]]))


class _Doubled:
    """A complex Hermitian matrix by the factors of its real form."""

    def __init__(self, factors: Factor) -> None:
        self._factors, self.name = factors, factors.name

    def solve(self, load: Floats) -> Floats:
        found = self._factors.solve(np.concatenate((load.real, load.imag)))
        half = len(load)
        return found[:half] + 1j * found[half:]


class _SuperLU:
    """LU by SciPy. Positive definite: diagonal pivots are safe."""

    name = "superlu"
    # Columns that a thread solves at once.
    _COLUMNS = 16

    def __init__(self, matrix: sp.csc_matrix) -> None:
        order = node_order(matrix) if matrix.shape[0] >= _DISSECTED else None
        self._order = order
        ordered = matrix if order is None else sp.csc_matrix(matrix[order][:, order])
        try:
            self._factors = spl.splu(
                ordered, permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL",
                diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise InputError(f"{_FREE}: {error}") from None
        pivots = _pivots(self._factors)
        _check_pivots(pivots, ordered.diagonal(), order)
        self._dtype = matrix.dtype

    def solve(self, load: Floats) -> Floats:
        load = np.asarray(load, dtype=self._dtype)
        order = self._order
        if order is None:
            return self._spread(np.ascontiguousarray(load))
        found = np.empty_like(load)
        found[order] = self._spread(load[order])
        return found

    def _spread(self, load: Floats) -> Floats:
        """SuperLU works outside Python's lock: columns are solved side by side. The small products
        inside would start threads of their own, which wait for one another most of the time."""
        width = self._COLUMNS
        if load.ndim == 1 or load.shape[1] <= width:
            return self._factors.solve(load)
        blocks = [load[:, k:k + width] for k in range(0, load.shape[1], width)]
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(os.cpu_count()) as workers:
            return np.hstack(list(workers.map(self._factors.solve, blocks)))


class _Cholmod:
    """Supernodal Cholesky factors by scikit-sparse."""

    name = "cholmod"

    def __init__(self, matrix: sp.csc_matrix) -> None:
        from sksparse import cholmod

        matrix.sort_indices()
        try:
            self._factors = cholmod.cholesky(matrix, mode="supernodal", ordering_method="metis")
        except (cholmod.CholmodOutOfMemoryError, cholmod.CholmodTooLargeError):
            raise MemoryError from None
        except cholmod.CholmodNotPositiveDefiniteError:
            raise _Refused(_NEGATIVE.format("a pivot is negative") + f"; or {_FREE}") from None
        place = self._factors.P()
        _check_pivots(self._factors.D().real, matrix.diagonal()[place], place)
        self._dtype = matrix.dtype

    def solve(self, load: Floats) -> Floats:
        return np.asarray(self._factors(np.asarray(load, dtype=self._dtype)))


class _Mumps:
    """LDL^T by python-mumps; by its raw interface, which alone keeps the signs of the pivots."""

    name = "mumps"

    def __init__(self, matrix: sp.csc_matrix) -> None:
        self._instance, self._kept = mumps_instance(sp.tril(matrix))
        self._instance.cntl[1] = 0.0    # no pivoting: definite
        for job in (1, 2):
            status = run_mumps(self._instance, job, InputError)
            if status == "singular":
                raise _Refused(_FREE)
            if job == 1:
                check_room(self._instance, f"{matrix.shape[0]} degrees of freedom need")
        negative = int(self._instance.infog[12])
        if negative:
            raise _Refused(_NEGATIVE.format(f"{negative} negative pivots") + f"; or {_FREE}")
        _check_held(self.solve, matrix.diagonal())

    def solve(self, load: Floats) -> Floats:
        found = np.array(load, dtype=float, order="F")
        self._instance.set_dense_rhs(found)
        run_mumps(self._instance, 3, InputError)
        return found


class _Pardiso:
    """Cholesky factors by Intel's PARDISO."""

    name = "pardiso"
    # Its error for want of memory.
    _NO_MEMORY = -2

    def __init__(self, matrix: sp.csc_matrix) -> None:
        from pypardiso import PyPardisoSolver
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._upper = sp.csr_matrix(sp.triu(matrix, format="csr"))
        self._upper.sort_indices()
        self._solver = PyPardisoSolver(mtype=2)
        try:
            self._solver.factorize(self._upper)
        except PyPardisoError as error:
            if error.value == self._NO_MEMORY:
                raise MemoryError from None
            raise _Refused(_NEGATIVE.format("a pivot is negative") + f"; or {_FREE}") from None
        _check_held(self.solve, matrix.diagonal())

    def solve(self, load: Floats) -> Floats:
        load = np.asfortranarray(load, dtype=float)
        return np.asarray(self._solver.solve(self._upper, load)).reshape(load.shape)

    def __del__(self) -> None:
        solver = getattr(self, "_solver", None)
        if solver is not None:
            solver.free_memory(everything=True)


def _pivots(factors: Any) -> Floats:
    """Pivots of SuperLU in the order of the rows. Asked for U, SciPy copies both factors and keeps
    the copies, which are larger than the factors: their entries are given back."""
    upper = factors.U
    pivots = upper.diagonal()[factors.perm_c].real
    for part in (factors.L, upper):
        part.data, part.indices = part.data[:0].copy(), part.indices[:0].copy()
    return pivots


def _check_pivots(pivots: Floats, diagonal: Floats, order: NDArray[Any] | None) -> None:
    """Refuse pivots that are negative, or that round-off left; `order` names their places."""
    size = np.abs(diagonal)
    share = pivots / np.where(size > 0.0, size, 1.0)
    lost = np.flatnonzero(~(share >= _SINGULAR))
    if not len(lost):
        return
    names = lost if order is None else order[lost]
    if (share[lost] < -_SINGULAR).any():
        dof = int(names[share[lost].argmin()])
        raise InputError(_NEGATIVE.format("elimination leaves a negative pivot at degree of "
                                          f"freedom {dof + 1}"))
    raise InputError(f"{_FREE}: {len(lost)} found, first at degree of freedom {names.min() + 1}")


def _check_held(solve: Callable[[Floats], Floats], diagonal: Floats) -> None:
    """Refuse a matrix with a motion that nothing holds, where the pivots are not to be had.

    Inverse iteration of D^-1/2 K D^-1/2 finds the softest motion v; elimination that ends where it
    is largest leaves about lambda / max v^2 of the diagonal there.
    """
    root = np.sqrt(np.abs(diagonal.real))
    root = np.where(root > 0.0, root, 1.0)
    motion = 1.0 + np.cos(np.arange(len(root)) ** 1.1)
    for _ in range(_STEPS):
        motion /= np.linalg.norm(motion)
        soft = root * solve(root * motion)
        if not np.isfinite(soft).all():
            raise _Refused(_FREE)
        value, motion = float(motion @ soft), soft
    motion /= np.linalg.norm(motion)
    if value < 0.0 or 1.0 / value < _SINGULAR * float(np.max(motion**2)):
        raise _Refused(_FREE)


def node_order(matrix: sp.csc_matrix) -> NDArray[np.int64] | None:
    """Order of elimination by nested dissection; None where METIS is not there.

    Degrees of freedom whose columns have entries in the same rows are one node of the graph: that
    makes it three to nine times smaller, and keeps them together.
    """
    if find_spec("pymetis") is None:
        return None
    import pymetis

    n = matrix.shape[0]
    # A number for each row, at random: columns with the same entries have the same sum.
    weight = np.random.default_rng(1).integers(0, 2**63, size=n, dtype=np.uint64)
    filled = np.diff(matrix.indptr) > 0
    key = np.zeros(n, dtype=np.uint64)
    key[filled] = np.add.reduceat(weight[matrix.indices], matrix.indptr[:-1][filled])
    _, first, node = np.unique(key, return_index=True, return_inverse=True)
    n_nodes = len(first)
    if n_nodes < 3:
        return None
    columns = sp.csc_array(matrix)[:, first]
    graph = sp.csc_array((np.ones(len(columns.indices), dtype=np.int8),
                          (node[columns.indices], np.repeat(np.arange(n_nodes),
                                                            np.diff(columns.indptr)))),
                         (n_nodes, n_nodes))
    graph.sum_duplicates()
    graph = graph + graph.T
    graph.setdiag(0)
    graph.eliminate_zeros()
    # The form of the arguments depends on the version.
    given = (pymetis.CSRAdjacency(graph.indptr, graph.indices)
             if hasattr(pymetis, "CSRAdjacency") else None)
    place, _ = (pymetis.nested_dissection(given) if given is not None else
                pymetis.nested_dissection(xadj=graph.indptr, adjncy=graph.indices))
    rank = np.empty(n_nodes, dtype=np.int64)
    rank[np.asarray(place)] = np.arange(n_nodes)
    return np.argsort(rank[node], kind="stable")


def check_room(instance: Any, what: str) -> None:
    """Refuse what MUMPS has found to be more than the memory, after its analysis."""
    needed = 1e6 * float(instance.infog[17])
    if needed > memory():
        raise InputError(f"{what} {needed / 1e9:.1f} GB for their factors, and this machine has "
                         f"{memory() / 1e9:.1f} GB; take --factor cholmod or superlu, patches of "
                         "several nodes as pairs, or a coarser mesh away from the contact")


def memory() -> float:
    """Memory of the machine [bytes]; infinite where it does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return float("inf")
