"""Meshes of Gmsh (.msh) as text, formats 2.2 and 4.1: nodes with their numbers, cells, groups.

meshio counts nodes anew, knows one group of each cell, and a name for each number, though lines,
surfaces and volumes are numbered apart.
Source: Gmsh reference manual, "MSH file format" and "Node ordering".
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .deck import EDGES

__all__ = ["GmshMesh", "is_text", "read_gmsh"]

Ints = NDArray[np.int64]

#: Cells by their numbers: name in meshio, dimension, nodes.
_TYPES = {15: ("vertex", 0, 1), 1: ("line", 1, 2), 8: ("line3", 1, 3), 2: ("triangle", 2, 3),
          9: ("triangle6", 2, 6), 3: ("quad", 2, 4), 16: ("quad8", 2, 8), 10: ("quad9", 2, 9),
          4: ("tetra", 3, 4), 11: ("tetra10", 3, 10), 5: ("hexahedron", 3, 8),
          17: ("hexahedron20", 3, 20), 12: ("hexahedron27", 3, 27), 6: ("wedge", 3, 6),
          18: ("wedge15", 3, 15), 13: ("wedge18", 3, 18), 7: ("pyramid", 3, 5),
          19: ("pyramid13", 3, 13), 14: ("pyramid14", 3, 14)}
#: Edges in the order of the middle nodes of Gmsh, where it is not that of others.
_ORDER = {"tetra10": ((0, 1), (1, 2), (2, 0), (0, 3), (2, 3), (1, 3)),
          "hexahedron20": ((0, 1), (3, 0), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5),
                           (7, 4), (5, 6), (6, 7)),
          "wedge15": ((0, 1), (2, 0), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (5, 3), (4, 5)),
          "pyramid13": ((0, 1), (3, 0), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4))}
#: Cells with the same edges, whose nodes in the middle of faces follow.
_ORDER_OF = {"hexahedron27": "hexahedron20", "wedge18": "wedge15", "pyramid14": "pyramid13"}


@dataclass
class GmshMesh:
    """What a mesh lists; names are in capitals.

    Attributes
    ----------
    nodes, points : (n,) int, (n, 3)
        Numbers and positions [L].
    blocks : list of (str, (n, n_nodes) int)
        Cells as meshio calls and orders them, by places in `nodes`.
    numbers : list of (n,) int
        Of the cells of each block, from 1.
    groups : dict of str to list of int
        Cells by the name of their physical group; GROUP_7 of one without a name.
    """

    nodes: Ints
    points: NDArray[np.float64]
    blocks: list[tuple[str, Ints]] = field(default_factory=list)
    numbers: list[Ints] = field(default_factory=list)
    groups: dict[str, list[int]] = field(default_factory=dict)


def is_text(path: Path) -> bool:
    """Whether a file is of a format that is read here."""
    with open(path, errors="replace") as file:
        words = [file.readline().strip(), *file.readline().split()]
    return words[0] == "$MeshFormat" and words[1:3] in (["2.2", "0"], ["4.1", "0"])


def read_gmsh(path: Path) -> GmshMesh:
    """The nodes, cells and physical groups of a mesh.

    Raises
    ------
    InputError
        A section is not what it should be, or a cell names a node that is not there.
    """
    sections: dict[str, list[str]] = {}
    name = ""
    for line in path.read_text(errors="replace").splitlines():
        text = line.strip()
        if text.startswith("$End"):
            name = ""
        elif text.startswith("$"):
            name = text[1:]
            sections.setdefault(name, [])
        elif name and text:
            sections[name].append(text)
    if "PartitionedEntities" in sections:
        raise InputError(f"{path}: the mesh is partitioned; write it whole")
    try:
        return _Reader(path, sections).read()
    except InputError:
        raise
    except (ValueError, IndexError, KeyError):
        raise InputError(f"{path}: its $Nodes, $Elements or $Entities are missing, end too early, "
                         "or hold other than numbers; write it anew") from None


class _Reader:
    def __init__(self, path: Path, sections: dict[str, list[str]]) -> None:
        self.path, self.sections = path, sections
        self.is_new = sections["MeshFormat"][0].startswith("4")
        self.names: dict[tuple[int, int], str] = {}
        for line in sections.get("PhysicalNames", [])[1:]:
            dimension, tag, name = line.split(None, 2)
            self.names[int(dimension), int(tag)] = name.strip().strip('"').upper()
        self.cells: dict[str, list[list[int]]] = {}
        self.known: dict[tuple[str, tuple[int, ...]], int] = {}
        self.numbers: dict[str, list[int]] = {}

    def read(self) -> GmshMesh:
        places = self._new_nodes() if self.is_new else self._old_nodes()
        found = GmshMesh(np.array(list(places), dtype=np.int64),
                         np.array(list(places.values()), dtype=float).reshape(-1, 3))
        (self._new_cells if self.is_new else self._old_cells)(found)
        index = {node: k for k, node in enumerate(places)}
        for kind, rows in self.cells.items():
            try:
                table = np.array([[index[node] for node in row] for row in rows], dtype=np.int64)
            except KeyError as error:
                raise InputError(f"{self.path}: a cell names node {error}, which $Nodes does not "
                                 "list") from None
            found.blocks.append((kind, table[:, _permutation(kind, table.shape[1])]))
            found.numbers.append(np.array(self.numbers[kind], dtype=np.int64))
        return found

    def _place(self, places: dict[int, list[float]], node: int, words: list[str]) -> None:
        place = [float(word) for word in words[:3]]
        if len(place) < 3:
            raise ValueError
        if places.setdefault(node, place) != place:
            raise InputError(f"{self.path}: names node {node} twice, at different places")

    def _old_nodes(self) -> dict[int, list[float]]:
        places: dict[int, list[float]] = {}
        count, *lines = self.sections["Nodes"]
        for k in range(int(count)):
            node, *words = lines[k].split()
            self._place(places, int(node), words)
        return places

    def _new_nodes(self) -> dict[int, list[float]]:
        places: dict[int, list[float]] = {}
        lines = self.sections["Nodes"]
        at = 1
        for _ in range(int(lines[0].split()[0])):
            count = int(lines[at].split()[3])
            for k in range(count):
                self._place(places, int(lines[at + 1 + k]), lines[at + 1 + count + k].split())
            at += 1 + 2 * count
        return places

    def _old_cells(self, found: GmshMesh) -> None:
        count, *lines = self.sections["Elements"]
        for k in range(int(count)):
            words = [int(word) for word in lines[k].split()]
            first = 3 + words[2]
            tags = [words[3]] if words[2] and words[3] else []
            self._cell(found, words[1], words[first:], tags)

    def _new_cells(self, found: GmshMesh) -> None:
        groups = self._entities()
        lines = self.sections["Elements"]
        at = 1
        for _ in range(int(lines[0].split()[0])):
            dimension, entity, kind, count = (int(word) for word in lines[at].split())
            for line in lines[at + 1:at + 1 + count]:
                self._cell(found, kind, [int(word) for word in line.split()[1:]],
                           groups.get((dimension, entity), ()))
            at += 1 + count

    def _entities(self) -> dict[tuple[int, int], list[int]]:
        """Numbers of the groups of each point, curve, surface and volume."""
        groups: dict[tuple[int, int], list[int]] = {}
        if "Entities" not in self.sections:
            return groups
        counts, *lines = self.sections["Entities"]
        at = 0
        for dimension, count in enumerate(map(int, counts.split())):
            first = 4 if dimension == 0 else 7      # behind the position, or the box around it
            for line in lines[at:at + count]:
                words = line.split()
                n = int(words[first])
                groups[dimension, int(words[0])] = [
                    abs(int(word)) for word in words[first + 1:first + 1 + n]]
            at += count
        return groups

    def _cell(self, found: GmshMesh, number: int, nodes: list[int], tags: Iterable[int]) -> None:
        """One cell; format 2.2 lists it again for each further group."""
        if number not in _TYPES:
            raise InputError(f"{self.path}: cells of type {number} are of an order above 2 or "
                             "unknown; write the mesh with Mesh.ElementOrder = 1 or 2")
        kind, dimension, n = _TYPES[number]
        if len(nodes) != n:
            raise InputError(f"{self.path}: a {kind} has {len(nodes)} nodes; expected {n}")
        key = kind, tuple(nodes)
        if key not in self.known:
            self.known[key] = len(self.known) + 1
            self.cells.setdefault(kind, []).append(nodes)
            self.numbers.setdefault(kind, []).append(self.known[key])
        for tag in tags:
            name = self.names.get((dimension, tag), f"GROUP_{tag}")
            found.groups.setdefault(name, []).append(self.known[key])


def _permutation(kind: str, n: int) -> list[int]:
    """Where the nodes of a cell, in the order of meshio, stand in that of Gmsh."""
    like = _ORDER_OF.get(kind, kind)
    if like not in _ORDER:
        return list(range(n))
    corners = 1 + max(max(edge) for edge in EDGES[like])
    theirs = {frozenset(edge): corners + k for k, edge in enumerate(_ORDER[like])}
    whole = [*range(corners), *(theirs[frozenset(edge)] for edge in EDGES[like])]
    return [*whole, *range(len(whole), n)]
