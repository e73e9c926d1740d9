"""Frequency and damping of a nonlinear mode over its amplitude (`analysis = 'mode'`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ._native import namelist_values
from .errors import AbsentError
from .result_file import ResultFile

__all__ = ["LimitCycle", "NonlinearMode", "read_mode"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LimitCycle:
    """A motion that keeps itself alive: the damping of the mode vanishes there.

    Attributes
    ----------
    amplitude : float
        In the unit of the amplitudes of the mode.
    omega : float
        Angular frequency [rad/s].
    stable : bool
        Whether damping grows with the amplitude; a statement about this mode alone.
    """

    amplitude: float
    omega: float
    stable: bool


@dataclass(frozen=True)
class NonlinearMode:
    """The curve of a mode, in the order in which it was followed.

    Attributes
    ----------
    number : int
        Among the elastic modes with closed pairs stuck, from 1.
    control : str
        What the amplitudes are: 'observed', of the first harmonic of the first observed quantity,
        or 'modal'.
    amplitude, omega, damping_ratio : (n_points,)
        Amplitude, angular frequency [rad/s] and damping ratio.
    converged : (n_points,)
        Whether the point is a solution.
    stuck_omega, stuck_damping_ratio : float
        The linear mode with stuck pairs [rad/s].
    onset : float
        Amplitude from which on a pair slips or separates; NaN where none does.
    limit_cycles : tuple of LimitCycle
        In the order along the curve.
    """

    number: int
    control: str
    amplitude: Floats
    omega: Floats
    damping_ratio: Floats
    converged: NDArray[np.bool_]
    stuck_omega: float
    stuck_damping_ratio: float
    onset: float
    limit_cycles: tuple[LimitCycle, ...]

    @property
    def frequency(self) -> Floats:
        """Frequency (n_points) [Hz]."""
        return self.omega / (2.0 * np.pi)


def read_mode(result: ResultFile) -> NonlinearMode:
    """The mode of a result; raises AbsentError where it holds none."""
    damping = result["mode/damping_ratio"]
    control = namelist_values(result.namelist).get("mode%control", ["observed"])[0]
    modal = control == "modal"
    amplitude = (result["mode/modal_amplitude"] if modal
                 else result["mode/first_harmonic"][:, 0])
    with result.open() as file:
        facts = dict(file["mode"].attrs)
    if "number" not in facts:
        raise AbsentError(f"{result.name}: holds no point of the mode: the run has not come to its "
                          "end, or failed at the start")
    cycles = []
    if "mode/limit_cycle/amplitude" in result:
        cycles = [LimitCycle(float(a), float(omega), bool(stable)) for a, omega, stable in zip(
            *(result["mode/limit_cycle/" + name] for name in ("amplitude", "omega", "stable")))]
    return NonlinearMode(
        int(facts["number"]), control, amplitude, result["omega"], damping,
        result["converged"].astype(bool), float(facts["stuck_omega"]),
        float(facts["stuck_damping_ratio"]), float(facts["onset_amplitude"]), tuple(cycles))
