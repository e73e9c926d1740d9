"""What a result does not hold ends in one way: an AbsentError that says what is absent and why."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fretwear as fw

#: Public attributes that every result has, a file without anything in it too.
ALWAYS = {"is_mistuned", "parameter_name", "name", "path", "attributes", "remarks", "bifurcations"}
PUBLIC = {name: value for kind in fw.Result.__mro__[:-1] for name, value in vars(kind).items()
          if not name.startswith("_")}
PROPERTIES = sorted(name for name, value in PUBLIC.items() if isinstance(value, property))
#: Methods, with arguments that fit any result.
METHODS: dict[str, tuple[Any, ...]] = {
    "index": (), "amplitude_of": (), "harmonic": (1,), "peak": (), "maximum": (), "cycle": (0,),
    "sector": (1,),
    "declared": ("omega",), "units": ("omega",), "to_xarray": ()}
#: Asked for no data, or only for what is drawn of it.
OTHERS = {"kept_open", "of_run", "open", "save", "from_bytes", "to_pyvista", "animate", "plot"}


@pytest.fixture
def empty(tmp_path: Path) -> fw.Result:
    """A result file with nothing in it."""
    with h5py.File(tmp_path / "empty.h5", "w") as file:
        file.attrs["format"] = "fretwear-result"
        file.attrs["format_version"] = 1
    return fw.Result(tmp_path / "empty.h5")


@pytest.fixture(scope="module")
def linear() -> fw.Result:
    """A sweep without contact, histories, stability or wear."""
    return fw.frf(fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0]), 0.5, 1.5, 3)


def ask(result: fw.Result, name: str) -> Any:
    """One accessor of a result."""
    value = getattr(result, name)
    return value(*METHODS[name]) if name in METHODS else value


def test_every_accessor_is_asked() -> None:
    assert set(PUBLIC) == set(PROPERTIES) | set(METHODS) | OTHERS
    assert set(PROPERTIES) >= ALWAYS | {"omega", "depth", "stable", "steady_state", "status"}


@pytest.mark.parametrize("name", sorted((set(PROPERTIES) - ALWAYS) | set(METHODS)))
def test_an_empty_file_has_none_of_it(empty: fw.Result, name: str) -> None:
    if name == "to_xarray":
        pytest.importorskip("xarray")
    absent = r"empty\.h5: (holds no dataset /|has no (attribute|sectors))"
    with pytest.raises(fw.AbsentError, match=absent):
        ask(empty, name)


@pytest.mark.parametrize("name", sorted(ALWAYS))
def test_what_is_always_there(empty: fw.Result, name: str) -> None:
    assert ask(empty, name) is not None


@pytest.mark.parametrize(("name", "remedy"), [
    ("stable", "sweep%stability = .true."), ("steady_state", "case%analysis = 'wear'"),
    ("depth", "case%analysis = 'wear'"), ("rate", "case%analysis = 'wear'"),
    ("volume", "case%analysis = 'wear'"), ("cycles", "case%analysis = 'wear'"),
    ("force", "needs contact pairs, and output%contact"), ("fraction", "needs contact pairs"),
    ("dissipation", "needs contact pairs"), ("cycle", "needs contact pairs"),
    ("path", "save"), ("model_file", "to_hdf5")])
def test_what_is_absent_says_how_to_get_it(linear: fw.Result, name: str, remedy: str) -> None:
    with pytest.raises(fw.AbsentError) as absent:
        ask(linear, name)
    assert remedy in str(absent.value)


@pytest.mark.parametrize("name", ["contact/area", "contact/patch", "contact/position", "fold",
                                  "harmonics", "instants", "error_estimate", "history/force",
                                  "floquet/multipliers", "wear/depth_halved", "no/such"])
def test_datasets_end_the_same_way(linear: fw.Result, name: str) -> None:
    for ask_for in (linear.__getitem__, linear.units, linear.declared):
        with pytest.raises(fw.AbsentError, match=f"holds no dataset /{name}"):
            ask_for(name)
    assert name not in linear


def test_numbers_that_are_zero_are_given(linear: fw.Result) -> None:
    """None in the case is no absence."""
    assert linear.n_pairs == 0 and linear.remarks == []
    contact = fw.ContactPairs([[1, 0, 0]], mu=0.3, normal_load=1.0)
    hidden = fw.frf(fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0], contact=contact), 0.5, 1.5, 3,
                    harmonics={"n_harmonics": 3}, output={"contact": False})
    assert hidden.n_pairs == 1
    with pytest.raises(fw.AbsentError):
        _ = hidden.force


def test_a_run_at_work_has_no_time_yet(linear: fw.Result, tmp_path: Path) -> None:
    with h5py.File(linear.save(tmp_path / "part.h5").path, "r+") as file:
        file.attrs["status"] = "incomplete"
        file.attrs["elapsed"] = 0.0
    with pytest.raises(fw.AbsentError, match="has not come to its end"):
        _ = fw.Result(tmp_path / "part.h5").elapsed


def test_no_peak_where_nothing_converged(linear: fw.Result, tmp_path: Path) -> None:
    with h5py.File(linear.save(tmp_path / "failed.h5").path, "r+") as file:
        file["converged"][...] = np.zeros_like(file["converged"][()])
    with pytest.raises(fw.AbsentError, match="no point has converged"):
        fw.Result(tmp_path / "failed.h5").peak()


def test_remarks_are_texts(linear: fw.Result, tmp_path: Path) -> None:
    with h5py.File(linear.save(tmp_path / "said.h5").path, "r+") as file:
        file["remarks/text"] = ["no load", "mu = 30 is large"]
    assert fw.Result(tmp_path / "said.h5").remarks == ["no load", "mu = 30 is large"]
