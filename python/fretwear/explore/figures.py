"""The three pictures of the pages: response, loops and map of the flanks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, LinearColorMapper
from bokeh.models.annotations import ColorBar, Title
from bokeh.plotting import figure
from numpy.typing import NDArray

from ..errors import InputError
from ..plot.flanks import find_flanks
from ..plot.style import CURVE, PALETTE
from ..result import Result

__all__ = ["LOOPS", "WRAPPED", "choices", "loop_figure", "map_figure", "places_of_pairs",
           "response_figure"]

#: Pairs whose loops are drawn: those that dissipate most.
LOOPS = 3
#: Side by side where there is room, one below the other on a telephone.
WRAPPED = {"flex-wrap": "wrap"}
_GREY = "#9aa5b1"
_TOOLS = "pan,wheel_zoom,box_zoom,reset,save"


def response_figure(curve: ColumnDataSource, missing: ColumnDataSource, chosen: ColumnDataSource,
                    first: ColumnDataSource | None = None) -> figure:
    """The response: curve, points that are missing, the chosen one, and a curve to compare with."""
    found = figure(height=330, sizing_mode="stretch_width", tools=_TOOLS,
                   title="response (click a point for its loops)",
                   x_axis_label="frequency [Hz]", y_axis_label="amplitude")
    if first is not None:
        found.line("x", "y", source=first, color=_GREY, line_dash="dashed",
                   legend_label="as the case has it")
        now = found.line("x", "y", source=curve, color=CURVE, line_width=2, legend_label="now")
    else:
        now = found.line("x", "y", source=curve, color=CURVE, line_width=2)
    found.scatter("x", "y", source=missing, marker="x", size=8, color="#c0392b")
    found.scatter("x", "y", source=chosen, size=9, color=PALETTE[1])
    found.add_tools(HoverTool(renderers=[now], tooltips=[("frequency", "@x{0.0000}"),
                                                         ("amplitude", "@y")]))
    if first is not None:
        # Above the curves, where it covers none of them on a narrow screen.
        legend = found.legend[0]
        legend.orientation, legend.click_policy = "horizontal", "hide"
        legend.border_line_color = None
        found.add_layout(legend, "above")
    return found


def loop_figure(loops: Sequence[ColumnDataSource], title: Title) -> figure:
    """Contact force over relative displacement, a line for each pair."""
    found = figure(height=280, sizing_mode="stretch_width", min_width=300, tools=_TOOLS,
                   title=title)
    for source, colour in zip(loops, PALETTE):
        found.line("x", "y", source=source, color=colour, line_width=2)
    return found


def map_figure(cells: ColumnDataSource, title: Title) -> figure:
    """A cell for each pair, coloured by a share of the period."""
    colours = LinearColorMapper(palette="Viridis256", low=0.0, high=1.0)
    found = figure(height=280, sizing_mode="stretch_width", min_width=300,
                   tools=_TOOLS + ",hover", title=title,
                   tooltips=[("pair", "@name"), ("share", "@share{0.00}")])
    found.rect("x", "y", width="w", height="h", source=cells, line_color="white",
               fill_color={"field": "share", "transform": colours})
    found.add_layout(ColorBar(color_mapper=colours, width=10), "right")
    found.axis.visible, found.grid.visible = False, False
    return found


def places_of_pairs(result: Result) -> tuple[NDArray[np.float64], ...]:
    """Centre and size of the cell of every pair: flanks side by side, or all pairs in a row."""
    n = result.n_pairs
    x, y = np.arange(1.0, n + 1.0), np.zeros(n)
    width, height = np.full(n, 0.9), np.ones(n)
    try:
        flanks = find_flanks(result)
    except InputError:
        return x, y, width, height
    left = 0.0
    for flank in flanks:
        size = np.where(np.isnan(flank.size), np.nanmax(np.append(flank.size, 0.0)) or 1.0,
                        flank.size)
        low = (flank.place - 0.5 * size).min(axis=0)
        right = (flank.place + 0.5 * size).max(axis=0)[0]
        x[flank.pairs] = left + flank.place[:, 0] - low[0]
        y[flank.pairs] = flank.place[:, 1] - low[1]
        width[flank.pairs], height[flank.pairs] = size.T
        left += 1.15 * (right - low[0])
    return x, y, width, height


def choices(names: Sequence[str]) -> list[str | tuple[Any, str]]:
    """Names as a Select takes them."""
    return [*names]
