"""One run of a study: its identity, the program, what is kept of it.

A run is known by a hash of its effective input, so a study that is started again, or changed,
repeats nothing that is there. Everything here can be sent to another process or machine.
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from .._identity import digest, identity
from ..case import Case
from ..errors import FretwearError
from .plan import Setting, override

__all__ = ["STATUS", "Job", "JobStopped", "Record", "identify", "keep", "recorded",
           "remove_partial"]

STATUS = {0: "ok", 3: "bad input", 4: "not converged"}
#: Runs that ended so would end so again.
_FINAL = ("ok", "not converged")

class JobStopped(Exception):
    """A run was stopped from outside; nothing is recorded of it."""


@dataclass(frozen=True)
class Job:
    """What one run needs; plain texts, so that it travels.

    Attributes
    ----------
    name : str
        Hash of the effective input.
    program : str
        Path of the fw_run that is started for the run; '': the library of this package runs it.
    case, folder : str
        The namelist, the folder of the runs; absolute paths.
    values, settings : dict
        Values of the keys that vary; of all keys, the fixed ones included.
    timeout : float
        [s], 0: none.
    """

    name: str
    program: str
    case: str
    folder: str
    values: dict[str, Setting]
    settings: dict[str, Setting]
    timeout: float

    @property
    def result(self) -> Path:
        """Where the result file goes."""
        return Path(self.folder, f"{self.name}.h5")


@dataclass(frozen=True)
class Record:
    """What is kept of a run beside its result file.

    Attributes
    ----------
    name : str
        Of the job.
    values : dict
        Of the keys that vary.
    exit_status : int
        Of fw_run; negative: the signal that ended it; 124: time limit.
    status : str
        'ok', 'not converged', 'bad input', 'time limit', 'failed'.
    message : str
        What fw_run said of a failure.
    seconds : float
        Wall time.
    result : str
        Path of the result file; '' where there is none.
    """

    name: str
    values: Mapping[str, Setting]
    exit_status: int
    status: str
    message: str
    seconds: float
    result: str


def identify(program: str, case: Path, folder: Path, values: Mapping[str, Setting],
             fixed: Mapping[str, Setting], timeout: float) -> Job | Record:
    """The job of a point, named by its effective input; a record where the library refuses it.

    The point is read and checked in this process.
    """
    settings = {**fixed, **values}
    text = case.read_bytes().decode(errors="surrogateescape")
    try:
        whole = Case.from_text(text, case).overridden(
            override(key, value) for key, value in settings.items())
        with whole.open() as session:
            session.check()
            name = identity(session, case)
    except FretwearError as error:
        given = (override(key, value) for key, value in settings.items())
        return Record(digest([text, *given]), dict(values), error.exit_status,
                      STATUS.get(error.exit_status, "failed"), str(error), 0.0, "")
    return Job(name, program, str(case), str(folder), dict(values), settings, timeout)


def recorded(job: Job) -> Record | None:
    """The record of an earlier run of the same input, if it need not be repeated."""
    try:
        content = json.loads(_record_path(job).read_text())
        record = Record(**{**content, "values": job.values})
    except (OSError, ValueError, TypeError):
        return None
    kept = record.status in _FINAL and job.result.is_file()
    return record if kept else None


def _record_path(job: Job) -> Path:
    return Path(job.folder, f"{job.name}.json")


def keep(job: Job, exit_status: int, status: str, message: str, seconds: float) -> Record:
    """The record of a run that has ended, written beside its result file."""
    record = Record(job.name, job.values, exit_status, status, message, seconds,
                    str(job.result) if job.result.is_file() else "")
    _write(_record_path(job), json.dumps(asdict(record), indent=1))
    return record


def _write(path: Path, text: str) -> None:
    partial = path.with_name(f"{path.name}.{os.getpid()}.{threading.get_ident()}.part")
    partial.write_text(text)
    partial.replace(path)


def remove_partial(result: Path) -> None:
    for name in (f"{result.name}.part", f"{result.name}.part.2"):
        with contextlib.suppress(OSError):
            result.with_name(name).unlink()
