"""Checks of array arguments: what is wrong is said with the name of the argument."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from .errors import InputError

__all__ = ["array", "dofs", "flag", "output", "text", "whole"]

#: Largest integer that the library takes.
_MOST = 2**31 - 1


def array(name: str, value: ArrayLike, shape: Sequence[int | None], *,
          dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """A finite, Fortran-ordered array; `value` itself where it is one already.

    Parameters
    ----------
    name : str
        Name of the argument, for messages.
    value : array_like
        Numbers; sparse matrices of SciPy become dense. A scalar is taken for every element of a
        vector of known length.
    shape : sequence of int or None
        Wanted shape; None where any length will do.
    dtype : dtype
        float64 or complex128.
    """
    plain: Any = value
    # Who gives a sparse matrix has loaded scipy already, which nobody else shall wait for.
    sparse: Any = sys.modules.get("scipy.sparse")
    given = np.asarray(plain.toarray() if sparse is not None and sparse.issparse(plain) else plain)
    wanted = np.dtype(dtype)
    if given.dtype.kind not in ("iufc" if wanted.kind == "c" else "iuf"):
        raise InputError(f"{name}: its elements are of type {given.dtype}, must be "
                         f"{'complex' if wanted.kind == 'c' else 'real'} numbers")
    if given.ndim == 0 and len(shape) == 1 and shape[0] is not None:
        given = np.full(shape[0], given[()])
    _check_shape(name, given, shape)
    if not np.isfinite(given).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(given))[0])
        raise InputError(f"{name}{list(where)} = {given[where]}: must be finite")
    return np.asarray(given, dtype=wanted, order="F")


def dofs(name: str, value: ArrayLike, shape: Sequence[int | None], n_dof: int) -> NDArray[np.int32]:
    """Signed dof numbers, 0 for the ground, C-ordered."""
    given = np.asarray(value)
    if given.dtype.kind not in "iu":
        raise InputError(f"{name}: its elements are of type {given.dtype}, must be integers "
                         "(signed dof numbers, counted from 1; 0 for the ground)")
    _check_shape(name, given, shape)
    wrong = np.argwhere((given > n_dof) | (given < -n_dof))
    if len(wrong):
        where = tuple(int(i) for i in wrong[0])
        raise InputError(f"{name}{list(where)} = {given[where]}: must be a dof from 1 to {n_dof}, "
                         "with its sign, or 0 for the ground")
    return np.ascontiguousarray(given, dtype=np.int32)


def whole(name: str, value: int, least: int, most: int = _MOST) -> int:
    """An integer of Python, from `least` to `most`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not (
            least <= value <= most):
        wanted = f"from {least} to {most}" if most < _MOST else f"of at least {least}"
        raise InputError(f"{name} = {value!r}: must be an integer {wanted}")
    return int(value)


def flag(name: str, value: bool) -> bool:
    """A truth value; anything else that Python takes for one is more likely a mistake."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{name}: is a {type(value).__name__}, must be True or False")
    return bool(value)


def text(name: str, value: str) -> str:
    """A text without the character that ends one in C."""
    if not isinstance(value, str):
        raise InputError(f"{name}: is a {type(value).__name__}, must be a text")
    if "\0" in value:
        raise InputError(f"{name}: must not hold a null character")
    return value


def output(name: str, value: NDArray[Any] | None, shape: tuple[int, ...],
           dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """A Fortran-ordered array to write into: a new one, or the one given, which must fit."""
    if value is None:
        return np.zeros(shape, dtype=dtype, order="F")
    if not isinstance(value, np.ndarray) or value.dtype != dtype:
        kind = value.dtype if isinstance(value, np.ndarray) else type(value).__name__
        raise InputError(f"{name}: is of type {kind}, must be an array of {np.dtype(dtype)}")
    _check_shape(name, value, shape)
    if not value.flags.f_contiguous or not value.flags.writeable:
        raise InputError(f"{name}: must be a writable, Fortran-ordered array, such as "
                         f"np.empty({shape}, order='F')")
    return value


def _check_shape(name: str, given: NDArray[Any], shape: Sequence[int | None]) -> None:
    fits = given.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, given.shape))
    if not fits:
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise InputError(f"{name}: its shape is {given.shape}, must be "
                         f"({wanted}{',' if len(shape) == 1 else ''})")
