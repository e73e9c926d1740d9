"""Harmonic balance against integration in time on the sector at its resonance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.common.layout import table
from bench.common.measure import Bench, Groups, Run
from bench.common.sector import case

__all__ = ["Comparison", "measure_integration", "write_integration"]

#: Speed [rad/s] by its name in rpm, and the interval [Hz] in which the peak is looked for.
SETTINGS = {"4400": (460.8, 1026.0, 1018.0), "3600": (377.0, 1022.0, 1014.0),
            "2500": (261.8, 1018.0, 1008.0)}
HARMONICS = (3, 7, 15, 31)
#: What the amplitude may differ by at H = 7.
TARGET = 0.005
#: Instants of the balance, and the finer sampling that shows their error.
INSTANTS, MANY_INSTANTS = 256, 1024
STEPS = (1000, 2000)
SCALES = (0.1, 0.3, 3.0)
N_POINTS = 41


@dataclass(frozen=True)
class Comparison:
    """Amplitudes at the peak of H = 7.

    Attributes
    ----------
    hertz : frequency of the peak
    balance : (H, n_time, penalty_scale) -> tip amplitude [mm], NaN where it did not converge
    steps : steps per period -> run of the integration
    """

    speed: str
    hertz: float
    balance: dict[tuple[int, int, float], float]
    steps: dict[int, Run]

    @property
    def reference(self) -> float:
        """Amplitude of the finest integration [mm]."""
        return float(self.steps[max(self.steps)].amplitude[-1, 0])

    def difference(self, n_harmonics: int, n_time: int = INSTANTS, scale: float = 1.0) -> float:
        """Relative difference of the balance from the integration."""
        return self.balance.get((n_harmonics, n_time, scale), math.nan) / self.reference - 1.0


def measure_integration(bench: Bench, step: Callable[[str], None]) -> list[Comparison]:
    """Every setting."""
    found = []
    for speed in list(SETTINGS)[:1] if bench.quick else SETTINGS:
        step(f"{speed} rpm")
        found.append(compare(bench, speed))
    return found


def compare(bench: Bench, speed: str) -> Comparison:
    """Find the peak, then solve there in every way."""
    _, start, end = SETTINGS[speed]
    hertz = find_peak(bench.run(balance(speed, start, end, 7, INSTANTS, N_POINTS)))
    cases = [(h, INSTANTS, 1.0) for h in HARMONICS] + [(7, MANY_INSTANTS, 1.0)]
    cases += [(7, INSTANTS, scale) for scale in SCALES]
    amplitudes = {}
    for n_harmonics, n_time, scale in cases[:2] if bench.quick else cases:
        run = bench.run(balance(speed, start, hertz, n_harmonics, n_time, N_POINTS, scale))
        amplitudes[n_harmonics, n_time, scale] = (float(run.amplitude[-1, 0]) if run.converged[-1]
                                                  else math.nan)
    steps = {}
    for n_steps in (64,) if bench.quick else STEPS:
        groups = balance(speed, hertz, hertz, 7, INSTANTS, 1)
        groups["case"] = {"analysis": "time"}
        groups["time"] = {"steps_per_period": n_steps}
        steps[n_steps] = bench.run(groups)
    return Comparison(speed, hertz, amplitudes, steps)


def balance(speed: str, start: float, end: float, n_harmonics: int, n_time: int, n_points: int,
            scale: float = 1.0) -> Groups:
    """A sweep between two frequencies [Hz]."""
    sweep = {"start": start, "end": end, "n_points": n_points, "unit": "Hz"}
    groups = case(16, n_harmonics, sweep, speed=SETTINGS[speed][0])
    groups["harmonics"] = {"n_harmonics": n_harmonics, "n_time": n_time}
    groups["contact"] = {"penalty_scale": scale}
    groups["output"] = {"observe": "tip"}
    return groups


def find_peak(run: Run) -> float:
    """Frequency of the largest amplitude [Hz]."""
    amplitude = np.where(run.converged, run.amplitude[:, 0], 0.0)
    return float(run.omega[np.argmax(amplitude)] / (2.0 * np.pi))


def write_integration(found: list[Comparison]) -> str:
    """The text of the part."""
    coarse, fine = min(found[0].steps), max(found[0].steps)
    rows = [(c.speed, f"{c.hertz:.2f}", f"{c.reference:.5f}", *(percent(c.difference(h))
             for h in HARMONICS), met(c.difference(7))) for c in found]
    errors = [(c.speed, percent(c.steps[coarse].amplitude[-1, 0] / c.reference - 1.0),
               percent(c.difference(7, MANY_INSTANTS) - c.difference(7)),
               *(percent(c.difference(7, INSTANTS, scale)) for scale in SCALES[:2]),
               percent(c.difference(7)), percent(c.difference(7, INSTANTS, SCALES[2])))
              for c in found]
    work = [(c.speed, n, run.iterations[-1], f"{run.residual[-1]:.0e}",
             "yes" if run.converged[-1] else "no", f"{run.seconds[-1]:.1f}")
            for c in found for n, run in c.steps.items()]
    return "\n".join([
        "## Harmonic balance against integration in time", "",
        "Tip amplitude of the sector with 16 pairs, tip force 0.5 N, at the peak of H = 7: "
        f"harmonic balance (n_time = {INSTANTS}) against `analysis = 'time'` with {fine} steps per "
        f"period, which shares no formulation with it. Wanted: {100.0 * TARGET:g} % at H = 7.", "",
        *table(["rpm", "peak [Hz]", "integration [mm]", *(f"H = {h}" for h in HARMONICS),
                f"H = 7 within {100.0 * TARGET:g} %"], rows), "",
        f"Where the difference comes from: what {coarse} steps instead of {fine} change in the "
        f"integration, what {MANY_INSTANTS} instants instead of {INSTANTS} change in the balance, "
        "and the difference at H = 7 with other `penalty_scale`.", "",
        *table(["rpm", "steps", "instants", *(f"scale {scale:g}" for scale in SCALES[:2]),
                "scale 1", f"scale {SCALES[2]:g}"], errors), "",
        *(verdict(c) for c in found), "",
        "Contact coordinates of the reduced model carry some mass. Rigid friction in displacements "
        "on such coordinates converges slowly with H, at a rate that depends on `penalty_scale` "
        "(see [theory](theory.md)); the more of the joint slips, the more it counts.", "",
        *table(["rpm", "steps per period", "periods", "change over the last period", "periodic",
                "time [s]"], work)])


def verdict(c: Comparison) -> str:
    """Which side the difference at H = 7 comes from."""
    steps = abs(c.steps[min(c.steps)].amplitude[-1, 0] / c.reference - 1.0)
    instants = abs(c.difference(7, MANY_INSTANTS) - c.difference(7))
    difference = abs(c.difference(7))
    if math.isnan(difference) or math.isnan(instants):
        return f"- {c.speed} rpm: not known."
    if difference <= 2.0 * (steps + instants):
        return (f"- {c.speed} rpm: the difference is within twice what the steps and instants "
                "change, and says nothing about H.")
    return (f"- {c.speed} rpm: the difference is {difference / (steps + instants):.0f} times what "
            "the steps and instants change: it is the truncation of the series.")


def percent(value: float) -> str:
    """With its sign."""
    return "-" if math.isnan(value) else f"{100.0 * value:+.3f} %"


def met(value: float) -> str:
    """Whether the target is met."""
    return "met" if abs(value) <= TARGET else f"missed: {100.0 * abs(value):.2f} %"
