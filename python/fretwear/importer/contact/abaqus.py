"""Sets, surfaces and contact pairs of Abaqus and CalculiX input."""

from __future__ import annotations

from pathlib import Path

from ..deck import read_deck
from .named import NamedMesh
from .skin import CELLS, Cells

__all__ = ["read_abaqus_deck"]


def read_abaqus_deck(path: Path) -> NamedMesh:
    """What a deck names, as the mesh and the sets are read."""
    deck = read_deck(path)
    cells = [Cells(kind.rstrip("0123456789"), points, numbers)
             for (kind, points), numbers in zip(deck.blocks, deck.numbers)
             if points.shape[1] and kind.rstrip("0123456789") in CELLS]
    return NamedMesh(
        path, deck.points, deck.nodes, cells,
        {name: set(nodes) for name, nodes in (deck.node_sets | deck.node_surfaces).items()},
        {name: set(numbers) for name, numbers in deck.element_sets.items()},
        {name: [(set(numbers), label) for numbers, label in parts]
         for name, parts in deck.surfaces.items()}, deck.couples)
