"""Runs that are watched, stopped and interrupted while the library computes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Callable, Union

import numpy as np
from numpy.typing import NDArray

from ._native import Session, namelist_values
from ._progress import CONTROL, Bar, State, read_state
from .errors import InputError

__all__ = ["Progress", "Stop", "StopFlag", "Tell", "run_watched", "stop_function",
           "stop_reason", "stops_on_interrupt", "teller"]

#: Called with the number of points done and of points to come (0: not known); True for a bar on
#: the standard error, or in a notebook.
Progress = Union[bool, Callable[[int, int], object]]

#: What is asked whether to stop.
Stop = Union[threading.Event, Callable[[], object]]

#: What is told how far the run is.
Tell = Callable[[State], object]

#: How a run remarks that its time is over.
_TIME_OVER = "time limit:"
#: Time between two calls of a progress function [s].
_BETWEEN_CALLS = 0.1


class StopFlag(threading.Event):
    """An event that reaches runs at work by itself: none of them has to ask for it."""

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._controls: list[NDArray[np.int64]] = []

    def set(self) -> None:
        """Stop the runs at work, and those to come."""
        with self._lock:
            super().set()
            for control in self._controls:
                control[0] = 1

    @contextmanager
    def reaching(self, control: NDArray[np.int64]) -> Iterator[None]:
        """Stop the run with this control, when the flag is set in the `with` block or was before.
        """
        with self._lock:
            self._controls.append(control)
            control[0] = int(self.is_set())
        try:
            yield
        finally:
            with self._lock:
                self._controls = [other for other in self._controls if other is not control]


def stop_function(stop: object) -> Callable[[], object] | None:
    """What tells whether to stop: an event is asked whether it is set."""
    if stop is None:
        return None
    asked = getattr(stop, "is_set", stop)
    if not callable(asked):
        raise InputError(f"stop: is a {type(stop).__name__}, must be a threading.Event or a "
                         "function without arguments")
    return asked


def stop_reason(remarks: Iterable[str]) -> str:
    """What has ended a run that no signal has: its time, of which it remarks, or `stop`."""
    for line in remarks:
        if line.startswith(_TIME_OVER):
            return line
    return "the run was ended by `stop`"


@contextmanager
def teller(progress: Progress | None, session: Session) -> Iterator[Tell | None]:
    """What is told of a run: a bar, the function of the caller, or nothing."""
    if callable(progress):
        told = progress
        yield lambda state: told(state.done, state.total)
    elif progress:
        unit = namelist_values(session.text("namelist")).get("sweep%unit", ["rad/s"])
        bar = Bar(in_hertz=unit[0].lower() == "hz")
        try:
            yield bar.show
        finally:
            bar.end()
    else:
        yield None


def run_watched(run: Callable[[NDArray[np.int64]], int], progress: Tell | None,
                stop: Callable[[], object] | None) -> tuple[int, bool]:
    """Run what takes a control so that it can be interrupted; its status, and whether it was.

    The main thread alone gets signals, and only while it runs Python: the library works in another
    thread, while this one waits.
    """
    control = np.zeros(CONTROL, dtype=np.int64)
    in_main = threading.current_thread() is threading.main_thread()
    if not in_main and progress is None and stop is None:
        return run(control), False
    flag = getattr(stop, "__self__", None)
    if not in_main and progress is None and isinstance(flag, StopFlag):
        with flag.reaching(control):
            return run(control), False
    status: list[int] = []
    worker = threading.Thread(target=lambda: status.append(run(control)), name="fretwear")
    with stops_on_interrupt(control, in_main) as interrupted:
        worker.start()
        try:
            _wait(worker, control, progress, stop)
        except BaseException:
            control[0] = 1
            worker.join()
            raise
    return status[0], bool(interrupted)


def _wait(worker: threading.Thread, control: NDArray[np.int64], progress: Tell | None,
          stop: Callable[[], object] | None) -> None:
    if progress is None and stop is None:
        worker.join()
        return
    told = -1
    while True:
        worker.join(_BETWEEN_CALLS)
        at_work = worker.is_alive()
        if stop is not None and stop():
            control[0] = 1
        if progress is not None and told != control[1]:
            told = int(control[1])
            progress(read_state(control))
        if not at_work:
            return


@contextmanager
def stops_on_interrupt(control: NDArray[np.int64], in_main: bool) -> Iterator[list[int]]:
    """Let Ctrl-C set the stop flag instead of raising; yields the list of signals received.

    A handler of the calling program gets its signal afterwards.
    """
    received: list[int] = []

    def stop(number: int, _frame: object) -> None:
        received.append(number)
        control[0] = 1

    before = signal.getsignal(signal.SIGINT)
    if not in_main or before is None or before == signal.SIG_IGN:  # not ours to handle
        yield received
        return
    signal.signal(signal.SIGINT, stop)
    try:
        yield received
    finally:
        signal.signal(signal.SIGINT, before)
    if received and callable(before) and before is not signal.default_int_handler:
        before(received[-1], None)
