"""Missions of wear: depth flight by flight, and which block has worn it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..errors import InputError
from .style import (
    PALETTE,
    Source,
    as_result,
    label,
    largest_of,
    new_figure,
    pair_name,
    scale_axis,
    tidy,
    units_of,
)

__all__ = ["plot_mission"]

#: Pairs with a curve and a bar of their own: those that are worn most.
_MOST_PAIRS = 8


def plot_mission(source: Source) -> Figure:
    """Depth over the flights, and the share of each block in the last depth.

    Parameters
    ----------
    source : Result or path
        Result of a wear analysis with ``&mission``. Shown are the pairs that are worn most; marks
        are the flights that the run came by.
    """
    result = as_result(source)
    if "mission/depth" not in result:
        raise InputError(f"{result.name}: holds no mission; run with &mission")
    depth, share = result["mission/depth"], result["mission/share"]
    flown = np.flatnonzero(np.isfinite(depth).all(axis=1))
    last = depth[flown[-1]]
    worst = sorted(int(pair) for pair in np.argsort(-last, kind="stable")[:_MOST_PAIRS])
    figure = new_figure(8.0, 6.0)
    above, below = figure.subplots(2, 1)
    few = len(flown) <= 60
    for k, pair in enumerate(worst):
        above.plot(flown, depth[flown, pair], color=PALETTE[k % len(PALETTE)],
                   marker="o" if few else None, markersize=3.0, linewidth=1.2,
                   label=pair_name(result, pair))
    above.set_ylabel(label("wear depth", scale_axis(
        above.yaxis, largest_of(depth[flown]), units_of(result, "wear/depth"))))
    above.set_xlabel("flight")
    above.set_xlim(0, max(int(flown[-1]), 1))
    above.locator_params(axis="x", integer=True)
    if len(worst) > 1:
        above.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    tidy(above)
    bottom = np.zeros(len(worst))
    for k, name in enumerate(result["mission/name"]):
        part = 100.0 * share[k][worst]
        below.bar(range(len(worst)), part, bottom=bottom, width=0.7,
                  color=PALETTE[k % len(PALETTE)], label=str(name))
        bottom = bottom + part
    below.set_xticks(range(len(worst)), [pair_name(result, pair) for pair in worst])
    below.set_ylabel(label("share of the last depth", "%"))
    below.set_ylim(0.0, 100.0)
    below.legend(fontsize=8, frameon=False, bbox_to_anchor=(1.0, 1.0), loc="upper left")
    tidy(below)
    figure.suptitle(f"{int(flown[-1])} flights of {len(share)} blocks, "
                    f"{result['wear/cycles'][-1]:.4g} cycles", fontsize=11)
    return figure
