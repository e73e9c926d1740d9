"""Frequency and force at given amplitudes: by a mode, phase resonances, controlled sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from fit import N_HARMONICS, predict
from record import MASS, Level

import fretwear as fw
from fretwear.beam import ReducedBeam

__all__ = ["METHODS", "by_control", "by_mode", "by_resonance"]

Floats = np.ndarray
#: Phase resonances over the force, which is finer than a spline between them needs.
N_FORCES = 60
#: Frequencies of a controlled sweep, as in the record [Hz].
SPACING = 0.05
#: Where resonances are looked for [Hz].
RANGE = (79.0, 81.5)


def by_mode(beam: ReducedBeam, levels: Sequence[Level]) -> Floats:
    """Frequencies [Hz], then F/(2 m a) (2 n), of the nonlinear mode."""
    return predict(beam, levels)


def by_resonance(beam: ReducedBeam, levels: Sequence[Level]) -> Floats:
    """The same of phase resonances over the force, between them by splines of logarithms."""
    scipy = __import__("scipy.interpolate").interpolate
    forces = [one.force for one in levels]
    settings: Any = {
        "case": {"analysis": "resonance"}, "harmonics": {"n_harmonics": N_HARMONICS},
        "sweep": {"start": RANGE[0], "end": RANGE[1], "n_points": 101, "unit": "Hz"},
        "resonance": {"parameter": "load%harmonic_scale", "condition": "phase", "spacing": "log",
                      "start": 0.5 * min(forces), "end": 1.5 * max(forces), "n_points": N_FORCES}}
    track = fw.run(beam.case(**settings), in_memory=True).resonance
    good = track.converged
    size = np.log(track.first_harmonic[good])
    at = np.log([one.displacement for one in levels])
    frequency = scipy.CubicSpline(size, track.frequency[good])(at)
    force = np.exp(scipy.CubicSpline(size, np.log(track.parameter[good]))(at))
    return np.concatenate((frequency, _damping(force, frequency, levels)))


def by_control(beam: ReducedBeam, levels: Sequence[Level]) -> Floats:
    """The same of sweeps at the amplitudes, read as the record is: where the displacement is 90
    degrees behind the force, linearly between two frequencies."""
    places = np.arange(RANGE[0], RANGE[1] + 0.5 * SPACING, SPACING)
    sizes = [one.displacement for one in levels]
    settings: Any = {
        "case": {"analysis": "frf"}, "harmonics": {"n_harmonics": N_HARMONICS},
        "sweep": {"start": RANGE[0], "end": RANGE[1], "n_points": len(places), "unit": "Hz"},
        "control": {"amplitude": sorted(set(sizes))}}
    result = fw.run(beam.case(**settings), in_memory=True)
    behind = -np.angle(result.harmonic(1, "drive"))
    frequency, force = [], []
    for size in sizes:
        own = np.flatnonzero(np.isclose(result.control_amplitude, size, rtol=1e-12))
        late = behind[own] - 0.5 * np.pi
        k = int(np.flatnonzero(np.diff(np.signbit(late)))[0])
        share = late[k] / (late[k] - late[k + 1])
        for found, values in ((frequency, result.frequency), (force, result.load_scale)):
            found.append(values[own[k]] + share * (values[own[k + 1]] - values[own[k]]))
    return np.concatenate((frequency, _damping(np.array(force), np.array(frequency), levels)))


def _damping(force: Floats, frequency: Floats, levels: Sequence[Level]) -> Floats:
    """F/(2 m a) with the acceleration at the frequency of the model."""
    sizes = np.array([one.displacement for one in levels])
    return force / (2.0 * MASS * (2.0 * np.pi * frequency)**2 * sizes)


METHODS = {"mode": by_mode, "phase resonance": by_resonance, "controlled sweep": by_control}
