"""Worn cylinders: steady states that are right or carry a remark, scars that grow without end."""
import numpy as np
import pytest
from cases import read, run
from project import PROGRAM
from scar_cases import Scar, groups, led, marched, write_model
from steady_states import WORDS, random_scar, verdict

MODULUS, RADIUS, LOAD, MU, SHARE = 200e3 / (2 * (1 - 0.3**2)), 6.0, 18.5, 0.8, 0.75
#: Half width of the unworn contact, and of its stick zone.
WIDTH = np.sqrt(4.0 * LOAD * RADIUS / (np.pi * MODULUS))
STICK = WIDTH * np.sqrt(1.0 - SHARE)
#: The judge's steps and those of the program, as parts of the depth.
SAME_PROFILE = 0.02
#: Two measures of one slip: sums of thousands of terms; with the lag of pseudo-time's vibration.
SAME_ENERGY, SAME_WITH_LAG = 1e-8, 5e-3


def scar(n, reach):
    """Cells over so many half widths of the stick zone."""
    return Scar(n, 2.0 * reach * STICK / n, MODULUS, RADIUS, LOAD, MU, SHARE * MU * LOAD)


def worn(folder, case, n_harmonics, **wear):
    """The result of a run."""
    write_model(folder / "model.h5", case)
    run(folder, groups(case, n_harmonics, **wear))
    return read(folder / "case.h5")


def energy_of(case, found):
    """The friction energy that the last depths stand for, pair by pair."""
    return found["wear/depth"][-1] * case.cell * case.mu / case.wear


def test_long_steps_do_not_wear_what_sticks(tmp_path):
    """With steps of a twelfth of the depth the outermost cells that stick would wear: the volume
    was 32 % too large."""
    case = scar(60, 3)
    true = marched(case)
    found = worn(tmp_path, case, 5, max_depth_step=true.max() / 12)
    depth = found["wear/depth"][-1]
    assert found["wear"]["steady_state"] == "reached"
    assert abs(depth - true).max() < SAME_PROFILE * true.max()
    assert not depth[true == 0.0].any()
    assert "remarks/name" not in found
    energy = energy_of(case, found)
    assert abs(found["wear/energy"][-1] - energy).max() < SAME_ENERGY * energy.max()


def test_too_few_harmonics_are_noticed(tmp_path):
    """Whatever the steps, five harmonics wear cells that fifteen hold."""
    case = scar(60, 4)
    true = marched(case)
    found = worn(tmp_path, case, 5, max_depth_step=true.max() / 50)
    assert found["wear/depth"][-1].sum() > 1.2 * true.sum()
    assert b"too few harmonics" in list(found["remarks/name"])
    found = worn(tmp_path, case, 9, max_depth_step=true.max() / 12)
    assert abs(found["wear/depth"][-1] - true).max() < SAME_PROFILE * true.max()
    assert "remarks/name" not in found


def test_remarks_survive_a_restart(tmp_path):
    """What was noticed before a run ended is said by the run that goes on from there, to the same
    numbers."""
    case = scar(60, 4)
    wear = {"max_depth_step": marched(case).max() / 12}
    whole = worn(tmp_path, case, 5, **wear)
    rows = len(whole["wear/cycles"])
    run(tmp_path, groups(case, 5, **wear, max_steps=rows - 3), name="part", status=4)
    run(tmp_path, groups(case, 5, **wear), "--restart", "part.h5", name="rest")
    rest = read(tmp_path / "rest.h5")
    for name in ("wear/depth", "wear/energy", "wear/rate", "coefficients"):
        assert rest[name].tobytes() == whole[name].tobytes(), name
    assert list(rest["remarks/name"]) == list(whole["remarks/name"])


def test_pseudo_time_chooses_its_steps(tmp_path):
    """A scar in gross slip grows far beyond the compression of the cells that it began with: the
    steps grow with it, and every row of the way is one."""
    case = Scar(30, 0.6 / 30, MODULUS, RADIUS, LOAD, MU, 0.0)
    write_model(tmp_path / "model.h5", case, motion=0.0125)
    run(tmp_path, groups(case, 1, scheme="pseudo_time", n_cycles=18000.0))
    found = read(tmp_path / "case.h5")
    assert found["wear/cycles"][-1] == 18000.0
    assert found["converged"].all()
    energy = energy_of(case, found)
    assert abs(found["wear/energy"][-1] - energy).max() < SAME_WITH_LAG * energy.max()
    # Every cell wears but for the rim; the sliding is 4 times the motion less what is elastic.
    volume = found["wear/depth"][-1].sum() * case.cell
    assert volume == pytest.approx(case.wear * LOAD * 4 * 0.0125 * 18000.0, rel=0.05)


def test_new_contacts_cost_little(tmp_path):
    """Cells that touch at the rim of a growing scar: three stages of two iterations or three, with
    the steps that are tried again. It was 34 a step."""
    case = Scar(30, 0.4 / 30, MODULUS, RADIUS, LOAD, MU, 0.0)
    motion, cycles = 0.0125, 2000.0
    write_model(tmp_path / "model.h5", case, motion=motion)
    run(tmp_path, groups(case, 7, n_cycles=cycles))
    found = read(tmp_path / "case.h5")
    assert found["iterations"][1:].mean() < 9.0
    assert len(found["wear/cycles"]) < 80
    true = led(case, motion, cycles)
    assert np.count_nonzero(true) >= 2 * np.count_nonzero(found["wear/rate"][0])
    # Seven harmonics of a square wave slide 0.8 % too far.
    assert abs(found["wear/depth"][-1] - true).max() < SAME_PROFILE * true.max()


def test_explicit_steps_that_overshoot(tmp_path):
    """They say so."""
    case = scar(30, 4)
    true = marched(case)
    found = worn(tmp_path, case, 7, scheme="explicit", max_depth_step=true.max() / 12)
    assert b"steps too long" in list(found["remarks/name"])
    found = worn(tmp_path, case, 7, scheme="explicit",
                 max_depth_step=true.max() / 100)
    assert b"steps too long" not in list(found.get("remarks/name", []))


@pytest.mark.parametrize("steps", [{}, {"scheme": "pseudo_time"}], ids=["implicit", "pseudo-time"])
def test_one_step_for_the_whole_wear(tmp_path, steps):
    """What nothing estimates is not trusted without a word."""
    case = scar(30, 4)
    whole = marched(case).max()
    found = worn(tmp_path, case, 7, max_depth_step=10.0 * whole, **steps)
    assert b"steps too long" in list(found["remarks/name"])


@pytest.mark.parametrize("seed", range(6))
def test_random_scars(tmp_path, seed):
    """The first of the family that docs/robustness.md counts."""
    case, n_harmonics, scheme, step = random_scar(seed)
    word = verdict(tmp_path, case, n_harmonics, scheme, step, marched(case), PROGRAM)
    assert word in WORDS[:3]
