"""What pairs of several laws cost in one case, beside cases of one law.

A row of masses, a pair on each: all pairs of one law, all of the other, and every second pair of
each. The mixed case is held against the mean of the two, for half of its pairs are of each law.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from bench.common.layout import milliseconds, table
from bench.common.measure import Bench, Groups

__all__ = ["Mixed", "measure_laws", "write_laws"]

N_PAIRS, POINTS, RUNS = 48, 41, 5
#: What the mixed case may take, as a share of the mean of the two.
WANTED = 1.15
CONSTANTS = {"dlft": {}, "penalty": {"tangential_stiffness": 1.0},
             "regularised": {"slip_speed": 0.2}}


@dataclass(frozen=True)
class Mixed:
    """Processor times [s] and Newton steps of both laws alone (2) and of the mixed case."""

    laws: tuple[str, str]
    alone: tuple[float, float]
    steps_alone: tuple[int, int]
    mixed: float
    steps: int

    @property
    def ratio(self) -> float:
        """Time of the mixed case over the mean of the two."""
        return 2.0 * self.mixed / sum(self.alone)


def measure_laws(bench: Bench) -> list[Mixed]:
    """Every two of the laws."""
    rows = []
    for laws in itertools.combinations(CONSTANTS, 2):
        words = [[law] * N_PAIRS for law in laws] + [list(laws) * (N_PAIRS // 2)]
        best = [[np.inf, 0] for _ in words]
        for _ in range(1 if bench.quick else RUNS):
            for k, of_pairs in enumerate(words):
                run, cost = bench.run_and_weigh(case(of_pairs, 3 if bench.quick else POINTS))
                best[k] = [min(best[k][0], cost.processor), int(run.iterations.sum())]
        (first, n_1), (second, n_2), (both, n) = best
        rows.append(Mixed(laws, (first, second), (n_1, n_2), both, n))
    return rows


def case(words: list[str], points: int) -> Groups:
    """A sweep over the resonances of the row; each mass stands on the ground too."""
    random = np.random.default_rng(5)
    k = random.uniform(0.1, 0.2, N_PAIRS + 1)
    mass = np.diag(random.uniform(0.9, 1.1, N_PAIRS))
    stiffness = (np.diag(1.0 + k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1))
    contact: dict[str, object] = {
        "n_pairs": N_PAIRS, "law": words, "mu": 0.4, "normal_load": 0.6,
        "side_1": [dof for i in range(N_PAIRS) for dof in (i + 1, 0, 0)]}
    for word in set(words):
        contact |= CONSTANTS[word]
    return {
        "case": {"title": "pairs of several laws", "analysis": "frf"},
        "model": {"n_dof": N_PAIRS} | {name: matrix.ravel().tolist() for name, matrix in (
            ("mass", mass), ("damping", 0.03 * mass), ("stiffness", stiffness))},
        "contact": contact,
        "load": {"cosine": np.linspace(0.5, 1.0, N_PAIRS).tolist()},
        "harmonics": {"n_harmonics": 7},
        "sweep": {"start": 0.8, "end": 1.3, "n_points": points},
    }


def write_laws(rows: list[Mixed]) -> str:
    """The section of the document."""
    return "\n".join([
        "## Pairs of several laws", "",
        f"A row of {N_PAIRS} masses with a pair on each, {POINTS} frequencies over the resonances, "
        "H = 7: all pairs of one law, all of the other, every second pair of each. Processor time "
        f"of the whole run in one thread, the least of {RUNS}, and Newton steps. The ratio is that "
        f"of the mixed case to the mean of the two; wanted: {WANTED}.", "",
        *table(["laws", "first [ms]", "second [ms]", "both [ms]", "steps", "ratio", "wanted"],
               [(" and ".join(f"`{law}`" for law in r.laws), *map(milliseconds, r.alone),
                 milliseconds(r.mixed), f"{r.steps_alone[0]}, {r.steps_alone[1]}, {r.steps}",
                 f"{r.ratio:.2f}", "met" if r.ratio <= WANTED else "missed") for r in rows])])
