"""Meshes of other programs: read by meshio (ANSYS archives by mapdl-archive), with the numbers of
their nodes, which tie them to the rows of the matrices.

meshio forgets the numbers of Abaqus and Nastran files. They are read here once more, together with
the positions, which have to be those of meshio in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from ..mesh import CELL_TYPES
from .matrix_file import need

__all__ = ["ImportedMesh", "read_mesh_file"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

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
    if path.suffix.lower() in (".cdb", ".dat") and _is_ansys(path):
        points, nodes, blocks = _read_ansys(path)
    else:
        points, nodes, blocks = _read_meshio(path)
    return _linear(path, points, nodes, blocks)


def _is_ansys(path: Path) -> bool:
    with open(path, errors="replace") as file:
        return any("NBLOCK" in line.upper() for _, line in zip(range(5000), file))


def _read_ansys(path: Path) -> tuple[Floats, Ints, list[tuple[str, Ints]]]:
    archive = need("mapdl_archive", "mapdl-archive", "reading ANSYS archives", "ansys")
    vtk = need("pyvista", "pyvista", "reading ANSYS archives", "ansys")
    grid = archive.Archive(str(path)).grid
    blocks = []
    for kind, cells in grid.cells_dict.items():
        # QUADRATIC_TETRA and so on: corners come first.
        name = vtk.CellType(kind).name.lower().rsplit("_")[-1]
        blocks.append((name, np.asarray(cells, dtype=np.int64)))
    return (np.asarray(grid.points, dtype=float),
            np.asarray(grid.point_data["ansys_node_num"], dtype=np.int64), blocks)


def _read_meshio(path: Path) -> tuple[Floats, Ints, list[tuple[str, Ints]]]:
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
        return points, np.asarray(found).astype(np.int64).ravel(), blocks
    listed = {".inp": _abaqus_nodes, ".bdf": _nastran_nodes, ".nas": _nastran_nodes,
              ".fem": _nastran_nodes, ".dat": _nastran_nodes}.get(path.suffix.lower())
    if listed is None:
        return points, np.arange(1, len(points) + 1), blocks
    table = np.array(list(listed(path)), dtype=float).reshape(-1, 4)
    if len(table) != len(points) or (np.abs(table[:, 1:] - points).max(initial=0.0)
                                     > _SAME * np.abs(points).max(initial=1.0)):
        raise InputError(f"{path}: {len(table)} nodes are listed in it, but meshio finds "
                         f"{len(points)} or others; write the mesh as one file with nodes in "
                         "global coordinates, without INCLUDE and generated nodes")
    return points, table[:, 0].astype(np.int64), blocks


def _abaqus_nodes(path: Path) -> Iterator[list[float]]:
    """Number and position of the nodes below *NODE."""
    inside = False
    with open(path) as file:
        for line in file:
            if line.startswith("**") or not line.strip():
                continue
            if line.startswith("*"):
                inside = line.split(",")[0].strip().upper() == "*NODE"
            elif inside:
                words = [float(word) for word in line.strip().rstrip(",").split(",")[:4]]
                yield words + [0.0] * (4 - len(words))


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
    cells, kinds, left_out = [], [], 0
    for name, corners in blocks:
        linear = name.rstrip("0123456789")
        if linear not in CELL_TYPES:
            left_out += len(corners)
            continue
        number, n = CELL_TYPES[linear]
        if corners.ndim != 2 or corners.shape[1] < n:
            raise InputError(f"{path}: meshio finds cells of type {name} with "
                             f"{corners.shape[-1]} nodes, which have {n} corners")
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
                        _bodies(renumbered, len(used)), notes, points, nodes)


def _bodies(cells: Ints, n_points: int) -> Ints:
    """Number of the connected part of every cell."""
    import scipy.sparse as sp
    from scipy.sparse.csgraph import connected_components

    first = np.broadcast_to(cells[:, :1], cells.shape)
    there = cells >= 0
    graph: Any = sp.coo_array((np.ones(int(there.sum())), (first[there], cells[there])),
                              (n_points, n_points))
    return connected_components(graph, directed=False)[1][cells[:, 0]].astype(np.int64)
