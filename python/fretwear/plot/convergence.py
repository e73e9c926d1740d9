"""What the solver has done: iterations, residual and time of every point."""

from __future__ import annotations

import contextlib

import numpy as np
from matplotlib.figure import Figure

from .._native import namelist_values
from ..errors import InputError, NotBuiltError
from .style import CURVE, FAILED, Source, as_result, label, new_figure, tidy

__all__ = ["plot_convergence"]


def plot_convergence(source: Source) -> Figure:
    """Iterations, final residual and time against the number of the point.

    Points that did not converge are crosses; the dashed line is the tolerance of the run.

    Parameters
    ----------
    source : Result or path
        Any result with solution points.
    """
    result = as_result(source)
    if result.n_points == 0:
        raise InputError(f"{result.name}: holds no points")
    number = np.arange(1, result.n_points + 1)
    failed = ~result.converged
    figure = new_figure(8.0, 6.0)
    panels = figure.subplots(3, 1, sharex=True)
    residual = np.where(result.residual > 0.0, result.residual, np.nan)
    rows = (("iterations", "1", result.iterations.astype(float)), ("residual", "1", residual),
            ("time", "ms", 1e3 * result.seconds))
    for axes, (text, units, values) in zip(panels, rows):
        axes.plot(number, values, ".-", color=CURVE, linewidth=1.0, label=text)
        axes.plot(number[failed], values[failed], "x", color=FAILED, markersize=7,
                  label=f"not converged ({failed.sum()})" if failed.any() else None)
        axes.set_ylabel(label(text, units))
        tidy(axes)
    panels[0].set_ylim(bottom=0.0)
    panels[0].yaxis.get_major_locator().set_params(integer=True)
    if np.isfinite(residual).any():
        panels[1].set_yscale("log")
        # A residual below round-off is zero by chance; its decades would squeeze the others.
        panels[1].set_ylim(bottom=max(1e-18, 0.3 * np.nanmin(residual)))
    tolerance = None
    with contextlib.suppress(NotBuiltError):  # a line of the picture
        tolerance = namelist_values(result.namelist).get("solver%tolerance")
    if tolerance:
        panels[1].axhline(float(tolerance[0]), linestyle="--", color="0.4", linewidth=1.0,
                          label="tolerance")
        panels[1].legend(frameon=False, fontsize=8)
    if failed.any():
        panels[0].legend(frameon=False, fontsize=8)
    panels[2].set_ylim(bottom=0.0)
    panels[2].set_xlabel("point")
    panels[2].locator_params(axis="x", integer=True)
    figure.suptitle(f"Convergence: {(~failed).sum()} of {result.n_points} points, "
                    f"{result.iterations.sum()} iterations, {result.seconds.sum():.3g} s",
                    fontsize=11)
    return figure
