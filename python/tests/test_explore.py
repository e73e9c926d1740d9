"""The page with sliders: its keys, its solver, and the page itself in a browser."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsing import headless_browser, wait_for

import fretwear as fw
from fretwear.errors import InputError
from fretwear.explore.sliders import read_slider, settings_of, unit_of, usual_sliders
from fretwear.explore.solver import Answer, Solver

__all__ = ["headless_browser"]  # a fixture

RUBBING = """
&case title = 'A mass that rubs' /
&model n_dof = 1, mass = 1.0, stiffness = 1.0, damping = 0.04 /
&contact n_pairs = 1, law = 'penalty', tangential_stiffness = 1.0,
         side_1 = 1, 0, 0, mu = 0.5, normal_load = 1.0 /
&load cosine = 1.0 /
&harmonics n_harmonics = 3 /
&sweep start = 0.6, end = 1.6, n_points = 31 /
&output observe = 1 /
"""


@pytest.fixture(name="case")
def small_case(tmp_path: Path) -> fw.Case:
    """A sweep of an oscillator; nothing is written beside its namelist."""
    return fw.Case.from_text(RUBBING, tmp_path / "rubbing.nml")


def test_usual_sliders_enclose_the_case(case: fw.Case) -> None:
    sliders = usual_sliders(case)
    assert [slider.key for slider in sliders] == [
        "load%harmonic_scale", "contact%mu", "contact%normal_load", "harmonics%n_harmonics"]
    for slider in sliders:
        assert slider.low < slider.value < slider.high
        steps = (slider.high - slider.low) / slider.step
        assert 10 <= steps <= 250 or slider.is_whole


def test_slider_of_the_command_line(case: fw.Case) -> None:
    slider = read_slider("contact%mu=0.1:0.9", case)
    assert (slider.low, slider.high, slider.value) == pytest.approx((0.1, 0.9, 0.5))
    whole = read_slider("harmonics%n_harmonics=1:9", case)
    assert settings_of([slider, whole], [0.30000000000000004, 5.0]) == {
        "contact": {"mu": 0.3}, "harmonics": {"n_harmonics": 5}}
    # A hundredth of the range for each press of a key, of values typed without a point too.
    wide = read_slider("harmonics%n_time=16:6400", case.replace(harmonics={"n_time": 512}))
    assert wide.is_whole and 60 <= wide.step <= 68
    assert (wide.value - wide.low) % wide.step == 0 and wide.low >= 16 and wide.high <= 6400
    assert unit_of("contact%normal_load", "mm", "N") == "N"
    assert unit_of("contact%tangential_stiffness", "mm", "N") == "N/mm"
    assert unit_of("model%rotation_speed", "", "") == "rad/s"
    assert unit_of("contact%mu", "mm", "N") == unit_of("contact%gap", "", "") == ""
    for wrong, word in (("contact%mu", "low:high"), ("contact%mu=1:0", "lower one first"),
                        ("model%source=0:1", "one number"),
                        ("contact%mu=0.6:0.9", "mu is 0.5 in the case"),
                        ("contact%slip_speed=0.1:0.9", "no value in the case")):
        with pytest.raises(InputError, match=word):
            read_slider(wrong, case)


def test_sliders_start_where_the_model_file_has_them(case: fw.Case, tmp_path: Path) -> None:
    """A key that the namelist does not name starts at its value in the model, and a page where
    nothing has been moved is the case, to the last bit."""
    model = fw.Model([[1.0]], None, [[1.0]], contact=fw.ContactPairs(
        [[1, 0, 0]], mu=0.2512345, normal_load=1.0, tangential_stiffness=1.0), cosine=[1.0],
        observe={"tip": 1})
    model.to_hdf5(tmp_path / "model.h5")
    of_file = fw.Case(tmp_path / "model.h5", sweep={"start": 0.6, "end": 1.6, "n_points": 5},
                      structure={"modal_damping": 0.02}, contact={"law": "penalty"})
    slider = read_slider("contact%mu=0.1:0.9", of_file)
    assert slider.value == 0.2512345
    usual = usual_sliders(of_file)
    assert {one.key: one.value for one in usual}["contact%mu"] == 0.2512345
    assert settings_of(usual, [one.value for one in usual]) == {}
    assert settings_of([slider], [0.3]) == {"contact": {"mu": 0.3}}


class _Answers:
    """Answers of a solver, with a way to wait for one."""

    def __init__(self) -> None:
        self.all: list[Answer] = []
        self._changed = threading.Condition()

    def __call__(self, answer: Answer) -> None:
        with self._changed:
            self.all.append(answer)
            self._changed.notify()

    def wait(self, met: Callable[[Answer], bool]) -> Answer:
        with self._changed:
            assert self._changed.wait_for(lambda: any(map(met, self.all)), timeout=60.0)
            return next(filter(met, self.all))


def test_answers_are_those_of_a_run(case: fw.Case, tmp_path: Path) -> None:
    answers = _Answers()
    solver = Solver(case, answers, max_seconds=60.0)
    try:
        solver.ask({"contact": {"mu": 0.2}})
        answer = answers.wait(lambda one: one.is_final)
    finally:
        solver.stop()
    expected = fw.run(case.replace(contact={"mu": 0.2}), in_memory=True)
    assert answer.result is not None
    np.testing.assert_array_equal(answer.result.amplitude, expected.amplitude)
    assert list(tmp_path.iterdir()) == []


def test_only_the_newest_wish_is_computed(case: fw.Case) -> None:
    """What is at work is given up for what is wished; what was refused does not end the page."""
    answers = _Answers()
    # Minutes of work if it were done: a million points.
    solver = Solver(case.replace(sweep={"n_points": 1_000_000}), answers, max_seconds=600.0)
    try:
        solver.ask({})
        time.sleep(0.2)
        solver.ask({"contact": {"mu": -1.0}})
        refused = answers.wait(lambda one: one.result is None)
        assert "contact%mu" in refused.words or "mu" in refused.words
        solver.ask({"sweep": {"n_points": 5}})
        served = answers.wait(lambda one: one.result is not None and one.is_final)
        assert served.result is not None
        assert served.result.n_points == 5
    finally:
        solver.stop()


def test_a_limit_of_time_shows_what_is_there(case: fw.Case) -> None:
    answers = _Answers()
    solver = Solver(case.replace(sweep={"n_points": 1_000_000}), answers, max_seconds=0.5)
    try:
        solver.ask({})
        answer = answers.wait(lambda one: True)
    finally:
        solver.stop()
    assert "stopped after 0.5 s" in answer.words
    assert answer.result is not None
    assert 0 < answer.result.n_points < 1_000_000


def test_only_sweeps_are_explored(case: fw.Case) -> None:
    pytest.importorskip("bokeh")
    from fretwear.explore import serve

    with pytest.raises(InputError, match="analysis = point"):
        serve(case.replace(case={"analysis": "point"}))


# ---------------------------------------------------------------------- in a browser

#: Sliders of the page: identifier, title, value.
_SLIDERS = """return [...Bokeh.documents[0]._all_models.values()]
  .filter(m => m.type == "Slider").map(m => [m.id, m.title, m.value])"""
_HANDLE = """return Bokeh.index.find_one_by_id(arguments[0]).shadow_el
  .querySelector(".noUi-handle")"""
_BAR = """return Bokeh.index.find_one_by_id(arguments[0]).shadow_el
  .querySelector(".noUi-base")"""
_RANGE = """const m = Bokeh.documents[0].get_model_by_id(arguments[0])
  return [m.start, m.end, m.value]"""
_WORDS = """return [...Bokeh.documents[0]._all_models.values()]
  .filter(m => m.type == "Div").map(m => m.text).join(" ")"""


def test_page_in_a_browser(case: fw.Case, browser: Any) -> None:
    """Mouse and keys turn the sliders; the answer is that of a run; nothing leaves the machine."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    from fretwear.explore import serve

    server = serve(case)
    thread = threading.Thread(target=server.io_loop.start, daemon=True)
    thread.start()
    try:
        browser.get(f"http://127.0.0.1:{server.port}/")
        wait_for(browser, _WORDS, lambda words: "highest" in words)
        sliders = browser.execute_script(_SLIDERS)
        load, friction = (next(s for s in sliders if s[1].startswith(word))
                          for word in ("factor", "friction"))
        handle = browser.execute_script(_HANDLE, load[0])
        assert handle.get_attribute("aria-label") == load[1]
        assert handle.get_attribute("role") == "slider"
        # A click on the bar takes the value there: at the middle that of the middle.
        bar = browser.execute_script(_BAR, load[0])
        ActionChains(browser).move_to_element(bar).click().perform()
        low, high, value = browser.execute_script(_RANGE, load[0])
        assert abs(value - 0.5 * (low + high)) <= 0.02 * (high - low)
        ActionChains(browser).drag_and_drop_by_offset(handle, 40, 0).perform()
        browser.execute_script(_HANDLE, friction[0]).send_keys(Keys.ARROW_LEFT)
        changed = wait_for(browser, _SLIDERS, lambda now: all(
            new[2] != old[2] for new, old in zip(now, sliders) if old in (load, friction)))
        values = {title: value for _, title, value in changed}
        expected = fw.run(case.replace(
            load={"harmonic_scale": round(values[load[1]], 6)},
            contact={"mu": round(values[friction[1]], 6)}), in_memory=True)
        _, height = expected.maximum()
        wait_for(browser, _WORDS, lambda words: f"highest {height:.4g} " in words)
        for width in (360, 800, 1600):
            browser.set_window_size(width, 900)
            wide = browser.execute_script("return document.documentElement.scrollWidth")
            inside = browser.execute_script("return window.innerWidth")
            assert wide <= inside, f"the page is {wide} px wide in a window of {inside}"
        asked = [json.loads(entry["message"])["message"] for entry in
                 browser.get_log("performance")]
        addresses = {one["params"]["request"]["url"] for one in asked
                     if one["method"] == "Network.requestWillBeSent"}
        assert addresses
        assert all(address.startswith((f"http://127.0.0.1:{server.port}/", "data:"))
                   for address in addresses), addresses
    finally:
        server.io_loop.add_callback(server.io_loop.stop)
        thread.join()
        server.stop()
