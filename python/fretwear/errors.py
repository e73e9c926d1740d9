"""Errors of the package, each with the exit status that the commands return for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .result import Result

__all__ = ["AbsentError", "ConvergenceError", "FretwearError", "InputError", "NotBuiltError",
           "OutputError", "RunInterrupted", "RunStopped"]


class FretwearError(Exception):
    """Base of every error of this package.

    Attributes
    ----------
    exit_status : int
        What `fw_run` and `fretwear` return for it.
    """

    exit_status = 1


class InputError(FretwearError, ValueError):
    """Wrong input; the message names the place, the value found and the remedy."""

    exit_status = 3


class AbsentError(InputError):
    """A result does not hold what was asked of it; the message says how to get it.

    Parameters
    ----------
    message : str
        What is absent, and what would make it present.
    """


class NotBuiltError(AbsentError, ImportError):
    """The compiled part of the package is not there: what needs it cannot be had.

    Parameters
    ----------
    message : str
        How to get it.
    """


class ConvergenceError(FretwearError, RuntimeError):
    """Points that did not converge. What was computed is saved.

    Parameters
    ----------
    message : str
        How many points failed, and where.
    result : Result, optional
        Everything up to there; `Result.converged` marks the points that failed.
    report : sequence of str
        The summary of the run, one line each.
    """

    exit_status = 4

    def __init__(self, message: str, result: Result | None = None,
                 report: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.result = result
        self.report = tuple(report)


class OutputError(FretwearError, OSError):
    """A file cannot be read or written."""

    exit_status = 5


class RunStopped(FretwearError):
    """A run was ended by `max_seconds` or by `stop`; the points up to there are saved.

    Parameters
    ----------
    reason : str
        What ended it.
    result : Result, optional
        The points up to there; None where there is not even one.
    """

    exit_status = 6

    def __init__(self, reason: str, result: Result | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.result = result


class RunInterrupted(KeyboardInterrupt):
    """A run was stopped by Ctrl-C; the points up to there are saved.

    Parameters
    ----------
    result : Result, optional
        The points up to the interruption; None where there is not even one.
    """

    exit_status = 130

    def __init__(self, result: Result | None = None) -> None:
        super().__init__("the run was interrupted")
        self.result = result
