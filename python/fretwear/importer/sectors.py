"""One sector of a cyclic structure: its interfaces paired by turning coordinates, and checked.

The sector comes without the cyclic constraint of its program, both interfaces kept. Components of
interface nodes have to turn with the sector: cylindrical nodal systems do; Cartesian ones of the
right interface are turned here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from .finding import Finding
from .labels import Dofs
from .spectrum import Spectrum, lowest_modes
from .tables import read_table

if TYPE_CHECKING:
    from .build import FullModel

__all__ = ["FRAMES", "Interfaces", "axis_of", "check_interfaces", "in_sector_frames",
           "read_interfaces", "tie", "tied_spectrum"]

Floats = NDArray[np.float64]

FRAMES = ("cylindrical", "cartesian")
#: Turned nodes lie on each other within this share of the distance between neighbours.
_MATCH = 1e-3
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
    if n_sectors < 2:
        raise InputError(f"--sectors {n_sectors}: must be at least 2")
    if dofs.labels is None:
        raise InputError("--left and --right name nodes, but the files name none; give a label "
                         "table (--labels)")
    (one, places), (two, others) = _nodes(left), _nodes(right)
    if len(one) != len(two):
        raise InputError(f"{left} has {len(one)} nodes and {right} {len(two)}: the interfaces "
                         "need equal meshes")
    turn = _rotation(axis, 2.0 * np.pi / n_sectors)
    gaps = np.linalg.norm((places @ turn.T)[:, None] - others[None], axis=2)
    partner = gaps.argmin(axis=1)
    distance = gaps[np.arange(len(one)), partner]
    between = np.linalg.norm(places[:, None] - places[None], axis=2)
    near = between[between > 0.0].min() if (between > 0.0).any() else np.abs(places).max()
    worst = int(distance.argmax())
    if distance[worst] > _MATCH * near:
        raise InputError(
            f"node {one[worst]} of {left}, turned by {360.0 / n_sectors:g} degrees about {axis}, "
            f"is {distance[worst]:.3g} from the nearest of {right}, node {two[partner[worst]]}; "
            f"expected below {_MATCH * near:.2g}. Is the axis right (--axis=-z turns the other "
            "way), or left the right one?")
    if len(set(partner.tolist())) < len(partner):
        raise InputError(f"two nodes of {left} lie on one of {right}: the interfaces need equal "
                         "meshes")
    pairs = [(node, two[k]) for node, k in zip(one, partner)]
    numbers = np.array([both for node, other in pairs for both in _components(dofs, node, other)],
                       dtype=np.int32).reshape(-1, 2)
    return Interfaces(n_sectors, numbers[:, 0], numbers[:, 1], one, [b for _, b in pairs],
                      float(distance.max()), turn)


def in_sector_frames(model: FullModel, interfaces: Interfaces) -> FullModel:
    """The model with Cartesian components of right interface nodes in the frame of the next
    sector."""
    index = {label: i for i, label in enumerate(model.dofs.labels or ())}
    rotation = sp.lil_array(sp.identity(model.dofs.n, format="lil"))
    for node in interfaces.right_nodes:
        for first in (1, 4):
            places = [index.get((node, first + c), -1) for c in range(3)]
            there = [p for p in places if p >= 0]
            if len(there) not in (0, 3):
                raise InputError(f"node {node} has not all components {first} to {first + 2}: it "
                                 "cannot be turned; use cylindrical nodal systems")
            for row, p in enumerate(there):
                for column, q in enumerate(there):
                    rotation[p, q] = interfaces.turn[row, column]
    q = sp.csr_array(rotation)
    return replace(
        model, matrices={role: sp.csr_array(q.T @ matrix @ q)
                         for role, matrix in model.matrices.items()},
        loads={name: q.T @ load for name, load in model.loads.items()},
        speeds={speed: sp.csr_array(q.T @ matrix @ q) for speed, matrix in model.speeds.items()},
        stress=None if model.stress is None else replace(
            model.stress, rows=sp.csr_array(model.stress.rows @ q)),
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


def _nodes(path: Path) -> tuple[list[int], Floats]:
    """Nodes and their places (n, 3) of a table."""
    table = read_table(path, ["node", "x", "y", "z"])
    numbers, places = table.numbers("node"), table.vectors(["x", "y", "z"])
    if numbers is None or places is None:
        raise InputError(f"{path}: expected the columns node, x, y, z")
    nodes = numbers.astype(int).tolist()
    if len(set(nodes)) < len(nodes):
        raise InputError(f"{path}: names a node twice")
    return nodes, places


def _components(dofs: Dofs, left: int, right: int) -> list[tuple[int, int]]:
    """Degrees of freedom (from 1) of two nodes, component by component."""
    labels = dofs.labels or []
    places = [{c: i + 1 for i, (node, c) in enumerate(labels) if node == wanted}
              for wanted in (left, right)]
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


def _rotation(axis: str, angle: float) -> Floats:
    """Rotation (3, 3) about x, y or z by the right hand, with a minus the other way."""
    sign, name = (-1.0, axis[1:]) if axis.startswith("-") else (1.0, axis)
    if name not in ("x", "y", "z"):
        raise InputError(f"--axis {axis}: must be x, y, z, -x, -y or -z")
    j, k = ("xyz".index(name) + 1) % 3, ("xyz".index(name) + 2) % 3
    found = np.eye(3)
    c, s = np.cos(angle), sign * np.sin(angle)
    found[j, j], found[j, k], found[k, j], found[k, k] = c, -s, s, c
    return found
