"""Reduction of a sparse model to its contact coordinates and bonded modes.

The structure may be free but for its contact, so everything rests on K_a = K + kappa B^T B,
which is positive definite where the contact and the supports together hold the structure.
With S = B K_a^-1 B^T:

* constraint modes Psi = K_a^-1 B^T S^-1 (B Psi = I); contact stiffness
  K_rr = Psi^T K Psi = S^-1 - kappa I;
* Psi^T A Psi = S^-1 (B K_a^-1 A K_a^-1 B^T) S^-1 of any matrix A, and Psi^T f = S^-1 B K_a^-1 f,
  the exact static contact force: the shapes themselves, as long as the model and as many as there
  are contact coordinates, are formed only where somebody looks at them;
* bonded flexibility F f = y - K_a^-1 B^T S^-1 B y with y = K_a^-1 f (B F = 0): the modes of
  (F, M) are those of the structure with every pair stuck;
* Phi^T K Psi = 0, so the stiffness of q = (u_r, eta) is block diagonal.

S and the products with A come from solutions for blocks of rows of B, or by MUMPS from a Schur
complement (`schur.py`). Complex Hermitian matrices, of a sector tied in a nodal diameter, are taken
as well; T is the conjugate transpose then.

Rows of B are relative displacements u_r = u_side1 - u_side2 of the contact pairs, nodes or patch
averages, in any frame. They become the first degrees of freedom of the reduced model. Units are
those of the model and must be consistent: [F/L] stiffness, [M] mass.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Union

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import ArrayLike, NDArray

from .errors import InputError
from .factors import Factor, chosen_engine, factor, memory
from .reduction_error import MARGIN, error_of_modes
from .schur import contact_compliances

__all__ = ["Bonded", "Progress", "Reduction", "bonded_basis", "reduce"]

#: Real, or complex where one of the matrices is.
Floats = NDArray[Any]
Matrix = Union[sp.sparray, sp.spmatrix, Floats]

#: Called with what is being done, and how much of how much of it is done.
Progress = Callable[[str, int, int], None]

# Right-hand sides treated at once: fine flanks have thousands, each as long as the full model.
_BLOCK = 64
# Solutions for all rows of B are kept below this [bytes]: they serve again for every product.
_KEPT = 100e6
# Matrices of the order of the contact coordinates that are there at once.
_SQUARES = 4
# Relative displacements of which so little is their own are combinations of the others.
_DEPENDENT = 1e-13
# Share of the compliance of a load that the modes may leave for an attachment vector to matter.
_ATTACHED = 1e-12
# Modes that an accuracy begins with; twice as many each time.
_FIRST_MODES = 10
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
    engine : str
        Who factors: a word of `factors.ENGINES`.
    mass : (n, n) sparse, optional
        Matrix whose product with the shapes is wanted later: it comes on the way.

    Attributes
    ----------
    engine : str
        Who did.

    Raises
    ------
    InputError
        Motions remain that neither the contact nor the supports hold, contact coordinates
        depend on one another, or what is kept does not fit into the memory of the machine.
    """

    def __init__(self, stiffness: sp.csr_array, contact: sp.csr_array, kappa: float,
                 progress: Progress | None = None, *, engine: str = "auto",
                 mass: sp.csr_array | None = None) -> None:
        self.stiffness, self.contact, self.kappa = stiffness, contact, kappa
        self._progress = progress
        self.engine = chosen_engine(engine)
        augmented = sp.csc_matrix(stiffness + kappa * (contact.conj().T @ contact))
        self._dtype = augmented.dtype
        n, n_contact = augmented.shape[0], contact.shape[0]
        _check_memory(n, n_contact, augmented.dtype.itemsize)
        self._answers: Floats | None = None
        self._inner: list[tuple[Any, Floats]] = []
        self._by_schur = self.engine == "mumps" and self._dtype.kind == "f"
        self._tell("factors", 0, 1)
        if self._by_schur:
            # Before the factors for solutions, which refuse what is singular: both at once would
            # be the most memory of all.
            try:
                compliance, inner = contact_compliances(augmented, contact, mass)
            except InputError:
                factor(augmented, self.engine)
                raise
            if mass is not None and inner is not None:
                self._inner.append((mass, inner))
        self._factors: Factor = factor(augmented, self.engine)
        if not self._by_schur:
            self._keep()
            compliance = self._sweep(None if self._answers is not None else mass)
        self._tell("contact shapes", 1, 1)
        self._compliance: Floats = 0.5 * (compliance + compliance.conj().T)
        _check_independent(self._compliance)
        self._inverse = la.cho_factor(self._compliance)

    def contact_stiffness(self) -> Floats:
        """K_rr [F/L], (n_r, n_r): zero for motions that the contact alone holds."""
        n = self.contact.shape[0]
        inverse = la.cho_solve(self._inverse, np.eye(n))
        return 0.5 * (inverse + inverse.conj().T) - self.kappa * np.eye(n)

    def inner(self, matrix: sp.csr_array) -> Floats:
        """Psi^T A Psi of a symmetric matrix (n, n), symmetric to the last bit."""
        found = next((inner for known, inner in self._inner if known is matrix), None)
        if found is None:
            if self._by_schur:
                augmented = sp.csc_matrix(
                    self.stiffness + self.kappa * (self.contact.T @ self.contact))
                _, found = contact_compliances(augmented, self.contact, matrix)
            if found is None:
                found = np.empty_like(self._compliance)
                self._sweep(matrix, found)
        half = la.cho_solve(self._inverse, found)
        whole = la.cho_solve(self._inverse, half.conj().T)
        return 0.5 * (whole + whole.conj().T)

    def forces(self, load: Floats) -> Floats:
        """Psi^T f: static contact forces of loads (n,) or (n, k) with every pair stuck."""
        return la.cho_solve(self._inverse, self._met(load))

    def shapes(self, motion: Floats) -> Floats:
        """Psi u: static shapes (n, k) of contact coordinates u (n_r, k)."""
        return self._spread(la.cho_solve(self._inverse, motion))

    def rows(self, matrix: Matrix, dtype: Any = None) -> Floats:
        """R Psi of rows (k, n): by so many solutions, or by those of all shapes where that is
        fewer."""
        n_contact = self.contact.shape[0]
        if matrix.shape[0] <= n_contact:
            turned: Any = matrix.conj().T
            return self.forces(turned.toarray() if sp.issparse(turned) else turned).conj().T
        found = np.empty((matrix.shape[0], n_contact), dtype=dtype or self._dtype)
        motion = np.eye(n_contact)
        for block in _blocks(n_contact):
            found[:, block] = matrix @ self.shapes(motion[:, block])
        return found

    @cached_property
    def constraint_modes(self) -> Floats:
        """Static shapes Psi (n, n_r) of unit contact coordinates, all of them."""
        n, n_contact = self.stiffness.shape[0], self.contact.shape[0]
        if (needed := float(n) * n_contact * self._dtype.itemsize) > memory():
            raise InputError(_too_large(n, n_contact, needed))
        return self.rows(sp.identity(n, format="csr"))

    def solve(self, load: Floats) -> Floats:
        """Static displacement of the bonded structure under loads (n,) or (n, k)."""
        free = self._solve(load)
        met = self.contact @ free if self._answers is None else self._met(load)
        return free - self._spread(la.cho_solve(self._inverse, met))

    def _solve(self, load: Floats) -> Floats:
        """With nothing stuck; factors and right-hand sides are of one type."""
        if not load.size:
            return np.zeros_like(load, dtype=self._dtype)
        return self._factors.solve(np.asarray(load, dtype=self._dtype))

    def _met(self, load: Floats) -> Floats:
        """B K_a^-1 f."""
        if self._answers is not None:
            return self._answers.conj().T @ load
        if load.ndim == 1 or load.shape[1] <= _BLOCK:
            return np.asarray(self.contact @ self._solve(load))
        return np.hstack([self.contact @ self._solve(load[:, block])
                          for block in _blocks(load.shape[1])])

    def _spread(self, force: Floats) -> Floats:
        """K_a^-1 B^T f of forces (n_r,) or (n_r, k) at the contact coordinates."""
        if self._answers is not None:
            return self._answers @ force
        return self._solve(self.contact.conj().T @ force)

    def _keep(self) -> None:
        """Solutions for all rows of B where they take little."""
        n, n_contact = self.stiffness.shape[0], self.contact.shape[0]
        if float(n) * n_contact * self._dtype.itemsize <= _KEPT:
            answers = np.empty((n, n_contact), dtype=self._dtype, order="F")
            for block in self._told(_blocks(n_contact)):
                answers[:, block] = self._solve(self.contact[block].toarray().conj().T)
            self._answers = answers

    def _sweep(self, matrix: sp.csr_array | None, found: Floats | None = None) -> Floats:
        """S by blocks of rows of B, and B K_a^-1 A K_a^-1 B^T of a matrix beside it."""
        n_contact = self.contact.shape[0]
        compliance = np.empty((n_contact,) * 2, dtype=self._dtype)
        inner = np.empty_like(compliance) if found is None and matrix is not None else found
        blocks = _blocks(n_contact)
        for block in blocks if self._answers is not None else self._told(blocks):
            answers = (self._solve(self.contact[block].toarray().conj().T)
                       if self._answers is None else self._answers[:, block])
            compliance[:, block] = self.contact @ answers
            if inner is not None:
                inner[:, block] = self._met(matrix @ answers)
        if inner is not None and found is None:
            self._inner.append((matrix, inner))
        return compliance

    def _told(self, blocks: list[slice]) -> Any:
        for done, block in enumerate(blocks):
            self._tell("contact shapes", done, len(blocks))
            yield block

    def _tell(self, stage: str, done: int, total: int) -> None:
        if self._progress:
            self._progress(stage, done, total)

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
        kind = self._dtype
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
    bonded : Bonded
        Factored structure, which answers for Psi.
    shapes : (n, n_eta)
        Phi: bonded modes, then attachment vectors.
    stiffness : (n_r + n_eta, n_r + n_eta)
        T^T K T [F/L], without the round-off of the product.
    omega : (n_modes,)
        Circular frequencies of the bonded modes [rad/s].
    """

    bonded: Bonded
    shapes: Floats
    stiffness: Floats
    omega: Floats

    @cached_property
    def basis(self) -> Floats:
        """All columns (n, n_r + n_eta) on the degrees of freedom of the full model: recovery is
        u = basis @ q. Formed when it is asked for: `expand` and `row` take less."""
        return np.hstack((self.bonded.constraint_modes, self.shapes))

    def matrix(self, full: Matrix) -> Floats:
        """T^T A T of a symmetric matrix (n, n), symmetric to the last bit."""
        n = self.bonded.contact.shape[0]
        moved = full @ self.shapes
        product = np.empty((n + self.shapes.shape[1],) * 2,
                           dtype=np.result_type(self.shapes, self.stiffness))
        product[:n, :n] = self.bonded.inner(full)
        product[:n, n:] = self.bonded.forces(moved)
        product[n:, :n] = product[:n, n:].conj().T
        own = self.shapes.conj().T @ moved
        product[n:, n:] = 0.5 * (own + own.conj().T)
        return product

    def load(self, full: Floats) -> Floats:
        """T^T f of loads (n,) or (n, k)."""
        return np.concatenate((self.bonded.forces(full), self.shapes.conj().T @ full))

    def row(self, full: Matrix, dtype: Any = None) -> Floats:
        """Observation rows (k, n) of the full model, on the reduced coordinates."""
        return np.hstack((self.bonded.rows(full, dtype),
                          np.asarray(full @ self.shapes, dtype=dtype)))

    def expand(self, coordinates: Floats) -> Floats:
        """Displacement T q of the full model by reduced coordinates (n_q,) or (n_q, k)."""
        n = self.bonded.contact.shape[0]
        return self.bonded.shapes(coordinates[:n]) + self.shapes @ coordinates[n:]


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
    frequency, error : float or None
        Circular frequency [rad/s] up to which it was reduced, and the estimated error of the
        stiffness of the joint there; None where the modes were counted.
    """

    mass: Floats
    stiffness: Floats
    damping: Floats | None
    loads: Floats
    contact: slice
    reduction: Reduction
    frequency: float | None = None
    error: float | None = None


def bonded_basis(bonded: Bonded, mass: sp.csr_array, loads: Floats, n_modes: int,
                 known: tuple[Floats, Floats] | None = None) -> Reduction:
    """Constraint modes, bonded modes and attachment vectors of loads (n,) or (n, k); `known` are
    frequencies and shapes of modes that were found before.

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
    omega, shapes = bonded.modes(mass, n_modes) if known is None else known
    rest, diagonal = _attachments(bonded, mass, loads, shapes)
    stiffness = la.block_diag(bonded.contact_stiffness(),
                              np.diag(np.concatenate((omega**2, diagonal))))
    return Reduction(bonded, np.hstack((shapes, rest)), stiffness, omega)


def reduce(mass: Matrix, stiffness: Matrix, contact: Matrix, *, damping: Matrix | None = None,
           loads: ArrayLike | None = None, n_modes: int = 20,
           attachments: ArrayLike | None = None, kappa: float | None = None,
           bonded: Bonded | None = None, progress: Progress | None = None,
           factor: str = "auto", accuracy: float | None = None,
           up_to: float | None = None) -> ReducedSystem:
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
    factor : str
        Who factors: 'mumps', 'cholmod', 'superlu', 'pardiso', or 'auto' for the first of the first
        three that is installed.
    accuracy, up_to : float, optional
        In place of `n_modes`: as many as an estimated error of the stiffness of the joint takes,
        relative, up to this circular frequency [rad/s].

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
        bonded = _bonded(stiff, rows, kappa, progress, factor, masses)
    known, error = None, None
    if accuracy is not None:
        known, error = _modes_to(bonded, masses, attached.shape[1], accuracy, up_to)
        n_modes = len(known[0])
    reduction = bonded_basis(bonded, masses, attached, n_modes, known)
    return ReducedSystem(
        reduction.matrix(masses), reduction.stiffness,
        None if damping is None else reduction.matrix(sp.csr_array(damping)),
        reduction.load(forces), slice(0, rows.shape[0]), reduction,
        None if error is None else up_to, error)


def _modes_to(bonded: Bonded, mass: sp.csr_array, n_attached: int, accuracy: float,
              up_to: float | None) -> tuple[tuple[Floats, Floats], float]:
    """As few modes as the accuracy takes, with the estimated error that they leave."""
    if up_to is None:
        raise InputError("an accuracy needs the frequency up to which it is to hold: give "
                         "--up-to HZ (up_to in Python), the highest harmonic times the highest "
                         "frequency")
    if not 0.0 < accuracy < 1.0 or not up_to > 0.0:
        raise InputError(f"accuracy = {accuracy:g} up to {up_to:g} rad/s is not accepted; expected "
                         "an accuracy between 0 and 1, such as 1e-4, and a positive frequency")
    most = mass.shape[0] - bonded.contact.shape[0] - n_attached - 1
    count = _FIRST_MODES
    while True:
        count = min(count, most - 1)
        omega, shapes = bonded.modes(mass, count + 1)
        errors = error_of_modes(bonded, mass, omega, shapes, up_to)
        good = np.flatnonzero((errors <= accuracy) & (omega[1:] >= MARGIN * up_to))
        if len(good):
            kept = int(good[0]) + 1
            return (omega[:kept], shapes[:, :kept]), float(errors[kept - 1])
        if count == most - 1:
            raise InputError(f"accuracy = {accuracy:g}: all {count} modes leave an error of "
                             f"{errors[-1]:.2g} at {up_to / (2.0 * np.pi):.6g} Hz; ask for less")
        count *= 2


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
            progress: Progress | None, engine: str, mass: sp.csr_array) -> Bonded:
    """Factored structure; kappa is improved once where the guess costs digits."""
    if kappa is not None:
        return Bonded(stiffness, contact, kappa, progress, engine=engine, mass=mass)
    # Stiffness that the rows meet when nothing else moves: of the order of the contact stiffness,
    # and above it.
    size, met = (np.asarray(contact.conj().multiply(rows).sum(axis=1)).ravel().real
                 for rows in (contact, contact @ stiffness))
    guess = float(np.median(met / size**2))
    bonded = Bonded(stiffness, contact, guess, progress, engine=engine, mass=mass)
    found = float(np.median(np.diag(bonded.contact_stiffness()).real))
    if 0.0 < found < guess / _KAPPA_RATIO:
        del bonded  # as large as the next one
        return Bonded(stiffness, contact, found, progress, engine=engine, mass=mass)
    return bonded


def _check_memory(n: int, n_contact: int, size: int) -> None:
    """Refuse what cannot be held, `size` bytes for each number; factors come on top."""
    needed = size * (_SQUARES * float(n_contact)**2 + 2.0 * n * min(n_contact, _BLOCK))
    if needed > memory():
        raise InputError(_too_large(n, n_contact, needed))


def _too_large(n: int, n_contact: int, needed: float) -> str:
    return (f"{n_contact} contact coordinates of {n} degrees of freedom need "
            f"{needed / 1e9:.1f} GB, and this machine has {memory() / 1e9:.1f} GB; take patches of "
            "several nodes as pairs, or a coarser mesh away from the contact")


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
