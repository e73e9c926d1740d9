"""Pieces of a sweep as files, and clusters that cannot do the work."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from project import EXAMPLE
from test_pieces import (
    DUFFING,
    OF_THE_WAY,
    SAME,
    SLIDING,
    assert_same_result,
    random_chain,
)

import fretwear as fw
from fretwear import _pool
from fretwear.cli import main
from fretwear.errors import ConvergenceError, InputError
from fretwear.pieces import Share, cutting, join_files, run_share, running
from fretwear.pieces.overlap import Part

#: To which the search for a maximum goes.
SEARCHED = 1e-4


def solved(case: fw.Case, n: int, folder: Path) -> list[Path]:
    paths = [folder / f"{k}.h5" for k in range(1, n + 1)]
    for k, path in enumerate(paths, 1):
        run_share(case, Share(k, k, n), path)
    return paths


def test_joined_parts_are_the_sweep_of_one_process(tmp_path: Path) -> None:
    paths = solved(SLIDING, 3, tmp_path)
    joined = join_files(paths[::-1], tmp_path / "whole.h5")
    assert joined.path == tmp_path / "whole.h5" and joined.status == "complete"
    one = fw.run(SLIDING, in_memory=True)
    assert_same_result(one, joined)
    assert one.omega.tobytes() == joined.omega.tobytes()


def test_parts_solved_as_one_take_the_place_of_several(tmp_path: Path) -> None:
    paths = solved(SLIDING, 3, tmp_path)
    run_share(SLIDING, Share.of("2-3/3"), tmp_path / "both.h5")
    joined = join_files([paths[0], tmp_path / "both.h5"], tmp_path / "whole.h5")
    size = np.abs(joined.coefficients).max()
    assert joined.coefficients == pytest.approx(fw.run(SLIDING).coefficients, abs=SAME * size)


def test_parts_on_different_branches_are_not_joined(tmp_path: Path,
                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    """Without points that lead to it, the second part begins on the lower branch."""
    case = DUFFING.replace(sweep={"end": 2.4})
    with monkeypatch.context() as patch:
        patch.setattr(cutting.Piece, "lead", 0)
        paths = solved(case, 2, tmp_path)
    with pytest.raises(ConvergenceError, match=r"different solutions.*--part 1-2/2"):
        join_files(paths, tmp_path / "whole.h5")
    assert not (tmp_path / "whole.h5").exists()
    run_share(case, Share.of("1-2/2"), tmp_path / "both.h5")
    joined = join_files([tmp_path / "both.h5"], tmp_path / "whole.h5")
    assert np.allclose(fw.run(case).coefficients, joined.coefficients, rtol=0.0, atol=SAME)


def test_what_is_no_whole_is_not_joined(tmp_path: Path) -> None:
    one, two, three = solved(SLIDING, 3, tmp_path)
    for given, words in (((one, three), "no piece has rows"), ((one, two), "no piece has rows"),
                         ((one, two, two, three), "two pieces have rows"), ((), "name the pieces")):
        with pytest.raises(InputError, match=words):
            join_files(given, tmp_path / "whole.h5")
    other = tmp_path / "other.h5"
    run_share(SLIDING.replace(harmonics={"n_harmonics": 2}), Share(3, 3, 3), other)
    with pytest.raises(InputError, match="pieces of different sweeps"):
        join_files([one, two, other], tmp_path / "whole.h5")
    fw.run(SLIDING, tmp_path / "sweep.h5")
    with pytest.raises(InputError, match="is no piece of a sweep"):
        join_files([tmp_path / "sweep.h5"], tmp_path / "whole.h5")


@pytest.mark.parametrize("text", ["", "3", "0/3", "4/3", "2-1/3", "1-4/3", "a/3", "-1/3"])
def test_shares_that_mean_nothing_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="expected K/N, such as 3/16"):
        Share.of(text)


def test_more_parts_than_rows_make_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"65 rows make 4 pieces at most.*take N = 4"):
        run_share(SLIDING, Share(1, 1, 9), tmp_path / "1.h5")
    branch = SLIDING.replace(sweep={"continuation": "arclength"})
    with pytest.raises(InputError, match="run it without --part"):
        run_share(branch, Share(1, 1, 2), tmp_path / "1.h5")


def test_the_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = str(EXAMPLE / "duffing" / "duffing.nml")
    paths = [str(tmp_path / f"{k}.h5") for k in (1, 2)]
    for k, path in enumerate(paths, 1):
        assert main(["run", case, "--part", f"{k}/2", "-o", path, "-q", "--set",
                     "sweep%n_points=40"]) == 0
    assert main(["join", str(tmp_path / "whole.h5"), *paths]) == 0
    assert "converged         40 of 40 points" in capsys.readouterr().out
    assert fw.Result(tmp_path / "whole.h5").n_points == 40
    assert main(["run", case, "--part", "1/2", "--workers", "2"]) == 3
    assert main(["join", str(tmp_path / "whole.h5"), paths[0]]) == 3
    assert "no piece has rows" in capsys.readouterr().err


def test_a_scheduler_without_workers_is_refused(monkeypatch: pytest.MonkeyPatch,
                                                tmp_path: Path) -> None:
    """By its address and by its scheduler file."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(_pool, "_WAIT_FOR_WORKERS", 0.5)
    with distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        (tmp_path / "scheduler.json").write_text(
            '{"address": "' + cluster.scheduler_address + '"}')
        for where in (cluster.scheduler_address, str(tmp_path / "scheduler.json")):
            with pytest.raises(InputError, match=r"has no workers.*dask worker ADDRESS"):
                fw.run(SLIDING, in_memory=True, scheduler=where)
    with pytest.raises(InputError, match="there is no such scheduler file"):
        fw.run(SLIDING, in_memory=True, scheduler=str(tmp_path / "none.json"))


def test_workers_that_die_are_told_of() -> None:
    class KilledWorker(Exception):
        pass

    class Future:
        def result(self) -> None:
            raise KilledWorker("gave up after 4 attempts")

    with pytest.raises(fw.FretwearError, match=r"gave up.*memory-limit"):
        _pool._answer_of(Future())


def assert_same_sweep(one: fw.Result, other: fw.Result) -> None:
    """Rows as in one process, and as many maxima; of these the highest as well as it is known.

    Lower ones are looked for where they stand alone, so that they may be known better.
    """
    assert list(one) == list(other)
    for name in one:
        if (name.startswith(("peak", "remarks")) or name in OF_THE_WAY
                or one[name].dtype.kind == "U"):
            continue
        size = np.nanmax(np.abs(one[name]), initial=0.0)
        assert np.allclose(one[name], other[name], rtol=0.0, atol=SAME * size,
                           equal_nan=True), name
    if "peak/omega" in one:
        assert list(one["peak/observed"]) == list(other["peak/observed"])
        best = int(one["peak/amplitude"].argmax())
        assert other["peak/amplitude"][best] == pytest.approx(one["peak/amplitude"][best],
                                                              rel=SEARCHED)
    assert other.attributes["status"] == one.attributes["status"]
    assert other.attributes["namelist"] == one.attributes["namelist"]


def left_by_a_kill(case: fw.Case, rows: int, folder: Path) -> Path:
    """What a run leaves that is ended by signal 9 after so many rows."""
    names = {"output": {"file": str(folder / "killed.h5")}}
    (folder / "killed.nml").write_text(case.replace(**names).namelist())
    code = ("import os, sys, fretwear as fw\n"
            "def look(done, total):\n"
            f"    if done >= {rows}:\n"
            "        os.kill(os.getpid(), 9)\n"
            "fw.run(fw.Case.from_file(sys.argv[1]), progress=look)\n")
    done = subprocess.run([sys.executable, "-c", code, str(folder / "killed.nml")], check=False,
                          timeout=100)
    assert done.returncode == -signal.SIGKILL
    return folder / "killed.h5.part"


LONG = fw.Case.from_file(EXAMPLE / "blade_sector" / "frf.nml",
                         harmonics={"n_harmonics": 3, "n_time": 64}, sweep={"n_points": 401})


def test_a_killed_sweep_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the rows that are there, with all maxima."""
    # Progress is told from time to time: long enough for its middle not to be the end.
    long = LONG.replace(sweep={"n_points": 2401})
    left = left_by_a_kill(long, 250, tmp_path)
    with h5py.File(left) as file:
        n_rows = len(file["omega"])
    # What was not flushed is lost: up to twenty times what a flush takes.
    assert 100 <= n_rows < 2401
    solved: list[int] = []
    monkeypatch.setattr(running, "_part", counted(running._part, solved))
    again = fw.run(long, in_memory=True, restart=left)
    # Of those that are there four at the end, and seven around each maximum.
    assert sum(solved) <= 2401 - n_rows + 4 + 7 * len(solved[1:])
    assert_same_sweep(fw.run(long, in_memory=True), again)


def test_few_rows_are_solved_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 401, of which 300 are there: the 101 others, four before them, seven at the maximum."""
    fw.run(LONG, tmp_path / "whole.h5")
    left, solved = tmp_path / "left.h5", list[int]()
    with h5py.File(tmp_path / "whole.h5") as file, h5py.File(left, "w") as kept:
        keep_rows(file, kept, 300)
    monkeypatch.setattr(running, "_part", counted(running._part, solved))
    fw.run(LONG, in_memory=True, restart=left)
    assert sorted(solved) == [7, 105]


def counted(part: Callable[..., Part], rows: list[int]) -> Callable[..., Part]:
    def count(*arguments: Any) -> Part:
        given = part(*arguments)
        rows.append(len(given.places))
        return given
    return count


@pytest.mark.parametrize("case", [
    SLIDING, DUFFING.replace(sweep={"stability": True}),
    SLIDING.replace(sweep={"start": 2.0, "end": 0.4}),
    SLIDING.replace(sweep={"parameter": "contact%mu", "frequency": 1.1, "start": 0.1})],
    ids=["sliding", "stability", "downwards", "parameter"])
@pytest.mark.parametrize("rows", [2, 9, 33, 60])
def test_stopped_sweeps_go_on(case: fw.Case, rows: int, tmp_path: Path) -> None:
    """Wherever they were stopped, by one worker and by two."""
    whole = fw.run(case, in_memory=True)
    left = tmp_path / "left.h5"
    fw.run(case, tmp_path / "whole.h5")
    with h5py.File(tmp_path / "whole.h5") as file, h5py.File(left, "w") as kept:
        keep_rows(file, kept, rows)
    assert_same_sweep(whole, fw.run(case, in_memory=True, restart=left))
    assert_same_sweep(whole, fw.run(case, in_memory=True, restart=left, workers=2))


def keep_rows(file: h5py.File, kept: h5py.File, rows: int) -> None:
    """A file as it is after so many rows."""
    for name, value in file.attrs.items():
        kept.attrs[name] = value

    def take(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith(("peak", "bifurc", "remarks")):
            labels = [str(label) for label in item.attrs.get("DIMENSION_LABELS", [""])]
            is_of_points = labels[:1] == ["point"]
            new = kept.create_dataset(name, data=item[:rows] if is_of_points else item[()])
            for key, value in item.attrs.items():
                if key == "DIMENSION_LABELS":
                    new.attrs[key] = value

    file.visititems(take)
    kept.attrs["status"] = "incomplete"


def test_what_cannot_go_on_is_refused(tmp_path: Path) -> None:
    whole = tmp_path / "whole.h5"
    fw.run(SLIDING, whole)
    for given, case, words in (
            (whole, SLIDING, "has all 65 rows"),
            (whole, SLIDING.replace(harmonics={"n_harmonics": 2}),
             r"n_harmonics = 3, but this case has 2: --restart goes on with the same case"),
            (whole, SLIDING.replace(sweep={"continuation": "arclength"}),
             "run it without --restart")):
        with pytest.raises(InputError, match=words):
            fw.run(case, in_memory=True, restart=given)
    (tmp_path / "text.h5").write_text("no result")
    for name in ("text.h5", "none.h5"):
        with pytest.raises(fw.OutputError, match="cannot be read"):
            fw.run(SLIDING, in_memory=True, restart=tmp_path / name)


def test_a_part_that_is_there_is_not_solved_again(tmp_path: Path,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    """But for another case, or another model file."""
    case = fw.Case.from_file(EXAMPLE / "duffing" / "duffing.nml", sweep={"n_points": 64})
    target, solved = tmp_path / "1.h5", list[int]()
    monkeypatch.setattr(running, "_part", counted(running._part, solved))
    for _ in range(2):
        run_share(case, Share(1, 1, 2), target)
        assert len(solved) == 1
    run_share(case.replace(case={"title": "another"}), Share(1, 1, 2), target)
    assert len(solved) == 1
    run_share(case.replace(harmonics={"n_harmonics": 2}), Share(1, 1, 2), target)
    assert len(solved) == 2
    target.write_bytes(target.read_bytes()[:1000])
    run_share(case, Share(1, 1, 2), target)
    assert len(solved) == 3


def test_random_sweeps_go_on(tmp_path: Path) -> None:
    """Chains that rub, up or down, left at any row."""
    rng = np.random.default_rng(21)
    for _ in range(8):
        case = random_chain(rng)
        left = tmp_path / "left.h5"
        whole = fw.run(case, tmp_path / "whole.h5", check=False)
        with h5py.File(tmp_path / "whole.h5") as file, h5py.File(left, "w") as kept:
            keep_rows(file, kept, int(rng.integers(1, whole.n_points)))
        again = fw.run(case, in_memory=True, check=False, restart=left,
                       workers=int(rng.integers(1, 3)))
        assert (whole.converged == again.converged).all()
        solved = whole.converged.astype(bool)
        assert np.allclose(whole.coefficients[solved], again.coefficients[solved], rtol=0.0,
                           atol=1e-5 * np.abs(whole.coefficients).max())
