"""The group `/mesh` of a model file: a mesh, and how its points move with the reduced coordinates.

See docs/user-guide.md for its datasets.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import InputError

__all__ = ["RecoveryMesh", "mesh_datasets", "mesh_of_group"]

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]

#: Vertices of a hexahedron and of a flank facet.
_CORNERS = {"cells": 8, "facets": 4}


@dataclass(frozen=True)
class RecoveryMesh:
    """Mesh and the displacement of its points in the coordinates of a reduced model.

    Attributes
    ----------
    points : (n_points, 3)
        Positions [length].
    cells : (n_cells, 8) int
        Hexahedra, points from 0 in the order of VTK.
    body : (n_cells,) int
        Body of each cell.
    facets : (n_facets, 4) int
        Facets that carry contact, points in cyclic order.
    pair : (n_facets,) int
        Contact pair (from 0) of each facet.
    basis : (3 n_points, n_dof)
        Displacement x, y, z of point 0, then of point 1, ... per unit of each coordinate; single
        precision is enough for pictures.
    """

    points: Floats
    cells: Ints
    body: Ints
    facets: Ints
    pair: Ints
    basis: Floats


def mesh_datasets(mesh: RecoveryMesh) -> dict[str, NDArray[Any]]:
    """Datasets of the group `/mesh` by their names in a model file."""
    found: dict[str, NDArray[Any]] = {}
    for name in ("points", "basis"):
        found[f"mesh/{name}"] = np.asarray(getattr(mesh, name), dtype=np.float32)
    for name in ("cells", "body", "facets", "pair"):
        found[f"mesh/{name}"] = np.asarray(getattr(mesh, name), dtype=np.int32)
    return found


def mesh_of_group(group: h5py.Group, path: Path, n_dof: int) -> RecoveryMesh:
    """The mesh of a model file; raises InputError where its datasets do not fit each other."""
    arrays = {}
    for name in ("points", "cells", "body", "facets", "pair", "basis"):
        if name not in group:
            raise InputError(f"{path}: holds no dataset /mesh/{name}")
        arrays[name] = group[name][()]
    n_points = len(arrays["points"])
    shapes = {"points": (n_points, 3), "basis": (3 * n_points, n_dof),
              "cells": (len(arrays["cells"]), 8), "body": (len(arrays["cells"]),),
              "facets": (len(arrays["facets"]), 4), "pair": (len(arrays["facets"]),)}
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise InputError(f"{path}: dataset /mesh/{name} has shape {arrays[name].shape}, "
                             f"expected {shape}")
    for name in _CORNERS:
        if arrays[name].size and not 0 <= arrays[name].min() <= arrays[name].max() < n_points:
            raise InputError(f"{path}: dataset /mesh/{name} names points that do not exist")
    return RecoveryMesh(**arrays)
