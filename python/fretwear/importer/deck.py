"""Decks of Abaqus and CalculiX (.inp): nodes, cells, sets, supports and nodal loads.

Read are *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *CONTACT PAIR with its *FRICTION, *BOUNDARY,
*CLOAD, *TRANSFORM, *INCLUDE and the procedure of each step; everything else is left to the program
that solves. Names count without regard to capital letters.
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

from ..errors import InputError
from .cards import Card, cards, numbers_of, words_of

__all__ = ["EDGES", "FACES", "Couple", "Deck", "NodalLoad", "read_deck"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Edges of quadratic cells by their corners, in the order of their middle nodes (Abaqus, VTK).
EDGES = {"triangle6": ((0, 1), (1, 2), (2, 0)),
         "quad8": ((0, 1), (1, 2), (2, 3), (3, 0)),
         "tetra10": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
         "pyramid13": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
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
#: Types of plane cells, whose faces S1, S2, ... are edges.
_PLANE = ("CPS", "CPE", "CAX")
#: Supports by name: their components.
_SUPPORTS = {"ENCASTRE": (1, 2, 3, 4, 5, 6), "PINNED": (1, 2, 3), "XSYMM": (1, 5, 6),
             "YSYMM": (2, 4, 6), "ZSYMM": (3, 4, 5)}
#: Makes nodes or cells that no file lists.
_GENERATED = ("NGEN", "NFILL", "NCOPY", "ELGEN", "ELCOPY", "SYSTEM", "NMAP")
#: Loads that are none of nodes.
_SPREAD = ("DLOAD", "DSLOAD", "TEMPERATURE")
#: Faces of a shell; CalculiX calls the negative one S1 too, the positive one S2.
_SIDES = ("", "SPOS", "SNEG", "S1", "S2")
_PROCEDURES = {"STATIC": "static", "STEADYSTATEDYNAMICS": "harmonic"}


@dataclass(frozen=True)
class Couple:
    """Two surfaces that touch, by their names in a deck, and their friction where it says that."""

    one: str
    two: str
    mu: float | None = None


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
    numbers : list of (n_cells,) int
        Of the elements of each block.
    elements : dict of int to (str, list of int)
        Type and node numbers of each element.
    node_sets, element_sets : dict of str to list of int
        Numbers by name, in capital letters; surfaces are sets of nodes too.
    surfaces : dict of str to list of (list of int, str)
        Surfaces of element faces: elements, and the face S1, S2, ..., SPOS or SNEG of each; ''
        stands for the free ones.
    node_surfaces : dict of str to list of int
        Surfaces of nodes.
    couples : list of Couple
        Contact pairs that it declares.
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
    numbers: list[Ints] = field(default_factory=list)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    surfaces: dict[str, list[tuple[list[int], str]]] = field(default_factory=dict)
    node_surfaces: dict[str, list[int]] = field(default_factory=dict)
    couples: list[Couple] = field(default_factory=list)
    supports: set[tuple[int, int]] = field(default_factory=set)
    loads: list[NodalLoad] = field(default_factory=list)
    turned: set[int] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)


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
        self.plane: set[int] = set()

    def deck(self) -> Deck:
        """Cards in the order that lets each use what it names, wherever it stands."""
        for card in self.cards:
            if card.word in _GENERATED or (card.word == "NODE" and "SYSTEM" in card.parameters):
                raise InputError(f"{card.where}: *{card.word} makes nodes or cells that the deck "
                                 "does not list; write the mesh out")
        self._nodes()
        self._assembly()
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
        self._contact()
        return self.found

    def _assembly(self) -> None:
        """One part where it is, whose nodes the matrices number as the deck does."""
        instances = list(self._of("INSTANCE"))
        for card in instances:
            if card.lines:
                raise InputError(f"{card.where}: an instance that is moved; write the mesh as one "
                                 "part, where it is")
        if len(instances) > 1:
            raise InputError(f"{instances[1].where}: a second *INSTANCE, whose node numbers are "
                             "not those of the matrices; write a flat deck, without parts and "
                             "assemblies")
        nodes = np.sort(self.found.nodes)
        if instances and not np.array_equal(nodes, np.arange(1, len(nodes) + 1)):
            raise InputError(f"{instances[0].where}: matrices of an assembly number its nodes "
                             "anew, from 1 without gaps, and those of its part are not; write a "
                             "flat deck, without parts and assemblies")

    def _nodes(self) -> None:
        table: list[list[float]] = []
        for card in self._of("NODE"):
            first = len(table)
            for line in card.lines:
                values = numbers_of(line, card.where)
                if len(values) < 2:
                    raise InputError(f"{card.where}: a node needs its number and its position")
                table.append([*values, 0.0, 0.0][:4])
            self._into(self.found.node_sets, card.name("NSET"), [int(v[0]) for v in table[first:]])
        read = self._once(np.array(table, dtype=float).reshape(-1, 4))
        self.found.nodes, self.found.points = read[:, 0].astype(np.int64), read[:, 1:]
        self.place = dict(zip(self.found.nodes.tolist(), self.found.points))

    def _once(self, read: Floats) -> Floats:
        """Nodes that are listed again at the same place are one."""
        _, first, owner = np.unique(read[:, 0], return_index=True, return_inverse=True)
        moved = np.flatnonzero((read != read[first[owner]]).any(axis=1))
        if len(moved):
            raise InputError(f"{self.found.path}: names node {int(read[moved[0], 0])} twice, at "
                             "different places")
        return read[np.sort(first)]

    def _elements(self) -> None:
        index = {node: k for k, node in enumerate(self.found.nodes.tolist())}
        for card in self._of("ELEMENT"):
            kind, n = _cell(card.name("TYPE"))
            every = list(_joined(card, n))
            self._into(self.found.element_sets, card.name("ELSET"), [row[0] for row in every])
            read = [row for row in every if row[0] not in self.found.elements]
            for number, *nodes in every:
                if self.found.elements.setdefault(number, (kind, nodes)) != (kind, nodes):
                    raise InputError(f"{card.where}: element {number} is there twice, with "
                                     "different nodes")
            if card.name("TYPE").startswith(_PLANE):
                self.plane.update(row[0] for row in read)
            self.found.numbers.append(np.array([row[0] for row in read], dtype=np.int64))
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
            for element in self._elements_of(card.name("ELSET"), card.where):
                members += self.found.elements[element][1] if element in self.found.elements else []
        for line in card.lines:
            words = [word for word in words_of(line) if word]
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
                elif self._bare(word) in sets:
                    members += sets[self._bare(word)]
                else:
                    raise InputError(f"{card.where}: there is no set {word} above it")
        self._into(sets, card.name(card.word), members)

    def _surface(self, card: Card) -> None:
        """A surface of nodes, or of faces of elements: its nodes, those in the middle of edges
        too."""
        name, kind = card.name("NAME"), card.name("TYPE")
        if kind not in ("", "NODE", "ELEMENT"):
            self.found.notes.append(f"{card.where}: the surface {name} of type {kind} is left out")
            return
        members: list[int] = []
        for line in card.lines:
            word, label = [*words_of(line), ""][:2]
            if kind == "NODE":
                members += self._named(word, card.where)
            elif "COMBINE" in card.parameters:
                if card.name("COMBINE") != "UNION":
                    raise InputError(f"{card.where}: COMBINE={card.name('COMBINE')} is not read; "
                                     "write the surface by its faces")
                for part in filter(None, words_of(line)):
                    if self._bare(part) not in self.found.surfaces:
                        raise InputError(f"{card.where}: there is no surface {part} above it")
                    self.found.surfaces.setdefault(name, []).extend(
                        self.found.surfaces[self._bare(part)])
                    members += self.found.node_sets[self._bare(part)]
            else:
                chosen = self._elements_of(word, card.where)
                self.found.surfaces.setdefault(name, []).append((chosen, label))
                members += self._on_faces(chosen, label, card.where)
        if kind == "NODE":
            self._into(self.found.node_surfaces, name, members)
        if name not in self.found.node_sets:
            self._into(self.found.node_sets, name, list(dict.fromkeys(members)))

    def _on_faces(self, chosen: list[int], label: str, where: str) -> list[int]:
        """Nodes of the faces with a label."""
        members: list[int] = []
        for element in chosen:
            if element in self.found.elements:
                kind, nodes = self.found.elements[element]
                # A solid without a face stands for those that are free.
                for face in [label] if label or not _faces(kind) else self._free(kind, nodes):
                    members += _face(kind, nodes, face, where, element in self.plane)
        return members

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
        values = np.array([v for line in card.lines for v in numbers_of(line, card.where)])
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
        words = words_of(line)
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
        words = words_of(line)
        try:
            component, value = int(words[1]), float(words[2])
        except (IndexError, ValueError):
            raise InputError(f"{card.where}: expected node or set, component and force, found "
                             f"'{line.strip()}'") from None
        for node in self._named(words[0], card.where):
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

    def _contact(self) -> None:
        """Contact pairs, with the friction of their interaction."""
        friction: dict[str, float] = {}
        interaction = ""
        for card in self.cards:
            if card.word == "SURFACE INTERACTION":
                interaction = card.name("NAME")
            elif card.word == "FRICTION" and interaction and card.lines:
                friction[interaction] = [*numbers_of(card.lines[0], card.where), 0.0][0]
        for card in self._of("CONTACT PAIR"):
            for line in card.lines:
                names = [self._bare(word) for word in words_of(line) if word]
                if len(names) < 2:
                    raise InputError(f"{card.where}: *CONTACT PAIR: '{line}' must name two "
                                     "surfaces")
                self.found.couples.append(Couple(names[0], names[1],
                                                 friction.get(card.name("INTERACTION"))))

    def _named(self, word: str, where: str) -> list[int]:
        """A node or the nodes of a set."""
        word = self._bare(word)
        if word.isdigit():
            return [int(word)]
        if word not in self.found.node_sets:
            raise InputError(f"{where}: there is no node set {word}")
        return self.found.node_sets[word]

    def _elements_of(self, word: str, where: str) -> list[int]:
        """An element or those of a set."""
        word = self._bare(word)
        if word.isdigit():
            return [int(word)]
        if word not in self.found.element_sets:
            raise InputError(f"{where}: there is no element set {word}")
        return self.found.element_sets[word]

    def _bare(self, word: str) -> str:
        """A name without that of the instance before it."""
        instance, dot, name = word.partition(".")
        return name if dot and instance in self._instances else word

    @cached_property
    def _instances(self) -> set[str]:
        return {card.name("NAME") for card in self._of("INSTANCE")}

    def _of(self, word: str) -> Iterator[Card]:
        return (card for card in self.cards if card.word == word)

    @staticmethod
    def _into(sets: dict[str, list[int]], name: str, members: list[int]) -> None:
        if name:
            sets[name] = list(dict.fromkeys([*sets.get(name, []), *members]))


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


def _face(kind: str, nodes: list[int], face: str, where: str, plane: bool) -> list[int]:
    """Nodes of a face S1, S2, ...; of a plane cell those of an edge, of a shell all of them."""
    faces = _faces(kind)
    if not faces and (not plane or not face):
        if face not in _SIDES:
            raise InputError(f"{where}: '{face}' is no face of a shell; expected SPOS or SNEG")
        return nodes
    if plane:
        n = 3 if kind.startswith("triangle") else 4
        faces = tuple((k, (k + 1) % n) for k in range(n))
    if not (face.startswith("S") and face[1:].isdigit() and 1 <= int(face[1:]) <= len(faces)):
        raise InputError(f"{where}: '{face}' is no face of a {kind}; expected S1 to "
                         f"S{len(faces)}")
    corners = faces[int(face[1:]) - 1]
    first = 1 + max(max(corner) for corner in faces)
    return [nodes[k] for k in corners] + [
        nodes[first + k] for k, edge in enumerate(EDGES.get(kind, ()))
        if edge[0] in corners and edge[1] in corners]
