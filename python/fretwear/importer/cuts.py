"""Cut faces of a sector: named by tables or sets of nodes, or found by turning the mesh; their
nodes are matched one by one."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from .finding import Finding
from .meshes import ImportedMesh
from .recovery import surface_faces
from .tables import read_table

__all__ = ["Face", "faces_by_turning", "fits", "left_behind", "match", "named_face", "rotation",
           "table_face"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Turned nodes lie on each other within this share of the distance between neighbours.
_MATCH = 1e-3
#: Positions of six digits are this share of the largest from the true ones.
_DIGITS = 2e-6
#: Neighbours nearer than this share of the usual distance are two nodes at one place.
_ONE_PLACE = 1e-3
#: A turned node lies in a face, between its nodes, within this share of its edge.
_IN_FACE = 1e-2
#: Cosine of the angle between faces at an edge that face each other, below 25 degrees.
_FACING = 0.9
#: Nodes that a message names.
_NAMED = 5


@dataclass(frozen=True)
class Face:
    """Nodes of a cut face.

    Attributes
    ----------
    name : str
        Of its table or set, for messages.
    nodes : list of int
    places : (n, 3)
        [L].
    """

    name: str
    nodes: list[int]
    places: Floats

    def at(self, k: int) -> str:
        """Node and its place, for messages."""
        return f"{self.nodes[k]} {_place(self.places[k])}"


def _place(place: Floats) -> str:
    return "at (" + ", ".join(f"{x:.6g}" for x in place) + ")"


def rotation(axis: str, angle: float) -> Floats:
    """Rotation (3, 3) about x, y or z by the right hand, with a minus the other way."""
    sign, name = (-1.0, axis[1:]) if axis.startswith("-") else (1.0, axis)
    if name not in ("x", "y", "z"):
        raise InputError(f"--axis {axis}: must be x, y, z, -x, -y or -z")
    j, k = ("xyz".index(name) + 1) % 3, ("xyz".index(name) + 2) % 3
    found = np.eye(3)
    c, s = np.cos(angle), sign * np.sin(angle)
    found[j, j], found[j, k], found[k, j], found[k, k] = c, -s, s, c
    return found


def table_face(path: Path) -> Face:
    """Nodes of a table with the columns node, x, y, z."""
    table = read_table(path, ["node", "x", "y", "z"])
    numbers, places = table.numbers("node"), table.vectors(["x", "y", "z"])
    if numbers is None or places is None:
        raise InputError(f"{path}: expected the columns node, x, y, z")
    nodes = numbers.astype(int).tolist()
    if len(set(nodes)) < len(nodes):
        raise InputError(f"{path}: names a node twice")
    return Face(str(path), nodes, places)


def named_face(name: str, mesh: ImportedMesh) -> tuple[Face, list[Finding]]:
    """Nodes of a set, with the nodes in the middle of its edges where the set has corners only."""
    wanted = set(mesh.sets[name.upper()])
    corners = {int(node) for node in mesh.nodes} & wanted
    faces = [face for face in surface_faces(mesh)
             if all(int(mesh.nodes[k]) in corners for k in face)]
    added = _middles(mesh, faces) - wanted
    found = []
    if added:
        found.append(Finding("note", "interfaces", f"{len(added)} nodes in the middle of edges are "
                             f"added to the set {name}, node {min(added)} for one"))
    place = dict(zip(mesh.all_nodes.tolist(), mesh.all_points))
    strange = sorted(wanted - set(place))
    if strange:
        raise InputError(f"set {name}: node {strange[0]} is not in {mesh.path}")
    # Nodes that no cell has are centres of circles and the like.
    used = {int(node) for node in mesh.nodes} | {int(node) for node in mesh.middles[:, 2]}
    nodes = sorted((wanted & used) | added)
    if not nodes:
        raise InputError(f"set {name}: holds no node of a cell of {mesh.path}")
    return Face(name, nodes, np.array([place[node] for node in nodes])), found


def faces_by_turning(mesh: ImportedMesh, n_sectors: int, axis: str, leave: Collection[int],
                     surfaces: Collection[int] = ()) -> tuple[Face, Face, list[Finding]]:
    """Both cut faces of the mesh of a sector: faces of its surface that lie on others when they are
    turned by a sector.

    Parameters
    ----------
    leave : collection of int
        Nodes of contact pairs between sectors, which touch and are not tied.
    surfaces : collection of int
        Nodes of surfaces that touch between sectors: faces of these nodes alone are not tied.

    Raises
    ------
    InputError
        There are none, they do not match, or the mesh is more than a sector; the message says
        where.
    """
    turn = rotation(axis, 2.0 * np.pi / n_sectors)
    by = f"turned by {360.0 / n_sectors:g} degrees about {axis}"
    surface = [face for face in surface_faces(mesh)
               if not any(int(mesh.nodes[k]) in leave for k in face)
               and not all(int(mesh.nodes[k]) in surfaces for k in face)]
    partner = _partners(mesh, surface, turn, by)
    if not partner:
        raise InputError(f"{mesh.path}: no node, {by}, lies on another: is the number of sectors "
                         "or the axis another one (--axis), or the mesh on both sides not the "
                         "same?")
    both = sorted(set(partner) & set(partner.values()))
    if both:
        raise InputError(f"{mesh.path}: {len(both)} nodes lie between others when the mesh is "
                         f"{by}, node {_of_mesh(mesh, both[0])}: the mesh is more than one of "
                         f"{n_sectors} sectors")
    there = {tuple(sorted(face)) for face in surface}
    left = [face for face in surface if all(k in partner for k in face)
            and tuple(sorted(partner[k] for k in face)) in there]
    # Corners that touch lie on others as the tied ones do, in faces beside those that touch.
    tied = {k for face in left for k in face}
    touching = set(np.flatnonzero(np.isin(mesh.nodes, list(surfaces))).tolist()) - tied
    partner = {k: other for k, other in partner.items() if k not in touching}
    _refuse_other_meshes(mesh, surface, partner, turn, by, touching)
    stray = sorted(set(partner) - tied)
    if stray:
        raise InputError(f"{mesh.path}: {len(stray)} nodes, {by}, lie on others without a face "
                         f"that does, node {_of_mesh(mesh, stray[0])}: the mesh is not the same "
                         "on both cut faces, or parts touch there; name the cut faces (--left, "
                         "--right)")
    right = [tuple(partner[k] for k in face) for face in left]
    _refuse_cracks(mesh, surface, left, partner, turn, by)
    parts = _parts(left)
    text = (f"cut faces found by turning: {len(left)} faces of cells on each, in {len(parts)} "
            + ("part" if len(parts) == 1 else "parts"))
    found = [Finding("note", "interfaces", text)]
    if len(parts) > 1:
        where = "; ".join(f"{len(part)} corners around "
                          f"{_place(mesh.points[sorted(part)].mean(axis=0))[3:]}"
                          for part in parts[:_NAMED])
        found = [Finding("warning", "interfaces", f"{text}: {where}. All are tied to the next "
                         "sector: name the cut faces (--left, --right) where parts only touch")]
    return _as_face("left cut face", mesh, left), _as_face("right cut face", mesh, right), found


def left_behind(mesh: ImportedMesh, left: Face, turn: Floats,
                leave: Collection[int]) -> Finding | None:
    """Nodes outside of named faces that lie on others when they are turned, and are not tied."""
    surface = surface_faces(mesh)
    corners = np.unique([k for face in surface for k in face])
    outside = corners[~np.isin(mesh.nodes[corners], [*left.nodes, *leave])]
    if not len(outside):
        return None
    tolerance = _tolerance(mesh.points[corners])
    distance, _ = cKDTree(mesh.points[corners]).query(mesh.points[outside] @ turn.T)
    touching = outside[distance <= tolerance]
    if not len(touching):
        return None
    return Finding("warning", "interfaces", f"{len(touching)} nodes outside of {left.name} lie on "
                   f"others when they are turned by a sector, node "
                   f"{_of_mesh(mesh, int(touching[0]))}: they are not tied")


def fits(left: Face, right: Face, turn: Floats, mesh: ImportedMesh | None) -> bool:
    """Whether every node of the left face lies on one of the right when it is turned."""
    _, distance, tolerance = _nearest(left, right, turn, mesh)
    return bool((distance <= tolerance).all())


def match(left: Face, right: Face, turn: Floats, n_sectors: int, axis: str,
          mesh: ImportedMesh | None = None) -> tuple[Ints, Floats]:
    """Node of the right face (place in its list) that each left one lies on when it is turned, and
    how far from it; of two at one place that of the same part of the mesh.

    Raises
    ------
    InputError
        A node has no partner, or several.
    """
    partner, distance, tolerance = _nearest(left, right, turn, mesh)
    by = f"turned by {360.0 / n_sectors:g} degrees about {axis}"
    alone = np.flatnonzero(distance > tolerance)
    if len(alone):
        worst = int(distance.argmax())
        other_way = np.setdiff1d(np.arange(len(right.nodes)), partner[distance <= tolerance])
        lines = [f"node {left.at(worst)} of {left.name}, {by}, is {distance[worst]:.3g} from the "
                 f"nearest of {right.name}, node {right.at(int(partner[worst]))}; expected below "
                 f"{tolerance:.2g}"]
        for face, which in ((left, alone), (right, other_way)):
            if len(which):
                named = ", ".join(face.at(int(k)) for k in which[:_NAMED])
                lines.append(f"{len(which)} of {len(face.nodes)} nodes of {face.name} have no "
                             f"partner: {named}"
                             + (f" and {len(which) - _NAMED} more" if len(which) > _NAMED else ""))
        lines.append("is the axis right (--axis=-z turns the other way), or left the right one?"
                     + _apart(left, right, axis))
        raise InputError("\n".join(lines))
    if len(left.nodes) != len(right.nodes):
        other_way = np.setdiff1d(np.arange(len(right.nodes)), partner)
        named = ", ".join(right.at(int(k)) for k in other_way[:_NAMED])
        raise InputError(f"{left.name} has {len(left.nodes)} nodes and {right.name} "
                         f"{len(right.nodes)}: the interfaces need equal meshes"
                         + (f"; without a partner are {named}" if len(other_way) else ""))
    if len(set(partner.tolist())) < len(partner):
        raise InputError(f"two nodes of {left.name} lie on one of {right.name}: the interfaces "
                         "need equal meshes")
    return partner, distance


def _apart(left: Face, right: Face, axis: str) -> str:
    """What the angle between the middles of both faces says of the number of sectors."""
    one, two = left.places.mean(axis=0), right.places.mean(axis=0)
    j, k = (("xyz".index(axis[-1]) + c) % 3 for c in (1, 2))
    if min(np.hypot(one[j], one[k]), np.hypot(two[j], two[k])) < 1e-9 * np.abs(one).max():
        return ""
    angle = np.degrees(np.angle((two[j] + 1j * two[k]) / (one[j] + 1j * one[k])))
    angle = -angle if axis.startswith("-") else angle
    if abs(angle) < 1e-6:
        return ""
    return (f" The middle of {right.name} lies {angle:.6g} degrees from that of {left.name}"
            + (f"; {360.0 / angle:.6g} sectors would make a whole" if angle > 0.0 else "") + ".")


def _nearest(left: Face, right: Face, turn: Floats,
             mesh: ImportedMesh | None) -> tuple[Ints, Floats, float]:
    tolerance = _tolerance(left.places)
    turned = left.places @ turn.T
    tree = cKDTree(right.places)
    distance, partner = tree.query(turned)
    partner = partner.astype(np.int64)
    if mesh is not None:
        body = _body_of_nodes(mesh)
        for k, near in enumerate(tree.query_ball_point(turned, tolerance)):
            same = [i for i in near if body.get(right.nodes[i]) == body.get(left.nodes[k])]
            if len(near) > 1 and len(same) == 1:
                partner[k] = same[0]
                distance[k] = np.linalg.norm(turned[k] - right.places[same[0]])
    return partner, distance, tolerance


def _tolerance(places: Floats) -> float:
    """How far from each other nodes are one, after turning."""
    return max(_MATCH * _spacing(places), _DIGITS * float(np.abs(places).max()))


def _spacing(places: Floats) -> float:
    """Smallest distance between neighbours; nodes at one place count once."""
    if len(places) < 2:
        return float(np.abs(places).max())
    nearest = cKDTree(places).query(places, k=min(4, len(places)))[0][:, 1:]
    usual = float(np.median(nearest[:, -1]))
    apart = nearest[nearest > _ONE_PLACE * usual]
    return float(apart.min()) if len(apart) else float(np.abs(places).max())


def _partners(mesh: ImportedMesh, surface: list[tuple[int, ...]], turn: Floats,
              by: str) -> dict[int, int]:
    """Corner of the surface (point of the mesh) that each lies on when it is turned."""
    corners = np.unique([k for face in surface for k in face])
    places = mesh.points[corners]
    tolerance = _tolerance(places)
    body = _body_of_nodes(mesh)
    partner = {}
    for own, near in zip(corners.tolist(),
                         cKDTree(places).query_ball_point(places @ turn.T, tolerance)):
        others = corners[near].tolist()
        if own in others:
            raise InputError(f"{mesh.path}: node {_of_mesh(mesh, own)} is on the axis; {by}, it "
                             "stays where it is, and a sector cannot be tied there: leave a bore "
                             "around the axis")
        if others:
            same = [k for k in others if body.get(int(mesh.nodes[k]))
                    == body.get(int(mesh.nodes[own]))]
            partner[own] = (same or others)[0]
    return partner


def _refuse_other_meshes(mesh: ImportedMesh, surface: list[tuple[int, ...]],
                         partner: dict[int, int], turn: Floats, by: str,
                         touching: set[int]) -> None:
    """Nodes that lie within a face of the surface when they are turned, between its nodes: there
    the meshes of both cut faces differ, or parts touch that are not to (`touching`)."""
    corners = np.unique([k for face in surface for k in face])
    middles = np.array([mesh.points[list(face)].mean(axis=0) for face in surface])
    tree = cKDTree(middles)
    sides = ((turn, set(partner)), (turn.T, set(partner.values())))
    for matrix, matched in sides:
        free = np.array(sorted(set(corners.tolist()) - matched - touching), dtype=np.int64)
        if not len(free):
            continue
        turned = mesh.points[free] @ matrix.T
        _, nearest = tree.query(turned, k=min(6, len(surface)))
        for place, own, faces in zip(turned, free.tolist(), np.atleast_2d(nearest).reshape(
                len(free), -1)):
            for face in faces.tolist():
                corner = mesh.points[list(surface[face])]
                edge = float(np.linalg.norm(corner[1] - corner[0]))
                if _distance(place, corner) < _IN_FACE * edge:
                    raise InputError(f"{mesh.path}: node {_of_mesh(mesh, own)}, {by} or back, "
                                     "lies in a face of the surface, between its nodes: the mesh "
                                     "is not the same on both cut faces, or parts touch there; "
                                     "name the cut faces (--left, --right)")


def _refuse_cracks(mesh: ImportedMesh, surface: list[tuple[int, ...]],
                   left: list[tuple[int, ...]], partner: dict[int, int], turn: Floats,
                   by: str) -> None:
    """Faces of the surface beside matched ones, which face each other where those end: behind the
    edge of a whole cut face the surface goes on from a sector to the next."""
    beside: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for face in surface:
        for edge in _edges(face):
            beside.setdefault(edge, []).append(face)
    one = {tuple(sorted(face)) for face in left}
    two = {tuple(sorted(partner[k] for k in face)) for face in left}
    for face in left:
        for edge in _edges(face):
            across = tuple(sorted(partner[k] for k in edge))
            own = [other for other in beside[edge] if tuple(sorted(other)) not in one]
            next_ = [other for other in beside.get(across, ())
                     if tuple(sorted(other)) not in two]
            if any(turn @ _away(mesh, a, edge) @ _away(mesh, b, across) > _FACING
                   for a in own for b in next_):
                raise InputError(f"{mesh.path}: at node {_of_mesh(mesh, edge[0])} the faces that "
                                 f"lie on others, {by}, end where the surfaces still face each "
                                 "other: the mesh is not the same on both cut faces, or parts "
                                 "touch there; name the cut faces (--left, --right)")


def _edges(face: tuple[int, ...]) -> list[tuple[int, ...]]:
    return [tuple(sorted((face[k - 1], face[k]))) for k in range(len(face))]


def _away(mesh: ImportedMesh, face: tuple[int, ...], edge: tuple[int, ...]) -> Floats:
    """Unit vector within a face, away from an edge of it and square to that."""
    one, two = mesh.points[list(edge)]
    along = (two - one) / np.linalg.norm(two - one)
    off = mesh.points[list(face)].mean(axis=0) - one
    off = off - (off @ along) * along
    size = float(np.linalg.norm(off))
    return np.asarray(off / size if size > 0.0 else off)


def _distance(place: Floats, corner: Floats) -> float:
    """From a point to a face of three or four corners."""
    least = np.inf
    for k in range(1, len(corner) - 1):
        one, two = corner[k] - corner[0], corner[k + 1] - corner[0]
        gram = np.array([[one @ one, one @ two], [one @ two, two @ two]])
        off = place - corner[0]
        a, b = np.linalg.solve(gram, [one @ off, two @ off])
        if a >= -_IN_FACE and b >= -_IN_FACE and a + b <= 1.0 + _IN_FACE:
            least = min(least, float(np.linalg.norm(off - a * one - b * two)))
    return least


def _parts(faces: list[tuple[int, ...]]) -> list[set[int]]:
    """Corners of the connected parts of faces."""
    parts: list[set[int]] = []
    for face in faces:
        touching = [part for part in parts if part & set(face)]
        parts = [part for part in parts if not part & set(face)]
        parts.append(set(face).union(*touching))
    return parts


def _as_face(name: str, mesh: ImportedMesh, faces: list[tuple[int, ...]]) -> Face:
    nodes = sorted({int(mesh.nodes[k]) for face in faces for k in face} | _middles(mesh, faces))
    place = dict(zip(mesh.all_nodes.tolist(), mesh.all_points))
    return Face(name, nodes, np.array([place[node] for node in nodes]))


def _middles(mesh: ImportedMesh, faces: list[tuple[int, ...]]) -> set[int]:
    """Nodes in the middle of the edges of faces."""
    edges = {tuple(sorted((int(mesh.nodes[face[k - 1]]), int(mesh.nodes[face[k]]))))
             for face in faces for k in range(len(face))}
    return {int(middle) for one, two, middle in mesh.middles.tolist()
            if (min(one, two), max(one, two)) in edges}


def _body_of_nodes(mesh: ImportedMesh) -> dict[int, int]:
    """Connected part of the mesh that a node belongs to."""
    there = mesh.cells >= 0
    owner: Any = np.broadcast_to(mesh.body[:, None], mesh.cells.shape)
    found = dict(zip(mesh.nodes[mesh.cells[there]].tolist(), owner[there].tolist()))
    found.update({middle: found[one] for one, _, middle in mesh.middles.tolist() if one in found})
    return found


def _of_mesh(mesh: ImportedMesh, k: int) -> str:
    return f"{int(mesh.nodes[k])} {_place(mesh.points[k])}"
