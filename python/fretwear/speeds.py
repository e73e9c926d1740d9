"""Matrices of a model at several rotation speeds (group ``/speed`` of a model file)."""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ._arguments import array
from .errors import InputError

__all__ = ["read_speeds", "speed_datasets"]

#: As many as the library interpolates between.
_FEWEST, _MOST = 2, 4


def speed_datasets(speeds: Mapping[float, Any], n_dof: int) -> dict[str, NDArray[Any]]:
    """Datasets of a model file, by names such as ``speed/0/stiffness``.

    Parameters
    ----------
    speeds : mapping
        Rotation speed [rad/s] with the stiffness (n_dof, n_dof) there, or with a pair of it and of
        the static load (n_dof,) [force]; None in a pair for what is not given.

    Raises
    ------
    InputError
        Fewer than two speeds or more than four, a speed that is negative, or values of another
        shape.
    """
    if not isinstance(speeds, Mapping):
        raise InputError(f"speeds: is a {type(speeds).__name__}, must be a dictionary of speeds")
    if not _FEWEST <= len(speeds) <= _MOST:
        raise InputError(f"speeds: has {len(speeds)}, must have {_FEWEST} to {_MOST} speeds")
    values = array("speeds, their keys", sorted(speeds), (None,))
    if values[0] < 0.0:
        raise InputError(f"speeds: has {values[0]}, must be rad/s from 0 on")
    found: dict[str, NDArray[Any]] = {"speed/value": values}
    for number, speed in enumerate(sorted(speeds)):
        parts = speeds[speed]
        if not isinstance(parts, tuple):
            parts = (parts, None)
        if len(parts) != 2:
            raise InputError(f"speeds[{speed}]: has {len(parts)} parts, must be a stiffness, or a "
                             "pair of stiffness and static load")
        for name, value, shape in (("stiffness", parts[0], (n_dof, n_dof)),
                                   ("static", parts[1], (n_dof,))):
            if value is not None:
                found[f"speed/{number}/{name}"] = array(f"speeds[{speed}], {name}", value, shape)
    return found


def read_speeds(file: h5py.File) -> dict[float, Any] | None:
    """The speeds of a model file; None where it has none."""
    if "speed/value" not in file:
        return None
    return {float(speed): tuple(file[name][()] if name in file else None for name in (
        f"speed/{number}/stiffness", f"speed/{number}/static"))
        for number, speed in enumerate(np.atleast_1d(file["speed/value"][()]))}
