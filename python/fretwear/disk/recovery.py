"""Mesh of the sector with the displacement of its vertices in the reduced coordinates."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..mesh import RecoveryMesh
from ..sector.recovery import VTK_ORDER, cyclic_corners
from .mesh import SHROUD
from .model import FullDisk, reduced_system

__all__ = ["recovery_mesh"]

Floats = NDArray[np.float64]


def recovery_mesh(full: FullDisk) -> tuple[RecoveryMesh, Floats]:
    """Vertices and linear hexahedra of the sector; the shroud faces carry its pairs.

    An element layer of a shroud face is coloured by the pair in its middle.

    Returns
    -------
    RecoveryMesh
        Points [mm].
    (2, n_dof) array
        Rows of the tip and of the load point, to tell whether a model file belongs to it.
    """
    reduction = reduced_system(full).reduction
    mesh, p = full.sector.mesh, full.parameters
    n_vertices = mesh.p.shape[1]
    at_vertex = np.flatnonzero(full.free < 3 * n_vertices)
    basis = reduction.row(sp.csr_array(
        (np.ones(len(at_vertex)), (full.free[at_vertex], at_vertex)),
        (3 * n_vertices, len(full.free))))
    boundary = mesh.boundary_facets()
    boundary = boundary[full.sector.body[mesh.f2t[0, boundary]] == SHROUD]
    centre = mesh.p[:, mesh.facets[:, boundary]].mean(axis=1)
    section = np.arctan2(centre[1], centre[0])
    gamma = np.radians(p.twist)
    flat = np.abs(np.abs(section - np.tan(gamma) * centre[2] / np.hypot(*centre[:2]))
                  - np.pi / p.n_sectors) < 0.1 * np.radians(p.pitch_degrees) / p.side_columns
    facets = boundary[flat]
    share = (centre[2, flat] / p.axial_length + 0.5) * p.n_patches
    pair = np.clip(share.astype(np.int64), 0, p.n_patches - 1)
    found = RecoveryMesh(mesh.p.T.copy(), mesh.t[list(VTK_ORDER)].T.copy(), full.sector.body,
                         cyclic_corners(mesh.p.T, mesh.facets[:, facets].T), pair, basis)
    rows = full.rows[[-1, -2]].toarray()
    return found, reduction.row(rows)
