"""Models of arrays and of files: what is taken, what is refused, what a file holds."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse
from project import EXAMPLE
from rubbing import RUBBING, SECTOR, assert_same_numbers

import fretwear as fw
from fretwear.settings import Groups


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


def test_a_model_file_holds_loads_and_stiffnesses_of_pairs(tmp_path: Path) -> None:
    RUBBING.to_hdf5(tmp_path / "rubbing.h5")
    again = fw.Model.from_hdf5(tmp_path / "rubbing.h5")
    assert again.contact is not None
    assert RUBBING.contact is not None
    for name in ("mu", "normal_load", "tangential_stiffness"):
        assert np.array_equal(getattr(again.contact, name), getattr(RUBBING.contact, name)), name
    assert again.contact.normal_stiffness is None
    # The program reads from the file what it is given as arrays here.
    law: Groups = {"contact": {"law": "penalty"}, "harmonics": {"n_harmonics": 3}}
    here = fw.frf(RUBBING, 0.6, 1.6, 5, **law)
    read = fw.frf(tmp_path / "rubbing.h5", 0.6, 1.6, 5, **law)
    assert read.coefficients.tobytes() == here.coefficients.tobytes()
    assert read.remarks == here.remarks
    # The input stands above the file.
    stiffer: Groups = {"contact": {"law": "penalty", "tangential_stiffness": 2.0},
                       "harmonics": {"n_harmonics": 3}}
    other = fw.frf(tmp_path / "rubbing.h5", 0.6, 1.6, 5, **stiffer)
    assert not np.allclose(other.coefficients, here.coefficients, rtol=1e-3)


def test_stiffnesses_that_the_law_does_not_take_are_remarked(tmp_path: Path) -> None:
    RUBBING.to_hdf5(tmp_path / "rubbing.h5")
    rigid = fw.frf(tmp_path / "rubbing.h5", 0.6, 1.6, 3, contact={"law": "dlft"},
                   harmonics={"n_harmonics": 3})
    assert any("contact%tangential_stiffness, which contact%law = 'dlft' does not take" in remark
               for remark in rigid.remarks)
    # Given by the case itself, they are refused as ever.
    with pytest.raises(fw.InputError, match="belongs to law = 'penalty'"):
        fw.frf(tmp_path / "rubbing.h5", 0.6, 1.6, 3,
               contact={"law": "dlft", "tangential_stiffness": 1.0})


#: Pairs with a law and its constants, and springs: nothing is left to the case.
WHOLE = fw.Model(
    np.diag([1.0, 2.0]), [[0.04, 0.0], [0.0, 0.1]], [[2.0, -1.0], [-1.0, 1.5]], cosine=[1.0, 0.0],
    contact=fw.ContactPairs([[1, 0, 0], [2, 0, 0]], [[2, 0, 0], [0, 0, 0]], mu=[0.3, 0.2],
                            normal_load=[1.0, 2.0], slip_speed=0.02, law="regularised"),
    springs=[fw.Spring(1, 2, 0.5, 3), fw.Spring(-2, coefficient=0.1, power=2)])
INLINE = '''&model n_dof = 2 mass = 1 0 0 2 damping = 0.04 0 0 0.1 stiffness = 2 -1 -1 1.5 /
&load cosine = 1 0 /
&contact n_pairs = 2 side_1 = 1 0 0 2 0 0 side_2 = 2 0 0 0 0 0 mu = 0.3 0.2
   normal_load = 1 2 slip_speed = 0.02 law = 'regularised' /
&spring n_springs = 2 side_1 = 1 -2 side_2 = 2 0 coefficient = 0.5 0.1 power = 3 2 /
'''
SWEEP = "&harmonics n_harmonics = 3 / &sweep start = 0.4 end = 1.2 n_points = 5 /"


def test_a_model_file_holds_everything_of_the_structure(tmp_path: Path) -> None:
    """The matrices, pairs, law and springs of a file are those of the namelist, to the bit."""
    WHOLE.save(tmp_path / "whole.h5")
    (tmp_path / "case.nml").write_text("&model source = 'hdf5' file = 'whole.h5' /" + SWEEP)
    read = fw.run(tmp_path / "case.nml", in_memory=True)
    inline = fw.run(fw.Case.from_text(INLINE + SWEEP), in_memory=True)
    groups: Groups = {"harmonics": {"n_harmonics": 3}}
    for other in (inline, fw.frf(WHOLE, 0.4, 1.2, 5, **groups),
                  fw.frf(fw.Model.from_hdf5(tmp_path / "whole.h5"), 0.4, 1.2, 5, **groups)):
        assert read.coefficients.tobytes() == other.coefficients.tobytes()
        assert read.force.tobytes() == other.force.tobytes()
    # The effective case reads back to the same.
    (tmp_path / "again.nml").write_text(read.namelist)
    again = fw.run(tmp_path / "again.nml", in_memory=True)
    assert again.coefficients.tobytes() == read.coefficients.tobytes()


def test_the_case_stands_above_the_springs_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "whole.h5"
    WHOLE.save(path)
    groups: Any = {"sweep": {"start": 0.6, "end": 0.8, "n_points": 2},
                   "harmonics": {"n_harmonics": 3}}

    def answer(model: fw.Model | Path, **more: Any) -> Any:
        return fw.run(fw.Case(model, **groups, **more)).coefficients

    def sprung(*springs: fw.Spring) -> fw.Model:
        return fw.Model(WHOLE.M, WHOLE.C, WHOLE.K, contact=WHOLE.contact, cosine=WHOLE.cosine,
                        springs=springs)

    stiffer = sprung(fw.Spring(1, 2, 0.7, 3), fw.Spring(-2, coefficient=0.1, power=2))
    for spring, model in (
            ({"coefficient": [0.7, 0.1]}, stiffer), ({"n_springs": 0}, sprung()),
            ({"n_springs": 1, "side_1": 1, "coefficient": 0.2},
             sprung(fw.Spring(1, coefficient=0.2)))):
        assert answer(path, spring=spring).tobytes() == answer(model).tobytes()
    with pytest.raises(fw.InputError, match="n_springs = 3: the model holds 2; give side_1"):
        fw.Case(path, **groups, spring={"n_springs": 3}).check()
    with pytest.raises(fw.InputError, match=r"side_1\(2\) = 4"):
        fw.Case(path, **groups, spring={"side_1": [1, 4]}).check()


@pytest.mark.parametrize(("name", "value", "told"), [
    ("spring/coefficient", [1.0, 2.0, 3.0],
     r"/spring/coefficient has shape \(3,?\), expected \(2,?\)"),
    ("spring/power", [3, 3, 3],
     "/spring/power has 3 values, expected 2, as many as /spring/side_1"),
    ("spring/coefficient", None, "/spring/coefficient is missing"),
    ("spring/side_2", [[1], [2]], "/spring/side_2 has shape .*expected 1 dimension"),
    ("spring/power", [3, 0], r"holds power\(2\) = 0: must be an integer from 1 to 99"),
    ("spring/side_1", [1, 5], r"holds side_1\(2\) = 5: must be"),
    ("spring/stiffness", [1.0, 1.0], "/spring/stiffness is nothing that is read.*expected there: "
     "side_1, side_2, sector_2, coefficient, power"),
    ("contact.law", "glue", "attribute law of /contact is .glue., expected 'dlft', "),
])
def test_springs_and_laws_of_a_file_are_checked(tmp_path: Path, name: str, value: Any,
                                                told: str) -> None:
    path = tmp_path / "whole.h5"
    WHOLE.save(path)
    with h5py.File(path, "r+") as file:
        if name == "contact.law":
            file["contact"].attrs["law"] = value
        else:
            if name in file:
                del file[name]
            if value is not None:
                file[name] = value
    with pytest.raises(fw.InputError, match=told):
        fw.Case(path, sweep={"start": 1.0, "end": 2.0, "n_points": 2}).check()


def test_a_model_file_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(fw.OutputError, match="cannot be written"):
        fw.Model([[1]], None, [[1]]).to_hdf5(tmp_path / "none" / "model.h5")
    assert not list(tmp_path.iterdir())


# Not one byte may go to a file: the system ends a process that tries.
NO_FILES = """
import resource, sys
import fretwear as fw
from fretwear.settings import Groups
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


def test_springs_are_parts_of_a_model_in_memory() -> None:
    """What C and Fortran give by the names of datasets."""
    from fretwear._native import Session

    def effective(**springs: Any) -> str:
        with Session() as session:
            session.new_model(1, 0)
            for name, values in {"mass": [1.0], "stiffness": [1.0]}.items():
                session.put(name, np.array(values))
            for name, values in springs.items():
                session.put(f"spring/{name}", np.array(values))
            session.read("&sweep start = 0.5 end = 1.0 n_points = 2 /", "here.nml", ())
            return session.text("namelist")

    assert "n_springs = 2" in effective(
        side_1=np.array([1, -1], dtype=np.int32), coefficient=[0.5, 1.0])
    for springs, told in (
            ({"coefficient": [1.0]}, "spring/coefficient has 1 values: must be 0"),
            ({"side_1": np.array([1], dtype=np.int32)}, "lacks spring/coefficient"),
            ({"side_1": np.array([1], dtype=np.int32), "coefficient": [1.0],
              "power": np.array([3, 3], dtype=np.int32)}, "spring/power has 2 values: must be 1")):
        with pytest.raises(fw.InputError, match=told):
            effective(**springs)
