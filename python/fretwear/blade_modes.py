"""Modes of a blade alone, held where it stands, and its matrices where only those of all are known.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray

__all__ = ["held_modes", "mode_rows"]

Floats = NDArray[np.float64]


def held_modes(stiffness: sp.csr_array, mass: sp.csr_array, inside: NDArray[Any],
               n_modes: int) -> tuple[Floats, Floats]:
    """Lowest modes of some degrees of freedom with all others held.

    Parameters
    ----------
    stiffness, mass : (n, n) sparse
        Of the structure.
    inside : (n_inside,) int
        Degrees of freedom that move, from 0.
    n_modes : int
        Fewer than these.

    Returns
    -------
    squares : (n_modes,)
        Eigenvalues, ascending [rad^2/s^2].
    shapes : (n_inside, n_modes)
        Of mass 1; the largest entry of each is positive.
    """
    own, inert = (sp.csc_matrix(matrix[inside][:, inside]) for matrix in (stiffness, mass))
    # A fixed start: the same modes every time.
    start = 1.0 + np.cos(np.arange(len(inside)) ** 1.1)
    squares, shapes = spl.eigsh(own, n_modes, inert, sigma=0.0, v0=start)
    order = np.argsort(squares)
    squares, shapes = squares[order], shapes[:, order]
    shapes *= np.sign(shapes[np.abs(shapes).argmax(axis=0), np.arange(n_modes)])
    return squares, shapes


def mode_rows(stiffness: sp.csr_array, inside: NDArray[Any], squares: Floats,
              shapes: Floats) -> sp.csr_array:
    """Rows Lambda^-1 Phi^T [K_bb K_br] of the motion of modes on all degrees of freedom."""
    return sp.csr_array((stiffness[inside].T @ shapes / squares).T)
