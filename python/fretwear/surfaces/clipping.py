"""Polygons of a plane, many at once: what two of them have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["clipped", "fans", "polygon_areas"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _next(count: Ints, width: int) -> tuple[NDArray[np.bool_], Ints]:
    """Which vertices are there (n, width), and the one after each."""
    number = np.arange(width)
    there = number < count[:, None]
    return there, np.where(number + 1 < count[:, None], number + 1, 0)


def clipped(polygon: Floats, count: Ints, window: Floats) -> tuple[Floats, Ints]:
    """The part of each polygon inside a convex window (Sutherland and Hodgman).

    Parameters
    ----------
    polygon : (n, width, 2)
        Corners; those behind `count` mean nothing.
    count : (n,) int
        Corners of each.
    window : (n, n_edges, 2)
        Corners of convex windows, anticlockwise; a corner may be there twice.

    Returns
    -------
    polygon, count : (n, width', 2), (n,)
    """
    n_edges = window.shape[1]
    for edge in range(n_edges):
        start, along = window[:, edge], window[:, (edge + 1) % n_edges] - window[:, edge]
        off = polygon - start[:, None]
        height = along[:, None, 0] * off[..., 1] - along[:, None, 1] * off[..., 0]
        there, after = _next(count, polygon.shape[1])
        height_after = np.take_along_axis(height, after, axis=1)
        inside, inside_after = height >= 0.0, height_after >= 0.0
        crosses = there & (inside != inside_after)
        share = np.where(crosses, height, 0.0) / np.where(crosses, height - height_after, 1.0)
        far = np.take_along_axis(polygon, after[..., None], axis=1)
        crossing = polygon + share[..., None] * (far - polygon)
        # Every corner that is inside, then the crossing of the edge that begins there.
        made = np.stack((polygon, crossing), axis=2).reshape(len(polygon), -1, 2)
        kept = np.stack((there & inside, crosses), axis=2).reshape(len(polygon), -1)
        count = kept.sum(axis=1)
        row, column = np.nonzero(kept)
        polygon = np.zeros((len(made), max(int(count.max(initial=0)), 1), 2))
        polygon[row, (np.cumsum(kept, axis=1) - 1)[row, column]] = made[row, column]
    return polygon, count


def polygon_areas(polygon: Floats, count: Ints) -> Floats:
    """Areas (n,), positive where the corners go round anticlockwise."""
    there, after = _next(count, polygon.shape[1])
    off = polygon - polygon[:, :1]
    far = np.take_along_axis(off, after[..., None], axis=1)
    cross = off[..., 0] * far[..., 1] - off[..., 1] * far[..., 0]
    return 0.5 * np.where(there, cross, 0.0).sum(axis=1)


def fans(polygon: Floats, count: Ints) -> tuple[Floats, Ints]:
    """Triangles (n_triangles, 3, 2) of convex polygons, and the polygon that each is of."""
    owner = np.repeat(np.arange(len(count)), np.maximum(count - 2, 0))
    first = np.concatenate(([0], np.cumsum(np.maximum(count - 2, 0))))[:-1]
    number = np.arange(len(owner)) - first[owner] + 1
    return np.stack((polygon[owner, 0], polygon[owner, number], polygon[owner, number + 1]),
                    axis=1), owner
