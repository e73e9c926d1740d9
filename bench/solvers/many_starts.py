"""Every solver, and every scheme on every pseudo-time flow, from many starts (starts.f90).

No fallback and no other guess: a solver that fails from a start has failed. The starts are random
and the same for every solver.
"""

from __future__ import annotations

import math
import statistics
import subprocess
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bench.common.measure import Bench, Floats, Groups, write_namelist
from bench.common.oscillators import coulomb, duffing_points, relative_error, single, two_dof
from bench.common.programs import run_program
from bench.common.sector import case as sector_case

__all__ = ["SOLVERS", "Outcome", "Problem", "Solver", "Start", "measure_solvers", "problems",
           "references_by_frequency", "solve_starts", "summarize"]

FLOWS = ("rotated", "identity", "preconditioned")
SCHEMES = ("implicit_euler", "bdf", "rosenbrock", "runge_kutta")
#: Frequencies [rad/s] between the folds at 1.233 and 1.457, where three solutions exist.
DUFFING_FREQUENCIES = (1.25, 1.3, 1.4, 1.43)
#: Random coefficients lie within these; the largest response between the folds is 1.5.
DUFFING_SPREADS = (1.0, 3.0, 10.0)
N_STARTS = 21
#: Frequencies [Hz] before, at and behind the peak of the sector at 4400 rpm.
SECTOR_FREQUENCIES = (1020.0, 1022.7, 1025.0)
#: Bound of the random relative displacements [mm]; those at the peak reach a quarter of it.
SECTOR_SPREAD = 1e-3
#: A program that takes longer [s] has no bound on its work.
TIMEOUT = 600.0


@dataclass(frozen=True)
class Solver:
    """A solver as it stands in the namelist."""

    kind: str
    flow: str = ""
    scheme: str = ""

    @property
    def name(self) -> str:
        """A short name for tables."""
        return self.kind if not self.flow else f"{self.flow}, {self.scheme}"

    @property
    def groups(self) -> Groups:
        """Its groups."""
        if not self.flow:
            return {"solver": {"kind": self.kind}}
        return {"solver": {"kind": self.kind},
                "pseudo_time": {"flow": self.flow, "scheme": self.scheme}}


SOLVERS = (Solver("newton"), Solver("powell"), Solver("kinsol"),
           *(Solver("pseudo_time", flow, scheme) for flow in FLOWS for scheme in SCHEMES))


@dataclass(frozen=True)
class Problem:
    """A case with its starts and its known solutions.

    Attributes
    ----------
    groups : the case without a solver
    starts : keys of &starts
    references : known coefficients for a frequency [rad/s] (rounded to 9 digits), several where
        there are several solutions; frequencies without a reference count in no error
    """

    name: str
    groups: Groups
    starts: dict[str, object]
    references: dict[float, list[Floats]] = field(default_factory=dict)


@dataclass(frozen=True)
class Start:
    """What came of one start; error is NaN where nothing is known to compare with."""

    omega: float
    number: int
    converged: bool
    iterations: int
    seconds: float
    error: float
    message: str


@dataclass(frozen=True)
class Outcome:
    """All starts of a problem with one solver, or the time-out that ended it."""

    problem: str
    solver: Solver
    starts: list[Start]
    timed_out: bool = False


@dataclass(frozen=True)
class Summary:
    """Figures of an outcome: medians over the starts that converged, the largest error."""

    converged: int
    total: int
    iterations: float
    seconds: float
    error: float
    failures: list[tuple[str, int]]

    @property
    def share(self) -> float:
        """Part of the starts that converged."""
        return self.converged / self.total if self.total else 0.0


def problems(bench: Bench) -> list[Problem]:
    """The problems of the table."""
    n_starts = 2 if bench.quick else N_STARTS
    found = [duffing_problem(spread, n_starts) for spread in DUFFING_SPREADS]
    for key, law in (("c0.1_N0.4_w0.9", "dlft"), ("c0.1_N0.4_w0.9", "dlft_velocity"),
                     ("ss_c0.1_N1.2_w0.4", "dlft")):
        case = coulomb(key, law)
        found.append(oscillator_problem(case.name, case.groups, case.reference, n_starts))
    case = two_dof("E_separation")
    found.append(oscillator_problem(case.name, case.groups, case.reference, n_starts))
    found.append(sector_problem(bench))
    return found


def duffing_problem(spread: float, n_starts: int) -> Problem:
    """Between the folds; H = 5."""
    p, _ = duffing_points()
    groups = single(p, p["F"], DUFFING_FREQUENCIES[0]) | {
        "spring": {"n_springs": 1, "side_1": 1, "coefficient": p["alpha"], "power": 3},
        "harmonics": {"n_harmonics": 5}}
    starts = {"frequencies": DUFFING_FREQUENCIES, "n_starts": n_starts, "spread": spread}
    return Problem(f"Duffing, starts within {spread:g}", groups, starts, references_by_frequency())


def references_by_frequency() -> dict[float, list[Floats]]:
    """Every known solution of the Duffing oscillator."""
    references: dict[float, list[Floats]] = {}
    for omega, coefficients in duffing_points()[1]:
        references.setdefault(round(omega, 9), []).append(coefficients)
    return references


def oscillator_problem(name: str, groups: Groups, reference: Floats, n_starts: int) -> Problem:
    """One frequency, starts within 3; H = 7."""
    omega = float(groups["sweep"]["start"])
    return Problem(name, groups | {"harmonics": {"n_harmonics": 7, "n_time": 256}},
                   {"frequencies": [omega], "n_starts": n_starts, "spread": 3.0},
                   {round(omega, 9): [reference]})


def sector_problem(bench: Bench) -> Problem:
    """16 pairs, H = 3; the references are solutions of sweeps at a tolerance of 1e-11."""
    frequencies = [2.0 * math.pi * f for f in SECTOR_FREQUENCIES]
    references = {}
    for hertz, omega in zip(SECTOR_FREQUENCIES, frequencies):
        sweep = {"start": hertz + 3.0, "end": hertz, "n_points": 13, "unit": "Hz"}
        groups = sector_case(16, 3, sweep) | {"output": {"observe": "tip"},
                                              "solver": {"tolerance": 1e-11}}
        run = bench.run(groups)
        if not run.converged[-1]:
            raise RuntimeError(f"the sector has no reference at {hertz} Hz")
        references[round(omega, 9)] = [run.coefficients[-1, :, 0]]
    groups = sector_case(16, 3, {"start": frequencies[0]}) | {"output": {"observe": "tip"}}
    groups["case"] = {"analysis": "point"}
    return Problem("Sector, 16 pairs", groups,
                   {"frequencies": frequencies, "n_starts": 1 if bench.quick else 5,
                    "spread": SECTOR_SPREAD, "first_guess": True}, references)


def measure_solvers(bench: Bench, program: Path, step: Callable[[str], None]) -> list[Outcome]:
    """Every problem with every solver."""
    outcomes = []
    for problem in problems(bench):
        step(problem.name)
        outcomes += [solve_starts(bench, program, problem, solver) for solver in SOLVERS]
    return outcomes


def solve_starts(bench: Bench, program: Path, problem: Problem, solver: Solver) -> Outcome:
    """One run of bench/solvers/starts.f90."""
    case_file, starts_file = bench.folder / "starts_case.nml", bench.folder / "starts.nml"
    write_namelist(case_file, merged(problem.groups, solver.groups))
    starts = {"case": case_file, "budget": 0.0 if bench.quick else 0.1, **problem.starts}
    write_namelist(starts_file, {"starts": starts})
    try:
        rows = run_program(program, starts_file, separator=";", timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        return Outcome(problem.name, solver, [], timed_out=True)
    return Outcome(problem.name, solver, [read_start(row, problem) for row in rows])


def merged(case: Groups, solver: Groups) -> Groups:
    """Both, the keys of the solver last."""
    return case | {group: case.get(group, {}) | keys for group, keys in solver.items()}


def read_start(row: dict[str, str], problem: Problem) -> Start:
    """A line of the program with its distance to the nearest known solution."""
    coefficients = np.array(row["coefficients"].split(), dtype=float)
    omega = float(row["omega"])
    errors = [relative_error(coefficients, reference)
              for reference in problem.references.get(round(omega, 9), [])]
    return Start(omega, int(row["start"]), row["converged"] == "1", int(row["iterations"]),
                 float(row["seconds"]), min(errors, default=math.nan), row["message"])


def summarize(outcome: Outcome) -> Summary:
    """Figures of a table row; NaN where no start converged."""
    good = [start for start in outcome.starts if start.converged]
    errors = [start.error for start in good if not math.isnan(start.error)]
    failures = Counter(plain_message(start.message) for start in outcome.starts
                       if not start.converged)
    return Summary(len(good), len(outcome.starts),
                   statistics.median([s.iterations for s in good]) if good else math.nan,
                   statistics.median([s.seconds for s in good]) if good else math.nan,
                   max(errors, default=math.nan), failures.most_common())


def plain_message(message: str) -> str:
    """A message without counts and explanations, so that equal failures count together."""
    if message.startswith(("steps run out", "the flow runs away")):
        return message.split(":")[0]
    return message or "no message"
