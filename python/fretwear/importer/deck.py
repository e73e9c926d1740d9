"""Decks of Abaqus and CalculiX (.inp): nodes, cells, sets, supports and nodal loads.

Read are *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *BOUNDARY, *CLOAD, *TRANSFORM, *INCLUDE and the
procedure of each step; everything else is left to the program that solves. Names count without
regard to capital letters.
Source: CalculiX CrunchiX USER'S MANUAL version 2.20, "Input deck format"; Abaqus Keywords Guide.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError

__all__ = ["EDGES", "FACES", "Card", "Deck", "NodalLoad", "cards", "read_deck"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Edges of quadratic cells by their corners, in the order of their middle nodes (Abaqus, VTK).
EDGES = {"triangle6": ((0, 1), (1, 2), (2, 0)),
         "quad8": ((0, 1), (1, 2), (2, 3), (3, 0)),
         "tetra10": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
         "wedge15": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
         "hexahedron20": ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4),
                          (1, 5), (2, 6), (3, 7))}
#: Corners of the faces S1, S2, ... of solids.
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3),
                   (3, 7, 4, 0))}
#: Cells of solids and of surfaces by the number of their nodes.
_SOLIDS = {4: "tetra", 10: "tetra10", 5: "pyramid", 13: "pyramid13", 6: "wedge", 15: "wedge15",
           8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27"}
_SHELLS = {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8", 9: "quad9"}
_TYPES = ((re.compile(r"(?:C3D|DC3D|F3D)(\d+)"), _SOLIDS), (re.compile(r"SC([68])R"), _SOLIDS),
          (re.compile(r"(?:CPS|CPEG|CPE|CAX|M3D|SFM3D|R3D|DS|S)(\d)"), _SHELLS),
          (re.compile(r"STRI(3|65)"), {3: "triangle", 65: "triangle6"}))
#: Supports by name: their components.
_SUPPORTS = {"ENCASTRE": (1, 2, 3, 4, 5, 6), "PINNED": (1, 2, 3), "XSYMM": (1, 5, 6),
             "YSYMM": (2, 4, 6), "ZSYMM": (3, 4, 5)}
#: Makes nodes or cells that no file lists.
_GENERATED = ("NGEN", "NFILL", "NCOPY", "ELGEN", "ELCOPY", "SYSTEM", "NMAP")
#: Loads that are none of nodes.
_SPREAD = ("DLOAD", "DSLOAD", "TEMPERATURE")
_PROCEDURES = {"STATIC": "static", "STEADYSTATEDYNAMICS": "harmonic"}
_DEEPEST = 20


@dataclass(frozen=True)
class NodalLoad:
    """A *CLOAD of one node.

    Attributes
    ----------
    step : int
        Step of the deck, from 1.
    kind : str
        'static', 'harmonic' or '' of the procedure of this step.
    imaginary : bool
        Whether it is the imaginary part (LOAD CASE = 2).
    node : int
    direction : (3,) floats
        Force along the global axes.
    """

    step: int
    kind: str
    imaginary: bool
    node: int
    direction: tuple[float, float, float]


@dataclass
class Deck:
    """What a deck says of its mesh.

    Attributes
    ----------
    path : Path
    nodes, points : (n,) int, (n, 3)
        Numbers and positions, in the order of the deck.
    blocks : list of (str, (n_cells, n_corners) int)
        Cells of solids and surfaces as meshio calls them, by places in `nodes`, a block for each
        keyword; other elements under their own names, without nodes.
    elements : dict of int to (str, list of int)
        Type and node numbers of each element.
    node_sets, element_sets : dict of str to list of int
        Numbers by name, in capital letters; surfaces are sets of nodes too.
    supports : set of (node, component)
        Components that *BOUNDARY holds.
    loads : list of NodalLoad
    turned : set of int
        Nodes with a *TRANSFORM, whose supports and loads are along axes of their own.
    notes : list of str
        What is left out.
    """

    path: Path
    nodes: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    blocks: list[tuple[str, Ints]] = field(default_factory=list)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    supports: set[tuple[int, int]] = field(default_factory=set)
    loads: list[NodalLoad] = field(default_factory=list)
    turned: set[int] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Card:
    """A keyword with its parameters and its data lines.

    Attributes
    ----------
    where : str
        File and line, for messages.
    word : str
        The keyword in capital letters, without its star.
    parameters : dict of str to str
        By names in capital letters, without blanks.
    lines : list of str
        Of data.
    """

    where: str
    word: str
    parameters: dict[str, str]
    lines: list[str]

    def name(self, key: str) -> str:
        return self.parameters.get(key, "").upper()


def read_deck(path: str | Path) -> Deck:
    """The mesh, sets, supports and nodal loads of a deck.

    Raises
    ------
    InputError
        A line is not what its keyword says, or nodes are made that no file lists.
    OutputError
        A file cannot be read.
    """
    return _Reader(Path(path)).deck()


class _Reader:
    def __init__(self, path: Path) -> None:
        self.found = Deck(path)
        self.cards = list(cards(path))
        self.axes: dict[int, tuple[str, Floats]] = {}
        self.place: dict[int, Floats] = {}

    def deck(self) -> Deck:
        """Cards in the order that lets each use what it names, wherever it stands."""
        for card in self.cards:
            if card.word in _GENERATED or (card.word == "NODE" and "SYSTEM" in card.parameters):
                raise InputError(f"{card.where}: *{card.word} makes nodes or cells that the deck "
                                 "does not list; write the mesh out")
            if card.word == "INSTANCE" and card.lines:
                raise InputError(f"{card.where}: an instance that is moved; write the mesh as one "
                                 "part, where it is")
        self._nodes()
        self._elements()
        for card in self.cards:
            if card.word in ("NSET", "ELSET"):
                self._set(card)
        for card in self.cards:
            if card.word == "SURFACE":
                self._surface(card)
        for card in self.cards:
            if card.word == "TRANSFORM":
                self._transform(card)
        self._steps()
        return self.found

    def _nodes(self) -> None:
        table: list[list[float]] = []
        for card in self._of("NODE"):
            first = len(table)
            for line in card.lines:
                values = _numbers(line, card.where)
                if len(values) < 2:
                    raise InputError(f"{card.where}: a node needs its number and its position")
                table.append([*values, 0.0, 0.0][:4])
            self._into(self.found.node_sets, card.name("NSET"), [int(v[0]) for v in table[first:]])
        read = np.array(table, dtype=float).reshape(-1, 4)
        self.found.nodes, self.found.points = read[:, 0].astype(np.int64), read[:, 1:]
        self.place = dict(zip(self.found.nodes.tolist(), self.found.points))

    def _elements(self) -> None:
        index = {node: k for k, node in enumerate(self.found.nodes.tolist())}
        for card in self._of("ELEMENT"):
            kind, n = _cell(card.name("TYPE"))
            read = list(_joined(card, n))
            self.found.elements.update((numbers[0], (kind, numbers[1:])) for numbers in read)
            self._into(self.found.element_sets, card.name("ELSET"), [row[0] for row in read])
            try:
                rows = [[index[node] for node in numbers[1:1 + n]] for numbers in read]
            except KeyError as error:
                raise InputError(f"{card.where}: a cell of type {kind} names node {error}, which "
                                 "the deck does not list") from None
            self.found.blocks.append((kind, np.array(rows, dtype=np.int64).reshape(-1, n)
                                      if n else np.zeros((len(read), 0), dtype=np.int64)))

    def _set(self, card: Card) -> None:
        """*NSET or *ELSET: numbers, ranges, other sets."""
        of_nodes = card.word == "NSET"
        sets = self.found.node_sets if of_nodes else self.found.element_sets
        members: list[int] = []
        if of_nodes and "ELSET" in card.parameters:
            for element in self.found.element_sets.get(card.name("ELSET"), []):
                members += self.found.elements[element][1] if element in self.found.elements else []
        for line in card.lines:
            words = [word.strip() for word in line.split(",") if word.strip()]
            if "GENERATE" in card.parameters:
                try:
                    first, last, step = [*map(int, words), 1][:3]
                except ValueError:
                    raise InputError(f"{card.where}: expected first, last and step, found "
                                     f"'{line.strip()}'") from None
                if step == 0:
                    raise InputError(f"{card.where}: a step of 0 leads nowhere")
                members += range(first, last + (1 if step > 0 else -1), step)
                continue
            for word in words:
                if word.lstrip("+-").isdigit():
                    members.append(int(word))
                elif word.upper() in sets:
                    members += sets[word.upper()]
                else:
                    raise InputError(f"{card.where}: there is no set {word} above it")
        self._into(sets, card.name(card.word), members)

    def _surface(self, card: Card) -> None:
        """A surface of nodes, or of faces of elements: its nodes, those in the middle of edges
        too."""
        members: list[int] = []
        for line in card.lines:
            words = [word.strip().upper() for word in line.split(",")]
            if card.name("TYPE") == "NODE":
                members += self._named(words[0], card.where)
                continue
            chosen = ([int(words[0])] if words[0].isdigit()
                      else self.found.element_sets.get(words[0]))
            if chosen is None:
                raise InputError(f"{card.where}: there is no element set {words[0]}")
            label = words[1] if len(words) > 1 else ""
            for element in chosen:
                if element in self.found.elements:
                    kind, nodes = self.found.elements[element]
                    # A solid without a face stands for those that are free.
                    for face in [label] if label or not _faces(kind) else self._free(kind, nodes):
                        members += _face(kind, nodes, face, card.where)
        name = card.name("NAME")
        if name not in self.found.node_sets:
            self._into(self.found.node_sets, name, list(dict.fromkeys(members)))

    def _free(self, kind: str, nodes: list[int]) -> list[str]:
        """Faces of a solid that no other cell of the deck has."""
        return [f"S{k}" for k, corners in enumerate(_faces(kind), 1)
                if self._count[frozenset(nodes[corner] for corner in corners)] == 1]

    @cached_property
    def _count(self) -> Counter[frozenset[int]]:
        """How many solids have a face, by its corners."""
        return Counter(frozenset(nodes[corner] for corner in corners)
                       for kind, nodes in self.found.elements.values() for corners in _faces(kind))

    def _transform(self, card: Card) -> None:
        values = np.array([v for line in card.lines for v in _numbers(line, card.where)])
        if len(values) < 6:
            raise InputError(f"{card.where}: expected six coordinates")
        for node in self._named(card.name("NSET"), card.where):
            self.axes[node] = card.name("TYPE") or "R", values[:6].reshape(2, 3)
        self.found.turned = set(self.axes)

    def _steps(self) -> None:
        """Supports, and nodal loads with the procedure of their step."""
        step, kind, spread = 0, "", ""
        for card in self.cards:
            squeezed = card.word.replace(" ", "")
            if squeezed == "STEP":
                step, kind = step + 1, ""
            kind = _PROCEDURES.get(squeezed, kind)
            if card.word in _SPREAD:
                spread = card.word
            if card.word == "BOUNDARY":
                for line in card.lines:
                    self._boundary(card, line)
            elif card.word == "CLOAD":
                for line in card.lines:
                    self._load(card, line, step, kind)
        if spread:
            self.found.notes.append(f"{self.found.path}: loads of *{spread} are left out; loads "
                                    "of nodes (*CLOAD) are read")

    def _boundary(self, card: Card, line: str) -> None:
        words = [word.strip().upper() for word in line.split(",")]
        nodes = self._named(words[0], card.where)
        if len(words) > 1 and words[1] in _SUPPORTS:
            components: tuple[int, ...] = _SUPPORTS[words[1]]
        else:
            try:
                first = int(words[1])
                last = int(words[2]) if len(words) > 2 and words[2] else first
            except (IndexError, ValueError):
                raise InputError(f"{card.where}: expected node or set, first and last component, "
                                 f"found '{line.strip()}'") from None
            components = tuple(range(first, last + 1))
        for node in nodes:
            self.found.supports.update((node, component) for component in components)

    def _load(self, card: Card, line: str, step: int, kind: str) -> None:
        words = [word.strip() for word in line.split(",")]
        try:
            component, value = int(words[1]), float(words[2])
        except (IndexError, ValueError):
            raise InputError(f"{card.where}: expected node or set, component and force, found "
                             f"'{line.strip()}'") from None
        for node in self._named(words[0].upper(), card.where):
            if not 1 <= component <= 3:
                raise InputError(f"{card.where}: component {component} of node {node}; forces "
                                 "along 1, 2 and 3 are read")
            direction = value * self._frame(node)[component - 1]
            self.found.loads.append(NodalLoad(step, kind, card.name("LOADCASE") == "2", node,
                                              tuple(direction.tolist())))

    def _frame(self, node: int) -> Floats:
        """Axes of the components of a node, as rows."""
        if node not in self.axes:
            return np.eye(3)
        kind, (one, two) = self.axes[node]
        if kind.startswith("C"):
            axis = (two - one) / np.linalg.norm(two - one)
            off = self.place[node] - one
            radial = off - (off @ axis) * axis
            radial = radial / np.linalg.norm(radial)
            return np.stack((radial, np.cross(axis, radial), axis))
        first = one / np.linalg.norm(one)
        third = np.cross(first, two)
        third = third / np.linalg.norm(third)
        return np.stack((first, np.cross(third, first), third))

    def _named(self, word: str, where: str) -> list[int]:
        """A node or the nodes of a set."""
        if word.isdigit():
            return [int(word)]
        if word not in self.found.node_sets:
            raise InputError(f"{where}: there is no node set {word}")
        return self.found.node_sets[word]

    def _of(self, word: str) -> Iterator[Card]:
        return (card for card in self.cards if card.word == word)

    @staticmethod
    def _into(sets: dict[str, list[int]], name: str, members: list[int]) -> None:
        if name:
            sets[name] = list(dict.fromkeys([*sets.get(name, []), *members]))


def cards(path: Path, folder: Path | None = None, depth: int = 0) -> Iterator[Card]:
    """Keywords with their data; included files, named from the folder of the deck, in their place.

    Raises
    ------
    InputError
        Files include each other.
    OutputError
        A file cannot be read.
    """
    folder = path.parent if folder is None else folder
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    card: Card | None = None
    k = 0
    while k < len(lines):
        line, number = lines[k].strip(), k + 1
        k += 1
        if not line or line.startswith("**"):
            continue
        if not line.startswith("*"):
            if card is not None:
                card.lines.append(line)
            continue
        while line.endswith(",") and k < len(lines):   # parameters go on in the next line
            line, k = line + lines[k].strip(), k + 1
        word, *parameters = (part.strip() for part in line[1:].split(","))
        pairs = (part.partition("=") for part in parameters)
        if card is not None:
            yield card
        card = Card(f"{path}, line {number}", " ".join(word.upper().split()),
                     {key.strip().upper().replace(" ", ""): value.strip().strip("'\"")
                      for key, _, value in pairs}, [])
        if card.word == "INCLUDE":
            if depth == _DEEPEST:
                raise InputError(f"{card.where}: files include each other")
            yield from cards(folder / card.parameters.get("INPUT", ""), folder, depth + 1)
            card = None
    if card is not None:
        yield card


def _cell(name: str) -> tuple[str, int]:
    """Cell of an element type and its number of nodes; 0 where it is no solid and no surface."""
    for pattern, known in _TYPES:
        match = pattern.match(name)
        if match and int(match[1]) in known:
            n = int(match[1])
            return known[n], 6 if n == 65 else n
    return name or "of no type", 0


def _joined(card: Card, n: int) -> Iterator[list[int]]:
    """Element and node numbers, over as many lines as they take."""
    numbers: list[int] = []
    for line in card.lines:
        try:
            numbers += [int(word) for word in line.split(",") if word.strip()]
        except ValueError:
            raise InputError(f"{card.where}: expected numbers of an element and its nodes, found "
                             f"'{line}'") from None
        if len(numbers) == n + 1 or (n == 0 and not line.endswith(",")):
            yield numbers
            numbers = []
        elif n and len(numbers) > n + 1:
            raise InputError(f"{card.where}: element {numbers[0]} of type {card.name('TYPE')} has "
                             f"{len(numbers) - 1} nodes; expected {n}")
    if numbers:
        raise InputError(f"{card.where}: element {numbers[0]} of type {card.name('TYPE')} has "
                         f"{len(numbers) - 1} nodes; expected {n}")


def _faces(kind: str) -> tuple[tuple[int, ...], ...]:
    """Corners of the faces of a solid; of other cells there are none."""
    return FACES.get(kind.rstrip("0123456789"), ())


def _face(kind: str, nodes: list[int], face: str, where: str) -> list[int]:
    """Nodes of a face S1, S2, ...; of a shell all of them."""
    faces = _faces(kind)
    if not faces:
        return nodes
    if not (face.startswith("S") and face[1:].isdigit() and 1 <= int(face[1:]) <= len(faces)):
        raise InputError(f"{where}: '{face}' is no face of a {kind}; expected S1 to "
                         f"S{len(faces)}")
    corners = faces[int(face[1:]) - 1]
    first = 1 + max(max(corner) for corner in faces)
    return [nodes[k] for k in corners] + [
        nodes[first + k] for k, edge in enumerate(EDGES.get(kind, ()))
        if edge[0] in corners and edge[1] in corners]


def _numbers(line: str, where: str) -> list[float]:
    try:
        return [float(word) for word in line.split(",") if word.strip()]
    except ValueError:
        raise InputError(f"{where}: expected numbers, found '{line}'") from None
