"""Some of the branches of each family, and proof that the judges see what is wrong."""
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import branch_chains
import branch_cusps
import branch_joints
import branches
import numpy as np
import pytest

# First seeds of each family: some seconds.
CHAINS, JOINTS, CUSPS = range(16), range(9), (0, 3, 5, 7)
SECTOR = Path(__file__).resolve().parents[2] / "example" / "blade_sector"
# Rows that branches of the sector took when their steps heeded the slip of every pair.
SECTOR_CASES = (("frf.nml", ("harmonics%n_harmonics=3",), 105), ("frf_48.nml", (), 62))


@pytest.mark.parametrize("n_points", branches.FIRST_STEPS)
def test_a_linear_branch_goes_over_every_resonance(n_points):
    for seed in CHAINS:
        verdict = branches.judge_chain(branches.PROGRAM, seed, n_points)
        assert not (verdict.turned or verdict.skipped or verdict.incomplete or verdict.off), (
            seed, verdict)
        assert verdict.interpolation < 2 * branches.TRUE, (seed, verdict)


@pytest.mark.parametrize("seed", JOINTS)
def test_a_branch_holds_what_fine_sweeps_find(seed):
    kind, verdict = branches.judge_joint(branches.PROGRAM, seed)
    assert not (verdict.incomplete or verdict.off or verdict.missed), (kind, verdict)


@pytest.mark.parametrize("seed", CUSPS)
def test_folds_that_are_about_to_merge_are_there(seed):
    kind, verdict = branches.judge_cusp(branches.PROGRAM, seed)
    assert not (verdict.incomplete or verdict.missed or verdict.wrong), (kind, verdict)
    assert verdict.there == 2


@pytest.mark.parametrize(("name", "settings", "before"), SECTOR_CASES)
def test_a_branch_of_many_pairs_is_short_and_true_to_its_response(tmp_path, name, settings,
                                                                  before):
    words = [word for key in (*settings, "sweep%n_points=41") for word in ("--set", key)]
    status, (omega, _, x, _, tangent) = branches.run(
        branches.PROGRAM, tmp_path, "branch", *words, "--set", "sweep%continuation='arclength'",
        SECTOR / name)
    sweep = branches.run(branches.PROGRAM, tmp_path, "sweep", *words, SECTOR / name)[1]
    assert status == 0 and len(omega) < before / 2
    # The vibration at the tip: a static load moves every row alike.
    tangent = tangent[:, 1:].reshape(x.shape)[:, 1:, 0], tangent[:, :1]
    off = branch_joints.distances(omega, x[:, 1:, 0], sweep[0], sweep[2][:, 1:, 0],
                                  np.hstack(tangent[::-1]))
    assert off.max() < branches.TRUE
    # Without every second row it is not.
    few = slice(None, None, 2)
    off = branch_joints.distances(omega[few], x[few, 1:, 0], sweep[0], sweep[2][:, 1:, 0],
                                  np.hstack(tangent[::-1])[few])
    assert off.max() > branches.TRUE


@pytest.mark.parametrize(("load", "n_harmonics"), [(0.25, 1), (0.5, 3)])
def test_a_branch_is_true_where_pieces_meet_close_together(tmp_path, load, n_harmonics):
    """At 2500 rpm pairs change their states in pairs: two corners in one step, and places that a
    step in frequency alone goes over. The cubics missed 0.9 % there."""
    words = [word for key in ("model%rotation_speed=261.8", "sweep%start=1000", "sweep%end=1020",
                              f"load%harmonic_scale={load}", f"harmonics%n_harmonics={n_harmonics}")
             for word in ("--set", key)]
    status, (omega, _, x, _, tangent) = branches.run(
        branches.PROGRAM, tmp_path, "branch", *words, "--set", "sweep%n_points=41",
        "--set", "sweep%continuation='arclength'", SECTOR / "frf.nml")
    assert status == 0
    sweep = branches.run(branches.PROGRAM, tmp_path, "sweep", *words, "--set",
                         "sweep%n_points=601", SECTOR / "frf.nml")[1]
    tip = tangent[:, 1:].reshape(x.shape)[:, 1:, 0]
    off = branch_joints.distances(omega, x[:, 1:, 0], sweep[0], sweep[2][:, 1:, 0],
                                  np.hstack([tangent[:, :1], tip]))
    assert off.max() < branches.TRUE


def test_the_judge_of_chains_sees_what_is_wrong():
    chain = branch_chains.random_chain(3)
    omega = np.linspace(chain.start, chain.end, 4000)
    u = chain.response(omega)[0]
    rows = np.stack([np.zeros_like(u.real), u.real, -u.imag], axis=1)
    good = branch_chains.judge(chain, omega, rows, 0)
    assert not (good.turned or good.skipped or good.incomplete or good.off)
    away = np.abs(omega - chain.omega[0]) > 8 * chain.width[0]
    assert branch_chains.judge(chain, omega[away], rows[away], 0).skipped
    assert branch_chains.judge(chain, omega[::-1], rows[::-1], 0).turned
    assert branch_chains.judge(chain, omega[:-1], rows[:-1], 0).incomplete
    assert branch_chains.judge(chain, omega, 1.001 * rows, 0).off
    assert branch_chains.judge(chain, omega[::400], rows[::400], 0).interpolation > branches.TRUE


def test_the_judge_of_cusps_sees_what_is_wrong():
    cusp = branch_cusps.random_cusp(3)
    folds, omega = cusp.folds(), np.array([0.5, cusp.end])
    assert len(folds) == 2
    right = [("fold", w) for w in folds]
    good = branch_cusps.judge(cusp, 0, omega, right)
    assert not (good.missed or good.wrong or good.open or good.incomplete)
    assert branch_cusps.judge(cusp, 0, omega, right[:1]).missed == 1
    assert branch_cusps.judge(cusp, 0, omega, [*right, ("fold", 0.9)]).wrong == 1
    assert branch_cusps.judge(cusp, 0, omega, [("undecided", w) for w in folds]).open == 2
    # Below the load of the cusp there are none.
    assert not replace(cusp, load=0.9 * cusp.load).folds()


def test_the_judge_of_joints_sees_what_is_wrong():
    """An S that its branch cuts short, held against sweeps along its ends."""
    joint = branch_joints.Joint("cubic", "", 0.0, 1.0)
    a = np.linspace(-1, 1, 400)
    omega = 0.5 + 0.75 * a**3 - 0.25 * a
    turning = np.zeros(len(a), dtype=bool)
    turning[np.searchsorted(a, [-1 / 3, 1 / 3])] = True
    rows = (2 + a)[:, None, None]
    whole = (omega, np.ones(len(a), dtype=bool), rows, turning)
    at = np.linspace(0, 1, 201)

    def sweep(order):
        # What a natural sweep follows: the last root on its side of the folds.
        first = 0 if order > 0 else -1
        value = [np.sort(np.interp(0, [0], [0]) + np.real(r[np.abs(r.imag) < 1e-9]))[first]
                 for r in (np.roots([0.75, 0, -0.25, 0.5 - w]) for w in at)]
        good = np.ones(len(at), dtype=bool)
        found = (at, good, 2 + np.array(value)[:, None, None], ~good)
        return found if order > 0 else tuple(part[::-1] for part in found)

    sweeps = (sweep(1), sweep(-1))
    assert branch_joints.judge(joint, whole, sweeps, 0) == branch_joints.Verdict(400)
    unmarked = (omega, whole[1], rows, np.zeros_like(turning))
    assert branch_joints.judge(joint, unmarked, sweeps, 0).missed
    cut = (a < -0.34) | (a > 0.9)
    short = tuple(part[cut] for part in whole)
    assert branch_joints.judge(joint, short, sweeps, 0).off
