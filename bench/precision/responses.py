"""Error against run time: methods, samplings and laws with H and n_time given, and with an accuracy
asked for, on oscillators whose responses are known and on the sector against a converged solution.

The references (test/reference) were computed without harmonic balance: event by event, in closed
form, or by shooting. The error is the relative L2 error of the first observed quantity's Fourier
coefficients up to the highest harmonic of the reference; harmonics that a solution does not carry
count as zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.common.measure import Bench, Floats, Groups, Run
from bench.common.oscillators import Case, load_cases, relative_error
from bench.common.sector import case as sector_case
from bench.common.sector import near_peak

__all__ = ["ACCURACIES", "HARMONICS", "INSTANTS", "SECTOR", "SETTINGS", "Kept", "Precision",
           "Sample", "measure_precision"]

HARMONICS = (1, 3, 7, 15, 31)
INSTANTS = (64, 256, 1024, 4096)
ACCURACIES = (1e-2, 1e-3, 1e-4)
SECTOR = "sector, 16 pairs"
SECTOR_PAIRS = 16
#: The most instants that are compared with the converged solution of the sector, and what that has.
LARGEST_SECTOR_INSTANTS = 1024
CONVERGED = {"n_harmonics": 63, "n_time": 0}
#: Ways to solve, by their names; n_time is automatic where it is not given.
SETTINGS: dict[str, dict[str, object]] = {
    "HBM, automatic n_time": {"method": "hbm", "sampling": "uniform"},
    **{f"HBM, n_time = {n}": {"method": "hbm", "sampling": "uniform", "n_time": n}
       for n in INSTANTS},
    "HBM, events": {"method": "hbm", "sampling": "events"},
    "TCM, automatic n_time": {"method": "tcm", "sampling": "uniform"},
    "TCM, events": {"method": "tcm", "sampling": "events"},
    "HDHB": {"method": "hdhb"},
}


@dataclass(frozen=True)
class Sample:
    """One solution: error and time of a point [s]; seconds is NaN where it did not converge."""

    case: str
    setting: str
    n_harmonics: int
    error: float
    seconds: float


@dataclass(frozen=True)
class Kept:
    """A solution with an accuracy asked for: what was chosen, claimed, and is true."""

    case: str
    accuracy: float
    n_harmonics: int
    n_time: int
    estimate: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Precision:
    """All solutions."""

    samples: list[Sample]
    kept: list[Kept]


@dataclass(frozen=True)
class Problem:
    """A case, its references (n_points, coefficients), and the settings that it is solved with."""

    name: str
    groups: Groups
    references: list[Floats]
    allows: Callable[[str], bool]


def measure_precision(bench: Bench, step: Callable[[str], None]) -> Precision:
    """Every problem with every setting."""
    samples, kept = [], []
    for problem in [*map(oscillator, load_cases()), sector(bench)]:
        step(problem.name)
        for setting, keys in SETTINGS.items():
            if not problem.allows(setting):
                continue
            samples += [solve(bench, problem, setting, keys, n_harmonics)
                        for n_harmonics in (HARMONICS[:2] if bench.quick else HARMONICS)
                        if keys.get("n_time", 1024) >= 2 * n_harmonics + 1]
        kept += [keep(bench, problem, accuracy) for accuracy in ACCURACIES]
    return Precision(samples, kept)


def oscillator(case: Case) -> Problem:
    """A case with one reference; springs alone have no events to locate."""
    is_smooth = "contact" not in case.groups
    return Problem(case.name, case.groups, [case.reference],
                   lambda setting: not (is_smooth and "events" in setting))


def sector(bench: Bench) -> Problem:
    """Nine points around the peak, where the joint slips; the tip."""
    groups = sector_case(SECTOR_PAIRS, 1, near_peak(SECTOR_PAIRS))
    groups["output"] = {"observe": "tip"}
    del groups["harmonics"]
    converged = {"n_harmonics": 3, "n_time": 256} if bench.quick else CONVERGED
    run = bench.run(groups | {"harmonics": {"sampling": "events"} | converged})
    return Problem(SECTOR, groups, [point[:, 0] for point in run.coefficients],
                   lambda setting: SETTINGS[setting].get("n_time", 0) <= LARGEST_SECTOR_INSTANTS)


def solve(bench: Bench, problem: Problem, setting: str, keys: dict[str, object],
          n_harmonics: int) -> Sample:
    """The case with H, n_time, sampling and method given."""
    seconds, run = repeat(bench, problem, {"n_harmonics": n_harmonics} | keys)
    converged = bool(run.converged.all())
    return Sample(problem.name, setting, n_harmonics, largest_error(problem, run),
                  seconds if converged else float("nan"))


def keep(bench: Bench, problem: Problem, accuracy: float) -> Kept:
    """The case with an accuracy asked for; of several points, the largest numbers."""
    seconds, run = repeat(bench, problem, {"accuracy": accuracy})
    return Kept(problem.name, accuracy, int(run.harmonics.max()), int(run.instants.max()),
                float(run.estimate.max()), largest_error(problem, run), seconds)


def repeat(bench: Bench, problem: Problem, harmonics: dict[str, object]) -> tuple[float, Run]:
    """Median of the mean time of a point in one thread."""
    return bench.repeat(problem.groups | {"harmonics": harmonics},
                        lambda run: float(run.seconds.mean()), most=3, budget=1.0)


def largest_error(problem: Problem, run: Run) -> float:
    """Of the points that converged; of the first observed quantity."""
    errors = [relative_error(point[:, 0], reference)
              for point, reference, converged in zip(run.coefficients, problem.references,
                                                     run.converged) if converged]
    return float(np.max(errors, initial=0.0)) if errors else float("nan")
