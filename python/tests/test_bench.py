"""The logic of the benchmarks: the document, errors against references, figures of tables."""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCH = Path(__file__).resolve().parents[2] / "bench"
MACHINE = {"processor": "P", "compiler": "C", "flags": "-O3", "commit": "abc", "date": "today"}


def test_a_part_replaces_itself_and_nothing_else(tmp_path: Path) -> None:
    from bench.common.document import update_document

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
    from bench.common.document import update_document

    path = tmp_path / "benchmarks.md"
    update_document(path, "paper", "## Methods\n\n| a |\n| --- |\n| 1 |", MACHINE)
    first = path.read_text(encoding="utf-8")
    update_document(path, "paper", "## Methods\n\n| a |\n| --- |\n| 1 |", MACHINE)
    assert path.read_text(encoding="utf-8") == first


def test_a_measurement_replaces_its_page_and_the_first_one(tmp_path: Path) -> None:
    from bench.common.pages import update_page

    update_page(tmp_path, "time", "## Time\n\nold, see [speed](#whole)", MACHINE)
    update_page(tmp_path, "speed", "## Speed\n\n### Whole\n\n| 1 | < 5 s: met |", MACHINE)
    update_page(tmp_path, "time", "## Time\n\nnew, see [speed](#whole)\n\n![p](images/p.png)",
                MACHINE | {"commit": "def"})
    page = (tmp_path / "benchmarks" / "time.md").read_text(encoding="utf-8")
    first = (tmp_path / "benchmarks.md").read_text(encoding="utf-8")
    assert page.startswith("# Time\n") and "old" not in page and "commit def" in page
    assert "](speed.md#whole)" in page and "](../images/p.png)" in page
    assert "## Whole" in (tmp_path / "benchmarks" / "speed.md").read_text(encoding="utf-8")
    assert "| [Whole](benchmarks/speed.md#whole) | 1 | 0 |  |" in first
    assert "[Speed](benchmarks/speed.md)" in first


def test_the_first_page_finds_its_answers_and_is_that_of_the_pages(tmp_path: Path) -> None:
    from bench.common.headlines import HEADLINES, rows
    from bench.common.layout import unwrapped
    from bench.common.pages import read_pages, write_overview

    docs = BENCH.parent / "docs"
    pages = {part: unwrapped(text) for part, text in read_pages(docs / "benchmarks").items()}
    found = rows(pages)
    assert len(found) == len(HEADLINES)
    assert all(answer != "-" and "{" not in answer + target for _, answer, target in found)
    shutil.copytree(docs / "benchmarks", tmp_path / "benchmarks")
    shutil.copytree(docs / "images", tmp_path / "images")
    write_overview(tmp_path)
    assert (tmp_path / "benchmarks.md").read_text() == (docs / "benchmarks.md").read_text()


def test_prose_is_wrapped_and_tables_are_not() -> None:
    from bench.common.layout import unwrapped, wrapped

    text = "# " + "h " * 90 + "\n\n" + "word " * 60 + "end\n\n| " + "cell " * 60 + "|"
    lines = wrapped(text).split("\n")
    assert [len(line) > 120 for line in lines].count(True) == 2
    assert unwrapped(wrapped(text)) == text


def test_error_is_relative_to_the_reference() -> None:
    from bench.common.oscillators import relative_error

    reference = np.array([1.0, 2.0, 0.0])
    # Mean square: 1 + 2 = 3 of the reference, 0.5 of the difference in the cosine.
    assert relative_error(np.array([1.0, 1.0, 0.0]), reference) == pytest.approx(
        math.sqrt(0.5 / 3.0))
    # Harmonics that are not carried count as zero, those above the reference do not count.
    assert relative_error(np.array([1.0]), reference) == pytest.approx(math.sqrt(2.0 / 3.0))
    assert relative_error(np.append(reference, [9.0, 9.0]), reference) == pytest.approx(0.0)


def row(number: int, converged: int, coefficients: str, message: str = "") -> dict[str, str]:
    """A line of bench/solvers/starts.f90."""
    return {"omega": "1.300000000000001E+00", "start": str(number), "converged": str(converged),
            "iterations": str(10 * number), "seconds": "1.0E-3", "residual": "1.0E-9",
            "message": message, "coefficients": coefficients}


def test_a_start_is_compared_with_the_nearest_solution() -> None:
    from bench.solvers.many_starts import Problem, read_start

    problem = Problem("p", {}, {}, {1.3: [np.array([0.0, 1.0, 0.0]), np.array([0.0, 3.0, 0.0])]})
    assert read_start(row(1, 1, "0.0 3.3 0.0"), problem).error == pytest.approx(0.1)
    assert math.isnan(read_start(row(1, 1, "0.0 3.3 0.0"), Problem("p", {}, {})).error)


def test_figures_of_a_table_row() -> None:
    from bench.solvers.many_starts import SOLVERS, Outcome, Problem, read_start, summarize

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
    from bench.solvers.many_starts import SOLVERS

    assert len({solver.name for solver in SOLVERS}) == len(SOLVERS) == 3 + 3 * 4


def test_peak_ignores_points_that_failed() -> None:
    from bench.common.measure import Run
    from bench.precision.integration import find_peak

    omega = 2.0 * np.pi * np.array([10.0, 11.0, 12.0])
    amplitude = np.array([[1.0], [9.0], [2.0]])
    ones = np.ones(3)
    run = Run(omega, ones, np.ones(3, dtype=np.int64), np.array([True, False, True]),
              np.zeros(3, dtype=bool), np.zeros((3, 1, 1)), amplitude, ones, 1.0, 1, 1, ones, ones,
              ones)
    assert find_peak(run) == pytest.approx(12.0)


@pytest.mark.parametrize(("at_7", "word"), [(1.03, "truncation"), (1.0005, "within twice")])
def test_the_difference_is_attributed(at_7: float, word: str) -> None:
    from bench.common.measure import Run
    from bench.precision.integration import INSTANTS, MANY_INSTANTS, Comparison, verdict

    def integrated(amplitude: float) -> Run:
        one = np.ones(1)
        return Run(one, one, np.ones(1, dtype=np.int64), np.array([True]), np.array([False]),
                   np.zeros((1, 1, 1)), np.array([[amplitude]]), one, 1.0, 1, 1, one, one, one)

    comparison = Comparison("2500", 1011.5, {(7, INSTANTS, 1.0): at_7,
                                             (7, MANY_INSTANTS, 1.0): at_7 + 1e-4},
                            {1000: integrated(0.999), 2000: integrated(1.0)})
    assert word in verdict(comparison)
    assert comparison.difference(7) == pytest.approx(at_7 - 1.0)
    assert math.isnan(comparison.difference(15))


def measured(pairs: int, n_harmonics: int, seconds: float, memory: float = 100.0) -> Any:
    """A size of the scaling."""
    from bench.speed.scaling import Measured

    unknowns = 3 * pairs * (2 * n_harmonics + 1)
    return Measured(pairs, n_harmonics, seconds, 0.1, memory, unknowns, unknowns, 4.0, 40.0, 9, 9,
                    1020.0, 0.9)


@pytest.mark.parametrize(("power", "word"), [(1.9, "met"), (2.3, "missed by 0.30")])
def test_exponents_judge_the_targets(power: float, word: str) -> None:
    from bench.speed.scaling_report import exponents

    rows = [measured(pairs, n, pairs**power * n) for pairs in (16, 48, 768) for n in (1, 31)]
    lines = exponents(rows)
    over_pairs = [line for line in lines if line.endswith(f"2: {word} |")]
    over_harmonics = [line for line in lines if line.endswith("1: met |")]
    assert len(over_pairs) == 2 and len(over_harmonics) == 3
    assert all(f"| {power:.2f} |" in line for line in over_pairs)


def test_memory_tells_whether_there_is_a_matrix_of_the_order_of_the_unknowns() -> None:
    from bench.speed.scaling_report import largest_matrix

    small, large = measured(16, 3, 1.0), measured(96, 31, 1.0)
    assert small.full_matrix == pytest.approx(8e-6 * 336**2)
    assert largest_matrix([small]) == []
    assert "There is no matrix" in largest_matrix([small, large])[0]
    assert "does not rule out" in largest_matrix([measured(96, 31, 1.0, 1e4)])[0]


def test_peak_memory_of_a_program_is_its_own() -> None:
    from bench.common.measure import watch_memory

    ballast = np.ones(30_000_000)
    sleep = Path(shutil.which("sleep") or "").resolve()
    with watch_memory(sleep) as peak:
        subprocess.run([sleep, "0.3"], check=True)
    assert 0.1 < peak[0] < 20.0 < ballast.nbytes / 1e6


def test_a_peer_that_did_not_end_has_no_ratio() -> None:
    from bench.peers.sector_and_chain import PeerCase, row_of

    done = PeerCase("chain", 3, 256, 0.001, 0.1, 3.0, 4.0, 1e-12, 30.0, 0.012)
    assert row_of(done) == ("chain", 3, "1", "100", "100", "30: met", "3.0", "4.0", "1e-12", "12")
    cut = PeerCase("chain", 3, 256, 0.001, math.nan, 3.0, math.nan, math.nan, 30.0, None)
    row = row_of(cut)
    assert "limit" in str(row[3]) and "not known" in str(row[5]) and len(row) == len(row_of(done))


def test_branches_of_the_peer_read_as_cases() -> None:
    from bench.peers.branches import BRANCHES, BranchRow, chain, write_branches

    assert chain(2, [0.0, 1.0, 1.0], 0.03)["stiffness"] == [1.0, -1.0, -1.0, 2.0]
    text = write_branches([BranchRow(BRANCHES[0], "chosen", 81, 0.02, True, 113, 0.025)])
    assert "| Duffing | chosen | 192 | 1.618 | 81 | 113 | 20 | 25 | yes |" in text


def test_scaling_asks_for_the_coarse_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bench.common import sector
    from bench.speed.scaling import COARSE
    from bench.speed.scaling_report import coarse_options

    asked: list[list[str]] = []
    monkeypatch.setattr(sector.subprocess, "run", lambda command, **_: asked.append(command))
    path = sector.sector_file(48, tmp_path, COARSE)
    assert path == tmp_path / "sector_48_coarse.h5"
    assert [option.replace("=", " ") for option in map(str, asked[0]) if "=" in option] == [
        f"--{option.strip()}" for option in coarse_options().split("--")[1:]]
    # What is there already is not generated again, and an example serves where nothing is coarse.
    path.touch()
    assert sector.sector_file(48, tmp_path, COARSE) == path
    assert sector.sector_file(48, tmp_path).parent.name == "blade_sector"
    assert len(asked) == 1


def test_the_floor_is_judged_without_what_runs_before_a_sweep() -> None:
    from bench.speed.limit import CONSTRUCTION, Part, floor_part

    parts = [Part("residual", 9, 1.2, 1.0), Part(CONSTRUCTION, 1, 9.0, 0.0)]
    assert "met everywhere" in floor_part({(16, 3): parts})
    slow = [Part("residual", 9, 3.0, 1.0), *parts[1:]]
    assert "missed in 1 of 2 cases, 3.00 times at worst" in floor_part({(16, 3): parts,
                                                                        (48, 3): slow})


def test_skips_name_tests_that_exist() -> None:
    import re

    text = (BENCH / "speed" / "skips.py").read_text(encoding="utf-8")
    named = re.findall(r"(test_\w+\.(?:py|pf))(?:::(test_\w+))?", text)
    assert len(named) > 9
    for module, name in named:
        (path,) = (BENCH.parent / "test").rglob(module)
        assert not name or name in path.read_text(encoding="utf-8"), (module, name)


def test_a_saving_is_the_time_without_over_that_with() -> None:
    from bench.speed.skips import Saving, Spared, write_skips

    text = write_skips([Saving("a skip", "a case", 0.1, 0.25, "test_a.py::b, test_c.pf")],
                       [Spared("a thing", "a case", 2, 64, "test_d.pf")])
    assert "| a skip | a case | 100 | 250 | 2.50 | `test_a.py::b`, `test_c.pf` |" in text
    assert "| a thing | a case | 2 | 64 | 32.0 | `test_d.pf` |" in text


def test_targets_are_collected_from_the_parts() -> None:
    from bench.common.document import targets

    parts = ["## One\n\nTarget: at most 1.5; missed in 2 of 3 cases, 2.25 times at worst. More.",
             "## Two\n\n### A, B and C\n\n| 16 | 2: met |\n| 48 | 2: missed by 0.5 |\n"
             "| 96 | 2: missed by 1.25 |\n\n### None\n\nIt is met by nobody."]
    lines = targets(parts)
    assert lines[-2] == "| [One](#one) | 0 | 1 | in 2 of 3 cases, 2.25 times at worst |"
    assert lines[-1] == "| [A, B and C](#a-b-and-c) | 1 | 2 | by 1.25 |"


def test_kernels_are_compared_by_the_step_where_their_paths_differ() -> None:
    from bench.speed.kernels import row_of

    assert row_of("same", [1.2, 1.0], [5, 5]) == ("same", "1.20", "1.00", "1e+03", "1.20: met")
    assert row_of("path", [1.5, 1.0], [6, 5]) == ("path", "1.50 (6)", "1.00 (5)", "1e+03",
                                                  "1.25: met")
    assert row_of("slow", [1.5, 1.0], [5, 5])[-1] == "1.50: missed"


def worn(scheme: str, error: float, cpu: float) -> Any:
    from bench.precision.worn import WearPoint

    return WearPoint(scheme, "", 1, 1, error, cpu)


def test_times_at_an_error_lie_on_the_frontier_of_a_scheme() -> None:
    from bench.precision.worn import time_at

    # A power law between points; one that another beats in error and time is left out, and one
    # without a steady state too.
    points = [worn("a", 1e-2, 1.0), worn("a", 1e-4, 4.0), worn("a", 5e-3, 3.9),
              worn("a", math.nan, math.nan), worn("a", 2e-2, 2.0)]
    steep = math.log(1e-2 / 5e-3) / math.log(1e-2 / 1e-3)
    assert time_at(5e-3, points) == pytest.approx(3.9)
    assert time_at(1e-3, points[:2]) == pytest.approx(2.0)
    assert time_at(5e-3, points[:2]) == pytest.approx(2.0**steep)
    assert time_at(1e-2, points) == pytest.approx(1.0)
    # The fastest run may be more accurate than it has to be.
    assert time_at(1.5e-2, points) == pytest.approx(1.0)
    assert math.isnan(time_at(1e-5, points)) and math.isnan(time_at(1e-2, []))


def test_wear_at_equal_error_is_judged() -> None:
    from bench.precision.worn import times_at_equal_error

    points = [worn(name, error, cpu * at) for name, cpu in (
        ("implicit, order 1", 1.0), ("implicit, order 2", 0.5), ("pseudo-time, order 1", 0.28),
        ("pseudo-time, Rosenbrock", 0.25)) for error, at in ((1e-2, 1.0), (1e-4, 4.0))]
    text = "\n".join(times_at_equal_error(points))
    assert text.count("| 0.28: met | 0.56 |") == 3
    assert text.count("| 0.25: missed | 0.50 |") == 3 and "pseudo-time, Rosenbrock, 0.50" in text
    assert times_at_equal_error(points[:2])[-1].count(" - |") >= 3


def test_two_workers_are_judged_by_medians_and_their_rows() -> None:
    from bench.speed.workers import Turns, waiting

    turns = Turns("sweep", [2.0, 1.9, 3.0], [1.0, 1.1, 0.9], 2e-6)
    assert turns.row == ("sweep", "2.00 (1.90)", "1.00 (0.90)", "2.00: met", "2.11", "2e-06")
    slow = Turns("sweep", [1.7], [1.0], 1e-3)
    assert slow.row[3] == "1.70: missed" and slow.row[-1] == "1e-03, NOT the same"
    # The second worker begins one second later, and has nothing to do for half a second.
    assert waiting([(0.0, 4.0), (1.0, 2.0), (2.5, 4.0)]) == pytest.approx(1.5)


def test_pictures_are_drawn_from_what_the_pages_say(tmp_path: Path) -> None:
    """What is read from the tables gives their rows again, and pictures without a measurement."""
    from bench.common.layout import milliseconds
    from bench.precision import events, report
    from bench.redraw import PARTS, read_limits, read_points, read_precision, redraw

    docs = BENCH.parent / "docs"
    page = (docs / "benchmarks" / "precision.md").read_text(encoding="utf-8")
    data = read_precision(docs / "benchmarks" / "precision.md")
    names = dict.fromkeys(sample.case for sample in data.samples)
    lines = [line for name in names for line in report.case_part(data.samples, name) if "|" in line]
    assert len(lines) > 80 and all(line in page for line in lines)
    page = (docs / "benchmarks" / "events.md").read_text(encoding="utf-8")
    limits = read_limits(docs / "benchmarks" / "events.md")
    assert len(limits) > 80 and all(events.cell(limit) in page for limit in limits)
    page = (docs / "benchmarks" / "speed.md").read_text(encoding="utf-8")
    points = read_points(docs / "benchmarks" / "speed.md")
    for krylov, lu in zip(points[::2], points[1::2]):
        dense = "not run" if math.isnan(lu.seconds) else milliseconds(lu.seconds)
        assert f"| {milliseconds(krylov.seconds)} | {dense} |" in page
    redraw(list(PARTS), docs, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "benchmark_errors.png", "benchmark_errors_sector.png", "benchmark_events.png",
        "benchmark_points.png"}
