"""`fretwear report`: a page that stands alone and holds the numbers of its result."""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from browsing import headless_browser, wait_for
from rubbing import RUBBING

import fretwear as fw
from fretwear.cli import main
from fretwear.plot import KINDS, Choices, fitting
from fretwear.report import render_report, write_report
from fretwear.result import Result

__all__ = ["headless_browser"]  # a fixture

_VOID = {"meta", "img", "br", "link", "input", "hr"}


class _Page(HTMLParser):
    """Sections, pictures, cells and everything that refers to somewhere."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.pictures: list[str] = []
        self.rows: list[list[str]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attributes}
        if tag not in _VOID:
            self.open.append(tag)
        self.ids += [found["id"]] if "id" in found else []
        self.references += [found[name] for name in ("href", "src", "srcset", "action", "data")
                            if name in found]
        if tag == "img":
            assert found["alt"]
            self.pictures.append(found["src"])
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        assert tag not in ("script", "link", "iframe", "object")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes another element"

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def text(coarse: Result) -> str:
    """Page of a sweep."""
    return render_report(coarse, Choices())


@pytest.fixture(scope="module")
def worn_text(worn: Result) -> str:
    """Page of a wear analysis."""
    return render_report(worn, Choices())


def _page(text: str) -> _Page:
    page = _Page(text)
    assert page.open == []
    return page


def test_the_page_stands_alone(text: str) -> None:
    page = _page(text)
    anchors = [target for target in page.references if target.startswith("#")]
    rest = [target for target in page.references if not target.startswith("#")]
    assert {target[1:] for target in anchors} == set(page.ids)
    assert all(target.startswith("data:image/svg+xml;base64,") for target in rest)
    assert "@import" not in text and "url(" not in text


def test_every_picture_that_fits_is_there(coarse: Result, worn: Result, text: str,
                                          worn_text: str) -> None:
    for result, source in ((coarse, text), (worn, worn_text)):
        page = _page(source)
        assert [name for name in page.ids if name in KINDS] == fitting(result)
        assert len(page.pictures) == len(fitting(result))
        for picture in page.pictures:
            svg = ElementTree.fromstring(base64.b64decode(picture.partition(",")[2]))
            assert svg.tag.endswith("svg") and len(list(svg.iter())) > 20
            for element in svg.iter():
                for name, value in element.attrib.items():
                    assert not name.endswith("href") or value.startswith(("#", "data:"))


def test_the_numbers_are_those_of_the_result(coarse: Result, text: str) -> None:
    page = _page(text)
    assert ["peak of tip", f"{coarse.maximum('tip')[1]:.6g}", "mm"] in page.rows
    assert ["converged points", "40 of 40", ""] in page.rows
    head = next(row for row in page.rows if row[:1] == ["point"])
    assert head[:4] == ["point", "frequency [Hz]", "tip [mm]", "tip_x [mm]"]
    first = page.rows.index(head) + 1
    for k in range(coarse.n_points):
        row = page.rows[first + k]
        assert row[0] == str(k + 1) and row[1] == f"{coarse.frequency[k]:.6g}"
        assert row[2:4] == [f"{value:.6g}" for value in coarse.amplitude[k]]
    assert coarse.namelist in page.text


def test_numbers_of_wear(worn: Result, worn_text: str) -> None:
    rows = _page(worn_text).rows
    worst = int(np.argmax(worn.depth[-1]))
    assert ["steady state", "reached", ""] in rows
    assert [f"largest depth, pair {worst + 1}", f"{worn.depth[-1].max():.6g}", "mm"] in rows


def test_what_failed_is_said(coarse: Result, tmp_path: Path) -> None:
    path = tmp_path / "failed.h5"
    path.write_bytes(coarse.path.read_bytes())
    with h5py.File(path, "r+") as file:
        file["converged"][4] = False
        file.attrs["title"] = "<b>1 & 2</b>"
    text = render_report(Result(path), Choices())
    assert "1 of 40 points did not converge" in _Page(text).text
    assert text.count('<tr class="failed">') == 1
    assert "<h1>&lt;b&gt;1 &amp; 2&lt;/b&gt;</h1>" in text
    with h5py.File(path, "r+") as file:
        file["converged"][...] = False
    write_report(Result(path), tmp_path / "failed.html")


def test_long_results_show_a_part(coarse: Result, tmp_path: Path,
                                  monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fretwear.report._MOST_ROWS", 10)
    monkeypatch.setattr("fretwear.report.fitting", lambda result: [])
    page = _page(render_report(coarse, Choices()))
    first = next(k for k, row in enumerate(page.rows) if row[:1] == ["point"]) + 1
    numbers = [int(row[0]) for row in page.rows[first:]]
    assert 10 <= len(numbers) <= 12
    assert {1, 40, coarse.peak() + 1} <= set(numbers)


def test_the_same_result_gives_the_same_page(coarse: Result, text: str) -> None:
    assert render_report(coarse, Choices()) == text


def test_command_line(coarse: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                      capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["report", str(coarse.path), "--linear", str(coarse.path)]) == 0
    assert Path("coarse.html").read_text().startswith("<!DOCTYPE html>")
    assert main(["report", str(coarse.path), "-o", "none/a.html"]) == 5
    assert "there is no folder" in capsys.readouterr().err


#: Where the response stands on the screen at a frequency.
_PLACE = """const p = [...Bokeh.documents[0]._all_models.values()].find(
  m => m.type == "Figure" && m.title.text.startsWith("response"))
const v = Bokeh.index.find_one_by_id(p.id), r = v.canvas_view.el.getBoundingClientRect()
return [r.left + v.frame.x_scale.compute(arguments[0]), r.top + v.frame.bbox.vcenter]"""
#: Point of the slider, data of the first loop, share of the first cell, all texts.
_SHOWN = """const all = [...Bokeh.documents[0]._all_models.values()]
const loop = all.find(m => m.type == "Figure" && m.title.text.startsWith("pairs"))
const map = all.find(m => m.type == "Figure" && m.title.text.includes("share"))
const data = f => f.renderers[0].data_source.data
return [all.find(m => m.type == "Slider").value, Array.from(data(loop).y),
        Array.from(data(map).share), loop.title.text,
        all.filter(m => m.type == "Div").map(m => m.text).join(" ")]"""


@pytest.mark.parametrize("groups", [
    {}, {"harmonics": {"sampling": "uniform", "n_time": 128}}, {"harmonics": {"accuracy": 1e-2}},
    {"sweep": {"continuation": "arclength"}}], ids=str)
def test_an_interactive_page_has_loops(groups: Any) -> None:
    """Of every converged point, where events are located as where contact is sampled."""
    pytest.importorskip("bokeh")
    from fretwear.explore.standing import _numbers

    case = fw.Case(RUBBING, contact={"law": "penalty"}, harmonics={"n_harmonics": 7},
                   sweep={"start": 0.6, "end": 1.6, "n_points": 9})
    result = fw.run(case.replace(**groups), in_memory=True)
    found, words = _numbers(result)
    assert not words and found["force"] is not None
    force = found["force"].reshape(result.n_points, -1, found["instants"])
    assert np.isfinite(force[result.converged]).all()
    cycle = result.cycle(result.peak())
    ratio = np.ptp(force[result.peak(), 0]) / np.ptp(cycle.force[:, 0, 0])
    assert ratio == pytest.approx(10.0 ** round(np.log10(ratio)), rel=1e-3)
    assert "No loops" not in render_report(result, Choices(), interactive=True)


def test_an_interactive_page_answers_without_a_server(tmp_path: Path, browser: Any) -> None:
    """A click shows the loops and the shares of that point; keys move it; nothing is asked for."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    result = fw.frf(RUBBING, 0.6, 1.6, 11, contact={"law": "penalty"}, output={"histories": True})
    write_report(result, tmp_path / "page.html", interactive=True)
    browser.get((tmp_path / "page.html").as_uri())
    first = wait_for(browser, _SHOWN, lambda found: found[0] == result.peak() + 1)
    browser.execute_script("window.scrollTo(0, 0)")
    x, y = browser.execute_script(_PLACE, float(result.frequency[7]))
    ActionChains(browser).move_by_offset(round(x), round(y)).click().perform()
    found = wait_for(browser, _SHOWN, lambda now: now[0] == 8 and now[1] != first[1])
    cycle = result.cycle(7)
    c = int(np.argmax(np.ptp(cycle.displacement[:, 0], axis=0)))
    drawn = np.linspace(0, len(cycle.force) - 1, 129).round().astype(int)
    ratio = np.array(found[1]) / cycle.force[drawn, 0, c]
    assert ratio == pytest.approx(np.full(129, 10.0 ** round(np.log10(ratio[0]))), rel=1e-5)
    assert found[2] == pytest.approx(result.fraction[7, :, 1].tolist(), abs=1e-6)
    assert f"at {result.frequency[7]:.6g} Hz" in found[3] and f"{result.amplitude[7, 0]:.5g}" in (
        found[4])
    handle = browser.execute_script("""return Bokeh.index.find_one_by_id([...Bokeh.documents[0]
      ._all_models.values()].find(m => m.type == "Slider").id).shadow_el
      .querySelector(".noUi-handle")""")
    handle.send_keys(Keys.ARROW_LEFT)
    wait_for(browser, _SHOWN, lambda now: now[0] == 7)
    asked = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    addresses = {one["params"]["request"]["url"] for one in asked
                 if one["method"] == "Network.requestWillBeSent"}
    assert all(address.startswith(("file:", "data:")) for address in addresses), addresses
    for width in (360, 800, 1600):
        browser.set_window_size(width, 900)
        assert browser.execute_script("return document.documentElement.scrollWidth <= "
                                      "window.innerWidth")
