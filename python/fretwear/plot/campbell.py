"""The Campbell diagram of one result: frequencies, engine orders, crossings and peaks."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..errors import AbsentError
from ..result import Result
from .style import CURVE, PALETTE, new_figure, tidy

__all__ = ["plot_campbell_result"]


def plot_campbell_result(result: Result) -> Figure:
    """Frequencies over the rotation speed with the lines of the orders, of one `campbell` run.

    Drawn are the nodal diameters that the orders excite. Circles are crossings, discs the maxima
    of the response near them; their areas go with the amplitude of the first observed quantity.

    Parameters
    ----------
    result : Result
        Of ``analysis = 'campbell'``.

    Raises
    ------
    AbsentError
        The result holds no diagram.
    """
    if "campbell/speed" not in result:
        raise AbsentError(f"{result.name}: holds no Campbell diagram: run with case%analysis = "
                          "'campbell', or name results of 'modes' at several speeds")
    rpm = 30.0 / np.pi * result["campbell/speed"]
    known = result["campbell/nodal_diameter"].astype(int).tolist()
    crossing = {name: result[f"campbell/crossing/{name}"]
                for name in ("order", "nodal_diameter", "speed", "omega")}
    orders = sorted(set(crossing["order"].astype(int).tolist()), key=abs)
    excited = sorted(set(crossing["nodal_diameter"].astype(int).tolist())) or known
    figure = new_figure(8.0, 5.2)
    axes = figure.subplots()
    with_pairs = not np.array_equal(result["campbell/open"], result["campbell/closed"],
                                    equal_nan=True)
    for k, diameter in enumerate(excited):
        # Where waves both ways are alike one of them stands for both.
        place = known.index(diameter if diameter in known else abs(diameter))
        colour = PALETTE[k % len(PALETTE)]
        for state, style in (("open", "--"), ("closed", "-")):
            if state == "closed" or with_pairs:
                axes.plot(rpm, result[f"campbell/{state}"][:, place] / (2.0 * np.pi), style,
                          color=colour, linewidth=1.2)
        axes.plot([], [], "-", color=colour, label=f"nodal diameter {diameter}")
    if with_pairs:
        axes.plot([], [], "--", color="0.5", label="pairs open")
    highest = 0.0
    for order in orders:
        end = abs(order) * float(rpm[-1]) / 60.0
        highest = max(highest, end)
        axes.plot([0.0, rpm[-1]], [0.0, end], "-", color="0.6", linewidth=0.8, zorder=1)
        axes.annotate(f"EO {order}", (float(rpm[-1]), end), xytext=(3, -2), fontsize=8,
                      textcoords="offset points", annotation_clip=False)
    axes.plot(30.0 / np.pi * crossing["speed"], crossing["omega"] / (2.0 * np.pi), "o",
              color=CURVE, markerfacecolor="none", markersize=6, label="crossing")
    if "campbell/peak/amplitude" in result and crossing["speed"].size:
        size = result["campbell/peak/amplitude"][:, 0]
        found = np.isfinite(size)
        if found.any():
            axes.scatter(30.0 / np.pi * result["campbell/peak/speed"][found],
                         result["campbell/peak/omega"][found] / (2.0 * np.pi),
                         s=120.0 * size[found] / size[found].max(), color=PALETTE[1], alpha=0.7,
                         zorder=3, label="peak, area as amplitude")
    axes.set_xlim(0.0, rpm[-1])
    axes.set_ylim(0.0, 1.08 * highest if highest > 0.0 else None)
    axes.set_xlabel("rotation speed [rpm]")
    axes.set_ylabel("frequency [Hz]")
    tidy(axes)
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    figure.suptitle("Campbell diagram", fontsize=11)
    return figure
