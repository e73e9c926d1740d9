"""The pictures of a result as a part of a page that needs no server: a click on the response shows
loops and flanks of that point. All numbers are in the page."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.embed import components
from bokeh.embed.bundle import bundle_for_objs_and_resources
from bokeh.events import Tap
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, CustomJS
from bokeh.models.annotations import Title
from bokeh.models.widgets import Div, Select, Slider
from bokeh.resources import Resources
from numpy.typing import NDArray

from ..cycle import run_again
from ..errors import AbsentError, FretwearError
from ..plot.style import label, scale, units_of
from ..result import STATES, Result
from ..shown import dissipation, known_to, loop_of
from .figures import (
    LOOPS,
    WRAPPED,
    choices,
    loop_figure,
    map_figure,
    places_of_pairs,
    response_figure,
)

__all__ = ["standing_page"]

#: Instants of a loop.
_INSTANTS = 128

_SHOW = """
const n = at.x.length
let k = point.value - 1
if (cb_obj.event_name == "tap") {
  let best = Infinity
  for (let i = 0; i < n; i++) {
    const away = Math.abs(at.x[i] - cb_obj.x)
    if (away < best) { best = away; k = i }
  }
  if (k != point.value - 1) { point.value = k + 1; return }
}
const y = at.y[observed.value]
curve.data = {x: at.drawn.map(i => at.x[i]), y: at.drawn.map(i => at.good[i] ? y[i] : NaN)}
chosen.data = {x: [at.x[k]], y: [y[k]]}
const place = " at " + at.x[k].toPrecision(6) + " " + at.unit
words.text = "<p role='status' aria-live='polite'>" + place + ": " + y[k].toPrecision(5) + " " +
  at.length + (at.good[k] ? "" : ", not converged") + "</p>"
if (at.share != null) {
  const m = cells.data.x.length, s = at.states.indexOf(state.value)
  const found = []
  for (let i = 0; i < m; i++) found.push(at.share[(k * m + i) * at.states.length + s])
  cells.data = Object.assign({}, cells.data, {share: found})
  map_title.text = state.value + ", share of the period" + place
}
if (at.moved != null) {
  const t = at.instants, named = []
  for (let j = 0; j < loops.length; j++) {
    const first = (k * loops.length + j) * t
    loops[j].data = {x: Array.from(at.moved.slice(first, first + t)),
                     y: Array.from(at.force.slice(first, first + t))}
    named.push(at.pair[k * loops.length + j])
  }
  loop_title.text = "pairs " + named.join(", ") + place
}
"""
_NAME_THEM = """
for (const [id, name] of Object.entries(names)) {
  const view = Bokeh.index.find_one_by_id(id)
  if (view == null) continue
  for (const handle of (view.shadow_el ?? view.el).querySelectorAll(".noUi-handle, canvas"))
    handle.setAttribute("aria-label", name)
}
"""


def standing_page(result: Result) -> tuple[str, str]:
    """What goes into the head of a page and into its body.

    Parameters
    ----------
    result : Result
        A sweep or a branch.

    Returns
    -------
    head, body : str
        All of Bokeh that is needed, without any reference to the outside; the pictures.
    """
    layout = _layout(result)
    script, division = components(layout)
    # Only the parts of Bokeh that these pictures take.
    parts = bundle_for_objs_and_resources([layout], Resources(mode="inline"))
    head = [f"<style>{text}</style>" for text in parts.css_raw]
    head += [f"<script>{text}</script>" for text in parts.js_raw]
    return "\n".join(head), f"{division}\n{script}"


def _layout(result: Result) -> Any:
    at, loop_words = _numbers(result)
    curve, chosen = (ColumnDataSource({"x": [], "y": []}) for _ in range(2))
    failed = at["x"][~np.array(at["good"])] if len(at["good"]) else at["x"]
    missing = ColumnDataSource({"x": failed.tolist(), "y": [0.0] * len(failed)})
    loops = [ColumnDataSource({"x": [], "y": []})
             for _ in range(min(LOOPS, max(result.n_pairs, 1)))]
    x, y, width, height = places_of_pairs(result) if "contact/fraction" in result else (
        np.zeros(0),) * 4
    cells = ColumnDataSource({"x": x.tolist(), "y": y.tolist(), "w": width.tolist(),
                              "h": height.tolist(), "share": [0.0] * len(x),
                              "name": [str(k + 1) for k in range(len(x))]})
    observed = Select(title="observed", options=choices(result.observed), value=result.observed[0],
                      width=280, visible=len(result.observed) > 1)
    state = Select(title="map shows the share of the period in", value="slip",
                   options=choices(STATES), width=280, visible=len(x) > 0)
    point = Slider(title="point", start=1, end=max(result.n_points, 2), step=1,
                   value=_highest(result) + 1, width=280)
    words, map_title = Div(text="", width=280), Title(text="flanks")
    loop_title = Title(text=loop_words)
    response = response_figure(curve, missing, chosen)
    response.yaxis.axis_label = label("amplitude", at["length"])
    response.xaxis.axis_label = label(at["name"], at["unit"])
    pictures = [response]
    below: list[Any] = []
    if at["moved"] is not None:
        loop = loop_figure(loops, loop_title)
        loop.xaxis.axis_label, loop.yaxis.axis_label = at["axes"]
        below.append(loop)
    elif loop_words:
        below.append(Div(text=f"<p>{loop_words}</p>", sizing_mode="stretch_width"))
    if len(x):
        below.append(map_figure(cells, map_title))
    show = CustomJS(args={
        "at": at, "curve": curve, "chosen": chosen, "loops": loops, "cells": cells,
        "observed": observed, "state": state, "point": point, "words": words,
        "map_title": map_title, "loop_title": loop_title}, code=_SHOW)
    response.js_on_event(Tap, show)
    for widget in (observed, state, point):
        widget.js_on_change("value", show)
    response.js_on_event("document_ready", show)
    side = row(point, observed, state, words, sizing_mode="stretch_width", styles=WRAPPED)
    body = column(*pictures, side, row(*below, sizing_mode="stretch_width", styles=WRAPPED),
                  sizing_mode="stretch_width")
    names = {point.id: "point", response.id: "response, click a point for its loops"}
    ready = CustomJS(args={"names": names, "show": show, "point": point}, code=_NAME_THEM)
    body.js_on_event("document_ready", ready)
    _first_state(result, at, curve, chosen, cells, loops, (words, map_title, loop_title))
    return body


def _first_state(result: Result, at: dict[str, Any], curve: ColumnDataSource,
                 chosen: ColumnDataSource, cells: ColumnDataSource,
                 loops: list[ColumnDataSource], texts: tuple[Div, Title, Title]) -> None:
    """What stands on the page before anything is clicked: the highest point."""
    k, y = _highest(result), at["y"][result.observed[0]]
    words, map_title, loop_title = texts
    place = f" at {at['x'][k]:.6g} {at['unit']}"
    good = np.array(at["good"])
    drawn = at["drawn"]
    curve.data = {"x": at["x"][drawn].tolist(), "y": np.where(good, y, np.nan)[drawn].tolist()}
    chosen.data = {"x": [float(at["x"][k])], "y": [float(y[k])]}
    words.text = f"<p role='status'>{place}: {y[k]:.5g} {at['length']}</p>"
    if at["share"] is not None:
        cells.data["share"] = result.fraction[k, :, STATES.index("slip")].tolist()
        map_title.text = f"slip, share of the period{place}"
    if at["moved"] is not None:
        n, t = len(loops), at["instants"]
        for j, source in enumerate(loops):
            first = (k * n + j) * t
            source.data = {"x": at["moved"][first:first + t].tolist(),
                           "y": at["force"][first:first + t].tolist()}
        named = ", ".join(map(str, at["pair"][k * n:(k + 1) * n].tolist()))
        loop_title.text = f"pairs {named}{place}"


def _highest(result: Result) -> int:
    return result.peak() if result.converged.any() else 0


def _numbers(result: Result) -> tuple[dict[str, Any], str]:
    """What the page knows of every point; and what is said of the loops."""
    over_parameter = "parameter" in result
    place = result.parameter if over_parameter else result.frequency
    is_branch = "tangent" in result or (np.diff(place) > 0.0).all() or (np.diff(place) < 0.0).all()
    drawn = np.arange(len(place)) if is_branch else np.argsort(place, kind="stable")
    found: dict[str, Any] = {
        "x": np.asarray(place, dtype=float),
        "y": {name: np.array(result.amplitude[:, k], dtype=float)
              for k, name in enumerate(result.observed)},
        "good": result.converged.tolist(), "drawn": drawn.tolist(), "states": list(STATES),
        "name": result.parameter_name, "unit": "" if over_parameter else "Hz",
        "length": units_of(result, "amplitude"), "share": None, "moved": None,
        "force": None, "pair": None, "instants": 0, "axes": ("", "")}
    if "contact/fraction" in result:
        found["share"] = result.fraction.astype(np.float32).ravel()
    words = ""
    if "contact/dissipation" in result and result.n_pairs:
        try:
            found |= _loops(result)
        except FretwearError as error:
            words = f"No loops: {error}"
    return found, words


def _loops(result: Result) -> dict[str, Any]:
    """Loops of the pairs that dissipate most at each point, by a run that keeps histories."""
    n_loops = min(LOOPS, result.n_pairs)
    known = _with_periods(result)
    pairs = np.argsort(-dissipation(result), axis=1, kind="stable")[:, :n_loops]
    sizes, limit = np.abs(result.amplitude).max(axis=1), known_to(result)
    moved = np.zeros((result.n_points, n_loops, _INSTANTS + 1))
    force = np.zeros_like(moved)
    for point in range(result.n_points):
        if not result.converged[point]:
            moved[point] = force[point] = np.nan
            continue
        try:
            cycle = known.cycle(point)
        except AbsentError:  # a loop that cannot be had leaves its place empty
            moved[point] = force[point] = np.nan
            continue
        instants = np.linspace(0.0, len(cycle.displacement) - 1, _INSTANTS + 1).round().astype(int)
        for j, pair in enumerate(pairs[point]):
            loop = loop_of(cycle, pair, float(sizes[point]), limit)
            moved[point, j], force[point, j] = loop.displacement[instants], loop.force[instants]
    by, length = scale(float(np.nanmax(np.abs(moved), initial=0.0)), units_of(result, "amplitude"))
    times, newton = scale(float(np.nanmax(np.abs(force), initial=0.0)),
                          units_of(result, "contact/force"))
    return {"moved": _single(by * moved), "force": _single(times * force),
            "pair": (pairs + 1).astype(np.int32).ravel(), "instants": _INSTANTS + 1,
            "axes": (label("relative displacement", length), label("contact force", newton))}


def _with_periods(result: Result) -> Result:
    """The result, or its run with histories; the result where that comes out otherwise, of which
    each point is then solved again by itself.
    """
    if "history/force" in result:
        return result
    try:
        return run_again(result)
    except FretwearError:
        result.cycle(_highest(result))  # or why there is none
        return result


def _single(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return values.astype(np.float32).ravel()
