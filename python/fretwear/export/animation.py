"""One period of the vibration as a moving picture, drawn by PyVista and packed by Pillow."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from ..result import Result
from ..rows import choose_point
from .fields import Fields

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Animation", "animate"]

Floats = NDArray[np.float64]

#: Formats of moving pictures that Pillow writes.
_FORMATS = {".gif": "GIF", ".webp": "WEBP", ".png": "PNG"}
#: Largest displacement that is drawn, over the size of the mesh.
_SHOWN = 0.12
#: How much of the bodies is seen, so that the faces between them are.
_OPACITY = 0.18
#: Height of the strip below the scene, over that of the picture: colours and factor.
_STRIP = 0.16
_COLOURS = "viridis"


@dataclass(frozen=True)
class Animation:
    """A moving picture that a notebook shows.

    Attributes
    ----------
    image : bytes
        The file.
    kind : str
        'gif', 'webp' or 'png'.
    factor : float
        By which displacements are drawn larger.
    """

    image: bytes
    kind: str
    factor: float

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.image).decode()
        return (f'<img src="data:image/{self.kind};base64,{data}" style="max-width:100%" '
                f'alt="vibration, displacements drawn {self.factor:.3g} times as large">')

    def __repr__(self) -> str:
        return f"<Animation: {self.kind}, {len(self.image)} bytes, factor {self.factor:.3g}>"


def animate(result: Result | str | Path, file: str | Path | None = None, *,
            point: int | None = None, scalars: str = "slip", sectors: int = 1, axis: str = "z",
            frames: int = 24, turn: float = 0.0, factor: float | None = None,
            size: tuple[int, int] = (640, 480), view: Sequence[float] = (1.0, 0.5, 1.3),
            up: Sequence[float] = (0.0, 1.0, 0.0)) -> Animation:
    """One period of the vibration, the faces in contact coloured.

    Parameters
    ----------
    result : Result or path
        Result of a model file with a mesh.
    file : str or Path, optional
        Picture to write, .gif, .webp or .png; a GIF in memory without it.
    point, sectors, axis
        See `export_mesh`.
    scalars : str
        What colours the faces in contact, one of `pair_fields`; see `export_mesh`.
    frames : int
        Instants of the period.
    turn : float
        Angle by which the camera goes around the mesh meanwhile [degrees].
    factor : float, optional
        By which displacements are drawn larger; without it so that they are seen.
    size : (int, int)
        Width and height [pixels].
    view, up : (3,) floats
        Direction from the middle of the mesh to the camera, and the one that is upright.

    Raises
    ------
    InputError
        PyVista is not installed, no mesh belongs to the model, or there is no such field.
    OutputError
        The file cannot be written.
    """
    pyvista = _need_pyvista()
    target = Path("animation.gif" if file is None else file)
    if target.suffix.lower() not in _FORMATS:
        raise InputError(f"{target}: the suffix must be {', '.join(_FORMATS)}")
    if frames < 2:
        raise InputError(f"frames = {frames}: must be at least 2")
    if not isinstance(result, Result):
        result = Result(result)
    fields = Fields(result, choose_point(result, None) if point is None else point,
                    sectors=sectors, axis=axis)
    if scalars not in fields.pairs:
        raise InputError(f"scalars = {scalars!r}: of the pairs this result knows "
                         + (", ".join(fields.pairs) or "nothing"))
    strip = round(_STRIP * size[1])
    scene = _Scene(pyvista, fields, scalars, (size[0], size[1] - strip))
    drawn = _SHOWN * scene.length / scene.largest if factor is None and scene.largest > 0.0 \
        else factor or 1.0
    scene.plotter.view_vector(view, up)
    scene.plotter.camera.zoom(0.9)   # room for the motion
    below = _strip(scene.title, scene.limits, drawn, (size[0], strip))
    pictures = [np.concatenate([scene.draw(360.0 * k / frames, drawn, turn / frames), below])
                for k in range(frames)]
    scene.plotter.close()
    image = _packed(pictures, _FORMATS[target.suffix.lower()])
    if file is not None:
        try:
            target.write_bytes(image)
        except OSError as error:
            raise OutputError(f"{target}: cannot be written: {error.strerror}") from None
    return Animation(image, target.suffix.lower()[1:], drawn)


def _need_pyvista() -> Any:
    try:
        import pyvista
    except ImportError:
        raise InputError("animations need pyvista: pip install pyvista") from None
    return pyvista


def _packed(pictures: list[Floats], kind: str) -> bytes:
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    if kind == "GIF":
        images = [image.quantize(128, dither=Image.Dither.NONE) for image in images]
    buffer = io.BytesIO()
    images[0].save(buffer, kind, save_all=True, append_images=images[1:], duration=60, loop=0)
    return buffer.getvalue()


def _strip(title: str, limits: tuple[float, float], factor: float,
           size: tuple[int, int]) -> Floats:
    """What the colours mean and how much larger the motion is drawn, below the scene: in front of
    it a bar would hide parts that move."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    dpi = 100.0 * size[0] / 480.0   # the text as wide a part of every picture
    figure = Figure(figsize=(size[0] / dpi, size[1] / dpi), dpi=dpi)
    canvas: Any = FigureCanvasAgg(figure)
    bar = figure.add_axes((0.06, 0.45, 0.34, 0.2))
    figure.colorbar(ScalarMappable(Normalize(*limits), _COLOURS), cax=bar,
                    orientation="horizontal", ticks=limits, format="%.2g")
    bar.tick_params(labelsize=8)
    figure.text(0.23, 0.74, title, fontsize=9, ha="center", va="bottom")
    said = "to scale" if factor == 1.0 else f"drawn {factor:.3g} times as large"
    figure.text(0.7, 0.5, f"displacements {said}", fontsize=8, ha="center", va="center")
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


class _Scene:
    """Bodies, seen through, and the faces in contact, coloured."""

    def __init__(self, pyvista: Any, fields: Fields, scalars: str, size: tuple[int, int]) -> None:
        self.fields = fields
        mesh = fields.at(0.0)
        self.points = np.asarray(mesh.points)
        whole = pyvista.wrap(mesh)
        touching = np.concatenate(mesh.cell_data["pair"]) > 0
        self.length = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        vibration = mesh.point_data.get("vibration")
        if vibration is None:
            raise InputError(f"{fields.result.name}: holds no contact forces, from which the "
                             "motion follows; run with output%contact = .true.")
        self.largest = float(np.abs(vibration).max())
        self.parts = []
        self.plotter = pyvista.Plotter(off_screen=True, window_size=size)
        self.plotter.set_background("white")
        units = fields.pairs[scalars][1]
        self.title = scalars.replace("_", " ") + (f" [{units}]" if units not in ("", "1") else "")
        self.limits = _limits(fields.pairs[scalars][0], units)
        for which in (~touching, touching):
            if not which.any():
                continue
            part = whole.extract_cells(np.flatnonzero(which))
            # Points that no cell of the part has are left out: where those that are there stand.
            origin = np.asarray(part.point_data["vtkOriginalPointIds"])
            surface = part.extract_surface(algorithm=None)
            origin = origin[np.asarray(surface.point_data["vtkOriginalPointIds"])]
            self.parts.append((surface, origin))
            if which is touching:
                self.plotter.add_mesh(
                    surface, scalars=scalars, cmap=_COLOURS, show_edges=False, lighting=False,
                    clim=self.limits, show_scalar_bar=False)
            else:
                self.plotter.add_mesh(surface, color="#7a8694", opacity=_OPACITY,
                                      silhouette={"color": "#303840", "line_width": 1.5})

    def draw(self, phase: float, factor: float, turn: float) -> Floats:
        """The picture at an instant [degrees]; the camera goes on afterwards."""
        moved = self.points + factor * self.fields.at(phase).point_data["displacement"]
        for surface, origin in self.parts:
            surface.points = moved[origin]
        self.plotter.render()
        picture: Floats = self.plotter.screenshot(None, return_img=True)
        if turn:
            self.plotter.camera.azimuth += turn
        return picture


def _limits(values: Floats, units: str) -> tuple[float, float]:
    """Range of the colours: the whole one of shares."""
    if units == "1":
        return 0.0, 1.0
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return (low, high) if high > low else (low, low + 1.0)
