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
        Amplitude, angular frequency [rad/s] and damping ratio xi/(2 omega). Where the shape changes
        with the amplitude this is not F/(2 m a) of a forced motion: see `forced_damping_ratio`.
    converged : (n_points,)
        Whether the point is a solution.
    stuck_omega, stuck_damping_ratio : float
        The linear mode with stuck pairs [rad/s].
    onset : float
        Amplitude from which on a pair slips or separates; NaN where none does.
    limit_cycles : tuple of LimitCycle
        In the order along the curve.
    modal_mass : (n_points,)
        Mass of the mode at the first observed quantity, as its shape is at each amplitude: the
        modal amplitude over that of the first harmonic, squared.
    onset_known_by : str
        'bound', 'solutions', 'stuck', 'below', 'every' or 'none', as the user guide has them; ''
        in results of older versions.
    onset_bound : float
        Amplitude above which nothing can stick; NaN where it is not known.
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
    modal_mass: Floats
    onset_known_by: str = ""
    onset_bound: float = float("nan")

    def forced_damping_ratio(self, mass: float | None = None) -> Floats:
        """F/(2 m a) of the forced motion at its phase resonance (n_points), as it is measured.

        F drives the first observed quantity, a is its acceleration, and m is one mass for all
        amplitudes. It is `damping_ratio` times `modal_mass` over m, as far as other modes take no
        part.

        Parameters
        ----------
        mass : float, optional
            The m of the measurement; the modal mass at the lowest amplitude without it.
        """
        if mass is None:
            good = np.flatnonzero(self.converged)
            if not len(good):
                return np.full(len(self.amplitude), np.nan)
            mass = float(self.modal_mass[good[np.argmin(self.amplitude[good])]])
        return np.asarray(self.damping_ratio * self.modal_mass / mass)

    @property
    def frequency(self) -> Floats:
        """Frequency (n_points) [Hz]."""
        return self.omega / (2.0 * np.pi)


def read_mode(result: ResultFile) -> NonlinearMode:
    """The mode of a result; raises AbsentError where it holds none."""
    damping = result["mode/damping_ratio"]
    control = namelist_values(result.namelist).get("mode%control", ["observed"])[0]
    modal = control == "modal"
    modal_amplitude, observed = result["mode/modal_amplitude"], result["mode/first_harmonic"][:, 0]
    amplitude = modal_amplitude if modal else observed
    with np.errstate(divide="ignore", invalid="ignore"):  # at a node of the mode
        mass = (modal_amplitude / observed)**2
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
        float(facts["stuck_damping_ratio"]), float(facts["onset_amplitude"]), tuple(cycles),
        np.asarray(mass), str(facts.get("onset_known_by", "")),
        float(facts.get("onset_bound", np.nan)))
