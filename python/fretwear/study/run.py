"""One run of a study: its identity, the program, what is kept of it.

A run is known by a hash of its effective input, so a study that is started again, or changed,
repeats nothing that is there. Everything here can be sent to another process or machine.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from .._namelist import literal
from .._native import Session, library_version, namelist_values
from ..errors import FretwearError, InputError
from .plan import Setting, override

__all__ = ["Job", "Record", "RunStopped", "check_program", "find_program", "identify", "recorded",
           "run_job"]

STATUS = {0: "ok", 3: "bad input", 4: "not converged"}
#: Runs that ended so would end so again.
_FINAL = ("ok", "not converged")
_TIMEOUT_STATUS = 124
#: What does not change the numbers of a run, or counts by its content.
_INDIFFERENT = ("case%threads", "case%title", "output%file", "model%file", "contact%worn")


class RunStopped(Exception):
    """A run was stopped from outside; nothing is recorded of it."""


@dataclass(frozen=True)
class Job:
    """What one run needs; plain texts, so that it travels.

    Attributes
    ----------
    name : str
        Hash of the effective input.
    program, case, folder : str
        fw_run, the namelist, the folder of the runs; absolute paths.
    values : dict
        Values of the keys that vary.
    overrides : tuple of str
        All KEY=VALUE, the fixed ones included.
    timeout : float
        [s], 0: none.
    """

    name: str
    program: str
    case: str
    folder: str
    values: dict[str, Setting]
    overrides: tuple[str, ...]
    timeout: float


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


def find_program(given: str = "") -> str:
    """Absolute path of fw_run: as given, of FW_RUN, of this package, or on the path."""
    # In a wheel the program itself lies beside the package; what is beside Python only starts it.
    inside = str(Path(__file__).parents[2] / "fretwear.scripts" / "fw_run")
    beside = str(Path(sys.executable).parent / "fw_run")
    for candidate in (given, os.environ.get("FW_RUN", ""), inside, beside, "fw_run"):
        found = shutil.which(candidate) if candidate else None
        if found:
            return os.path.abspath(found)
        if candidate and candidate == given:
            raise InputError(f"run.program = '{given}' cannot be executed")
    raise InputError("fw_run was not found; put it on the PATH, or name it by FW_RUN or by "
                     "program under [run]")


def check_program(program: str) -> None:
    """Raise where fw_run is of another version than this package.

    The points are read and checked by the library of the package, which must be that of fw_run.
    """
    try:
        told = subprocess.run([program, "--version"], capture_output=True, text=True,
                              check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"run.program = '{program}' does not tell its version: {error}") from None
    if library_version() not in told.split():
        raise InputError(f"{program} is '{told}', this package is of version {library_version()}: "
                         "they must be the same; name the fw_run of this installation by FW_RUN "
                         "or by program under [run]")


def identify(program: str, case: Path, folder: Path, values: Mapping[str, Setting],
             fixed: Mapping[str, Setting], timeout: float) -> Job | Record:
    """The job of a point, named by its effective input; a record where the library refuses it.

    The point is read and checked in this process.
    """
    settings = {**fixed, **values}
    overrides = tuple(override(key, value) for key, value in settings.items())
    text = case.read_bytes().decode(errors="surrogateescape")
    try:
        with Session() as session:
            session.read(text, str(case), [(key, literal(value, key))
                                           for key, value in settings.items()])
            session.check()
            effective = namelist_values(session.text("namelist"))
            inputs = session.text("inputs").splitlines()
    except FretwearError as error:
        return Record(_digest([text, *overrides]), dict(values), error.exit_status,
                      STATUS.get(error.exit_status, "failed"), str(error), 0.0, "")
    kept = {key: value for key, value in effective.items() if key not in _INDIFFERENT}
    # Of the namelist its effect counts, of every other file that is read what it holds.
    contents = [_content(Path(path)) for path in inputs if Path(path) != case]
    name = _digest([library_version(), json.dumps(kept, sort_keys=True), *contents])
    return Job(name, program, str(case), str(folder), dict(values), overrides, timeout)


def recorded(job: Job) -> Record | None:
    """The record of an earlier run of the same input, if it need not be repeated."""
    try:
        content = json.loads(_record_path(job).read_text())
        record = Record(**{**content, "values": job.values})
    except (OSError, ValueError, TypeError):
        return None
    kept = record.status in _FINAL and Path(job.folder, f"{job.name}.h5").is_file()
    return record if kept else None


def run_job(job: Job, stop: threading.Event | None = None) -> Record:
    """Run fw_run on one thread, and write its record.

    Raises
    ------
    RunStopped
        `stop` was set; the run was ended and left nothing.
    """
    folder = Path(job.folder)
    folder.mkdir(parents=True, exist_ok=True)
    result = folder / f"{job.name}.h5"
    command = [job.program, *_options(job.overrides), "--set", "case%threads=1", "-o", str(result),
               job.case]
    started = time.perf_counter()
    # A session of its own: Ctrl-C reaches the study, which then decides.
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env=_environment(), start_new_session=True)
    out, err, status = _wait(process, stop, job.timeout)
    if stop is not None and stop.is_set() and process.returncode < 0:
        _remove_partial(result)
        raise RunStopped(job.name)
    if status < 0 or status == _TIMEOUT_STATUS:
        _remove_partial(result)
    kind = STATUS.get(status, "failed")
    message = "" if status == 0 else _message(err)
    if kind == "not converged":
        message = _summary(out) or message
    if status == _TIMEOUT_STATUS:
        kind, message = "time limit", f"stopped after {job.timeout:g} s"
    elif status < 0:
        message = f"ended by signal {signal.Signals(-status).name}. {message}".strip()
    record = Record(job.name, job.values, status, kind, message, time.perf_counter() - started,
                    str(result) if result.is_file() else "")
    _write(_record_path(job), json.dumps(asdict(record), indent=1))
    return record


def _wait(process: subprocess.Popen[str], stop: threading.Event | None,
          timeout: float) -> tuple[str, str, int]:
    """Output, errors and status of a process that may be stopped or run out of time."""
    ends = time.monotonic() + timeout if timeout else float("inf")
    while True:
        try:
            out, err = process.communicate(timeout=0.1)
        except subprocess.TimeoutExpired:
            late = time.monotonic() > ends
            if late or (stop is not None and stop.is_set()):
                process.kill()
                out, err = process.communicate()
                return out, err, _TIMEOUT_STATUS if late else process.returncode
        else:
            return out, err, process.returncode


def _options(overrides: Iterable[str]) -> list[str]:
    return [word for text in overrides for word in ("--set", text)]


def _environment() -> dict[str, str]:
    """One thread in every library: the runs share the cores among themselves."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**os.environ, **one}


def _content(path: Path) -> str:
    """Digest of a file."""
    return _digest([path.read_bytes()])


def _digest(parts: Iterable[str | bytes]) -> str:
    whole = hashlib.sha256()
    for part in parts:
        whole.update(part.encode() if isinstance(part, str) else part)
        whole.update(b"\0")
    return whole.hexdigest()[:20]


def _message(errors: str) -> str:
    """Lines that fw_run marks as errors; else its last line."""
    lines = [line.partition("error: ")[2] for line in errors.splitlines() if "error: " in line]
    rest = errors.strip().splitlines()
    return "; ".join(lines) or (rest[-1] if rest else "")


def _summary(out: str) -> str:
    """First line of the summary, which says how many points converged."""
    lines = [" ".join(line.split()) for line in out.splitlines() if line.startswith("converged")]
    return lines[0] if lines else ""


def _record_path(job: Job) -> Path:
    return Path(job.folder, f"{job.name}.json")


def _write(path: Path, text: str) -> None:
    partial = path.with_name(f"{path.name}.{os.getpid()}.{threading.get_ident()}.part")
    partial.write_text(text)
    partial.replace(path)


def _remove_partial(result: Path) -> None:
    for name in (f"{result.name}.part", f"{result.name}.part.2"):
        with contextlib.suppress(OSError):
            result.with_name(name).unlink()
