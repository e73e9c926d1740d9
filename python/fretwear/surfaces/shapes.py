"""Faces of finite elements: nodes, shape functions, and points of integration on triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CORNERS", "NODES", "corner_functions", "shape_functions", "triangle_rule"]

Floats = NDArray[np.float64]

#: Nodes of a face by its name in meshio; those in the middle of edges follow the corners.
NODES = {"triangle": 3, "quad": 4, "triangle6": 6, "quad8": 8, "line": 2, "line3": 3}
CORNERS = {"triangle": 3, "quad": 4, "triangle6": 3, "quad8": 4, "line": 2, "line3": 2}


def corner_functions(n_corners: int, at: Floats) -> Floats:
    """Linear functions of the corners (..., n_corners) at local coordinates (..., 2).

    Triangles: 0 to 1 along their first two edges; quadrilaterals: -1 to 1.
    """
    r, s = at[..., 0], at[..., 1]
    if n_corners == 3:
        return np.stack((1.0 - r - s, r, s), axis=-1)
    return 0.25 * np.stack(((1.0 - r) * (1.0 - s), (1.0 + r) * (1.0 - s),
                            (1.0 + r) * (1.0 + s), (1.0 - r) * (1.0 + s)), axis=-1)


def shape_functions(kind: str, at: Floats) -> Floats:
    """Shape functions of a triangle or quadrilateral (..., n_nodes) at local coordinates."""
    linear = corner_functions(CORNERS[kind], at)
    if kind in ("triangle", "quad"):
        return linear
    if kind == "triangle6":
        after = np.roll(linear, -1, axis=-1)
        return np.concatenate((linear * (2.0 * linear - 1.0), 4.0 * linear * after), axis=-1)
    r, s = at[..., 0], at[..., 1]
    middles = 0.5 * np.stack(((1.0 - r * r) * (1.0 - s), (1.0 + r) * (1.0 - s * s),
                              (1.0 - r * r) * (1.0 + s), (1.0 - r) * (1.0 - s * s)), axis=-1)
    # Each corner gives half of what the middles of both its edges take.
    return np.concatenate((linear - 0.5 * (middles + np.roll(middles, 1, axis=-1)), middles),
                          axis=-1)


def triangle_rule(n: int) -> tuple[Floats, Floats]:
    """Areas coordinates (n * n, 3) and weights, which add up to 1: exact to degree 2 n - 2."""
    place, weight = np.polynomial.legendre.leggauss(n)
    place, weight = 0.5 * (place + 1.0), 0.5 * weight
    u, v = (grid.ravel() for grid in np.meshgrid(place, place, indexing="ij"))
    scale: Any = np.outer(weight, weight).ravel() * (1.0 - u)
    return np.stack(((1.0 - u) * (1.0 - v), u, (1.0 - u) * v), axis=1), 2.0 * scale
