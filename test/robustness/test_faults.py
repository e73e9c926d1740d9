"""What a run leaves where it is killed, stopped, or has no room: nothing half, nothing lost."""
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]
import fault_cases  # noqa: E402
import fault_trials  # noqa: E402
import faults  # noqa: E402
from project import PROGRAM, require_program  # noqa: E402


@pytest.fixture
def case(tmp_path):
    require_program()
    return fault_cases.Case(PROGRAM, tmp_path)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_with_the_points_that_are_done(case, number):
    status, errors = case.stop(number)
    assert status == 6, errors
    assert "ends with the points that are done" in errors
    with h5py.File(case.result) as file:
        assert len(file["omega"]) >= fault_cases.SEEN
    assert case.equals_reference("stopped")
    assert case.files() == ["case.nml", "x.h5"]


def test_a_second_signal_ends_it_at_once_and_keeps_its_points(case):
    process = case.start()
    case.wait_for_saved_points(process)
    for _ in range(100):
        if process.poll() is not None:
            break
        process.send_signal(signal.SIGINT)
        time.sleep(0.001)
    process.communicate(timeout=60)
    assert process.returncode in (-signal.SIGINT, 6)
    assert case.saved() > 0


def test_ignored_signals_stay_ignored(case):
    process = case.start(preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    case.wait_for_points(process)
    process.send_signal(signal.SIGINT)
    time.sleep(0.2)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 6


def test_a_killed_run_leaves_its_points_until_a_later_one_is_complete(case):
    case.kill()
    assert case.files() == ["case.nml", "x.h5.part"]
    assert case.saved() > 0
    case.refused("--set", "contact%mu=-1")
    case.kill()
    assert case.files() == ["case.nml", "x.h5.part", "x.h5.part.2"]
    case.complete()
    assert case.files() == ["case.nml", "x.h5"]
    assert case.equals_reference()


def test_the_part_of_a_run_at_work_is_left_alone(case):
    process = case.start()
    case.wait_for_points(process)
    case.complete()
    assert case.files() == ["case.nml", "x.h5", "x.h5.part"]
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 6
    assert case.files() == ["case.nml", "x.h5"]


def test_a_part_whose_lock_proves_nothing_is_left_alone(case):
    """Where locks are switched off, a killed run cannot be told from one at work."""
    case.kill(env=dict(os.environ, HDF5_USE_FILE_LOCKING="FALSE"))
    case.complete()
    assert case.files() == ["case.nml", "x.h5", "x.h5.part"]


def test_a_part_that_is_whole_is_left_alone(case):
    """Its run has closed it and is about to give it its name."""
    case.kill()
    with h5py.File(case.part(), "a") as file:
        file.attrs["status"] = b"complete"
    case.complete()
    assert case.files() == ["case.nml", "x.h5", "x.h5.part"]


@pytest.mark.parametrize("name", faults.SCENARIOS)
def test_at_random_moments(tmp_path, name):
    """A few tries of each fault; `make faults` takes more."""
    tried, complaints = faults.campaign(name, tmp_path, tries=3)
    assert not complaints
    assert tried == 3 or name in faults.NEED_FILE_SYSTEM


def test_what_is_left_is_judged(tmp_path):
    sweep = fault_trials.Sweep(tmp_path)
    sweep.complete()
    with h5py.File(sweep.case.result, "r+") as file:
        file["coefficients"][7, 1, 0] *= 1.001
    with pytest.raises(fault_trials.Fault, match="numbers"):
        sweep.check_result()
    sweep.case.result.write_bytes(sweep.case.result.read_bytes()[:5000])
    with pytest.raises(fault_trials.Fault, match="half"):
        sweep.check_result()
    sweep.case.result.unlink()
    with pytest.raises(fault_trials.Fault, match="lost"):
        sweep.check_result()
    sweep.reset()
    with pytest.raises(fault_trials.Fault, match="crash"):
        sweep.refused(sweep.start())


def test_two_runs_of_one_name(case):
    first, second = case.start(length=200), case.start(length=200)
    for process in (first, second):
        process.communicate(timeout=120)
        assert process.returncode == 0
    assert case.files() == ["case.nml", "x.h5"]
    with h5py.File(case.result) as file:
        assert len(file["omega"]) == 200


def test_no_room(case):
    """A file that may not grow stands for a full disk: the earlier result is whole afterwards."""
    case.complete()
    before = case.result.read_bytes()

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))

    done = case.run(preexec_fn=limit)
    assert done.returncode == 5, done.stderr
    assert "disk full?" in done.stderr
    assert case.result.read_bytes() == before


def test_a_place_that_takes_no_files(case):
    """The file systems of the kernel stand for one that is mounted read-only."""
    done = case.run("-o", "/proc/x.h5")
    assert done.returncode == 5, done.stderr
    assert "/proc/x.h5" in done.stderr


def test_a_folder_without_permission(case):
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    case.folder.chmod(0o555)
    try:
        assert case.run().returncode == 5
    finally:
        case.folder.chmod(0o755)


def test_result_open_elsewhere(case):
    """A reader keeps what it has open; a writer's file is not replaced."""
    case.complete()
    with h5py.File(case.result) as reader:
        before = reader["coefficients"][:]
        assert case.run().returncode == 0
        assert np.array_equal(reader["coefficients"][:], before)
    with h5py.File(case.result, "r+"):
        done = case.run()
        assert done.returncode == 5, done.stderr
        assert "open for writing" in done.stderr
    assert case.equals_reference()


def test_standard_streams_that_are_full(case):
    with open("/dev/full", "w") as full:
        done = subprocess.run(case.arguments(fault_cases.SHORT), cwd=case.folder, stdout=full,
                              stderr=full, timeout=60, check=False)
    assert done.returncode == 0
    assert case.files() == ["case.nml", "x.h5"]
    assert case.equals_reference()
