"""Branches through folds: the Duffing oscillator of the reference solutions."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

REFERENCE = Path(__file__).parents[1] / "reference" / "oracle_a_duffing.json"

# The folds of the reference are known to 1e-10; the branch locates them to 1e-10 of omega.
FOLD = 1e-8
# The tolerance of the solver, on the norm of the residual over that of the load.
EQUILIBRIUM = 1e-8

CASE = """
&case title = 'Duffing branch' analysis = 'frf' /
&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.1 /
&spring n_springs = 1 side_1 = 1 coefficient = 0.5 /
&load cosine = 0.25 /
&harmonics n_harmonics = 15 method = '{method}' /
&sweep start = 0.3 end = 2.0 n_points = 50 continuation = 'arclength' /
"""

# A small structure whose last dof sticks: nothing of its linear problems is left.
MASS = np.diag([0.00953, 0.614, 0.372, 0.00101])
STIFFNESS = np.array([[3.42, -1.6, 0, 0], [-1.6, 2.99, -1.39, 0], [0, -1.39, 2.12, -0.733],
                      [0, 0, -0.733, 1.25]])
DAMPING = np.array([[1.88e-4, -2.29e-5, 3.21e-5, 5.13e-8], [-2.29e-5, 9.07e-3, 4.35e-3, 7.01e-6],
                    [3.21e-5, 4.35e-3, 4.43e-3, -2.09e-5], [5.13e-8, 7.01e-6, -2.09e-5, 4.76e-5]])
LOAD = np.array([-0.0111, 0.0114, 0.0133, 0])
STUCK = """
&model n_dof = 4 mass = {mass} stiffness = {stiffness} damping = {damping} /
&contact law = 'dlft' n_pairs = 1 side_1 = 4, 0, 0 mu = 0.3 normal_load = 0.00444 /
&load cosine = {load} /
&harmonics n_harmonics = 1 /
&sweep start = 47.9 end = 16.5 n_points = 31 continuation = 'arclength' /
"""


def _residual(omega: float, row: np.ndarray) -> float:
    """Balance of one row of coefficients by plain sums over 256 instants."""
    tau = 2 * np.pi * np.arange(256) / 256
    n = np.arange(1, len(row) // 2 + 1)
    base = np.vstack([np.ones_like(tau), *np.ravel(
        [[np.cos(k * tau), np.sin(k * tau)] for k in n]).reshape(2 * len(n), -1)])
    velocity = np.zeros_like(row)
    velocity[1::2], velocity[2::2] = n * row[2::2], -n * row[1::2]
    stiffness = np.concatenate([[1.0], np.repeat(1.0 - (n * omega) ** 2, 2)])
    u = row @ base
    force = stiffness * row + 0.1 * omega * velocity
    weights = np.full(len(row), 2.0 / len(tau))
    weights[0] /= 2
    force += weights * (base @ (0.5 * u**3 - 0.25 * np.cos(tau)))
    return float(np.linalg.norm(force)) / 0.25


@pytest.mark.parametrize("method", ["hbm", "hdhb"])
def test_folds_of_the_duffing_oscillator(fw_run, method: str) -> None:
    fw_run.write(CASE.format(method=method), "branch.nml")
    done = fw_run("-q", "-o", "branch.h5", "branch.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "branch.h5") as file:
        omega, fold = file["omega"][:], file["fold"][:]
        rows = file["coefficients"][:, :, 0]
        assert file["converged"][:].all()
    assert omega[0] == 0.3 and omega[-1] == 2.0
    # hdhb aliases: its folds lie elsewhere, by the little that 15 harmonics leave.
    expected = sorted(p["omega"] for p in json.loads(REFERENCE.read_text())["folds_multi"])
    assert sorted(omega[fold]) == pytest.approx(expected, rel=FOLD if method == "hbm" else 1e-6)
    if method == "hbm":
        for w, row in zip(omega, rows):
            assert _residual(w, row) < EQUILIBRIUM, f"row at omega = {w}"


def test_the_branch_is_unstable_between_its_folds(fw_run) -> None:
    fw_run.write(CASE.format(method="hbm"), "branch.nml")
    done = fw_run("-q", "-o", "branch.h5", "--set", "sweep%stability=.true.", "branch.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "branch.h5") as file:
        stable, fold = file["floquet/stable"][:], np.flatnonzero(file["fold"][:])
        multipliers = file["floquet/multipliers"][:]
    # The folds themselves have a multiplier of one: either answer is right there.
    inside = np.zeros(len(stable), dtype=bool)
    inside[fold[0] + 1:fold[1]] = True
    elsewhere = ~inside
    elsewhere[fold] = False
    assert (stable[inside] == 0).all() and (stable[elsewhere] == 1).all()
    # Liouville: the product of the multipliers is exp(-c T / m), whatever the stiffness.
    with h5py.File(fw_run.directory / "branch.h5") as file:
        omega = file["omega"][:]
    value = multipliers[..., 0] + 1j * multipliers[..., 1]
    assert np.prod(value, axis=1) == pytest.approx(np.exp(-0.1 * 2 * np.pi / omega), rel=1e-6)


def test_a_branch_that_turns_back_says_so(fw_run) -> None:
    """max_points ends the run with the status of a sweep that is not complete."""
    fw_run.write(CASE.format(method="hbm"), "branch.nml")
    result = fw_run("-o", "branch.h5", "--set", "sweep%max_points=5", "branch.nml")
    assert result.returncode == 4
    with h5py.File(fw_run.directory / "branch.h5") as file:
        assert len(file["omega"]) == 5


# Two masses, linear but for a spring of nothing: damping of 1.5 and of 0.5 %; n_points, load.
LINEAR = """
&case analysis = 'frf' /
&model n_dof = 2, mass = 1, 0, 0, 1, stiffness = {k}, -{c}, -{c}, {k}, damping = {d} /
&spring n_springs = 1, side_1 = 1, coefficient = 1e-9 /
&load cosine = 1, {load} /
&sweep start = {start}, end = 3, n_points = {n}, continuation = 'arclength' /
"""


@pytest.mark.parametrize(("k", "c", "d", "load", "start", "n", "peaks"), [
    (1.5, 0.5, (0.03, 0.01), 0, 0.3, 21, 2), (1.2, 0.2, (0.012, 0.002), 1, 0.5, 41, 1)])
def test_resonances_are_followed_in_few_points(fw_run, k, c, d, load, start, n, peaks) -> None:
    """The corrector stays near its predictor: no resonance is jumped, and none traced twice."""
    damping = f"{d[0]}, -{d[1]}, -{d[1]}, {d[0]}"
    fw_run.write(LINEAR.format(k=k, c=c, d=damping, load=load, start=start, n=n), "branch.nml")
    done = fw_run("-o", "branch.h5", "branch.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "branch.h5") as file:
        omega, amplitude = file["omega"][:], file["amplitude"][:, 0]
    assert (np.diff(omega) > 0).all() and omega[-1] == 3
    assert len(omega) < 80

    def exact(w):
        dynamic = np.array([[k, -c], [-c, k]]) - w**2 * np.eye(2) + 1j * w * np.array(
            [[d[0], -d[1]], [-d[1], d[0]]])
        return abs(np.linalg.solve(dynamic, [1, load])[0])

    # The spring of nothing moves the response by 1e-9 * 3/4 * 100^3 / 0.01 at most.
    assert amplitude == pytest.approx([exact(w) for w in omega], rel=0.1)
    tops = [max(exact(w) for w in np.linspace(0.97, 1.03, 6001) * mode)
            for mode in (np.sqrt(k - c), np.sqrt(k + c))[:peaks]]
    highest = [amplitude[k] for k in range(1, len(omega) - 1)
               if amplitude[k] > max(amplitude[k - 1], amplitude[k + 1])]
    # Rows stand within a fifth of the half-power width: 4 % below the top.
    assert highest == pytest.approx(tops, rel=0.04)
    # Progress of a branch of unknown length is some lines, and says why it ended.
    assert "followed to the end of the sweep" in done.stderr
    assert len(done.stderr.splitlines()) < 30 < len(omega)


SECTOR = Path(__file__).parents[2] / "example" / "blade_sector" / "frf.nml"


def _sector_branch(fw_run, speed: float, load: float, start: float, end: float):
    return fw_run("-o", "sector.h5", "--set", f"model%rotation_speed={speed}",
                  "--set", f"load%harmonic_scale={load}", "--set", f"sweep%start={start}",
                  "--set", f"sweep%end={end}", "--set", "sweep%n_points=41",
                  "--set", "sweep%continuation='arclength'", str(SECTOR))


@pytest.mark.parametrize(("speed", "load", "start", "end"), [
    (209.44, 0.5, 990, 1007.5), (209.44, 1.0, 990, 1004.7), (261.8, 0.5, 995, 1020),
    (377.0, 0.5, 1005, 1025), (460.8, 0.5, 1017, 1029)])
def test_branches_through_strong_slip(fw_run, speed, load, start, end) -> None:
    """Pairs that slip for the first time turn the branch sharply; it goes on to the end."""
    done = _sector_branch(fw_run, speed, load, start, end)
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "sector.h5") as file:
        hertz = file["omega"][:] / (2 * np.pi)
        assert file["converged"][:].all()
    assert hertz[0] == pytest.approx(start, rel=1e-12)
    assert hertz[-1] == pytest.approx(end, rel=1e-12)
    # It never walks back: what it covers is little more than the interval.
    assert np.abs(np.diff(hertz)).sum() < 1.5 * (end - start)


# Loads that differ by round-off lead up to the last kink in other steps.
@pytest.mark.parametrize(("load", "hertz"), [
    (0.5, 1007.95), (0.5 * (1 + 2e-13), 1007.95), (0.5 * (1 + 5e-13), 1007.95), (1.0, 1005.07),
    (1.0 + 1e-13, 1005.07), (1.0 + 6e-13, 1005.07)])
def test_a_blade_that_nothing_holds(fw_run, load, hertz) -> None:
    """All flanks slip: the static position along the slot is free, and the branch runs away."""
    done = _sector_branch(fw_run, 209.44, load, 990, 1012)
    assert done.returncode == 4
    assert "no longer holds" in done.stderr
    with h5py.File(fw_run.directory / "sector.h5") as file:
        omega, fraction = file["omega"][:], file["contact/fraction"][:]
    assert np.ptp(omega[-8:]) < 1e-6 * omega[-1]
    assert omega[-1] / (2 * np.pi) == pytest.approx(hertz, abs=0.005)
    assert (fraction[-1, :, 1] > 0).all()


# Peaks of natural sweeps of 41 points (example/blade_sector/README.md), which end on it or beside.
LOCKED = [(3, 1.0, 37, 0.3811), (3, 1.0, 41, 0.3811), (3, 0.5, 41, 0.3592), (1, 1.0, 41, 0.4295),
          (1, 0.5, 45, 0.3882)]
# At the last kink every pair slips within a hundredth of a rad/s: whether a branch gets around it
# turns with the round-off of the processor. Of five, three or more have done so on each that was
# tried; the others end in words.
FEWEST_LOCKED = 2
# Into the sharp turns; downwards, as the example goes, all of them end well.
UPWARDS = ("--set", "sweep%start=990", "--set", "sweep%end=1012")
# Corners between 128 instants roughen the branch by 1.3e-4 of its height; rows stand apart.
ROUGH = 1e-3


def test_the_lock_carries_the_branch_on(fw_run) -> None:
    """The same with an axial lock: on to the end, whatever the first step."""
    case, at_the_end = SECTOR.with_name("frf_2000rpm.nml"), 0
    for harmonics, load, n_points, peak in LOCKED:
        done = fw_run("-o", "locked.h5", "--set", f"sweep%n_points={n_points}", "--set",
                      f"harmonics%n_harmonics={harmonics}", "--set",
                      f"load%harmonic_scale={load}", *UPWARDS, case)
        if done.returncode == 4:
            assert "branch: " in done.stderr + done.stdout
            continue
        assert done.returncode == 0, done.stderr
        with h5py.File(fw_run.directory / "locked.h5") as file:
            hertz = file["omega"][:] / (2 * np.pi)
            assert file["converged"][:].all()
            amplitude = file["amplitude"][:, 0]
        assert hertz[-1] == pytest.approx(1012, rel=1e-12)
        assert amplitude.max() == pytest.approx(peak, abs=ROUGH)
        at_the_end += 1
    assert at_the_end >= FEWEST_LOCKED


def test_the_resonance_of_a_stuck_joint_is_not_passed_over(fw_run) -> None:
    """No unknown moves there: the modes with the contact held say how long a step may be."""
    done = fw_run("-o", "stuck.h5", "--set", "load%harmonic_scale=0.02",
                  "--set", "sweep%continuation='arclength'", "--set", "sweep%n_points=5", SECTOR)
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "stuck.h5") as file:
        amplitude = file["amplitude"][:, 0]
        assert np.diff(file["omega"][:]).min() > 0
    # The top of a natural sweep of 1201 points; rows stand within a fifth of the width.
    assert amplitude.max() == pytest.approx(0.06774, rel=0.02)
    assert len(amplitude) < 120


def test_a_small_stuck_joint_has_the_resonances_of_what_it_holds(fw_run) -> None:
    """Judge: the structure without the dof that sticks, solved by NumPy."""
    values = {"mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING, "load": LOAD}
    (fw_run.directory / "held.nml").write_text(STUCK.format(
        **{name: ", ".join(repr(float(x)) for x in a.ravel()) for name, a in values.items()}))
    done = fw_run("-o", "held.h5", "held.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "held.h5") as file:
        amplitude = file["amplitude"][:]
    assert not amplitude[:, 3].any()
    mass, stiffness, damping = (a[:3, :3] for a in (MASS, STIFFNESS, DAMPING))
    omega = np.linspace(18.9, 19.1, 4001)[:, None, None]
    held = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping,
                           LOAD[:3, None].astype(complex))
    # Rows stand within a fifth of the width of the resonance.
    assert amplitude[:, 0].max() == pytest.approx(np.abs(held[:, 0, 0]).max(), rel=0.02)
    assert len(amplitude) < 120


# Ways to go over the last kinks of the locked sector differ by round-off: kernels stand for that.
KERNELS = ("Prescott", "Haswell")


@pytest.mark.parametrize("kernel", KERNELS)
def test_no_branch_comes_back_along_itself_without_a_word(fw_run, monkeypatch, kernel) -> None:
    """Where a branch that turned at a kink ends at its first point, it says so, with the place."""
    monkeypatch.setenv("OPENBLAS_CORETYPE", kernel)
    case, ends = SECTOR.with_name("frf_2000rpm.nml"), []
    for harmonics, load, n_points, _ in LOCKED:
        done = fw_run("-o", "locked.h5", "--set", f"sweep%n_points={n_points}", "--set",
                      f"harmonics%n_harmonics={harmonics}", "--set",
                      f"load%harmonic_scale={load}", *UPWARDS, case)
        words = done.stderr + done.stdout
        assert "closed on itself" not in words
        ends.append(done.returncode == 0)
        if done.returncode:
            assert "turned back on itself" in words or "no continuation was found at" in words
    assert sum(ends) >= FEWEST_LOCKED


def test_a_branch_whose_time_is_over_says_so(fw_run) -> None:
    """Nobody stopped it."""
    done = fw_run("-o", "x.h5", "--set", "case%max_seconds=0.3", "--set",
                  "sweep%continuation='arclength'", "--set", "harmonics%n_harmonics=31",
                  SECTOR.with_name("frf_48.nml"))
    assert done.returncode == 6
    assert "stopped by the user" not in done.stderr
    assert "time limit: the run ended" in done.stderr


# A spring without a load: there is nothing to follow.
AT_REST = """
&case analysis = 'frf' /
&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.02 /
&spring n_springs = 1 side_1 = 1 coefficient = 0.3 /
&sweep start = 0.6 end = 1.6 n_points = 11 continuation = 'arclength' /
&harmonics n_harmonics = 3 /
"""


def test_a_branch_without_a_load_is_a_list_of_rest(fw_run) -> None:
    (fw_run.directory / "rest.nml").write_text(AT_REST)
    done = fw_run("-o", "rest.h5", "rest.nml")
    assert done.returncode == 0, done.stderr
    assert "no vibratory load acts" in done.stdout
    with h5py.File(fw_run.directory / "rest.h5") as file:
        assert np.allclose(file["omega"][:], np.linspace(0.6, 1.6, 11), rtol=1e-12)
        assert not file["amplitude"][:].any()


UNDAMPED = """
&case analysis = 'frf' /
&model n_dof = 2 mass = 1, 0, 0, 1 stiffness = 2, -1, -1, 2 damping = 4*0 /
&load cosine = 1, 0 /
&harmonics n_harmonics = 3 /
&sweep start = 0.6 end = 1.4 n_points = 11 {along} /
"""


@pytest.mark.parametrize("along", ["", "continuation = 'arclength'"])
def test_a_resonance_without_damping_is_told_to_get_some(fw_run, along) -> None:
    (fw_run.directory / "undamped.nml").write_text(UNDAMPED.format(along=along))
    done = fw_run("-o", "undamped.h5", "undamped.nml")
    assert done.returncode == 4
    assert "model%damping" in done.stdout + done.stderr
    assert "take more points around them" not in done.stdout
