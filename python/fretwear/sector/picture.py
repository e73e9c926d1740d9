"""Picture of the sector mesh with its contact patches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .contact import FLANKS, boundary_facets, flank_facets
from .mesh import BLADE, DISK
from .model import FullModel

__all__ = ["draw_sector"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_BODY_COLOUR = {BLADE: to_rgb("#8fb3d9"), DISK: to_rgb("#d5cbb8")}
_FLANK_COLOURS = ((to_rgb("#b2182b"), to_rgb("#fcae91")), (to_rgb("#00664b"), to_rgb("#a1dab4")))
_EDGE = to_rgb("#33414f")


def draw_sector(full: FullModel, path: str | Path) -> None:
    """Draw the sector, the root with its flanks coloured by patch, and the cross-section.

    Parameters
    ----------
    full : FullModel
        The sector.
    path : str or Path
        Picture file; the suffix decides on the format.
    """
    figure = Figure(figsize=(12.5, 6.6), dpi=120, facecolor="white")
    sector = figure.add_axes((0.01, 0.02, 0.27, 0.85))
    root = figure.add_axes((0.28, 0.06, 0.36, 0.76))
    section = figure.add_axes((0.69, 0.09, 0.30, 0.78))
    g, d = full.parameters.geometry, full.parameters.discretisation
    _draw_solid(sector, full, (BLADE, DISK), azimuth=-33.0, elevation=20.0)
    _draw_solid(root, full, (BLADE,), azimuth=-30.0, elevation=30.0, top=g.platform_radius)
    _draw_section(section, full)
    titles = ("Blade and disk sector",
              "Blade root below the platform: "
              f"{d.axial_patches} x {d.slope_patches} patches per flank",
              "Cross-section of root and slot")
    for axes, title in zip((sector, root, section), titles, strict=True):
        box = axes.get_position(original=True)
        figure.text(0.5 * (box.x0 + box.x1), 0.895, title, ha="center", fontsize=11)
    figure.suptitle(f"Bladed-disk sector: {d.n_pairs} contact pairs, {len(full.free):,} free "
                    "degrees of freedom", fontsize=14, y=0.975)
    figure.savefig(path)


def _draw_solid(axes: Axes, full: FullModel, bodies: tuple[int, ...], azimuth: float,
                elevation: float, top: float = np.inf) -> None:
    """Shaded boundary of bodies below a radius [mm], seen from azimuth, elevation [degrees]."""
    right, up, towards = _camera(azimuth, elevation)
    corners, colours = [], []
    for body in bodies:
        facets = _visible_facets(full, body, top)
        corners.append(_corners(full, facets))
        colours.append(_colours(full, facets, body))
    quads, colour = np.vstack(corners), np.vstack(colours)
    normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    # Facets have no common orientation: turned to the viewer, then painted from far to near.
    facing = np.where(normal @ towards < 0, -1.0, 1.0)[:, None] * normal
    light = towards + 0.55 * up - 0.45 * right
    shade = 0.5 + 0.5 * np.clip(facing @ (light / np.linalg.norm(light)), 0.0, 1.0)
    order = np.argsort((quads @ towards).mean(axis=1))
    flat = np.stack((quads @ right, quads @ up), axis=-1)[order]
    axes.add_collection(PolyCollection(list(flat), facecolors=(colour * shade[:, None])[order],
                                       edgecolors=[(*_EDGE, 0.55)], linewidths=0.45))
    _frame(axes, flat.reshape(-1, 2))


def _visible_facets(full: FullModel, body: int, top: float) -> Ints:
    """Boundary facets of a body below a radius, and the facets that cap it there."""
    facets, centre = boundary_facets(full.sector, body)
    mesh = full.sector.mesh
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    inner = inner[full.sector.body[mesh.f2t[0, inner]] == body]
    radius = mesh.p[1][mesh.facets[:, inner]]
    cap = inner[(np.abs(radius - top) < 1e-6).all(axis=0)]
    return np.concatenate((facets[centre[:, 1] < top - 1e-6], cap))


def _camera(azimuth: float, elevation: float) -> tuple[Floats, Floats, Floats]:
    """Right, up and towards-the-viewer directions; azimuth 0 looks along -z."""
    a, e = np.radians(azimuth), np.radians(elevation)
    towards = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    return right, np.cross(towards, right), towards


def _corners(full: FullModel, facets: Ints) -> Floats:
    """Corners of facets in cyclic order, (n, 4, 3) [mm]."""
    mesh = full.sector.mesh
    points = mesh.p[:, mesh.facets[:, facets]].transpose(2, 1, 0)
    # Vertex numbers are sorted within a facet: go round its centre by angle instead.
    offset = points - points.mean(axis=1, keepdims=True)
    first = offset[:, 0] / np.linalg.norm(offset[:, 0], axis=1, keepdims=True)
    normal = np.cross(offset[:, 0], offset[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    second = np.cross(normal, first)
    angle = np.arctan2(np.einsum("nkc,nc->nk", offset, second),
                       np.einsum("nkc,nc->nk", offset, first))
    return np.take_along_axis(points, np.argsort(angle, axis=1)[:, :, None], axis=1)


def _colours(full: FullModel, facets: Ints, body: int) -> Floats:
    """Colour of each facet: that of its patch on a flank, that of the body elsewhere, (n, 3)."""
    colour = np.tile(_BODY_COLOUR[body], (len(facets), 1))
    flank, pair = flank_facets(full.sector, full.parameters, body)
    pair_of = dict(zip(flank.tolist(), pair.tolist(), strict=True))
    for k, facet in enumerate(facets.tolist()):
        if facet in pair_of:
            colour[k] = _patch_colour(full, pair_of[facet])
    return colour


def _patch_colour(full: FullModel, pair: int) -> Floats:
    """Shade of the flank's colour: rows from dark to light, alternating along the axis."""
    d = full.parameters.discretisation
    flank, within = divmod(pair, d.axial_patches * d.slope_patches)
    row, column = divmod(within, d.axial_patches)
    weight = 0.75 * row / max(d.slope_patches - 1, 1) + 0.25 * (column % 2)
    dark, light = (np.array(c) for c in _FLANK_COLOURS[flank])
    return (1.0 - weight) * dark + weight * light


def _draw_section(axes: Axes, full: FullModel) -> None:
    """Front face of root and disk with the flanks drawn bold."""
    g, d = full.parameters.geometry, full.parameters.discretisation
    front = 0.5 * g.axial_length
    for body in (DISK, BLADE):
        facets, _ = boundary_facets(full.sector, body)
        quads = _corners(full, facets)
        flat = (np.abs(quads[:, :, 2] - front) < 1e-6).all(axis=1)
        quads = quads[flat & (quads[:, :, 1].max(axis=1) < g.airfoil_radius + 1e-6)]
        axes.add_collection(PolyCollection(quads[:, :, :2], facecolors=[_BODY_COLOUR[body]],
                                           edgecolors=[(*_EDGE, 0.8)], linewidths=0.6,
                                           snap=False))
    for number, (name, side) in enumerate(FLANKS):
        ends = np.array([[side * g.root_half_width, g.flank_radius],
                         [side * g.neck_half_width, g.flank_top_radius]])
        points = ends[0] + np.linspace(0, 1, d.slope_patches + 1)[:, None] * (ends[1] - ends[0])
        first = number * d.axial_patches * d.slope_patches
        shades = [_patch_colour(full, first + k * d.axial_patches) for k in range(d.slope_patches)]
        axes.add_collection(LineCollection(list(np.stack((points[:-1], points[1:]), axis=1)),
                                           colors=shades, linewidths=4.0, capstyle="butt"))
        axes.annotate(name, ends.mean(axis=0), (side * 13.5, g.airfoil_radius + 4.0), ha="center",
                      color=_FLANK_COLOURS[number][0], fontsize=11,
                      arrowprops={"arrowstyle": "-", "color": _FLANK_COLOURS[number][0]})
    half = g.rim_radius * np.sin(g.half_pitch)
    _frame(axes, np.array([[-half, g.inner_radius], [half, g.airfoil_radius + 6.0]]))
    axes.axis("on")
    axes.set(xlabel="x, circumferential [mm]", ylabel="y, radial [mm]")
    axes.spines[["top", "right"]].set_visible(False)


def _frame(axes: Axes, points: Floats) -> None:
    """Limits around points with a small margin, equal scales, no axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.03 * (high - low).max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.axis("off")
