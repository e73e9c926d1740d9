"""What each piece of work that a case does not need would cost, and the test that leaving it out
changes no answer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.common.layout import milliseconds, table
from bench.common.measure import Bench, Groups, Run, write_namelist
from bench.common.programs import run_program
from bench.common.sector import PAIRS, case, near_peak
from bench.peers.sector_and_chain import chain, namelist
from bench.speed.limit import downwards

__all__ = ["Saving", "Spared", "measure_skips", "write_skips"]

#: Points of cheap sweeps, so that what is done once is little beside them.
MANY = 401
#: What stands against `accuracy`: as many harmonics as it may use, at every point.
FIXED = {"n_harmonics": 53, "n_time": 1024}


@dataclass(frozen=True)
class Saving:
    """Time of a run with and without a skip [s], and the test of its equality."""

    skip: str
    example: str
    on: float
    off: float
    test: str


@dataclass(frozen=True)
class Spared:
    """How often something was done in a sweep, how often it would be without its reuse."""

    what: str
    example: str
    done: int
    without: int
    test: str


def measure_skips(bench: Bench, floor: Path) -> tuple[list[Saving], list[Spared]]:
    """Every skip that can be switched, in time; every reuse, in counts."""
    sector = case(16, 3, near_peak(16) | {"n_points": 11 if bench.quick else MANY})
    rows = [compare(bench, "stuck and closed pairs leave the linear problems, preconditioners are "
                    "kept", f"{pairs} pairs, H = {n}", groups,
                    changed(groups, "solver", skips=False),
                    "test_sector_equivalence.py::test_same_answer, test_newton.pf::test_skips")
            for pairs, n, groups in ((16, 3, sector), (48, 7, case(48, 7, downwards(48))))]
    stuck = sector | {"contact": {"mu": 100.0, "gap": -0.01}}
    friction, small = namelist(chain(48, 17)), namelist(chain(8, 3))
    small_load = changed(sector, "load", harmonic_scale=0.02)
    rows += [
        compare(bench, "second tangential direction", "chain of 48 masses, H = 17",
                lateral(friction, in_both=False), lateral(friction, in_both=True),
                "test_invariants.py::test_second_direction_that_nothing_moves"),
        compare(bench, "even harmonics where the symmetry is exact", "chain of 48 masses, H = 17",
                changed(friction, "harmonics", parity="auto"),
                changed(friction, "harmonics", parity="all"),
                "test_invariants.py::test_parity_auto_is_all, test_newton.pf::test_odd_is_all"),
        compare(bench, "harmonics and instants not needed (`accuracy = 1e-3`)",
                "one mass with friction", oscillator({"accuracy": 1e-3}), oscillator(FIXED),
                "test_accuracy_of_sweeps.py::test_accuracy_along_a_sweep"),
        *(compare(bench, what, "16 pairs, H = 3", changed(sector, group, **{key: False}),
                  changed(sector, group, **{key: True}),
                  "test_sector_equivalence.py::test_what_is_not_asked_for_changes_nothing")
          for what, group, key in (("recovery of the contact quantities", "output", "contact"),
                                   ("histories", "output", "histories"))),
        compare(bench, "stability", "chain of 8 masses, H = 3", small,
                changed(small, "sweep", stability=True),
                "test_invariants.py::test_stability_changes_no_answer")]
    return rows, [
        linear_points(bench, "16 pairs, mu = 100", stuck,
                      "test_sector_equivalence.py::test_stuck_sector_is_linear_algebra"),
        linear_points(bench, "16 pairs, 0.02 N", small_load,
                      "test_sector_equivalence.py::test_a_sweep_that_is_linear_in_part"),
        *(row for pairs in PAIRS for row in count(bench, floor, pairs, 7))]


def linear_points(bench: Bench, example: str, groups: Groups, test: str) -> Spared:
    """Newton steps of a sweep whose joint stays stuck, at some points or at all: none there."""
    run = bench.run(groups)
    steps, without = int(run.iterations.sum()), int((run.iterations == 0).sum())
    return Spared("linear problems: none where the joint stays stuck", example, steps,
                  steps + without, test)


def compare(bench: Bench, skip: str, example: str, on: Groups, off: Groups, test: str) -> Saving:
    """Both runs, one after the other, each without the reading of its input."""
    return Saving(skip, example, bench.repeat(on, elapsed)[0], bench.repeat(off, elapsed)[0], test)


def elapsed(run: Run) -> float:
    """Time of a run without the reading of its input [s]."""
    return run.elapsed


def changed(groups: Groups, group: str, **keys: object) -> Groups:
    """Groups with some keys of one group set."""
    return groups | {group: groups.get(group, {}) | keys}


def lateral(groups: Groups, in_both: bool) -> Groups:
    """Masses that may move across the chain as well; whether the contact feels it.

    Without skips, which would leave out a direction that nothing moves.
    """
    model = groups["model"]
    n = int(str(model["n_dof"]))
    doubled = {key: np.kron(np.eye(2), np.reshape(model[key], (n, n))).ravel().tolist()
               for key in ("mass", "stiffness", "damping")}
    sides = [j for i in range(1, n + 1) for j in (i, n + i if in_both else 0, 0)]
    cosine = [*groups["load"]["cosine"], *n * [0.0]]  # type: ignore[misc]
    return (changed(groups, "contact", side_1=sides)
            | {"model": {"n_dof": 2 * n} | doubled, "load": {"cosine": cosine},
               "solver": groups["solver"] | {"skips": False}})


def oscillator(harmonics: dict[str, object]) -> Groups:
    """A mass with elastic friction, through its superharmonic and main resonances."""
    return {"case": {"analysis": "frf"},
            "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.04},
            "contact": {"n_pairs": 1, "law": "penalty", "tangential_stiffness": 1.0,
                        "side_1": [1, 0, 0], "mu": 1.0, "normal_load": 0.5},
            "load": {"cosine": 1.0}, "harmonics": harmonics,
            "sweep": {"start": 0.3, "end": 1.6, "n_points": 27}}


def count(bench: Bench, floor: Path, pairs: int, n_harmonics: int) -> list[Spared]:
    """What a sweep does once and uses often."""
    path = bench.folder / "skips.nml"
    write_namelist(path, case(pairs, n_harmonics, downwards(pairs)))
    calls = {row["part"]: int(row["calls"]) for row in run_program(floor, path)}
    residuals, steps = calls["residual"], calls["derivative of the forces"]
    example = f"{pairs} pairs, H = {n_harmonics}"
    return [
        Spared("condensations: one a frequency, not one a residual", example,
               calls["condensation"], residuals, "test_condensation.pf::test_update_twice"),
        Spared("derivatives: one a step, not one a residual", example, steps, residuals,
               "test_jacobian.pf"),
        Spared("preconditioners: kept while they serve, not one a step", example,
               calls["preconditioner: build"], steps,
               "test_work.py::test_kept_preconditioners_change_no_answer")]


def write_skips(savings: list[Saving], spared: list[Spared]) -> str:
    """The section of the document."""
    times = [(row.skip, row.example, milliseconds(row.on), milliseconds(row.off),
              f"{row.off / row.on:.2f}", named(row.test)) for row in savings]
    counts = [(row.what, row.example, row.done, row.without,
               f"{row.without / row.done:.1f}" if row.done else "-", named(row.test))
              for row in spared]
    return "\n".join([
        "## What is skipped", "",
        "Time of whole runs, without the reading of their input, with and without the work that "
        "each skip leaves out, and the tests that the answer is the same. The `skipped` lines of "
        "the summary and the attribute "
        "`skipped` of the result file say what a run left out; what is made only when asked for is "
        "in the result file or not.", "",
        *table(["left out", "case", "with the skip [ms]", "without [ms]", "ratio", "tests"], times),
        "", "What is made once and used often, in counts of a sweep of the sector:", "",
        *table(["kept", "case", "made", "without", "ratio", "tests"], counts)])


def named(tests: str) -> str:
    """Names of tests in the type of code."""
    return ", ".join(f"`{test}`" for test in tests.split(", "))
