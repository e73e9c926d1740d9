"""Sets, surfaces and contact pairs of Abaqus and CalculiX input."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..deck import cards
from .deck import Couple, Deck
from .skin import Cells

__all__ = ["read_abaqus_deck"]

#: Element types with faces: linear name in meshio, nodes. Plane ones and shells alike.
_TYPES = (
    (r"C3D4|C3D10\w*", "tetra"), (r"C3D8\w*|C3D20\w*|C3D27\w*", "hexahedron"),
    (r"C3D6\w*|C3D15\w*", "wedge"), (r"C3D5\w*|C3D13\w*", "pyramid"),
    (r"CP[SE]G?[36]\w*|S3\w*|S6\w*|STRI\d+|M3D[36]\w*|SFM3D[36]\w*", "triangle"),
    (r"CP[SE]G?[48]\w*|S4\w*|S8\w*|M3D[48]\w*|SFM3D[48]\w*", "quad"),
)


def read_abaqus_deck(path: Path) -> Deck:
    """What a deck names; parts and assemblies have to be flattened."""
    deck = Deck(path, np.zeros((0, 3)), np.zeros(0, dtype=np.int64), [])
    places: dict[int, list[float]] = {}
    elements: dict[str, list[list[int]]] = {}
    declared: list[tuple[str, str, str]] = []
    friction: dict[str, float] = {}
    interaction = ""
    for card in cards(path):
        keyword, data = card.word, card.lines
        words = {key: value.upper() for key, value in card.parameters.items()}
        if keyword == "INSTANCE":
            raise InputError(f"{path}: holds *INSTANCE; write a flat deck, without parts and "
                             "assemblies, whose node numbers are those of the matrices")
        if keyword == "NODE":
            rows = [_numbers(path, line) for line in data]
            places.update({int(row[0]): (row[1:4] + [0.0] * 3)[:3] for row in rows})
            _add(deck.node_sets, words.get("NSET"), {int(row[0]) for row in rows})
        elif keyword == "ELEMENT":
            kind = next((name for types, name in _TYPES
                         if re.fullmatch(types, words.get("TYPE", ""))), None)
            numbers = [int(value) for line in data for value in _numbers(path, line)]
            rows_of = _split(path, words.get("TYPE", ""), data, numbers)
            _add(deck.element_sets, words.get("ELSET"), {row[0] for row in rows_of})
            if kind is not None:
                elements.setdefault(f"{kind} {len(rows_of[0])}" if rows_of else kind,
                                    []).extend(rows_of)
        elif keyword in ("NSET", "ELSET"):
            known = deck.node_sets if keyword == "NSET" else deck.element_sets
            _add(known, words.get(keyword), _members(path, keyword, words, data, known))
        elif keyword == "SURFACE":
            _surface(deck, words, data)
        elif keyword == "SURFACE INTERACTION":
            interaction = words.get("NAME", "")
        elif keyword == "FRICTION" and interaction and data:
            friction[interaction] = _numbers(path, data[0])[0]
        elif keyword == "CONTACT PAIR":
            for line in data:
                names = [word.strip().upper() for word in line.split(",") if word.strip()]
                if len(names) < 2:
                    raise InputError(f"{path}: *CONTACT PAIR: '{line}' must name two surfaces")
                declared.append((names[0], names[1], words.get("INTERACTION", "")))
    deck.couples = [Couple(one, two, friction.get(name)) for one, two, name in declared]
    deck.nodes = np.array(sorted(places), dtype=np.int64)
    deck.points = np.array([places[node] for node in deck.nodes.tolist()]).reshape(-1, 3)
    at = {node: k for k, node in enumerate(deck.nodes.tolist())}
    for name, members in elements.items():
        try:
            points = np.array([[at[node] for node in row[1:]] for row in members],
                              dtype=np.int64)
        except KeyError as error:
            raise InputError(f"{path}: an element names node {error}, which the deck does not "
                             "have") from None
        deck.cells.append(Cells(name.split()[0], points, np.array([row[0] for row in members])))
    return deck


def _surface(deck: Deck, words: dict[str, str], data: list[str]) -> None:
    """*SURFACE of element faces, or of nodes."""
    name = words.get("NAME", "")
    for line in data:
        fields = [word.strip().upper() for word in line.split(",") if word.strip()]
        if not fields:
            continue
        if words.get("TYPE", "ELEMENT").startswith("NODE"):
            _add(deck.node_sets, name, {int(fields[0])} if fields[0].isdigit() else
                 _known(deck.path, deck.node_sets, fields[0], f"*SURFACE {name}"))
            continue
        elements = ({int(fields[0])} if fields[0].isdigit() else
                    _known(deck.path, deck.element_sets, fields[0], f"*SURFACE {name}"))
        label = fields[1] if len(fields) > 1 else ""
        match = re.fullmatch(r"S(\d)", label)
        if not match and label not in ("", "SPOS", "SNEG"):
            raise InputError(f"{deck.path}: *SURFACE {name}: face '{label}' is not known; must be "
                             "S1 to S6, SPOS or SNEG")
        deck.surfaces.setdefault(name, []).append((elements, int(match[1]) if match else 0))


def _members(path: Path, keyword: str, words: dict[str, str], data: list[str],
             known: dict[str, set[int]]) -> set[int]:
    found: set[int] = set()
    for line in data:
        fields = [word.strip().upper() for word in line.split(",") if word.strip()]
        if "GENERATE" in words:
            first, last, *step = (int(value) for value in fields)
            found |= set(range(first, last + 1, *step))
            continue
        for value in fields:
            found |= ({int(value)} if value.lstrip("-").isdigit() else
                      _known(path, known, value, f"*{keyword} {words.get(keyword, '')}"))
    return found


def _known(path: Path, sets: dict[str, set[int]], name: str, where: str) -> set[int]:
    if name not in sets:
        raise InputError(f"{path}: {where}: there is no set '{name}' before it")
    return sets[name]


def _add(sets: dict[str, set[int]], name: str | None, members: set[int]) -> None:
    if name:
        sets[name] = sets.get(name, set()) | members


def _split(path: Path, kind: str, data: list[str], numbers: list[int]) -> list[list[int]]:
    """Elements of the numbers of their lines: one that ends with a comma goes on in the next."""
    rows: list[list[int]] = []
    goes_on = False
    at = 0
    for line in data:
        n = len([word for word in line.split(",") if word.strip()])
        if not goes_on:
            rows.append([])
        rows[-1] += numbers[at:at + n]
        at += n
        goes_on = line.rstrip().endswith(",")
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"{path}: *ELEMENT, TYPE={kind}: elements have "
                         f"{min(map(len, rows)) - 1} to {max(map(len, rows)) - 1} nodes; a line "
                         "that goes on in the next must end with a comma")
    return rows


def _numbers(path: Path, line: str) -> list[float]:
    try:
        return [float(word) for word in line.split(",") if word.strip()]
    except ValueError:
        raise InputError(f"{path}: '{line.strip()}' must be numbers, separated by commas") from None
