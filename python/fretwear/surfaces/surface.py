"""Surfaces of a mesh: faces of elements with their nodes, and the flat facets they consist of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .shapes import CORNERS, NODES, corner_functions, shape_functions

__all__ = ["Facets", "Surface", "facets_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Nodes of the largest face.
_MOST = 8
#: Edges whose middle node is this share of their length off the middle are curved.
_CURVED = 1e-7
#: Parts of a curved face: corners in its local coordinates, the corner again where it has three.
_HALVES = {
    "triangle6": ([0, 3, 5, 5], [3, 1, 4, 4], [5, 4, 2, 2], [3, 4, 5, 5]),
    "quad8": ([0, 4, 7, 7], [4, 1, 5, 5], [5, 2, 6, 6], [6, 3, 7, 7], [4, 5, 6, 7]),
}
_LOCAL = {
    "triangle": [[0, 0], [1, 0], [0, 1]], "quad": [[-1, -1], [1, -1], [1, 1], [-1, 1]],
    "triangle6": [[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]],
    "quad8": [[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0]],
}


class Surface:
    """Faces of a mesh.

    Parameters
    ----------
    points : (n_points, 2 or 3)
        Positions of the nodes of the mesh [L]; plane ones have lines for faces.
    faces : mapping of str to (n, n_nodes) int
        Points (from 0) of faces by their kind in meshio: 'triangle', 'quad', 'triangle6', 'quad8',
        or of plane meshes 'line', 'line3'. They go round anticlockwise, seen from outside of the
        body; lines have the body on their left.
    name : str
        For messages.

    Raises
    ------
    InputError
        A face is of an unknown kind, has no area, is there twice, or names points that are not
        there.

    Attributes
    ----------
    kind : list of str
        Of each face.
    nodes : (n_faces, 8) int
        Points of each face; -1 behind the last one.
    """

    def __init__(self, points: ArrayLike, faces: Mapping[str, ArrayLike],
                 name: str = "surface") -> None:
        self.points: Floats = np.asarray(points, dtype=float)
        self.name = name
        self.kind: list[str] = []
        if self.points.ndim != 2 or self.points.shape[1] not in (2, 3):
            raise InputError(f"{name}: points have shape {self.points.shape}, must be "
                             "(n_points, 2 or 3)")
        self.is_plane = self.points.shape[1] == 2
        blocks = [np.zeros((0, _MOST), dtype=np.int64)]
        for kind, block in faces.items():
            if kind not in NODES or (kind in ("line", "line3")) != self.is_plane:
                known = [one for one in NODES if one.startswith("line") == self.is_plane]
                raise InputError(f"{name}: faces are of kind '{kind}', must be of "
                                 + ", ".join(known))
            table = np.asarray(block)
            if table.ndim != 2 or table.shape[1] != NODES[kind] or table.dtype.kind not in "iu":
                raise InputError(f"{name}: faces '{kind}' have shape {table.shape}, must be "
                                 f"(n, {NODES[kind]}) points, counted from 0")
            padded = np.full((len(table), _MOST), -1, dtype=np.int64)
            padded[:, :NODES[kind]] = table
            blocks.append(padded)
            self.kind += [kind] * len(table)
        self.nodes: Ints = np.concatenate(blocks)
        self._check()

    def __len__(self) -> int:
        return len(self.kind)

    def _check(self) -> None:
        if not len(self):
            raise InputError(f"{self.name}: has no faces")
        used = np.unique(self.nodes[self.nodes >= 0])
        if used.min() < 0 or used.max() >= len(self.points):
            raise InputError(f"{self.name}: names point {used.max()}, must be below "
                             f"{len(self.points)}")
        if not np.isfinite(self.points[used]).all():
            raise InputError(f"{self.name}: positions must be finite")
        seen: dict[tuple[int, ...], int] = {}
        for number, kind in enumerate(self.kind):
            key = tuple(sorted(self.nodes[number, :CORNERS[kind]].tolist()))
            if seen.setdefault(key, number) != number:
                raise InputError(f"{self.name}: faces {seen[key]} and {number} have the same "
                                 f"corners, points {', '.join(map(str, key))}; must be one face")

    def corners(self) -> Ints:
        """Points at corners of faces, ascending: those that carry pairs."""
        return np.unique(np.concatenate([self.nodes[k, :CORNERS[kind]]
                                         for k, kind in enumerate(self.kind)]))


@dataclass(frozen=True)
class Facets:
    """Flat parts of faces, each a triangle or a quadrilateral.

    A triangle has its last corner twice.

    Attributes
    ----------
    kind : (n_facets,) str
        Of the face that it is of: 'triangle', 'quad', 'triangle6' or 'quad8'.
    face : (n_facets,) int
        Number of that face.
    nodes : (n_facets, 8) int
        Its points.
    count : (n_facets,) int
        Corners.
    place : (n_facets, 4, 3)
        Positions of the corners.
    local : (n_facets, 4, 2)
        Their local coordinates in the face.
    centre, normal : (n_facets, 3)
        Of the plane through the middles of opposite edges; the normal points outwards.
    radius : (n_facets,)
        From the centre to the furthest corner.
    area : (n_facets,)
        In that plane.
    """

    kind: NDArray[Any]
    face: Ints
    nodes: Ints
    count: Ints
    place: Floats
    local: Floats
    centre: Floats
    normal: Floats
    radius: Floats
    area: Floats


def facets_of(surface: Surface, points: Floats, kinds: list[str], nodes: Ints) -> Facets:
    """Facets of the faces of a surface, given with their points in space."""
    rows: list[tuple[str, int, int]] = []
    local: list[Floats] = []
    for number, kind in enumerate(kinds):
        own = np.array(_LOCAL[kind], dtype=float)
        corners = CORNERS[kind]
        plain = [0, 1, 2, 2 if corners == 3 else 3]
        parts = _HALVES[kind] if _is_curved(points, kind, nodes[number]) else (plain,)
        for part in parts:
            rows.append((kind, number, 3 if part[2] == part[3] else 4))
            local.append(own[part])
    kind_of = np.array([row[0] for row in rows])
    face = np.array([row[1] for row in rows], dtype=np.int64)
    count = np.array([row[2] for row in rows], dtype=np.int64)
    where = np.array(local)
    place = _places(points, kind_of, nodes[face], where)
    centre = np.where((count == 3)[:, None], place[:, :3].mean(axis=1), place.mean(axis=1))
    # The cross product of the diagonals: twice the area, of triangles too.
    cross = 0.5 * np.cross(place[:, 2] - place[:, 0], place[:, 3] - place[:, 1])
    area = np.linalg.norm(cross, axis=1)
    radius = np.linalg.norm(place - centre[:, None], axis=2).max(axis=1)
    if (area <= 1e-12 * radius**2).any():
        bad = int(face[np.argmax(area <= 1e-12 * radius**2)])
        raise InputError(f"{surface.name}: face {bad} has no area; its points are "
                         + ", ".join(map(str, surface.nodes[bad][surface.nodes[bad] >= 0])))
    return Facets(kind_of, face, nodes[face], count, place, where, centre,
                  cross / area[:, None], radius, area)


def _is_curved(points: Floats, kind: str, nodes: Ints) -> bool:
    if kind not in _HALVES:
        return False
    n = CORNERS[kind]
    corner = points[nodes[:n]]
    after = np.roll(corner, -1, axis=0)
    off = points[nodes[n:2 * n]] - 0.5 * (corner + after)
    return bool((np.linalg.norm(off, axis=1) >
                 _CURVED * np.linalg.norm(after - corner, axis=1)).any())


def _places(points: Floats, kinds: NDArray[Any], nodes: Ints, local: Floats) -> Floats:
    """Positions (n, m, 3) of local coordinates (n, m, 2); curved edges by their middles."""
    place = np.zeros((*local.shape[:2], 3))
    for kind in np.unique(kinds):
        which = np.flatnonzero(kinds == kind)
        values = shape_functions(str(kind), local[which])
        place[which] = np.einsum("fmk,fki->fmi", values, points[nodes[which, :NODES[kind]]])
    return place


def bilinear(count: Ints, corners: Floats, at: Floats) -> Floats:
    """Values (n, m, k) in facets of their values at corners (n, 4, k), at own coordinates."""
    found = np.einsum("fmc,fck->fmk", corner_functions(4, at), corners)
    three = count == 3
    if three.any():
        found[three] = np.einsum("fmc,fck->fmk", corner_functions(3, at[three]),
                                 corners[three, :3])
    return found
