"""The range of a response over the residual tractions of its pairs."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..errors import AbsentError
from ..result import Result
from .style import CURVE, FAILED, PALETTE, label_y, new_figure, tidy, units_of

__all__ = ["plot_bounds"]

#: What the axis says of each quantity.
_TITLES = {"first_harmonic": "first harmonic of {}", "largest": "largest {}",
           "dissipation": "friction energy of a cycle", "wear_volume": "worn volume of a cycle"}


def plot_bounds(result: Result) -> Figure:
    """Band between the lowest and the highest response, with the one in its middle.

    Below it the residual tractions of the highest response, pair by pair. Crosses are frequencies
    where some residual tractions had no solution.

    Parameters
    ----------
    result : Result
        Of ``analysis = 'bounds'``.

    Raises
    ------
    AbsentError
        The result holds no range.
    """
    if "bounds/lowest" not in result:
        raise AbsentError(f"{result.name}: holds no range: run with case%analysis = 'bounds'")
    omega = result["omega"] / (2.0 * np.pi)
    low, high, centre = (result[f"bounds/{name}"] for name in ("lowest", "highest", "centre"))
    failed = result["bounds/failed"] > 0
    shares = result["bounds/residual_highest"]
    quantity = str(result.attributes.get("bounds_quantity", ""))
    figure = new_figure(7.2, 5.4)
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    mark = "o" if omega.size == 1 else ""
    axes.fill_between(omega, low, high, color=PALETTE[5], alpha=0.45,
                      linewidth=0.0, label="all residual tractions")
    for values in (low, high):
        axes.plot(omega, values, marker=mark, color=PALETTE[0], linewidth=0.9)
    axes.plot(omega, centre, "--", marker=mark, color=CURVE, linewidth=1.2,
              label="in the middle")
    if failed.any():
        axes.plot(omega[failed], high[failed], "x", color=FAILED, markersize=5,
                  label="some have no solution")
    observed = result.observed[0] if result.observed else ""
    label_y(axes, _TITLES.get(quantity, quantity).format(observed),
            units_of(result, "bounds/highest"))
    axes.legend(frameon=False, fontsize=8)
    tidy(axes)
    for pair in range(shares.shape[1]):
        below.plot(omega, shares[:, pair], marker=".", markersize=4, linewidth=0.8,
                   color=PALETTE[pair % len(PALETTE)], label=f"pair {pair + 1}")
    below.set_ylim(-1.12, 1.12)
    below.set_ylabel("residual traction\nof the highest")
    below.set_xlabel("frequency [Hz]")
    if shares.shape[1] <= len(PALETTE):
        below.legend(frameon=False, fontsize=7, ncol=3)
    tidy(below)
    figure.suptitle("Range over residual tractions", fontsize=11)
    return figure
