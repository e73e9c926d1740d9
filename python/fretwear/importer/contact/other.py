"""Names of the other meshes: physical groups of Gmsh, cell sets and point sets of meshio."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..gmsh import is_text, read_gmsh
from ..matrix_file import need
from ..meshes import read_mesh_file
from .named import NamedMesh
from .skin import CELLS, Cells

__all__ = ["read_other_deck"]

#: Where meshio keeps the numbers of physical groups.
_GROUP = "gmsh:physical"


def read_other_deck(path: Path) -> NamedMesh:
    """Named groups of cells become element sets, named groups of points node sets."""
    return _of_gmsh(path) if path.suffix.lower() == ".msh" and is_text(path) else _of_meshio(path)


def _of_gmsh(path: Path) -> NamedMesh:
    read = read_gmsh(path)
    deck = NamedMesh(path, read.points, read.nodes, [])
    nodes: dict[int, list[int]] = {}
    for (kind, table), numbers in zip(read.blocks, read.numbers):
        linear = kind.rstrip("0123456789")
        if linear in CELLS:
            deck.cells.append(Cells(linear, table, numbers))
        elif linear == "vertex":
            nodes.update(zip(numbers.tolist(), read.nodes[table].tolist()))
    for name, cells in read.groups.items():
        if cells[0] in nodes:
            deck.node_sets[name] = {node for cell in cells for node in nodes.get(cell, [])}
        else:
            deck.element_sets[name] = set(cells)
    return deck


def _of_meshio(path: Path) -> NamedMesh:
    known = read_mesh_file(path)
    mesh: Any = need("meshio", "meshio", "reading meshes", "export").read(path)
    nodes = known.all_nodes
    deck = NamedMesh(path, known.all_points, nodes, [])
    names = {(int(dimension), int(tag)): str(name).upper()
             for name, (tag, dimension) in mesh.field_data.items()}
    first = 1
    for k, block in enumerate(mesh.cells):
        number = np.arange(first, first + len(block.data))
        first += len(block.data)
        if _GROUP in mesh.cell_data:
            tags = np.asarray(mesh.cell_data[_GROUP][k])
            for tag in np.unique(tags).tolist():
                name = names.get((block.dim, int(tag)), f"GROUP_{int(tag)}")
                _put(deck, name, number[tags == tag])
        for name, parts in mesh.cell_sets.items():
            if not name.startswith("gmsh:") and k < len(parts) and parts[k] is not None:
                _put(deck, name.upper(), number[np.asarray(parts[k], dtype=np.int64)])
        linear = block.type.rstrip("0123456789")
        if linear in CELLS:
            deck.cells.append(Cells(linear, np.asarray(block.data, dtype=np.int64), number))
    for name, members in mesh.point_sets.items():
        deck.node_sets[name.upper()] = set(nodes[np.asarray(members)].tolist())
    return deck


def _put(deck: NamedMesh, name: str, numbers: Any) -> None:
    if len(numbers):
        deck.element_sets.setdefault(name, set()).update(numbers.tolist())
