"""Bifurcations of branches and of natural sweeps: kind, place, summary, result file, picture."""
from __future__ import annotations

import fretwear as fw
import h5py
import numpy as np
import pytest

DUFFING = """
&case analysis = 'frf' /
&model n_dof = 1, mass = 1, stiffness = 1, damping = 0.1 /
&spring n_springs = 1, side_1 = 1, side_2 = 0, coefficient = 0.5, power = 3 /
&load cosine = 0.25 /
&harmonics n_harmonics = 9 /
&sweep start = 0.3, end = 2.5, continuation = 'arclength' /
&output observe = 1 /
"""
STOP = """
&case analysis = 'frf' /
&model n_dof = 1, mass = 1, stiffness = 1, damping = 0.1 /
&contact law = 'penalty', n_pairs = 1, side_1 = 0, 0, -1, side_2 = 0, 0, 0, mu = 0, gap = 0
   normal_stiffness = 5, tangential_stiffness = 1 /
&load cosine = 0.3 /
&harmonics n_harmonics = 15 /
&sweep start = 0.6, end = 2.5, n_points = 41, stability = .true. /
&output observe = 1 /
"""
# By shooting in time (test/bifurcations/orbit_judge.py), which shares no code with the program.
FOLDS = (1.4574126, 1.2328070)
DOUBLINGS = (0.6159834, 0.8449861, 0.9541156, 2.2885096)
# The solution at a stop converges like H**-2.5: 4e-5 measured at H = 15.
STOP_TOLERANCE = 2e-4


def places(path):
    with h5py.File(path) as file:
        if "bifurcation" not in file:
            return []
        group = file["bifurcation"]
        names = [str(name) for name in group["kind"].attrs["names"]]
        return [(names[kind], omega) for kind, omega in zip(group["kind"][:], group["omega"][:])]


def test_folds_of_a_branch_need_no_multipliers(fw_run) -> None:
    fw_run.write(DUFFING, "duffing.nml")
    done = fw_run("-o", "duffing.h5", "duffing.nml")
    assert done.returncode == 0, done.stderr
    found = places(fw_run.directory / "duffing.h5")
    assert [kind for kind, _ in found] == ["fold", "fold"]
    assert [omega for _, omega in found] == pytest.approx(FOLDS, rel=1e-6)
    assert "bifurcations      fold at 1.457413E+00 rad/s" in done.stdout
    result = fw.Result(fw_run.directory / "duffing.h5")
    assert np.isnan(result.bifurcations[0].multiplier)
    # A fold is a row of its own.
    rows = result.omega[result["fold"].astype(bool)]
    assert [place.omega for place in result.bifurcations] == pytest.approx(rows, rel=1e-12)


def test_a_fold_is_no_branch_point_too(fw_run) -> None:
    """A multiplier passes 1 at a fold: it is named once."""
    fw_run.write(DUFFING, "duffing.nml")
    done = fw_run("-q", "-o", "duffing.h5", "--set", "sweep%stability=.true.", "duffing.nml")
    assert done.returncode == 0, done.stderr
    result = fw.Result(fw_run.directory / "duffing.h5")
    assert [place.kind for place in result.bifurcations] == ["fold", "fold"]
    assert [abs(place.multiplier) for place in result.bifurcations] == pytest.approx([1, 1],
                                                                                     abs=1e-3)


@pytest.mark.parametrize("continuation", ["arclength", "natural"])
def test_period_doubling_at_a_stop(fw_run, continuation) -> None:
    fw_run.write(STOP, "stop.nml")
    done = fw_run("-o", "stop.h5", "--set", f"sweep%continuation={continuation}", "stop.nml")
    assert done.returncode == 0, done.stderr
    # Where the stop is just reached 15 harmonics cannot tell: a branch may say so, twice.
    found = [place for place in places(fw_run.directory / "stop.h5") if place[0] != "undecided"]
    assert [kind for kind, _ in found] == ["period doubling"] * len(DOUBLINGS)
    assert [omega for _, omega in found] == pytest.approx(DOUBLINGS, rel=STOP_TOLERANCE)
    assert done.stdout.count("period doubling at") == len(DOUBLINGS)
    result = fw.Result(fw_run.directory / "stop.h5")
    decided = [place for place in result.bifurcations if place.kind != "undecided"]
    for place, omega in zip(decided, DOUBLINGS):
        assert place.multiplier == pytest.approx(-1.0, abs=1e-7)
        assert place.found_by == "multiplier"
        assert abs(place.omega - omega) <= place.error
    # On either side of each the verdicts differ.
    order = np.argsort(result.omega)
    crossings = np.diff(result.stable[order]) != 0
    assert crossings.sum() == len(DOUBLINGS)


def test_bifurcations_are_marked_in_the_picture(fw_run) -> None:
    fw_run.write(STOP, "stop.nml")
    assert fw_run("-q", "-o", "stop.h5", "stop.nml").returncode == 0
    result = fw.Result(fw_run.directory / "stop.h5")
    axes = fw.plot_response(result).axes[0]
    marked = [line for line in axes.lines if line.get_label() == "period doubling (4)"]
    assert len(marked) == 1
    assert marked[0].get_xdata() == pytest.approx([p.frequency for p in result.bifurcations])


def test_no_verdict_no_bifurcation(fw_run) -> None:
    """Without `stability` a natural sweep has none, and a result none to read."""
    fw_run.write(STOP, "stop.nml")
    done = fw_run("-o", "stop.h5", "--set", "sweep%stability=.false.", "stop.nml")
    assert done.returncode == 0, done.stderr
    assert "bifurcations" not in done.stdout
    assert fw.Result(fw_run.directory / "stop.h5").bifurcations == []
