"""The amplification of many disks: how many stay below it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from .._words import did_you_mean
from ..errors import AbsentError, InputError
from ..result import Result
from .style import PALETTE, new_figure, tidy

__all__ = ["plot_population"]


def plot_population(result: Result, observe: str | int | None = None) -> Figure:
    """Share of the disks whose largest amplitude stays below a multiple of the tuned one.

    Parameters
    ----------
    result : Result
        Of ``analysis = 'population'``, or of ``fretwear population``.
    observe : str or int, optional
        Observed quantity (default: the first).

    Raises
    ------
    AbsentError
        The result holds no population.
    """
    if "population/amplification" not in result:
        raise AbsentError(f"{result.name}: holds no population: run with case%analysis = "
                          "'population', or fretwear population")
    values = result["population/amplification"]
    names = [name.rpartition("@")[0] for name in result.observed[:values.shape[1]]]
    if isinstance(observe, str) and observe not in names:
        raise InputError(f"{result.name}: '{observe}' is not observed; available: "
                         + ", ".join(names) + did_you_mean(observe, words=names))
    column = names.index(observe) if isinstance(observe, str) else observe or 0
    values = values[:, column]
    values = np.sort(values[np.isfinite(values)])
    figure = new_figure(6.4, 4.2)
    axes = figure.subplots()
    share = (np.arange(values.size) + 1.0) / max(values.size, 1)
    axes.step(values, 100.0 * share, where="post", color=PALETTE[0], linewidth=1.4,
              label=f"{values.size} disks")
    for k, level in enumerate((50.0, 95.0, 99.0) if values.size else ()):
        at = float(np.percentile(values, level))
        axes.plot([at, at], [0.0, level], "--", color=PALETTE[1 + k], linewidth=0.9,
                  label=f"{level:g} %: {at:.3f}")
    axes.set_ylim(0.0, 102.0)
    axes.set_xlabel("largest amplitude / that of the tuned disk")
    axes.set_ylabel("disks below it [%]")
    tidy(axes)
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    figure.suptitle(f"Population: {names[column]}", fontsize=11)
    return figure
