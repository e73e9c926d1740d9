"""Values as a namelist has them."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np

from .errors import InputError

__all__ = ["by_columns", "literal", "write_namelist"]

#: Matrices that need not be symmetric.
_ANY_SHAPE = ("circulatory", "stiffness_unsymmetric", "damping_unsymmetric")


def literal(value: object, name: str = "value") -> str:
    """A value in the syntax of a namelist, every digit kept.

    Parameters
    ----------
    value : str, path, bool, int, float, or sequence or array of these
        Matrices stand row by row; most are symmetric (`write_namelist` turns the others).
    name : str, optional
        What a message calls it.

    Raises
    ------
    InputError
        It is nothing that a namelist can hold.
    """
    if isinstance(value, np.generic):  # np.float64 is a float, but prints as an expression
        value = value.item()
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, (str, os.PathLike)):
        return "'" + os.fspath(value).replace("'", "''") + "'"
    if isinstance(value, (int, float)):
        return repr(value)
    if hasattr(value, "magnitude") and hasattr(value, "units"):  # a quantity of pint
        magnitude = np.ravel(value.magnitude).tolist()
        return literal([f"{number!r} {value.units}" for number in magnitude], name)
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "iufb":
            raise InputError(f"{name}: its elements are of type {value.dtype}, must be numbers")
        return literal(value.ravel().tolist(), name)
    if isinstance(value, (list, tuple)) and value:
        return ", ".join(literal(item, name) for item in value)
    raise InputError(f"{name}: is {value!r}, must be a text, a number, a truth value, or a list "
                     "or array of these")


def by_columns(key: str, value: object) -> object:
    """A namelist has arrays column by column, which shows in matrices of any shape."""
    if key.rpartition("%")[2].lower() not in _ANY_SHAPE or np.ndim(value) != 2:  # type: ignore[arg-type]
        return value
    return np.asarray(value).T


def write_namelist(groups: Mapping[str, Mapping[str, object]]) -> str:
    """The text of a namelist from its groups, such as ``{"case": {"analysis": "frf"}}``."""
    lines = []
    for group, keys in groups.items():
        lines.append(f"&{group}")
        lines += [f"   {key} = {literal(by_columns(key, value), f'{group}%{key}')}"
                  for key, value in keys.items()]
        lines.append("/")
    return "\n".join(lines) + "\n"
