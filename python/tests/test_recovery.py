"""All displacements from the contact forces of a result, against what the run itself has seen."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run

import fretwear as fw
from fretwear import InputError
from fretwear._native import namelist_values
from fretwear.export import read_structure, recover_displacement, relative_displacement
from fretwear.result import Result

# The forces of a result are known to the tolerance of its solver, 1e-8 of the vibratory load.
SOLVED = 1e-6


def _harmonics(history: np.ndarray, n_coefficients: int) -> np.ndarray:
    """Coefficients (0, c1, s1, ...) of samples along axis 1."""
    n = history.shape[1]
    tau = 2.0 * np.pi * np.arange(n) / n
    rows = [np.full(n, 1.0 / n)]
    for h in range(1, (n_coefficients - 1) // 2 + 1):
        rows += [2.0 / n * np.cos(h * tau), 2.0 / n * np.sin(h * tau)]
    return np.einsum("ct,pt...->pc...", np.array(rows), history)


def test_relative_displacements_are_those_of_the_run(sampled: Result) -> None:
    """Vibratory parts of all pairs; static ones where contact or observation fixes them."""
    expected = _harmonics(sampled["history/relative_displacement"], 7)
    found = relative_displacement(sampled)
    size = np.abs(expected[:, 1:]).max()
    assert (sampled.fraction[:, :, 1] > 0.0).any(), "the joint has to slip somewhere"
    assert found[:, 1:] == pytest.approx(expected[:, 1:], abs=SOLVED * size * 100)
    stuck = sampled.fraction[:, :, 0].all(axis=1)
    assert found[stuck, 0] == pytest.approx(expected[stuck, 0], abs=1e-9)


def test_observed_quantities_follow(coarse: Result) -> None:
    structure = read_structure(coarse)
    observed = recover_displacement(coarse, structure) @ structure.observe.T
    assert observed == pytest.approx(coarse.coefficients, abs=SOLVED * coarse.amplitude.max())


def test_only_the_points_asked_for(coarse: Result) -> None:
    some = recover_displacement(coarse, points=[3])
    assert np.isfinite(some).all(axis=(1, 2)).tolist() == [k == 3 for k in range(40)]


@pytest.mark.parametrize("name", ["separation", "jenkins", "coulomb", "gap"])
def test_inline_models(name: str, examples: Path, tmp_path: Path) -> None:
    result = run(examples.parent / name / f"{name}.nml", tmp_path / "a.h5",
                 "output%histories=true")
    expected = _harmonics(result["history/relative_displacement"], result.coefficients.shape[1])
    size = np.abs(expected).max()
    assert relative_displacement(result) == pytest.approx(expected, abs=SOLVED * size)


def test_a_changed_model_is_noticed(coarse: Result, tmp_path: Path) -> None:
    result = tmp_path / "moved.h5"
    shutil.copy(coarse.path, result)
    model = tmp_path / "model.h5"
    shutil.copy(coarse.path.with_name("model.h5"), model)
    with h5py.File(model, "r+") as file:
        file["mass"][...] *= 1.001
    with h5py.File(result, "r+") as file:
        text = file.attrs["namelist"].replace(str(coarse.path.parent), "/nowhere")
        file.attrs["namelist"] = text
    # The path of the namelist is gone: the model beside the result is taken, and found wrong.
    with pytest.raises(InputError, match="does not follow from its contact forces"):
        recover_displacement(Result(result))
    model.unlink()
    with pytest.raises(InputError, match="is not there; put it there, or beside the result"):
        recover_displacement(Result(result))


def test_springs_are_refused(examples: Path, tmp_path: Path) -> None:
    result = run(examples.parent / "duffing" / "duffing.nml", tmp_path / "a.h5",
                 "sweep%n_points=3", "sweep%end=0.4")
    with pytest.raises(InputError, match="nonlinear springs"):
        recover_displacement(result)


def test_namelist_values() -> None:
    text = ("&case\n   title = 'it''s, = !'               ! a text\n/\n&model\n"
            "   mass = 1, 0,\n      0, 2.5e-3\n   on = .true.\n   gap = 3*0.5, 1\n/\n")
    assert namelist_values(text) == {
        "case%title": ["it's, = !"], "model%mass": ["1", "0", "0", "2.5e-3"],
        "model%on": [".true."], "model%gap": ["0.5", "0.5", "0.5", "1"]}
    with pytest.raises(InputError, match="the = is missing"):
        namelist_values("&case title")


def test_a_model_in_memory_is_recovered_too(examples: Path) -> None:
    """Every dof of a case that no file tells of, against a run that observes them all."""
    model = fw.Model.from_hdf5(examples / "sector_16.h5")
    settings = {
        "structure": {"modal_damping": 1e-3, "rotation_speed": 460.8}, "contact": {"mu": 0.5},
        "load": {"harmonic_scale": 0.5}, "harmonics": {"n_harmonics": 3, "n_time": 128}}
    tip = fw.frf(model, 1022, 1023, 2, unit="Hz", output={"observe": ["tip"]}, **settings)
    every = list(range(1, model.n_dof + 1))
    whole = fw.frf(model, 1022, 1023, 2, unit="Hz", output={"observe": every}, **settings)
    found = recover_displacement(tip)
    assert np.abs(found[:, 1:] - whole.coefficients[:, 1:]).max() < SOLVED * np.abs(
        whole.coefficients[:, 1:]).max()
