"""Archives of ANSYS (.cdb of CDWRITE, .dat of Workbench): nodes, elements, components.

Blocks are of fixed columns, whose widths the line behind NBLOCK, EBLOCK, CMBLOCK tells; zeros at
the end of a line are left out. EBLOCK with SOLID has eleven fields before the nodes, without it
five, and as many nodes as there are.
Nodes of rotated frames are told: their components in the matrices are along axes of their own.
Source: Mechanical APDL Programmer's Reference, "Coded database file commands".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError

__all__ = ["CONTACT", "TARGET", "Archive", "Element", "is_archive", "read_archive"]

#: Element types by their numbers: corners.
_SOLIDS = {185: 8, 45: 8, 186: 8, 95: 8, 5: 8, 226: 8, 187: 4, 92: 4, 285: 4, 227: 4}
_PLANES = (42, 82, 182, 183, 25, 83)
_SHELLS = (63, 93, 181, 281, 43, 154)
CONTACT, TARGET = (171, 172, 173, 174, 175), (169, 170)
_LINES = (171, 172, 169)
#: Fields of EBLOCK with SOLID.
_TYPE, _REAL, _N_NODES, _NUMBER, _FIRST = 1, 2, 8, 10, 11
#: Nodes of a hexahedron that say whether it is a wedge, a pyramid or a tetrahedron, and those of
#: the shapes, corners and middles.
_WEDGE = (0, 1, 2, 4, 5, 6), (8, 9, 11, 12, 13, 15, 16, 17, 18)
_PYRAMID = (0, 1, 2, 3, 4), (8, 9, 10, 11, 16, 17, 18, 19)
_TETRA = (0, 1, 2, 4), (8, 9, 11, 16, 17, 18)


@dataclass(frozen=True)
class Element:
    """An element of an archive.

    Attributes
    ----------
    number, kind, real : int
        Its number, that of its type (186 of SOLID186), and its set of real constants.
    shape : str
        Linear name in meshio; '' of what has no faces.
    nodes : list of int
        Corners, then middles of edges where there are any, in the order of meshio.
    """

    number: int
    kind: int
    real: int
    shape: str
    nodes: list[int]


@dataclass
class Archive:
    """What an archive lists; names are in capitals.

    Attributes
    ----------
    path : Path
    nodes, points : (n,) int, (n, 3)
        Numbers in rising order, and positions [L].
    turned : set of int
        Nodes whose components are along axes of their own.
    elements : list of Element
    node_sets, element_sets : dict of str to set of int
        Components.
    """

    path: Path
    nodes: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    points: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    turned: set[int] = field(default_factory=set)
    elements: list[Element] = field(default_factory=list)
    node_sets: dict[str, set[int]] = field(default_factory=dict)
    element_sets: dict[str, set[int]] = field(default_factory=dict)


def is_archive(path: Path) -> bool:
    """Whether a file holds a block of nodes."""
    with open(path, errors="replace") as file:
        return any("NBLOCK" in line.upper() for _, line in zip(range(5000), file))


def read_archive(path: Path) -> Archive:
    """The nodes, elements and components of an archive.

    Raises
    ------
    InputError
        A block is not what its line of format says, or an element names a node that is not there.
    OutputError
        The file cannot be read.
    """
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    return _Reader(Archive(path), lines).read()


class _Reader:
    def __init__(self, found: Archive, lines: list[str]) -> None:
        self.found, self.lines, self.at = found, lines, 0
        self.types: dict[int, int] = {}
        self.parameters: dict[str, str] = {}
        self.places: dict[int, list[float]] = {}
        self.rows: list[tuple[int, int, int, list[int]]] = []

    def read(self) -> Archive:
        while self.at < len(self.lines):
            words = [word.strip().upper() for word in
                     self.lines[self.at].partition("!")[0].split(",")]
            self.at += 1
            try:
                self._command([*words, "", "", ""])
            except InputError:
                raise
            except (ValueError, IndexError):
                raise InputError(f"{self.found.path}, line {self.at}: '"
                                 f"{self.lines[min(self.at, len(self.lines)) - 1].strip()}' is "
                                 f"not what {words[0]} has there") from None
        self.found.nodes = np.array(sorted(self.places), dtype=np.int64)
        self.found.points = np.array([self.places[node] for node in self.found.nodes.tolist()]
                                     ).reshape(-1, 3)
        for number, kind, real, nodes in self.rows:
            self.found.elements.append(self._element(number, self.types.get(kind, 0), real, nodes))
        return self.found

    def _command(self, words: list[str]) -> None:
        if words[0] == "*SET":
            self.parameters[words[1]] = words[2]
        elif words[0] == "ET":
            number = re.search(r"\d+$", words[2])
            if number:
                self.types[self._value(words[1])] = int(number[0])
        elif words[0] == "ETBLOCK":
            for line in self._block():
                row = _chopped(line, self.width)
                self.types[row[0]] = row[1]
        elif words[0] == "NBLOCK":
            self._nodes()
        elif words[0] == "EBLOCK":
            self._elements("SOLID" in words)
        elif words[0] == "CMBLOCK":
            self._component(words)

    def _value(self, word: str) -> int:
        """A number, or the parameter that stands for it."""
        return int(float(self.parameters.get(word, word)))

    def _format(self) -> None:
        """Integers at the front, their width and that of the numbers behind, of
        (3i9,6e21.13e3)."""
        line = self.lines[self.at].strip().lower()
        self.at += 1
        match = re.match(r"\(\s*(\d+)i(\d+)(?:\s*,\s*\d+[eg](\d+))?", line)
        if not match:
            raise InputError(f"{self.found.path}, line {self.at}: the format '{line}' of a block "
                             "is not known")
        self.integers, self.width, self.real = int(match[1]), int(match[2]), int(match[3] or 0)

    def _block(self) -> Iterator[str]:
        """Lines of a block up to its end."""
        self._format()
        while self.at < len(self.lines):
            line = self.lines[self.at]
            self.at += 1
            if line.strip().startswith(("-1", "N,", "n,", "/")):
                return
            if line.strip():
                yield line

    def _nodes(self) -> None:
        for line in self._block():
            start = self.integers * self.width
            number = int(line[:self.width])
            values = [float(text) if (text := line[start + k * self.real:
                                                   start + (k + 1) * self.real].strip()) else 0.0
                      for k in range(6)]
            if self.places.setdefault(number, values[:3]) != values[:3]:
                raise InputError(f"{self.found.path}: names node {number} twice, at different "
                                 "places")
            if any(values[3:]):
                self.found.turned.add(number)

    def _elements(self, solid: bool) -> None:
        rows = self._block()
        for line in rows:
            row = _chopped(line, self.width)
            if not solid:
                nodes = row[5:]
                while nodes and nodes[-1] == 0:
                    nodes.pop()
                self.rows.append((row[0], row[1], row[2], nodes))
                continue
            while len(row) < _FIRST + row[_N_NODES]:
                row += _chopped(next(rows, ""), self.width) or [0]
            self.rows.append((row[_NUMBER], row[_TYPE], row[_REAL],
                              row[_FIRST:_FIRST + row[_N_NODES]]))

    def _component(self, words: list[str]) -> None:
        """Members of a component: a negative number ends a range that the one before begins."""
        count = int(words[3])
        self._format()
        numbers: list[int] = []
        while len(numbers) < count and self.at < len(self.lines):
            numbers += _chopped(self.lines[self.at], self.width)
            self.at += 1
        members: set[int] = set()
        for before, number in zip([0, *numbers], numbers):
            members |= {number} if number > 0 else set(range(before, -number + 1))
        (self.found.node_sets if words[2].startswith("NODE")
         else self.found.element_sets)[words[1]] = members

    def _element(self, number: int, kind: int, real: int, nodes: list[int]) -> Element:
        shape, nodes = _shape(kind, nodes)
        if shape:
            missing = next((node for node in nodes if node not in self.places), None)
            if missing == 0:
                raise InputError(f"{self.found.path}: element {number} lacks nodes in the middle "
                                 "of some of its edges; give it all of them or none")
            if missing is not None:
                raise InputError(f"{self.found.path}: element {number} names node {missing}, which "
                                 "the archive does not have")
        return Element(number, kind, real, shape, nodes)


def _chopped(line: str, width: int) -> list[int]:
    return [int(line[k:k + width]) for k in range(0, len(line.rstrip()), width)]


def _shape(kind: int, nodes: list[int]) -> tuple[str, list[int]]:
    """Linear name and nodes of an element with faces; degenerate ones as what they are."""
    if kind in _SOLIDS and len(nodes) in (4, 10) and _SOLIDS[kind] == 4:
        return "tetra", _all_or_none(nodes, 4)
    if kind in _SOLIDS and len(nodes) in (8, 20):
        return _solid(nodes)
    if kind in _LINES and len(nodes) in (2, 3):
        return "line", _all_or_none(nodes, 2)
    if kind in (*_PLANES, *_SHELLS, 173, 174, 170):
        if len(nodes) in (4, 8) and nodes[2] == nodes[3]:
            # The fourth corner is the third, and so is the middle between them.
            nodes = nodes[:3] + ([nodes[4], nodes[5], nodes[7]] if len(nodes) == 8 else [])
        if len(nodes) in (3, 4, 6, 8):
            n = 3 if len(nodes) in (3, 6) else 4
            return ("triangle" if n == 3 else "quad"), _all_or_none(nodes, n)
    return "", nodes


def _solid(nodes: list[int]) -> tuple[str, list[int]]:
    name, (corners, middles) = "hexahedron", (tuple(range(8)), tuple(range(8, 20)))
    if len(set(nodes[4:8])) == 1:
        name, (corners, middles) = (("tetra", _TETRA) if nodes[2] == nodes[3]
                                    else ("pyramid", _PYRAMID))
    elif nodes[2] == nodes[3] and nodes[6] == nodes[7]:
        name, (corners, middles) = "wedge", _WEDGE
    chosen = [nodes[k] for k in corners] + [nodes[k] for k in middles if len(nodes) == 20]
    return name, _all_or_none(chosen, len(corners))


def _all_or_none(nodes: list[int], n_corners: int) -> list[int]:
    return nodes if any(nodes[n_corners:]) else nodes[:n_corners]
