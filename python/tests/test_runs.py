"""Models, cases and runs of the package against the program."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import typing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse
from project import EXAMPLE, PROGRAM

import fretwear as fw
from fretwear import settings
from fretwear._native import Session
from fretwear.settings import Groups

SECTOR: Groups = {
    "structure": {"modal_damping": 1e-3, "rotation_speed": 460.8}, "contact": {"mu": 0.5},
    "load": {"harmonic_scale": 0.5}, "harmonics": {"n_harmonics": 3, "n_time": 128},
    "output": {"observe": ["tip"]}}
#: A stop takes some tenths of a second [s]; the rest is for machines that do other things.
STOPPED_WITHIN = 5.0
# Rubbing oscillator: one dof, one pair without a normal direction.
PAIR = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5, tangential_stiffness=1.0)
RUBBING = fw.Model([[1.0]], [[0.04]], [[1.0]], contact=PAIR, cosine=[1.0], title="rubbing")


def by_program(directory: Path, namelist: Path, *options: str) -> fw.Result:
    """What fw_run makes of a namelist."""
    target = directory / "program.h5"
    subprocess.run([PROGRAM, "-q", *options, "-o", target, namelist], check=True)
    return fw.Result(target)


def assert_same_numbers(one: fw.Result, other: fw.Result) -> None:
    """Every dataset but the times, to the last bit."""
    assert list(one) == list(other)
    for name in one:
        if name == "seconds":
            continue
        if one[name].dtype.kind == "U":
            assert list(one[name]) == list(other[name])
        else:
            assert one[name].tobytes() == other[name].tobytes(), name


# ---------------------------------------------------------------------- the same numbers


@pytest.mark.parametrize("name", ["jenkins", "coulomb", "duffing", "gap"])
def test_a_namelist_gives_the_numbers_of_fw_run(name: str, tmp_path: Path) -> None:
    namelist = EXAMPLE / name / f"{name}.nml"
    result = fw.run(fw.Case.from_file(namelist, sweep={"n_points": 7}), tmp_path / "here.h5")
    assert_same_numbers(result, by_program(tmp_path, namelist, "--set", "sweep%n_points=7"))


def test_a_branch_gives_the_numbers_of_fw_run(tmp_path: Path) -> None:
    namelist = EXAMPLE / "duffing" / "duffing.nml"
    case = fw.Case.from_file(namelist, sweep={"continuation": "arclength", "stability": True},
                             output={"histories": True})
    other = by_program(tmp_path, namelist, "--set", "sweep%continuation=arclength", "--set",
                       "sweep%stability=.true.", "--set", "output%histories=.true.")
    assert_same_numbers(fw.run(case, tmp_path / "here.h5"), other)


@pytest.mark.parametrize("in_memory", [False, True])
def test_the_sector_gives_the_numbers_of_fw_run(in_memory: bool, tmp_path: Path) -> None:
    file = EXAMPLE / "blade_sector" / "sector_16.h5"
    model = fw.Model.from_hdf5(file) if in_memory else file
    result = fw.frf(model, 1017, 1029, 25, unit="Hz", **SECTOR)
    other = by_program(tmp_path, EXAMPLE / "blade_sector" / "frf.nml", "--set",
                       "sweep%n_points=25")
    assert (result.fraction[:, :, 1] > 0.0).any()  # pairs slip: not only linear algebra
    assert_same_numbers(result, other)


def test_a_model_of_arrays_is_that_of_a_namelist(tmp_path: Path) -> None:
    result = fw.frf(RUBBING, 0.6, 1.6, 5, contact={"law": "penalty"},
                    harmonics={"n_harmonics": 15, "n_time": 1024})
    other = by_program(tmp_path, EXAMPLE / "jenkins" / "jenkins.nml", "--set", "sweep%n_points=5")
    assert_same_numbers(result, other)


def test_springs_of_a_model_are_those_of_a_namelist(tmp_path: Path) -> None:
    model = fw.Model([[1.0]], [[0.1]], [[1.0]], springs=[fw.Spring(1, coefficient=0.5)],
                     cosine=[0.25], observe={"u1": 1})
    result = fw.frf(model, 0.3, 1.43, 12, harmonics={"n_harmonics": 7})
    other = by_program(tmp_path, EXAMPLE / "duffing" / "duffing.nml", "--set",
                       "sweep%n_points=12")
    assert_same_numbers(result, other)


def test_the_effective_input_is_that_of_fw_run() -> None:
    namelist = EXAMPLE / "blade_sector" / "frf.nml"
    shown = subprocess.run([PROGRAM, "--check", namelist], check=True, capture_output=True,
                           text=True).stdout
    case = fw.Case.from_file(namelist)
    assert case.namelist() == shown
    case.check()
    # Read back, the effective input is the same case.
    assert fw.Case.from_text(shown).namelist() == shown


# ------------------------------------------------------------------------------ settings


def complaint(group: str, key: str) -> str:
    """What the library says of a key with a nonsensical value, '' where it takes even that."""
    nonsense: Any = {group: {key: ["?", "?"]}}
    try:
        fw.Case.from_file(EXAMPLE / "jenkins" / "jenkins.nml", **nonsense).namelist()
    except fw.InputError as error:
        return str(error)
    return ""


def test_a_group_has_the_keys_that_the_library_knows() -> None:
    unknown = "has no key"
    assert unknown in complaint("solver", "tolerances")
    own = {"model" if group == "structure" else group: typing.get_type_hints(keys)
           for group, keys in typing.get_type_hints(settings.Groups).items()}
    for group, keys in own.items():
        for key in keys:
            assert unknown not in complaint(group, key), (group, key)
    group = ""
    case = fw.Case(EXAMPLE / "blade_sector" / "sector_16.h5",
                   sweep={"start": 1.0, "end": 2.0, "n_points": 2})
    for line in case.namelist().splitlines():
        if line.startswith("&"):
            group = line[1:].strip()
        elif "=" in line:
            assert line.split("=")[0].strip() in own[group], (group, line)


def test_texts_numbers_and_arrays_reach_the_library_unchanged() -> None:
    case = fw.Case(RUBBING, case={"title": "it's = \"a\" / title!"},
                   sweep={"start": 0.1 + 0.2, "end": 1e300, "n_points": 2},
                   load={"cosine": np.array([1 / 3])}, output={"histories": True},
                   contact={"law": "penalty", "mu": np.float64(0.7)})
    shown = case.namelist()
    assert "title = 'it''s = \"a\" / title!'" in shown
    assert "start = 0.30000000000000004" in shown
    assert "cosine = 0.3333333333333333" in shown
    assert "histories = .true." in shown
    assert "mu = 0.7" in shown


def test_a_case_does_not_change_with_its_copies() -> None:
    case = fw.Case(RUBBING, contact={"law": "penalty"},
                   sweep={"start": 1.0, "end": 2.0, "n_points": 2})
    finer = case.replace(harmonics={"n_harmonics": 9})
    assert "n_harmonics = 9" in finer.namelist()
    assert "n_harmonics = 9" not in case.namelist()


# -------------------------------------------------------------------------------- errors


def test_a_wrong_key_is_answered_with_the_right_one() -> None:
    with pytest.raises(fw.InputError, match=r"argument contact%nu='x'.*did you mean mu\?"):
        fw.frf(RUBBING, 1, 2, 3, contact={"nu": "x"})  # type: ignore[typeddict-unknown-key]
    with pytest.raises(fw.InputError, match=r"mu\(1\) = -1"):
        fw.frf(RUBBING, 1, 2, 3, contact={"mu": -1})
    with pytest.raises(fw.InputError, match=r"harmonics: is a int"):
        fw.Case(RUBBING, harmonics=3)  # type: ignore[arg-type]
    with pytest.raises(fw.InputError, match=r"sweep\['start'\]: is set by an argument"):
        fw.frf(RUBBING, 1, 2, 3, sweep={"start": 3})
    with pytest.raises(fw.InputError, match=r"model: is a float"):
        fw.frf(1.0, 1, 2, 3)  # type: ignore[arg-type]


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(fw.OutputError, match=r"none.nml: cannot be read"):
        fw.run(tmp_path / "none.nml")
    with pytest.raises(fw.OutputError, match=r"none.h5"):
        fw.frf(tmp_path / "none.h5", 1, 2, 3)
    with pytest.raises(fw.OutputError, match="does not exist"):
        fw.frf(RUBBING, 1, 2, 3, file=tmp_path / "none" / "x.h5", contact={"law": "penalty"})


def test_points_that_fail_are_an_error_that_carries_what_was_computed() -> None:
    strict: Groups = {**SECTOR, "solver": {"max_iterations": 1, "fallback": False}}
    with pytest.raises(fw.ConvergenceError, match=r"of 13 points did not converge") as failed:
        fw.frf(EXAMPLE / "blade_sector" / "sector_16.h5", 1017, 1029, 13, unit="Hz", **strict)
    result = failed.value.result
    assert result is not None
    assert result.n_points == 13
    assert result.status == "not converged"
    assert not result.converged.all()
    assert any(line.startswith("converged ") for line in failed.value.report)
    again = fw.frf(EXAMPLE / "blade_sector" / "sector_16.h5", 1017, 1029, 13, unit="Hz",
                   check=False, **strict)
    assert np.array_equal(again.converged, result.converged)


@pytest.mark.parametrize(("argument", "change"), [
    ("K", {"K": np.eye(3)[:2]}),
    ("K", {"K": [[1.0, np.nan], [np.nan, 1.0]]}),
    ("K", {"K": [["a", "b"], ["c", "d"]]}),
    ("K", {"K": np.eye(2, dtype=complex)}),
    ("M", {"M": np.eye(3)}),
    ("M", {"M": [1.0, 1.0]}),
    ("C", {"C": np.full((2, 2), np.inf)}),
    ("cosine", {"cosine": [1.0]}),
    ("static", {"static": [[1.0, 2.0]]}),
    ("stiffness_rotation", {"stiffness_rotation": np.eye(4)}),
    (r"observe\['tip'\]", {"observe": {"tip": 3}}),
    (r"observe\['tip'\]", {"observe": {"tip": [1.0]}}),
    (r"contact.side_1\[0, 1\] = 5", {"contact": fw.ContactPairs([[1, 5, 0]])}),
    ("contact.side_1", {"contact": fw.ContactPairs([[1.0, 0.0, 0.0]])}),
    ("contact.side_1", {"contact": fw.ContactPairs([1, 2, 0])}),
    ("contact.side_2", {"contact": fw.ContactPairs([[1, 2, 0]], [[0, 0, 0]] * 2)}),
    ("contact.mu", {"contact": fw.ContactPairs([[1, 2, 0]], mu=[0.1, 0.2])}),
    ("contact.position", {"contact": fw.ContactPairs([[1, 2, 0]], position=[0.0, 0.0, 0.0])}),
    ("contact.patch", {"contact": fw.ContactPairs([[1, 2, 0]], patch="left")}),
    (r"springs\[0\]", {"springs": [fw.Spring(3)]}),
])
def test_a_wrong_array_is_named(argument: str, change: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {"M": np.eye(2), "C": None, "K": np.eye(2), **change}
    with pytest.raises(fw.InputError, match=rf"^{argument}"):
        fw.Model(**arguments)


@pytest.mark.parametrize("kind", ["csr_array", "csc_matrix", "coo_array"])
def test_sparse_matrices_are_those_of_numpy(kind: str) -> None:
    sparse = getattr(scipy.sparse, kind)
    mass, damping, stiffness = np.diag([1.0, 2.0]), 0.1 * np.eye(2), [[2.0, -1.0], [-1.0, 1.0]]
    dense = fw.Model(mass, damping, stiffness, cosine=[1.0, 0.0], stiffness_rotation=np.eye(2))
    taken = fw.Model(sparse(mass), sparse(damping), sparse(stiffness), cosine=[1.0, 0.0],
                     stiffness_rotation=sparse(np.eye(2)))
    for name in ("M", "C", "K", "stiffness_rotation"):
        assert np.array_equal(getattr(taken, name), getattr(dense, name))
    with pytest.raises(fw.InputError, match=r"shape is \(2, 3\)"):
        fw.Model(sparse(np.ones((2, 3))), None, stiffness)


def test_matrices_that_are_not_symmetric_are_refused_by_the_library() -> None:
    model = fw.Model(np.eye(2), None, [[2.0, -1.0], [0.0, 2.0]], cosine=[1, 0])
    with pytest.raises(fw.InputError, match=r"stiffness.*symmetric"):
        fw.frf(model, 1, 2, 3)


# ----------------------------------------------------------------------- memory and files


def test_fortran_ordered_arrays_are_not_copied() -> None:
    mass, stiffness = np.asfortranarray(np.diag([1.0, 2.0])), np.asfortranarray(np.eye(2))
    model = fw.Model(mass, None, stiffness)
    assert np.shares_memory(model.M, mass)
    assert np.shares_memory(model.K, stiffness)
    with pytest.raises(ValueError, match="read-only"):
        model.M[0, 0] = 3.0
    assert model.C is None


@pytest.mark.parametrize(("mass", "damping", "stiffness", "blamed"), [
    (2, 2, 3, "K"), (3, 2, 2, "M"), (2, 3, 2, "C"), (2, None, 3, "M and K")])
def test_the_matrix_of_another_size_is_blamed(mass: int, damping: int | None, stiffness: int,
                                              blamed: str) -> None:
    with pytest.raises(fw.InputError, match=rf"^{blamed}: "):
        fw.Model(np.eye(mass), None if damping is None else np.eye(damping), np.eye(stiffness))


def test_a_model_file_holds_the_model(tmp_path: Path) -> None:
    file = EXAMPLE / "blade_sector" / "sector_16.h5"
    model = fw.Model.from_hdf5(file)
    model.to_hdf5(tmp_path / "again.h5")
    again = fw.Model.from_hdf5(tmp_path / "again.h5")
    for one, other in ((model.M, again.M), (model.K, again.K), (model.static, again.static),
                       (model.cosine, again.cosine), (model.sine, again.sine),
                       (model.static_rotation, again.static_rotation)):
        assert np.array_equal(one, other)
    assert model.stiffness_rotation is not None
    assert again.stiffness_rotation is not None
    assert np.array_equal(model.stiffness_rotation, again.stiffness_rotation)
    assert model.contact is not None
    assert again.contact is not None
    for name in ("side_1", "side_2", "mu", "gap", "area", "position"):
        assert np.array_equal(getattr(model.contact, name), getattr(again.contact, name)), name
    assert model.contact.patch == again.contact.patch
    assert (model.title, model.unit_system) == (again.title, again.unit_system)
    assert model.observe is not None
    assert again.observe is not None
    assert list(model.observe) == list(again.observe)
    case = fw.Case(tmp_path / "again.h5", sweep={"start": 1.0, "end": 2.0, "n_points": 2})
    assert "n_pairs = 16" in case.namelist()


def test_a_model_file_is_not_written_without_what_it_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(fw.InputError, match=r"contact.normal_load, contact.tangential_stiffness"):
        RUBBING.to_hdf5(tmp_path / "model.h5")
    with pytest.raises(fw.InputError, match="springs"):
        fw.Model([[1]], None, [[1]], springs=[fw.Spring(1)]).to_hdf5(tmp_path / "model.h5")
    with pytest.raises(fw.OutputError, match="cannot be written"):
        fw.Model([[1]], None, [[1]]).to_hdf5(tmp_path / "none" / "model.h5")
    assert not list(tmp_path.iterdir())


# Not one byte may go to a file: the system ends a process that tries.
NO_FILES = """
import resource, sys
import fretwear as fw
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
pair = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5, tangential_stiffness=1.0)
model = fw.Model([[1.0]], [[0.04]], [[1.0]], contact=pair, cosine=[1.0])
result = fw.frf(model, 0.6, 1.6, 3, contact={"law": "penalty"})
print(repr(result.amplitude.ravel().tolist()))
"""


def test_a_model_runs_without_a_file() -> None:
    done = subprocess.run([sys.executable, "-c", NO_FILES], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stderr
    result = fw.frf(RUBBING, 0.6, 1.6, 3, contact={"law": "penalty"})
    assert eval(done.stdout) == result.amplitude.ravel().tolist()


def test_a_result_in_memory_is_that_of_the_file(tmp_path: Path) -> None:
    model = fw.Model.from_hdf5(EXAMPLE / "blade_sector" / "sector_16.h5")
    here = fw.frf(model, 1017, 1029, 5, unit="Hz", **SECTOR)
    written = fw.frf(model, 1017, 1029, 5, unit="Hz", file=tmp_path / "sector.h5", **SECTOR)
    assert_same_numbers(here, written)
    for name in here:
        assert here.declared(name) == written.declared(name)
    assert here.units("amplitude") == "mm"  # the unit system of the model reaches the result
    saved = here.save(tmp_path / "saved.h5")
    assert_same_numbers(here, saved)
    assert_same_numbers(here, pickle.loads(pickle.dumps(here)))
    with pytest.raises(fw.AbsentError, match="in memory"):
        _ = here.path
    with pytest.raises(fw.OutputError, match="cannot be written"):
        here.save(tmp_path / "none" / "saved.h5")


def test_a_stop_from_another_thread_ends_the_run() -> None:
    stop = threading.Event()
    ended: list[fw.Result | None] = []

    def run_until_stopped() -> None:
        try:
            fw.run(long_run(), stop=stop)
        except fw.RunInterrupted as interrupted:
            ended.append(interrupted.result)

    worker = threading.Thread(target=run_until_stopped)
    worker.start()
    worker.join(0.5)
    assert worker.is_alive()
    stop.set()
    worker.join(30.0)
    assert not worker.is_alive()
    assert ended and ended[0] is not None and ended[0].status == "stopped"


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
        except fw.RunInterrupted as interrupted:
            results.append(interrupted.result)

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
    with pytest.raises(fw.RunInterrupted) as stopped:
        fw.run(endless_point(), max_seconds=0.5)
    assert time.monotonic() - begun < 0.5 + STOPPED_WITHIN
    assert stopped.value.result is not None and stopped.value.result.status == "stopped"


def test_what_cannot_stop_a_run_is_refused() -> None:
    with pytest.raises(fw.InputError, match=r"stop: is a int, must be a threading.Event"):
        fw.run(endless_point(), stop=typing.cast(Any, 1))
    with pytest.raises(fw.InputError, match="max_seconds"):
        fw.run(endless_point(), max_seconds=-1.0)


# -------------------------------------------------------------------------------- the session


def test_a_misspelt_part_of_a_model_is_refused_and_replaces_nothing() -> None:
    with Session() as session:
        session.new_model(1, 1)
        with pytest.raises(fw.InputError, match="'masss' is no real part of a model"):
            session.put("masss", np.eye(1))
        with pytest.raises(fw.InputError, match="contact/position has 1 values: must be 3"):
            session.put("contact/position", np.eye(1))
        with pytest.raises(fw.InputError, match="'side_1' is no integer part"):
            session.put("side_1", np.ones((1, 3), dtype=np.int32))
        with pytest.raises(fw.InputError, match="'titel' is no text part"):
            session.put_texts("titel", ["x"])
        with pytest.raises(fw.InputError, match="a case has no part 'masss'"):
            session.part("masss")
        with pytest.raises(KeyError):
            session.text("mesage")


def test_steps_give_the_numbers_of_a_run() -> None:
    case = fw.Case(RUBBING, contact={"law": "penalty"}, sweep={
        "start": 0.6, "end": 1.6, "n_points": 7}, output={"histories": True})
    whole = fw.run(case)
    with fw.Steps(case) as steps:
        assert steps.frequencies.tobytes() == whole.omega.tobytes()
        assert steps.observed == whole.observed
        points = [steps.solve(omega) for omega in steps.frequencies]
    for k, point in enumerate(points):
        assert point.converged and point.omega == whole.omega[k]
        for name in ("coefficients", "amplitude", "contact/force", "contact/fraction",
                     "history/force", "history/relative_displacement"):
            assert point[name].tobytes() == whole[name][k].tobytes(), name
            assert point[name].shape == whole[name][k].shape, name
    with pytest.raises(fw.AbsentError, match=r"no 'wear/depth'.*there are omega, "):
        _ = points[0]["wear/depth"]


def test_what_does_not_go_step_by_step_is_refused() -> None:
    with pytest.raises(fw.InputError, match="must be a Case"):
        fw.Steps(RUBBING)  # type: ignore[arg-type]
    case = fw.Case(RUBBING, contact={"law": "penalty"}, sweep={
        "start": 0.6, "end": 1.6, "n_points": 3})
    with pytest.raises(fw.InputError, match="run the case as a whole"):
        fw.Steps(case.replace(harmonics={"accuracy": 1e-2}))
    with fw.Steps(case) as steps, pytest.raises(fw.InputError, match="omega = -1"):
        steps.solve(-1.0)


# ------------------------------------------------------------------- interruption, threads


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


def test_progress_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    fw.frf(RUBBING, 0.6, 1.6, 25, contact={"law": "penalty"}, progress=True)
    told = capsys.readouterr().err
    assert told.startswith("\r") and told.endswith("\n")
    assert "25 of 25 points" in told.split("\r")[-1]
    fw.frf(RUBBING, 0.6, 1.6, 3, contact={"law": "penalty"}, progress=False)
    assert capsys.readouterr().err == ""
    with pytest.raises(fw.InputError, match="progress: is a int, must be True or a function"):
        fw.frf(RUBBING, 0.6, 1.6, 3, progress=1)  # type: ignore[arg-type]


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


# ---------------------------------------------------------------------------------- wear


def test_wear_gives_the_numbers_of_fw_run(tmp_path: Path) -> None:
    groups: Groups = {**SECTOR, "wear": {"max_depth_step": 2e-5}}
    result = fw.wear(EXAMPLE / "blade_sector" / "sector_16.h5", 1022.5, 1e-9, 1e7, unit="Hz",
                     scheme="explicit", **groups)
    options = ["case%analysis=wear", "sweep%start=1022.5", "sweep%end=0", "wear%scheme=explicit",
               "wear%coefficient=1e-9", "wear%n_cycles=1e7", "wear%max_depth_step=2e-5"]
    other = by_program(tmp_path, EXAMPLE / "blade_sector" / "frf.nml",
                       *(word for option in options for word in ("--set", option)))
    assert_same_numbers(result, other)
    n_steps = len(result.cycles)
    assert n_steps > 2
    assert result.cycles[-1] == 1e7
    assert result.depth.shape == result.rate.shape == (n_steps, 16)
    assert result.volume.shape == (n_steps, 2)
    assert (result.depth[-1] > 0.0).any()
    assert result.steady_state in ("reached", "not reached", "none: gross slip")
    table = result.to_xarray()
    assert table["wear_depth"].dims == ("step", "pair")
    assert table["amplitude"].dims == ("step", "observed")
    assert np.array_equal(table["cycles"], result.cycles)


def test_what_wear_has_an_argument_for_is_given_there() -> None:
    with pytest.raises(fw.InputError, match=r"wear\['n_cycles'\]: is set by an argument"):
        fw.wear(RUBBING, 1.0, 1e-9, 1e6, wear={"n_cycles": 3})
    with pytest.raises(fw.InputError, match="area"):
        fw.wear(RUBBING, 1.0, 1e-9, 1e6, contact={"law": "penalty"})
