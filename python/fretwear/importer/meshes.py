"""Meshes of other programs: decks of Abaqus and CalculiX, ANSYS archives and files of Gmsh by this
package, all others by meshio, with the numbers of their nodes, which tie them to the rows of the
matrices, and their sets of nodes.

meshio forgets the numbers of Nastran files. They are read here once more, together with the
positions, which have to be those of meshio in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from ..mesh import CELL_TYPES
from .archive import CONTACT, TARGET, is_archive, read_archive
from .deck import EDGES, Deck, read_deck
from .gmsh import is_text, read_gmsh
from .matrix_file import need

__all__ = ["ImportedMesh", "mesh_of_deck", "read_mesh_file"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
#: Positions and numbers of nodes, cells, sets of nodes.
_Read = tuple[Floats, Ints, "list[tuple[str, Ints]]", "dict[str, list[int]]"]

#: Where other formats keep the numbers of nodes, in the point data of meshio.
_NUMBERS = ("node", "node_id", "GlobalNodeId", "ansys_node_num", "gmsh:node_id")
#: Positions of the two readings agree within this share of the largest.
_SAME = 1e-5


@dataclass(frozen=True)
class ImportedMesh:
    """Nodes and linear cells of a mesh; nodes in the middle of edges are left out.

    Attributes
    ----------
    path : Path
        The file.
    points : (n_points, 3)
        Positions of the nodes at corners [L].
    nodes : (n_points,) int
        Their numbers.
    cells : (n_cells, 8) int
        Corners of each cell, points from 0 in the order of VTK; -1 behind the last one.
    kind : (n_cells,) int
        Number of the cell type in VTK.
    body : (n_cells,) int
        Connected part that the cell belongs to.
    notes : list of str
        What was left out.
    all_points, all_nodes : (n_all, 3), (n_all,) int
        Positions and numbers of all nodes of the file, those in the middle of edges too.
    middles : (n_edges, 3) int
        Numbers of both corners of each edge and of the node in its middle.
    sets : dict of str to list of int
        Numbers of nodes by the name of their set, in capital letters.
    """

    path: Path
    points: Floats
    nodes: Ints
    cells: Ints
    kind: Ints
    body: Ints
    notes: list[str]
    all_points: Floats
    all_nodes: Ints
    middles: Ints = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    sets: dict[str, list[int]] = field(default_factory=dict)


def read_mesh_file(path: str | Path) -> ImportedMesh:
    """The mesh of a file that meshio reads, or of an ANSYS archive (.cdb).

    Raises
    ------
    InputError
        The file is of no known format, holds no cells with faces, or names a node twice.
    OutputError
        It cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise OutputError(f"{path}: cannot be read: there is no such file")
    if path.suffix.lower() == ".inp":
        return mesh_of_deck(read_deck(path))
    if path.suffix.lower() in (".cdb", ".dat") and is_archive(path):
        points, nodes, blocks, sets = _read_ansys(path)
    elif path.suffix.lower() == ".msh" and is_text(path):
        points, nodes, blocks, sets = _read_gmsh(path)
    else:
        points, nodes, blocks, sets = _read_meshio(path)
    return replace(_linear(path, points, nodes, blocks), sets=sets)


def mesh_of_deck(deck: Deck) -> ImportedMesh:
    """The mesh of a deck, with its sets of nodes."""
    return replace(_linear(deck.path, deck.points, deck.nodes, deck.blocks), sets=deck.node_sets)


def _read_ansys(path: Path) -> _Read:
    """Cells of an archive without the contact elements that lie on them."""
    read = read_archive(path)
    place = {node: k for k, node in enumerate(read.nodes.tolist())}
    blocks: dict[tuple[str, int], list[list[int]]] = {}
    for element in read.elements:
        if element.shape and element.kind not in (*CONTACT, *TARGET):
            blocks.setdefault((element.shape, len(element.nodes)), []).append(
                [place[node] for node in element.nodes])
    return (read.points, read.nodes,
            [(f"{shape}{n}" if f"{shape}{n}" in EDGES else shape, np.array(rows, dtype=np.int64))
             for (shape, n), rows in blocks.items()],
            {name: sorted(nodes) for name, nodes in read.node_sets.items()})


def _read_gmsh(path: Path) -> _Read:
    read = read_gmsh(path)
    inside = {number: read.nodes[row].tolist() for (_, table), numbers in
              zip(read.blocks, read.numbers) for number, row in zip(numbers.tolist(), table)}
    sets = {name: sorted({node for cell in cells for node in inside[cell]})
            for name, cells in read.groups.items()}
    return read.points, read.nodes, read.blocks, sets


def _read_meshio(path: Path) -> _Read:
    meshio = need("meshio", "meshio", "reading meshes", "export")
    try:
        mesh = meshio.read(path)
    except SystemExit:  # meshio ends the program where it knows no format
        raise InputError(f"{path}: meshio knows no format of this name") from None
    except Exception as error:
        raise InputError(f"{path}: meshio cannot read this mesh: {error or type(error).__name__}"
                         ) from None
    points = np.zeros((len(mesh.points), 3))
    points[:, :mesh.points.shape[1]] = mesh.points
    blocks = [(block.type, np.asarray(block.data, dtype=np.int64)) for block in mesh.cells]
    found = next((mesh.point_data[name] for name in _NUMBERS if name in mesh.point_data), None)
    if found is not None:
        nodes = np.asarray(found).astype(np.int64).ravel()
        return points, nodes, blocks, _sets(mesh, nodes)
    if path.suffix.lower() not in (".bdf", ".nas", ".fem", ".dat"):
        nodes = np.arange(1, len(points) + 1)
        return points, nodes, blocks, _sets(mesh, nodes)
    table = np.array(list(_nastran_nodes(path)), dtype=float).reshape(-1, 4)
    if len(table) != len(points) or (np.abs(table[:, 1:] - points).max(initial=0.0)
                                     > _SAME * np.abs(points).max(initial=1.0)):
        raise InputError(f"{path}: {len(table)} nodes are listed in it, but meshio finds "
                         f"{len(points)} or others; write the mesh as one file with nodes in "
                         "global coordinates, without INCLUDE and generated nodes")
    nodes = table[:, 0].astype(np.int64)
    return points, nodes, blocks, _sets(mesh, nodes)


def _sets(mesh: Any, nodes: Ints) -> dict[str, list[int]]:
    """Sets of nodes, and the nodes of sets of cells, as meshio finds them."""
    found = {}
    for name, parts in mesh.cell_sets.items():
        inside = [np.asarray(block.data)[np.asarray(part, dtype=np.int64)].ravel()
                  for block, part in zip(mesh.cells, parts) if part is not None and len(part)]
        if inside and ":" not in name:
            found[name.upper()] = nodes[np.unique(np.concatenate(inside)).astype(int)].tolist()
    for name, members in mesh.point_sets.items():
        found[name.upper()] = nodes[np.asarray(members, dtype=np.int64)].tolist()
    return found


def _nastran_nodes(path: Path) -> Iterator[list[float]]:
    """Number and position of the GRID entries."""
    bulk = need("pyyeti.nastran.bulk", "pyyeti", "reading the node numbers of Nastran meshes",
                "import")
    grids = bulk.rdgrids(str(path))
    for line in np.zeros((0, 8)) if grids is None else np.asarray(grids, dtype=float):
        if line[1] != 0.0:
            raise InputError(f"{path}: GRID {int(line[0])} lies in coordinate system "
                             f"{int(line[1])}; write the mesh in basic coordinates (CP = 0)")
        yield [line[0], *line[2:5]]


def _linear(path: Path, points: Floats, nodes: Ints,
            blocks: list[tuple[str, Ints]]) -> ImportedMesh:
    """Cells by their corners; nodes that are no corner are left out."""
    cells, kinds, edges, left_out = [], [], [np.zeros((0, 3), dtype=np.int64)], 0
    for name, corners in blocks:
        linear = name.rstrip("0123456789")
        if linear not in CELL_TYPES:
            left_out += len(corners)
            continue
        number, n = CELL_TYPES[linear]
        if corners.ndim != 2 or corners.shape[1] < n:
            raise InputError(f"{path}: meshio finds cells of type {name} with "
                             f"{corners.shape[-1]} nodes, which have {n} corners")
        if name in EDGES and corners.shape[1] == n + len(EDGES[name]):
            edges += [np.column_stack((corners[:, edge], corners[:, n + k]))
                      for k, edge in enumerate(EDGES[name])]
        padded = np.full((len(corners), 8), -1, dtype=np.int64)
        padded[:, :n] = corners[:, :n]
        cells.append(padded)
        kinds.append(np.full(len(corners), number))
    if not cells:
        raise InputError(f"{path}: holds no solid or shell cells; found "
                         + (", ".join(sorted({name for name, _ in blocks})) or "none"))
    every, kind = np.concatenate(cells), np.concatenate(kinds)
    used = np.unique(every[every >= 0])
    place = np.full(len(points) + 1, -1)
    place[used] = np.arange(len(used))
    notes = [f"{path}: {len(used)} nodes and {len(every)} cells"]
    if len(points) > len(used):
        notes[0] += f"; {len(points) - len(used)} nodes that are no corner of one are left out"
    if left_out:
        notes.append(f"{path}: {left_out} cells without faces are left out")
    if len(np.unique(nodes[used])) < len(used):
        raise InputError(f"{path}: names a node twice")
    renumbered = place[every]
    return ImportedMesh(path, points[used], nodes[used], renumbered, kind,
                        _bodies(renumbered, len(used)), notes, points, nodes,
                        np.unique(nodes[np.concatenate(edges)], axis=0))


def _bodies(cells: Ints, n_points: int) -> Ints:
    """Number of the connected part of every cell."""
    import scipy.sparse as sp
    from scipy.sparse.csgraph import connected_components

    first = np.broadcast_to(cells[:, :1], cells.shape)
    there = cells >= 0
    graph: Any = sp.coo_array((np.ones(int(there.sum())), (first[there], cells[there])),
                              (n_points, n_points))
    return connected_components(graph, directed=False)[1][cells[:, 0]].astype(np.int64)
