"""One period of the contact: what the law gives at the instants, never a sum of harmonics.

The contact force of a pair that slips or opens has kinks and jumps; the sum of a few harmonics
overshoots them and shows tension or more than the friction limit, which no law gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._native import namelist_values, tolerance_of
from ._progress import CONTROL
from .errors import AbsentError, FretwearError
from .steps import Point, Steps

if TYPE_CHECKING:
    from .result import Result

__all__ = ["Cycle", "read_cycle", "read_peak_cycle", "run_again"]

Floats = NDArray[np.float64]

#: Under an accuracy, the tail of the contact forces corrects an answer by no more than this.
#: The period that is shown is the one before it, in which forces and motion belong together.
_CORRECTION = 0.03
_RIGID_WORDS = ("dlft", "dlft_velocity")
#: Largest difference of a point that is solved again, over the largest value, and in multiples of
#: the tolerance of the solver: a solution known to this tolerance is off by it times the condition
#: of the problem, and another solution is far away. The greater one holds.
_SAME, _SAME_OF_SOLVER = 1e-6, 1e3
#: Instants of a period where the law may be asked at any.
_INSTANTS = 256
#: Points before the one in question from which its solution is followed, where it does not come
#: out by itself; after that, all.
_BEFORE = 10
#: Values of histories that a run may hold to show a point.
_MOST = 50_000_000


@dataclass(frozen=True)
class Cycle:
    """One period of the contact, closed: the last instant repeats the first.

    Attributes
    ----------
    degrees : (n_time + 1,)
        Phase of the excitation [degrees].
    displacement, force : (n_time + 1, n_pairs, 3)
        Relative displacement [length] and contact force [force] in (t1, t2, n), as the law gives
        them.
    pairs : (n_pairs,)
        Which pairs these are, from 0: all, but at the peak.
    frequency : float
        [Hz]
    """

    degrees: Floats
    displacement: Floats
    force: Floats
    pairs: NDArray[np.int64]
    frequency: float


def read_peak_cycle(result: Result) -> Cycle:
    """One period at the highest peak of the pairs that dissipate most; see `Result.peak_cycle`."""
    omega = result["peak/cycle/omega"]
    return _closed(result["peak/cycle/relative_displacement"], result["peak/cycle/force"],
                   float(omega[0]), result["peak/cycle/pair"])


def read_cycle(result: Result, point: int) -> Cycle:
    """One period at a point (from 0); see `Result.cycle`."""
    if "history/force" in result:
        displacement = result["history/relative_displacement"][point]
        force = result["history/force"][point]
        if np.isfinite(force).all():
            return _closed(displacement, force, result.omega[point])
    if not result.converged[point]:
        raise AbsentError(f"{result.name}: point {point + 1} has not converged: it has no period "
                          "to show")
    result.declared("contact/force")
    try:
        solved = _again(result, point)
    except AbsentError:
        raise
    except FretwearError as error:
        raise AbsentError(_excuse(result, point, str(error))) from None
    return _closed(solved["history/relative_displacement"], solved["history/force"],
                   result.omega[point])


def _closed(displacement: Floats, force: Floats, omega: float,
            pairs: NDArray[np.int64] | None = None) -> Cycle:
    return Cycle(np.linspace(0.0, 360.0, len(force) + 1),
                 np.concatenate((displacement, displacement[:1])),
                 np.concatenate((force, force[:1])),
                 np.arange(force.shape[1]) if pairs is None else pairs,
                 omega / (2.0 * np.pi))


def _excuse(result: Result, point: int, why: str) -> str:
    return (f"{result.name}: point {point + 1} holds no histories, and the law cannot be evaluated "
            f"there again ({why}); run with output%histories = .true.")


def _again(result: Result, point: int) -> Point:
    """The same solution with its histories, or the reason why it cannot be had."""
    values = namelist_values(result.namelist)
    if values.get("case%analysis") == ["time"]:
        raise AbsentError(_excuse(result, point, "integration in time has no harmonic balance to "
                                  "solve"))
    if values.get("case%analysis") == ["resonance"]:
        raise AbsentError(f"{result.name}: a resonance over a parameter keeps no histories: run "
                          "a point at the value of the parameter")
    if values.get("case%analysis") == ["mode"]:
        raise AbsentError(f"{result.name}: a nonlinear mode keeps no histories, and as a response "
                          "to a load it would be another motion")
    tolerance = tolerance_of(values)
    settings = _settings(result, point)
    if "contact%law" in values:
        # Left to the program, histories would ask for another one.
        settings["contact"] = {"law": _words(values), **settings.get("contact", {})}
    finer = {**settings, "harmonics": {**settings["harmonics"], "n_time": _INSTANTS}}
    # Located events are exact whatever the instants, in one tangential direction.
    by_events = result.attributes.get("sampling") == "events"
    tried = [(finer, point)] if by_events else []
    tried += [(settings, point), (settings, max(0, point - _BEFORE))]
    is_sweep = values.get("sweep%continuation", ["natural"]) == ["natural"]
    if is_sweep and point > _BEFORE:
        # Of several solutions the way from the first row leads to that of the row.
        tried.append((settings, 0))
    if "error_estimate" in result and _words(values, "dlft") in _RIGID_WORDS:
        # Under an accuracy, friction in one direction is solved as by the law of high order.
        rigid = {**finer, "contact": {**settings.get("contact", {}), "law": "rigid"}}
        tried.insert(0, (rigid, point))
    for groups, first in tried:
        with Steps(result.case.replace(**groups)) as steps:
            for before in range(first, point):
                steps.solve(result.omega[before])
            solved = steps.solve(result.omega[point])
        if _is_same(result, point, solved, tolerance, "error_estimate" in result):
            return solved
    if not is_sweep and "wear/depth" not in result:
        return _of_run(run_again(result), point)
    raise AbsentError(_excuse(result, point, "solving it again leads to another solution"))


def _words(values: dict[str, list[str]], absent: str = "") -> str | list[str]:
    """The law of all pairs, or that of each."""
    words = values.get("contact%law", [absent])
    return words if len(words) > 1 else words[0]


def _of_run(known: Result, point: int) -> Point:
    names = ("history/relative_displacement", "history/force")
    return Point({name: known[name][point] for name in names})


def run_again(result: Result) -> Result:
    """The run once more, with histories; it has to come out as it stands in the result.

    Raises
    ------
    FretwearError
        It is another solution, or its histories are too many.
    """
    size = result.n_points * max(result.n_pairs, 1) * int(result.attributes.get("n_time", 1024))
    if size > _MOST:
        raise FretwearError(f"{size} values of histories are too many; run with output%histories "
                            "= .true., or fewer points")
    groups: Any = {"output": {"histories": True}}
    values = namelist_values(result.namelist)
    # Left to the program, histories would ask for another law, and for instants.
    if "contact%law" in values:
        groups["contact"] = {"law": _words(values)}
    if "sampling" in result.attributes:
        groups["harmonics"] = {"sampling": result.attributes["sampling"]}
    case = result.case.replace(**groups)
    with case.open() as session:
        session.run(np.zeros(CONTROL, dtype=np.int64), in_memory=True)
        known = type(result).of_run(case, session.text("output"), session.image())
    tolerance = tolerance_of(values)
    limit = max(_SAME, _SAME_OF_SOLVER * tolerance) * np.abs(result.amplitude).max()
    if known.amplitude.shape != result.amplitude.shape or (
            np.abs(known.amplitude - result.amplitude)[result.converged].max(initial=0.0) > limit):
        raise FretwearError("the case, run once more, does not give what the result holds")
    return known


def _settings(result: Result, point: int) -> dict[str, Any]:
    """What lets the case of a result be solved at one of its points, with histories.

    The bounds of the sweep stay: the numerical stiffness of rigid contact follows from them.
    """
    groups: dict[str, Any] = {
        "sweep": {"continuation": "natural", "stability": False},
        "harmonics": {"accuracy": 0.0},
        "output": {"histories": True, "contact": True}}
    if "sampling" in result.attributes:  # left to the program, histories would ask for instants
        groups["harmonics"]["sampling"] = result.attributes["sampling"]
    if "harmonics" in result:
        groups["harmonics"]["n_harmonics"] = int(result["harmonics"][point])
    if "instants" in result and result["instants"][point] > 0:
        groups["harmonics"]["n_time"] = int(result["instants"][point])
    if "wear/depth" in result:
        groups["case"] = {"analysis": "point"}
        if len(result.depth) != result.n_points:
            raise AbsentError(_excuse(result, point, "the worn depth of the point is not known"))
        with result.case.open() as session:
            gap, before = session.part("contact/gap"), session.part("contact/depth")
        # A worn pair acts like one of a larger gap; the case begins with the depth before.
        worn = result.depth[point] - (before if before.size else 0.0)
        groups["contact"] = {"gap": gap + worn}
    return groups


def _is_same(result: Result, point: int, solved: Point, tolerance: float,
             corrected: bool) -> bool:
    """Whether a solution is that of a point, where it may have been `corrected` by its tail."""
    if not solved.converged:
        return False
    limit = max(_SAME, _SAME_OF_SOLVER * tolerance, _CORRECTION if corrected else 0.0)
    for name, stored in (("coefficients", result.coefficients[point]),
                         ("contact/force", result.force[point])):
        found = np.zeros_like(stored)
        found[:len(solved[name])] = solved[name][:len(stored)]
        known = slice(len(solved[name])) if corrected else slice(None)
        if np.abs(found - stored)[known].max() > limit * np.abs(stored).max():
            return False
    return True
