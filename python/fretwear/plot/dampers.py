"""Bodies that only rotation presses: their path, their forces and their loops over a period."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..errors import AbsentError, FretwearError
from ..result import Result
from ..rows import choose_point, synthesis
from .style import CURVE, PALETTE, Source, as_result, label, new_figure, scale_axis, tidy, units_of

if TYPE_CHECKING:
    from ..model import Model

__all__ = ["has_bodies", "plot_damper"]

Floats = NDArray[np.float64]

_INSTANTS, _ARROWS = 256, 8
#: Part of the size of a body that its longest arrow takes.
_LENGTH = 0.8


def has_bodies(result: Result) -> bool:
    """Whether the model file of a result holds bodies, and the result their motion and forces."""
    try:
        model = _model(result)
    except FretwearError:
        return False
    return (model.bodies is not None and model.bodies.point is not None
            and "contact/force" in result and bool(result.converged.any())
            and _columns(result, model, 0) is not None)


def plot_damper(source: Source, point: int | None = None) -> Figure:
    """Path and rotation of the first body over a period, and the forces on it at eight instants.

    Parameters
    ----------
    source : Result or path
        Of a model file with bodies (`fretwear.damper`), whose dofs are observed.
    point : int, optional
        Point from 0; that of the largest amplitude without it.

    Raises
    ------
    AbsentError
        The result has no bodies, or does not observe their dofs.
    """
    result = as_result(source)
    model = _model(result)
    if model.bodies is None or model.bodies.point is None:
        raise AbsentError(f"{result.name}: its model has no bodies (fretwear.damper)")
    columns = _columns(result, model, 0)
    if columns is None:
        raise AbsentError(f"{result.name}: does not observe the dofs of body "
                          f"{model.bodies.name[0]}")
    row = choose_point(result, None) if point is None else point
    tau = np.linspace(0.0, 2.0 * np.pi, _INSTANTS + 1)
    motion = result.coefficients[row][:, columns].T @ synthesis(
        result.coefficients.shape[1], tau)
    turns = len(columns) > 2
    figure = new_figure(11.0 if turns else 8.0, 4.6)
    panels = figure.subplots(1, 3 if turns else 2)
    _draw_path(panels[0], motion, result)
    _draw_forces(panels[1], result, model, row)
    if turns:
        panels[2].plot(np.degrees(tau), 1e3 * (motion[2] - motion[2].mean()), color=CURVE)
        panels[2].set(xlabel="phase [degrees]", ylabel="rotation about its mean [mrad]",
                      xlim=(0.0, 360.0), xticks=[0, 90, 180, 270, 360])
        tidy(panels[2])
    figure.suptitle(f"Body {model.bodies.name[0]} at point {row + 1}, "
                    f"{result.frequency[row]:.6g} Hz", fontsize=11)
    return figure


def _model(result: Result) -> Model:
    from ..model import Model

    return Model.from_hdf5(result.model_file)


def _columns(result: Result, model: Model, body: int) -> list[int] | None:
    """Observed quantities that are x, y and, where there is one, the rotation about z."""
    assert model.bodies is not None
    dof, name = np.asarray(model.bodies.dof)[body], model.bodies.name[body]
    found = []
    for slot, word in ((0, "x"), (1, "y"), (5, "rz")):
        if dof[slot] == 0:
            continue
        there = [text for text in (f"{name}.{word}", f"u{dof[slot]}") if text in result.observed]
        if not there:
            return None
        found.append(result.observed.index(there[0]))
    return found if len(found) > 1 else None


def _draw_path(axes: Axes, motion: Floats, result: Result) -> None:
    x, y = (values - values.mean() for values in motion[:2])
    axes.plot(x, y, color=CURVE)
    for k in range(_ARROWS):
        at = k * (_INSTANTS // _ARROWS)
        axes.plot(x[at], y[at], "o", color=PALETTE[1] if k == 0 else CURVE, markersize=4)
    size = float(max(np.abs(x).max(), np.abs(y).max()))
    if size > 0.0:
        axes.set(xlim=(-1.2 * size, 1.2 * size), ylim=(-1.2 * size, 1.2 * size))
    length = scale_axis(axes.xaxis, size, units_of(result, "amplitude"))
    scale_axis(axes.yaxis, size, units_of(result, "amplitude"))
    axes.set_aspect("equal")
    axes.set(xlabel=label("x", length), ylabel=label("y, outwards", length))
    axes.set_title("path about its mean", fontsize=10)
    tidy(axes)


def _draw_forces(axes: Axes, result: Result, model: Model, row: int) -> None:
    """Contact forces on the body at its points, in shades from the start of the period on."""
    bodies = model.bodies
    assert bodies is not None
    of_body = np.flatnonzero(np.asarray(bodies.of_point) == 0)
    places = np.asarray(bodies.point)[of_body]
    pairs = np.asarray(bodies.pair)[of_body]
    force = result.force[row]
    tau = 2.0 * np.pi * np.arange(_ARROWS) / _ARROWS
    basis = synthesis(len(force), tau)
    # The law acts on side 1 with the sign of the left-hand side.
    values = -np.einsum("kpc,kt->tpc", force[:, pairs], basis)
    frames = np.array([_frame(model, pair) for pair in pairs])
    arrows = np.einsum("pcx,tpc->tpx", frames, values)
    size = float(np.ptp(places[:, :2], axis=0).max()) or 1.0
    longest = float(np.abs(arrows).max()) or 1.0
    for k, shade in enumerate(np.linspace(0.25, 1.0, _ARROWS)):
        axes.quiver(places[:, 0], places[:, 1], arrows[k, :, 0], arrows[k, :, 1], angles="xy",
                    scale_units="xy", scale=longest / (_LENGTH * size), width=0.004,
                    color=CURVE, alpha=float(shade))
    axes.plot(places[:, 0], places[:, 1], "o", color="black", markersize=3)
    axes.plot(0.0, 0.0, "+", color="black")
    axes.set(xlim=(places[:, 0].min() - size, places[:, 0].max() + size),
             ylim=(places[:, 1].min() - size, places[:, 1].max() + size))
    axes.set_aspect("equal")
    axes.set_title(f"forces on it, longest {longest:.4g} {units_of(result, 'contact/force')}",
                   fontsize=10)
    tidy(axes)


def _frame(model: Model, pair: int) -> Floats:
    """Directions t1, t2, n of a pair in x and y (3, 2), by the row of its side on the body."""
    assert model.contact is not None and model.bodies is not None
    dofs = np.asarray(model.bodies.dof)[0, :2] - 1
    frame = np.zeros((3, 2))
    for c, side in enumerate(np.asarray(model.contact.side_1)[pair]):
        if side > model.n_dof:
            frame[c] = model.rows[side - model.n_dof - 1][dofs]
        elif side > 0:
            # A node that a spring ties to the body.
            frame[c] = -model.K[side - 1, dofs] / model.K[side - 1, side - 1]
    return frame
