"""Named selections and contact elements of ANSYS archives."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..archive import CONTACT, TARGET, read_archive
from ..deck import Couple
from .named import NamedMesh
from .skin import Cells

__all__ = ["read_ansys_deck"]


def read_ansys_deck(path: Path) -> NamedMesh:
    """Nodes, elements, components (CMBLOCK) and pairs of contact elements with one set of real
    constants, called CONTA_3 and TARGE_3 for set 3."""
    read = read_archive(path)
    deck = NamedMesh(path, read.points, read.nodes, [], read.node_sets, read.element_sets,
                     turned=read.turned)
    place = {node: k for k, node in enumerate(read.nodes.tolist())}
    blocks: dict[tuple[str, int], list[list[int]]] = {}
    pairs: dict[int, tuple[set[int], set[int]]] = {}
    for element in read.elements:
        if element.kind in (*CONTACT, *TARGET):
            pairs.setdefault(element.real, (set(), set()))[element.kind in TARGET].add(
                element.number)
        if element.shape:
            blocks.setdefault((element.shape, len(element.nodes)), []).append(
                [element.number, *(place[node] for node in element.nodes)])
    for (name, _), rows in blocks.items():
        table = np.array(rows, dtype=np.int64)
        deck.cells.append(Cells(name, table[:, 1:], table[:, 0]))
    for real, (contact, target) in sorted(pairs.items()):
        if contact and target:
            deck.element_sets |= {f"CONTA_{real}": contact, f"TARGE_{real}": target}
            deck.couples.append(Couple(f"CONTA_{real}", f"TARGE_{real}"))
    return deck
