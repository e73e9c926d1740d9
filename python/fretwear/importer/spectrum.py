"""What the spectrum of a model says: definiteness, rigid-body modes, frequencies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray

from ..errors import InputError
from ..factors import factor

__all__ = ["Spectrum", "lowest_modes", "negative_directions"]

Floats = NDArray[np.float64]

# Added to the diagonal before a factorization, as a share of it: far above round-off, far below
# what a coarse mesh can resolve.
_SHIFT = 1e-10
# Squares of frequencies below this share of the largest local one are zero: round-off of a fine
# mesh leaves 1e-16, its softest elastic modes some 1e-9.
_RIGID = 1e-13
# Models of this size and below are solved densely, which is exact and quick.
_DENSE = 400
N_LOWEST = 12


@dataclass(frozen=True)
class Spectrum:
    """Lowest modes of the structure with open contact.

    Attributes
    ----------
    frequency : (n_modes,)
        [Hz], ascending, without the rigid-body modes.
    rigid : (n, n_rigid)
        Shapes of zero frequency, of unit size.
    local : float
        Median over the degrees of freedom of sqrt(K_ii / M_ii) / 2 pi [Hz]: how fast one
        element swings.
    """

    frequency: Floats
    rigid: Floats
    local: float


def negative_directions(matrix: sp.csr_array, engine: str = "auto") -> int:
    """Number of negative eigenvalues of a symmetric matrix, by the signs of its pivots.

    Counts on the degrees of freedom with a diagonal entry; a diagonal shift of 1e-10 of each
    entry keeps the zero ones out (Sylvester's law of inertia).
    """
    diagonal = matrix.diagonal()
    used = np.flatnonzero(diagonal)
    shifted = sp.csc_matrix(matrix[used][:, used] + sp.diags_array(_SHIFT * np.abs(diagonal[used])))
    if not len(used):
        return 0
    # A common scale leaves the signs alone and keeps the pivots comparable.
    scale = sp.diags_array(1.0 / np.sqrt(np.abs(diagonal[used])))
    scaled = sp.csc_matrix(scale @ shifted @ scale)
    if len(used) <= _DENSE:
        return int((la.eigvalsh(scaled.toarray()) < 0.0).sum())
    try:
        factor(scaled, engine)
    except InputError:
        return int((_factors(scaled).U.diagonal() < 0.0).sum())
    return 0


def lowest_modes(mass: sp.csr_array, stiffness: sp.csr_array,
                 engine: str = "auto") -> Spectrum | None:
    """Lowest modes; None where the stiffness and the mass leave a motion without either."""
    local = _local_squares(mass, stiffness)
    if not len(local):
        return None
    n = stiffness.shape[0]
    shift = float(np.median(local)) * 1e-6
    shifted = sp.csc_matrix(stiffness + shift * mass)
    try:
        if n <= _DENSE:
            # Largest 1 / (omega^2 + shift): massless motions give zero.
            values, shapes = la.eigh(mass.toarray(), shifted.toarray())
            values, shapes = values[::-1], shapes[:, ::-1]
            count = min(N_LOWEST, int((values > 1e-14 * values[0]).sum()))
            values, shapes = values[:count], shapes[:, :count]
        else:
            try:
                factors = factor(shifted, engine)
            except InputError:
                factors = _factors(shifted)
            solve = spl.LinearOperator((n, n), matvec=factors.solve, dtype=np.float64)
            start = 1.0 + np.cos(np.arange(n) ** 1.1)
            found, shapes = spl.eigsh(shifted, k=N_LOWEST, M=mass, sigma=0.0, OPinv=solve,
                                      v0=factors.solve(mass @ start))
            order = np.argsort(found)
            values, shapes = 1.0 / found[order], shapes[:, order]
    except (la.LinAlgError, RuntimeError):
        return None
    squares = 1.0 / values - shift
    zero = squares < max(_RIGID * float(local.max()), 1e-6 * shift)
    rigid = shapes[:, zero]
    return Spectrum(np.sqrt(squares[~zero]) / (2.0 * np.pi),
                    rigid / np.linalg.norm(rigid, axis=0),
                    float(np.sqrt(np.median(local))) / (2.0 * np.pi))


def _local_squares(mass: sp.csr_array, stiffness: sp.csr_array) -> Floats:
    """K_ii / M_ii where both are positive [(rad/s)^2]."""
    m, k = mass.diagonal(), stiffness.diagonal()
    used = (m > 0.0) & (k > 0.0)
    return np.asarray(k[used] / m[used])


def _factors(matrix: sp.csc_matrix) -> Any:
    """Of a matrix that need not be definite: pivots on the diagonal, with their signs."""
    return spl.splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                    options={"SymmetricMode": True})
