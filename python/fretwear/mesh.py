"""The group `/mesh` of a model file: a mesh, and how its points move with the reduced coordinates.

See docs/files.md for its datasets.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import InputError

__all__ = ["CELL_TYPES", "RecoveryMesh", "mesh_datasets", "mesh_of_group"]

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]

#: Cells by their names in meshio: number of the type in VTK, corners.
CELL_TYPES = {"triangle": (5, 3), "quad": (9, 4), "tetra": (10, 4), "hexahedron": (12, 8),
              "wedge": (13, 6), "pyramid": (14, 5)}
_CORNERS = dict(CELL_TYPES.values())
_HEXAHEDRON = 12
#: Below the largest entry of a column; 2e-6 of it.
_BITS = 18


@dataclass(frozen=True)
class RecoveryMesh:
    """Mesh and the displacement of its points in the coordinates of a reduced model.

    Attributes
    ----------
    points : (n_points, 3)
        Positions [length].
    cells : (n_cells, 8) int
        Corners, points from 0 in the order of VTK; -1 behind the last one of a cell with fewer.
    body : (n_cells,) int
        Body of each cell.
    facets : (n_facets, 4) int
        Facets that carry contact, points in cyclic order.
    pair : (n_facets,) int
        Contact pair (from 0) of each facet.
    basis : (3 n_points, n_dof)
        Displacement x, y, z of point 0, then of point 1, ... per unit of each coordinate. A file
        keeps it to 2e-6 of the largest of a column.
    kind : (n_cells,) int, optional
        Number of the cell type in VTK; all are hexahedra without it.
    """

    points: Floats
    cells: Ints
    body: Ints
    facets: Ints
    pair: Ints
    basis: Floats
    kind: Ints | None = None

    def blocks(self) -> list[tuple[str, Ints]]:
        """Cells of one type each: its name in meshio, and which cells are of it."""
        if self.kind is None:
            return [("hexahedron", np.arange(len(self.cells)))]
        found = ((name, np.flatnonzero(self.kind == kind))
                 for name, (kind, _) in CELL_TYPES.items())
        return [(name, which) for name, which in found if len(which)]

    def corners(self, which: Ints, name: str) -> Ints:
        """Corners of cells of one type."""
        return self.cells[which, :CELL_TYPES[name][1]]


def mesh_datasets(mesh: RecoveryMesh) -> dict[str, NDArray[Any]]:
    """Datasets of the group `/mesh` by their names in a model file."""
    found: dict[str, NDArray[Any]] = {}
    found["mesh/points"] = np.asarray(mesh.points, dtype=np.float32)
    found["mesh/basis"] = _packable(np.asarray(mesh.basis, dtype=np.float32))
    for name in ("cells", "body", "facets", "pair"):
        found[f"mesh/{name}"] = np.asarray(getattr(mesh, name), dtype=np.int32)
    if mesh.kind is not None and (mesh.kind != _HEXAHEDRON).any():
        found["mesh/kind"] = np.asarray(mesh.kind, dtype=np.int32)
    return found


def _packable(basis: NDArray[np.float32]) -> NDArray[np.float32]:
    """The basis without bits that pictures do not show, which packs to half."""
    largest = np.abs(basis).max(axis=0, initial=0.0)
    step = np.exp2(np.floor(np.log2(np.where(largest > 0.0, largest, 1.0))) - _BITS)
    return (np.round(basis / step) * step).astype(np.float32)


def mesh_of_group(group: h5py.Group, path: Path, n_dof: int) -> RecoveryMesh:
    """The mesh of a model file; raises InputError where its datasets do not fit each other."""
    arrays = {}
    for name in ("points", "cells", "body", "facets", "pair", "basis"):
        if name not in group:
            raise InputError(f"{path}: holds no dataset /mesh/{name}")
        arrays[name] = group[name][()]
    if "kind" in group:
        arrays["kind"] = group["kind"][()]
    n_points, n_cells = len(arrays["points"]), len(arrays["cells"])
    shapes = {"points": (n_points, 3), "basis": (3 * n_points, n_dof),
              "cells": (n_cells, 8), "body": (n_cells,), "kind": (n_cells,),
              "facets": (len(arrays["facets"]), 4), "pair": (len(arrays["facets"]),)}
    for name, array in arrays.items():
        if array.shape != shapes[name]:
            raise InputError(f"{path}: dataset /mesh/{name} has shape {array.shape}, "
                             f"expected {shapes[name]}")
    unknown = sorted(set(arrays.get("kind", np.zeros(0)).tolist()) - _CORNERS.keys())
    if unknown:
        raise InputError(f"{path}: dataset /mesh/kind holds {unknown[0]}; known types of VTK are "
                         + ", ".join(f"{kind} ({name})" for name, (kind, _) in CELL_TYPES.items()))
    mesh = RecoveryMesh(**arrays)
    named = {"cells": [mesh.corners(which, name) for name, which in mesh.blocks()],
             "facets": [mesh.facets]}
    for name, lists in named.items():
        if any(part.size and not 0 <= part.min() <= part.max() < n_points for part in lists):
            raise InputError(f"{path}: dataset /mesh/{name} names points that do not exist")
    return mesh
