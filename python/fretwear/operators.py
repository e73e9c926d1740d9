"""Operators of the library for post-processing and for methods of one's own.

Arrays are Fortran-ordered: such arrays of the right type pass without a copy, others are converted
first. Every function takes an optional `out` to write into. Harmonic coefficients come in the order
(0, c1, s1, c2, s2, ...), or (c1, s1, c3, s3, ...) where only odd harmonics are kept; the complex
amplitude of harmonic n is ``c_n - i s_n``. Instants are ``tau_k = 2 pi k / n_time``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array, dofs, flag, output, whole
from ._native import functions, raise_status
from .errors import InputError

__all__ = ["ContactForces", "amplitude", "coefficient_count", "condense", "contact_forces",
           "differentiate", "dynamic_stiffness", "harmonic_operators", "recover",
           "to_coefficients", "to_time"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

#: As for the keys n_harmonics and n_time of a case.
_MOST_HARMONICS, _MOST_INSTANTS = 10000, 1000000


def coefficient_count(n_harmonics: int, odd_only: bool = False) -> int:
    """Coefficients of the harmonics 0..H: 2H+1; of the odd ones up to H: 2 ceil(H/2)."""
    whole("n_harmonics", n_harmonics, 1, _MOST_HARMONICS)
    return 2 * ((n_harmonics + 1) // 2) if flag("odd_only", odd_only) else 2 * n_harmonics + 1


def harmonic_operators(n_harmonics: int, n_time: int, *,
                       odd_only: bool = False) -> tuple[Floats, Floats]:
    """Values of the base functions at the instants, and the weights of the projection.

    ``u(tau) = coefficients @ synthesis``, ``coefficients = u(tau) @ analysis.T``.

    Parameters
    ----------
    n_harmonics, n_time : int
        H, and the instants per period, at least 2H+1.
    odd_only : bool, optional
        Odd harmonics only.

    Returns
    -------
    synthesis, analysis : (n_coefficients, n_time)
        Fortran-ordered.
    """
    n_coefficients = coefficient_count(n_harmonics, odd_only)
    whole("n_time", n_time, 2 * n_harmonics + 1, _MOST_INSTANTS)
    synthesis = output("synthesis", None, (n_coefficients, n_time))
    analysis = output("analysis", None, (n_coefficients, n_time))
    functions().harmonic_operators(n_harmonics, odd_only, synthesis, analysis)
    return synthesis, analysis


def to_time(coefficients: ArrayLike, n_time: int, *, odd_only: bool = False,
            out: Floats | None = None) -> Floats:
    """Time histories over one period from coefficients.

    Parameters
    ----------
    coefficients : (n_rows, n_coefficients)
        Of any quantities, one per row.
    n_time : int
        Instants, at least 2H+1.
    odd_only : bool, optional
        The coefficients are of odd harmonics only.
    out : (n_rows, n_time), optional
        Array to write into.

    Returns
    -------
    (n_rows, n_time)
    """
    given = array("coefficients", coefficients, (None, None))
    n_harmonics = _harmonics_of("coefficients", given.shape[1], odd_only)
    whole("n_time", n_time, 2 * n_harmonics + 1, _MOST_INSTANTS)
    values = output("out", out, (given.shape[0], n_time))
    functions().to_time(n_harmonics, odd_only, given, values)
    return values


def to_coefficients(values: ArrayLike, n_harmonics: int, *, odd_only: bool = False,
                    out: Floats | None = None) -> Floats:
    """Coefficients of time histories over one period: their projection.

    Parameters
    ----------
    values : (n_rows, n_time)
        Values at the instants; n_time at least 2H+1.
    n_harmonics : int
        H.
    odd_only : bool, optional
        Coefficients of odd harmonics only.
    out : (n_rows, n_coefficients), optional
        Array to write into.

    Returns
    -------
    (n_rows, n_coefficients)
    """
    n_coefficients = coefficient_count(n_harmonics, odd_only)
    given = array("values", values, (None, None))
    whole("n_time, the second length of values,", given.shape[1], 2 * n_harmonics + 1)
    coefficients = output("out", out, (given.shape[0], n_coefficients))
    functions().to_coefficients(n_harmonics, odd_only, given, coefficients)
    return coefficients


def differentiate(coefficients: ArrayLike, *, odd_only: bool = False,
                  out: Floats | None = None) -> Floats:
    """Coefficients of du/dtau from those of u; velocities are omega times that.

    Parameters
    ----------
    coefficients, out : (n_rows, n_coefficients)
        See `to_time`.

    Returns
    -------
    (n_rows, n_coefficients)
    """
    given = array("coefficients", coefficients, (None, None))
    n_harmonics = _harmonics_of("coefficients", given.shape[1], odd_only)
    derivative = output("out", out, given.shape)
    functions().differentiate(n_harmonics, odd_only, given, derivative)
    return derivative


def amplitude(coefficients: ArrayLike, *, out: Floats | None = None) -> Floats:
    """Largest magnitude over the period, static part included, as in a result file.

    Parameters
    ----------
    coefficients : (n_rows, 2H+1)
        Of all harmonics.
    out : (n_rows,), optional
        Array to write into.

    Returns
    -------
    (n_rows,)
    """
    given = array("coefficients", coefficients, (None, None))
    _harmonics_of("coefficients", given.shape[1], False)
    largest = output("out", out, (given.shape[0],))
    functions().amplitudes(given, largest)
    return largest


def dynamic_stiffness(M: ArrayLike, C: ArrayLike | None, K: ArrayLike, omega: float,
                      harmonics: Sequence[int] = (1,), *,
                      out: Complexes | None = None) -> Complexes:
    """``Z_n = K - (n omega)^2 M + i n omega C`` for each harmonic n.

    Parameters
    ----------
    M, C, K : (n_dof, n_dof)
        Mass, damping (None for none) and stiffness.
    omega : float
        Frequency [rad/s].
    harmonics : sequence of int, optional
        Harmonics n.
    out : (n_dof, n_dof, n_harmonics) complex, optional
        Array to write into.

    Returns
    -------
    (n_dof, n_dof, n_harmonics) complex
    """
    mass, damping, stiffness = _matrices(M, C, K)
    numbers = _numbers(harmonics)
    z = output("out", out, (*stiffness.shape, len(numbers)), np.complex128)
    functions().dynamic_stiffness(mass, damping, stiffness, numbers, _frequency(omega), z)
    return z


def condense(M: ArrayLike, C: ArrayLike | None, K: ArrayLike, side_1: ArrayLike, side_2: ArrayLike,
             omega: float, harmonics: Sequence[int] = (1,), *, static: ArrayLike | None = None,
             cosine: ArrayLike | None = None,
             sine: ArrayLike | None = None) -> tuple[Complexes, Complexes]:
    """Condense a structure to relative displacements ``q = u(side_1) - u(side_2)``.

    ``Z_r q + lambda = F_r`` with ``Z_r = (B Z^-1 B^T)^-1``, ``F_r = Z_r B Z^-1 F``, evaluated
    through the modes of the structure with q held, so that mass and stiffness may be singular.

    Parameters
    ----------
    M, C, K : (n_dof, n_dof)
        Mass, damping (None for none) and stiffness, symmetric.
    side_1, side_2 : (n_rows,) int
        Signed dof numbers, counted from 1; 0 is the ground. The rows must be independent.
    omega : float
        Frequency [rad/s].
    harmonics : sequence of int, optional
        Harmonics n.
    static, cosine, sine : (n_dof,), optional
        Loads [force]: harmonic 0 gets the first, harmonic 1 the others.

    Returns
    -------
    stiffness : (n_rows, n_rows, n_harmonics) complex
    load : (n_rows, n_harmonics) complex

    Raises
    ------
    InputError
        Also at an undamped natural frequency of the structure with q held, where Z_r has a pole.
    """
    problem = _Condensation(M, C, K, side_1, side_2, omega, harmonics, static, cosine, sine)
    n_rows, n_harmonics = len(problem.side_1), len(problem.harmonics)
    stiffness = output("stiffness", None, (n_rows, n_rows, n_harmonics), np.complex128)
    load = output("load", None, (n_rows, n_harmonics), np.complex128)
    problem.call(functions().condense, stiffness, load)
    return stiffness, load


def recover(M: ArrayLike, C: ArrayLike | None, K: ArrayLike, side_1: ArrayLike, side_2: ArrayLike,
            omega: float, q: ArrayLike, harmonics: Sequence[int] = (1,), *,
            static: ArrayLike | None = None, cosine: ArrayLike | None = None,
            sine: ArrayLike | None = None, out: Complexes | None = None) -> Complexes:
    """All displacements from the relative ones: ``u = Z^-1 (F - B^T lambda)``.

    Parameters
    ----------
    M, C, K, side_1, side_2, omega, harmonics, static, cosine, sine
        See `condense`.
    q : (n_rows, n_harmonics) complex
        Relative displacements [length].
    out : (n_dof, n_harmonics) complex, optional
        Array to write into.

    Returns
    -------
    (n_dof, n_harmonics) complex
    """
    problem = _Condensation(M, C, K, side_1, side_2, omega, harmonics, static, cosine, sine)
    n_rows, n_harmonics = len(problem.side_1), len(problem.harmonics)
    given = array("q", q, (n_rows, n_harmonics), dtype=np.complex128)
    u = output("out", out, (len(problem.stiffness), n_harmonics), np.complex128)
    problem.call(functions().recover, given, u)
    return u


class _Condensation:
    """Checked arguments of `condense` and `recover`."""

    def __init__(self, M: ArrayLike, C: ArrayLike | None, K: ArrayLike, side_1: ArrayLike,
                 side_2: ArrayLike, omega: float, harmonics: Sequence[int],
                 static: ArrayLike | None, cosine: ArrayLike | None,
                 sine: ArrayLike | None) -> None:
        self.mass, self.damping, self.stiffness = _matrices(M, C, K)
        n = len(self.stiffness)
        self.load = np.zeros((n, 3), order="F")
        for column, (name, part) in enumerate(
                (("static", static), ("cosine", cosine), ("sine", sine))):
            if part is not None:
                self.load[:, column] = array(name, part, (n,))
        self.side_1 = dofs("side_1", side_1, (None,), n)
        self.side_2 = dofs("side_2", side_2, (len(self.side_1),), n)
        same = np.flatnonzero(self.side_1 == self.side_2)
        if len(same):
            raise InputError(f"side_1[{same[0]}]: joins dof {self.side_1[same[0]]} to itself")
        self.harmonics = _numbers(harmonics)
        self.omega = _frequency(omega)

    def call(self, routine: Any, *arrays: Complexes) -> None:
        status, message = routine(self.mass, self.damping, self.stiffness, self.load, self.side_1,
                                  self.side_2, self.harmonics, self.omega, *arrays)
        raise_status(status, message.decode().strip())


@dataclass(frozen=True)
class ContactForces:
    """What `contact_forces` returns.

    Attributes
    ----------
    force : (n_pairs, 3, n_coefficients)
        Coefficients of the contact forces [force].
    force_time : (n_pairs, 3, n_time)
        The same at the instants.
    finish : (n_pairs, 2)
        Where the march ends: corrected tangential position times the prediction stiffness.
    state : (n_pairs,) int
        1 stuck and closed, 2 open, at every instant of every turn; 3 anything else.
    fraction : (n_pairs, 3)
        Shares of the period in stick, slip and open.
    periodic : bool
        Whether every march repeats from period to period.
    jacobian : (n_pairs, 3, n_coefficients, 3, n_coefficients) or None
        Derivative of `force` (first two, after the pair) by the prediction (last two).
    """

    force: Floats
    force_time: Floats
    finish: Floats
    state: NDArray[np.int32]
    fraction: Floats
    periodic: bool
    jacobian: Floats | None = None


def contact_forces(prediction: ArrayLike, mu: ArrayLike, n_time: int, *,
                   offset: ArrayLike | None = None, start: ArrayLike | None = None,
                   present: ArrayLike | None = None, remembers: bool = True,
                   odd_only: bool = False, jacobian: bool = False) -> ContactForces:
    """Contact forces over a period from predicted ones: the correction of the DLFT.

    At every instant the prediction is brought back to the friction cone, from where the march has
    come: stick, slip or open. For the rigid law the prediction is
    ``F_r - Z_r q + eps (q + gap)``, for the elastic one ``k (q + gap)``.

    Parameters
    ----------
    prediction : (n_pairs, 3, n_coefficients)
        Coefficients of the predicted forces along (t1, t2, n), compression negative [force].
    mu : float or (n_pairs,)
        Friction coefficient [-].
    n_time : int
        Instants, at least 2H+1.
    offset : float or (n_pairs,), optional
        Added to the predicted normal force: stiffness times gap, or minus the preload.
    start : (n_pairs, 2), optional
        Where the march starts, see `ContactForces.finish`; 0 without it, the unstrained assembly.
    present : (n_pairs, 3) bool, optional
        Directions that a pair has; all without it.
    remembers : bool, optional
        False for the law on velocities ('dlft_velocity'), which projects without a march.
    odd_only : bool, optional
        The coefficients are of odd harmonics only.
    jacobian : bool, optional
        Compute the derivative too.

    Returns
    -------
    ContactForces
    """
    given = array("prediction", prediction, (None, 3, None))
    n_pairs, _, n_coefficients = given.shape
    if n_pairs == 0:
        raise InputError("prediction: holds no pair")
    n_harmonics = _harmonics_of("prediction", n_coefficients, odd_only)
    whole("n_time", n_time, 2 * n_harmonics + 1, _MOST_INSTANTS)
    flag("remembers", remembers)
    flag("jacobian", jacobian)
    friction = array("mu", mu, (n_pairs,))
    if (friction < 0.0).any():
        raise InputError(f"mu[{int(np.argmax(friction < 0.0))}]: is negative")
    force = output("force", None, given.shape)
    force_time = output("force_time", None, (n_pairs, 3, n_time))
    finish = output("finish", None, (n_pairs, 2))
    state = np.zeros(n_pairs, dtype=np.int32)
    fraction = output("fraction", None, (3, n_pairs))
    size = (3 * n_coefficients, 3 * n_coefficients, n_pairs) if jacobian else (1, 1, 1)
    slopes = output("jacobian", None, size)
    periodic = functions().contact_forces(
        n_harmonics, odd_only, remembers, friction, _present(present, n_pairs),
        array("offset", 0.0 if offset is None else offset, (n_pairs,)),
        array("start", np.zeros((n_pairs, 2)) if start is None else start, (n_pairs, 2)),
        given, force, force_time, finish, state, fraction, jacobian, slopes)
    blocks = (n_pairs, 3, n_coefficients, 3, n_coefficients)
    return ContactForces(force, force_time, finish, state, fraction.T, bool(periodic),
                         slopes.T.reshape(blocks) if jacobian else None)


def _present(present: ArrayLike | None, n_pairs: int) -> NDArray[np.int32]:
    """Directions as the library takes them: integers, (3, n_pairs)."""
    flags = np.ones((n_pairs, 3), dtype=bool) if present is None else np.asarray(present)
    if flags.dtype != bool or flags.shape != (n_pairs, 3):
        raise InputError(f"present: must be truth values of shape ({n_pairs}, 3)")
    return np.asfortranarray(flags.T, dtype=np.int32)


def _matrices(M: ArrayLike, C: ArrayLike | None,
              K: ArrayLike) -> tuple[Floats, Floats, Floats]:
    stiffness = array("K", K, (None, None))
    square = (len(stiffness), len(stiffness))
    array("K", stiffness, square)
    return (array("M", M, square), array("C", np.zeros(square) if C is None else C, square),
            stiffness)


def _numbers(harmonics: Sequence[int]) -> NDArray[np.int32]:
    numbers = np.asarray(harmonics)
    if numbers.ndim != 1 or numbers.size == 0 or numbers.dtype.kind not in "iu" or (
            (numbers < 0) | (numbers > _MOST_HARMONICS)).any():
        raise InputError(f"harmonics: is {harmonics!r}, must be a list of integers from 0 to "
                         f"{_MOST_HARMONICS}")
    return np.asarray(numbers, dtype=np.int32)


def _frequency(omega: float) -> float:
    value = float(array("omega", omega, ()))
    if value <= 0.0:
        raise InputError(f"omega = {value}: must be a frequency above 0 [rad/s]")
    return value


def _harmonics_of(name: str, n_coefficients: int, odd_only: bool) -> int:
    """H from the number of coefficients."""
    if flag("odd_only", odd_only):
        if n_coefficients < 2 or n_coefficients % 2 == 1:
            raise InputError(f"{name}: has {n_coefficients} coefficients, must have 2 for each "
                             "odd harmonic")
        return n_coefficients - 1
    if n_coefficients < 3 or n_coefficients % 2 == 0:
        raise InputError(f"{name}: has {n_coefficients} coefficients, must have 2H+1")
    return (n_coefficients - 1) // 2
