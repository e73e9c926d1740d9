"""The logic of the benchmarks: the document, errors against references, figures of tables."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

BENCH = Path(__file__).resolve().parents[2] / "bench"
MACHINE = {"processor": "P", "compiler": "C", "flags": "-O3", "commit": "abc", "date": "today"}


@pytest.fixture(autouse=True)
def bench_on_path() -> Iterator[None]:
    """The scripts import each other by name."""
    sys.path.insert(0, str(BENCH))
    yield
    sys.path.remove(str(BENCH))


def test_a_part_replaces_itself_and_nothing_else(tmp_path: Path) -> None:
    from document import update_document

    path = tmp_path / "benchmarks.md"
    update_document(path, "time", "## Time\n\nold", MACHINE)
    update_document(path, "speed", "## Speed\n\nkept", MACHINE)
    update_document(path, "time", "## Time\n\nnew", MACHINE | {"commit": "def"})
    text = path.read_text(encoding="utf-8")
    assert "old" not in text
    assert text.index("kept") < text.index("new")
    assert text.count("## Time") == text.count("## Speed") == 1
    assert "commit abc" in text and "commit def" in text


def test_update_is_stable(tmp_path: Path) -> None:
    from document import update_document

    path = tmp_path / "benchmarks.md"
    update_document(path, "paper", "## Methods\n\n| a |\n| --- |\n| 1 |", MACHINE)
    first = path.read_text(encoding="utf-8")
    update_document(path, "paper", "## Methods\n\n| a |\n| --- |\n| 1 |", MACHINE)
    assert path.read_text(encoding="utf-8") == first


def test_error_is_relative_to_the_reference() -> None:
    from oscillators import relative_error

    reference = np.array([1.0, 2.0, 0.0])
    # Mean square: 1 + 2 = 3 of the reference, 0.5 of the difference in the cosine.
    assert relative_error(np.array([1.0, 1.0, 0.0]), reference) == pytest.approx(
        math.sqrt(0.5 / 3.0))
    # Harmonics that are not carried count as zero, those above the reference do not count.
    assert relative_error(np.array([1.0]), reference) == pytest.approx(math.sqrt(2.0 / 3.0))
    assert relative_error(np.append(reference, [9.0, 9.0]), reference) == pytest.approx(0.0)


def row(number: int, converged: int, coefficients: str, message: str = "") -> dict[str, str]:
    """A line of bench/starts.f90."""
    return {"omega": "1.300000000000001E+00", "start": str(number), "converged": str(converged),
            "iterations": str(10 * number), "seconds": "1.0E-3", "residual": "1.0E-9",
            "message": message, "coefficients": coefficients}


def test_a_start_is_compared_with_the_nearest_solution() -> None:
    from solvers import Problem, read_start

    problem = Problem("p", {}, {}, {1.3: [np.array([0.0, 1.0, 0.0]), np.array([0.0, 3.0, 0.0])]})
    assert read_start(row(1, 1, "0.0 3.3 0.0"), problem).error == pytest.approx(0.1)
    assert math.isnan(read_start(row(1, 1, "0.0 3.3 0.0"), Problem("p", {}, {})).error)


def test_figures_of_a_table_row() -> None:
    from solvers import SOLVERS, Outcome, Problem, read_start, summarize

    problem = Problem("p", {}, {}, {1.3: [np.array([0.0, 1.0, 0.0])]})
    lines = [row(1, 1, "0.0 1.0 0.0"), row(2, 1, "0.0 1.2 0.0"),
             row(3, 0, "0.0 9.0 0.0", "steps run out: 499 taken, 1 refused"),
             row(4, 0, "0.0 9.0 0.0", "steps run out: 500 taken, 0 refused"),
             row(5, 0, "0.0 9.0 0.0", "iterations run out")]
    summary = summarize(Outcome("p", SOLVERS[0], [read_start(line, problem) for line in lines]))
    assert (summary.converged, summary.total) == (2, 5)
    assert summary.iterations == pytest.approx(15.0)
    assert summary.error == pytest.approx(0.2)
    assert summary.failures == [("steps run out", 2), ("iterations run out", 1)]


def test_every_combination_once() -> None:
    from solvers import SOLVERS

    assert len({solver.name for solver in SOLVERS}) == len(SOLVERS) == 3 + 3 * 4


def test_peak_ignores_points_that_failed() -> None:
    from integration import find_peak
    from measure import Run

    omega = 2.0 * np.pi * np.array([10.0, 11.0, 12.0])
    amplitude = np.array([[1.0], [9.0], [2.0]])
    ones = np.ones(3)
    run = Run(omega, ones, np.ones(3, dtype=np.int64), np.array([True, False, True]),
              np.zeros(3, dtype=bool), np.zeros((3, 1, 1)), amplitude, ones, 1.0, 1, 1)
    assert find_peak(run) == pytest.approx(12.0)


@pytest.mark.parametrize(("at_7", "word"), [(1.03, "truncation"), (1.0005, "within twice")])
def test_the_difference_is_attributed(at_7: float, word: str) -> None:
    from integration import INSTANTS, MANY_INSTANTS, Comparison, verdict
    from measure import Run

    def integrated(amplitude: float) -> Run:
        one = np.ones(1)
        return Run(one, one, np.ones(1, dtype=np.int64), np.array([True]), np.array([False]),
                   np.zeros((1, 1, 1)), np.array([[amplitude]]), one, 1.0, 1, 1)

    comparison = Comparison("2500", 1011.5, {(7, INSTANTS, 1.0): at_7,
                                             (7, MANY_INSTANTS, 1.0): at_7 + 1e-4},
                            {1000: integrated(0.999), 2000: integrated(1.0)})
    assert word in verdict(comparison)
    assert comparison.difference(7) == pytest.approx(at_7 - 1.0)
    assert math.isnan(comparison.difference(15))
