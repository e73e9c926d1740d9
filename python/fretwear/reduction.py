"""Reduction of a sparse model to its contact coordinates and bonded modes.

The structure may be free but for its contact, so everything rests on K_a = K + kappa B^T B,
which is positive definite where the contact and the supports together hold the structure.
With Y = K_a^-1 B^T and S = B Y:

* constraint modes Psi = Y S^-1 (B Psi = I); contact stiffness K_rr = Psi^T K Psi = S^-1 - kappa I;
* bonded flexibility F = K_a^-1 - Y S^-1 Y^T (B F = 0): the modes of (F, M) are those of the
  structure with every pair stuck, and Psi^T f is the exact static contact force;
* Phi^T K Psi = 0, so the stiffness of q = (u_r, eta) is block diagonal.

Complex Hermitian matrices, of a sector tied in a nodal diameter, are taken as well; T is the
conjugate transpose then.

Rows of B are relative displacements u_r = u_side1 - u_side2 of the contact pairs, nodes or patch
averages, in any frame. They become the first degrees of freedom of the reduced model. Units are
those of the model and must be consistent: [F/L] stiffness, [M] mass.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from .errors import InputError

__all__ = ["Bonded", "Progress", "Reduction", "bonded_basis", "reduce"]

#: Real, or complex where one of the matrices is.
Floats = NDArray[Any]
Matrix = Union[sp.sparray, sp.spmatrix, Floats]

#: Called with what is being done, and how much of how much of it is done.
Progress = Callable[[str, int, int], None]

# Right-hand sides treated at once: fine flanks have thousands, each as long as the full model.
_BLOCK = 64
# Columns or rows of dense products: few, and the basis would come from memory for each few.
_WIDE = 512
# A pivot that elimination leaves at this share of its diagonal entry is round-off.
_SINGULAR = 1e-12
# Relative displacements of which so little is their own are combinations of the others.
_DEPENDENT = 1e-13
# Share of the compliance of a load that the modes may leave for an attachment vector to matter.
_ATTACHED = 1e-12
# K_rr = S^-1 - kappa I keeps 16 digits less the ratio of kappa to K_rr: more is lost than needed.
_KAPPA_RATIO = 1e3


def _blocks(n: int, width: int = _BLOCK) -> list[slice]:
    """Consecutive blocks of n columns."""
    return [slice(k, min(k + width, n)) for k in range(0, n, width)]


class Bonded:
    """Factored structure with its contact coordinates.

    Parameters
    ----------
    stiffness : (n, n) sparse
        Stiffness on the free degrees of freedom [F/L]; may be singular for motions that the
        contact holds.
    contact : (n_r, n) sparse
        Contact coordinates, rows of B, linearly independent.
    kappa : float
        Stiffness put between the sides of every pair [F/L]; of the order of the contact
        stiffness itself, or digits are lost in S^-1 - kappa I.
    progress : callable, optional
        Told how far the work is.
    spare : int
        Columns kept free behind the shapes, so that modes and attachment vectors join them
        without a copy of it all.

    Attributes
    ----------
    constraint_modes : (n, n_r)
        Static shapes Psi of unit contact coordinates.

    Raises
    ------
    InputError
        Motions remain that neither the contact nor the supports hold, contact coordinates
        depend on one another, or the shapes do not fit into the memory of the machine.
    """

    def __init__(self, stiffness: sp.csr_array, contact: sp.csr_array, kappa: float,
                 progress: Progress | None = None, spare: int = 0) -> None:
        self.stiffness, self.contact, self.kappa = stiffness, contact, kappa
        augmented = sp.csc_matrix(stiffness + kappa * (contact.conj().T @ contact))
        n = len(augmented.indptr) - 1
        _check_memory(n, contact.shape[0], augmented.dtype.itemsize * (1 if spare else 2))
        if progress:
            progress("factors", 0, 1)
        self._factors = _factor(augmented)
        room = np.empty((n, contact.shape[0] + spare), dtype=augmented.dtype, order="F")
        self._room: Floats | None = room if spare else None
        flexible = room[:, :contact.shape[0]]
        blocks = _blocks(contact.shape[0])

        def answer(block: slice) -> None:
            flexible[:, block] = self._solve(contact[block].toarray().conj().T)

        # SuperLU works outside Python's lock: blocks are solved side by side. The small products
        # inside would start threads of their own, which wait for one another most of the time.
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(os.cpu_count()) as workers:
            for done, _ in enumerate(workers.map(answer, blocks), 1):
                if progress:
                    progress("contact shapes", done, len(blocks))
        compliance = contact @ flexible
        self._compliance = 0.5 * (compliance + compliance.conj().T)
        _check_independent(self._compliance)
        self._inverse = la.cho_factor(self._compliance)
        # In place: another array of this size would be most of the memory.
        for rows in _blocks(len(flexible), _WIDE):
            # Without the test for NaN, which reads the whole factor for every block.
            flexible[rows] = la.cho_solve(self._inverse, flexible[rows].conj().T,
                                          check_finite=False).conj().T
        self.constraint_modes: Floats = flexible

    def contact_stiffness(self) -> Floats:
        """K_rr [F/L], (n_r, n_r): zero for motions that the contact alone holds."""
        n = self.contact.shape[0]
        inverse = la.cho_solve(self._inverse, np.eye(n))
        return 0.5 * (inverse + inverse.conj().T) - self.kappa * np.eye(n)

    def shapes_with(self, *others: Floats) -> Floats:
        """The shapes with other columns (n, k) behind them, the first time in the spare ones."""
        columns = np.hstack(others)
        last = self.contact.shape[0] + columns.shape[1]
        if self._room is None or last > self._room.shape[1] or columns.dtype != self._room.dtype:
            return np.hstack((self.constraint_modes, columns))
        room, self._room = self._room, None
        room[:, self.contact.shape[0]:last] = columns
        return room[:, :last]

    def solve(self, load: Floats) -> Floats:
        """Static displacement of the bonded structure under loads (n,) or (n, k)."""
        modes = self.constraint_modes
        return self._solve(load) - modes @ (self._compliance @ (modes.conj().T @ load))

    def _solve(self, load: Floats) -> Floats:
        """With nothing stuck; factors and right-hand sides are of one type."""
        return self._factors.solve(np.ascontiguousarray(load, dtype=self._factors.U.dtype))

    def modes(self, mass: sp.csr_array, n_modes: int) -> tuple[Floats, Floats]:
        """Lowest modes with every pair stuck.

        Parameters
        ----------
        mass : (n, n) sparse
            Mass [M]; may be singular.
        n_modes : int
            At least one, fewer than the bonded degrees of freedom.

        Returns
        -------
        omega : (n_modes,)
            Circular frequencies [rad/s], ascending.
        shapes : (n, n_modes)
            Mass-normalised shapes with B shapes = 0.
        """
        n = mass.shape[0]
        # A fixed start without any symmetry: the same modes, with the same signs, every time.
        start = 1.0 + np.cos(np.arange(n) ** 1.1)
        kind = self.constraint_modes.dtype
        flexibility = spl.LinearOperator((n, n), matvec=self.solve, dtype=kind)
        # With sigma and OPinv the first argument only gives shape and type; it is never applied.
        values, shapes = spl.eigsh(mass.astype(kind), k=n_modes, M=mass, sigma=0.0,
                                   OPinv=flexibility, v0=self.solve(mass @ start), tol=0.0)
        if kind.kind == "c":
            # Of close frequencies the shapes of a complex pencil are not orthogonal.
            values, mix = la.eigh(_gram(shapes, self.stiffness), _gram(shapes, mass))
            shapes = shapes @ mix
        order = np.argsort(values)
        return np.sqrt(values[order]), shapes[:, order] * _turned(
            start @ (mass @ shapes[:, order]))


@dataclass(frozen=True)
class Reduction:
    """Basis T = (Psi, Phi) of the reduced coordinates q = (u_r, eta).

    Attributes
    ----------
    basis : (n, n_r + n_eta)
        Columns on the degrees of freedom of the full model: recovery is u = basis @ q.
    stiffness : (n_r + n_eta, n_r + n_eta)
        T^T K T [F/L], without the round-off of the product.
    omega : (n_modes,)
        Circular frequencies of the bonded modes [rad/s]; eta holds these modes, then the
        attachment vectors.
    """

    basis: Floats
    stiffness: Floats
    omega: Floats

    def matrix(self, full: Matrix) -> Floats:
        """T^T A T of a symmetric matrix (n, n), symmetric to the last bit."""
        product = np.empty((self.basis.shape[1],) * 2, dtype=self.basis.dtype)
        for block in _blocks(len(product), _WIDE):
            below = slice(block.start, None)
            product[below, block] = self.basis[:, below].conj().T @ (full @ self.basis[:, block])
            product[block, block] = 0.5 * (product[block, block] + product[block, block].conj().T)
            product[block, below] = product[below, block].conj().T
        return product

    def load(self, full: Floats) -> Floats:
        """T^T f of loads (n,) or (n, k)."""
        return self.basis.conj().T @ full

    def row(self, full: Matrix) -> Floats:
        """Observation rows (k, n) of the full model, on the reduced coordinates."""
        return np.asarray(full @ self.basis)


@dataclass(frozen=True)
class ReducedSystem:
    """What `reduce` returns: the matrices in q = (u_r, eta), and the way back.

    Attributes
    ----------
    mass, stiffness : (n_q, n_q)
        Modal coordinates are mass-normalised.
    damping : (n_q, n_q) or None
        None where none was given.
    loads : (n_q, n_loads)
        Columns T^T f.
    contact : slice
        Contact coordinates among q, in the order of the rows of B.
    reduction : Reduction
        Basis, for what else is to be projected or recovered.
    """

    mass: Floats
    stiffness: Floats
    damping: Floats | None
    loads: Floats
    contact: slice
    reduction: Reduction


def bonded_basis(bonded: Bonded, mass: sp.csr_array, loads: Floats, n_modes: int) -> Reduction:
    """Constraint modes, bonded modes and attachment vectors of loads (n,) or (n, k).

    An attachment vector is what the modes leave of the static answer to a load, so it is
    orthogonal to them in mass and stiffness and the reduced stiffness stays block diagonal.
    Loads that the modes or other loads answer already add no vector.

    Raises
    ------
    InputError
        n_modes is not below the number of bonded degrees of freedom.
    """
    loads = loads.reshape(len(loads), -1)
    most = mass.shape[0] - bonded.contact.shape[0] - loads.shape[1]
    if n_modes < 1 or n_modes >= most:
        raise InputError(f"n_modes = {n_modes} is not accepted; expected 1 to {most - 1}: fewer "
                         "than the bonded degrees of freedom of this model")
    omega, shapes = bonded.modes(mass, n_modes)
    rest, diagonal = _attachments(bonded, mass, loads, shapes)
    stiffness = la.block_diag(bonded.contact_stiffness(),
                              np.diag(np.concatenate((omega**2, diagonal))))
    return Reduction(bonded.shapes_with(shapes, rest), stiffness, omega)


def reduce(mass: Matrix, stiffness: Matrix, contact: Matrix, *, damping: Matrix | None = None,
           loads: ArrayLike | None = None, n_modes: int = 20,
           attachments: ArrayLike | None = None, kappa: float | None = None,
           bonded: Bonded | None = None, progress: Progress | None = None) -> ReducedSystem:
    """Reduce a large sparse model to relative displacements, bonded modes and attachments.

    Exact in the reduced model: the stuck (bonded) natural frequencies kept, the static contact
    forces of any load, and the static displacement that the attachment loads work on.

    Parameters
    ----------
    mass, stiffness : (n, n) sparse or dense
        Symmetric or Hermitian, on the free degrees of freedom [M], [F/L]. The mass may be singular,
        and the stiffness for motions that the contact holds.
    contact : (n_r, n) sparse or dense
        Rows of B: relative displacements u_side1 - u_side2 of the pairs, linearly independent.
    damping : (n, n) sparse or dense, optional
        Symmetric [F s/L].
    loads : (n,) or (n, n_loads), optional
        Loads [F] to bring into reduced coordinates.
    n_modes : int
        Modes of the bonded structure.
    attachments : (n,) or (n, k), optional
        Loads whose static answer the basis is to hold; `loads` where not given.
    kappa : float, optional
        Stiffness between the sides of the pairs [F/L] for the factorization; by default of the
        order of the contact stiffness. The result does not depend on it but by round-off.
    bonded : Bonded, optional
        The factored structure, where the caller has it; `stiffness` and `contact` must be its.
    progress : callable, optional
        Told what is being done, and how much of how much of it is done.

    Returns
    -------
    ReducedSystem

    Raises
    ------
    InputError
        Shapes do not agree; n_modes is too large; motions remain that neither the contact nor
        the supports hold; or contact coordinates depend on one another.
    """
    masses, stiff = sp.csr_array(mass), sp.csr_array(stiffness)
    rows = sp.csr_array(contact)
    n = stiff.shape[0]
    _check_shapes(n, masses, stiff, rows, damping)
    forces = _columns(loads, n, "loads")
    attached = forces if attachments is None else _columns(attachments, n, "attachments")
    if bonded is None:
        bonded = _bonded(stiff, rows, kappa, progress, n_modes + attached.shape[1])
    reduction = bonded_basis(bonded, masses, attached, n_modes)
    return ReducedSystem(
        reduction.matrix(masses), reduction.stiffness,
        None if damping is None else reduction.matrix(sp.csr_array(damping)),
        reduction.load(forces), slice(0, rows.shape[0]), reduction)


def _attachments(bonded: Bonded, mass: sp.csr_array, loads: Floats,
                 shapes: Floats) -> tuple[Floats, Floats]:
    """Attachment vectors (n, k), orthogonal to the modes and each other, and their stiffness."""
    static = bonded.solve(loads)
    compliance = np.einsum("ij,ij->j", loads.conj(), static).real
    used = compliance > 0.0
    loads, static, compliance = loads[:, used], static[:, used], compliance[used]
    if not loads.shape[1]:
        return np.empty((len(loads), 0)), np.empty(0)
    rest = static - bonded.solve(mass @ (shapes @ (shapes.conj().T @ loads)))
    for _ in range(2):  # the second pass removes the round-off of the first
        rest -= shapes @ (shapes.conj().T @ (mass @ rest))
    rest /= np.sqrt(compliance)
    values, vectors = la.eigh(_gram(rest, bonded.stiffness))
    kept = values > _ATTACHED
    rest = rest @ (vectors[:, kept] / np.sqrt(values[kept]))  # now of unit stiffness
    values, vectors = la.eigh(_gram(rest, mass))
    # A vector without mass stays as it is: it answers statically.
    scale = np.where(values > _ATTACHED * np.abs(values).max(initial=0.0), values, 1.0)
    rest = rest @ (vectors / np.sqrt(scale))
    work = rest.conj().T @ loads
    largest = work[np.arange(len(work)), np.abs(work).argmax(axis=1)]
    return rest * _turned(largest.conj()), 1.0 / scale


def _turned(values: Floats) -> Floats:
    """Factors of unit size that make the values positive."""
    size = np.abs(values)
    return np.where(size > 0.0, np.conj(values) / np.where(size > 0.0, size, 1.0), 1.0)


def _gram(vectors: Floats, matrix: sp.csr_array) -> Floats:
    product = vectors.conj().T @ (matrix @ vectors)
    return 0.5 * (product + product.conj().T)


def _bonded(stiffness: sp.csr_array, contact: sp.csr_array, kappa: float | None,
            progress: Progress | None, spare: int) -> Bonded:
    """Factored structure; kappa is improved once where the guess costs digits."""
    if kappa is not None:
        return Bonded(stiffness, contact, kappa, progress, spare)
    # Stiffness that the rows meet when nothing else moves: of the order of the contact stiffness,
    # and above it.
    size, met = (np.asarray(contact.conj().multiply(rows).sum(axis=1)).ravel().real
                 for rows in (contact, contact @ stiffness))
    guess = float(np.median(met / size**2))
    bonded = Bonded(stiffness, contact, guess, progress, spare)
    found = float(np.median(np.diag(bonded.contact_stiffness()).real))
    if 0.0 < found < guess / _KAPPA_RATIO:
        del bonded  # as large as the next one
        return Bonded(stiffness, contact, found, progress, spare)
    return bonded


def _check_memory(n: int, n_contact: int, size: int) -> None:
    """Refuse what cannot be held, `size` bytes for each number of the shapes."""
    needed, there = float(n) * n_contact * size, _memory()
    if needed > there:
        raise InputError(f"{n_contact} contact coordinates of {n} degrees of freedom need "
                         f"{needed / 1e9:.1f} GB, and this machine has {there / 1e9:.1f} GB; take "
                         "patches of several nodes as pairs, or a coarser mesh away from the "
                         "contact")


def _memory() -> float:
    """Memory of the machine [bytes]; infinite where it does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return float("inf")


def _factor(matrix: sp.csc_matrix) -> Any:
    """LU factors of a symmetric positive definite matrix, or why there are none."""
    try:
        # Positive definite: diagonal pivots are safe, and a symmetric ordering fills least.
        factors = spl.splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                           options={"SymmetricMode": True})
    except RuntimeError as error:
        raise InputError(f"{_FREE}: {error}") from None
    pivots = factors.U.diagonal()[factors.perm_c].real
    size = np.abs(matrix.diagonal())
    share = pivots / np.where(size > 0.0, size, 1.0)
    lost = np.flatnonzero(share < _SINGULAR)
    if len(lost):
        if (share[lost] < -_SINGULAR).any():
            dof = int(lost[share[lost].argmin()])
            raise InputError("the stiffness is not positive semidefinite: elimination leaves a "
                             f"negative pivot at degree of freedom {dof + 1}; check signs and "
                             "units, and leave spin softening to stiffness_rotation")
        raise InputError(f"{_FREE}: {len(lost)} found, first at degree of freedom {lost[0] + 1}")
    return factors


_FREE = ("motions remain that neither the contact nor the supports hold (rigid-body modes of the "
         "bonded structure); add supports or pairs")


def _check_independent(compliance: Floats) -> None:
    """Refuse contact coordinates that depend on one another."""
    size = np.sqrt(np.abs(np.diag(compliance)))
    scaled = compliance / np.outer(size, size)
    _, order, rank, _ = la.get_lapack_funcs("pstrf", (scaled,))(scaled, tol=_DEPENDENT)
    if rank < len(compliance):
        rows: Sequence[int] = sorted(int(row) for row in order[rank:])
        raise InputError(f"{len(rows)} of {len(compliance)} contact rows depend on the others "
                         f"(row {rows[0]} for one): a pair given twice, or one between points "
                         "that move together; remove them")


def _check_shapes(n: int, mass: sp.csr_array, stiffness: sp.csr_array, contact: sp.csr_array,
                  damping: Matrix | None) -> None:
    square = {"stiffness": stiffness, "mass": mass, "damping": damping}
    for name, matrix in square.items():
        if matrix is not None and matrix.shape != (n, n):
            raise InputError(f"{name} is {matrix.shape[0]} x {matrix.shape[1]}; expected {n} x "
                             f"{n}, as the stiffness has {n} rows")
    if contact.shape[1] != n or contact.shape[0] == 0:
        raise InputError(f"contact is {contact.shape[0]} x {contact.shape[1]}; expected at least "
                         f"one row of {n} columns")
    empty = np.flatnonzero(abs(contact).sum(axis=1) == 0.0)
    if len(empty):
        raise InputError(f"contact row {empty[0] + 1} is zero: it involves no degree of freedom")


def _columns(loads: ArrayLike | None, n: int, name: str) -> Floats:
    if loads is None:
        return np.empty((n, 0))
    columns = np.asarray(loads, dtype=np.result_type(np.asarray(loads), float))
    if columns.shape[:1] != (n,) or columns.ndim > 2:
        raise InputError(f"{name} has the shape {columns.shape}; expected ({n},) or ({n}, k)")
    return columns.reshape(n, -1)
