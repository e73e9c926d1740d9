"""Runs of the library in this process."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from numpy.typing import ArrayLike

from ._native import NOT_CONVERGED, STOPPED, raise_status
from ._watching import Progress, Stop, run_watched, stop_function, stop_reason, teller
from .case import Case, ModelLike
from .errors import ConvergenceError, InputError, RunInterrupted, RunStopped
from .result import Result

if TYPE_CHECKING:
    from typing import Literal

    from .settings import CaseGroup, Groups, Mode, Sweep, Wear

    if sys.version_info >= (3, 11):
        from typing import Unpack
    else:
        from typing_extensions import Unpack

__all__ = ["frf", "mode", "resonance", "run", "wear"]


def run(case: Case | str | Path, file: str | Path | None = None, *, check: bool = True,
        progress: Progress | None = None, stop: Stop | None = None,
        max_seconds: float | None = None, in_memory: bool = False,
        workers: int | None = None, scheduler: str = "threads",
        restart: str | Path | None = None) -> Result:
    """Run a case and open its result.

    The library computes in this process with the interpreter lock released; the numbers are those
    of `fw_run`, to the last digit. Ctrl-C stops the run, within a point too, and keeps the points
    that are done.

    Parameters
    ----------
    case : Case, str or Path
        The case, or the path of a namelist.
    file : str or Path, optional
        Result file. Without it: where the case says, or beside its namelist; the result of a
        model is in memory, and no file is touched (`Result.save` writes one).
    check : bool, optional
        Raise ConvergenceError where points have not converged (default).
    progress : callable, optional
        Called now and then with the points done and the points to come (0: not known); True shows
        them with frequency, amplitude and the time left (of wear with cycles and depth), in a
        notebook too.
    stop : threading.Event or callable, optional
        Set the event, in any thread, to stop the run as Ctrl-C does; a function is called about
        ten times a second, and stops the run by returning what is true.
    max_seconds : float, optional
        Stop the run after this time; the key `max_seconds` of `case` (default: no limit).
    in_memory : bool, optional
        Keep the result in memory and touch no file, whatever the case says.
    workers : int, optional
        Cut a natural sweep into as many overlapping pieces, which are solved at once and joined:
        the same rows to the tolerance, checked where pieces overlap (0: one for each core).
    scheduler : str, optional
        Who solves them: 'threads' of this process (default), 'dask' for a cluster on this machine,
        the address of a Dask scheduler, or its scheduler file (.json), with one piece for each of
        its threads by default.
    restart : str or Path, optional
        Go on with a natural sweep: take the rows of this result of the same case, also of what a
        run left that was killed (`name.h5.part`), and solve what is missing.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        The library does not accept the case; the message names group, key and value.
    OutputError
        A file cannot be read or written.
    ConvergenceError
        Points have not converged; its `result` holds all that was computed, its `report` the
        summary of the run.
    RunInterrupted
        Ctrl-C has stopped the run (a KeyboardInterrupt); its `result` holds the points up to there.
    RunStopped
        `max_seconds` or `stop` has; its `reason` says which, its `result` holds the points.
    """
    is_stopped = stop_function(stop)
    if progress is not None and not isinstance(progress, bool) and not callable(progress):
        raise InputError(f"progress: is a {type(progress).__name__}, must be True or a function of "
                         "the points done and the points to come")
    if not isinstance(case, Case):
        case = Case.from_file(case)
    if file is not None:
        case = case.replace(output={"file": os.path.abspath(file)})
    if max_seconds is not None:
        case = case.replace(case={"max_seconds": max_seconds})
    if in_memory and file is not None:
        raise InputError(f"file: is '{file}', but in_memory is set; one of the two")
    in_memory = in_memory or not case.names_output
    if workers is not None or scheduler != "threads" or restart is not None:
        from .pieces import run_in_pieces

        if workers is None:
            workers = 1 if scheduler == "threads" else 0
        result, report = run_in_pieces(case, workers, scheduler, progress, is_stopped,
                                       in_memory=in_memory, restart=restart)
        if check and result.status == "not converged":
            raise ConvergenceError(_failure(result, report), result, report)
        return result
    return _run(case, progress, is_stopped, check=check, in_memory=in_memory)


def _run(case: Case, progress: Progress | None, is_stopped: Callable[[], object] | None, *,
         check: bool, in_memory: bool) -> Result:
    with case.open() as session:
        with teller(progress, session) as tell:
            status, interrupted = run_watched(
                lambda control: session.run(control, in_memory=in_memory), tell, is_stopped)
            session.raise_of_laws()
        report = (session.text("remarks") + session.text("summary")).splitlines()
        message, path = session.text("message"), session.text("output")
        image = session.image() if in_memory else None
    if status not in (NOT_CONVERGED, STOPPED):
        raise_status(status, message)
    result = Result.of_run(case, path, image)
    if interrupted:
        raise RunInterrupted(result)
    if status == STOPPED:
        raise RunStopped(stop_reason(report), result)
    if status == NOT_CONVERGED and check:
        raise ConvergenceError(_failure(result, report), result, report)
    return result


def frf(model: ModelLike, start: float | None = None, end: float | None = None,
        n_points: int | None = None, *, values: ArrayLike | None = None,
        parameter: str | None = None, frequency: float | None = None,
        unit: Literal["rad/s", "Hz"] | None = None, file: str | Path | None = None,
        check: bool = True, progress: Progress | None = None, **groups: Unpack[Groups]) -> Result:
    """Frequency response: periodic solutions over a range of frequencies, or of a parameter.

    Parameters
    ----------
    model : Model, str or Path
        The structure, or the path of a model file.
    start, end : float
        First and last frequency [unit], or values of `parameter`; may go down.
    n_points : int, optional
        Points, evenly spaced.
    values : array_like, optional
        Frequencies, or values of `parameter`, one by one, in place of the three.
    parameter : str, optional
        What is swept in place of the frequency, such as "load%harmonic_scale" or "contact%mu".
    frequency : float, optional
        The one frequency of such a sweep [unit].
    unit : {'rad/s', 'Hz'}, optional
        Unit of the frequencies (default: rad/s).
    file, check, progress
        See `run`.
    **groups
        Further settings by group, see `Case`.

    Returns
    -------
    Result

    Raises
    ------
    InputError, OutputError, ConvergenceError, RunInterrupted
        See `run`.
    """
    given = {"start": start, "end": end, "n_points": n_points, "values": values,
             "parameter": parameter, "frequency": frequency, "unit": unit}
    sweep = cast("Sweep", {key: value for key, value in given.items() if value is not None})
    case = _case(model, {"analysis": "frf"}, sweep, groups)
    return run(case, file, check=check, progress=progress)


def wear(model: ModelLike, frequency: float, coefficient: ArrayLike,
         n_cycles: float | None = None, *,
         scheme: Literal["explicit", "implicit", "pseudo_time"] | None = None,
         unit: Literal["rad/s", "Hz"] | None = None, file: str | Path | None = None,
         check: bool = True, progress: Progress | None = None,
         **groups: Unpack[Groups]) -> Result:
    """Fretting wear of the contact pairs under vibration at one frequency.

    Parameters
    ----------
    model : Model, str or Path
        The structure, or the path of a model file; its pairs have areas.
    frequency : float
        Frequency of the excitation [unit].
    coefficient : float or array
        Archard's coefficient [length^2/force], in the units of the model; one for all pairs or one
        for each.
    n_cycles : float, optional
        Cycles of vibration; until the joint is steady without it.
    scheme : {'explicit', 'implicit', 'pseudo_time'}, optional
        How the two time scales are coupled (default: implicit).
    unit : {'rad/s', 'Hz'}, optional
        Unit of the frequency (default: rad/s).
    file, check, progress
        See `run`.
    **groups
        Further settings by group, see `Case`; such as ``wear={"max_depth_step": 1e-4}``, or
        ``mission={"n_blocks": 2, "cycles": [1e4, 1e5], "change": ["", "sweep%start = 900"],
        "n_flights": 100}`` in place of `n_cycles`.

    Returns
    -------
    Result
        With `cycles`, `depth`, `rate` and `steady_state`; one row per wear step, or per block of
        a mission.

    Raises
    ------
    InputError, OutputError, ConvergenceError, RunInterrupted
        See `run`.
    """
    sweep: Sweep = {"start": frequency}
    if unit is not None:
        sweep["unit"] = unit
    settings: Wear = {"coefficient": coefficient}
    if n_cycles is not None:
        settings["n_cycles"] = n_cycles
    if scheme is not None:
        settings["scheme"] = scheme
    _refuse_twice("wear", settings, groups.get("wear", {}))
    case = _case(model, {"analysis": "wear"}, sweep, groups).replace(wear=settings)
    return run(case, file, check=check, progress=progress)


def mode(model: ModelLike, start: float, end: float, n_points: int | None = None, *,
         number: int | None = None,
         continuation: Literal["natural", "arclength"] | None = None,
         file: str | Path | None = None, check: bool = True, progress: Progress | None = None,
         **groups: Unpack[Groups]) -> Result:
    """A nonlinear mode: its frequency and damping over its amplitude.

    Parameters
    ----------
    model : Model, str or Path
        The structure, or the path of a model file.
    start, end : float
        Lowest and highest amplitude: of the first harmonic of the first observed quantity, or
        modal with ``mode={"control": "modal"}``.
    n_points : int, optional
        Points, evenly spaced in the logarithm of the amplitude; of a branch it sets its longest
        step.
    number : int, optional
        Of the elastic modes of the structure with its closed pairs stuck, from 1.
    continuation : {'natural', 'arclength'}, optional
        Points at given amplitudes, or a branch through folds (default).
    file, check, progress
        See `run`.
    **groups
        Further settings by group, see `Case`; such as ``mode={"synthesis": [1.0, 2.0]}``.

    Returns
    -------
    Result
        With `mode`, a `NonlinearMode`.

    Raises
    ------
    InputError, OutputError, ConvergenceError, RunInterrupted
        See `run`.
    """
    settings: Mode = {"start": start, "end": end}
    if n_points is not None:
        settings["n_points"] = n_points
    if number is not None:
        settings["number"] = number
    if continuation is not None:
        settings["continuation"] = continuation
    _refuse_twice("mode", settings, groups.get("mode", {}))
    case = _case(model, {"analysis": "mode"}, {}, groups).replace(mode=settings)
    return run(case, file, check=check, progress=progress)


def resonance(model: ModelLike, parameter: str, start: float, end: float,
              n_points: int | None = None, *, between: tuple[float, float],
              n_sweep: int = 41, unit: Literal["rad/s", "Hz"] | None = None,
              by_factor: bool = False, file: str | Path | None = None, check: bool = True,
              progress: Progress | None = None, **groups: Unpack[Groups]) -> Result:
    """A resonance as a function of a parameter: its amplitude and its frequency.

    Parameters
    ----------
    model : Model, str or Path
        The structure, or the path of a model file.
    parameter : str
        Such as 'contact%normal_load' (`resonance%parameter`).
    start, end : float
        First and last value, or factor.
    n_points : int, optional
        Values.
    between : (float, float)
        Frequencies [unit] between which the first resonance is looked for.
    n_sweep : int
        Points of the sweep that looks for it.
    unit : {'rad/s', 'Hz'}, optional
        Unit of these frequencies (default: rad/s).
    by_factor : bool
        Whether the values are factors of those of the case, all pairs (springs) together.
    file, check, progress
        See `run`.
    **groups
        Further settings by group, see `Case`; such as ``resonance={"condition": "phase"}``.

    Returns
    -------
    Result
        With `resonance`, a `ResonanceTrack`.

    Raises
    ------
    InputError, OutputError, ConvergenceError, RunInterrupted
        See `run`.
    """
    sweep: Sweep = {"start": between[0], "end": between[1], "n_points": n_sweep}
    if unit is not None:
        sweep["unit"] = unit
    settings: dict[str, object] = {"parameter": parameter, "start": start, "end": end}
    if n_points is not None:
        settings["n_points"] = n_points
    if by_factor:
        settings["as"] = "factor"
    given: Any = groups
    _refuse_twice("resonance", settings, given.get("resonance", {}))
    analysis: Any = {"analysis": "resonance"}
    change: Any = {"resonance": settings}
    case = _case(model, analysis, sweep, groups).replace(**change)
    return run(case, file, check=check, progress=progress)


def _case(model: ModelLike, analysis: CaseGroup, sweep: Sweep, groups: Groups) -> Case:
    """A case of one kind of analysis; what has an argument of its own is given there alone."""
    _refuse_twice("case", analysis, groups.get("case", {}))
    _refuse_twice("sweep", sweep, groups.get("sweep", {}))
    return Case(model, **groups).replace(case=analysis, sweep=sweep)


def _refuse_twice(group: str, own: Mapping[str, object], given: Mapping[str, object]) -> None:
    if not isinstance(given, Mapping):
        raise InputError(f"{group}: is a {type(given).__name__}, must be a dictionary of the keys "
                         "of the group")
    for key in own.keys() & given.keys():
        raise InputError(f"{group}[{key!r}]: is set by an argument of the function already; leave "
                         "it out, or make a Case and run it")


def _failure(result: Result, report: list[str]) -> str:
    """How many points failed, and where, or why a branch ended."""
    failed = result.omega[~result.converged]
    if not len(failed):
        return f"{result.name}: the run ended early: {'; '.join(report[:1])}"
    where = ", ".join(f"{omega:.6g}" for omega in failed[:5]) + (", ..." if len(failed) > 5 else "")
    return (f"{result.name}: {len(failed)} of {result.n_points} points did not converge, at omega "
            f"= {where} rad/s; try a finer sweep, or other harmonics; fw_run --explain says why")
