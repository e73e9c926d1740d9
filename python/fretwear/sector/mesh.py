"""Structured hexahedral mesh of the sector.

The cross-section (x, y) of both bodies is made of ruled blocks of quadrilaterals, extruded along
z; above the platform the extruded nodes are moved onto the twisted airfoil. Blade and disk share
no node: their grids coincide on the flanks, where the contact joins them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex1

from .parameters import Discretisation, Geometry, SectorParameters

__all__ = ["BLADE", "DISK", "HEX_CORNERS", "SectorMesh", "build_mesh"]

BLADE, DISK = 0, 1
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Corners of the quadrilateral (0..3, counter-clockwise from the local origin) and layer
# (0 below, 1 above) in the vertex order of scikit-fem's reference hexahedron.
HEX_CORNERS = ((2, 1), (2, 0), (1, 1), (3, 1), (1, 0), (3, 0), (0, 1), (0, 0))
_DECIMALS = 7  # nodes of neighbouring blocks agree to round-off (1e-13 mm); elements are > 0.1 mm


@dataclass(frozen=True)
class SectorMesh:
    """Mesh of blade and disk.

    Attributes
    ----------
    mesh : MeshHex1
        Vertices [mm] and hexahedra of both bodies.
    body : (n_elements,) int
        BLADE or DISK.
    """

    mesh: MeshHex1
    body: Ints


def build_mesh(parameters: SectorParameters) -> SectorMesh:
    """Mesh blade and disk sector."""
    geometry, disc = parameters.geometry, parameters.discretisation
    z = np.linspace(-0.5, 0.5, disc.n_axial + 1) * geometry.axial_length
    vertices, hexes, bodies = [], [], []
    offset = 0
    parts = {BLADE: _blade_blocks(geometry, disc), DISK: _disk_blocks(geometry, disc)}
    for body, blocks in parts.items():
        points, quads = _merge(blocks)
        xyz, cells = _extrude(points, quads, z)
        if body == BLADE:
            xyz = _shape_airfoil(xyz, geometry)
        vertices.append(xyz)
        hexes.append(cells + offset)
        bodies.append(np.full(len(cells), body))
        offset += len(xyz)
    mesh = MeshHex1(np.ascontiguousarray(np.vstack(vertices).T),
                    np.ascontiguousarray(np.vstack(hexes).T))
    return SectorMesh(mesh, np.concatenate(bodies))


def _polyline(corners: list[tuple[float, float]], counts: list[int]) -> Floats:
    """Points of a polyline with the given number of equal steps per leg, (sum(counts) + 1, 2)."""
    legs = [np.linspace(a, b, n, endpoint=False)
            for a, b, n in zip(corners[:-1], corners[1:], counts, strict=True)]
    return np.vstack([*legs, np.array(corners[-1:])])


def _ruled(first: Floats, last: Floats, n: int) -> Floats:
    """Grid between two edges, (len(edge), n + 1, 2)."""
    weight = np.linspace(0.0, 1.0, n + 1)[None, :, None]
    return (1.0 - weight) * first[:, None, :] + weight * last[:, None, :]


def _mirror(block: Floats) -> Floats:
    """Mirror image in x with the columns reversed, so that elements keep their orientation."""
    return block[:, ::-1] * np.array([-1.0, 1.0])


def _blade_blocks(g: Geometry, d: Discretisation) -> list[Floats]:
    """Blade: one stack from root bottom to tip, and the two overhangs of the platform."""
    profile = [
        (g.root_half_width - g.root_taper, g.root_radius), (g.root_half_width, g.flank_radius),
        (g.neck_half_width, g.flank_top_radius), (g.neck_half_width, g.platform_radius),
        (g.neck_half_width, g.airfoil_radius),
        (g.neck_half_width, g.airfoil_radius + g.fillet_height), (g.neck_half_width, g.tip_radius),
    ]
    rows = [d.root_rows, d.n_slope, d.neck_rows, d.platform_rows, 1, d.airfoil_rows]
    right = _polyline(profile, rows)
    stack = _ruled(right * np.array([-1.0, 1.0]), right, d.blade_columns)
    inner = _polyline(profile[3:5], [d.platform_rows])
    outer = np.column_stack((np.full(len(inner), g.platform_half_width), inner[:, 1]))
    wing = _ruled(inner, outer, d.wing_columns)
    return [stack, wing, _mirror(wing)]


def _disk_blocks(g: Geometry, d: Discretisation) -> list[Floats]:
    """Disk: the part under the slot and the two posts beside it, down to the inner face."""
    radii = [g.inner_radius, g.slot_radius, g.flank_radius, g.flank_top_radius, g.rim_radius]
    rows = [d.disk_rows, d.root_rows, d.n_slope, d.neck_rows]
    # The inner end of the post is narrower than the slot in proportion to the radius.
    angle = g.root_half_width / g.slot_radius
    slot = [
        (g.inner_radius * np.sin(angle), g.inner_radius * np.cos(angle)),
        (g.root_half_width, g.slot_radius), (g.root_half_width, g.flank_radius),
        (g.neck_half_width, g.flank_top_radius), (g.neck_half_width + g.neck_gap, g.rim_radius),
    ]
    cut = [(r * np.sin(g.half_pitch), r * np.cos(g.half_pitch)) for r in radii]
    post = _ruled(_polyline(slot, rows), _polyline(cut, rows), d.post_columns)
    theta = np.linspace(-angle, angle, d.slot_columns + 1)
    arc = g.inner_radius * np.column_stack((np.sin(theta), np.cos(theta)))
    flat = np.column_stack((np.linspace(-1, 1, len(theta)) * g.root_half_width,
                            np.full(len(theta), g.slot_radius)))
    below = _ruled(arc, flat, d.disk_rows).transpose(1, 0, 2)
    return [below, post, _mirror(post)]


def _merge(blocks: list[Floats]) -> tuple[Floats, Ints]:
    """Join blocks at coinciding points.

    Returns the points (n, 2) and the quadrilaterals (m, 4), corners counter-clockwise.
    """
    quads, offset = [], 0
    for block in blocks:
        n_rows, n_columns = block.shape[:2]
        number = np.arange(n_rows * n_columns).reshape(n_rows, n_columns) + offset
        quads.append(np.stack((number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]),
                              axis=-1).reshape(-1, 4))
        offset += number.size
    points = np.vstack([block.reshape(-1, 2) for block in blocks])
    _, first, inverse = np.unique(np.round(points, _DECIMALS) + 0.0, axis=0,
                                  return_index=True, return_inverse=True)
    return points[first], inverse.reshape(-1)[np.vstack(quads)]


def _extrude(points: Floats, quads: Ints, z: Floats) -> tuple[Floats, Ints]:
    """Sweep a cross-section along z: vertices (n * len(z), 3) and hexahedra (m * steps, 8)."""
    n = len(points)
    xyz = np.column_stack((np.tile(points, (len(z), 1)), np.repeat(z, n)))
    layer = np.column_stack([quads[:, corner] + n * up for corner, up in HEX_CORNERS])
    return xyz, np.vstack([layer + n * k for k in range(len(z) - 1)])


def _shape_airfoil(xyz: Floats, g: Geometry) -> Floats:
    """Move the nodes above the platform from the straight prism onto the airfoil."""
    out = xyz.copy()
    above = xyz[:, 1] > g.airfoil_radius + 1e-9
    x, y, z = xyz[above].T
    across, along = x / g.neck_half_width, z / (0.5 * g.axial_length)
    height = (y - g.airfoil_radius) / g.span
    chord = g.chord_root + (g.chord_tip - g.chord_root) * height
    thickness = g.thickness_root + (g.thickness_tip - g.thickness_root) * height
    stagger = np.radians(g.stagger_root + (g.stagger_tip - g.stagger_root) * height)
    bow = 1.0 - along**2
    # Sections are stacked on the mean of the camber line: the centrifugal load then bends little.
    normal = (g.camber * chord * (bow - 2.0 / 3.0)
              + 0.5 * across * thickness * (g.edge_thickness + (1.0 - g.edge_thickness) * bow))
    tangent = 0.5 * along * chord
    out[above, 0] = normal * np.cos(stagger) - tangent * np.sin(stagger)
    out[above, 2] = normal * np.sin(stagger) + tangent * np.cos(stagger)
    return out
