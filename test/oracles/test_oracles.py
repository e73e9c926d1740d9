"""fw_run against periodic responses that were computed without any harmonic balance.

test/reference holds them: event by event with exact segments, or by shooting (Duffing).
"""
from __future__ import annotations

import numpy as np
import oracle_cases as cases
import pytest
from oracle_cases import coefficients_of, error
from oracle_runs import read_reference, run_case

DUFFING, COULOMB, JENKINS, TWO_DOF, GAP, PLANAR = map(read_reference, "abcdef")


def within(value, bound):
    """Bounds are tabled with two digits."""
    return float(f"{value:.1e}") <= bound


def solve(folder, groups):
    """Coefficients (2H+1, observed) of a point."""
    return run_case(folder, groups).coefficients[0]


# --- Duffing -------------------------------------------------------------------------------

def first_amplitude(coefficients):
    return np.hypot(coefficients[1], coefficients[2])


# Between the folds at 1.233 and 1.454 rad/s two branches are stable: the upper one is reached from
# below, the lower one from above. Unstable orbits are out of reach of a natural sweep.
@pytest.mark.parametrize("start, end, n_points, upper", [(0.3, 1.43, 114, True),
                                                         (2.5, 1.3, 121, False)])
def test_duffing_stable_branches(tmp_path, start, end, n_points, upper):
    parameters = DUFFING["params"]
    result = run_case(tmp_path, cases.sweep(cases.duffing(parameters, start, 7), start, end,
                                            n_points))
    assert result.converged.all()
    n_checked = 0
    for point in DUFFING["points"]:
        k = int(np.argmin(np.abs(result.omega - point["omega"])))
        same = [p for p in DUFFING["points"] if p["omega"] == point["omega"] and p["stable"]]
        extreme = (max if upper else min)(same, key=lambda p: p["xmax"])
        if abs(result.omega[k] - point["omega"]) > 1e-9 or point is not extreme:
            continue
        n_checked += 1
        # Measured: 8.1e-11 at most.
        expected = first_amplitude(coefficients_of(point))
        assert abs(first_amplitude(result.coefficients[k, :, 0]) - expected) < 1e-8
        # Harmonics 9 and above are cut off; measured: 4.7e-7 at most.
        assert abs(result.amplitude[k, 0] - point["xmax"]) < 1e-6
    assert n_checked == (8 if upper else 7)


# --- Elastic friction, one direction ---------------------------------------------------------

@pytest.mark.parametrize("n_harmonics, bound", [(3, 2.1e-3), (7, 8e-5), (15, 2e-5)])
@pytest.mark.parametrize("name", JENKINS)
def test_jenkins(tmp_path, name, n_harmonics, bound):
    reference = JENKINS[name]
    computed = solve(tmp_path, cases.jenkins(reference["params"], n_harmonics))[:, 0]
    assert within(error(computed, coefficients_of(reference)), bound)


# --- Unilateral spring -----------------------------------------------------------------------

# Orbits on branches to which a point alone is not led: reached along a sweep from this frequency.
GAP_SWEPT_FROM = {"gap_g0.5_F0.3_w1.15": 0.7, "gap_g-0.2_F0.3_w1.5": 0.9}
# A resonance of the second harmonic, where cutting off harmonics shifts the answer far: by 1.16 at
# H = 3, 9.6e-3 at H = 7 (that this solves the balance is checked in test_invariants.py) and 8.1e-5
# at H = 15. It is checked apart.
GAP_RESONANT = "gap_g0.0_F0.3_w0.7"
# The unstable orbits (gapnewton) are left out. The balance happens to reach them, but another start
# may lead to another orbit: nothing is promised for them.
GAP_TABLED = [name for name in GAP if name.startswith("gap_") and name != GAP_RESONANT]


@pytest.mark.parametrize("n_harmonics, bound", [(3, 6e-2), (7, 8e-4), (15, 3e-5)])
@pytest.mark.parametrize("name", GAP_TABLED)
def test_gap(tmp_path, name, n_harmonics, bound):
    reference = GAP[name]
    parameters = reference["params"]
    groups = cases.gap(parameters, n_harmonics)
    if name in GAP_SWEPT_FROM:
        groups = cases.sweep(groups, GAP_SWEPT_FROM[name], parameters["omega"], 31)
    result = run_case(tmp_path, groups)
    assert within(error(result.coefficients[-1, :, 0], coefficients_of(reference)), bound)


def test_gap_resonant(tmp_path):
    reference = GAP[GAP_RESONANT]
    computed = solve(tmp_path, cases.gap(reference["params"], 15))[:, 0]
    assert error(computed, coefficients_of(reference)) < 9e-5


# --- Two degrees of freedom: stick, slip, separation -----------------------------------------

ELASTIC = [name for name in TWO_DOF if not name.startswith("chain")]


@pytest.mark.parametrize("n_harmonics, bound", [(3, 5e-3), (7, 5e-4), (15, 4e-4)])
@pytest.mark.parametrize("name", ELASTIC)
def test_two_dof(tmp_path, name, n_harmonics, bound):
    reference = TWO_DOF[name]
    if n_harmonics == 3 and "separation" in name:
        bound = 0.11
    computed = solve(tmp_path, cases.two_dof(reference["params"], n_harmonics))[:, 0]
    assert within(error(computed, coefficients_of(reference["q1"])), bound)


# Rigid contact behind the same springs: the displacement of the massless node has kinks, which
# the elastic law leaves to the force alone. No table; measured: 0.21, 1.6e-2, 3.8e-3 at most.
@pytest.mark.parametrize("n_harmonics, bound", [(3, 0.25), (7, 2e-2), (15, 5e-3)])
@pytest.mark.parametrize("name", ELASTIC)
def test_two_dof_rigid_on_massless_nodes(tmp_path, name, n_harmonics, bound):
    reference = TWO_DOF[name]
    computed = solve(tmp_path, cases.two_dof_massless(reference["params"], n_harmonics))[:, 0]
    assert error(computed, coefficients_of(reference["q1"])) < bound


@pytest.mark.parametrize("name", ELASTIC)
def test_two_dof_states(tmp_path, name):
    reference = TWO_DOF[name]
    result = run_case(tmp_path, cases.two_dof(reference["params"], 15))
    exact = reference["fraction_of_period"]
    expected = [exact.get("stick", 0.0), exact.get("slip+", 0.0) + exact.get("slip-", 0.0),
                exact.get("open", 0.0)]
    # Each of at most six switches is off by one instant at the most.
    assert np.abs(result.fraction[0, 0] - expected).max() < 6.0 / cases.N_TIME
    # Measured: 6.5e-4 at most.
    assert result.dissipation[0, 0] == pytest.approx(reference["friction_work_per_cycle"], rel=1e-3)


# --- Elastic friction, two directions --------------------------------------------------------

# The radial return of planar slip is of first order in the time step; measured at H = 7:
# 1.7e-3 (A), 3.8e-4 (B), 3.0e-3 (C, slip along a full circle).
@pytest.mark.parametrize("name, bound", [("A", 2e-3), ("B", 5e-4), ("C", 3.5e-3)])
def test_planar(tmp_path, name, bound):
    reference = PLANAR[name]
    computed = solve(tmp_path, cases.planar(reference["params"], 7))
    for i, axis in enumerate("xy"):
        assert error(computed[:, i], np.array(reference[axis])) < bound


def test_planar_error_is_the_sampling(tmp_path):
    """Extrapolating n_time to infinity leaves nothing of the largest error."""
    reference = PLANAR["C"]
    coarse, fine = (solve(tmp_path, cases.planar(reference["params"], 7, n_time=n_time))
                    for n_time in (1024, 2048))
    for i, axis in enumerate("xy"):
        exact = np.array(reference[axis])
        halved = error(fine[:, i], exact) / error(coarse[:, i], exact)
        assert halved == pytest.approx(0.5, abs=0.01)
        # Measured: 3.3e-6.
        assert error(2.0 * fine[:, i] - coarse[:, i], exact) < 1e-5


# --- Rigid friction --------------------------------------------------------------------------

NO_STOPS = "c0.1_N0.4_w0.9"


def peak(folder, name, n_harmonics, **contact):
    """Relative error of the largest displacement."""
    reference = COULOMB[name]
    result = run_case(folder, cases.coulomb(reference["params"], n_harmonics, **contact))
    return result.amplitude[0, 0] / reference["ext"]["max"] - 1.0


@pytest.mark.parametrize("law, n_harmonics, bound", [
    ("dlft", 1, 6e-2), ("dlft", 7, 3e-2), ("dlft", 25, 1e-2),
    ("dlft_velocity", 1, 5e-3), ("dlft_velocity", 7, 1.2e-3)])
def test_coulomb_peak(tmp_path, law, n_harmonics, bound):
    assert within(abs(peak(tmp_path, NO_STOPS, n_harmonics, law=law)), bound)


# The penalty is a means of solution. What the answer keeps of it is part of the truncation error
# and goes faster than that: the spread over a factor of ten, measured, is 3.4e-2, 5.1e-3 and 1.1e-4 of
# the peak, the error at penalty_scale = 1 5.4e-2, 2.6e-2 and 9.1e-3.
@pytest.mark.parametrize("n_harmonics, spread", [(1, 3.5e-2), (7, 5.5e-3), (25, 2e-4)])
def test_coulomb_penalty_hardly_matters(tmp_path, n_harmonics, spread):
    errors = [peak(tmp_path, NO_STOPS, n_harmonics, penalty_scale=scale)
              for scale in (0.3, 1.0, 3.0)]
    assert max(errors) - min(errors) < spread


def test_coulomb_is_rigid_above_resonance(tmp_path):
    """A prediction that halves the stiffness makes a spring of rigid friction: 84 % off here."""
    r, slip = 1.5, 0.5
    linear = 1.0 / (1.0 - r**2)
    lag = np.sin(np.pi / r) / (r * (1.0 + np.cos(np.pi / r)))
    exact = np.sqrt(linear**2 - (slip * lag) ** 2)  # Den Hartog, 1931: motion without stops
    p = {"m": 1.0, "c": 0.0, "k": 1.0, "mu": 0.5, "N0": 1.0, "N1": 0.0, "F": 1.0, "omega": r}
    # Measured at H = 7: 20.0 to 21.1 % (dlft), 7.0 to 10.7 % (dlft_velocity).
    for law, bound in (("dlft", 0.22), ("dlft_velocity", 0.11)):
        for scale in (0.3, 1.0, 3.0):
            groups = cases.coulomb(p, 7, law=law, penalty_scale=scale)
            amplitude = run_case(tmp_path, groups).amplitude[0, 0]
            assert abs(amplitude / exact - 1.0) < bound, (law, scale)


# Stick-slip, and normal loads that vary or vanish for a while; measured: 2.4e-2 at most but for the
# resonant N1.4_w1.0 (4.1e-2) and the long slip of ss_c0.05 (5.2e-2).
@pytest.mark.parametrize("name", COULOMB)
def test_coulomb_velocity_level(tmp_path, name):
    reference = COULOMB[name]
    groups = cases.coulomb(reference["params"], 15, law="dlft_velocity")
    bound = 6e-2 if name in ("c0.1_N1.4_w1.0", "ss_c0.05_N1.6_w0.7") else 3e-2
    assert error(solve(tmp_path, groups)[:, 0], coefficients_of(reference)) < bound


# Measured: 6.2e-2 at most; the forced mass moves little there, so that errors of the force weigh much.
@pytest.mark.parametrize("name", [name for name in TWO_DOF if name.startswith("chain")])
def test_chain_velocity_level(tmp_path, name):
    reference = TWO_DOF[name]
    computed = solve(tmp_path, cases.chain(reference["params"], 15, law="dlft_velocity"))
    for i in (0, 1):
        assert error(computed[:, i], coefficients_of(reference[f"x{i + 1}"])) < 0.07


# --- Event-resolved sampling -----------------------------------------------------------------

EVENTS = {"sampling": "events", "n_time": 0}


def with_events(groups, **harmonics):
    """The same case with the events located instead of sampled, on 4H + 2 instants."""
    return {**groups, "harmonics": {**groups["harmonics"], **EVENTS, **harmonics}}


@pytest.mark.parametrize("n_harmonics, bound", [(3, 2.1e-3), (7, 8.3e-5), (15, 9e-6)])
@pytest.mark.parametrize("name", JENKINS)
def test_jenkins_with_events(tmp_path, name, n_harmonics, bound):
    reference = JENKINS[name]
    computed = solve(tmp_path, with_events(cases.jenkins(reference["params"], n_harmonics)))[:, 0]
    assert within(error(computed, coefficients_of(reference)), bound)


@pytest.mark.parametrize("n_harmonics, bound", [(3, 6e-2), (7, 8e-4), (15, 2e-5)])
@pytest.mark.parametrize("name", GAP_TABLED)
def test_gap_with_events(tmp_path, name, n_harmonics, bound):
    reference = GAP[name]
    parameters = reference["params"]
    groups = with_events(cases.gap(parameters, n_harmonics))
    if name in GAP_SWEPT_FROM:
        groups = cases.sweep(groups, GAP_SWEPT_FROM[name], parameters["omega"], 31)
    result = run_case(tmp_path, groups)
    assert within(error(result.coefficients[-1, :, 0], coefficients_of(reference)), bound)


# What is left is the truncation alone. Measured at H = 15: 3.0e-5, where 1024 instants leave 3.2e-4.
@pytest.mark.parametrize("n_harmonics, bound", [(3, 5e-3), (7, 4e-4), (15, 3.1e-5)])
@pytest.mark.parametrize("name", ELASTIC)
def test_two_dof_with_events(tmp_path, name, n_harmonics, bound):
    reference = TWO_DOF[name]
    if n_harmonics == 3 and "separation" in name:
        bound = 0.11
    if n_harmonics == 7 and "D_separation" in name:
        bound = 5e-4
    result = run_case(tmp_path, with_events(cases.two_dof(reference["params"], n_harmonics)))
    assert error(result.coefficients[0, :, 0], coefficients_of(reference["q1"])) < bound
    if n_harmonics < 15:
        return
    exact = reference["fraction_of_period"]
    expected = [exact.get("stick", 0.0), exact.get("slip+", 0.0) + exact.get("slip-", 0.0),
                exact.get("open", 0.0)]
    # Measured: 1.8e-4 and 3.7e-5 at most; an instant of 1024 is 1e-3.
    assert np.abs(result.fraction[0, 0] - expected).max() < 3e-4
    assert result.dissipation[0, 0] == pytest.approx(reference["friction_work_per_cycle"], rel=5e-5)


def sampled_cases():
    """Friction, a gap, and both, elastic and rigid, with memory and without; H = 7."""
    chosen = {"jenkins": cases.jenkins(JENKINS["jenkins_F1.0_w1.0"]["params"], 7),
              "gap": cases.gap(GAP["gap_g0.5_F0.3_w0.9"]["params"], 7),
              "coulomb": cases.coulomb(COULOMB[NO_STOPS]["params"], 7, law="dlft"),
              "velocity": cases.coulomb(COULOMB[NO_STOPS]["params"], 7, law="dlft_velocity"),
              "separation": cases.two_dof(TWO_DOF["D_separation"]["params"], 7),
              "rigid": cases.two_dof_massless(TWO_DOF["F_separation"]["params"], 7)}
    return chosen.items()


# Two independent routes to one answer. 15 * 1024 instants hold those of the collocation exactly. What
# the finest sampling leaves, measured: 1e-8 to 6e-7; with instants for a landing, of first order,
# 5e-8 here and up to 2e-5 in other cases.
@pytest.mark.parametrize("method", ["hbm", "tcm", "tcm_least_squares"])
@pytest.mark.parametrize("name, groups", sampled_cases())
def test_events_are_the_limit_of_sampling(tmp_path, name, groups, method):
    exact = solve(tmp_path, with_events(groups, method=method))
    fine = solve(tmp_path, with_events(groups, method=method, sampling="uniform", n_time=15360))
    assert np.abs(exact - fine).max() < 2e-6 * np.abs(exact).max()


@pytest.mark.parametrize("name, groups", sampled_cases())
def test_events_need_no_instants(tmp_path, name, groups):
    """4H instants and four times as many give the same answer."""
    few = solve(tmp_path, with_events(groups, n_time=28))
    many = solve(tmp_path, with_events(groups, n_time=112))
    # The tolerance of the solution is 1e-11 of the load, times the condition of the balance.
    assert np.abs(few - many).max() < 1e-9 * np.abs(many).max()


# Fourth order in n_time: what is left at 60 instants is the truncation. Measured: 2.6e-4 (A), 8.9e-5
# (B), 1.4e-8 (C); with 1024 uniform instants 1.7e-3, 3.8e-4, 3.0e-3.
@pytest.mark.parametrize("name, bound", [("A", 3e-4), ("B", 1e-4), ("C", 2e-8)])
def test_planar_with_events(tmp_path, name, bound):
    reference = PLANAR[name]
    computed = solve(tmp_path, with_events(cases.planar(reference["params"], 7)))
    for i, axis in enumerate("xy"):
        assert error(computed[:, i], np.array(reference[axis])) < bound


def test_planar_with_events_needs_no_instants(tmp_path):
    """The circle has no truncation error at H = 15, and is followed to 1e-11 or so."""
    reference = PLANAR["C"]
    groups = cases.planar(reference["params"], 15)
    for n_time in (0, 256):
        found = solve(tmp_path, with_events(groups, n_time=n_time))[:, 0]
        assert error(found, np.array(reference["x"])) < 1e-9


@pytest.mark.parametrize("method", ["tcm", "tcm_least_squares"])
def test_planar_collocation_with_events(tmp_path, method):
    """The same instants of the equations under both samplings."""
    groups = cases.planar(PLANAR["A"]["params"], 7)
    exact = solve(tmp_path, with_events(groups, method=method, n_time=240))
    coarse, fine = (solve(tmp_path, with_events(groups, method=method, sampling="uniform",
                                                n_time=n_time)) for n_time in (7680, 15360))
    assert np.abs(exact - (2.0 * fine - coarse)).max() < 1e-5 * np.abs(exact).max()
