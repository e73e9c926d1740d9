"""Reduction of the sector to contact coordinates and bonded modes.

The free blade makes K singular, so everything rests on K_a = K + kappa B^T B, which is positive
definite. With Y = K_a^-1 B^T and S = B Y:

* constraint modes Psi = Y S^-1 (B Psi = I); contact stiffness K_rr = Psi^T K Psi = S^-1 - kappa I;
* bonded flexibility F = K_a^-1 - Y S^-1 Y^T (B F = 0): the modes of (F, M) are those of the
  structure with every pair stuck, and Psi^T f is the exact static contact force;
* Phi^T K Psi = 0, so the stiffness of q = (u_r, eta) is block diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray

from .parameters import ParameterError

__all__ = ["Bonded", "Reduction", "bonded_basis"]

Floats = NDArray[np.float64]


# Right-hand sides treated at once: fine flanks have thousands, each as long as the full model.
_BLOCK = 256


def _blocks(n: int) -> list[slice]:
    """Consecutive blocks of n columns."""
    return [slice(k, min(k + _BLOCK, n)) for k in range(0, n, _BLOCK)]


class Bonded:
    """Factored structure with its contact coordinates.

    Parameters
    ----------
    stiffness : (n, n) sparse
        Stiffness on the free degrees of freedom [N/mm]; singular for rigid motions of the blade.
    contact : (n_r, n) sparse
        Contact coordinates, rows of B.
    kappa : float
        Stiffness put between the sides of every pair [N/mm]; of the order of the contact
        stiffness itself, or digits are lost in S^-1 - kappa I.
    """

    def __init__(self, stiffness: sp.csr_array, contact: sp.csr_array, kappa: float) -> None:
        self.stiffness, self.contact, self.kappa = stiffness, contact, kappa
        augmented = sp.csc_matrix(stiffness + kappa * (contact.T @ contact))
        # Positive definite: diagonal pivots are safe, and a symmetric ordering fills least.
        self._factors = spl.splu(augmented, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                                 options={"SymmetricMode": True})
        self._flexible = np.empty(contact.shape[::-1], order="F")
        for block in _blocks(contact.shape[0]):
            self._flexible[:, block] = self._factors.solve(contact[block].toarray().T)
        compliance = contact @ self._flexible
        self._compliance = la.cho_factor(0.5 * (compliance + compliance.T))

    def constraint_modes(self) -> Floats:
        """Static shapes Psi of unit contact coordinates, (n, n_r)."""
        return la.cho_solve(self._compliance, self._flexible.T).T

    def contact_stiffness(self) -> Floats:
        """K_rr [N/mm], (n_r, n_r): zero for rigid motions of the blade."""
        n = self.contact.shape[0]
        inverse = la.cho_solve(self._compliance, np.eye(n))
        return 0.5 * (inverse + inverse.T) - self.kappa * np.eye(n)

    def solve(self, load: Floats) -> Floats:
        """Static displacement of the bonded structure under loads (n,) or (n, k)."""
        free = self._factors.solve(np.ascontiguousarray(load))
        return free - self._flexible @ la.cho_solve(self._compliance, self._flexible.T @ load)

    def modes(self, mass: sp.csr_array, n_modes: int) -> tuple[Floats, Floats]:
        """Lowest modes with every pair stuck.

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
        flexibility = spl.LinearOperator((n, n), matvec=self.solve, dtype=np.float64)
        # With sigma and OPinv the first argument only gives shape and type; it is never applied.
        values, shapes = spl.eigsh(mass, k=n_modes, M=mass, sigma=0.0, OPinv=flexibility,
                                   v0=self.solve(mass @ start), tol=0.0)
        order = np.argsort(values)
        shapes = shapes[:, order] * np.sign(start @ (mass @ shapes[:, order]))
        return np.sqrt(values[order]), shapes


@dataclass(frozen=True)
class Reduction:
    """Basis T = (Psi, Phi) of the reduced coordinates q = (u_r, eta).

    Attributes
    ----------
    basis : (n, n_r + n_eta)
        Columns on the free degrees of freedom.
    stiffness : (n_r + n_eta, n_r + n_eta)
        T^T K T [N/mm], without the round-off of the product.
    """

    basis: Floats
    stiffness: Floats

    def matrix(self, full: sp.csr_array) -> Floats:
        """T^T A T of a symmetric matrix, symmetric to the last bit."""
        product = np.empty((self.basis.shape[1],) * 2)
        for block in _blocks(len(product)):
            product[:, block] = self.basis.T @ (full @ self.basis[:, block])
        return 0.5 * (product + product.T)

    def load(self, full: Floats) -> Floats:
        """T^T f of a load (n,)."""
        return self.basis.T @ full


def bonded_basis(bonded: Bonded, mass: sp.csr_array, load: Floats, n_modes: int) -> Reduction:
    """Constraint modes, bonded modes and one attachment vector of a load (n,).

    The attachment vector is what the modes leave of the static answer to the load, so it is
    orthogonal to them in mass and stiffness and the reduced stiffness stays block diagonal.
    """
    most = mass.shape[0] - bonded.contact.shape[0] - 1  # one is left for the attachment vector
    if n_modes >= most:
        raise ParameterError(f"Discretisation: n_modes = {n_modes} is not accepted; expected "
                             f"fewer than {most}, the bonded degrees of freedom of this mesh")
    omega, shapes = bonded.modes(mass, n_modes)
    rest = bonded.solve(load - mass @ (shapes @ (shapes.T @ load)))
    for _ in range(2):  # the second pass removes the round-off of the first
        rest -= shapes @ (shapes.T @ (mass @ rest))
    rest /= np.copysign(np.sqrt(rest @ (mass @ rest)), rest @ load)
    diagonal = np.append(omega**2, rest @ (bonded.stiffness @ rest))
    return Reduction(np.hstack((bonded.constraint_modes(), shapes, rest[:, None])),
                     la.block_diag(bonded.contact_stiffness(), np.diag(diagonal)))
