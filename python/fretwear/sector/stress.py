"""Stress of a generated mesh at points, as rows on the coordinates of its reduced model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from skfem import Basis, ElementHex1, ElementHex2, MeshHex1

from ..reduction import Reduction
from ..stress import Stress
from .assembly import lame
from .parameters import Material

__all__ = ["StressPoints", "reduced_stress", "stress_points"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
#: Two of Gauss's points a direction, where the stress of triquadratic elements is best.
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
#: No vertex of the mesh.
_NO_POINT = -1


@dataclass(frozen=True)
class StressPoints:
    """Where the stress of a mesh is known, and how.

    Attributes
    ----------
    rows : (6 n_points, 3 n_nodes) sparse
        Components xx, yy, zz, xy, yz, zx of point 0, then of point 1, ... [N/mm^3].
    position : (n_points, 3)
        [mm].
    vertex : (n_points,) int
        Vertex of the mesh; -1 for the points inside of elements.
    """

    rows: sp.csr_array
    position: Floats
    vertex: Ints


def stress_points(mesh: MeshHex1, body: Ints, material: Material) -> StressPoints:
    """Stress at the 2 x 2 x 2 points of each triquadratic element, then at the vertices of each
    body: there the trilinear extension from these points, as the mean of the body's elements."""
    reference = np.stack(np.meshgrid(_GAUSS, _GAUSS, _GAUSS, indexing="ij"), axis=-1).reshape(-1, 3)
    basis = Basis(mesh, ElementHex2(), quadrature=(reference.T, np.full(8, 0.125)))
    n_cells, n_nodes = mesh.t.shape[1], basis.doflocs.shape[1]
    # (element, point, direction, node)
    slope = np.array([np.asarray(b[0].grad) for b in basis.basis]).transpose(2, 3, 1, 0)
    rows = _stress_of(slope, material)
    numbers = 3 * basis.element_dofs.T[:, None, None, :, None] + np.arange(3)
    numbers = np.broadcast_to(numbers, rows.shape)
    pointer = np.arange(0, rows.size + 1, numbers[0, 0, 0].size)
    inside = sp.csr_array((rows.ravel(), numbers.ravel(), pointer), (n_cells * 48, 3 * n_nodes))
    places = basis.mapping.F(reference.T).transpose(1, 2, 0).reshape(-1, 3)
    mean, vertex = _extension(mesh, body)
    spread = sp.csr_array(sp.kron(mean, sp.identity(6)))
    return StressPoints(
        sp.csr_array(sp.vstack([inside, spread @ inside])),
        np.vstack([places, mesh.p.T[vertex]]),
        np.concatenate((np.full(len(places), _NO_POINT), vertex)))


def reduced_stress(points: StressPoints, free: Ints, reduction: Reduction,
                   centrifugal: Floats) -> Stress:
    """The same on the coordinates of a reduction of the free degrees of freedom.

    What the modes leave of the static answer to the centrifugal load [N per (rad/s)^2] goes into
    the stress without motion: with everything else at rest it is then that of the mesh.
    """
    rows = sp.csr_array(points.rows[:, free])
    kept = len(reduction.stiffness) - reduction.shapes.shape[1]
    own = np.diag(reduction.stiffness)[kept:]
    left = reduction.bonded.solve(centrifugal) - reduction.shapes @ (
        reduction.shapes.T @ centrifugal / own)
    n_points = len(points.position)
    return Stress(reduction.row(rows).reshape(n_points, 6, -1),
                  static_rotation=(rows @ left).reshape(n_points, 6),
                  position=points.position, mesh_point=points.vertex)


def _stress_of(slope: Floats, material: Material) -> Floats:
    """(element, point, 6, node, 3) from gradients of shapes (element, point, 3, node)."""
    first, shear = lame(material)
    rows = np.zeros((*slope.shape[:2], 6, slope.shape[3], 3))
    for i in range(3):
        rows[:, :, :3, :, i] = first * slope[:, :, [i]]
        rows[:, :, i, :, i] += 2.0 * shear * slope[:, :, i]
        # xy, yz, zx
        j = (i + 1) % 3
        rows[:, :, 3 + i, :, i] = shear * slope[:, :, j]
        rows[:, :, 3 + i, :, j] = shear * slope[:, :, i]
    return rows


def _extension(mesh: MeshHex1, body: Ints) -> tuple[sp.csr_array, Ints]:
    """Means (n, 8 n_elements) of the extensions to vertices, and the vertices, body after body."""
    corner = ElementHex1().doflocs
    share = np.ones((8, 2, 2, 2))
    for k in range(3):
        along = np.stack((_GAUSS[1] - corner[:, k], corner[:, k] - _GAUSS[0]), axis=1)
        share *= np.expand_dims(along / (_GAUSS[1] - _GAUSS[0]), tuple(
            axis for axis in (1, 2, 3) if axis != k + 1))
    n_cells = mesh.t.shape[1]
    key = np.asarray(body)[None] * mesh.p.shape[1] + mesh.t
    found, place, count = np.unique(key.ravel(), return_inverse=True, return_counts=True)
    place = place.reshape(mesh.t.shape)
    rows = np.broadcast_to(place[:, :, None], (8, n_cells, 8))
    columns = np.broadcast_to(8 * np.arange(n_cells)[None, :, None] + np.arange(8), rows.shape)
    values = np.broadcast_to(share.reshape(8, 1, 8), rows.shape) / count[rows]
    mean = sp.csr_array((values.ravel(), (rows.ravel(), columns.ravel())),
                        (len(found), 8 * n_cells))
    return mean, found % mesh.p.shape[1]
