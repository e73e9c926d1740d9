"""Measured curves, and what a case says in their place, with derivatives by its parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arguments import array
from .._native import namelist_values
from ..analyses import run
from ..case import Case
from ..errors import ConvergenceError, InputError
from ..steps import Steps
from .parameters import Unknowns, differentiated, has_parts

__all__ = ["ControlData", "Measured", "ModeData", "Predicted", "ResponseData"]

Floats = NDArray[np.float64]
Deviation = Union[float, ArrayLike, None]

#: Relative step of differences, whose error is then that of the solver over it.
_STEP = 1e-4


@dataclass(frozen=True)
class Predicted:
    """What a case says in place of measured numbers.

    Attributes
    ----------
    values : (n,)
        In the order of `Measured.values`.
    jacobian : (n, n_parameters) or None
        Derivatives by the parameters.
    solved : int
        Runs of mode curves or solutions of the balance.
    """

    values: Floats
    jacobian: Floats | None
    solved: int


class Measured(ABC):
    """Measured numbers of one kind, with their standard deviations.

    Attributes
    ----------
    values : (n,)
        The numbers.
    deviation : (n,)
        Their standard deviations; sizes of the numbers where these are not known.
    is_known : bool
        Whether the deviations are.
    case : Case or None
        The case that they are of; that of the calibration without it.
    labels : tuple of str
        What the numbers are, one word each (n).
    is_exact : bool
        Whether derivatives are exact; differences where not.
    """

    is_exact: bool = True
    values: Floats
    deviation: Floats
    is_known: bool
    case: Case | None
    labels: tuple[str, ...]

    @abstractmethod
    def predict(self, unknowns: Unknowns, values: Floats, case: Case, *, slopes: bool
                ) -> Predicted:
        """What the case has at these values of the parameters.

        Raises
        ------
        ConvergenceError
            It has no answer there.
        """

    def _take(self, case: Case | None, parts: Sequence[tuple[str, Floats, Deviation]]) -> None:
        known, values, sizes, labels = [], [], [], []
        for name, numbers, given in parts:
            size = array(f"deviation of {name}", 0.0 if given is None else given,
                         (len(numbers),))
            if given is None:
                size = np.full(len(numbers), max(float(np.abs(numbers).mean()), 1e-300))
            if (size <= 0.0).any():
                raise InputError(f"deviation of {name}: is {size.min():g}, must be positive")
            known.append(given is not None)
            values.append(numbers)
            sizes.append(size)
            labels += [name] * len(numbers)
        if len(set(known)) > 1:
            raise InputError("deviations: are given for some numbers and not for others; give all "
                             "or none")
        self.values, self.deviation = np.concatenate(values), np.concatenate(sizes)
        self.is_known, self.case, self.labels = known[0], case, tuple(labels)


class ModeData(Measured):
    """Frequency and damping of a mode over its amplitude.

    Parameters
    ----------
    amplitude : (n,)
        As `mode%control` has it: of the first harmonic of the first observed quantity, or modal.
    frequency : (n,), optional
        [Hz]
    damping_ratio : (n,), optional
        Fraction of critical damping, as `damping` says.
    frequency_deviation, damping_deviation : float or (n,), optional
        Standard deviations; all or none.
    damping : {'mode', 'forced'}
        What `damping_ratio` holds: that of the mode, xi/(2 omega), as a decay shows it, or
        F/(2 m a) of forced motions at phase resonance, F driving the first observed quantity.
        Where the shape of the mode changes with the amplitude these are different numbers, and the
        case is asked for the same one.
    mass : float, optional
        The m of the measurement, for 'forced'.
    case : Case, optional
        With `analysis = 'mode'`; its amplitudes are set here.
    """

    def __init__(self, amplitude: ArrayLike, frequency: ArrayLike | None = None,
                 damping_ratio: ArrayLike | None = None, *,
                 frequency_deviation: Deviation = None, damping_deviation: Deviation = None,
                 damping: str = "mode", mass: float | None = None,
                 case: Case | None = None) -> None:
        if damping not in ("mode", "forced"):
            raise InputError(f"damping = {damping!r}: must be 'mode' or 'forced'")
        if (damping == "forced") != (mass is not None) or (mass is not None and not mass > 0.0):
            raise InputError(f"mass = {mass!r}: must be a positive number with damping = 'forced', "
                             "the m of F/(2 m a), and is given with nothing else")
        self.damping, self.mass = damping, mass
        self.amplitude: Floats = array("amplitude", amplitude, (None,))
        if not len(self.amplitude) or (self.amplitude <= 0.0).any():
            raise InputError("amplitude: must be positive numbers")
        n, parts = len(self.amplitude), []
        if frequency is not None:
            parts.append(("frequency", array("frequency", frequency, (n,)), frequency_deviation))
        if damping_ratio is not None:
            parts.append(("damping_ratio", array("damping_ratio", damping_ratio, (n,)),
                          damping_deviation))
        if not parts:
            raise InputError("frequency, damping_ratio: give one of them, or both")
        self._take(case, parts)
        self._is_asked = False

    def predict(self, unknowns: Unknowns, values: Floats, case: Case, *, slopes: bool
                ) -> Predicted:
        case = self._curve(case)
        if not self._is_asked:
            self._is_asked = True
            # Of the modal mass the library gives no derivative.
            self.is_exact = (self.damping == "mode" or "damping_ratio" not in self.labels) and (
                _has_derivatives(unknowns.case_at(values, case), unknowns.keys))
        if slopes and self.is_exact:
            case = differentiated(case, unknowns.keys, [])
        found, jacobian = self._at(unknowns, values, case, slopes=slopes and self.is_exact)
        if not slopes or self.is_exact:
            return Predicted(found, jacobian, 1)
        jacobian = _differences(unknowns, values,
                                lambda at: self._at(unknowns, at, case, slopes=False)[0])
        return Predicted(found, jacobian, 1 + 2 * len(values))

    def _curve(self, case: Case) -> Case:
        """Rows at the measured amplitudes; of one alone a second one beside it."""
        rows = np.unique(self.amplitude).tolist()
        if len(rows) == 1:
            rows.append(1.001 * rows[0])
        return case.replace(mode={"amplitudes": rows, "start": rows[0], "end": rows[-1],
                                  "n_points": len(rows), "continuation": "natural"})

    def _at(self, unknowns: Unknowns, values: Floats, case: Case, *, slopes: bool
            ) -> tuple[Floats, Floats | None]:
        result = run(unknowns.case_at(values, case), in_memory=True)
        mode = result.mode
        damping = (mode.damping_ratio if self.damping == "mode"
                   else mode.forced_damping_ratio(self.mass))
        curves = {"frequency": mode.frequency, "damping_ratio": damping}
        names = list(dict.fromkeys(self.labels))
        rows = np.searchsorted(np.unique(self.amplitude), self.amplitude)
        found = np.concatenate([curves[name][rows] for name in names])
        if not slopes:
            return found, None
        by, blocks = result.sensitivities, []
        for name in names:
            quantity, factor = (("mode_omega", 0.5 / np.pi) if name == "frequency"
                                else ("mode_damping_ratio", 1.0))
            blocks.append(factor * unknowns.chain(by[quantity])[rows])
        return found, np.concatenate(blocks)


class ResponseData(Measured):
    """Amplitudes of a response over the frequency.

    Parameters
    ----------
    frequency : (n,)
        [Hz]
    amplitude : (n,)
        Of one observed quantity.
    deviation : float or (n,), optional
        Standard deviation.
    observe : str, optional
        Observed quantity; the first without it.
    of : {'first_harmonic', 'largest'}
        What is an amplitude.
    case : Case, optional
        With `analysis = 'frf'`; the points of its sweep lead to the measured frequencies, which
        lie within them.
    """

    def __init__(self, frequency: ArrayLike, amplitude: ArrayLike, *, deviation: Deviation = None,
                 observe: str | None = None, of: str = "first_harmonic",
                 case: Case | None = None) -> None:
        self.frequency: Floats = array("frequency", frequency, (None,))
        if of not in ("first_harmonic", "largest"):
            raise InputError(f"of = {of!r}: must be 'first_harmonic' or 'largest'")
        self._observe, self._of = observe, of
        numbers = array("amplitude", amplitude, (len(self.frequency),))
        if not len(numbers):
            raise InputError("frequency: is empty")
        self._take(case, [("amplitude", numbers, deviation)])

    def predict(self, unknowns: Unknowns, values: Floats, case: Case, *, slopes: bool
                ) -> Predicted:
        case = unknowns.case_at(values, case)
        # Values come from where derivatives do: both are of the same solutions then.
        with Steps(differentiated(case, unknowns.keys, [self._of])) as steps:
            column = self._column(steps)
            own = steps.frequencies
            measured = 2.0 * np.pi * self.frequency
            slack = 1e-9 * own.max()
            if measured.min() < own.min() - slack or measured.max() > own.max() + slack:
                raise InputError(
                    f"frequency: {self.frequency.min():.6g} to {self.frequency.max():.6g} Hz, must "
                    f"lie within the sweep, {own.min() / (2 * np.pi):.6g} to "
                    f"{own.max() / (2 * np.pi):.6g} Hz")
            places = np.unique(np.concatenate((own, np.clip(measured, own.min(), own.max()))))
            rows: dict[float, tuple[float, Floats]] = {}
            for omega in places if own[-1] >= own[0] else places[::-1]:
                if not steps.advance(float(omega)):
                    raise ConvergenceError(f"the point at {omega:.9g} rad/s did not converge")
                rows[float(omega)] = self._row(steps, unknowns, column)
        order = [float(omega) for omega in np.clip(measured, own.min(), own.max())]
        return Predicted(np.array([rows[omega][0] for omega in order]),
                         np.stack([rows[omega][1] for omega in order]) if slopes else None,
                         len(places))

    def _column(self, steps: Steps) -> int:
        names = steps.observed
        if self._observe is None:
            return 0
        if self._observe not in names:
            raise InputError(f"observe = {self._observe!r}: must be among {', '.join(names)}")
        return names.index(self._observe)

    def _row(self, steps: Steps, unknowns: Unknowns, column: int) -> tuple[float, Floats]:
        """The amplitude and its derivatives at the point that was solved last."""
        n = len(steps.observed)
        value = steps.numbers(f"sensitivity/value/{self._of}")[column]
        by_key: dict[str, Any] = {}
        for key in unknowns.keys:
            numbers = steps.numbers(f"sensitivity/{self._of}/{key.replace('%', '_')}")
            row = numbers.reshape(n, -1)[column]
            by_key[key] = row if has_parts(key) else row[0]
        return float(value), unknowns.chain(by_key)


class ControlData(Measured):
    """Loads that a response of given amplitude takes, over the frequency.

    Parameters
    ----------
    frequency : (n,)
        [Hz]
    amplitude : float or (n,)
        That the response was held at.
    load : (n,)
        Factor of the vibratory loads of the case, as `load%harmonic_scale`.
    deviation : float or (n,), optional
        Standard deviation of the loads.
    observe : str, optional
        Observed quantity that was held; the first without it.
    of : {'first_harmonic', 'largest'}
        What is an amplitude.
    case : Case, optional
        With `analysis = 'frf'`; frequencies and `&control` are set here. A case whose sweep has
        `values` is led from frequency to frequency, another one is solved at each by itself.
    """

    is_exact = False

    def __init__(self, frequency: ArrayLike, amplitude: ArrayLike, load: ArrayLike, *,
                 deviation: Deviation = None, observe: str | None = None,
                 of: str = "first_harmonic", case: Case | None = None) -> None:
        self.frequency: Floats = array("frequency", frequency, (None,))
        n = len(self.frequency)
        if not n or (self.frequency <= 0.0).any():
            raise InputError("frequency: must be positive numbers")
        self.amplitude: Floats = array("amplitude", amplitude, (n,))
        if (self.amplitude <= 0.0).any():
            raise InputError("amplitude: must be positive numbers")
        if of not in ("first_harmonic", "largest"):
            raise InputError(f"of = {of!r}: must be 'first_harmonic' or 'largest'")
        self._control: dict[str, Any] = {"of": of}
        if observe is not None:
            self._control["observed"] = observe
        self._take(case, [("load", array("load", load, (n,)), deviation)])

    def predict(self, unknowns: Unknowns, values: Floats, case: Case, *, slopes: bool
                ) -> Predicted:
        found = self._loads(unknowns.case_at(values, case))
        if not slopes:
            return Predicted(found, None, len(found))
        jacobian = _differences(unknowns, values,
                                lambda at: self._loads(unknowns.case_at(at, case)))
        return Predicted(found, jacobian, (1 + 2 * len(values)) * len(found))

    def _loads(self, case: Case) -> Floats:
        """One amplitude after the other."""
        leads = "sweep%values" in namelist_values(case.namelist())
        found = np.empty(len(self.frequency))
        for amplitude in np.unique(self.amplitude).tolist():
            own = np.flatnonzero(self.amplitude == amplitude)
            places, rows = np.unique(self.frequency[own], return_inverse=True)
            control: Any = self._control | {"amplitude": [amplitude]}
            held = case.replace(control=control, sweep={"unit": "Hz"})
            if leads:
                loads = _loads_of(held.replace(sweep={"values": places.tolist()}))
            else:
                loads = np.concatenate([_loads_of(held.replace(
                    case={"analysis": "point"}, sweep={"start": place}))
                    for place in places.tolist()])
            found[own] = loads[rows]
        return found


def _loads_of(case: Case) -> Floats:
    """Of a case of given amplitude."""
    return run(case, in_memory=True).load_scale


def _differences(unknowns: Unknowns, values: Floats, at: Callable[[Floats], Floats]) -> Floats:
    """Derivatives of what a case says by central differences (n, n_parameters)."""
    columns = []
    for k, value in enumerate(values):
        step = np.zeros(len(values))
        step[k] = _STEP * (abs(value) or unknowns.high[k] - unknowns.low[k])
        columns.append((at(values + step) - at(values - step)) / (2.0 * step[k]))
    return np.stack(columns, axis=1)


def _has_derivatives(case: Case, keys: Sequence[str]) -> bool:
    """Whether the library differentiates modes by these."""
    try:
        differentiated(case, keys, []).check()
    except InputError as error:
        case.check()  # what is wrong without derivatives, is wrong
        if "sensitivity" not in str(error):
            raise
        return False
    return True
