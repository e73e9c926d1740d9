"""Interfaces, shroud patches and points of the sector as rows on all degrees of freedom.

Interfaces and patches are in a frame that turns with their sector: what is `right` in one sector
is `left` in the next, turned by the pitch. Pairs: t1 along the radius, t2 along the face, n across
it, from the next sector to this one, so that positive opens.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..sector.assembly import Assembly
from .mesh import face_angle
from .parameters import DiskParameters, ParameterError

__all__ = ["Patches", "held_nodes", "interface_rows", "patch_rows", "point_row", "turn"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ON_SURFACE = 1e-6  # [mm], far above round-off and far below any element


@dataclass(frozen=True)
class Patches:
    """Patches of a shroud by radius and along the axis: of its face to the next sector, then of the
    other one.

    Attributes
    ----------
    rows : (2 * 3 n_patches, 3 n_nodes) sparse
        Displacements (t1, t2, n) of the right face, then of the left one.
    area : (n_patches,)
        [mm^2]
    position : (n_patches, 3)
        Of the right face [mm].
    """

    rows: sp.csr_array
    area: Floats
    position: Floats


def turn(angle: float) -> Floats:
    """Rotation about the axis of the disk by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def held_nodes(assembly: Assembly, parameters: DiskParameters) -> NDArray[np.bool_]:
    """Nodes on the inner face, which is clamped."""
    # The inner face is faceted: its chords lie inside of the arc.
    return np.hypot(*assembly.nodes[:2]) < parameters.inner_radius + _ON_SURFACE


def interface_rows(assembly: Assembly, parameters: DiskParameters) -> sp.csr_array:
    """Displacements of both cut faces of the disk: left ones, then right ones in the same order."""
    half = np.pi / parameters.n_sectors
    radius, angle = np.hypot(*assembly.nodes[:2]), np.arctan2(*assembly.nodes[1::-1])
    inside = ~held_nodes(assembly, parameters) & (radius < parameters.rim_radius + _ON_SURFACE)
    blocks = []
    for side in (-1.0, 1.0):
        nodes = np.flatnonzero(inside & (radius * np.abs(angle - side * half) < _ON_SURFACE))
        order = np.lexsort((np.round(assembly.nodes[2, nodes], 6), np.round(radius[nodes], 6)))
        frame = turn(0.0 if side < 0.0 else 2.0 * half)
        pick = sp.csr_array((np.ones(len(nodes)), (np.arange(len(nodes)), nodes[order])),
                            shape=(len(nodes), assembly.n_nodes))
        # Rows of the frame's axes on the Cartesian components of the sector.
        blocks.append(sp.kron(pick, frame.T))
    if blocks[0].shape != blocks[1].shape:
        raise ParameterError("DiskParameters: the cut faces of the disk do not have equal nodes")
    return sp.csr_array(sp.vstack(blocks))


def point_row(assembly: Assembly, parameters: DiskParameters, radius: float) -> sp.csr_array:
    """Circumferential displacement of the edge of the blade at z > 0, at a radius."""
    z = 0.5 * parameters.axial_length
    angle = np.tan(float(face_angle(parameters, radius))) * z / radius
    place = np.array([[radius * np.cos(angle)], [radius * np.sin(angle)], [z]])
    node = int(np.linalg.norm(assembly.nodes - place, axis=0).argmin())
    x, y = assembly.nodes[:2, node] / np.hypot(*assembly.nodes[:2, node])
    return sp.csr_array(([-y, x], ([0, 0], [3 * node, 3 * node + 1])),
                        shape=(1, 3 * assembly.n_nodes))


def patch_rows(assembly: Assembly, parameters: DiskParameters) -> Patches:
    """Displacements of the patches of both shroud faces, in the frames of the pairs."""
    p = parameters
    gamma = float(face_angle(p, p.tip_radius))
    sides = [_face(assembly, p, side) for side in (1.0, -1.0)]
    rows = []
    for (means, centre, _), pitch in zip(sides, (0.0, 2.0 * np.pi / p.n_sectors)):
        for k in range(p.n_patches):
            # The left face belongs to the next sector: seen from there it is turned back.
            where = turn(pitch) @ centre[k]
            radial = np.array([*where[:2], 0.0]) / np.hypot(*where[:2])
            around = np.array([-radial[1], radial[0], 0.0])
            axis = np.array([0.0, 0.0, 1.0])
            frame = np.stack((radial, np.sin(gamma) * around + np.cos(gamma) * axis,
                              -np.cos(gamma) * around + np.sin(gamma) * axis))
            rows.append(sp.kron(means[[k]], frame @ turn(pitch)))
    return Patches(sp.csr_array(sp.vstack(rows)), sides[0][2], sides[0][1])


def _face(assembly: Assembly, p: DiskParameters, side: float
          ) -> tuple[sp.csr_array, Floats, Floats]:
    """Rows (n_patches, n_nodes) of the patches of a shroud face, their centres and areas.

    Patches are equal parts of the face, and move as the mean of their nodes; a node on the border
    of several counts as a share in each. That leaves the moments of a pressure that is linear over
    the face nearly what they are, which means by area would lessen.
    """
    grid = _face_nodes(assembly, p, side)
    tall, wide = _shares(grid.shape[0], p.radial_patches), _shares(grid.shape[1], p.axial_patches)
    rows = sp.lil_array((p.n_patches, assembly.n_nodes))
    rows[:, grid.ravel()] = np.kron(tall, wide)
    return sp.csr_array(rows), rows @ assembly.nodes.T, np.full(
        p.n_patches, _face_area(assembly.nodes, grid) / p.n_patches)


def _shares(n_nodes: int, n_parts: int) -> Floats:
    """Weights (n_parts, n_nodes) of the nodes of a line in the means of its equal parts."""
    node, part = np.arange(n_nodes) * n_parts, np.arange(n_parts)[:, None] * (n_nodes - 1)
    inside = (part <= node) & (node <= part + n_nodes - 1)
    share = inside / inside.sum(axis=0)
    return share / share.sum(axis=1, keepdims=True)


def _face_area(nodes: Floats, grid: Ints) -> float:
    """Area between the vertices of the element faces, two triangles each."""
    corner = nodes[:, grid[::2, ::2]]
    across, back = corner[:, 1:, 1:] - corner[:, :-1, :-1], corner[:, 1:, :-1] - corner[:, :-1, 1:]
    return 0.5 * float(np.linalg.norm(np.cross(across, back, axis=0), axis=0).sum())


def _face_nodes(assembly: Assembly, p: DiskParameters, side: float) -> Ints:
    """Nodes of a shroud face, (3, 2 axial_layers + 1), by radius and along the axis."""
    x, y, z = assembly.nodes
    turned = np.arctan2(y, x) - side * np.pi / p.n_sectors
    radius = np.hypot(x, y)
    off = radius * turned - np.tan(face_angle(p, p.tip_radius)) * z
    # Edges of elements are chords of the twisted face.
    slack = 0.02 * p.axial_length / p.axial_layers
    found = np.flatnonzero((np.abs(off) < slack) & (radius > p.shroud_radius - slack))
    order = np.lexsort((z[found], np.round((radius[found] - p.shroud_radius)
                                           / (p.tip_radius - p.shroud_radius) * 2.0)))
    if len(found) != 3 * (2 * p.axial_layers + 1):
        raise ParameterError("DiskParameters: the shroud faces cannot be told from the rest; use "
                             "less twist or more axial_layers")
    return found[order].reshape(3, -1)
