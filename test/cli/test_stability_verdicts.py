"""Verdicts on stability stand only where truncation could not turn them."""
from __future__ import annotations

import h5py
import numpy as np

# A spring of power 5 under a strong load: five harmonics are far from enough.
CASE = """
&case analysis = 'frf' /
&model n_dof = 1, mass = 1, stiffness = 1, damping = 0.05 /
&spring n_springs = 1, side_1 = 1, side_2 = 0, coefficient = 1.0, power = 5 /
&load cosine = 1.5, static = 0.3 /
&sweep start = 0.4, end = 0.8, n_points = 21, stability = .true. /
&output observe = 1 /
"""
FEW, MANY = 5, 31
# Solutions of few and many harmonics are of one branch where they agree to this.
SAME_BRANCH = 0.1


def solve(fw_run, n_harmonics):
    fw_run.write(CASE, "power.nml")
    done = fw_run("-o", "power.h5", "--set", f"harmonics%n_harmonics={n_harmonics}", "power.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "power.h5") as file:
        values = file["floquet/multipliers"][:] @ [1.0, 1.0j]
        remarks = file["remarks/name"].asstr()[:] if "remarks" in file else []
        return (done.stdout, values, file["floquet/error"][:], file["floquet/stable"][:],
                file["amplitude"][:, 0], list(remarks))


def test_a_verdict_that_truncation_could_turn_is_open(fw_run) -> None:
    said, few, error, verdict, amplitude, remarks = solve(fw_run, FEW)
    _, many, small, truth, true_amplitude, _ = solve(fw_run, MANY)
    alike = np.abs(amplitude / true_amplitude - 1.0) < SAME_BRANCH
    raw = (np.abs(few).max(axis=1) <= 1.0).astype(int)
    # Many harmonics are certain nearly everywhere, and their errors are small.
    assert (truth >= 0).sum() >= 19 and np.nanmedian(small) < 1e-3
    # Taken by their moduli alone, some points would have the wrong verdict: they are left open.
    wrong = alike & (truth >= 0) & (raw != truth)
    assert wrong.sum() >= 4
    assert (verdict[wrong] == -1).all()
    # Where there is a verdict it is right, and there is one at some points.
    given = alike & (verdict >= 0) & (truth >= 0)
    assert given.any() and (verdict[given] == truth[given]).all()
    assert "undecided" in said and "stability undecided" in remarks
    # The estimate covers the distance to the better multipliers, in either order.
    distance = np.minimum(np.abs(few - many).max(axis=1), np.abs(few - many[:, ::-1]).max(axis=1))
    known = alike & np.isfinite(error).all(axis=1)
    assert (distance[known] <= error[known].max(axis=1)).all()


def test_a_pair_at_shakedown_is_a_spring(fw_run) -> None:
    """A pair that slipped on its way to the period and sticks in it adds no multiplier of one."""
    fw_run.write("""
&case analysis = 'point' /
&model n_dof = 1, mass = 1, stiffness = 1, damping = 0.1 /
&contact law = 'penalty', n_pairs = 1, side_1 = 1, 0, 0, side_2 = 0, 0, 0, mu = 0.5
   normal_load = 1.0, tangential_stiffness = 1.0 /
&load cosine = 0.2, static = 2.0 /
&harmonics n_harmonics = 5 /
&sweep start = 1.2, stability = .true. /
""", "shake.nml")
    done = fw_run("-q", "-o", "shake.h5", "shake.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "shake.h5") as file:
        slip = file["contact/fraction"][0, 0, 1]
        values = file["floquet/multipliers"][0] @ [1.0, 1.0j]
        assert file["floquet/stable"][0] == 1
    # One instant at an end of its path touches the cone.
    assert slip < 0.05
    root = np.sqrt(2.0 - 0.05**2)
    exact = np.exp(2 * np.pi / 1.2 * np.array([-0.05 + 1j * root, -0.05 - 1j * root]))
    assert np.abs(np.sort_complex(values) - np.sort_complex(exact)).max() < 1e-8
