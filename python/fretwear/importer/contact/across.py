"""Contact pairs with a surface of the neighbouring sector, which is turned before it is projected.

Sector numbers grow as the left cut face is turned onto the right one. A node of sector s moves by
R**s u, with u along the axes of its own sector and R the rotation from a sector to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...errors import InputError
from ...surfaces import Surface, SurfacePairs

__all__ = ["Facing", "facing_neighbour"]

Floats = NDArray[np.float64]
#: Sectors that touch a sector, and how messages call them.
_NEIGHBOURS = {1: "the next sector", -1: "the previous sector"}
#: A surface is at its place when it is turned out of its plane by no more.
_IN_PLANE = 1e-9


@dataclass(frozen=True)
class Facing:
    """Pairs of two surfaces, with the displacements of both by the nodes of one sector.

    Attributes
    ----------
    pairs : SurfacePairs
        Areas, gaps, directions and places, in the axes of the sector of surface 1.
    rows_1, rows_2 : (d n_pairs, d n_points) sparse
        Relative displacements are rows_1 u - rows_2 u', with u' the displacements of sector
        `sector`, along its own axes.
    sector : int
        Of surface 2, counted from that of surface 1.
    """

    pairs: SurfacePairs
    rows_1: sp.csr_array
    rows_2: sp.csr_array
    sector: int


def facing_neighbour(one: Surface, two: Surface, turn: Floats,
                     make: Callable[[Surface, Surface], SurfacePairs]) -> Facing:
    """Pairs of a surface with that of the next sector or of the previous one, whichever is nearer.

    Parameters
    ----------
    one, two : Surface
        Of the mesh of one sector.
    turn : (3, 3)
        Rotation from a sector to the next.
    make : callable
        Pairs of two surfaces of one mesh.
    """
    d = one.points.shape[1]
    if d == 2 and abs(turn[2, 2] - 1.0) > _IN_PLANE:
        raise InputError(f"{one.name} and {two.name}: a plane mesh turns about z; give --axis z or "
                         "-z, or a mesh of solids")
    rotation = {1: turn[:d, :d], -1: turn[:d, :d].T}
    sector = min(rotation, key=lambda s: (_distance(one, two, rotation[s]), -s))
    # Both sectors as one mesh: the nodes of this one, then those of the neighbour.
    n = len(one.points)
    points = np.vstack((one.points, one.points @ rotation[sector].T))
    pairs = make(_moved(one, points, 0, one.name),
                 _moved(two, points, n, f"{two.name} of {_NEIGHBOURS[sector]}"))
    rows = sp.csr_array(pairs.matrix)
    own = sp.kron(sp.identity(n), rotation[sector], format="csr")
    return Facing(pairs, sp.csr_array(rows[:, :d * n]),
                  sp.csr_array(-rows[:, d * n:] @ own), sector)


def _distance(one: Surface, two: Surface, rotation: Floats) -> float:
    """Median distance of the corners of a surface from the other one, when that is turned."""
    there = two.points[two.corners()] @ rotation.T
    return float(np.median(cKDTree(there).query(one.points[one.corners()])[0]))


def _moved(surface: Surface, points: Floats, first: int, name: str) -> Surface:
    """The faces of a surface in another mesh, where its nodes stand from `first` on."""
    faces: dict[str, list[list[int]]] = {}
    for kind, nodes in zip(surface.kind, surface.nodes):
        faces.setdefault(kind, []).append((nodes[nodes >= 0] + first).tolist())
    return Surface(points, {kind: np.array(table, dtype=np.int64)
                            for kind, table in faces.items()}, name)
