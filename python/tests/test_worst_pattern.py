"""The pattern that amplifies most: against searches on small disks."""

from pathlib import Path

import numpy as np
import pytest
from test_populations import N, disk, files_of_disk

import fretwear as fw
from fretwear.cli import main

BOX = 0.06


def test_no_pattern_of_a_search_is_worse() -> None:
    """All corners of the box, all patterns of three values, and 2,000 drawn ones."""
    case = disk()
    found = fw.worst_pattern(case, BOX, starts=8, seed=1)
    assert (np.abs(found.pattern) <= BOX).all()
    assert found.ended.all() and found.agree >= 1
    grid = np.stack(np.meshgrid(*[[-BOX, 0.0, BOX]] * N), axis=-1).reshape(-1, N)
    drawn = np.random.default_rng(2).uniform(-BOX, BOX, (2000, N))
    searched = fw.population(case, np.vstack([grid, drawn]))
    assert searched.amplification[:, 0].max() <= found.amplification * (1.0 + 1e-6)
    # What it says of its pattern is so.
    again = fw.population(case, found.pattern[None])
    assert again.amplification[0, 0] == pytest.approx(found.amplification, rel=1e-12)
    assert again.sector[0, 0] == found.sector and again.omega[0, 0] == found.omega
    # No small change inside of the box is worse.
    near = found.pattern + 1e-3 * BOX * np.random.default_rng(3).normal(size=(200, N))
    around = fw.population(case, np.clip(near, -BOX, BOX))
    assert around.amplification[:, 0].max() <= found.amplification * (1.0 + 1e-6)


def test_friction_and_given_starts() -> None:
    case = disk(pairs=True).replace(sweep={"start": 0.8, "end": 1.2, "n_points": 17})
    drawn = fw.population(case, 4, seed=3, deviation=0.02)
    starts = np.clip(drawn.patterns, -BOX, BOX)
    before = fw.population(case, starts).amplification[:, 0]
    found = fw.worst_pattern(case, BOX, starts=starts)
    assert (found.all >= before).all()
    assert found.amplification > before.max()


@pytest.mark.parametrize(("more", "told"), [
    ({"box": -1.0}, "must be a deviation between 0 and 1"),
    ({"starts": 0}, "must be a number of patterns"),
    ({"starts": [[0.1] * N]}, "inside of the box")])
def test_wrong_arguments_are_refused(more: dict[str, object], told: str) -> None:
    with pytest.raises(fw.InputError, match=told):
        fw.worst_pattern(disk(), **{"box": 0.05, **more})  # type: ignore[arg-type]


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["population", str(files_of_disk(tmp_path)), "--worst", "--starts", "2", "-q"]
    assert main([*words, "--box", "0.03"]) == 0
    told = capsys.readouterr().out
    assert "a local maximum" in told and "&mistuning frequency = " in told
    assert main([*words, "--contact", "mu=0.1"]) == 3
