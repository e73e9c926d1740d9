"""Laws of one's own: functions of displacements and velocities, as elements of a model."""

from __future__ import annotations

import ctypes
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array, text
from .errors import InputError

__all__ = ["Law"]

Floats = NDArray[np.float64]
#: Bits of fretwear.h.
ODD, NO_DERIVATIVE = 1, 4


class _Call(ctypes.Structure):
    """struct fw_law_call of fretwear.h."""

    _fields_ = [("size", ctypes.c_size_t), ("n_time", ctypes.c_int), ("n_in", ctypes.c_int),
                ("n_state", ctypes.c_int), ("n_parameters", ctypes.c_int),
                ("wants_derivative", ctypes.c_int), ("omega", ctypes.c_double),
                ("tau", ctypes.POINTER(ctypes.c_double)), ("u", ctypes.POINTER(ctypes.c_double)),
                ("v", ctypes.POINTER(ctypes.c_double)),
                ("parameters", ctypes.POINTER(ctypes.c_double))]


_DOUBLES = ctypes.POINTER(ctypes.c_double)
_FORCE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(_Call), _DOUBLES, _DOUBLES,
                          _DOUBLES)
_STEP = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(_Call), _DOUBLES, _DOUBLES,
                         _DOUBLES, _DOUBLES, _DOUBLES)


@dataclass(frozen=True)
class Law:
    """An element whose forces a function gives.

    Parameters
    ----------
    function : callable
        ``function(u, v, t, omega)`` returns the forces (n_time, n_in), on the side of the
        stiffness, of displacements u and velocities v (n_time, n_in) at the times t (n_time,).
        With `parameters` it is called with these as the last argument. None: there is no force for
        this motion, and the step is taken back. An exception ends the run and is raised again.
    side_1, side_2 : int or sequence of int
        Signed dofs, counted from 1, of each input; side_2 is the ground, 0, by default.
    parameters : sequence of float
        Constants that are handed on.
    derivative : callable, optional
        With the same arguments, returns the slopes by u and by v, (n_time, n_in, n_in) each:
        ``du[t, i, j]`` of force i by u_j. Without it, differences stand for them.
    states : sequence of float, optional
        Of a law that remembers: its states in the unstrained element. Then the function is a step,
        ``function(state, u, v, t, omega)`` with u and v (2, n_in) and t (2,) at both ends, which
        returns the state and the forces (n_in,) at the end. `derivative` returns, with the same
        arguments, the slopes of the state by (state, u, v before, u, v after),
        (n_states, n_states + 4 n_in), and of the forces by (state after, u, v after),
        (n_in, n_states + 2 n_in).
    odd : bool
        Opposite motions have opposite forces: odd harmonics suffice where loads are odd too.
    name : str
        For messages; that of the function by default.
    """

    function: Callable[..., Any]
    side_1: int | Sequence[int]
    side_2: int | Sequence[int] = 0
    parameters: ArrayLike = ()
    derivative: Callable[..., Any] | None = None
    states: ArrayLike = ()
    odd: bool = False
    name: str = ""

    def checked(self, number: int, n_dof: int) -> BoundLaw:
        """The law of a model with n_dof dofs, ready to be called by the library."""
        where = f"laws[{number}]"
        for argument, value in (("function", self.function), ("derivative", self.derivative)):
            if not (callable(value) or (value is None and argument == "derivative")):
                raise InputError(f"{where}.{argument}: is a {type(value).__name__}, must be a "
                                 "function")
        side_1 = _sides(f"{where}.side_1", self.side_1, n_dof)
        side_2 = _sides(f"{where}.side_2", self.side_2, n_dof)
        if side_2.shape == (1,):
            side_2 = np.repeat(side_2, len(side_1))
        if side_1.shape != side_2.shape or not len(side_1):
            raise InputError(f"{where}.side_2: has {len(side_2)} dofs, must be {len(side_1)} as "
                             "side_1, at least one")
        constants = np.atleast_1d(np.asarray(self.parameters, dtype=float)).ravel()
        array(f"{where}.parameters", constants, constants.shape)
        start = np.atleast_1d(np.asarray(self.states, dtype=float)).ravel()
        array(f"{where}.states", start, start.shape)
        name = self.name or getattr(self.function, "__name__", "law")
        return BoundLaw(self, text(f"{where}.name", name), side_1, side_2, constants,
                        start)


def _sides(name: str, sides: int | Sequence[int], n_dof: int) -> NDArray[np.int32]:
    found = np.atleast_1d(np.asarray(sides))
    if found.ndim != 1 or found.dtype.kind not in "iu" or np.abs(found).max(initial=0) > n_dof:
        raise InputError(f"{name}: must be dof numbers from -{n_dof} to {n_dof}")
    return found.astype(np.int32)


class BoundLaw:
    """A law with the function that the library calls; keeps what it raised."""

    def __init__(self, law: Law, name: str, side_1: NDArray[np.int32], side_2: NDArray[np.int32],
                 parameters: Floats, start: Floats) -> None:
        self.law, self.name, self.side_1, self.side_2 = law, name, side_1, side_2
        self.parameters, self.start = parameters, start
        self.flags = (ODD if law.odd else 0) | (NO_DERIVATIVE if law.derivative is None else 0)
        self._takes_parameters = len(parameters) > 0 or _names(law.function) > 4 + (
            len(start) > 0)
        self.raised: BaseException | None = None
        self._function: Any = _STEP(self._step) if len(start) else _FORCE(self._answer)

    def __reduce__(self) -> tuple[Any, ...]:
        # A process of its own needs a function of its own.
        return (BoundLaw, (self.law, self.name, self.side_1, self.side_2, self.parameters,
                           self.start))

    @property
    def address(self) -> int:
        """Where the library finds the function."""
        return int(ctypes.cast(self._function, ctypes.c_void_p).value or 0)

    def _answer(self, _: Any, call: Any, force: Any, by_u: Any, by_v: Any) -> int:
        try:
            return self._try(call.contents, force, by_u, by_v)
        except BaseException as error:
            # Raised again where the run was asked for: nothing passes through the library.
            self.raised = error
            return 1

    def _step(self, _: Any, call: Any, state: Any, after: Any, force: Any, by_state: Any,
              by_force: Any) -> int:
        try:
            return self._try_step(call.contents, state, after, force, by_state, by_force)
        except BaseException as error:
            self.raised = error
            return 1

    def _try_step(self, call: Any, state: Any, after: Any, force: Any, by_state: Any,
                  by_force: Any) -> int:
        n, m = call.n_state, call.n_in
        tau = np.ctypeslib.as_array(call.tau, (2,))
        arguments: tuple[Any, ...] = (
            np.ctypeslib.as_array(state, (n,)).copy(), _shown(call.u, (2, m)),
            _shown(call.v, (2, m)), tau / call.omega if call.omega > 0.0 else tau, call.omega)
        if self._takes_parameters:
            arguments += (self.parameters.copy(),)
        found = self.law.function(*arguments)
        if found is None:
            return -1
        new, forces = found
        np.ctypeslib.as_array(after, (n,))[...] = _shaped(f"{self.name}, state", new, (n,))
        np.ctypeslib.as_array(force, (m,))[...] = _shaped(self.name, forces, (m,))
        if not call.wants_derivative or self.law.derivative is None:
            return 0
        shapes = (n, n + 4 * m), (m, n + 2 * m)
        slopes = self._two(self.law.derivative(*arguments))
        for target, slope, shape in zip((by_state, by_force), slopes, shapes):
            np.ctypeslib.as_array(target, shape)[...] = _shaped(f"{self.name}, derivative", slope,
                                                                shape)
        return 0

    def _try(self, call: Any, force: Any, by_u: Any, by_v: Any) -> int:
        shape = (call.n_time, call.n_in)
        tau = np.ctypeslib.as_array(call.tau, (call.n_time,))
        u, v = _shown(call.u, shape), _shown(call.v, shape)
        t = tau / call.omega if call.omega > 0.0 else tau
        arguments: tuple[Any, ...] = (u, v, t, call.omega)
        if self._takes_parameters:
            arguments += (self.parameters.copy(),)
        found = self.law.function(*arguments)
        if found is None:
            return -1
        np.ctypeslib.as_array(force, shape)[...] = _shaped(self.name, found, shape)
        if not call.wants_derivative or self.law.derivative is None:
            return 0
        slopes = self._two(self.law.derivative(*arguments))
        for target, slope in zip((by_u, by_v), slopes):
            np.ctypeslib.as_array(target, (*shape, call.n_in))[...] = _shaped(
                f"{self.name}, derivative", slope, (*shape, call.n_in))
        return 0

    def _two(self, slopes: Any) -> tuple[Any, Any]:
        """What a derivative returned, as two."""
        if not isinstance(slopes, (tuple, list)) or len(slopes) != 2:
            raise InputError(f"law {self.name}, derivative: returned a {type(slopes).__name__}, "
                             "must be two arrays")
        return slopes[0], slopes[1]


def _shown(pointer: Any, shape: tuple[int, ...]) -> Floats:
    """Numbers of the library, which a function may read and not write."""
    values: Floats = np.ctypeslib.as_array(pointer, shape)
    values.flags.writeable = False
    return values


def _shaped(name: str, found: Any, shape: tuple[int, ...]) -> Floats:
    values = np.asanyarray(found)
    if values.dtype.kind not in "fiub" or isinstance(values, np.ma.MaskedArray):
        raise InputError(f"law {name}: returned {values.dtype} in a {type(found).__name__}, must "
                         "be real numbers")
    values = np.asarray(values, dtype=float)
    if values.shape != shape:
        # Of one input the last ones may be left out.
        if shape[-1] == 1 and values.shape in ((), shape[:1]):
            return np.broadcast_to(values, shape[:1]).reshape(shape)
        if values.shape != ():
            raise InputError(f"law {name}: returned an array of shape {values.shape}, must be "
                             f"{shape}")
    return np.broadcast_to(values, shape)


def _names(function: Callable[..., Any]) -> int:
    """How many arguments a function names."""
    try:
        return len(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        return 0
