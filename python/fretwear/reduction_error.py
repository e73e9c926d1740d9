"""How far the dynamic stiffness of a reduced model is from that of the full one.

With u a few motions of the joint at random, x = Psi u their static shapes, m_j = Phi_j^T M x and F
the bonded flexibility, what the modes j > k add to the stiffness that the joint meets at w is

    w^4 sum m_j^2 / (w_j^2 - w^2) <= w^4 (x^T M F M x - sum_{j<=k} m_j^2 / w_j^2)
                                     / (1 - w^2 / w_{k+1}^2),

over u^T K_rr u; it is as much without the last divisor at least. The solutions for a few motions
are all that it takes. Of all motions it says what it says of these: an estimate, no bound.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray

from ._mumps import mumps_instance, run_mumps
from .errors import InputError
from .factors import chosen_engine

if TYPE_CHECKING:
    from .reduction import Bonded

__all__ = ["MARGIN", "error_of_modes", "exact_stiffness", "motions", "true_error"]

Floats = NDArray[Any]

#: The first frequency that is left out over the highest that is wanted, at least.
MARGIN = 1.4
_N_MOTIONS = 8


def motions(stiffness: Floats) -> Floats:
    """Random motions of the contact coordinates (n_r, 8), of one force in each coordinate."""
    size = np.abs(np.diag(stiffness).real)
    scale = 1.0 / np.sqrt(np.where(size > 0.0, size, size.max(initial=0.0) or 1.0))
    signs = np.random.default_rng(1).standard_normal((len(size), _N_MOTIONS))
    return signs * scale[:, None]


def error_of_modes(bonded: Bonded, mass: Any, omega: Floats, shapes: Floats,
                   frequency: float) -> Floats:
    """Estimates with 1, 2, ... modes kept, all but the last of those that are given.

    Parameters
    ----------
    bonded : Bonded
        Factored structure.
    mass : (n, n) sparse
        Its mass.
    omega, shapes : (n_modes + 1,), (n, n_modes + 1)
        Bonded modes, ascending.
    frequency : float
        Circular frequency [rad/s].

    Returns
    -------
    (n_modes,)
        Relative to K_rr; infinite where the next frequency is not above the one given.
    """
    stiffness = bonded.contact_stiffness()
    moved = motions(stiffness)
    static = np.einsum("ij,ij->j", moved.conj(), stiffness @ moved).real
    inertia = mass @ bonded.shapes(moved)
    whole = np.einsum("ij,ij->j", inertia.conj(), bonded.solve(inertia)).real
    kept = np.abs(shapes[:, :-1].conj().T @ inertia)**2 / omega[:-1, None]**2
    left = np.maximum(whole - np.cumsum(kept, axis=0), 0.0)
    below = 1.0 - frequency**2 / omega[1:]**2
    worst = np.divide(left, static, out=np.full_like(left, np.inf),
                      where=static > 0.0).max(axis=1)
    return np.divide(frequency**4 * worst, below, out=np.full_like(worst, np.inf),
                     where=below > 0.0)


def true_error(reduced_mass: Floats, reduced_stiffness: Floats, mass: Any, stiffness: Any,
               contact: Any, frequency: float, damping: float = 1e-3,
               engine: str = "auto") -> float:
    """The same share by the full matrices at one circular frequency, with a structural damping;
    contact coordinates are the first of the reduced ones."""
    rr = slice(0, contact.shape[0])
    inner = slice(rr.stop, None)
    moved = motions(reduced_stiffness[rr, rr])
    full = exact_stiffness(mass, stiffness, contact, frequency, moved, damping, engine)
    complex_stiffness = reduced_stiffness * (1.0 + 1j * damping) - frequency**2 * reduced_mass
    answer = np.linalg.solve(complex_stiffness[inner, inner], complex_stiffness[inner, rr] @ moved)
    ours = complex_stiffness[rr, rr] @ moved - complex_stiffness[rr, inner] @ answer
    work = np.abs(np.einsum("ij,ij->j", moved.conj(), ours - full))
    static = np.einsum("ij,ij->j", moved.conj(), reduced_stiffness[rr, rr] @ moved).real
    return float((work / static).max())


def exact_stiffness(mass: Any, stiffness: Any, contact: Any, frequency: float, moved: Floats,
                    damping: float = 1e-3, engine: str = "auto") -> Floats:
    """Forces Z_r u (n_r, k) that move the pairs of the full model by u at a circular frequency.

    From one complex factorization of [K (1 + i damping) - w^2 M, B^T; B, 0].
    """
    dynamic = sp.csr_array(stiffness) * (1.0 + 1j * damping) - frequency**2 * sp.csr_array(mass)
    rows = sp.csr_array(contact)
    n, n_contact = dynamic.shape[0], rows.shape[0]
    # Both parts of one size, which the pivots compare.
    size = float(abs(dynamic.diagonal()).mean())
    right = np.zeros((n + n_contact, moved.shape[1]), dtype=complex, order="F")
    right[n:] = size * moved
    if chosen_engine(engine) == "mumps" and not np.iscomplexobj(rows):
        instance, _kept = mumps_instance(sp.block_array(
            [[sp.tril(dynamic), None], [size * rows, sp.csr_array((n_contact, n_contact))]]))
        for job in (1, 2):
            if run_mumps(instance, job, InputError) == "singular":
                raise InputError(f"the structure resonates at {frequency / (2.0 * np.pi):.6g} Hz "
                                 "with every pair stuck; verify at another frequency")
        instance.set_dense_rhs(right)
        run_mumps(instance, 3, InputError)
        return -size * right[n:]
    whole = sp.csc_matrix(sp.block_array([[dynamic, size * rows.conj().T], [size * rows, None]]))
    return -size * spl.splu(whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1).solve(
        right)[n:]
