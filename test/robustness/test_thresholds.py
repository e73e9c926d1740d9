"""The records of limits: each limit is read somewhere, and what changes it is understood."""
import re

import pytest
from project import ROOT
from thresholds import FACTORS, FAMILIES, RECORDS, Counter, Limit, cell, limits, written


@pytest.mark.parametrize("record", RECORDS)
def test_every_limit_is_read(record):
    source, constant, _ = RECORDS[record]
    module = re.search(r"^module (\w+)", (ROOT / source).read_text(), re.MULTILINE)[1]
    read = set()
    for path in (ROOT / "src").rglob("*.f90"):
        text = re.sub(r"!.*", "", path.read_text())
        if f"use {module}," in text:
            read |= set(re.findall(rf"\b{constant}%(\w+)", text))
    assert read == {limit.name for limit in limits(record)}


def test_a_limit_is_halved_and_doubled():
    assert [Limit("x", "a", "real", 0.2).changed(factor) for factor in FACTORS] == [0.1, 0.4]
    # A part near 1 by what it leaves.
    assert Limit("x", "a", "real", 0.9).changed(2.0) == pytest.approx(0.8)
    assert Limit("x", "a", "integer", 5).changed(0.5) == 2
    assert Limit("x", "max_turn", "real", 0.9).changed(2.0) == 1.8


class Numbers:
    """A family of numbers that are wrong above a limit of 3."""

    NAMES = ()

    def case(self, seed, setting, _folder):
        limit = float(setting.partition("=")[2] or 3.0)
        return 0, {"iterations": int(limit), "answer": min(seed, limit)}, {}

    def wrong(self, seed, found, _folder):
        return int(found[1]["answer"] < min(seed, 3.0))


def test_counts(monkeypatch, tmp_path):
    monkeypatch.setitem(FAMILIES, "peak", lambda _program: Numbers())
    counter = Counter("peak", None, 7, tmp_path / "state")
    counter.start(tmp_path)
    limit = Limit("peak", "three", "real", 3.0)
    half, double = (counter.count(limit, factor, tmp_path) for factor in FACTORS)
    assert half["noticed"] == double["noticed"] == 7
    assert (half["more"], half["fewer"], double["more"]) == (5, 0, 0)
    assert cell(half) == "7 | +5 -0 | -66.7 %" and cell(double) == "7 | 0 | +100.0 %"
    assert cell(None).startswith("no other")
    page = written("# Title\n", "peak", ["one"])
    assert written(page, "peak", ["two"]) == page.replace("one", "two")
