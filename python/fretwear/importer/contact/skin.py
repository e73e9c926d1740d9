"""Faces of the cells of a mesh with the nodes in the middle of their edges, and its skin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...surfaces import Surface
from ..deck import EDGES, FACES

__all__ = ["CELLS", "Cells", "Faces", "faces_of", "surface_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Corners and dimension of the cells that have faces, by their linear names in meshio.
CELLS = {"tetra": (4, 3), "hexahedron": (8, 3), "wedge": (6, 3), "pyramid": (5, 3),
         "triangle": (3, 2), "quad": (4, 2), "line": (2, 1)}
#: Corners of the faces of solids as Abaqus numbers them, and of the edges of plane cells.
_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    **FACES, "triangle": ((0, 1), (1, 2), (2, 0)), "quad": ((0, 1), (1, 2), (2, 3), (3, 0))}
#: Edges whose middles follow the corners, by linear names.
_EDGES: dict[str, tuple[tuple[int, int], ...]] = {
    **{kind.rstrip("0123456789"): edges for kind, edges in EDGES.items()},
    "line": ((0, 1),)}
_KIND = {(2, False): "line", (2, True): "line3", (3, False): "triangle", (3, True): "triangle6",
         (4, False): "quad", (4, True): "quad8"}


@dataclass(frozen=True)
class Cells:
    """Cells of one type.

    Attributes
    ----------
    kind : str
        Linear name in meshio, of `CELLS`.
    points : (n, n_nodes) int
        Corners, then middles of edges where there are any; more is left out.
    number : (n,) int
        Of the elements.
    """

    kind: str
    points: Ints
    number: Ints

    @property
    def is_quadratic(self) -> bool:
        """Whether edges have a node in the middle."""
        return bool(self.points.shape[1] >= CELLS[self.kind][0] + len(_EDGES[self.kind]))


@dataclass(frozen=True)
class Faces:
    """Faces of cells.

    Attributes
    ----------
    nodes : list of tuple of int
        Corners, then middles of edges; outwards as `fretwear.surfaces.Surface` wants them.
    n_corners : (n,) int
        Of each.
    element, label : (n,) int
        Element, and number of the face there from 1.
    is_skin : (n,) bool
        Whether no other cell has the face.
    """

    nodes: list[tuple[int, ...]]
    n_corners: Ints
    element: Ints
    label: Ints
    is_skin: NDArray[np.bool_]

    def keys(self) -> list[tuple[int, ...]]:
        """Sorted corners of each."""
        return [tuple(sorted(face[:n])) for face, n in zip(self.nodes, self.n_corners.tolist())]


def faces_of(points: Floats, blocks: list[Cells]) -> Faces:
    """Faces of all cells that fill the mesh: of solids, or of the cells of a plane mesh."""
    top = max((CELLS[block.kind][1] for block in blocks), default=3)
    nodes: list[tuple[int, ...]] = []
    element: list[int] = []
    label: list[int] = []
    corners: list[int] = []
    for block in blocks:
        n, dimension = CELLS[block.kind]
        if dimension != top:
            continue
        middles = {frozenset(edge): n + k for k, edge in enumerate(_EDGES[block.kind])}
        for number, cell in zip(block.number.tolist(), block.points.tolist()):
            centre = points[cell[:n]].mean(axis=0)
            for k, face in enumerate(_FACES[block.kind], 1):
                found = _face(cell, face, middles if block.is_quadratic else None)
                if len(found[0]) < 2 + (top == 3):
                    continue      # an edge of a degenerate cell
                nodes.append(_outward(points, *found, centre))
                corners.append(len(found[0]))
                element.append(number)
                label.append(k)
    faces = Faces(nodes, np.array(corners, dtype=np.int64), np.array(element, dtype=np.int64),
                  np.array(label, dtype=np.int64), np.ones(len(nodes), dtype=bool))
    count: dict[tuple[int, ...], int] = {}
    for key in (keys := faces.keys()):
        count[key] = count.get(key, 0) + 1
    faces.is_skin[:] = [count[key] == 1 for key in keys]
    return faces


def _face(cell: list[int], face: tuple[int, ...], middles: Mapping[frozenset[int], int] | None
          ) -> tuple[list[int], list[int]]:
    """Corners and middles of a face, without those that a degenerate cell has twice."""
    corners: list[int] = []
    between: list[int] = []
    edges = list(zip(face, face[1:] + face[:1])) if len(face) > 2 else [(face[0], face[1])]
    for one, two in edges:
        if cell[one] != cell[two] or len(face) == 2:
            corners.append(cell[one])
            if middles is not None:
                between.append(cell[middles[frozenset((one, two))]])
    if len(face) == 2:
        corners.append(cell[face[1]])
    return corners, between


def _outward(points: Floats, corners: list[int], middles: list[int], centre: Floats
             ) -> tuple[int, ...]:
    place = points[corners]
    if len(corners) == 2:
        along = place[1] - place[0]
        normal = np.array([along[1], -along[0], 0.0])
    else:
        normal = np.cross(place[2] - place[0], place[-1] - place[1])
    if (place.mean(axis=0) - centre) @ normal >= 0.0:
        return (*corners, *middles)
    # The other way round from the same corner; the middles follow their edges.
    if len(corners) == 2:
        return (corners[1], corners[0], *middles)
    return (corners[0], *corners[:0:-1], *middles[::-1])


def surface_of(name: str, points: Floats, faces: list[tuple[int, ...]], n_corners: Ints,
               plane: bool) -> Surface:
    """A surface of some faces."""
    groups: dict[str, list[tuple[int, ...]]] = {}
    for face, n in zip(faces, n_corners.tolist()):
        kind = _KIND[n, len(face) > n]
        groups.setdefault(kind, []).append(face)
    tables: dict[str, Any] = {kind: np.array(group, dtype=np.int64)
                              for kind, group in groups.items()}
    return Surface(points[:, :2] if plane else points, tables, name)
