"""Runs of wear on the sector with 48 pairs: their cases, and the work that they took."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from bench.common.measure import Bench, Floats, Groups
from bench.common.sector import case
from fretwear.result import Result

__all__ = ["FAST", "N_PAIRS", "SLOW", "Regime", "Scheme", "WearRun", "difference", "first_tangent",
           "rosenbrock", "run_wear", "stage_order", "steps_of"]

N_PAIRS = 48
#: [mm^2/N], as the wear of titanium alloys on themselves is often computed with. It sets the scale
#: of the cycles and nothing else: every depth below is the same with any other.
COEFFICIENT = 1e-8
#: Beyond what any steady state takes.
MANY_CYCLES = 1e15


@dataclass(frozen=True)
class Regime:
    """Rotation speed [rad/s], and the resonance of the unworn joint at it [Hz]."""

    name: str
    speed: float
    resonance: float


FAST = Regime("3600 rpm", 376.99, 1012.5)
SLOW = Regime("2500 rpm", 261.8, 1006.5)


@dataclass(frozen=True)
class Scheme:
    """A way to integrate wear: its name, and the groups that choose it."""

    name: str
    wear: dict[str, object]
    pseudo_time: dict[str, object] | None = None


def steps_of(scheme: str, depth_step: float) -> Scheme:
    """First order, with steps that let the largest depth grow by `depth_step` [mm]."""
    name = {"implicit": "implicit Euler", "pseudo_time": "pseudo-time"}[scheme]
    return Scheme(name, {"scheme": scheme, "max_depth_step": depth_step})


def stage_order(order: int, tolerance: float) -> Scheme:
    """The implicit scheme of an order from 2 to 4, with steps set by the error."""
    return Scheme(f"implicit, order {order}",
                  {"scheme": "implicit", "order": order, "error_tolerance": tolerance})


def rosenbrock(tolerance: float, depth_step: float = 0.0) -> Scheme:
    """Pseudo-time of order 3 with one derivative a step, with steps set by the error."""
    wear: dict[str, object] = {"scheme": "pseudo_time"}
    if tolerance > 0.0:
        wear["error_tolerance"] = tolerance
    if depth_step > 0.0:
        wear["max_depth_step"] = depth_step
    return Scheme("Rosenbrock, order 3", wear, {"scheme": "rosenbrock"})


@dataclass(frozen=True)
class WearRun:
    """What a run left, and what it took.

    Attributes
    ----------
    scheme : Scheme
    result : Result
    n_solves : int
        Linear solutions of the march, without the vibration of the unworn joint.
    n_krylov : int
        Krylov iterations of all of them.
    n_steps, n_rejected : int
        Steps taken, and steps that were repeated at half their length.
    cpu : float
        Processor time of the whole program in one thread [s]: start, reading and writing too.
    """

    scheme: Scheme
    result: Result
    n_solves: int
    n_krylov: int
    n_steps: int
    n_rejected: int
    cpu: float

    @property
    def is_steady(self) -> bool:
        """Whether the steady state was reached."""
        return self.result.steady_state == "reached"

    @property
    def depth(self) -> Floats:
        """Depth of every pair at the end [mm]."""
        return self.result.depth[-1]

    @property
    def deepest(self) -> float:
        """Largest depth at the end [mm]."""
        return float(self.depth.max())

    @property
    def n_worn(self) -> int:
        """Pairs with more than a thousandth of the largest depth."""
        return int((self.depth > 1e-3 * self.deepest).sum())

    @property
    def swing(self) -> Floats:
        """Half the swing of the tip over the period at every step [mm], without its static part."""
        return half_swing(self.result.coefficients[:, :, 0])


def run_wear(bench: Bench, name: str, scheme: Scheme, regime: Regime = FAST,
             changes: Groups | None = None) -> WearRun:
    """Wear at the resonance of the unworn joint, to its steady state unless the run gives up.

    Parameters
    ----------
    bench : Bench
    name : str
        Of the result file in the folder of the bench.
    scheme : Scheme
    regime : Regime
    changes : Groups, optional
        Keys that differ from the case of the paper.
    """
    groups = wear_case(regime, scheme)
    for group, keys in (changes or {}).items():
        groups[group] = groups.get(group, {}) | keys
    path = bench.folder / f"{name}.h5"
    summary, cpu = bench.execute(groups, path)
    result = Result(path)
    return WearRun(scheme, result, int(result.iterations[1:].sum()),
                   count(r"(\d+) Krylov iterations", summary), len(result.depth) - 1,
                   count(r"^wear steps .*?(\d+) repeated", summary), cpu)


def wear_case(regime: Regime, scheme: Scheme) -> Groups:
    """H = 3, 0.5 N at the tip; the tip and the first tangent of every pair are observed."""
    groups = case(N_PAIRS, 3, {"start": regime.resonance, "unit": "Hz"}, speed=regime.speed)
    groups["case"] = {"title": f"wear at {regime.name}, {scheme.name}", "analysis": "wear"}
    groups["wear"] = {"coefficient": COEFFICIENT, "n_cycles": MANY_CYCLES} | scheme.wear
    if scheme.pseudo_time:
        groups["pseudo_time"] = dict(scheme.pseudo_time)
    # The relative displacements are the first dofs of the model.
    groups["output"] = {"observe": ["tip", *(3 * pair + 1 for pair in range(N_PAIRS))]}
    return groups


def count(pattern: str, summary: str) -> int:
    """A number of the summary that fw_run prints."""
    found = re.search(pattern, summary, re.MULTILINE)
    if found is None:
        raise RuntimeError(f"no {pattern!r} in the summary:\n{summary}")
    return int(found[1])


def first_tangent(run: WearRun, pair: int) -> Floats:
    """Amplitude of the first harmonic of a pair (from 0) along its first tangent [mm], for every
    step of the run."""
    coefficients = run.result.coefficients[:, 1:3, 1 + pair]
    return np.hypot(coefficients[:, 0], coefficients[:, 1])


def half_swing(coefficients: Floats) -> Floats:
    """Half the difference between the extremes of Fourier series (n_series, 2H+1)."""
    turn = 2.0 * np.pi * np.arange(512) / 512
    orders = np.arange(1, (coefficients.shape[1] + 1) // 2)
    values = (coefficients[:, 1::2] @ np.cos(np.outer(orders, turn))
              + coefficients[:, 2::2] @ np.sin(np.outer(orders, turn)))
    return 0.5 * np.ptp(values, axis=1)


def difference(profile: Floats, reference: Floats) -> float:
    """Largest difference of two profiles as a part of the largest depth of the second."""
    return float(np.abs(profile - reference).max() / reference.max())
