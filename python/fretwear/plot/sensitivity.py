"""What the numbers of a case do to a response: p dQ/dp as bars."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..rows import choose_point, status_words
from .style import PALETTE, Source, as_result, new_figure, tidy

__all__ = ["plot_sensitivity"]

#: Bars of single pairs or springs up to this number; above, all of them together.
_MOST_PARTS = 8
#: What quantities are called.
_NAMES = {"first_harmonic": "amplitude of the first harmonic", "largest": "largest displacement",
          "dissipation": "friction energy per cycle", "wear_volume": "wear volume per cycle"}


def plot_sensitivity(source: Source, point: int | None = None,
                     observe: str | None = None) -> Figure:
    """Bars of p dQ/dp over Q at a point, one panel for each quantity.

    A bar says by how many per cent a quantity grows with one per cent of a parameter. The bars of
    pairs stand beside each other where they are few, else together.

    Parameters
    ----------
    source : Result or path
        Result of a run with `&sensitivity`.
    point : int, optional
        Solution point from 0; that of the largest amplitude without it.
    observe : str, optional
        Observed quantity; the first without it.
    """
    result = as_result(source)
    found = result.sensitivities
    point = choose_point(result, None) if point is None else point
    column = result.index(observe)
    n_bars = max(len(by) for by in found.values())
    figure = new_figure(8.0, 1.2 + len(found) * (0.6 + 0.32 * n_bars))
    panels = figure.subplots(len(found), 1, sharex=True, squeeze=False).ravel()
    for axes, (quantity, by) in zip(panels, found.items()):
        for row, parameter in enumerate(by):
            parts = found.relative(quantity, parameter, point, column)
            if len(parts) > _MOST_PARTS:
                parts = parts.sum(keepdims=True)
            width = 0.8 / len(parts)
            for k, part in enumerate(parts):
                axes.barh(row + (k - 0.5 * (len(parts) - 1)) * width, part, 0.9 * width,
                          color=PALETTE[k % len(PALETTE)])
        axes.set_yticks(range(len(by)), list(by))
        axes.invert_yaxis()
        axes.axvline(0.0, color="black", linewidth=0.8)
        of = f" of {result.observed[column]}" if quantity in ("first_harmonic", "largest") else ""
        axes.set_title(_NAMES.get(quantity, quantity) + of, fontsize=10, loc="left")
        tidy(axes)
    panels[-1].set_xlabel("per cent of the quantity for one per cent of the parameter")
    figure.suptitle(f"Sensitivity at {result.omega[point]:.6g} rad/s, {result.frequency[point]:.6g}"
                    f" Hz{status_words(result, point)}", fontsize=11)
    return figure
