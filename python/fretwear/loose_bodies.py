"""Bodies that no spring holds, as a model file has them (group /body)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array, dofs
from .errors import InputError
from .model_file import strings

__all__ = ["Bodies", "read_bodies"]

#: Parts that runs do not need.
OF_PICTURES = ("body/point", "body/pair", "body/of_point")


@dataclass(frozen=True)
class Bodies:
    """Rigid bodies, or those of matrices, that only their contact holds.

    The matrices of the model hold neither their mass nor the load that rotation makes of it: a run
    adds ``mass * unit_mass`` and ``mass * radius * rotation_speed**2 * direction``.

    Parameters
    ----------
    name : sequence of str
        One each.
    mass : (n_bodies,)
        [mass]
    dof : (n_bodies, 6) int
        Their dofs x, y, z and rotations, counted from 1; 0 for none.
    unit_mass : (n_bodies, 6, 6)
        Mass matrix of each for a unit of mass.
    radius : (n_bodies,), optional
        Of the centre of mass [length]; 0 by default.
    direction : (n_bodies, 3), optional
        Outwards, of length 1.
    point : (n_points, 3), optional
        Places of contact from the centre of mass, for pictures.
    pair, of_point : (n_points,) int, optional
        The pair and the body of each point, counted from 0.
    """

    name: Sequence[str]
    mass: ArrayLike
    dof: ArrayLike
    unit_mass: ArrayLike
    radius: ArrayLike | None = None
    direction: ArrayLike | None = None
    point: ArrayLike | None = None
    pair: ArrayLike | None = None
    of_point: ArrayLike | None = None

    def checked(self, n_dof: int) -> Bodies:
        """The same with arrays that fit each other; raises InputError where they do not."""
        if isinstance(self.name, str):
            raise InputError("bodies.name: is a text, must be a sequence of them")
        n = len(self.name)
        dof = dofs("bodies.dof", self.dof, (n, 6), n_dof)
        if (dof < 0).any():
            raise InputError("bodies.dof: has a negative number, must be dofs or 0")
        values: dict[str, Any] = {}
        if self.point is not None:
            values["point"] = array("bodies.point", self.point, (None, 3))
            for key in ("pair", "of_point"):
                values[key] = np.asarray(getattr(self, key), dtype=np.int32)
                if values[key].shape != (len(values["point"]),):
                    raise InputError(f"bodies.{key}: must be one number for each point")
        return Bodies(
            tuple(str(name) for name in self.name), array("bodies.mass", self.mass, (n,)), dof,
            np.ascontiguousarray(array("bodies.unit_mass", self.unit_mass, (n, 6, 6))),
            np.zeros(n) if self.radius is None else array("bodies.radius", self.radius, (n,)),
            np.zeros((n, 3)) if self.direction is None else
            np.ascontiguousarray(array("bodies.direction", self.direction, (n, 3))), **values)

    def datasets(self) -> dict[str, NDArray[Any]]:
        """The parts of a model file."""
        return {"body/name": strings(self.name)} | {
            f"body/{key}": np.asarray(value) for key in (
                "mass", "radius", "direction", "dof", "unit_mass", "point", "pair", "of_point")
            if (value := getattr(self, key)) is not None}

    def joined(self, other: Bodies) -> Bodies:
        """These, then others."""
        def both(key: str, shift: int = 0) -> Any:
            first, second = getattr(self, key), getattr(other, key)
            return np.concatenate([first, np.asarray(second) + shift])
        values = {key: both(key) for key in ("mass", "dof", "unit_mass", "radius", "direction",
                                             "point", "pair")}
        return Bodies(tuple(self.name) + tuple(other.name), **values,
                      of_point=both("of_point", len(self.name)))


def read_bodies(file: h5py.File | Mapping[str, Any]) -> Bodies | None:
    """The bodies of a model file; None where it has none."""
    if "body" not in file:
        return None
    group = file["body"]
    for key in ("name", "mass", "dof", "unit_mass"):
        if key not in group:
            raise InputError(f"dataset /body/{key} is missing")
    found = {key: group[key][()] for key in (
        "mass", "dof", "unit_mass", "radius", "direction", "point", "pair", "of_point")
        if key in group}
    names = [name.decode() if isinstance(name, bytes) else str(name) for name in group["name"][()]]
    return Bodies(names, **found)
