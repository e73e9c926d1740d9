"""Contact pairs of two surfaces whose meshes need not match.

A pair belongs to a corner k of surface 1 with its linear function N_k. Its area, gap and relative
displacement are integrals over the part where the surfaces face each other,

    A_k = int N_k,   g_k = n_k . int N_k (x_2 - x_1) / A_k,   u_k = int N_k (u_1 - u_2) / A_k,

so that forces A_k p do the work of a constant pressure p on both surfaces, whatever their meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ..errors import InputError
from .picture import RefusedSurfaces
from .segments import Coverage, Side, Weights, cover, integrate, side_of
from .surface import Surface

__all__ = ["SurfacePairs", "contact_pairs"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: A facet may be covered by this share more than once: round-off, and edges of curved surfaces.
_TWICE = 1e-6
#: The same of surface 2, whose facets are seen along the normals of several facets of surface 1.
_TWICE_BEHIND = 0.5
#: Pairs with less than this share of their function are added to a neighbour: their relative
#: displacement would be told by few points, nearly as that of the neighbour.
_SMALL = 0.02
#: Distances that are round-off of the size of the model.
_ROUND = 1e-14


@dataclass(frozen=True)
class SurfacePairs:
    """Contact pairs of two surfaces.

    Attributes
    ----------
    names : tuple of str
        Of both surfaces.
    points : (n_pairs,) int
        Point of the mesh (from 0), a corner of surface 1, that each pair belongs to.
    position : (n_pairs, d)
        Where it is [L]; d is 2 or 3.
    area : (n_pairs,)
        [L^2].
    gap : (n_pairs,)
        [L]; negative: interference.
    frame : (n_pairs, d, d)
        Directions t1, t2, n (of plane surfaces t1, n) as rows; n points from surface 2 to
        surface 1.
    weights_1, weights_2 : (n_pairs, n_points) sparse
        Average displacement of either surface over a pair, by the points of the mesh; rows add up
        to 1.
    matrix : (d n_pairs, d n_points) sparse
        Relative displacements t1, t2, n of one pair after the other, by displacements of point 0,
        point 1, ...; rigid motions give none.
    outside : tuple of float
        Areas of both surfaces that face nothing [L^2].
    """

    names: tuple[str, str]
    points: Ints
    position: Floats
    area: Floats
    gap: Floats
    frame: Floats
    weights_1: sp.csr_array
    weights_2: sp.csr_array
    matrix: sp.csr_array
    outside: tuple[float, float]

    def __len__(self) -> int:
        return len(self.points)


def contact_pairs(surface_1: Surface, surface_2: Surface, *, reach: float | None = None,
                  tangent: Sequence[float] | None = None,
                  thickness: float = 1.0) -> SurfacePairs:
    """Contact pairs where two surfaces face each other.

    Parameters
    ----------
    surface_1, surface_2 : Surface
        Of one mesh. Surface 1 carries the pairs, one at each corner that faces surface 2; take the
        finer one.
    reach : float, optional
        Gaps and overlaps up to here become pairs [L]; without it the longest edge of either.
    tangent : sequence of float, optional
        Direction that t1 is to follow; without it the global axis that is least along the normal.
    thickness : float
        Of plane surfaces [L].

    Raises
    ------
    RefusedSurfaces
        The surfaces lie apart, are inside out, or face each other twice; its `save(path)` draws
        where.
    InputError
        They are not of one mesh, or share faces.
    """
    _check_mesh(surface_1, surface_2)
    if not (np.isfinite(thickness) and thickness > 0.0):
        raise InputError(f"thickness = {thickness}; must be above 0")
    used = np.unique(np.concatenate([surface.nodes[surface.nodes >= 0]
                                     for surface in (surface_1, surface_2)]))
    middle = 0.5 * (surface_1.points[used].min(axis=0) + surface_1.points[used].max(axis=0))
    width = _edge(surface_1)
    side_1, side_2 = (side_of(surface, middle, width) for surface in (surface_1, surface_2))
    if reach is None:
        reach = 2.0 * max(float(side.facets.radius.max()) for side in (side_1, side_2))
    elif not (np.isfinite(reach) and reach > 0.0):
        raise InputError(f"reach = {reach}; must be above 0")
    segments = _faced(surface_1, surface_2, side_1, side_2, reach)
    outside = _outside(surface_1, surface_2, side_1, side_2, segments, reach)
    weights = _merged(integrate(side_1, side_2, segments), surface_1)
    return _pairs(surface_1, surface_2, weights, tangent, thickness,
                  (outside[0] * thickness, outside[1] * thickness))


def _check_mesh(one: Surface, two: Surface) -> None:
    if one.points.shape != two.points.shape or not np.array_equal(one.points, two.points):
        raise InputError(f"{one.name} and {two.name}: must be surfaces of one mesh, with the same "
                         "points")
    keys = [{tuple(sorted(nodes[nodes >= 0].tolist())) for nodes in surface.nodes}
            for surface in (one, two)]
    shared = keys[0] & keys[1]
    if shared:
        raise InputError(f"{one.name} and {two.name}: share {len(shared)} faces, such as that of "
                         f"points {', '.join(map(str, min(shared)))}; must be faces of two bodies "
                         "with nodes of their own")


def _edge(surface: Surface) -> float:
    ends = surface.points[surface.nodes[:, :2]]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())


def _faced(one: Surface, two: Surface, side_1: Side, side_2: Side, reach: float) -> Coverage:
    """Segments of facets that face each other; refused where there are none."""
    found = cover(side_1, side_2, reach)
    segments = found.part(found.facing)
    names = f"{one.name} and {two.name}"
    if not len(segments.one) and len(found.one):
        raise RefusedSurfaces(
            f"{names}: lie on each other, but their normals point the same way: one of them is "
            "inside out; turn the corners of its faces round, or name the faces of the body that "
            "touches", one, two, np.unique(side_1.facets.face[found.one]),
            np.unique(side_2.facets.face[found.two]), normals=True)
    if not len(segments.one):
        corner_1, corner_2 = one.points[one.corners()], two.points[two.corners()]
        distance = cKDTree(corner_2).query(corner_1)[0]
        raise RefusedSurfaces(
            f"{names}: face each other nowhere within reach = {reach:.6g}; their nearest corners "
            f"are {distance.min():.6g} apart; take other surfaces, or another reach", one, two,
            np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    return segments


def _outside(one: Surface, two: Surface, side_1: Side, side_2: Side, segments: Coverage,
             reach: float) -> tuple[float, float]:
    """Areas that face nothing; refused where an area faces twice."""
    facets_1, facets_2 = side_1.facets, side_2.facets
    cosine = -np.einsum("ij,ij->i", facets_1.normal[segments.one], facets_2.normal[segments.two])
    seen = (np.bincount(segments.one, segments.area, len(facets_1.area)),
            np.bincount(segments.two, segments.area / cosine, len(facets_2.area)))
    for k, (surface, facets, allowed) in enumerate(((one, facets_1, _TWICE),
                                                    (two, facets_2, _TWICE_BEHIND))):
        bad = np.flatnonzero(seen[k] > (1.0 + allowed) * facets.area)
        if len(bad):
            other = (two, one)[k]
            faces = np.unique(facets.face[bad])
            own = np.isin((segments.one, segments.two)[k], bad)
            there = np.unique((facets_2.face[segments.two], facets_1.face[segments.one])[k][own])
            raise RefusedSurfaces(
                f"{one.name} and {two.name}: {len(faces)} faces of {surface.name} face "
                f"{other.name} twice within reach = {reach:.6g} (up to "
                f"{(seen[k] / facets.area).max():.3g} times their area): {other.name} must be one "
                "sheet there; leave out the faces behind, or take a smaller reach", one, two,
                *((faces, there) if k == 0 else (there, faces)))
    missing = [max(float(facets.area.sum() - covered.sum()), 0.0) / side.width
               for facets, covered, side in ((facets_1, seen[0], side_1),
                                             (facets_2, seen[1], side_2))]
    return missing[0], missing[1]


def _merged(weights: Weights, surface: Surface) -> Weights:
    """Pairs with a small part of their function added to a neighbour with a larger one."""
    area = weights.area
    small = np.flatnonzero((area > 0.0) & (area < _SMALL * weights.whole))
    target = np.arange(len(area))
    if not len(small):
        return weights
    edges = [surface.nodes[k, :len(_corners(surface, k))] for k in range(len(surface))]
    beside: dict[int, set[int]] = {}
    for corners in edges:
        for corner in corners.tolist():
            beside.setdefault(corner, set()).update(corners.tolist())
    # The largest first, so that whom they are added to is settled.
    for k in small[np.argsort(-area[small], kind="stable")].tolist():
        best = max(beside[k], key=lambda other: (area[other], -other))
        if area[best] > area[k]:
            target[k] = target[best]
    n = len(area)
    gather = sp.csr_array((np.ones(n), (target, np.arange(n))), (n, n))
    return Weights(gather @ area, weights.whole, gather @ weights.normal,
                   sp.csr_array(gather @ weights.one), sp.csr_array(gather @ weights.two))


def _corners(surface: Surface, face: int) -> Ints:
    from .shapes import CORNERS

    return surface.nodes[face, :CORNERS[surface.kind[face]]]


def _pairs(one: Surface, two: Surface, weights: Weights, tangent: Sequence[float] | None,
           thickness: float, outside: tuple[float, float]) -> SurfacePairs:
    chosen = np.flatnonzero(weights.area > 0.0)
    area = weights.area[chosen]
    scale = sp.diags_array(1.0 / area)
    sides = [sp.csr_array(scale @ matrix[chosen]) for matrix in (weights.one, weights.two)]
    d = one.points.shape[1]
    normal = -weights.normal[chosen, :d]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    frame = _frames(normal, tangent)
    # From the middle: large coordinates would cost digits.
    used = np.unique(np.concatenate((one.nodes[one.nodes >= 0], two.nodes[two.nodes >= 0])))
    points = one.points - one.points[used].mean(axis=0)
    apart = sides[0] @ points - sides[1] @ points
    size = float(np.abs(points[used]).max())
    return SurfacePairs(
        (one.name, two.name), chosen, one.points[chosen].copy(), area * thickness,
        np.einsum("ki,ki->k", apart, normal), frame, sides[0], sides[1],
        _rows(sides, frame, apart, points, size), outside)


def _frames(normal: Floats, tangent: ArrayLike | None) -> Floats:
    """Rows t1, t2, n of each pair; t1, n in a plane."""
    d = normal.shape[1]
    if d == 2:
        # t1, n: a quarter turn from each other.
        return np.stack((np.stack((normal[:, 1], -normal[:, 0]), axis=1), normal), axis=1)
    if tangent is None:
        start = np.eye(3)[np.abs(normal).argmin(axis=1)]
    else:
        given = np.asarray(tangent, dtype=float)
        if given.shape != (3,) or not np.isfinite(given).all() or not given.any():
            raise InputError(f"tangent = {tangent!r}; must be three numbers, not all 0")
        start = np.broadcast_to(given / np.linalg.norm(given), normal.shape)
    first = start - np.einsum("ij,ij->i", start, normal)[:, None] * normal
    length = np.linalg.norm(first, axis=1)
    n_along = int((length < 1e-6).sum())
    if n_along:
        raise InputError(f"tangent = {tangent!r}; is along the normal of {n_along} pairs, must be "
                         "across it")
    first /= length[:, None]
    return np.stack((first, np.cross(normal, first), normal), axis=1)


def _rows(sides: list[sp.csr_array], frame: Floats, apart: Floats, points: Floats,
          size: float) -> sp.csr_array:
    """Relative displacements by displacements of points.

    Where the surfaces are apart, a rotation moves facing points past each other. Forces of pairs
    would then make a moment: shifts of the points of surface 1, as a rigid rotation has them,
    take it out.
    """
    n_pairs, d = frame.shape[:2]
    difference = sp.csr_array(sides[0] - sides[1])
    blocks: list[Any] = [sp.kron(difference, np.ones((d, 1)))]
    whole = sp.csr_array(blocks[0])
    columns, values, counts = [], [], []
    rest = np.zeros((n_pairs, d, 3))
    space = np.zeros((n_pairs, 3))
    space[:, :d] = apart
    directions = np.zeros((n_pairs, d, 3))
    directions[:, :, :d] = frame
    rest = np.cross(space[:, None, :], directions)
    for k in range(n_pairs):
        for i in range(d):
            row = slice(whole.indptr[k * d + i], whole.indptr[k * d + i + 1])
            where = whole.indices[row]
            own = whole.data[row][:, None] * frame[k, i]
            if np.abs(rest[k, i]).max() > _ROUND * size:
                own = own + _shift(sides[0], k, where, points, rest[k, i])
            columns.append((where[:, None] * d + np.arange(d)).ravel())
            values.append(own.ravel())
            counts.append(own.size)
    return sp.csr_array((np.concatenate(values), np.concatenate(columns),
                         np.concatenate(([0], np.cumsum(counts)))),
                        (n_pairs * d, d * len(points)))


def _shift(side: sp.csr_array, k: int, where: Ints, points: Floats, moment: Floats) -> Floats:
    """Rows (n, d) with the moment -`moment` and no force, on the points of surface 1."""
    row = slice(side.indptr[k], side.indptr[k + 1])
    weight = np.zeros(len(where))
    at = {int(point): position for position, point in enumerate(where)}
    for point, value in zip(side.indices[row], side.data[row]):
        weight[at[int(point)]] = abs(value)
    place = np.zeros((len(where), 3))
    place[:, :points.shape[1]] = points[where]
    place -= weight @ place / weight.sum()
    inertia = (np.einsum("n,ni,ni->", weight, place, place) * np.eye(3)
               - np.einsum("n,ni,nj->ij", weight, place, place))
    turn = np.linalg.lstsq(inertia, -moment, rcond=1e-10)[0]
    return weight[:, None] * np.cross(turn, place)[:, :points.shape[1]]
