"""MUMPS by the raw interface of python-mumps, which alone shows the signs of its pivots."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

__all__ = ["mumps_instance", "run_mumps"]

# Ordering by METIS; what MUMPS says goes nowhere.
_METIS = 5
# Room beyond the estimate [%], and how often it may grow to double.
_ROOM, _GROWTH = 30, 6
# Errors of MUMPS: a matrix that is singular, by numbers or by structure; work space too small.
_SINGULAR, _SMALL = (-10, -6), (-8, -9, -11, -12, -14, -15, -17, -19, -20)
_NO_MEMORY = -13


def mumps_instance(lower: Any) -> tuple[Any, tuple[NDArray[Any], ...]]:
    """MUMPS with a triangle of a symmetric matrix, and the arrays that it goes on looking at."""
    from mumps import _mumps

    part = sp.coo_array(lower)
    kind = "z" if part.dtype.kind == "c" else "d"
    kept = (np.asfortranarray(part.row + 1, dtype=_mumps.int_dtype),
            np.asfortranarray(part.col + 1, dtype=_mumps.int_dtype),
            np.asfortranarray(part.data, dtype=complex if kind == "z" else float))
    instance = getattr(_mumps, f"{kind}mumps")(False, 2)
    instance.set_assembled_matrix(part.shape[0], *kept)
    instance.icntl[7], instance.icntl[14] = _METIS, _ROOM
    return instance, kept


def run_mumps(instance: Any, job: int, failure: type[Exception]) -> str:
    """One phase of MUMPS, with more room as often as it asks; 'singular' where the matrix is."""
    for _ in range(_GROWTH):
        instance.job = job
        instance.call()
        said = int(instance.infog[1])
        if said >= 0:
            return ""
        if said in _SINGULAR:
            return "singular"
        if said not in _SMALL:
            break
        instance.icntl[14] = 2 * instance.icntl[14]
    if said == _NO_MEMORY or said in _SMALL:
        raise failure("MUMPS found no room for the factors; take --factor cholmod or superlu, or "
                      "a coarser mesh away from the contact")
    raise failure(f"MUMPS ended with INFOG(1) = {said}, INFOG(2) = {int(instance.infog[2])}; take "
                  "--factor cholmod or superlu")
