"""Contact coordinates, held faces and tip of the sector.

Contact coordinates are patch averages of the relative displacement (blade minus disk) in the
local frame of a flank: t1 up the slope in the cross-section, t2 along +z, n from the disk to the
blade. A blade pulled outwards has negative normal coordinates; positive ones open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .assembly import FacetMeans, facet_means
from .mesh import BLADE, DISK, SectorMesh
from .parameters import Geometry, SectorParameters

__all__ = ["FLANKS", "ContactRows", "Tip", "boundary_facets", "contact_rows", "flank_facets",
           "flank_frame", "held_nodes", "retention_row", "tip_rows"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Name and sign of x of the flanks; positive camber makes -x the pressure side of the airfoil.
FLANKS = (("intrados", -1.0), ("extrados", 1.0))
_ON_SURFACE = 1e-6  # [mm], far above round-off and far below any element


@dataclass(frozen=True)
class ContactRows:
    """Contact pairs in the order flank, slope (upwards), axis (along +z).

    Attributes
    ----------
    matrix : (3 n_pairs, 3 n_nodes) sparse
        B: contact coordinates u_r = B u, three per pair (t1, t2, n).
    blade : (3 n_pairs, 3 n_nodes) sparse
        The part of B that acts on the blade.
    area : (n_pairs,)
        Patch areas [mm^2].
    position : (n_pairs, 3)
        Patch centroids [mm].
    frame : (n_pairs, 3, 3)
        Rows t1, t2, n.
    patch : list of str
        Flank of each pair.
    """

    matrix: sp.csr_array
    blade: sp.csr_array
    area: Floats
    position: Floats
    frame: Floats
    patch: list[str]


@dataclass(frozen=True)
class Tip:
    """Averages over the tip face.

    Attributes
    ----------
    mean : (3, 3 n_nodes) sparse
        Mean displacement in x, y, z.
    direction : (3,)
        Unit vector normal to the chord of the tip section.
    normal : (3 n_nodes,)
        Row of the displacement in that direction; as a column, the unit force [N].
    """

    mean: sp.csr_array
    direction: Floats
    normal: Floats


def flank_frame(geometry: Geometry, side: float) -> Floats:
    """Local frame of the flank at the given sign of x: rows t1, t2, n, (3, 3)."""
    c, s = np.cos(geometry.slope), np.sin(geometry.slope)
    return np.array([[-side * c, s, 0.0], [0.0, 0.0, 1.0], [-side * s, -c, 0.0]])


def contact_rows(sector: SectorMesh, parameters: SectorParameters) -> ContactRows:
    """Build the contact coordinates of both flanks."""
    n_pairs = parameters.discretisation.n_pairs
    blade = _body_means(sector, parameters, BLADE)
    disk = _body_means(sector, parameters, DISK)
    frame = np.repeat([flank_frame(parameters.geometry, side) for _, side in FLANKS],
                      n_pairs // 2, axis=0)
    # Block-diagonal frames times (pair averages per component) give the local coordinates.
    rotate = sp.block_diag(list(frame), format="csr")
    blade_rows = sp.csr_array(rotate @ sp.kron(blade.rows, sp.identity(3)))
    disk_rows = sp.csr_array(rotate @ sp.kron(disk.rows, sp.identity(3)))
    names = [name for name, _ in FLANKS for _ in range(n_pairs // 2)]
    return ContactRows(sp.csr_array(blade_rows - disk_rows), blade_rows, blade.area,
                       blade.centroid, frame, names)


def flank_facets(sector: SectorMesh, parameters: SectorParameters, body: int) -> tuple[Ints, Ints]:
    """Facets on the flanks of one body and the pair (from 0) to which each belongs."""
    g, d = parameters.geometry, parameters.discretisation
    facets, centre = boundary_facets(sector, body)
    per_flank = d.axial_patches * d.slope_patches
    found, pairs = [], []
    for number, (_, side) in enumerate(FLANKS):
        up, _, normal = flank_frame(g, side)
        offset = centre - np.array([side * g.root_half_width, g.flank_radius, 0.0])
        along = offset @ up / g.flank_length
        on_flank = (np.abs(offset @ normal) < _ON_SURFACE) & (along > 0) & (along < 1)
        row = np.floor(along[on_flank] * d.slope_patches).astype(np.int64)
        column = np.floor((centre[on_flank, 2] / g.axial_length + 0.5) * d.axial_patches)
        found.append(facets[on_flank])
        pairs.append(number * per_flank + row * d.axial_patches + column.astype(np.int64))
    return np.concatenate(found), np.concatenate(pairs)


def _body_means(sector: SectorMesh, parameters: SectorParameters, body: int) -> FacetMeans:
    """Patch averages on the flanks of one body."""
    facets, pairs = flank_facets(sector, parameters, body)
    return facet_means(sector.mesh, facets, pairs, parameters.discretisation.n_pairs)


def boundary_facets(sector: SectorMesh, body: int) -> tuple[Ints, Floats]:
    """Boundary facets of one body and their centres (n, 3)."""
    mesh = sector.mesh
    facets = mesh.boundary_facets()
    facets = facets[sector.body[mesh.f2t[0, facets]] == body]
    return facets, mesh.p[:, mesh.facets[:, facets]].mean(axis=1).T


def held_nodes(nodes: Floats, geometry: Geometry) -> NDArray[np.bool_]:
    """Nodes on both cut faces and on the inner face of the disk sector, (n_nodes,)."""
    x, y = np.abs(nodes[0]), nodes[1]
    cut = np.abs(x * np.cos(geometry.half_pitch) - y * np.sin(geometry.half_pitch)) < _ON_SURFACE
    cut &= y < geometry.rim_radius + _ON_SURFACE
    # The inner face is faceted: its chords lie inside the arc by their sagitta at most.
    inner = np.hypot(nodes[0], y) < geometry.inner_radius + _ON_SURFACE
    return cut | inner


def retention_row(sector: SectorMesh, geometry: Geometry) -> sp.csr_array:
    """Axial displacement of the root relative to the disk, (1, 3 n_nodes).

    The mean over the bottom of the root minus the mean over the bottom of the slot: where a lock
    plate sits.
    """
    axial = np.array([[0.0, 0.0, 1.0]])
    means = []
    for body, radius in ((BLADE, geometry.root_radius), (DISK, geometry.slot_radius)):
        facets, centre = boundary_facets(sector, body)
        facets = facets[np.abs(centre[:, 1] - radius) < _ON_SURFACE]
        means.append(facet_means(sector.mesh, facets, np.zeros(len(facets), dtype=np.int64), 1))
    return sp.csr_array(sp.kron(means[0].rows - means[1].rows, axial))


def tip_rows(sector: SectorMesh, geometry: Geometry) -> Tip:
    """Averages over the tip face and the unit force normal to the chord there."""
    facets, centre = boundary_facets(sector, BLADE)
    facets = facets[np.abs(centre[:, 1] - geometry.tip_radius) < _ON_SURFACE]
    average = facet_means(sector.mesh, facets, np.zeros(len(facets), dtype=np.int64), 1)
    mean = sp.csr_array(sp.kron(average.rows, sp.identity(3)))
    stagger = np.radians(geometry.stagger_tip)
    direction = np.array([np.cos(stagger), 0.0, np.sin(stagger)])
    return Tip(mean, direction, direction @ mean)
