"""Models, cases and runs of the package against the program."""

from __future__ import annotations

import subprocess
import typing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from project import EXAMPLE, PROGRAM
from rubbing import RUBBING, SECTOR, assert_same_numbers, by_program

import fretwear as fw
from fretwear import settings
from fretwear._native import Session
from fretwear.settings import Groups

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
    # What --check adds for the eye, natural frequencies, stands behind as comments.
    assert shown.startswith(case.namelist())
    assert all(line.startswith("!") for line in shown.removeprefix(case.namelist()).splitlines())
    case.check()
    # Read back, the effective input is the same case.
    assert fw.Case.from_text(shown).namelist() == case.namelist()


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


_SWEPT = fw.Case(RUBBING, sweep={"start": 0.6, "end": 1.6, "n_points": 5},
                 contact={"law": "penalty"}, harmonics={"n_harmonics": 1})


def test_a_wrong_key_is_answered_with_the_right_one() -> None:
    with pytest.raises(fw.InputError, match=r"argument contact%nu='x'.*did you mean mu\?"):
        fw.frf(RUBBING, 1, 2, 3, contact={"nu": "x"})  # type: ignore[typeddict-unknown-key]
    with pytest.raises(fw.InputError, match=r"mu\(1\) = -1"):
        fw.frf(RUBBING, 1, 2, 3, contact={"mu": -1})
    unknown: Any = {"continuation": "arclength"}
    with pytest.raises(fw.InputError, match=r"continuation: is a key: .*sweep=\{.continuation"):
        fw.frf(RUBBING, 1, 2, 3, **unknown)
    with pytest.raises(fw.InputError, match=r"harmonicss: is no group .*did you mean harmonics\?"):
        fw.frf(RUBBING, 1, 2, 3, **dict[str, Any](harmonicss=3))
    with pytest.raises(fw.InputError, match=r"no group &swep.*did you mean sweep\?"):
        fw.Case(RUBBING, **dict[str, Any](swep={"start": 1.0})).check()
    with pytest.raises(fw.InputError, match=r"no derivatives by it.*did you mean contact%mu\?"):
        fw.optimise(_SWEPT, minimise="max_amplitude", over="contact%nu", bounds=(0.1, 1.0))
    with pytest.raises(fw.InputError, match=r"is no quantity.*did you mean max_amplitude\?"):
        fw.optimise(_SWEPT, minimise="max_amplitud", over="contact%mu", bounds=(0.1, 1.0))
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
