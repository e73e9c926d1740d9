"""A picture that shows which way the wave of an engine order runs around the disk that a sector
makes.

It is the lowest mode of the sector with its cut faces tied as a run ties them, in the nodal
diameter of the engine order, with contact pairs held. Each sector moves as the one before it, the
engine order over their number of a period later: what is drawn follows from the faces, the axis and
the frames of the import, and a mistake in one of them shows.
"""

from __future__ import annotations

import base64
import html
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from .diameters import factor
from .finding import Finding
from .recovery import point_motion, surface_faces
from .sectors import axis_of, tie
from .tables import rows_by_sector

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .build import FullModel

__all__ = ["PICTURES", "Wheel", "draw_wheel", "wheel_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

#: Suffixes of pictures; .html and .gif move.
PICTURES = (".png", ".svg", ".pdf", ".gif", ".html")
_MOVING = (".gif", ".html")
#: Matrices up to this size are solved densely.
_DENSE = 400
_N_MODES = 6
#: Stiffness that holds the pairs, over the largest of the structure.
_HOLDS = 10.0
#: Shift over the median of K_ii / M_ii, and squares of frequencies that are zero beside it.
_SHIFT, _ZERO = 1e-6, 1e-4
#: Largest displacement that is drawn, over the size of the disk; instants of a period.
_SHOWN, _FRAMES = 0.06, 16
_DIRECTIONS = ("radial", "tangential", "axial")


@dataclass(frozen=True)
class Wheel:
    """The disk of all sectors in the lowest mode of a nodal diameter.

    Attributes
    ----------
    n_sectors, engine_order : int
    axis : str
        About which sector numbers grow, by the right hand.
    diameter : int
        Of the wave, negative where it runs towards lower sectors; 0 and n_sectors/2 stand.
    frequency : float
        [Hz].
    points, motion : (n_sectors, n_points, 3)
        Positions [L], and complex displacements: real part of motion exp(i omega t).
    faces : list of tuple of int
        Corners of the faces of the surface of one sector.
    """

    n_sectors: int
    engine_order: int
    axis: str
    diameter: int
    frequency: float
    points: Floats
    motion: Complexes
    faces: list[tuple[int, ...]]

    @property
    def sense(self) -> int:
        """1 about the axis, -1 the other way, 0 of a wave that stands."""
        return 0 if 2 * self.diameter % self.n_sectors == 0 else int(np.sign(self.diameter))

    def view(self) -> Floats:
        """Rows: right and up in a picture with the axis towards the reader, and the axis."""
        axis = np.array(axis_of(self.axis))
        right = np.roll(np.abs(axis), 1)
        return np.stack((right, np.cross(axis, right), axis))

    def angles(self) -> Floats:
        """Of the points about the axis [rad], (n_sectors, n_points)."""
        flat = self.points @ self.view().T
        found: Floats = np.arctan2(flat[..., 1], flat[..., 0])
        return found

    def components(self) -> Complexes:
        """Radial, tangential and axial displacement (n_sectors, n_points, 3)."""
        flat, angle = self.motion @ self.view().T, self.angles()
        c, s = np.cos(angle), np.sin(angle)
        return np.stack((c * flat[..., 0] + s * flat[..., 1], c * flat[..., 1] - s * flat[..., 0],
                         flat[..., 2]), axis=-1)

    def main_direction(self) -> int:
        """Component that moves most: radial, tangential, axial."""
        return int((np.abs(self.components()) ** 2).sum(axis=(0, 1)).argmax())

    def crest(self, phase: float) -> float | None:
        """Angle of a crest of the wave at an instant, about the axis [rad]; None of one that
        stands."""
        if self.sense == 0:
            return None
        shape = self.components()[..., self.main_direction()]
        sum_ = (shape * np.exp(1j * self.diameter * self.angles())).sum()
        return float((phase + np.angle(sum_)) / self.diameter)

    def texts(self) -> list[str]:
        """What the picture shows, in words."""
        axis, back = self.axis, self.axis[1:] if self.axis.startswith("-") else f"-{self.axis}"
        first = (f"engine order {self.engine_order} on {self.n_sectors} sectors: nodal diameter "
                 f"{abs(self.diameter)}, ")
        if self.sense == 0:
            return [first + "a wave that stands",
                    f"lowest mode with pairs held {self.frequency:.5g} Hz"]
        runs, turns = (axis, back) if self.sense > 0 else (back, axis)
        return [first + f"the wave runs about {runs}, towards "
                + ("higher" if self.sense > 0 else "lower") + " sectors",
                f"lowest mode with pairs held {self.frequency:.5g} Hz",
                f"a disturbance at rest runs so on a disk that turns about {turns}; for one that "
                f"turns about {runs} give engine_order = {-self.engine_order}"]


def wheel_of(model: FullModel, engine_order: int) -> Wheel:
    """The lowest mode of the nodal diameter of an engine order, on all sectors.

    Raises
    ------
    InputError
        The model is no sector, or has no mesh.
    """
    faces, mesh = model.interfaces, model.mesh
    if faces is None or mesh is None:
        raise InputError("--check FILE draws the wave of an engine order: it goes with --sectors "
                         "and a mesh (--mesh, or the deck of a job)")
    n = faces.n_sectors
    diameter = (engine_order + (n - 1) // 2) % n - (n - 1) // 2
    frequency, shape = _lowest(model, diameter)
    own = np.asarray(point_motion(model, mesh) @ shape).reshape(-1, 3)
    points, motion = [mesh.points], [own]
    delay = np.exp(-2j * np.pi * diameter / n)
    for _ in range(n - 1):
        points.append(points[-1] @ faces.turn.T)
        motion.append(delay * (motion[-1] @ faces.turn.T))
    return Wheel(n, engine_order, model.axis, diameter, frequency, np.array(points),
                 np.array(motion), surface_faces(mesh))


def _lowest(model: FullModel, diameter: int) -> tuple[float, Complexes]:
    """Frequency [Hz] and displacements of all degrees of freedom of the lowest elastic mode."""
    faces = model.interfaces
    assert faces is not None
    turn = factor(faces.n_sectors, diameter % faces.n_sectors, np.array([1]))[0]
    ties = tie(faces, model.dofs.n, turn)
    back = sp.csr_array(ties.conj().T)
    mass, stiffness = (sp.csc_matrix(back @ model.matrices[role] @ ties)
                       for role in ("mass", "stiffness"))
    largest = float(np.abs(stiffness.diagonal()).max())
    if model.pairs is not None:
        rows = sp.csr_array(_held(model, diameter) @ ties)
        stiffness = sp.csc_matrix(stiffness + _HOLDS * largest * (rows.conj().T @ rows))
    m, k = mass.diagonal().real, stiffness.diagonal().real
    used = (m > 0.0) & (k > 0.0)
    shift = _SHIFT * float(np.median(k[used] / m[used]))
    shifted = sp.csc_matrix(stiffness + shift * mass)
    n = shifted.shape[0]
    if n <= _DENSE:
        values, shapes = la.eigh(mass.toarray(), shifted.toarray())
        values, shapes = values[::-1][:_N_MODES + 6], shapes[:, ::-1]
    else:
        solve = spl.LinearOperator((n, n), matvec=spl.splu(shifted).solve, dtype=shifted.dtype)
        found, shapes = spl.eigsh(shifted, k=_N_MODES + 6, M=mass, sigma=0.0, OPinv=solve,
                                  v0=solve.matvec(mass @ (1.0 + np.cos(np.arange(n) ** 1.1))))
        order = np.argsort(found.real)
        values, shapes = 1.0 / found.real[order], shapes[:, order]
    squares = 1.0 / values - shift
    first = int(np.argmax(squares > _ZERO * shift))
    shape: Complexes = np.asarray(ties @ shapes[:, first], dtype=complex)
    return float(np.sqrt(max(squares[first], 0.0)) / (2.0 * np.pi)), shape


def _held(model: FullModel, diameter: int) -> sp.csr_array:
    """Relative displacements of the pairs, side 2 in its sector."""
    pairs = model.pairs
    assert pairs is not None and model.interfaces is not None
    one, two, _, across = rows_by_sector(pairs, model.dofs.n)
    n = model.interfaces.n_sectors
    turns = factor(n, diameter % n, across)
    return sp.csr_array(one - sp.diags_array(turns) @ two)


def draw_wheel(wheel: Wheel, path: Path) -> list[Finding]:
    """Write the picture: instants side by side, or a period that moves (.gif, .html)."""
    from matplotlib.figure import Figure

    words = wheel.texts()
    if path.suffix.lower() in _MOVING:
        pictures = []
        for k in range(_FRAMES):
            figure = Figure(figsize=(6.0, 6.6), dpi=90)
            _draw(figure.add_axes((0.0, 0.0, 1.0, 0.92)), wheel, 2.0 * np.pi * k / _FRAMES)
            figure.text(0.5, 0.95, words[0], ha="center", fontsize=8)
            pictures.append(_pixels(figure))
        data = _packed(pictures)
        if path.suffix.lower() == ".html":
            data = _page(wheel, data).encode()
    else:
        figure = Figure(figsize=(13.0, 5.2), dpi=120)
        for k in range(3):
            axes = figure.add_axes((k / 3.0, 0.0, 1.0 / 3.0, 0.84))
            _draw(axes, wheel, k * np.pi / 4.0)
            axes.set_title(("t = 0", "t = T/8", "t = T/4")[k], fontsize=10)
        figure.text(0.5, 0.91, "\n".join(words[::2]), ha="center", va="center", fontsize=9)
        buffer = io.BytesIO()
        figure.savefig(buffer, format=path.suffix[1:].lower())
        data = buffer.getvalue()
    try:
        path.write_bytes(data)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from None
    return [Finding("note", "wave", text) for text in (*words, f"drawn in {path}")]


def _draw(axes: Axes, wheel: Wheel, phase: float) -> None:
    """The disk at an instant, its axis towards the reader."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import FancyArrowPatch

    view = wheel.view()
    places, moved = wheel.points @ view.T, (wheel.motion * np.exp(1j * phase)).real @ view.T
    radius = float(np.hypot(places[..., 0], places[..., 1]).max())
    largest = float(np.linalg.norm(np.abs(wheel.motion), axis=-1).max()) or 1.0
    deformed = places + _SHOWN * 2.0 * radius / largest * moved
    k = wheel.main_direction()
    values = (wheel.components()[..., k] * np.exp(1j * phase)).real
    polygons = [deformed[j][list(face)] for j in range(wheel.n_sectors) for face in wheel.faces]
    colours = np.array([values[j][list(face)].mean() for j in range(wheel.n_sectors)
                        for face in wheel.faces])
    order = np.argsort([polygon[:, 2].mean() for polygon in polygons], kind="stable")
    bound = float(np.abs(wheel.components()[..., k]).max()) or 1.0
    drawn = PolyCollection([polygons[i][:, :2] for i in order], array=colours[order],
                           cmap="RdBu_r", edgecolors="0.35", linewidths=0.15)
    drawn.set_clim(-bound, bound)
    axes.add_collection(drawn)
    for j in range(wheel.n_sectors):
        middle = places[j].mean(axis=0)
        away = 1.1 * radius / np.hypot(*middle[:2])
        axes.text(away * middle[0], away * middle[1], str(j), fontsize=7, color="0.4",
                  ha="center", va="center")
    crest = wheel.crest(phase)
    if crest is not None:
        axes.plot(1.2 * radius * np.cos(crest), 1.2 * radius * np.sin(crest), "o",
                  color="#c0392b", markersize=7)
        ahead = crest + wheel.sense * 0.7
        ends = [(1.2 * radius * np.cos(a), 1.2 * radius * np.sin(a)) for a in (crest, ahead)]
        axes.add_patch(FancyArrowPatch(
            *ends, connectionstyle=f"arc3,rad={wheel.sense * np.tan(0.7 / 4.0):.4f}",
            arrowstyle="-|>", mutation_scale=14, color="#c0392b", linewidth=1.6))
    axes.text(0.02, 0.02, f"{_DIRECTIONS[k]} motion; numbers of sectors; axis {wheel.axis} towards "
              "the reader", transform=axes.transAxes, fontsize=7, color="0.3")
    axes.set_xlim(-1.35 * radius, 1.35 * radius)
    axes.set_ylim(-1.35 * radius, 1.35 * radius)
    axes.set_aspect("equal")
    axes.axis("off")


def _pixels(figure: Figure) -> NDArray[np.uint8]:
    from PIL import Image

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=90)
    return np.asarray(Image.open(buffer).convert("RGB"))


def _packed(pictures: list[NDArray[np.uint8]]) -> bytes:
    """A GIF of a period."""
    from PIL import Image

    images = [Image.fromarray(picture).quantize(128, dither=Image.Dither.NONE)
              for picture in pictures]
    buffer = io.BytesIO()
    images[0].save(buffer, "GIF", save_all=True, append_images=images[1:], duration=90, loop=0)
    return buffer.getvalue()


def _page(wheel: Wheel, picture: bytes) -> str:
    """One page with the moving picture in it."""
    words = [html.escape(text[0].upper() + text[1:] + ".") for text in wheel.texts()]
    return ("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
            "<meta name=\"viewport\" content=\"width=device-width\">"
            f"<title>Engine order {wheel.engine_order}</title>"
            "<style>body{font-family:sans-serif;max-width:40em;margin:1em auto;padding:0 1em}"
            "img{max-width:100%}</style></head>\n<body><h1>Engine order "
            f"{wheel.engine_order}</h1>\n" + "".join(f"<p>{text}</p>\n" for text in words)
            + f'<img alt="{words[0]}" src="data:image/gif;base64,'
            + base64.b64encode(picture).decode() + '">\n</body></html>\n')
