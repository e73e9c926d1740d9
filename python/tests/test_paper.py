"""The gallery of the paper on coarse settings, and what it claims."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from project import PROGRAM

#: Profiles of wear that count as the same, as a part of the largest depth.
SAME_PROFILE = 0.01
#: Part of the linear solutions of the implicit scheme that pseudo-time may take: 29 % in the paper.
LARGEST_SHARE = 0.35


@pytest.fixture
def bench(tmp_path: Path):
    """Runs cases once and coarse."""
    from bench.common.measure import Bench

    return Bench(PROGRAM, tmp_path, quick=True)


def check_pictures(text: str, folder: Path) -> None:
    """Every picture of a text is there and is no empty frame, and no number is missing."""
    names = re.findall(r"\]\((\w+\.png)\)", text)
    assert names
    assert all((folder / name).stat().st_size > 5000 for name in names)
    assert not re.search(r"\bnan\b", text)


def test_wear_at_3600_rpm(bench, tmp_path: Path) -> None:
    from bench.common.wear_runs import difference
    from bench.paper.gallery_wear import measure_wear, write_wear

    wear = measure_wear(bench)
    assert wear.implicit.is_steady and wear.pseudo.is_steady
    assert difference(wear.pseudo.depth, wear.implicit.depth) < SAME_PROFILE
    assert difference(wear.implicit.depth, wear.reference.depth) < SAME_PROFILE
    assert wear.share_of_solves < LARGEST_SHARE
    assert wear.implicit.n_rejected == wear.pseudo.n_rejected == 0
    assert wear.implicit.n_worn == 27  # the upper rows of either flank, and three below
    assert wear.implicit.swing[-1] < 0.9 * wear.implicit.swing[0]
    assert wear.worn.omega[wear.worn.amplitude[:, 0].argmax()] < (
        wear.unworn.omega[wear.unworn.amplitude[:, 0].argmax()])
    check_pictures(write_wear(tmp_path, wear), tmp_path)


def test_wear_at_2500_rpm(bench, tmp_path: Path) -> None:
    from bench.paper.gallery_path import STANDARD, measure_path, write_path

    path = measure_path(bench)
    assert all(run.is_steady for run in path.runs.values())
    assert path.runs[STANDARD].n_worn >= 44
    assert 5.0 < path.fall < 10.0
    others = [path.apart(name) for name in path.runs if name != STANDARD]
    assert all(1e-3 < apart < 0.2 for apart in others)
    assert min(run.n_rejected for run in path.runs.values()) == 0
    check_pictures(write_path(tmp_path, path), tmp_path)


def test_cost_of_a_profile(bench, tmp_path: Path) -> None:
    from bench.paper.gallery_cost import IMPLICIT, measure_cost, write_cost

    cost = measure_cost(bench)
    assert cost.floor < SAME_PROFILE
    assert all(cost.error(run) < SAME_PROFILE
               for runs in cost.runs.values() for run in runs.values())
    # Fewer steps take fewer linear solutions.
    assert cost.runs[IMPLICIT]["1/10"].n_solves < cost.runs[IMPLICIT]["1/20"].n_solves
    setting, _ = cost.cheapest(IMPLICIT, cost.error(cost.runs[IMPLICIT]["1/10"]))
    assert setting == "1/10"
    check_pictures(write_cost(tmp_path, cost), tmp_path)


def test_effects_of_the_discretisation(bench) -> None:
    from bench.paper.gallery_effects import measure_effects, write_effects

    effects = measure_effects(bench)
    assert 0.0 < effects.change(("harmonics", "n_time", 64)) < SAME_PROFILE
    assert "harmonics%n_time" in write_effects(effects)


def test_responses(bench, tmp_path: Path) -> None:
    from bench.paper.gallery_response import measure_response, value_of, write_response

    response = measure_response(bench)
    # One harmonic seen at three instants is no response; three harmonics at seven come close.
    assert value_of(response, "hdhb", True, 1) > 10.0 * value_of(response, "hbm", False, 1)
    assert value_of(response, "hdhb", True, 3) < 0.3 * value_of(response, "hdhb", True, 1)
    assert all(run.converged.all() for run in response.solvers.values())
    text = write_response(tmp_path, response)
    assert all((tmp_path / name).stat().st_size > 5000
               for name in re.findall(r"\]\((\w+\.png)\)", text))


def test_half_the_swing_leaves_the_static_part_out() -> None:
    import numpy as np

    from bench.common.wear_runs import half_swing

    assert half_swing(np.array([[7.0, 3.0, 4.0]])) == pytest.approx([5.0], rel=1e-4)
    assert half_swing(np.array([[1.0, 0.0, 0.0, 2.0, 0.0]])) == pytest.approx([2.0], rel=1e-4)
