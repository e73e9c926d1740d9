"""The page: sliders on the left; the curve, loops and the map of the flanks follow them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.events import Tap
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, CustomJS
from bokeh.models.annotations import Title
from bokeh.models.widgets import Button, Div, Select
from bokeh.models.widgets import Slider as Handle
from numpy.typing import NDArray

from ..case import Case
from ..errors import AbsentError
from ..plot.style import label, largest_of, scale, units_of
from ..result import STATES, Result
from ..shown import dissipation, highest, known_to, loop_of
from .figures import (
    LOOPS,
    WRAPPED,
    choices,
    loop_figure,
    map_figure,
    places_of_pairs,
    response_figure,
)
from .sliders import Slider, settings_of, unit_of
from .solver import Answer, Solver

__all__ = ["Page"]

_WIDTH = 300
#: What a screen reader reads; Bokeh gives its handles a role and a value, but no name.
_NAME_THEM = """
for (const [id, name] of Object.entries(names)) {
  const view = Bokeh.index.find_one_by_id(id)
  if (view == null) continue
  const root = view.shadow_el ?? view.el
  for (const handle of root.querySelectorAll(".noUi-handle, canvas"))
    handle.setAttribute("aria-label", name)
}
"""


class Page:
    """One visitor's page of a case.

    Parameters
    ----------
    document : bokeh Document
        What the browser shows.
    case : Case
        A frequency sweep.
    sliders : list of Slider
        Keys to turn.
    title : str
        Heading.
    max_seconds : float
        Limit of one sweep.
    """

    def __init__(self, document: Document, case: Case, sliders: Sequence[Slider], title: str,
                 max_seconds: float) -> None:
        self._document, self._sliders = document, list(sliders)
        self._result: Result | None = None
        self._point: int | None = None
        self._places: tuple[NDArray[np.float64], ...] | None = None
        self._curve = ColumnDataSource({"x": [], "y": []})
        self._first = ColumnDataSource({"x": [], "y": []})
        self._missing = ColumnDataSource({"x": [], "y": []})
        self._chosen = ColumnDataSource({"x": [], "y": []})
        self._loops = [ColumnDataSource({"x": [], "y": []}) for _ in range(LOOPS)]
        self._cells = ColumnDataSource({"x": [], "y": [], "w": [], "h": [], "share": [],
                                        "name": []})
        self._handles = [self._handle(slider) for slider in self._sliders]
        self._observed = Select(title="observed", options=[], width=_WIDTH, visible=False)
        self._state = Select(title="map shows the share of the period in", value="slip",
                             options=choices(STATES), width=_WIDTH)
        self._words = Div(width=_WIDTH)
        self._loop_title = Title(text="loops of the pairs that dissipate most")
        self._map_title = Title(text="flanks")
        self._build(title)
        self._solver = Solver(case, self._later, max_seconds)
        document.on_session_destroyed(lambda _context: self._solver.stop())
        self._ask()

    # ------------------------------------------------------------------ what is on the page

    def _handle(self, slider: Slider) -> Handle:
        handle = Handle(title=slider.title, start=slider.low, end=slider.high, step=slider.step,
                        value=slider.value, width=_WIDTH - 20, margin=(6, 10, 6, 10),
                        format="0" if slider.is_whole else "0." + slider.decimals * "0")
        handle.on_change("value", lambda _name, _old, _new: self._ask())
        return handle

    def _build(self, title: str) -> None:
        self._response = response_figure(self._curve, self._missing, self._chosen, self._first)
        self._response.on_event(Tap, self._tapped)
        self._loop = loop_figure(self._loops, self._loop_title)
        self._map = map_figure(self._cells, self._map_title)
        self._observed.on_change("value", lambda _name, _old, _new: self._draw())
        self._state.on_change("value", lambda _name, _old, _new: self._draw_map())
        back = Button(label="back to the case", width=_WIDTH)
        back.on_click(self._back)
        heading = Div(text=f"<h1 style='font-size:1.15rem;margin:0'>{escape(title)}</h1>",
                      sizing_mode="stretch_width")
        side = column(*self._handles, self._observed, self._state, back, self._words,
                      width=_WIDTH + 20)
        # Side by side where there is room, one below the other on a telephone.
        contact = row(self._loop, self._map, sizing_mode="stretch_width", styles=WRAPPED)
        pictures = column(self._response, contact, sizing_mode="stretch_width",
                          styles={"flex": "1 1 320px"})
        body = row(side, pictures, sizing_mode="stretch_width", styles=WRAPPED)
        self._document.add_root(column(heading, body, sizing_mode="stretch_width"))
        self._document.title = title
        names = {handle.id: slider.title for handle, slider in zip(self._handles, self._sliders)}
        names |= {self._response.id: "frequency response", self._loop.id: "contact loops",
                  self._map.id: "map of the flanks"}
        self._document.js_on_event("document_ready",
                                   CustomJS(args={"names": names}, code=_NAME_THEM))

    # ------------------------------------------------------------------ what happens

    def _ask(self) -> None:
        self._solver.ask(settings_of(self._sliders, [handle.value for handle in self._handles]))
        self._say("computing ...")

    def _back(self) -> None:
        for handle, slider in zip(self._handles, self._sliders):
            handle.value = slider.value

    def _later(self, answer: Answer) -> None:
        """Called by the solver's thread: the page may change in its own only."""
        self._document.add_next_tick_callback(lambda: self._show(answer))

    def _show(self, answer: Answer) -> None:
        if answer.result is None:
            self._say(answer.words, "#c0392b")
            return
        with answer.result.kept_open():
            self._show_curve(answer, answer.result)

        def contact() -> None:
            """Behind the curve, which nobody shall wait longer for; and of the newest alone."""
            if self._result is answer.result and answer.result is not None:
                with answer.result.kept_open():
                    self._draw_point()

        self._document.add_next_tick_callback(contact)

    def _show_curve(self, answer: Answer, result: Result) -> None:
        self._result = result
        if not self._observed.options:
            self._observed.options = choices(result.observed)
            self._observed.value = result.observed[0]
            self._observed.visible = len(result.observed) > 1
            self._say_units(result)
        self._draw_curve()
        if not self._first.data["x"] and answer.is_final:
            self._first.data = dict(self._curve.data)
        top = highest(result, self._observed.value)
        text = "no point has converged"
        if top is not None:
            text = (f"highest {top.height:.4g} {units_of(result, 'amplitude')} at {top.place:.5g} "
                    f"Hz {top.words}").rstrip()
        if not answer.is_final:
            text += " (few points; more follow)"
        self._say(f"{text}; {answer.seconds:.2f} s" + (f". {answer.words}" if answer.words else ""))

    def _say_units(self, result: Result) -> None:
        """Titles of the sliders with the units of the model, which the first answer knows."""
        length, force = units_of(result, "amplitude"), units_of(result, "contact/force")
        for handle, slider in zip(self._handles, self._sliders):
            handle.title = label(slider.title, unit_of(slider.key, length, force))

    def _say(self, words: str, colour: str = "#1c2733") -> None:
        self._words.text = (f"<p role='status' aria-live='polite' style='color:{colour}'>"
                            f"{escape(words)}</p>")

    def _tapped(self, event: Any) -> None:
        """Choose the point nearest to a click."""
        if self._result is None:
            return
        self._point = int(np.argmin(np.abs(self._result.frequency - event.x)))
        self._draw_point()
        self._say(f"point {self._point + 1}: {self._amplitude()[self._point]:.4g} "
                  f"{units_of(self._result, 'amplitude')} at "
                  f"{self._result.frequency[self._point]:.6g} Hz"
                  + ("" if self._result.converged[self._point] else ", not converged"))

    # ------------------------------------------------------------------ drawing

    def _amplitude(self) -> NDArray[np.float64]:
        assert self._result is not None
        return self._result.amplitude_of(self._observed.value)

    def _draw(self) -> None:
        self._draw_curve()
        self._draw_point()

    def _draw_curve(self) -> None:
        result = self._result
        if result is None:
            return
        amplitude = np.where(result.converged, self._amplitude(), np.nan)
        order = np.argsort(result.frequency, kind="stable")
        self._curve.data = {"x": result.frequency[order].tolist(),
                            "y": amplitude[order].tolist()}
        failed = result.frequency[~result.converged]
        self._missing.data = {"x": failed.tolist(), "y": [0.0] * len(failed)}
        self._response.yaxis.axis_label = label(f"amplitude of {self._observed.value}",
                                                units_of(result, "amplitude"))
        self._point = None

    def _draw_point(self) -> None:
        """The chosen point, or the highest row, with its loops and its map."""
        result = self._result
        if result is None or not result.converged.any():
            return
        amplitude = self._amplitude()
        if self._point is None:
            self._point = int(np.nanargmax(np.where(result.converged, amplitude, np.nan)))
        self._chosen.data = {"x": [float(result.frequency[self._point])],
                             "y": [float(amplitude[self._point])]}
        self._draw_loops()
        self._draw_map()

    def _draw_loops(self) -> None:
        result, point = self._result, self._point
        for source in self._loops:
            source.data = {"x": [], "y": []}
        if result is None or point is None or "contact/dissipation" not in result:
            return
        try:
            cycle = result.cycle(point)
        except AbsentError as absent:
            self._loop_title.text = str(absent)
            return
        pairs = np.argsort(-dissipation(result)[point], kind="stable")[:LOOPS]
        size, limit = float(np.abs(result.amplitude[point]).max()), known_to(result)
        loops = [loop_of(cycle, pair, size, limit) for pair in pairs]
        moved, length = scale(largest_of(*(loop.displacement for loop in loops)),
                              units_of(result, "amplitude"))
        pressed, force = scale(largest_of(*(loop.force for loop in loops)),
                               units_of(result, "contact/force"))
        for source, loop in zip(self._loops, loops):
            source.data = {"x": (moved * loop.displacement).tolist(),
                           "y": (pressed * loop.force).tolist()}
        self._loop_title.text = (f"pairs {', '.join(str(pair + 1) for pair in pairs)} at "
                                 f"{result.frequency[point]:.5g} Hz"
                                 + ("" if any(loop.moves for loop in loops) else ", at rest"))
        self._loop.xaxis.axis_label = label("relative displacement", length)
        self._loop.yaxis.axis_label = label("contact force", force)

    def _draw_map(self) -> None:
        result, point = self._result, self._point
        if result is None or point is None or "contact/fraction" not in result:
            return
        share = result.fraction[point, :, STATES.index(self._state.value)]
        if self._places is None:
            self._places = places_of_pairs(result)  # those of the model, whatever is turned
        x, y, width, height = self._places
        self._cells.data = {"x": x.tolist(), "y": y.tolist(), "w": width.tolist(),
                            "h": height.tolist(), "share": share.tolist(),
                            "name": [str(pair + 1) for pair in range(result.n_pairs)]}
        self._map_title.text = (f"{self._state.value}, share of the period at "
                                f"{result.frequency[point]:.5g} Hz")
