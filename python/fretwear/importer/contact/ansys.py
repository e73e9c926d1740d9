"""Named selections and contact elements of ANSYS archives (.cdb)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...errors import InputError, OutputError
from ..deck import Couple
from .named import NamedMesh
from .skin import Cells

__all__ = ["is_ansys", "read_ansys_deck"]

#: Element types by their numbers: linear name, corners; of solids degenerate forms too.
_SOLIDS = {185: 8, 45: 8, 186: 8, 95: 8, 5: 8, 187: 4, 92: 4, 285: 4}
_PLANES = (42, 82, 182, 183, 25, 83)
_SHELLS = (63, 93, 181, 281, 43)
_CONTACT, _TARGET = (171, 172, 173, 174), (169, 170)
#: Fields before the nodes of an element: material, type, real constants, ..., element.
_TYPE, _REAL, _N_NODES, _NUMBER, _FIRST = 1, 2, 8, 10, 11


def is_ansys(path: Path) -> bool:
    """Whether a file holds a block of nodes."""
    with open(path, errors="replace") as file:
        return any("NBLOCK" in line.upper() for _, line in zip(range(5000), file))


def read_ansys_deck(path: Path) -> NamedMesh:
    """Nodes, elements, components (CMBLOCK) and pairs of contact elements with one set of real
    constants, called CONTA_3 and TARGE_3 for set 3."""
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    deck = NamedMesh(path, np.zeros((0, 3)), np.zeros(0, dtype=np.int64), [])
    types: dict[int, int] = {}
    places: dict[int, list[float]] = {}
    elements: list[list[int]] = []
    k = 0
    while k < len(lines):
        words = [word.strip().upper() for word in lines[k].split(",")]
        k += 1
        if words[0] == "ET" and len(words) > 2:
            number = re.search(r"\d+$", words[2])
            if number:
                types[int(words[1])] = int(number[0])
        elif words[0] == "NBLOCK":
            k = _nodes(path, lines, k, places)
        elif words[0] == "EBLOCK":
            if "SOLID" not in words:
                raise InputError(f"{path}: EBLOCK without SOLID is not read; write the archive "
                                 "with CDWRITE,DB")
            k = _elements(path, lines, k, elements)
        elif words[0] == "CMBLOCK":
            members, k = _component(lines, k)
            (deck.node_sets if words[2].startswith("NODE") else deck.element_sets)[words[1]] = (
                members)
    deck.nodes = np.array(sorted(places), dtype=np.int64)
    deck.points = np.array([places[node] for node in deck.nodes.tolist()]).reshape(-1, 3)
    _cells(deck, types, elements)
    return deck


def _widths(line: str) -> tuple[int, int, int]:
    """Integers at the front, their width and that of the numbers behind, of (3i9,6e21.13e3)."""
    match = re.match(r"\(\s*(\d+)i(\d+)(?:\s*,\s*\d+e(\d+))?", line.strip().lower())
    if not match:
        raise InputError(f"the format '{line.strip()}' of a block is not known")
    return int(match[1]), int(match[2]), int(match[3] or 0)


def _chopped(line: str, width: int) -> list[int]:
    return [int(line[k:k + width]) for k in range(0, len(line.rstrip()), width)]


def _nodes(path: Path, lines: list[str], k: int, places: dict[int, list[float]]) -> int:
    n, width, real = _widths(lines[k])
    for at in range(k + 1, len(lines)):
        line = lines[at]
        if line.lstrip().startswith(("N,", "-1", "/")):
            return at + 1
        start = n * width
        values = [line[start + i * real:start + (i + 1) * real].strip() for i in range(6)]
        if any(float(value) for value in values[3:] if value):
            # Angles turn the components of the node, which the matrices then have.
            raise InputError(f"{path}: node {int(line[:width])} has a rotated nodal frame; pairs "
                             "of surfaces need components along the global axes: NROTAT none")
        places[int(line[:width])] = [float(value) if value else 0.0 for value in values[:3]]
    return len(lines)


def _elements(path: Path, lines: list[str], k: int, elements: list[list[int]]) -> int:
    _, width, _ = _widths(lines[k])
    at = k + 1
    while at < len(lines):
        if lines[at].strip().startswith("-1"):
            return at + 1
        row = _chopped(lines[at], width)
        at += 1
        while len(row) < _FIRST + row[_N_NODES] and at < len(lines):
            row += _chopped(lines[at], width)
            at += 1
        elements.append(row)
    return at


def _component(lines: list[str], k: int) -> tuple[set[int], int]:
    """Members of a component: a negative number ends a range that the one before begins."""
    count = int(lines[k - 1].split(",")[3])
    _, width, _ = _widths(lines[k])
    numbers: list[int] = []
    at = k + 1
    while len(numbers) < count and at < len(lines):
        numbers += _chopped(lines[at], width)
        at += 1
    found: set[int] = set()
    for before, number in zip([0, *numbers], numbers):
        found |= {number} if number > 0 else set(range(before, -number + 1))
    return found, at


def _cells(deck: NamedMesh, types: dict[int, int], elements: list[list[int]]) -> None:
    at = {node: k for k, node in enumerate(deck.nodes.tolist())}
    blocks: dict[tuple[str, int], list[list[int]]] = {}
    pairs: dict[int, tuple[set[int], set[int]]] = {}
    for row in elements:
        kind = types.get(row[_TYPE], 0)
        nodes = row[_FIRST:_FIRST + row[_N_NODES]]
        if kind in _CONTACT or kind in _TARGET:
            pairs.setdefault(row[_REAL], (set(), set()))[kind in _TARGET].add(row[_NUMBER])
        for name, chosen in _shape(kind, nodes):
            try:
                blocks.setdefault((name, len(chosen)), []).append(
                    [row[_NUMBER], *(at[node] for node in chosen)])
            except KeyError as error:
                raise InputError(f"{deck.path}: element {row[_NUMBER]} names node {error}, which "
                                 "the archive does not have") from None
    for (name, _), rows in blocks.items():
        table = np.array(rows, dtype=np.int64)
        deck.cells.append(Cells(name, table[:, 1:], table[:, 0]))
    for real, (contact, target) in sorted(pairs.items()):
        if contact and target:
            deck.element_sets |= {f"CONTA_{real}": contact, f"TARGE_{real}": target}
            deck.couples.append(Couple(f"CONTA_{real}", f"TARGE_{real}"))


def _shape(kind: int, nodes: list[int]) -> Iterator[tuple[str, list[int]]]:
    """Linear name and nodes of an element with faces."""
    if kind in _SOLIDS:
        if _SOLIDS[kind] == 4:
            yield "tetra", nodes
        else:
            yield "hexahedron", nodes
    elif kind in (*_PLANES, *_SHELLS, 173, 174, 170):
        if len(nodes) in (4, 8) and nodes[2] == nodes[3]:
            # Degenerate: the fourth corner is the third, and so is the middle between them.
            nodes = nodes[:3] + ([nodes[4], nodes[5], nodes[7]] if len(nodes) == 8 else [])
        if len(nodes) in (3, 4, 6, 8):
            yield ("triangle" if len(nodes) in (3, 6) else "quad"), nodes
