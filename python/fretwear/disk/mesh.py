"""Hexahedral mesh of one sector: a grid in (radius, angle, axis) with cells left out beside the
blade, twisted about the radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex1

from ..sector.mesh import HEX_CORNERS
from .parameters import DiskParameters

__all__ = ["BLADE", "DISK", "SHROUD", "DiskMesh", "build_mesh", "face_angle"]

DISK, BLADE, SHROUD = 0, 1, 2
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class DiskMesh:
    """Mesh of a sector.

    Attributes
    ----------
    mesh : MeshHex1
        Vertices [mm] and hexahedra.
    body : (n_elements,) int
        DISK, BLADE or SHROUD.
    """

    mesh: MeshHex1
    body: Ints


def face_angle(parameters: DiskParameters, radius: Floats | float) -> Floats:
    """Angle of a section from the axis [rad]: linear in the radius along the blade."""
    p = parameters
    share = (np.asarray(radius, dtype=float) - p.rim_radius) / (p.shroud_radius - p.rim_radius)
    return np.radians(p.twist) * np.clip(share, 0.0, 1.0)


def build_mesh(parameters: DiskParameters) -> DiskMesh:
    """Mesh the sector."""
    p = parameters
    radius = np.concatenate((
        np.linspace(p.inner_radius, p.rim_radius, p.disk_rows + 1),
        np.linspace(p.rim_radius, p.shroud_radius, p.blade_rows + 1)[1:], [p.tip_radius]))
    side = np.linspace(0.5 * p.blade_angle, 0.5 * p.pitch_degrees, p.side_columns + 1)
    angle = np.radians(np.concatenate((-side[::-1], side)))
    axis = np.linspace(-0.5, 0.5, p.axial_layers + 1) * p.axial_length
    r, theta, z = np.meshgrid(radius, angle, axis, indexing="ij")
    theta = theta + np.tan(face_angle(p, r)) * z / r
    points = np.stack((r * np.cos(theta), r * np.sin(theta), z), axis=-1).reshape(-1, 3)
    number = np.arange(r.size).reshape(r.shape)
    cells, bodies = [], []
    for i in range(len(radius) - 1):
        body = DISK if i < p.disk_rows else SHROUD if i == len(radius) - 2 else BLADE
        for j in range(len(angle) - 1):
            if body == BLADE and j != p.side_columns:
                continue
            corners = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
            cells += [[number[(*corners[c], k + up)] for c, up in HEX_CORNERS]
                      for k in range(len(axis) - 1)]
            bodies += [body] * (len(axis) - 1)
    used, place = np.unique(np.array(cells), return_inverse=True)
    mesh = MeshHex1(np.ascontiguousarray(points[used].T),
                    np.ascontiguousarray(place.reshape(-1, 8).T))
    return DiskMesh(mesh, np.array(bodies))
