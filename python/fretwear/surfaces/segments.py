"""Segments of two surfaces: where a facet of one faces a facet of the other.

Facets of surface 1 are clipped by those of surface 2, projected along the normals of surface 1 into
its planes. Integrals go over the triangles of what is left, by points that both facets know in
their own coordinates: products of their shape functions are integrated as they are, which a
projection of nodes alone does not do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .clipping import clipped, fans, polygon_areas
from .shapes import CORNERS, NODES, corner_functions, shape_functions, triangle_rule
from .surface import Facets, Surface, bilinear, facets_of

__all__ = ["Coverage", "Side", "Weights", "cover", "integrate", "side_of"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Facets face each other where the cosine between their normals is below this (78 degrees).
_FACING = -0.2
#: Segments below this share of the smaller facet are round-off of edges that touch.
_SLIVER = 1e-13
#: Points along an edge of a triangle: the fewest are exact for products on two affine faces.
_RULES = (4, 8, 12, 16, 24, 32)
_AFFINE = 1e-9
#: ln 1e15 / 2: points of a smooth function with poles at a distance, see `_points`.
_DIGITS = 17.3
#: Pairs of facets worked on at once.
_BLOCK = 4000


@dataclass(frozen=True)
class Side:
    """A surface in space: lines of plane ones are strips, whose copied points are one point.

    Attributes
    ----------
    points : (n, 3)
        From the middle of the mesh.
    owner : (n,) int
        Point of the mesh.
    facets : Facets
    width : float
        Of the strips; 1 where there are none.
    """

    points: Floats
    owner: Ints
    facets: Facets
    width: float


def side_of(surface: Surface, middle: Floats, width: float) -> Side:
    """A surface in space, its positions from `middle`, its lines drawn out to `width`."""
    n = len(surface.points)
    places = np.zeros((n, 3))
    places[:, :surface.points.shape[1]] = surface.points - middle
    if not surface.is_plane:
        return Side(places, np.arange(n), facets_of(surface, places, surface.kind,
                                                    surface.nodes), 1.0)
    # Below, above, and between for the middles of the ends of quadratic strips.
    points = np.concatenate([
        places + np.array([0.0, 0.0, height]) for height in (0.0, width, 0.5 * width)])
    nodes = np.full((len(surface), 8), -1, dtype=np.int64)
    one, two, middle_node = surface.nodes[:, :3].T
    nodes[:, :4] = np.stack((one, two, two + n, one + n), axis=1)
    quadratic = np.array([kind == "line3" for kind in surface.kind])
    nodes[quadratic, 4:] = np.stack((middle_node, two + 2 * n, middle_node + n, one + 2 * n),
                                    axis=1)[quadratic]
    kinds = ["quad8" if flag else "quad" for flag in quadratic]
    return Side(points, np.tile(np.arange(n), 3), facets_of(surface, points, kinds, nodes), width)


@dataclass(frozen=True)
class Coverage:
    """Segments, each the common part of a facet of surface 1 and one of surface 2.

    Attributes
    ----------
    one, two : (n_segments,) int
        The facets.
    polygon, count : (n_segments, width, 2), (n_segments,)
        In the plane of facet 1, from its centre.
    area, gap : (n_segments,)
        Gap along the normal of facet 1, at the middle of the segment; negative: overlap.
    facing : (n_segments,) bool
        Whether the normals are against each other.
    """

    one: Ints
    two: Ints
    polygon: Floats
    count: Ints
    area: Floats
    gap: Floats
    facing: NDArray[np.bool_]

    def part(self, chosen: NDArray[Any]) -> Coverage:
        """Some of the segments."""
        return Coverage(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def _axes(normal: Floats) -> Floats:
    """Two directions (n, 2, 3) across each normal, which make a right-handed frame with it."""
    start = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = start - np.einsum("ij,ij->i", start, normal)[:, None] * normal
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack((first, np.cross(normal, first)), axis=1)


def _near(one: Facets, two: Facets, reach: float) -> Iterator[tuple[Ints, Ints]]:
    """Facets that may face each other within the reach, a block at a time."""
    tree = cKDTree(two.centre)
    largest = float(two.radius.max())
    for start in range(0, len(one.centre), _BLOCK):
        which = np.arange(start, min(start + _BLOCK, len(one.centre)))
        lists = tree.query_ball_point(one.centre[which], one.radius[which] + largest + reach)
        first = np.repeat(which, [len(found) for found in lists])
        second = np.array([k for found in lists for k in found], dtype=np.int64)
        apart = two.centre[second] - one.centre[first]
        along = np.einsum("ij,ij->i", apart, one.normal[first])
        across = np.linalg.norm(apart - along[:, None] * one.normal[first], axis=1)
        size = one.radius[first] + two.radius[second]
        near = (across <= size) & (np.abs(along) <= size + reach)
        for block in range(0, int(near.sum()), _BLOCK):
            chosen = np.flatnonzero(near)[block:block + _BLOCK]
            yield first[chosen], second[chosen]


def cover(side_1: Side, side_2: Side, reach: float) -> Coverage:
    """All segments within the reach, those of facets that do not face each other too."""
    one, two = side_1.facets, side_2.facets
    found = [_segments(one, two, first, second) for first, second in _near(one, two, reach)]
    empty = np.zeros(0)
    none = Coverage(empty.astype(np.int64), empty.astype(np.int64), np.zeros((0, 3, 2)),
                    empty.astype(np.int64), empty, empty, empty.astype(bool))
    whole = _joined([none, *found])
    return whole.part(np.abs(whole.gap) <= reach)


def _joined(parts: list[Coverage]) -> Coverage:
    width = max(part.polygon.shape[1] for part in parts)
    padded = [replace(part, polygon=np.pad(part.polygon, (
        (0, 0), (0, width - part.polygon.shape[1]), (0, 0)))) for part in parts]
    return Coverage(*(np.concatenate([getattr(part, name) for part in padded])
                      for name in Coverage.__dataclass_fields__))


def _planar(one: Facets, first: Ints, places: Floats) -> Floats:
    """Positions (n, m, 3) in the planes of facets of surface 1 (n, m, 2)."""
    return np.einsum("nkj,nmj->nmk", _axes(one.normal[first]), places - one.centre[first, None])


def _segments(one: Facets, two: Facets, first: Ints, second: Ints) -> Coverage:
    cosine = np.einsum("ij,ij->i", one.normal[first], two.normal[second])
    # Those on edge hardly project to any area.
    seen = np.abs(cosine) > -_FACING
    first, second, cosine = first[seen], second[seen], cosine[seen]
    window = _planar(one, first, one.place[first])
    polygon = _planar(one, first, two.place[second])
    facing = cosine < 0.0
    polygon[facing] = polygon[facing][:, ::-1]
    polygon, count = clipped(polygon, np.full(len(first), 4), window)
    area = polygon_areas(polygon, count)
    kept = area > _SLIVER * np.minimum(one.area[first], two.area[second])
    first, second, polygon, count = first[kept], second[kept], polygon[kept], count[kept]
    there = np.arange(polygon.shape[1]) < count[:, None]
    middle = np.where(there[..., None], polygon, 0.0).sum(axis=1) / np.maximum(count, 1)[:, None]
    axes = _axes(one.normal[first])
    place = one.centre[first] + np.einsum("nk,nkj->nj", middle, axes)
    # Height of the plane of facet 2 above this place.
    normal = two.normal[second]
    gap = (np.einsum("ij,ij->i", two.centre[second] - place, normal)
           / np.einsum("ij,ij->i", one.normal[first], normal))
    return Coverage(first, second, polygon, count, area[kept], gap, facing[kept])


@dataclass(frozen=True)
class Weights:
    """Integrals over segments, for the corners of surface 1 with their linear functions.

    Attributes
    ----------
    area : (n_points,)
        Of each function.
    whole : (n_points,)
        The same over all faces, covered or not.
    normal : (n_points, 3)
        Of the function times the outward normal.
    one, two : (n_points, n_points) sparse
        Of the function times the shape functions of surface 1 and of surface 2.
    """

    area: Floats
    whole: Floats
    normal: Floats
    one: sp.csr_array
    two: sp.csr_array


def integrate(side_1: Side, side_2: Side, segments: Coverage) -> Weights:
    """Integrals over segments, on the points of the mesh."""
    n = int(side_1.owner.max()) + 1
    area, normal = np.zeros(n), np.zeros((n, 3))
    one, two = sp.csr_array((n, n)), sp.csr_array((n, n))
    for rule, chosen in _by_rule(side_1.facets, side_2.facets, segments):
        block = max(_BLOCK * _RULES[0] ** 2 // rule**2, 1)
        for start in range(0, len(chosen), block):
            part = segments.part(chosen[start:start + block])
            for add in _integrals(side_1, side_2, part, rule):
                rows, values = add.rows, add.own.sum(axis=2)
                np.add.at(area, rows, values)
                np.add.at(normal, rows, values[..., None] * add.normal[:, None])
                one = one + _spread(rows, add.columns_1, add.own, n)
                two = two + _spread(rows, add.columns_2, add.other, n)
    whole = np.zeros(n)
    _whole(side_1, whole)
    return Weights(area / side_1.width, whole / side_1.width, normal / side_1.width,
                   sp.csr_array(one / side_1.width), sp.csr_array(two / side_1.width))


def _by_rule(one: Facets, two: Facets, segments: Coverage) -> Iterator[tuple[int, Ints]]:
    """Segments by the points that their facets need."""
    wanted = np.maximum(_points(one)[segments.one], _points(two)[segments.two])
    rule = np.minimum(np.searchsorted(_RULES, wanted), len(_RULES) - 1)
    for number in np.unique(rule):
        yield _RULES[number], np.flatnonzero(rule == number)


def _points(facets: Facets) -> Ints:
    """Points along an edge that integrate functions of a facet to 15 digits.

    In the plane functions of a distorted quadrilateral have a pole where its Jacobian vanishes.
    Gauss points converge by the ellipse around the edge that reaches up to there.
    """
    place = facets.place
    edges = np.roll(place, -1, axis=1) - place
    corner = np.einsum("nci,ni->nc", np.cross(np.roll(edges, 1, axis=1), edges), facets.normal)
    ratio = np.clip(corner.min(axis=1) / corner.max(axis=1), 1e-3, 1.0)
    pole = (1.0 + ratio) / np.maximum(1.0 - ratio, _AFFINE)
    needed = 3 + np.ceil(_DIGITS / np.log(pole + np.sqrt(pole * pole - 1.0))).astype(np.int64)
    skew = np.linalg.norm(place[:, 0] - place[:, 1] + place[:, 2] - place[:, 3], axis=1)
    plain = (facets.count == 3) | (skew <= _AFFINE * facets.radius)
    return np.where(plain, _RULES[0], needed)


@dataclass(frozen=True)
class _Block:
    """Integrals of segments whose faces are of one kind on either side."""

    rows: Ints           # points of the corners of face 1 (n, c)
    columns_1: Ints      # of face 1 (n, k)
    columns_2: Ints      # of face 2 (n, l)
    own: Floats          # (n, c, k)
    other: Floats        # (n, c, l)
    normal: Floats       # (n, 3)


def _integrals(side_1: Side, side_2: Side, segments: Coverage, rule: int) -> Iterator[_Block]:
    one, two = side_1.facets, side_2.facets
    coordinates, weight = triangle_rule(rule)
    for kind_1 in np.unique(one.kind[segments.one]):
        for kind_2 in np.unique(two.kind[segments.two]):
            part = segments.part((one.kind[segments.one] == kind_1)
                                 & (two.kind[segments.two] == kind_2))
            if not len(part.one):
                continue
            triangle, owner = fans(part.polygon, part.count)
            first, second = part.one[owner], part.two[owner]
            at = np.einsum("qc,tcj->tqj", coordinates, triangle)
            edge = triangle[:, 1:] - triangle[:, :1]
            size = 0.5 * (edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
            measure = size[:, None] * weight
            local_1 = _local(one, first, _planar(one, first, one.place[first]), at)
            local_2 = _local(two, second, _planar(one, first, two.place[second]), at)
            hats = corner_functions(CORNERS[str(kind_1)], local_1) * measure[..., None]
            own = np.einsum("tqc,tqk->tck", hats, shape_functions(str(kind_1), local_1))
            other = np.einsum("tqc,tql->tcl", hats, shape_functions(str(kind_2), local_2))
            nodes_1 = side_1.owner[one.nodes[first, :NODES[str(kind_1)]]]
            nodes_2 = side_2.owner[two.nodes[second, :NODES[str(kind_2)]]]
            yield _Block(nodes_1[:, :CORNERS[str(kind_1)]], nodes_1, nodes_2, own, other,
                         one.normal[first])


def _local(facets: Facets, which: Ints, corners: Floats, at: Floats) -> Floats:
    """Local coordinates in the face (n, q, 2) of places in the plane (n, q, 2)."""
    count = facets.count[which]
    own = np.where((count == 3)[:, None, None], 1.0 / 3.0, 0.0) * np.ones_like(at)
    for _ in range(30):
        left = at - bilinear(count, corners, own)
        step = _solved(count, corners, own, left)
        own = own + step
        if np.abs(step).max(initial=0.0) < 1e-14:
            break
    return bilinear(count, facets.local[which], own)


def _solved(count: Ints, corners: Floats, own: Floats, left: Floats) -> Floats:
    """Newton step of own coordinates; of triangles at once the whole way."""
    r, s = own[..., :1], own[..., 1:]
    c = corners[:, None]
    by_r = 0.25 * ((1.0 - s) * (c[:, :, 1] - c[:, :, 0]) + (1.0 + s) * (c[:, :, 2] - c[:, :, 3]))
    by_s = 0.25 * ((1.0 - r) * (c[:, :, 3] - c[:, :, 0]) + (1.0 + r) * (c[:, :, 2] - c[:, :, 1]))
    three = count == 3
    by_r[three] = c[three, :, 1] - c[three, :, 0]
    by_s[three] = c[three, :, 2] - c[three, :, 0]
    turn = by_r[..., 0] * by_s[..., 1] - by_r[..., 1] * by_s[..., 0]
    return np.stack((by_s[..., 1] * left[..., 0] - by_s[..., 0] * left[..., 1],
                     by_r[..., 0] * left[..., 1] - by_r[..., 1] * left[..., 0]),
                    axis=-1) / turn[..., None]


def _spread(rows: Ints, columns: Ints, values: Floats, n: int) -> sp.csr_array:
    shape = values.shape
    at = np.broadcast_to(rows[:, :, None], shape), np.broadcast_to(columns[:, None, :], shape)
    return sp.csr_array((values.ravel(), (at[0].ravel(), at[1].ravel())), (n, n))


def _whole(side: Side, whole: Floats) -> None:
    """Integrals of the linear functions of the corners over whole facets."""
    facets = side.facets
    place = _planar(facets, np.arange(len(facets.face)), facets.place)
    coordinates, weight = triangle_rule(_RULES[0])
    for kind in np.unique(facets.kind):
        which = np.flatnonzero(facets.kind == kind)
        triangle, owner = fans(place[which], facets.count[which])
        edge = triangle[:, 1:] - triangle[:, :1]
        size = 0.5 * (edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
        at = np.einsum("qc,tcj->tqj", coordinates, triangle)
        local = _local(facets, which[owner], place[which[owner]], at)
        hats = corner_functions(CORNERS[str(kind)], local)
        rows = side.owner[facets.nodes[which[owner], :CORNERS[str(kind)]]]
        np.add.at(whole, rows, np.einsum("t,q,tqc->tc", size, weight, hats))
