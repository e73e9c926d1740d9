"""Some of the random branches of each family, and proof that the comparison sees what is wrong."""
from __future__ import annotations

import bifurcations
import numpy as np
import orbit_judge
import pytest
import stop_judge
from bifurcation_cases import FAMILIES, random_sample

# Branches at a stop take the judge longer, and those of two masses.
SEEDS = {family: range(1 if family in ("stop", "torus") else 2) for family in FAMILIES}


@pytest.mark.parametrize(("family", "seed"), [(f, seed) for f in FAMILIES for seed in SEEDS[f]])
def test_kinds_and_places(family, seed):
    sample = random_sample(family, seed)
    true = bifurcations.known(sample)
    assert true is not None
    status, found = bifurcations.named(bifurcations.PROGRAM, sample)
    assert status == 0
    verdict = bifurcations.compare(family, true, found)
    assert not (verdict.missed or verdict.wrong), verdict
    if family == "torus":
        assert [kind for kind, *_ in true].count(orbit_judge.TORUS) >= 2 and not verdict.undecided


@pytest.mark.parametrize("stability", [False, True])
def test_a_branch_goes_straight_through_where_another_crosses_it(stability):
    """Two masses whose common motion others branch off at 1.37739 and 1.39135, with one fold
    between (all by shooting): the program turned aside there and named two folds more."""
    sample = random_sample("parametric", 12)
    sample.start, sample.stability = 1.45, stability
    status, found = bifurcations.named(bifurcations.PROGRAM, sample)
    # It comes back to where it started: the end lies on another branch.
    assert status == 4
    true = [("symmetry breaking", 1.3773866), ("fold", 1.3570404), ("symmetry breaking", 1.3913505)]
    expected = true if stability else true[1:2]
    assert [kind for kind, *_ in found] == [kind for kind, _ in expected]
    assert [omega for _, omega, _ in found] == pytest.approx([omega for _, omega in expected],
                                                             rel=1e-6)


def test_a_branch_point_beside_a_fold():
    """3e-6 of the frequency and 0.4 % of the amplitude apart (by shooting), within one step."""
    sample = random_sample("parametric", 3)
    sample.start = 1.45
    _, found = bifurcations.named(bifurcations.PROGRAM, sample)
    true = [("branch point", 1.2886725), ("branch point", 1.2639940), ("fold", 1.2639907)]
    found.sort(key=lambda place: place[2])
    assert [kind for kind, *_ in found] == [kind for kind, _ in true]
    assert [omega for _, omega, _ in found] == pytest.approx([omega for _, omega in true],
                                                             rel=1e-6)


def test_the_comparison_sees_what_is_wrong():
    true = [("fold", 1.0, 2.0), ("period doubling", 1.5, 1.0)]
    assert bifurcations.compare("folds", true, list(true)).worst == 0.0
    assert len(bifurcations.compare("folds", true, true[:1]).missed) == 1
    assert len(bifurcations.compare("folds", true, [*true, ("branch point", 1.2, 1.0)]).wrong) == 1
    other_kind = bifurcations.compare("folds", true, [true[0], ("branch point", 1.5, 1.0)])
    assert other_kind.missed and other_kind.wrong
    elsewhere = bifurcations.compare("folds", true, [true[0], ("period doubling", 1.502, 1.0)])
    assert elsewhere.missed and elsewhere.wrong
    still_open = bifurcations.compare("folds", true, [true[0], ("undecided", 1.5, 1.0)])
    assert still_open.undecided == 1 and not (still_open.missed or still_open.wrong)


def test_the_two_judges_agree():
    """Closed form and integration: a period far from the stop, and a slope against it."""
    one = np.eye(1)
    far = orbit_judge.Oscillator(one, 0.1 * one, one, np.array([0.3]), np.array([0.1]),
                                 stops=[(0, 1, 1e3, 5.0)])
    linear = orbit_judge.Oscillator(one, 0.1 * one, one, np.array([0.3]), np.array([0.1]),
                                    [(0, -1, 0.0, 3)])
    state, omega = np.array([0.2, -0.3]), 0.8
    exact = stop_judge.period(far, state, omega)
    marched = linear.period(state, omega)
    for a, b in zip((exact[0], exact[1], exact[2], exact[4]),
                    (marched[0], marched[1], marched[2], marched[4])):
        assert np.allclose(a, b, rtol=1e-6, atol=1e-7)
    # Against the stop: the monodromy matrix is the derivative of the end.
    hit = orbit_judge.Oscillator(one, 0.1 * one, one, np.array([0.3]), np.array([0.1]),
                                 stops=[(0, 1, 0.1, 5.0)])
    end, monodromy, *_ = stop_judge.motion(hit, state, omega)
    for k in range(2):
        step = 1e-6 * np.eye(2)[k]
        slope = (stop_judge.motion(hit, state + step, omega)[0]
                 - stop_judge.motion(hit, state - step, omega)[0]) / 2e-6
        assert slope == pytest.approx(monodromy[:, k], rel=1e-6, abs=1e-8)
