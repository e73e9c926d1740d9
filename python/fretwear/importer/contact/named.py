"""Decks with names: nodes, cells, sets, surfaces and contact pairs of the input of other programs.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...surfaces import Surface
from ..deck import Couple
from ..tables import read_table
from .skin import CELLS, Cells, Faces, faces_of, surface_of

__all__ = ["NamedMesh"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Faces of shells against their normal.
_NEGATIVE = ("SNEG", "S1")


@dataclass
class NamedMesh:
    """What a deck names; names are in capitals.

    Attributes
    ----------
    path : Path
        Its file.
    points : (n_points, 3)
        Positions of the nodes [L].
    nodes : (n_points,) int
        Their numbers.
    cells : list of Cells
        Blocks of cells.
    node_sets, element_sets : dict of str to set of int
        Numbers.
    surfaces : dict of str to list of (set of int, str)
        Elements with their face S1, S2, ... or, of shells, SPOS or SNEG; '': their faces on the
        skin, or shells themselves.
    couples : list of Couple
        Contact pairs that it declares.
    turned : set of int
        Nodes whose components in the matrices are along axes of their own.
    """

    path: Path
    points: Floats
    nodes: Ints
    cells: list[Cells]
    node_sets: dict[str, set[int]] = field(default_factory=dict)
    element_sets: dict[str, set[int]] = field(default_factory=dict)
    surfaces: dict[str, list[tuple[set[int], str]]] = field(default_factory=dict)
    couples: list[Couple] = field(default_factory=list)
    turned: set[int] = field(default_factory=set)

    @cached_property
    def is_plane(self) -> bool:
        """Whether all cells lie in one plane z, so that edges touch and not faces."""
        if any(CELLS[block.kind][1] == 3 for block in self.cells):
            return False
        used = np.unique(np.concatenate([block.points.ravel() for block in self.cells] or
                                        [np.zeros(0, dtype=np.int64)]))
        return bool(len(used)) and float(np.ptp(self.points[used, 2])) == 0.0

    @cached_property
    def faces(self) -> Faces:
        """Faces of its solids, or edges of its plane cells."""
        blocks = self.cells
        if not self.is_plane:
            blocks = [block for block in blocks if CELLS[block.kind][1] == 3]
        return faces_of(self.points, blocks)

    def surface(self, name: str) -> Surface:
        """A surface by its name: of a surface, an element set or a node set of the deck, or of a
        table with the column node.

        Raises
        ------
        InputError
            There is no such name, or no face belongs to it.
        """
        key = name.upper()
        if key in self.surfaces:
            chosen = [part for elements, label in self.surfaces[key]
                      for part in self._of_elements(elements, label)]
        elif key in self.element_sets:
            chosen = self._of_elements(self.element_sets[key])
        elif key in self.node_sets:
            chosen = self._of_nodes(self.node_sets[key])
        elif Path(name).is_file():
            chosen = self._of_nodes(_node_table(Path(name)))
        else:
            raise InputError(self._unknown(name))
        if not chosen:
            raise InputError(f"{self.path}: {name}: no outer face of an element belongs to it; a "
                             "node set must hold all corners of its faces")
        faces = {tuple(sorted(face[:n])): (face, n) for face, n in chosen}
        return surface_of(name, self.points, [face for face, _ in faces.values()],
                          np.array([n for _, n in faces.values()]), self.is_plane)

    def _unknown(self, name: str) -> str:
        known = sorted({*self.surfaces, *self.element_sets, *self.node_sets})
        near = difflib.get_close_matches(name.upper(), known, 3)
        return (f"{self.path}: names no surface, element set or node set '{name}', and there is no "
                "table of nodes of that name; "
                + (f"did you mean {' or '.join(near)}?" if near else
                   f"it has {', '.join(known[:20])}" if known else "it names none"))

    def _of_nodes(self, numbers: set[int]) -> list[tuple[tuple[int, ...], int]]:
        """Outer faces whose corners are all there."""
        inside = np.isin(self.nodes, list(numbers))
        faces = self.faces
        return [(faces.nodes[k], int(faces.n_corners[k])) for k in np.flatnonzero(faces.is_skin)
                if inside[list(faces.nodes[k][:faces.n_corners[k]])].all()]

    def _of_elements(self, numbers: set[int], label: str = ""
                     ) -> list[tuple[tuple[int, ...], int]]:
        """Faces of elements by their name, or all outer ones; shells, or lines of a plane mesh,
        themselves."""
        faces = self.faces
        own = np.isin(faces.element, list(numbers))
        own &= faces.label == int(label[1:]) if label[1:].isdigit() else faces.is_skin
        found = [(faces.nodes[k], int(faces.n_corners[k])) for k in np.flatnonzero(own)]
        for block in self.cells:
            n, dimension = CELLS[block.kind]
            if dimension != (1 if self.is_plane else 2):
                continue
            for cell in block.points[np.isin(block.number, list(numbers))].tolist():
                # Faces on a solid look out of it, whatever way their corners go round.
                k = self._outer.get(tuple(sorted(set(cell[:n]))), -1)
                if k >= 0:
                    found.append((faces.nodes[k], int(faces.n_corners[k])))
                elif not self.is_plane:
                    found.append((_turned(cell, n, block.is_quadratic)
                                  if label in _NEGATIVE else
                                  tuple(cell[:2 * n] if block.is_quadratic else cell[:n]), n))
        return found

    @cached_property
    def _outer(self) -> dict[tuple[int, ...], int]:
        """Faces of the skin by their sorted corners."""
        faces = self.faces
        return {key: k for k, key in enumerate(faces.keys()) if faces.is_skin[k]}


def _turned(cell: list[int], n: int, quadratic: bool) -> tuple[int, ...]:
    """A shell the other way round from the same corner; the middles follow their edges."""
    corners = [cell[0], *cell[n - 1:0:-1]]
    return (*corners, *(cell[2 * n - 1:n - 1:-1] if quadratic else ()))


def _node_table(path: Path) -> set[int]:
    table = read_table(path, ["node", "x", "y", "z"])
    numbers = table.numbers("node")
    if numbers is None:
        raise InputError(f"{path}: expected the column node")
    return {int(number) for number in numbers}
