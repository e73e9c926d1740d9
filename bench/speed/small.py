"""What a whole run of a small case takes: the first case of the README."""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass

from bench.common.layout import table
from bench.common.measure import Bench, Groups

__all__ = ["SmallCase", "measure_small", "write_small"]

FIRST: Groups = {
    "case": {"analysis": "frf", "title": "A mass that rubs"},
    "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.04},
    "contact": {"n_pairs": 1, "law": "penalty", "tangential_stiffness": 1.0,
                "side_1": [1, 0, 0], "mu": 1.0, "normal_load": 0.5},
    "load": {"cosine": 1.0},
    "harmonics": {"n_harmonics": 15},
    "sweep": {"start": 0.6, "end": 1.6, "n_points": 101},
    "output": {"observe": 1},
}
#: Name, keys of `harmonics` and the processor time that is wanted [s].
WAYS = (("events", {"sampling": "events"}, 0.010),
        ("1,024 instants", {"sampling": "uniform", "n_time": 1024}, 0.020))
RUNS = 40


@dataclass(frozen=True)
class SmallCase:
    """Processor time of a whole run [s], median and fastest; `before` is another program's."""

    name: str
    wanted: float
    median: float
    fastest: float
    before: float = math.nan


def measure_small(bench: Bench, other: Bench | None = None) -> list[SmallCase]:
    """Runs of this program and of the other one by turns, each into a new file."""
    rows = []
    for name, keys, wanted in WAYS:
        times: list[list[float]] = [[], []]
        for _ in range(2 if bench.quick else RUNS):
            for program, mine in zip((bench, other), times):
                if program:
                    mine.append(run_once(program, keys))
        rows.append(SmallCase(name, wanted, statistics.median(times[0]), min(times[0]),
                              statistics.median(times[1]) if other else math.nan))
    return rows


def run_once(bench: Bench, keys: dict[str, object]) -> float:
    """Processor time [s] of a run from its start to its end."""
    result = bench.folder / "small.h5"
    result.unlink(missing_ok=True)
    return bench.execute(FIRST | {"harmonics": FIRST["harmonics"] | keys}, result)[1]


def write_small(rows: list[SmallCase]) -> list[str]:
    """The section of the document."""
    return ["### A small case", "",
            "The first case of the README, 101 frequencies of one dof and one pair: processor time "
            f"of the whole program from its start to its end, {RUNS} runs by turns, each into a "
            "new file.", "",
            *table(("friction by", "median [ms]", "fastest [ms]", "before, median [ms]", "target"),
                   ((r.name, f"{1e3 * r.median:.1f}", f"{1e3 * r.fastest:.1f}",
                     "" if math.isnan(r.before) else f"{1e3 * r.before:.1f}",
                     f"{1e3 * r.wanted:g}: {'met' if r.median <= r.wanted else 'missed'}")
                    for r in rows)), ""]
