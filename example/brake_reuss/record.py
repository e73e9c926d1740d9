"""The measured record: phase resonances of its runs.

The record is ForcedFrequencyResponses.mat of github.com/mattiacenedese/BRBtesting (GPL-3.0;
doi 10.1016/j.ymssp.2021.108401): force and acceleration at the driven point near the first bending
mode, 4 runs at a constant force (FC), 8 at a constant acceleration (RC).
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

#: Of the first mode at the driven point [kg]: a damping ratio is F/(2 MASS a), here and there.
MASS = 1.951
#: Runs that the joint is calibrated on, and that it is to predict.
CALIBRATED = ("RC 1", "RC 4", "RC 7")
PREDICTED = ("RC 2", "RC 3", "RC 5", "RC 6", "FC 0", "FC 1", "FC 2", "FC 3")


@dataclass(frozen=True)
class Level:
    """Phase resonance of a run.

    Attributes
    ----------
    name : str
        Kind and number of the run, counted from 0.
    frequency, acceleration, force : float
        Where the displacement is 90 degrees behind the force [Hz], [m/s^2], [N].
    """

    name: str
    frequency: float
    acceleration: float
    force: float

    @property
    def displacement(self) -> float:
        """Amplitude [m]."""
        return self.acceleration / (2.0 * np.pi * self.frequency)**2

    @property
    def damping(self) -> float:
        """F/(2 m a)."""
        return self.force / (2.0 * MASS * self.acceleration)


def read_record(path: str | Path) -> list[Level]:
    """All runs, RC before FC."""
    data = import_module("scipy.io").loadmat(path, simplify_cells=True)["FRdata"]
    found = []
    for short, kind in (("RC", "ResponseControl"), ("FC", "ForceControl")):
        for number, run in enumerate(data[kind]):
            at = _crossing(np.asarray(run["phase"]) + 0.5 * np.pi)
            frequency, force, acceleration = (
                float(np.interp(at, np.arange(len(run[name])), run[name]))
                for name in ("frequency", "force", "amplitude"))
            found.append(Level(f"{short} {number}", frequency, acceleration, force))
    return found


def _crossing(values: np.ndarray) -> float:
    """The place, in steps, where they first change sign."""
    k = int(np.flatnonzero(np.diff(np.signbit(values)))[0])
    return k + float(values[k] / (values[k] - values[k + 1]))


@dataclass(frozen=True)
class Repeatability:
    """Standard deviations of one run: of the frequency [Hz], and relative of the damping."""

    frequency: float
    damping: float


def repeatability(levels: list[Level]) -> Repeatability:
    """From the FC runs against the RC runs between which they lie: the root mean square of the
    differences, of which each run has a half in the square."""
    held = sorted((one for one in levels if one.name.startswith("RC")),
                  key=lambda one: one.acceleration)
    size = np.log([one.acceleration for one in held])
    frequency, damping = [], []
    for one in levels:
        if one.name.startswith("FC"):
            at = np.log(one.acceleration)
            frequency.append(one.frequency - np.interp(at, size, [h.frequency for h in held]))
            damping.append(np.log(one.damping) - np.interp(
                at, size, [np.log(h.damping) for h in held]))
    return Repeatability(float(np.sqrt(0.5 * np.mean(np.square(frequency)))),
                         float(np.sqrt(0.5 * np.mean(np.square(damping)))))
