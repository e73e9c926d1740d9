"""From an imported mesh to the group `/mesh` of the model file: how its points move with the
coordinates of the model, and the faces that its pairs touch with.

The mesh and the matrices come from different files. That they belong together is tested on the
matrices: a rigid motion of the mesh strains nothing, so the rows of K times it vanish away from
supports. Wrong node numbers, other units or other frames of the nodes show there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from ..mesh import RecoveryMesh
from ..reduction import Reduction
from .finding import Finding
from .meshes import ImportedMesh
from .tables import rows_by_sector

if TYPE_CHECKING:
    from .build import FullModel

__all__ = ["check_mesh", "point_motion", "recovery_mesh", "surface_faces"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Outward faces of the cells by the number of their type in VTK; three corners or four.
_FACES = {5: ((0, 1, 2),), 9: ((0, 1, 2, 3),),
          10: ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
          12: ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6),
               (3, 0, 4, 7)),
          13: ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
          14: ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))}
_SHELLS = (5, 9)
#: Rows of K times a rigid motion, over the sizes of their terms, count as zero below this.
_RIGID = 1e-4
#: A stiffness with this share of its entries is a condensed one, whose rows all feel the supports.
_DENSE = 0.9
#: Rows that are enough for a judgement.
_FEWEST = 24
#: The basis in single precision from which a smaller mesh is worth a word [bytes].
_LARGE = 200e6


def recovery_mesh(model: FullModel, reduction: Reduction | None) -> RecoveryMesh:
    """The mesh of a model with the motion of its points.

    Parameters
    ----------
    model : FullModel
        With a mesh.
    reduction : Reduction or None
        Gives the displacement by each coordinate; None: the coordinates are those of the matrices.
    """
    mesh = _mesh(model)
    spread = point_motion(model, mesh)
    motion = (np.asarray(spread.toarray(), dtype=np.float32) if reduction is None
              else reduction.row(spread, np.float32))
    facets, pair, points, average = _facets(model, mesh)
    if len(points) > len(mesh.points):
        added = average @ motion.reshape(len(mesh.points), -1)
        motion = np.concatenate((motion, added.reshape(-1, motion.shape[1]).astype(np.float32)))
    return RecoveryMesh(points, mesh.cells, mesh.body, facets, pair, motion, mesh.kind)


def check_mesh(model: FullModel) -> Iterator[Finding]:
    """What is wrong with a mesh, or remarkable."""
    mesh = _mesh(model)
    for note in mesh.notes:
        yield Finding("note", "mesh", note)
    known = {node for node, _ in model.dofs.labels or ()}
    strange = sorted(known - set(mesh.nodes.tolist()))
    moving = np.isin(mesh.nodes, list(known))
    if not moving.any():
        yield Finding("error", "mesh", f"no node of {mesh.path} is in the matrices, which have "
                      f"nodes {min(known)} to {max(known)}; the mesh has {mesh.nodes.min()} to "
                      f"{mesh.nodes.max()}")
        return
    if not moving.all():
        yield Finding("warning" if (~moving).mean() > 0.5 else "note", "mesh",
                      f"{int((~moving).sum())} of {len(moving)} nodes are not in the matrices: "
                      "they are shown at rest")
    if strange:
        yield Finding("note", "mesh", f"{len(strange)} nodes of the matrices are no corner of a "
                      f"cell, node {strange[0]} for one")
    volume = _volumes(mesh)
    if (volume <= 0.0).any():
        yield Finding("warning", "mesh", f"{int((volume <= 0.0).sum())} of {len(volume)} cells "
                      "have no positive volume: their corners are in another order than that of "
                      "their type")
    strained = _strained(model, mesh)
    if strained is not None and strained > _RIGID:
        yield Finding("warning", "mesh", "moved as a rigid body, the mesh strains the stiffness "
                      f"nearly everywhere (by {strained:.2g} of its terms): the node numbers, "
                      "units or nodal frames of the mesh are not those of the matrices")
    size = 12.0 * len(mesh.points) * model.dofs.n
    if model.dofs.n < 3000 and size > _LARGE:
        yield Finding("warning", "mesh", f"the motion of all points takes {size / 1e6:.0f} MB: "
                      "--reduce makes that smaller")


def _mesh(model: FullModel) -> ImportedMesh:
    if model.mesh is None:
        raise InputError("the model has no mesh")
    if model.dofs.labels is None:
        raise InputError("--mesh: the files name no nodes, which tie the mesh to the matrices; "
                         "give a label table (--labels)")
    return model.mesh


def point_motion(model: FullModel, mesh: ImportedMesh) -> sp.csr_array:
    """Global displacement of the points (3 n_points, n) by the degrees of freedom of the matrices,
    each in the frame of its node."""
    order = np.argsort(mesh.nodes)
    labels = np.array(model.dofs.labels)
    is_motion = (labels[:, 1] >= 1) & (labels[:, 1] <= 3)
    at = np.clip(np.searchsorted(mesh.nodes[order], labels[:, 0]), 0, len(order) - 1)
    point = order[at]
    columns = np.flatnonzero(is_motion & (mesh.nodes[point] == labels[:, 0]))
    frames = _frames(model, mesh)
    point, component = point[columns], labels[columns, 1] - 1
    rows = 3 * point[:, None] + np.arange(3)
    values = frames[point, :, component]
    return sp.csr_array((values.ravel(), (rows.ravel(), np.repeat(columns, 3))),
                        (3 * len(mesh.points), model.dofs.n))


def _frames(model: FullModel, mesh: ImportedMesh) -> Floats:
    """Directions of the components of every node, as columns (n_points, 3, 3)."""
    frames = np.tile(np.eye(3), (len(mesh.points), 1, 1))
    if model.interfaces is None:
        return frames
    if model.in_cylinder is not None:
        axis = np.array(model.in_cylinder)
        off = mesh.points - np.outer(mesh.points @ axis, axis)
        radius = np.linalg.norm(off, axis=1)
        away = radius > 1e-9 * np.abs(mesh.points).max(initial=1.0)
        radial = off[away] / radius[away, None]
        frames[away] = np.stack((radial, np.cross(axis, radial),
                                 np.broadcast_to(axis, radial.shape)), axis=2)
        return frames
    # Cartesian components of the right interface were turned into the next sector.
    frames[np.isin(mesh.nodes, model.interfaces.right_nodes)] = model.interfaces.turn
    return frames


def _strained(model: FullModel, mesh: ImportedMesh) -> float | None:
    """Median share of the rows of K that rigid motions leave; None where supports are everywhere.
    """
    # Nodes in the middle of edges move as rigidly as corners, and stand in the matrices too.
    mesh = replace(mesh, points=mesh.all_points, nodes=mesh.all_nodes)
    stiffness = model.matrices["stiffness"]
    n = model.dofs.n
    if stiffness.nnz > _DENSE * float(n) ** 2 or n < 24:
        return None
    points = mesh.points - mesh.points.mean(axis=0)
    size = np.abs(points).max(initial=0.0) or 1.0
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for k in range(3):
        motions[:, :, 3 + k] = np.cross(np.eye(3)[k], points) / size
    spread = point_motion(model, mesh)
    rigid = np.asarray(spread.T @ motions.reshape(-1, 6))
    labels = np.array(model.dofs.labels)
    frames = dict(zip(mesh.nodes.tolist(), _frames(model, mesh)))
    for row in np.flatnonzero(labels[:, 1] > 3):
        frame = frames.get(int(labels[row, 0]))
        if frame is not None and labels[row, 1] <= 6:
            rigid[row, 3:] = frame[:, labels[row, 1] - 4] / size
    left = np.abs(stiffness @ rigid)
    terms = abs(stiffness) @ np.abs(rigid)
    share = np.where(terms > 0.0, left / np.where(terms > 0.0, terms, 1.0), 0.0)
    # Where a node is that the file does not name, nobody knows: rows that feel it tell nothing.
    unknown = ~np.isin(labels[:, 0], mesh.nodes)
    told = ~unknown & (abs(stiffness) @ unknown.astype(float) == 0.0)
    return float(np.median(share.max(axis=1)[told] if told.sum() >= _FEWEST else
                           share.max(axis=1)))


def _volumes(mesh: ImportedMesh) -> Floats:
    """Volume of every cell by the flux through its faces; one of shells."""
    volume = np.ones(len(mesh.cells))
    for kind in np.unique(mesh.kind):
        if kind in _SHELLS:
            continue
        which = np.flatnonzero(mesh.kind == kind)
        # From the first corner: large coordinates would cost digits.
        place = mesh.points[mesh.cells[which]] - mesh.points[mesh.cells[which, :1]]
        volume[which] = 0.0
        for face in _FACES[int(kind)]:
            corner = place[:, list(face)]
            middle = corner.mean(axis=1)
            for k in range(len(face)):
                volume[which] += np.einsum("ci,ci->c", middle, np.cross(
                    corner[:, k] - middle, corner[:, (k + 1) % len(face)] - middle)) / 6.0
    return volume


def _facets(model: FullModel, mesh: ImportedMesh) -> tuple[Ints, Ints, Floats, Any]:
    """The part of each face of the surface that lies around a node of a pair: corner, middles of
    both edges, middle of the face.

    Returns
    -------
    facets : (n_facets, 4) int
    pair : (n_facets,) int
    points : (n_all, 3)
        Those of the mesh, then the middles.
    average : (n_all - n_points, n_points) sparse
        The middles from the points.
    """
    pair_of = _pairs_of_points(model, mesh)
    none = np.zeros((0, 4), dtype=np.int64), np.zeros(0, dtype=np.int64)
    if (pair_of < 0).all():
        return *none, mesh.points, sp.csr_array((0, len(mesh.points)))
    chosen: list[tuple[tuple[int, ...], int]] = []
    alone: list[tuple[tuple[int, ...], int]] = []
    for face in surface_faces(mesh):
        touching = [k for k, corner in enumerate(face) if pair_of[corner] >= 0]
        (chosen if len(touching) == len(face) else alone).extend((face, k) for k in touching)
    # Pairs without a face of their own: around their nodes, whatever else is there.
    covered = {int(pair_of[face[k]]) for face, k in chosen}
    chosen += [(face, k) for face, k in alone if int(pair_of[face[k]]) not in covered]
    middles: dict[tuple[int, ...], int] = {}
    facets, pairs = [], []
    for face, k in chosen:
        before, corner, after = face[k - 1], face[k], face[(k + 1) % len(face)]
        made = [middles.setdefault(tuple(sorted(group)), len(mesh.points) + len(middles))
                for group in ((corner, after), face, (before, corner))]
        facets.append((corner, *made))
        pairs.append(pair_of[corner])
    rows = np.repeat(np.arange(len(middles)), [len(group) for group in middles])
    columns = np.array([corner for group in middles for corner in group], dtype=int)
    weights = np.repeat([1.0 / len(group) for group in middles], [len(group) for group in middles])
    average = sp.csr_array((weights, (rows, columns)), (len(middles), len(mesh.points)))
    return (np.array(facets, dtype=np.int64).reshape(-1, 4), np.array(pairs, dtype=np.int64),
            np.concatenate((mesh.points, average @ mesh.points)), average)


def _pairs_of_points(model: FullModel, mesh: ImportedMesh) -> Ints:
    """The pair that moves with each point most, from 0; -1 for none."""
    found = np.full(len(mesh.points), -1, dtype=np.int64)
    if model.pairs is None:
        return found
    one, two, number, _ = rows_by_sector(model.pairs, model.dofs.n)
    rows = abs(one) + abs(two)
    pair, direction = np.nonzero(number)
    gather = sp.csr_array((np.ones(len(pair)), (pair, number[pair, direction] - 1)),
                          (len(number), rows.shape[0]))
    spread = abs(point_motion(model, mesh))
    points = sp.csr_array((np.ones(spread.shape[0]), (np.arange(spread.shape[0]) // 3,
                                                      np.arange(spread.shape[0]))))
    weight = sp.csr_array(points @ spread @ (gather @ rows).T)
    touched = np.flatnonzero(np.diff(weight.indptr))
    found[touched] = np.asarray(weight.argmax(axis=1)).ravel()[touched]
    return found


def surface_faces(mesh: ImportedMesh) -> list[tuple[int, ...]]:
    """Faces that belong to one cell, and shells."""
    count: dict[tuple[int, ...], tuple[int, ...] | None] = {}
    for cell, kind in zip(mesh.cells.tolist(), mesh.kind.tolist()):
        for face in _FACES[kind]:
            corners = tuple(cell[k] for k in face)
            key = tuple(sorted(corners))
            count[key] = None if key in count and kind not in _SHELLS else corners
    return [corners for corners in count.values() if corners is not None]
