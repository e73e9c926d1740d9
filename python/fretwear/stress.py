"""Rows that give the stress at points of a structure, and what the points endure."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array

__all__ = ["Stress", "read_stress"]

#: What pictures alone take: no part that a calculation is given.
OF_PICTURES = ("position", "mesh_point")
_SHAPES: dict[str, tuple[int | None, ...]] = {
    "static": (None, 6), "static_rotation": (None, 6), "endurance": (None,), "ultimate": (None,),
    "position": (None, 3), "mesh_point": (None,)}


@dataclass(frozen=True)
class Stress:
    """Stress of a structure at n_stress points: ``matrix @ u + static + speed**2 static_rotation``.

    Parameters
    ----------
    matrix : (n_stress, 6, n_dof)
        Components xx, yy, zz, xy, yz, zx for each dof [force/length^3].
    static, static_rotation : (n_stress, 6), optional
        Without motion [force/length^2], and for each (rad/s)^2 of the rotation speed.
    endurance, ultimate : (n_stress,), optional
        Alternating stress that is endured, static strength [force/length^2].
    position : (n_stress, 3), optional
        Coordinates, for pictures [length].
    mesh_point : (n_stress,) int, optional
        Points of the mesh, for pictures.

    Raises
    ------
    InputError
        A shape does not fit.
    """

    matrix: ArrayLike
    static: ArrayLike | None = None
    static_rotation: ArrayLike | None = None
    endurance: ArrayLike | None = None
    ultimate: ArrayLike | None = None
    position: ArrayLike | None = None
    mesh_point: ArrayLike | None = None

    def checked(self, n_dof: int) -> Stress:
        """The same with arrays."""
        found: dict[str, Any] = {
            "matrix": np.ascontiguousarray(array("stress.matrix", self.matrix, (None, 6, n_dof)))}
        n = len(found["matrix"])
        for name, shape in _SHAPES.items():
            if (value := getattr(self, name)) is not None:
                values = array(f"stress.{name}", value, (n, *shape[1:]))
                found[name] = np.ascontiguousarray(values)
        if "mesh_point" in found:
            found["mesh_point"] = found["mesh_point"].astype(np.int64)
        return Stress(**found)

    def datasets(self) -> dict[str, NDArray[Any]]:
        """As a model file has them."""
        return {f"stress/{field.name}": np.asarray(value) for field in fields(self)
                if (value := getattr(self, field.name)) is not None}


def read_stress(file: h5py.File) -> Stress | None:
    """The rows of a model file; None where it has none."""
    if "stress/matrix" not in file:
        return None
    return Stress(**{field.name: file[f"stress/{field.name}"][()] for field in fields(Stress)
                     if f"stress/{field.name}" in file})
