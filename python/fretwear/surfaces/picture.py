"""Surfaces that were refused, and a picture of where they are wrong."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from .shapes import CORNERS

if TYPE_CHECKING:
    from .surface import Surface

__all__ = ["RefusedSurfaces", "draw_surfaces"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_COLOURS = ("tab:blue", "tab:orange")
_WRONG = "tab:red"
#: Normals are drawn so long, as a share of the size of the surfaces.
_ARROW = 0.12


class RefusedSurfaces(InputError):
    """Two surfaces that make no contact pairs.

    Parameters
    ----------
    message : str
        What is wrong and what to do.
    surface_1, surface_2 : Surface
        Which.
    faces_1, faces_2 : (n,) int
        Their faces (from 0) where it is wrong.
    normals : bool
        Whether the directions of the faces are what is wrong.
    """

    def __init__(self, message: str, surface_1: Surface, surface_2: Surface, faces_1: Ints,
                 faces_2: Ints, *, normals: bool = False) -> None:
        super().__init__(message)
        self.surfaces = surface_1, surface_2
        self.faces = faces_1, faces_2
        self.normals = normals

    def save(self, path: str | Path) -> Path:
        """Draw both surfaces, with what is wrong in red, into a file of any format of matplotlib.
        """
        figure = draw_surfaces(*self.surfaces, wrong=self.faces, normals=self.normals)
        try:
            figure.savefig(path, dpi=150)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error.strerror}") from None
        except ValueError as error:
            raise InputError(f"{path}: {error}") from None
        return Path(path)


def draw_surfaces(surface_1: Surface, surface_2: Surface, *,
                  wrong: tuple[Ints, Ints] | None = None, normals: bool = False) -> Any:
    """Both surfaces as a matplotlib figure.

    Parameters
    ----------
    surface_1, surface_2 : Surface
        Which.
    wrong : pair of (n,) int, optional
        Faces of either that are drawn in red.
    normals : bool
        Whether outward normals are drawn.
    """
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(7.0, 5.5))
    plane = surface_1.is_plane
    axes: Any = figure.add_subplot() if plane else figure.add_subplot(projection="3d")
    handles = []
    for k, surface in enumerate((surface_1, surface_2)):
        bad = np.zeros(0, dtype=np.int64) if wrong is None else wrong[k]
        outlines = [surface.points[surface.nodes[i, :CORNERS[kind]]]
                    for i, kind in enumerate(surface.kind)]
        colours = [_WRONG if i in set(bad.tolist()) else _COLOURS[k] for i in range(len(surface))]
        _outline(axes, outlines, colours, plane)
        if normals:
            _arrows(axes, outlines, plane, _COLOURS[k])
        handles.append(Line2D([], [], color=_COLOURS[k], label=f"{surface.name} ({len(surface)} "
                                                               "faces)"))
        if len(bad):
            handles.append(Line2D([], [], color=_WRONG,
                                  label=f"refused: {len(bad)} of {surface.name}"))
    _frame(axes, surface_1, surface_2)
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.12), ncol=2,
                frameon=False)
    return figure


def _outline(axes: Any, outlines: list[Floats], colours: list[str], plane: bool) -> None:
    from matplotlib.collections import LineCollection
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    if plane:
        axes.add_collection(LineCollection(outlines, colors=colours, linewidths=2.5))
        return
    axes.add_collection3d(Poly3DCollection(outlines, facecolors=colours, edgecolors="0.2",
                                           linewidths=0.4, alpha=0.5))


def _arrows(axes: Any, outlines: list[Floats], plane: bool, colour: str) -> None:
    middles = np.array([outline.mean(axis=0) for outline in outlines])
    length = _ARROW * float(np.ptp(middles, axis=0).max() or 1.0)
    if plane:
        along = np.array([outline[1] - outline[0] for outline in outlines])
        normal = np.stack((along[:, 1], -along[:, 0]), axis=1)
    else:
        normal = np.array([np.cross(outline[2] - outline[0], outline[-1] - outline[1])
                           for outline in outlines])
    normal *= length / np.linalg.norm(normal, axis=1)[:, None]
    if plane:
        axes.quiver(*middles.T, *normal.T, color=colour, angles="xy", scale_units="xy", scale=1.0,
                    width=0.004)
    else:
        axes.quiver(*middles.T, *normal.T, color=colour, linewidth=0.8)


def _frame(axes: Any, one: Surface, two: Surface) -> None:
    """Equal lengths along all axes, and their names."""
    used = np.unique(np.concatenate((one.nodes[one.nodes >= 0], two.nodes[two.nodes >= 0])))
    low, high = one.points[used].min(axis=0), one.points[used].max(axis=0)
    span = float((high - low).max()) or 1.0
    middle = 0.5 * (low + high)
    for k, name in enumerate("xyz"[:len(low)]):
        getattr(axes, f"set_{name}lim")(middle[k] - 0.6 * span, middle[k] + 0.6 * span)
        getattr(axes, f"set_{name}label")(f"{name} [length]")
    axes.set_aspect("equal") if one.is_plane else axes.set_box_aspect((1.0, 1.0, 1.0))
