"""Runs that are stopped, interrupted, watched, and run beside each other."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import typing
from pathlib import Path
from typing import Any

import pytest
from project import EXAMPLE
from rubbing import RUBBING, SECTOR, assert_same_numbers

import fretwear as fw
from fretwear.settings import Groups

#: A stop takes some tenths of a second [s]; the rest is for machines that do other things.
STOPPED_WITHIN = 5.0


def test_a_stop_from_another_thread_ends_the_run() -> None:
    stop = threading.Event()
    ended: list[fw.RunStopped] = []

    def run_until_stopped() -> None:
        try:
            fw.run(long_run(), stop=stop)
        except fw.RunStopped as stopped:
            ended.append(stopped)

    worker = threading.Thread(target=run_until_stopped)
    worker.start()
    worker.join(0.5)
    assert worker.is_alive()
    stop.set()
    worker.join(30.0)
    assert not worker.is_alive()
    assert ended and ended[0].result is not None and ended[0].result.status == "stopped"
    assert ended[0].reason == "the run was ended by `stop`"


def endless_point() -> fw.Case:
    """One point that no guess solves, each taking its time: minutes with all fallbacks."""
    return fw.Case(EXAMPLE / "blade_sector" / "sector_48.h5", **SECTOR).replace(
        harmonics={"n_harmonics": 7, "n_time": 8192}, solver={"tolerance": 1e-30},
        case={"analysis": "point"}, sweep={"start": 1017.8, "unit": "Hz"})


@pytest.mark.parametrize("by_function", [False, True])
def test_a_stop_acts_within_a_point(by_function: bool) -> None:
    stop = threading.Event()
    results: list[fw.Result | None] = []

    def run_until_stopped() -> None:
        try:
            fw.run(endless_point(), stop=stop.is_set if by_function else stop)
        except fw.RunStopped as stopped:
            results.append(stopped.result)

    worker = threading.Thread(target=run_until_stopped)
    worker.start()
    worker.join(1.5)
    assert worker.is_alive()
    stop.set()
    worker.join(STOPPED_WITHIN)
    assert not worker.is_alive()
    assert results[0] is not None and results[0].status == "stopped" and not results[0].n_points


def test_a_run_ends_after_its_seconds() -> None:
    begun = time.monotonic()
    with pytest.raises(fw.RunStopped, match=r"case%max_seconds = 0\.5") as stopped:
        fw.run(endless_point(), max_seconds=0.5, check=False)
    # What `except Exception` takes, and what a command ends with.
    assert isinstance(stopped.value, fw.FretwearError) and stopped.value.exit_status == 6
    assert time.monotonic() - begun < 0.5 + STOPPED_WITHIN
    assert stopped.value.result is not None and stopped.value.result.status == "stopped"


def test_what_cannot_stop_a_run_is_refused() -> None:
    with pytest.raises(fw.InputError, match=r"stop: is a int, must be a threading.Event"):
        fw.run(endless_point(), stop=typing.cast(Any, 1))
    with pytest.raises(fw.InputError, match="max_seconds"):
        fw.run(endless_point(), max_seconds=-1.0)


def long_run() -> fw.Case:
    """Far more points than can be computed while a test waits."""
    return fw.Case(RUBBING, contact={"law": "penalty"},
                   harmonics={"n_harmonics": 15, "n_time": 1024},
                   sweep={"start": 0.6, "end": 1.6, "n_points": 10_000_000})


def test_an_interrupt_stops_the_run_and_keeps_what_is_done(tmp_path: Path) -> None:
    def interrupt(done: int, _total: int) -> None:
        if done > 0:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(fw.RunInterrupted) as stopped:
        fw.run(long_run(), tmp_path / "stopped.h5", progress=interrupt)
    assert signal.getsignal(signal.SIGINT) is before
    result = stopped.value.result
    assert result is not None
    assert result.status == "stopped"
    assert 0 < result.n_points < 10_000_000
    assert result.converged.all()
    assert result.path == tmp_path / "stopped.h5"


def test_an_interrupt_stops_wear(tmp_path: Path) -> None:
    def interrupt(done: int, _total: int) -> None:
        if done > 0:
            os.kill(os.getpid(), signal.SIGINT)

    groups: Groups = {**SECTOR, "wear": {"max_depth_step": 1e-12, "max_steps": 10_000_000}}
    with pytest.raises(fw.RunInterrupted) as stopped:
        fw.wear(EXAMPLE / "blade_sector" / "sector_16.h5", 1022.5, 1e-9, 1e9, unit="Hz",
                scheme="explicit", file=tmp_path / "wear.h5", progress=interrupt, **groups)
    result = stopped.value.result
    assert result is not None
    assert result.status == "stopped"
    assert 0 < len(result.cycles) < 10_000_000
    assert result.steady_state == "not reached"


def test_control_c_ends_a_script_with_its_result(tmp_path: Path) -> None:
    script = """
import sys, fretwear as fw
model = fw.Model([[1.0]], [[0.04]], [[1.0]], cosine=[1.0],
                 contact=fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5,
                                         tangential_stiffness=1.0))
print("ready", flush=True)
told = []
def tell(done, total):
    if done > 0 and not told:
        told.append(print("going", flush=True))
try:
    fw.frf(model, 0.6, 1.6, 10_000_000, contact={"law": "penalty"}, file=sys.argv[1],
           progress=tell)
except KeyboardInterrupt as stopped:
    print(stopped.result.status, stopped.result.n_points)
"""
    with subprocess.Popen([sys.executable, "-c", script, tmp_path / "stopped.h5"], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        assert process.stdout.readline() == "going\n"
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    status, n_points = said.split()
    assert status == "stopped"
    assert fw.Result(tmp_path / "stopped.h5").n_points == int(n_points) > 0
    assert not (tmp_path / "stopped.h5.part").exists()


@pytest.mark.parametrize("has_tqdm", [True, False])
def test_progress_in_the_unit_that_was_typed(capsys: pytest.CaptureFixture[str], has_tqdm: bool,
                                             monkeypatch: pytest.MonkeyPatch) -> None:
    """Frequency and amplitude of the last point, with tqdm and without it."""
    if has_tqdm:
        pytest.importorskip("tqdm")
    else:
        monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    law: dict[str, Any] = {"contact": {"law": "penalty"}}
    fw.frf(RUBBING, 0.6, 1.6, 25, progress=True, **law)
    told = capsys.readouterr().err
    last = told.strip().split("\r")[-1]
    assert told.endswith("\n") and ("25/25" if has_tqdm else "25 of 25 points") in last
    assert "1.6 rad/s, amplitude" in last
    fw.frf(RUBBING, 0.1, 0.25, 5, unit="Hz", progress=True, **law)
    assert "0.25 Hz" in capsys.readouterr().err
    fw.frf(RUBBING, 0.6, 1.6, 3, progress=False, **law)
    assert capsys.readouterr().err == ""
    with pytest.raises(fw.InputError, match="progress: is a int, must be True or a function"):
        fw.frf(RUBBING, 0.6, 1.6, 3, progress=1)  # type: ignore[arg-type]


def test_progress_of_wear_says_cycles_and_depth(capsys: pytest.CaptureFixture[str]) -> None:
    worn = fw.wear(RUBBING, 1.0, coefficient=1e-3, n_cycles=20, scheme="explicit", progress=True,
                   contact={"law": "penalty", "area": 1.0})
    last = capsys.readouterr().err.strip().split("\r")[-1]
    assert f"{worn.cycles[-1]:.4g} cycles, depth {worn.depth[-1].max():.4g}" in last


def test_an_error_of_the_progress_function_stops_the_run(tmp_path: Path) -> None:
    def fail(done: int, _total: int) -> None:
        raise RuntimeError(f"seen {done}")

    with pytest.raises(RuntimeError, match="seen"):
        fw.run(long_run(), tmp_path / "stopped.h5", progress=fail)
    assert fw.Result(tmp_path / "stopped.h5").status == "stopped"


def test_python_goes_on_while_the_library_computes() -> None:
    counted: list[int] = []
    seen: list[tuple[int, int]] = []

    def count() -> None:
        while not finished.is_set():
            counted.append(len(counted))

    finished = threading.Event()
    counter = threading.Thread(target=count)
    counter.start()
    try:
        fw.run(long_run().replace(sweep={"n_points": 3000}),
               progress=lambda done, total: seen.append((done, total)))
    finally:
        finished.set()
        counter.join()
    # Were the lock held, the progress function would see the end only.
    assert len({done for done, _ in seen}) > 1
    assert {total for _, total in seen} == {3000}
    assert counted


def test_runs_in_several_threads_do_not_disturb_each_other() -> None:
    case = fw.Case(EXAMPLE / "blade_sector" / "sector_16.h5", **SECTOR).replace(
        sweep={"start": 1017, "end": 1029, "n_points": 13, "unit": "Hz"}, case={"threads": 1})
    alone = fw.run(case)
    results: list[fw.Result] = []
    workers = [threading.Thread(target=lambda: results.append(fw.run(case))) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(results) == 4
    for result in results:
        assert_same_numbers(result, alone)
