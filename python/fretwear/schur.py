"""Contact compliances without a solution, by the Schur complement of MUMPS.

In `[K_a B^T; B 0]` the multipliers are the variables that elimination leaves: what stands there in
the end is -B K_a^-1 B^T. With the complex symmetric `K_a - i h A` in place of K_a and h tiny, the
imaginary part holds h B K_a^-1 A K_a^-1 B^T, to all digits: the step in the complex plane takes no
difference of near numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ._mumps import mumps_instance, run_mumps
from .errors import InputError
from .factors import check_room

__all__ = ["STEP", "contact_compliances"]

Floats = NDArray[Any]

#: The step, as a share of the ratio of the mean diagonals: h^2 is nothing beside 1, and h is far
#: above what would vanish in the matrix. 1e-12 to 1e-18 give the same.
STEP = 1e-14


def contact_compliances(stiffness: sp.csc_matrix, contact: sp.csr_array,
                        matrix: sp.csr_array | None = None,
                        step: float = STEP) -> tuple[Floats, Floats | None]:
    """B K_a^-1 B^T, and B K_a^-1 A K_a^-1 B^T where a matrix A is given; all real symmetric.

    Parameters
    ----------
    stiffness : (n, n) sparse
        K_a, positive definite: whoever factors it for solutions sees whether it is.
    contact : (n_r, n) sparse
        Rows of B.
    matrix : (n, n) sparse, optional
        Mass, damping or any other symmetric matrix A.
    step : float
        Of the complex step, relative.

    Raises
    ------
    InputError
        K_a is singular; or the factors do not fit into the memory.
    """
    n, n_contact = stiffness.shape[0], contact.shape[0]
    if matrix is None or not matrix.nnz:
        upper, h = sp.tril(stiffness), 0.0
    else:
        h = step * float(np.abs(stiffness.diagonal()).mean() / np.abs(matrix.data).max())
        upper = sp.tril(stiffness) - 1j * h * sp.tril(matrix)
    saddle = sp.coo_array(sp.block_array([[upper, None], [contact, sp.csr_array(
        (n_contact, n_contact))]]))
    instance, kept = mumps_instance(saddle)
    del saddle, upper
    left = np.zeros((n_contact, n_contact), dtype=kept[-1].dtype)
    places = np.arange(n + 1, n + n_contact + 1, dtype=kept[0].dtype)
    instance.icntl[19], instance.icntl[31] = 1, 1
    instance.cntl[1] = 0.0
    instance.set_schur(left, places)
    for job in (1, 2):
        if run_mumps(instance, job, InputError) == "singular":
            raise InputError("the stiffness with its contact is singular")
        if job == 1:
            check_room(instance, f"{n_contact} contact coordinates of {n} degrees of freedom need")
    del instance
    whole = np.tril(left) + np.tril(left, -1).T   # one triangle comes back
    return -whole.real, None if h == 0.0 else -whole.imag / h
