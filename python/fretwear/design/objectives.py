"""What is made small or large: a number of a run with its derivatives."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Union

import numpy as np
from numpy.typing import NDArray

from .._native import namelist_values
from .._words import did_you_mean
from ..analyses import run
from ..case import Case
from ..errors import InputError
from ..sensitivity import Sensitivities
from .parameters import Unknowns, differentiated
from .peak_values import peak_values

__all__ = ["OBJECTIVES", "Cost", "Evaluation", "Objective", "new_objective"]

Floats = NDArray[np.float64]

#: A number made of quantities, and its derivatives by them, each of the shape of the quantity.
Cost = Callable[[Sensitivities], tuple[float, Mapping[str, NDArray[np.float64]]]]
#: What an objective may be given as.
Objective = Union[str, Cost]

#: Name: quantity at the peak of a sweep, where the peak is sought of, factor, meaning.
_AT_PEAK = {
    "max_amplitude": ("largest", "largest", 1.0, "largest amplitude of a sweep [L]"),
    "max_first_harmonic": ("first_harmonic", "first_harmonic", 1.0,
                           "largest amplitude of the first harmonic [L]"),
    "omega_at_peak": ("omega", "largest", 1.0, "where the amplitude is largest [rad/s]"),
    "frequency_at_peak": ("omega", "largest", 0.5 / np.pi, "the same [Hz]"),
    "dissipation_at_peak": ("dissipation", "largest", 1.0,
                            "friction energy of all pairs per cycle, there [F L]"),
    "wear_volume_at_peak": ("wear_volume", "largest", 1.0,
                            "wear volume of all pairs per cycle, there [L^3]"),
}
#: Name: whether it is of an observed quantity, meaning. Of a run of one point.
_OF_POINT = {
    "largest": (True, "largest amplitude at one frequency (case%analysis = 'point') [L]"),
    "first_harmonic": (True, "amplitude of the first harmonic there [L]"),
    "dissipation": (False, "friction energy of all pairs per cycle, there [F L]"),
    "wear_volume": (False, "wear volume of all pairs per cycle, there [L^3]"),
}
_FORM = re.compile(r"(\w+)(?:\[([^\]]+)\])?$")

#: What each name means.
OBJECTIVES = {**{name: entry[3] for name, entry in _AT_PEAK.items()},
              **{name: entry[1] for name, entry in _OF_POINT.items()}}


@dataclass(frozen=True)
class Evaluation:
    """An objective at values of the parameters.

    Attributes
    ----------
    parameters : (n,)
        Values.
    value : float
        The objective.
    gradient : (n,)
        Its derivatives by the parameters.
    omega : float
        Where the peak is [rad/s]; NaN where there is none.
    solved : int
        Solutions of the balance that this took.
    remarks : tuple of str
        What was remarked.
    """

    parameters: Floats
    value: float
    gradient: Floats
    omega: float
    solved: int
    remarks: tuple[str, ...]


Evaluate = Callable[[Floats], Evaluation]


def new_objective(what: Objective, unknowns: Unknowns, case: Case) -> Evaluate:
    """The function of the parameters that a name or a cost stands for.

    Raises
    ------
    InputError
        A name is not known, or the analysis of the case does not have it.
    """
    if callable(what):
        return lambda values: _of_cost(what, unknowns, values)
    match = _FORM.match(what) if isinstance(what, str) else None
    if not match or match[1] not in OBJECTIVES:
        raise InputError(f"{what!r}: is no quantity; there are " + ", ".join(OBJECTIVES)
                         + ", with the name of an observed quantity in brackets where it is not "
                           "the first"
                         + did_you_mean(str(what).partition("[")[0], words=OBJECTIVES))
    name, observe = match[1], match[2]
    analysis = namelist_values(case.namelist())["case%analysis"][0]
    wanted = "frf" if name in _AT_PEAK else "point"
    if analysis != wanted:
        raise InputError(f"{name}: is of case%analysis = '{wanted}', the case has '{analysis}'; "
                         "there are " + ", ".join(OBJECTIVES))
    if name in _AT_PEAK:
        return lambda values: _of_peak(name, observe, unknowns, values)
    if observe and not _OF_POINT[name][0]:
        raise InputError(f"{name}: is not of an observed quantity; write it without [{observe}]")
    return lambda values: _of_point(name, observe, unknowns, values)


def _of_peak(name: str, observe: str | None, unknowns: Unknowns, values: Floats) -> Evaluation:
    quantity, peak_of, factor, _ = _AT_PEAK[name]
    found = peak_values(unknowns.case_at(values), unknowns.keys, peak_of,
                        () if quantity == peak_of else (quantity,), observe)
    return Evaluation(values, factor * found.value[quantity],
                      factor * unknowns.chain(found.derivative[quantity]), found.omega,
                      found.solved, found.remarks)


def _of_point(name: str, observe: str | None, unknowns: Unknowns, values: Floats) -> Evaluation:
    case = differentiated(unknowns.case_at(values), unknowns.keys, [name])
    result = run(case, in_memory=True)
    found = result.sensitivities
    row: tuple[int, ...] = (0, result.index(observe)) if _OF_POINT[name][0] else (0,)
    by_key = {key: array[row] for key, array in found[name].items()}
    return Evaluation(values, float(found.value[name][row]), unknowns.chain(by_key), np.nan,
                      result.n_points, tuple(result.remarks))


def _of_cost(cost: Cost, unknowns: Unknowns, values: Floats) -> Evaluation:
    result = run(differentiated(unknowns.case_at(values), unknowns.keys, []), in_memory=True)
    found = result.sensitivities
    value, weights = cost(found)
    gradient = np.zeros(len(values))
    for quantity, weight in weights.items():
        gradient += unknowns.chain({key: _contracted(quantity, weight, array)
                                    for key, array in found[quantity].items()})
    if not np.isfinite(value) or not np.isfinite(gradient).all():
        raise InputError(f"the objective is {value:g} with derivatives {gradient.tolist()}: must "
                         "be finite")
    return Evaluation(values, float(value), gradient, np.nan, result.n_points,
                      tuple(result.remarks))


def _contracted(quantity: str, weight: Sequence[float] | Floats, array: Floats) -> Floats:
    """Sum over the points (and observed quantities) of a weight times a derivative."""
    weight = np.asarray(weight, dtype=float)
    if weight.shape != array.shape[:weight.ndim] or array.ndim - weight.ndim > 1:
        raise InputError(f"the derivatives by {quantity} have the shape {weight.shape}, which is "
                         "not that of the quantity")
    return np.tensordot(weight, array, axes=weight.ndim)
