"""A run by the library in this process, or by a program that is started for it."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path

from .._native import library_version
from ..analyses import run
from ..case import Case
from ..errors import ConvergenceError, FretwearError, InputError, RunInterrupted, RunStopped
from .plan import override
from .run import STATUS, Job, JobStopped, Record, keep, remove_partial

__all__ = ["check_program", "find_program", "run_job"]

_TIMEOUT_STATUS = 124


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


def run_job(job: Job, stop: threading.Event | None = None) -> Record:
    """Run a job on one thread, and write its record.

    Raises
    ------
    JobStopped
        `stop` was set; the run was ended and left nothing.
    """
    Path(job.folder).mkdir(parents=True, exist_ok=True)
    return _run_program(job, stop) if job.program else _run_here(job, stop)


def _run_here(job: Job, stop: threading.Event | None) -> Record:
    """Run a job in this process; the interpreter lock is free while it computes."""
    text = Path(job.case).read_bytes().decode(errors="surrogateescape")
    started = time.perf_counter()
    status, message = 0, ""
    try:
        case = Case.from_text(text, job.case).overridden(
            [*(override(key, value) for key, value in job.settings.items()), "case%threads=1"])
        run(case, job.result, stop=stop, max_seconds=job.timeout or None)
    except RunInterrupted:
        _remove_result(job)
        raise
    except RunStopped:
        _remove_result(job)
        if stop is not None and stop.is_set():
            raise JobStopped(job.name) from None
        status, message = _TIMEOUT_STATUS, f"stopped after {job.timeout:g} s"
    except ConvergenceError as failure:
        status, message = failure.exit_status, _summary("\n".join(failure.report))
    except FretwearError as error:
        status, message = error.exit_status, str(error)
    return keep(job, status, _kind(status), message, time.perf_counter() - started)


def _remove_result(job: Job) -> None:
    with contextlib.suppress(OSError):
        job.result.unlink()
    remove_partial(job.result)


def _kind(status: int) -> str:
    return "time limit" if status == _TIMEOUT_STATUS else STATUS.get(status, "failed")


def _run_program(job: Job, stop: threading.Event | None) -> Record:
    """Start fw_run for a job and wait for it."""
    command = [job.program, *_options(override(key, value) for key, value in job.settings.items()),
               "--set", "case%threads=1", "-o", str(job.result), job.case]
    started = time.perf_counter()
    # A session of its own: Ctrl-C reaches the study, which then decides.
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env=_environment(), start_new_session=True)
    out, err, status = _wait(process, stop, job.timeout)
    if stop is not None and stop.is_set() and process.returncode < 0:
        remove_partial(job.result)
        raise JobStopped(job.name)
    if status < 0 or status == _TIMEOUT_STATUS:
        remove_partial(job.result)
    message = "" if status == 0 else _message(err)
    if _kind(status) == "not converged":
        message = _summary(out) or message
    if status == _TIMEOUT_STATUS:
        message = f"stopped after {job.timeout:g} s"
    elif status < 0:
        message = f"ended by signal {signal.Signals(-status).name}. {message}".strip()
    return keep(job, status, _kind(status), message, time.perf_counter() - started)


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


def _message(errors: str) -> str:
    """Lines that fw_run marks as errors; else its last line."""
    lines = [line.partition("error: ")[2] for line in errors.splitlines() if "error: " in line]
    rest = errors.strip().splitlines()
    return "; ".join(lines) or (rest[-1] if rest else "")


def _summary(out: str) -> str:
    """First line of the summary, which says how many points converged."""
    lines = [" ".join(line.split()) for line in out.splitlines() if line.startswith("converged")]
    return lines[0] if lines else ""
