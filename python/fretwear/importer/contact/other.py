"""Sets of the other meshes that meshio reads: physical groups of Gmsh, cell sets, point sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..matrix_file import need
from ..meshes import read_mesh_file
from .named import NamedMesh
from .skin import CELLS, Cells

__all__ = ["read_other_deck"]

#: Where meshio keeps the numbers of physical groups.
_GROUP = "gmsh:physical"


def read_other_deck(path: Path) -> NamedMesh:
    """Named groups of cells become element sets, named groups of points node sets."""
    known = read_mesh_file(path)
    mesh: Any = need("meshio", "meshio", "reading meshes", "export").read(path)
    nodes = known.all_nodes
    deck = NamedMesh(path, known.all_points, nodes, [])
    names = {int(tag): str(name).upper() for name, (tag, _) in mesh.field_data.items()}
    first = 1
    for k, block in enumerate(mesh.cells):
        number = np.arange(first, first + len(block.data))
        first += len(block.data)
        if _GROUP in mesh.cell_data:
            tags = np.asarray(mesh.cell_data[_GROUP][k])
            for tag in np.unique(tags).tolist():
                _put(deck, names.get(int(tag), f"GROUP_{int(tag)}"), number[tags == tag])
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
