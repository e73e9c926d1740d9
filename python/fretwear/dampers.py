"""Bodies between blades that only rotation presses: wedges, cylinders, strips, split rings.

A body has the displacement u_G of its centre of mass and rotations theta. Its point i, at r_i from
the centre, moves by ``u_G + theta x r_i``, and touches a platform in the frame of its flank,
R = (t1; t2; n) with n from the platform to the body:

    side_1 = R [I, -[r]x] (u_G, theta),    side_2 = R u_platform.

Both are rows of a model (`Model`, rows). x is the tangential direction, from the left flank to the
right one, y points outwards, z along the axis.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array
from .errors import InputError
from .longer import longer_parts, padded
from .loose_bodies import Bodies
from .model import ContactPairs, Model

__all__ = ["KINDS", "Flank", "damper"]

Floats = NDArray[np.float64]

#: The words of contact%law, to which a test holds them.
LAWS = ("dlft", "dlft_velocity", "penalty", "rigid", "regularised", "iwan", "bouc_wen")
KINDS = ("wedge", "cylinder", "strip", "split_ring", "mesh")
#: Flanks of these lie at 90 degrees to the radial direction.
_FLAT = ("strip", "split_ring")
#: Angles of both flanks below this [degrees] are likely radians: no wedge is so slender.
_RADIANS = 3.2
#: Stiffness of pairs whose law takes none.
_UNUSED = {"tangential_stiffness": 1.0, "normal_stiffness": 1.0}


@dataclass(frozen=True)
class Flank:
    """Where a body touches a platform.

    Parameters
    ----------
    dofs : (n_points, 2) or (n_points, 3) int
        Dofs x, y (and z) of the platform under each point, counted from 1, with their signs, or
        numbers of rows behind the dofs; 0 is the ground.
    points : (n_points, 2) or (n_points, 3), optional
        Places of the points from the centre of mass [length]. Of a cylinder they follow from its
        size: left out for one point, or (n_points, 1), the places along the axis.
    sector : int or (n_points,) int
        Of cyclic structures: the sector of the platform, counted from that of the body.
    rows : (n_points, 3, n), optional
        Of kind 'mesh': displacements x, y, z of each point by the coordinates of the body.
    """

    dofs: ArrayLike
    points: ArrayLike | None = None
    sector: ArrayLike = 0
    rows: ArrayLike | None = None


def damper(model: Model, kind: str = "wedge", *, mass: float | None = None,
           inertia: ArrayLike | None = None, radius: float = 0.0,
           angles: tuple[float, float] | None = None, left: Flank | None = None,
           right: Flank | None = None, mu: ArrayLike = 0.0,
           tangential_stiffness: ArrayLike | None = None,
           normal_stiffness: ArrayLike | None = None,
           compliance: tuple[float, float] | None = None, size: float | None = None,
           matrices: tuple[ArrayLike, ArrayLike, ArrayLike | None] | None = None,
           load: ArrayLike | None = None, law: str | None = None,
           name: str = "damper") -> Model:
    """Add a body that no spring holds to a model.

    Parameters
    ----------
    model : Model
        The structure, with what is in contact already; its pairs stay the first. Several bodies
        are added one after another.
    kind : str
        'wedge': flanks at `angles` to the radial direction; 'cylinder': normals through its
        centre; 'strip' and 'split_ring': flanks at 90 degrees; 'mesh': matrices of your own.
    mass : float
        [mass]
    inertia : float, (3,) or (3, 3), optional
        About the centre of mass [mass length^2]: about z in a plane, about all axes in space.
        Without it the body does not rotate.
    radius : float, optional
        Of the centre of mass from the axis [length]: rotation presses the body outwards by
        ``mass * radius * rotation_speed**2``.
    angles : pair of float, optional
        Of the left and the right flank to the radial direction [degrees]; required but for strips
        and rings, whose flanks lie at 90.
    left, right : Flank
        Either may be left out.
    mu, tangential_stiffness, normal_stiffness : float or (n_points,)
        Of the pairs, those of the left flank first; the stiffnesses only for law = 'penalty'.
    compliance : pair of float, optional
        Tangential and normal stiffness of the body at each point [force/length], in series with
        the contact: nodes without mass. Rigid laws need it where points depend on each other.
    size : float, optional
        Radius of a cylinder [length].
    matrices, load : optional
        Of kind 'mesh': mass, stiffness and damping (None for none) of the free body, and its static
        load for each square of the rotation speed (n,).
    law : str, optional
        Law of the pairs, where the model names those of its own.
    name : str
        For messages, and for what is observed of it (``name.x``), where the model says what is
        observed.

    Returns
    -------
    Model
        With the dofs of the body behind those of the model, then those of nodes of `compliance`.

    Raises
    ------
    InputError
        An argument does not fit.

    Warns
    -----
    UserWarning
        Angles that look like radians; a flank whose platforms pull, as where left and right are
        exchanged.
    """
    if kind not in KINDS:
        raise InputError(f"kind: is {kind!r}, must be one of {', '.join(KINDS)}")
    if angles is None:
        if kind not in _FLAT:
            raise InputError(f"angles: are None, must be those of both flanks of a {kind}")
        angles = (90.0, 90.0)
    if kind in _FLAT and any(abs(angle - 90.0) > 0.0 for angle in angles):
        raise InputError(f"angles: are {angles}, must be (90, 90) for a {kind}")
    if len(angles) != 2 or not all(0.0 < angle < 180.0 for angle in angles):
        raise InputError(f"angles: are {angles}, must be two between 0 and 180 degrees")
    if kind != "mesh" and not (matrices is None and load is None):
        raise InputError(f"{'load' if matrices is None else 'matrices'}: is given, must be left "
                         f"out of a {kind}; kind = 'mesh' takes it")
    if law is not None and law not in LAWS:
        raise InputError(f"law: is {law!r}, must be one of {', '.join(LAWS)}")
    if max(angles) < _RADIANS:
        warnings.warn(f"angles: are {angles}, below {_RADIANS:g} degrees: give degrees, not "
                      "radians", stacklevel=2)
    points = [point for side, flank, angle in ((-1, left, angles[0]), (1, right, angles[1]))
              if flank is not None for point in _points(kind, side, flank, angle, size)]
    if not points:
        raise InputError("left and right: are None, must be one Flank at least")
    if model.sectors is None and any(point.sector for point in points):
        raise InputError("sector: is not 0, but the model has no sectors: leave it out, or give "
                         "the model its sectors (/cyclic, Model(sectors=...)) first")
    if kind == "wedge":
        _remark_pull(points)
    n_axes = {len(point.dofs) for point in points}
    if len(n_axes) > 1:
        raise InputError("left.dofs and right.dofs: have 2 and 3 columns, must have the same")
    space = n_axes == {3}
    body = _mesh(matrices, load, points) if kind == "mesh" else _rigid(mass, inertia, space)
    return _joined(model, body, points, radius, compliance, law, name, space, {
        "mu": mu, "tangential_stiffness": tangential_stiffness,
        "normal_stiffness": normal_stiffness})


def _not_negative(name: str, values: ArrayLike, n: int) -> Floats:
    found = array(name, values, (n,))
    if (found < 0.0).any():
        raise InputError(f"{name}: has {found.min()}, must be at least 0")
    return found


def _remark_pull(points: list[_Point]) -> None:
    """A platform presses a body on the side that it lies on: seen from the centre of mass, its
    normal points inwards. (A point far below the centre may do without.)"""
    for where, side in (("left", -1.0), ("right", 1.0)):
        # t2 of the frame says the side.
        of_flank = [point for point in points if point.frame[1, 2] == -side]
        pulls = [point.place @ point.frame[2] > 0.0 and side * point.place[0] < 0.0
                 for point in of_flank]
        if of_flank and all(pulls):
            warnings.warn(f"{where}.points: lie where the {where} flank pulls, as where left and "
                          "right are exchanged: x points from the left flank to the right one, y "
                          "outwards", stacklevel=3)


@dataclass(frozen=True)
class _Point:
    """A point of contact: frame (3, 3) with rows t1, t2, n."""

    dofs: NDArray[np.int64]
    place: Floats
    frame: Floats
    sector: int
    rows: Floats | None


@dataclass(frozen=True)
class _Body:
    """Coordinates: which of the six (-1 for none), mass matrix for a unit of mass, and mass."""

    n: int
    slots: tuple[int, ...]
    unit: Floats
    mass: float
    matrices: tuple[Floats, Floats, Floats | None, Floats | None] | None = None


def _frame(side: int, angle: float) -> Floats:
    """Rows t1, t2, n of a flank at an angle to the radial direction; n to the body."""
    s, c = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    # Of 90 degrees the cosine is 0, not round-off.
    c = 0.0 if abs(c) < 1e-15 else c
    return np.array([[-side * s, c, 0.0], [0.0, 0.0, -side], [-side * c, -s, 0.0]])


def _points(kind: str, side: int, flank: Flank, angle: float,
            size: float | None) -> list[_Point]:
    where = "left" if side < 0 else "right"
    if not isinstance(flank, Flank):
        raise InputError(f"{where}: is a {type(flank).__name__}, must be a Flank")
    dofs = np.asarray(flank.dofs)
    if dofs.ndim != 2 or dofs.shape[1] not in (2, 3) or dofs.dtype.kind not in "iu":
        raise InputError(f"{where}.dofs: must be whole numbers, (n_points, 2) or (n_points, 3)")
    n, axes = dofs.shape
    frame = _frame(side, angle)
    places = np.zeros((n, 3))
    if kind == "cylinder":
        if size is None:
            raise InputError("size: is None, must be the radius of the cylinder")
        places[:] = -size * frame[2]
        if flank.points is not None:
            places[:, 2] = array(f"{where}.points", flank.points, (n, 1))[:, 0]
    elif kind != "mesh":
        if flank.points is None:
            raise InputError(f"{where}.points: is None, must be places, one for each of dofs")
        places[:, :axes] = array(f"{where}.points", flank.points, (n, axes))
    elif flank.rows is None:
        raise InputError(f"{where}.rows: is None, must be displacements of the points by the "
                         "coordinates of the body")
    rows = None if flank.rows is None or kind != "mesh" else array(
        f"{where}.rows", flank.rows, (n, 3, None))
    sector = np.broadcast_to(np.asarray(flank.sector), (n,))
    return [_Point(dofs[i].astype(np.int64), places[i], frame, int(sector[i]),
                   None if rows is None else rows[i]) for i in range(n)]


def _rigid(mass: float | None, inertia: ArrayLike | None, space: bool) -> _Body:
    if mass is None or not float(array("mass", mass, ())) > 0.0:
        raise InputError(f"mass: is {mass}, must be above 0")
    slots: tuple[int, ...] = (0, 1, 2) if space else (0, 1)
    unit = np.zeros((6, 6))
    unit[:3, :3] = np.eye(3)
    if inertia is not None:
        given = array("inertia", inertia, np.shape(inertia))
        if not space:
            if given.size != 1:
                raise InputError("inertia: must be one number in a plane, that about z")
            tensor = np.diag([0.0, 0.0, float(given.ravel()[0])])
        elif given.size == 3:
            tensor = np.diag(given.ravel())
        elif given.shape == (3, 3):
            tensor = given
        else:
            raise InputError("inertia: must be three numbers or (3, 3) in space")
        slots += (3, 4, 5) if space else (5,)
        unit[3:, 3:] = 0.5 * (tensor + tensor.T) / mass
        # A tensor that was turned is symmetric to round-off.
        if np.abs(tensor - tensor.T).max() > 1e-12 * np.abs(tensor).max() or np.linalg.eigvalsh(
                tensor[np.ix_([k - 3 for k in slots if k > 2],
                              [k - 3 for k in slots if k > 2])]).min() <= 0.0:
            raise InputError("inertia: must be symmetric and positive")
    return _Body(len(slots), slots, unit, float(mass))


def _mesh(matrices: tuple[ArrayLike, ArrayLike, ArrayLike | None] | None,
          load: ArrayLike | None, points: list[_Point]) -> _Body:
    if matrices is None:
        raise InputError("matrices: is None, must be mass, stiffness and damping of the body")
    M = array("matrices[0]", matrices[0], (None, None))
    n = len(M)
    K = array("matrices[1]", matrices[1], (n, n))
    C = None if matrices[2] is None else array("matrices[2]", matrices[2], (n, n))
    for point in points:
        if point.rows is not None and point.rows.shape != (3, n):
            raise InputError(f"rows of a flank: have {point.rows.shape[1]} coordinates, must have "
                             f"{n}, as the matrices")
    return _Body(n, (), np.zeros((6, 6)), 0.0,
                 (M, K, C, None if load is None else array("load", load, (n,))))


def _motion(body: _Body, point: _Point) -> Floats:
    """Displacement x, y, z of a point by the coordinates of the body (3, n)."""
    if point.rows is not None:
        return point.rows
    x, y, z = point.place
    # theta x r
    whole = np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
    return whole[:, body.slots]


def _joined(model: Model, body: _Body, points: list[_Point], radius: float,
            compliance: tuple[float, float] | None, law: str | None, name: str, space: bool,
            constants: dict[str, Any]) -> Model:
    components = (0, 1, 2) if space else (0, 2)
    if compliance is not None:
        _not_negative("compliance", compliance, 2)
    n_nodes = 0 if compliance is None else len(points) * len(components)
    first, n = model.n_dof, model.n_dof + body.n + n_nodes
    parts = longer_parts(model, body.n + n_nodes)
    rows = _Rows(parts["rows"], n)
    of_body = np.zeros((body.n, n))
    of_body[:, first:first + body.n] = np.eye(body.n)
    side_1, side_2 = np.zeros((2, len(points), 3), dtype=np.int64)
    stiffness = np.zeros((n, n))
    node = first + body.n
    for i, point in enumerate(points):
        moves = point.frame @ _motion(body, point) @ of_body
        platform = point.frame[:, :len(point.dofs)] @ np.array(
            [rows.of(number, first, body.n + n_nodes) for number in point.dofs])
        for c in components:
            if compliance is None:
                side_1[i, c] = rows.number(moves[c])
            else:
                node += 1
                side_1[i, c] = node
                strain = -moves[c]
                strain[node - 1] += 1.0
                stiffness += compliance[c == 2] * np.outer(strain, strain)
            side_2[i, c] = rows.number(platform[c])
    _add_matrices(parts, stiffness, body, first, n)
    parts["rows"] = rows.matrix()
    given: dict[str, Any] = {
        key: _not_negative(key, value, len(points))
        for key, value in constants.items() if value is not None}
    pairs = ContactPairs(side_1, side_2, sector_2=[point.sector for point in points], **given)
    n_before = model.n_pairs
    parts["contact"] = _more_pairs(parts["contact"], pairs, law)
    if body.matrices is None:
        dof = np.zeros((1, 6), dtype=np.int32)
        dof[0, list(body.slots)] = first + 1 + np.arange(body.n)
        one = Bodies([name], [body.mass], dof, body.unit[None], [radius], [[0.0, 1.0, 0.0]],
                     [point.place for point in points], n_before + np.arange(len(points)),
                     np.zeros(len(points), dtype=np.int32)).checked(n)
        parts["bodies"] = one if parts["bodies"] is None else parts["bodies"].joined(one)
    if parts.get("observe") is not None:
        for k, slot in enumerate(body.slots):
            parts["observe"][f"{name}.{('x', 'y', 'z', 'rx', 'ry', 'rz')[slot]}"] = of_body[k]
    return Model(**parts)


class _Rows:
    """Rows of a model, each of which stands once."""

    def __init__(self, rows: Floats, n_dof: int) -> None:
        self._rows, self._n_dof = [np.asarray(row) for row in rows], n_dof
        self._known = {row.tobytes(): i for i, row in enumerate(self._rows)}

    def of(self, number: int, n_before: int, n_new: int) -> Floats:
        """Row of a signed number of the model before, 0 for the ground."""
        row = np.zeros(self._n_dof)
        k = abs(int(number))
        if k > n_before + len(self._rows):
            raise InputError(f"dofs of left or right: has {number}, must be a dof from 1 to "
                             f"{n_before} or a row behind them, with its sign, or 0 for the ground")
        if k > n_before:
            row[:] = self._rows[k - n_before - 1]
        elif k > 0:
            row[k - 1] = 1.0
        return np.sign(number) * row

    def number(self, row: Floats) -> int:
        """Number of a row, which is added where it is new; 0 of one that is zero."""
        if not np.any(row):
            return 0
        # Without signs of zeros.
        row = row + 0.0
        key = row.tobytes()
        if key not in self._known:
            self._known[key] = len(self._rows)
            self._rows.append(row)
        return self._n_dof + 1 + self._known[key]

    def matrix(self) -> Floats:
        return np.array(self._rows).reshape(-1, self._n_dof)


def _add_matrices(parts: dict[str, Any], stiffness: Floats, body: _Body, first: int,
                  n: int) -> None:
    """Stiffness of nodes, and matrices of a body that is no rigid one."""
    mass, damping, load = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    where = slice(first, first + body.n)
    if body.matrices is not None:
        M, K, C, rate = body.matrices
        mass[where, where] += M
        stiffness[where, where] += K
        if C is not None:
            damping[where, where] += C
        if rate is not None:
            load[where] += rate
    if np.any(load):
        parts["static_rotation"] = load + parts.get("static_rotation", 0.0)
    sectors = parts["sectors"]
    if sectors is None or sectors.diameters is None:
        parts["M"], parts["K"] = parts["M"] + mass, parts["K"] + stiffness
        if parts["C"] is not None or np.any(damping):
            parts["C"] = damping + (0.0 if parts["C"] is None else parts["C"])
        return
    found = {}
    for k, one in sectors.diameters.items():
        more = len(np.asarray(one.M)) - n
        M, K, C = (padded(matrix, more, n, 0, 1) for matrix in (mass, stiffness, damping))
        found[k] = replace(one, M=one.M + M, K=one.K + K,
                           C=one.C if not np.any(C) else C if one.C is None else one.C + C)
    parts["sectors"] = replace(sectors, diameters=found)


def _more_pairs(before: ContactPairs | None, pairs: ContactPairs,
                law: str | None) -> ContactPairs:
    """The pairs of a model, then those of a body."""
    n = len(np.asarray(pairs.side_1))
    if before is None:
        return replace(pairs, law=law)
    m = len(np.asarray(before.side_1))
    side_2 = np.zeros((m, 3), dtype=int) if before.side_2 is None else before.side_2
    values: dict[str, Any] = {"side_1": np.vstack([before.side_1, pairs.side_1]),
                              "side_2": np.vstack([side_2, np.asarray(pairs.side_2)])}
    for field in fields(ContactPairs):
        key = field.name
        first, second = getattr(before, key), getattr(pairs, key)
        if key in ("side_1", "side_2", "law", "normal_law", "table"):
            continue
        if first is None and second is None:
            continue
        if key == "patch":
            values[key] = [*first, *["body"] * n]
        elif key == "position":
            values[key] = np.vstack([first, np.zeros((n, 3))])
        else:
            values[key] = np.concatenate([
                _filled(key, first, m), _filled(key, second, n)])
    values["law"] = _words(before.law, m, law, n, "law")
    if before.normal_law is not None:
        values["normal_law"] = _words(before.normal_law, m, "unilateral", n, "normal_law")
        values["table"] = before.table
    return ContactPairs(**values)


def _filled(key: str, values: ArrayLike | None, n: int) -> NDArray[Any]:
    if values is None:
        zero: Any = 0 if key == "sector_2" else _UNUSED.get(key, 0.0)
        return np.full(n, zero)
    return np.asarray(np.broadcast_to(np.asarray(values), (n,)))


def _words(first: str | Sequence[str] | None, m: int, second: str | None, n: int,
           name: str) -> Any:
    if first == second or (first is None and second is None):
        return first
    if first is None or second is None:
        raise InputError(f"{name}: is {second} of the body and {first} of the pairs of the model, "
                         "must be given for both or for none")
    return [*([first] * m if isinstance(first, str) else first), *[second] * n]
