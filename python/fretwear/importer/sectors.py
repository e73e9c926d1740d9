"""One sector of a cyclic structure: its interfaces paired by turning coordinates, and checked.

The sector comes without the cyclic constraint of its program, both interfaces kept. Components of
interface nodes have to turn with the sector: cylindrical nodal systems do; Cartesian ones of the
right interface are turned here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from .cuts import (
    Face,
    faces_by_turning,
    fits,
    left_behind,
    match,
    named_face,
    rotation,
    table_face,
)
from .finding import Finding
from .labels import Dofs
from .meshes import ImportedMesh
from .spectrum import Spectrum, lowest_modes

if TYPE_CHECKING:
    from .build import FullModel

__all__ = ["FRAMES", "Interfaces", "axis_of", "check_interfaces", "cut_faces",
           "in_sector_frames", "pair_faces", "read_interfaces", "tie", "tied_spectrum"]

Floats = NDArray[np.float64]

FRAMES = ("cylindrical", "cartesian")
#: Of a rotation from an orthogonal matrix.
_TURNS = 1e-9
#: Rigid motions of a free body, and those that all sectors of a free disk make alike: along the
#: axis and around it.
_FREE, _ALIKE = 6, 2


@dataclass(frozen=True)
class Interfaces:
    """Both cut faces of a sector.

    Attributes
    ----------
    n_sectors : int
        Sectors of the whole.
    left, right : (n,) int
        Degrees of freedom from 1, in the same order.
    left_nodes, right_nodes : list of int
        Their nodes.
    distance : float
        Largest distance between nodes that are paired, after turning [L].
    turn : (3, 3)
        Rotation from a sector to the next.
    """

    n_sectors: int
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    left_nodes: list[int]
    right_nodes: list[int]
    distance: float
    turn: Floats


def read_interfaces(n_sectors: int, left: Path, right: Path, dofs: Dofs,
                    axis: str = "z") -> Interfaces:
    """Pair the nodes of two tables (node, x, y, z) by turning the left ones by one sector.

    Raises
    ------
    InputError
        Counts, places or components of the nodes do not agree; the message says where.
    """
    return pair_faces(n_sectors, table_face(left), table_face(right), dofs, axis)


def pair_faces(n_sectors: int, left: Face, right: Face, dofs: Dofs, axis: str = "z",
               mesh: ImportedMesh | None = None) -> Interfaces:
    """Pair the nodes of both cut faces by turning the left ones by one sector, `mesh` tells nodes
    at one place apart.

    Raises
    ------
    InputError
        Counts, places or components of the nodes do not agree; the message says where.
    """
    check_sectors(n_sectors)
    if dofs.labels is None:
        raise InputError("--left and --right name nodes, but the files name none; give a label "
                         "table (--labels)")
    turn = rotation(axis, 2.0 * np.pi / n_sectors)
    partner, distance = match(left, right, turn, n_sectors, axis, mesh)
    pairs = [(node, right.nodes[k]) for node, k in zip(left.nodes, partner.tolist())]
    own: dict[int, dict[int, int]] = {}
    for i, (node, component) in enumerate(dofs.labels):
        own.setdefault(node, {})[component] = i + 1
    numbers = np.array([both for one, other in pairs for both in _components(dofs, own, one,
                                                                             other)],
                       dtype=np.int32).reshape(-1, 2)
    return Interfaces(n_sectors, numbers[:, 0], numbers[:, 1], left.nodes, [b for _, b in pairs],
                      float(distance.max()), turn)


def cut_faces(n_sectors: int, left: str | None, right: str | None, axis: str,
              mesh: ImportedMesh | None, leave: Collection[int] = (),
              surfaces: Collection[int] = ()) -> tuple[Face, Face, list[Finding]]:
    """Both cut faces: of tables, of sets of the mesh in either order, or found by turning it.

    Parameters
    ----------
    left, right : str or None
        File of a table, or name of a set.
    leave : collection of int
        Nodes that touch those of other sectors and are not tied.
    surfaces : collection of int
        Nodes of faces that touch those of other sectors; tied faces may have some of them.
    """
    check_sectors(n_sectors)
    if left is None or right is None:
        if mesh is None:
            raise InputError("--sectors needs --left and --right, tables or sets of nodes of the "
                             "cut faces, or a mesh (--mesh) in which they are found by turning it")
        return faces_by_turning(mesh, n_sectors, axis, leave, surfaces)
    turn = rotation(axis, 2.0 * np.pi / n_sectors)
    found: list[Finding] = []
    faces, named = [], 0
    for option, text in (("--left", left), ("--right", right)):
        if mesh is not None and text.upper() in mesh.sets and not Path(text).is_file():
            face, notes = named_face(text, mesh)
            named, found = named + 1, found + notes
        elif mesh is not None and not Path(text).is_file():
            raise InputError(f"{option} {text}: there is no such file, and no set of nodes of this "
                             "name: there are " + (", ".join(sorted(mesh.sets)) or "none"))
        else:
            face = table_face(Path(text))
        faces.append(face)
    one, two = faces
    if named == 2 and not fits(one, two, turn, mesh) and fits(two, one, turn, mesh):
        one, two = two, one
        found.append(Finding("note", "interfaces", f"{one.name}, turned by a sector about {axis}, "
                             f"lies on {two.name}: it is the left face"))
    if mesh is not None and named == 2:
        behind = left_behind(mesh, one, turn, {*leave, *surfaces})
        found += [] if behind is None else [behind]
    return one, two, found


def check_sectors(n_sectors: int) -> None:
    """Refuse what makes no disk."""
    if n_sectors < 2:
        raise InputError(f"--sectors {n_sectors}: must be at least 2")


def in_sector_frames(model: FullModel, interfaces: Interfaces) -> FullModel:
    """The model with Cartesian components of right interface nodes in the frame of the next
    sector."""
    index = {label: i for i, label in enumerate(model.dofs.labels or ())}
    turned = sp.lil_array(sp.identity(model.dofs.n, format="lil"))
    for node in interfaces.right_nodes:
        for first in (1, 4):
            places = [index.get((node, first + c), -1) for c in range(3)]
            there = [c for c in range(3) if places[c] >= 0]
            part = interfaces.turn[np.ix_(there, there)]
            # Held along the axis alone is held along the axis in every sector.
            if np.abs(part @ part.T - np.eye(len(there))).max(initial=0.0) > _TURNS:
                raise InputError(f"node {node} has not all components {first} to {first + 2}, of "
                                 f"those across the axis: it cannot be turned; use cylindrical "
                                 "nodal systems")
            for row, p in enumerate(there):
                for column, c in enumerate(there):
                    turned[places[p], places[c]] = part[row, column]
    q = sp.csr_array(turned)
    return replace(
        model, matrices={role: sp.csr_array(q.T @ matrix @ q)
                         for role, matrix in model.matrices.items()},
        loads={name: q.T @ load for name, load in model.loads.items()},
        speeds={speed: sp.csr_array(q.T @ matrix @ q) for speed, matrix in model.speeds.items()},
        stress=None if model.stress is None else replace(
            model.stress, rows=sp.csr_array(model.stress.rows @ q)),
        # Rows are of the degrees of freedom of the files, as those of stress.
        pairs=model.pairs if model.pairs is None or model.pairs.rows is None else replace(
            model.pairs, rows=sp.csr_array(model.pairs.rows @ q),
            rows_2=None if model.pairs.rows_2 is None else sp.csr_array(model.pairs.rows_2 @ q)),
        notes=[*model.notes, f"{len(interfaces.right_nodes)} nodes of the right interface are in "
               "the frame of the next sector"])


def tied_spectrum(model: FullModel, interfaces: Interfaces,
                  engine: str = "auto") -> Spectrum | None:
    """Lowest modes that all sectors make alike (nodal diameter 0)."""
    alike = tie(interfaces, model.dofs.n)
    mass, stiffness = (sp.csr_array(alike.T @ model.matrices[role] @ alike)
                       for role in ("mass", "stiffness"))
    return lowest_modes(mass, stiffness, engine)


def tie(interfaces: Interfaces, n: int, factor: complex = 1.0) -> sp.csr_array:
    """From the degrees of freedom but the right ones to all of them (n, n_kept): right ones move as
    left ones times a factor."""
    kept = np.setdiff1d(np.arange(n), interfaces.right - 1)
    column = np.concatenate((np.arange(len(kept)), np.searchsorted(kept, interfaces.left - 1)))
    values = np.concatenate((np.ones(len(kept)), np.full(len(interfaces.right), factor)))
    return sp.csr_array((values, (np.concatenate((kept, interfaces.right - 1)), column)),
                        shape=(n, len(kept)))


def check_interfaces(interfaces: Interfaces, alone: Spectrum, tied: Spectrum) -> Iterator[Finding]:
    """Rigid motions of the sector alone, and of all sectors alike."""
    yield Finding("note", "interfaces", f"{len(interfaces.left_nodes)} nodes and "
                  f"{len(interfaces.left)} degrees of freedom on each, at most "
                  f"{interfaces.distance:.2g} from each other after turning")
    free, alike = alone.rigid.shape[1], tied.rigid.shape[1]
    frames = ("the components of the interface nodes do not turn with the sector (--frames "
              "cartesian turns them)")
    if alike > _ALIKE:
        yield Finding("error", "interfaces", f"nodal diameter 0 has {alike} rigid-body motions; a "
                      f"disk has at most {_ALIKE}, along its axis and around it: {frames}, or "
                      "parts or interface nodes are missing")
    elif free >= _FREE and alike < _ALIKE:
        yield Finding("error", "interfaces", f"nodal diameter 0 has {alike} rigid-body motions, "
                      f"where a free disk has {_ALIKE}, along its axis and around it: {frames}, "
                      "or the sector holds a cyclic constraint")
    else:
        yield Finding("note", "interfaces", f"{free} rigid-body motions of the sector, {alike} "
                      "of nodal diameter 0")


def _components(dofs: Dofs, own: Mapping[int, dict[int, int]], left: int,
                right: int) -> list[tuple[int, int]]:
    """Degrees of freedom (from 1) of two nodes, component by component."""
    places = [own.get(node, {}) for node in (left, right)]
    if not places[0] and not places[1]:
        # Held nodes are no part of the matrices.
        held = {node for node, _ in dofs.held}
        if {left, right} <= held:
            return []
    if places[0].keys() != places[1].keys() or not places[0]:
        raise InputError(f"node {left} of the left interface has the components "
                         f"{sorted(places[0])}, node {right} of the right one "
                         f"{sorted(places[1])}; both need the same")
    return [(places[0][c], places[1][c]) for c in sorted(places[0])]


def axis_of(axis: str) -> tuple[float, float, float]:
    """Direction of an axis, from its name."""
    sign = -1.0 if axis.startswith("-") else 1.0
    x, y, z = (sign * float(name == axis[-1]) for name in "xyz")
    return x, y, z
