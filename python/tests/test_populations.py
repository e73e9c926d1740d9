"""Populations of mistuned disks: seeds, workers, restart, quantiles, the command, the picture."""

import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from limits import limit

import fretwear as fw
from fretwear.cli import main

N = 5


def disk(pairs: bool = False) -> fw.Case:
    """Sectors of three masses, the first on the disk; the last is the tip."""
    mass = np.diag([1.0, 0.3, 0.2, 0.0])
    stiffness = np.zeros((4, 4))
    for i, j, k in ((0, 1, 1.0), (1, 2, 0.8), (0, 3, 0.4)):
        stiffness[np.ix_([i, j], [i, j])] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    stiffness[0, 0] += 0.5
    contact = fw.ContactPairs([[3, 0, 0]], [[0, 0, 0]], mu=0.3, normal_load=0.2,
                              tangential_stiffness=0.3) if pairs else None
    model = fw.Model(mass, stiffness, 0.01 * stiffness, contact=contact,
                     cosine=[0.0, 0.05, 0.05, 0.0], observe={"tip": 3, "root": 1},
                     sectors=fw.Sectors(N, [1], [4]),
                     mistuning=fw.Mistuning([[0.0, -0.3, 0.9, 0.0]], [1.2]))
    groups = {"contact": {"law": "penalty"}} if pairs else {}
    return fw.Case(model, cyclic={"engine_order": 2, "mistuned": True},
                   sweep={"start": 0.6, "end": 1.6, "n_points": 21},
                   harmonics={"n_harmonics": 1, "n_time": 32}, **groups)


def files_of_disk(folder: Path) -> Path:
    """The same as a namelist beside its model file."""
    model = disk().model
    assert model is not None
    model.save(folder / "model.h5")
    (folder / "case.nml").write_text(
        "&model source = 'hdf5' file = 'model.h5' /\n&cyclic engine_order = 2 mistuned = .true. /\n"
        "&sweep start = 0.6 end = 1.6 n_points = 21 /\n&harmonics n_harmonics = 1 /\n")
    return folder / "case.nml"


def same(a: fw.Population, b: fw.Population) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)
               for name in ("amplitude", "omega", "sector", "amplification", "tuned", "converged",
                            "solved", "patterns"))


def test_patterns_are_those_of_the_seed() -> None:
    found = fw.population(disk(), 7, seed=3, deviation=0.03, workers=1)
    wanted = 0.03 * np.random.default_rng(3).standard_normal((7, N))
    assert np.array_equal(found.patterns, wanted)
    assert found.names == ("tip", "root")
    assert found.amplitude.shape == (7, 2)
    assert (found.converged == found.solved).all()
    assert (found.amplification > 0.9).all()
    given = fw.population(disk(), wanted, workers=1)
    assert np.array_equal(given.amplitude, found.amplitude)


@pytest.mark.parametrize("contact", [None, {"mu": 0.1, "normal_load": 0.2}])
def test_workers_and_stops_do_not_change_the_numbers(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, contact: dict[str, float]) -> None:
    pairs = contact is not None
    n = 4 if pairs else 60
    one = fw.population(disk(pairs), n, seed=5, contact=contact, workers=1)
    assert same(one, fw.population(disk(pairs), n, seed=5, contact=contact, workers=8))
    stop, file = threading.Event(), tmp_path / "disks.h5"

    def then_stop(*args: Any, **options: Any) -> fw.Result:
        found = fw.run(*args, **options)
        stop.set()
        return found

    # In the thread that solves: who is told of the progress comes when all are done, at times.
    with monkeypatch.context() as patch:
        patch.setattr("fretwear.populations.run", then_stop)
        with pytest.raises(fw.RunStopped):
            fw.population(disk(pairs), n, seed=5, contact=contact, workers=1, file=file, stop=stop)
    with h5py.File(file) as kept:
        assert 0 < kept["population/done"][()].sum() < n
    rest: list[int] = []
    again = fw.population(disk(pairs), n, seed=5, contact=contact, workers=8, file=file,
                          progress=lambda done, total: rest.append(done))
    assert same(one, again)
    assert len(rest) < n
    assert same(one, fw.population(disk(pairs), n, seed=5, contact=contact, file=file,
                                   progress=lambda done, total: pytest.fail("solved again")))
    with pytest.raises(fw.InputError, match="is not of this input"):
        fw.population(disk(pairs), n, seed=6, contact=contact, file=file)


def test_what_was_killed_goes_on(tmp_path: Path) -> None:
    """The process is killed while it solves; the file it leaves is whole, and no digit differs."""
    case = disk()
    assert case.model is not None
    case.model.save(tmp_path / "model.h5")
    (tmp_path / "case.nml").write_text(
        "&model source = 'hdf5' file = 'model.h5' /\n&cyclic engine_order = 2 mistuned = .true. /\n"
        "&sweep start = 0.6 end = 1.6 n_points = 41 /\n&harmonics n_harmonics = 1 /\n")
    file, n = tmp_path / "killed.h5", 500
    words = ["population", str(tmp_path / "case.nml"), "--patterns", str(n), "--seed", "3",
             "--workers", "2", "-q", "-o", str(file)]
    # By itself, behind the first disks that it kept: who looks at the file comes too late at times.
    script = ("import os, sys, fretwear as fw\n"
              f"fw.population(sys.argv[1], {n}, seed=3, workers=2, file=sys.argv[2],\n"
              "              progress=lambda done, total: os.kill(os.getpid(), 9))\n")
    process = subprocess.run([sys.executable, "-c", script, str(tmp_path / "case.nml"), str(file)],
                             check=False, timeout=limit(120.0))
    assert process.returncode == -signal.SIGKILL
    with h5py.File(file) as kept:
        assert 0 < kept["population/done"][()].sum() < n
    assert main(words) == 0
    assert main([*words[:-1], str(tmp_path / "whole.h5")]) == 0
    with h5py.File(file) as one, h5py.File(tmp_path / "whole.h5") as other:
        for name in ("amplitude", "omega", "sector", "amplification", "tuned", "patterns"):
            assert np.array_equal(one[f"population/{name}"], other[f"population/{name}"])


def test_contact_is_drawn_behind_the_patterns() -> None:
    case = disk(pairs=True)
    found = fw.population(case, 2, seed=5, contact={"mu": 0.1}, workers=1)
    rng = np.random.default_rng(5)
    patterns = 0.02 * rng.standard_normal((2, N))
    mu = 0.3 * (1.0 + 0.1 * rng.standard_normal((2, N)))
    assert np.array_equal(found.patterns, patterns)
    for k in range(2):
        one = fw.population(case.replace(contact={"mu": mu[k].tolist()}), patterns[k:k + 1],
                            workers=1)
        assert np.array_equal(one.amplification[0], found.amplification[k])


def test_quantiles_lie_in_their_intervals() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(1.5, 0.2, (4000, 1))
    zero = np.zeros((4000, 1))
    found = fw.Population(zero, values, zero, values, zero.astype(int), np.ones(1), zero[:, 0],
                          zero[:, 0], ("tip",), 0).quantiles(n_samples=300)[0]
    exact = 1.5 + 0.2 * np.array([0.0, 1.6449, 2.3263])
    assert (found[:, 1] <= found[:, 0]).all() and (found[:, 0] <= found[:, 2]).all()
    assert (found[:, 1] <= exact).all() and (exact <= found[:, 2]).all()
    # Asymptotic: sqrt(p (1 - p)/n)/density, twice 1.96 times, to the noise of 300 samples.
    density = np.exp(-0.5 * ((exact - 1.5) / 0.2)**2) / (0.2 * np.sqrt(2.0 * np.pi))
    share = np.array([0.5, 0.95, 0.99])
    width = 2.0 * 1.96 * np.sqrt(share * (1.0 - share) / 4000) / density
    assert np.abs((found[:, 2] - found[:, 1]) / width - 1.0).max() < 0.5


@pytest.mark.parametrize(("more", "told"), [
    ({"patterns": 0}, "must be a number of disks"),
    ({"deviation": -1.0}, "must be a standard deviation"),
    ({"deviation": 3.0}, "draws blades without a frequency"),
    ({"patterns": [[np.nan] * N]}, "must be finite"),
    ({"contact": {"mass": 0.1}}, "must be among mu"),
    ({"contact": {"mu": 0.1}}, "mu is not given for any pair")])
def test_wrong_arguments_are_refused(more: dict[str, object], told: str) -> None:
    with pytest.raises(fw.InputError, match=told):
        fw.population(disk(), **{"patterns": 3, **more})  # type: ignore[arg-type]


def test_command_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["population", str(files_of_disk(tmp_path)), "--patterns", "30", "--seed", "3"]
    assert main([*words, "-q"]) == 0
    told = capsys.readouterr().out
    assert "30 disks" in told and "tip" in told
    with h5py.File(tmp_path / "case_population.h5") as file:
        assert file["population/amplification"].shape == (30, 2)
    assert main([*words, "--contact", "mu"]) == 3
    picture = tmp_path / "picture.png"
    for observe in ([], ["--observe", "root"]):
        assert main(["plot", str(tmp_path / "case_population.h5"), "--kind", "population",
                     "-o", str(picture), *observe]) == 0
    assert picture.stat().st_size > 1000
