"""Mesh of the sector with the displacement of its vertices in the reduced coordinates."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..mesh import RecoveryMesh
from ..reduction import ReducedSystem
from .contact import flank_facets
from .mesh import BLADE, DISK
from .model import FullModel, observed_rows, reduced_system

__all__ = ["VTK_ORDER", "cyclic_corners", "recovery_mesh"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Corners of scikit-fem's hexahedron in the order of VTK: round the bottom, then round the top.
VTK_ORDER = (7, 4, 1, 5, 6, 2, 0, 3)


def recovery_mesh(full: FullModel,
                  system: ReducedSystem | None = None) -> tuple[RecoveryMesh, Floats]:
    """Vertices and linear hexahedra of the sector, without the middle nodes of the elements.

    Returns
    -------
    RecoveryMesh
        Points [mm], both flanks of every pair as facets.
    (n_observed, n_dof) array
        Observation matrix of the same reduction, to tell whether a model file belongs to it.
    """
    reduction = (system or reduced_system(full)).reduction
    mesh = full.sector.mesh
    n_vertices = mesh.p.shape[1]
    # Degrees of freedom of the vertices come first in the numbering of the quadratic element.
    at_vertex = full.free < 3 * n_vertices
    rows = sp.csr_array((np.ones(int(at_vertex.sum())), (full.free[at_vertex],
                                                         np.flatnonzero(at_vertex))),
                        (3 * n_vertices, len(full.free)))
    basis = reduction.row(rows, np.float32)
    facets, pairs = zip(*(flank_facets(full.sector, full.parameters, body)
                          for body in (BLADE, DISK)), strict=True)
    corners = cyclic_corners(mesh.p.T, mesh.facets[:, np.concatenate(facets)].T)
    found = RecoveryMesh(mesh.p.T.copy(), mesh.t[list(VTK_ORDER)].T.copy(), full.sector.body,
                         corners, np.concatenate(pairs), basis)
    return found, reduction.row(observed_rows(full))


def cyclic_corners(points: Floats, facets: Ints) -> Ints:
    """Vertices of flat quadrilaterals (n, 4) sorted by the angle around their centre."""
    offset = points[facets] - points[facets].mean(axis=1, keepdims=True)
    first = offset[:, 0]
    normal = np.cross(first, offset[:, 1])
    second = np.cross(normal, first)
    second *= (np.linalg.norm(first, axis=1) / np.linalg.norm(second, axis=1))[:, None]
    angle = np.arctan2(np.einsum("nkc,nc->nk", offset, second),
                       np.einsum("nkc,nc->nk", offset, first))
    return np.take_along_axis(facets, np.argsort(angle, axis=1), axis=1)
