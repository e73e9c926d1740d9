"""The accuracy that was asked for is kept, against periodic responses of other origin."""
from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass

import h5py
import numpy as np
import oracle_cases as cases
import pytest
from cases import write_namelist
from oracle_cases import coefficients_of
from oracle_runs import TIME_LIMIT, read_reference
from project import PROGRAM

DUFFING, COULOMB, JENKINS, TWO_DOF, GAP, PLANAR = map(read_reference, "abcdef")
ACCURACIES = (1e-2, 1e-3, 1e-4)
# The references end at harmonic 9 or 15; the rest is of the balance itself with as many as this.
BEYOND = 61


@dataclass(frozen=True)
class Answer:
    coefficients: np.ndarray
    harmonics: int
    instants: int
    estimate: float
    text: str


def solve(folder, groups, status=0, **harmonics):
    """Run a point; its coefficients and what the file says of them."""
    groups = {**groups, "harmonics": harmonics, "solver": {"tolerance": 1e-9}}
    write_namelist(folder / "case.nml", groups)
    done = subprocess.run([PROGRAM, "-o", folder / "case.h5", folder / "case.nml"],
                          capture_output=True, text=True, check=False, timeout=TIME_LIMIT,
                          env={**os.environ, "OMP_WAIT_POLICY": "passive"})
    assert done.returncode == status, done.stderr
    with h5py.File(folder / "case.h5") as file:
        assert file["converged"][-1]
        chosen = [file[name][-1] if name in file else 0
                  for name in ("harmonics", "instants", "error_estimate")]
        return Answer(file["coefficients"][-1], *chosen, done.stdout + done.stderr)


def mean_square(coefficients):
    """Root mean square over the period."""
    return np.sqrt(coefficients[0] ** 2 + 0.5 * (coefficients[1:] ** 2).sum())


def true_error(computed, reference):
    """Of all harmonics, relative to the vibration of the reference."""
    n = max(len(computed), len(reference))
    difference = np.zeros(n)
    difference[:len(computed)] = computed
    difference[:len(reference)] -= reference
    return mean_square(difference) / mean_square(np.concatenate([[0.0], reference[1:]]))


# A sliding start or a sweep leads to other orbits in the same places (test_oracles.py).
OTHER_ORBITS = ("gap_g0.5_F0.3_w1.15", "gap_g-0.2_F0.3_w1.5")


def elastic_cases():
    """Smooth springs and elastic contact: (name, groups, reference of every quantity)."""
    for omega in (0.3, 0.5, 0.8, 1.0, 2.5):
        point = next(p for p in DUFFING["points"] if p["omega"] == omega)
        yield f"duffing_{omega}", cases.duffing(DUFFING["params"], omega, 1), [point]
    for name, item in JENKINS.items():
        yield name, cases.jenkins(item["params"], 1), [item]
    for name, item in GAP.items():
        if name.startswith("gap_") and name not in OTHER_ORBITS:
            yield name, cases.gap(item["params"], 1), [item]
    for name, item in TWO_DOF.items():
        if not name.startswith("chain"):
            yield name, cases.two_dof(item["params"], 1), [item["q1"]]
    for name, item in PLANAR.items():
        yield f"planar_{name}", cases.planar(item["params"], 1), [item["x"], item["y"]]


def rigid_cases():
    """Rigid friction on masses, and rigid contact on massless nodes behind springs."""
    for name, item in COULOMB.items():
        yield name, cases.coulomb(item["params"], 1, law="dlft_velocity"), [item]
    for name, item in TWO_DOF.items():
        if name.startswith("chain"):
            groups = cases.chain(item["params"], 1, law="dlft_velocity")
            yield name, groups, [item["x1"], item["x2"]]
        else:
            yield f"{name}_rigid", cases.two_dof_massless(item["params"], 1), [item["q1"]]


def largest_error(answer, references):
    return max(true_error(answer.coefficients[:, i], reference)
               for i, reference in enumerate(references))


def whole(folder, groups, items):
    """References with the harmonics above their own."""
    longer = solve(folder, groups, n_harmonics=BEYOND, sampling="events").coefficients.T
    for row, item in zip(longer, items):
        known = coefficients_of(item)
        row[:len(known)] = known
    return longer[:len(items)]


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("name, groups, items", [pytest.param(*case, id=case[0])
                                                 for case in elastic_cases()])
def test_elastic(tmp_path, name, groups, items, accuracy):
    """Measured: at most 0.14 of the accuracy, and 0.31 of the estimate."""
    answer = solve(tmp_path, groups, accuracy=accuracy)
    references = whole(tmp_path, groups, items)
    assert answer.estimate <= accuracy
    assert largest_error(answer, references) <= answer.estimate
    # No more than it takes: the references themselves hold 15 harmonics.
    assert answer.harmonics <= {1e-2: 15, 1e-3: 23, 1e-4: 53}[accuracy]


@pytest.mark.parametrize("accuracy", ACCURACIES[:2])
@pytest.mark.parametrize("name, groups, items", [pytest.param(*case, id=case[0])
                                                 for case in rigid_cases()])
def test_rigid(tmp_path, name, groups, items, accuracy):
    """Either kept or not claimed, in the harmonics that the references hold; those above are judged
    from event to event (test_claims.py)."""
    answer = solve(tmp_path, groups, accuracy=accuracy)
    claimed = answer.estimate <= accuracy
    assert claimed != ("is missed" in answer.text)
    if claimed:
        for i, item in enumerate(items):
            known = coefficients_of(item)
            assert true_error(answer.coefficients[:len(known), i], known) <= accuracy


def test_rigid_is_claimed_where_it_converges(tmp_path):
    """Not claiming anything would pass the test above."""
    claimed = [name for name, groups, _ in rigid_cases()
               if solve(tmp_path, groups, accuracy=1e-2).estimate <= 1e-2]
    # Measured: all.
    assert len(claimed) == len(list(rigid_cases()))


@pytest.mark.parametrize("accuracy", ACCURACIES[:2])
@pytest.mark.parametrize("name, groups, items", [
    pytest.param(*case, id=case[0]) for case in elastic_cases()
    if case[0].startswith(("jenkins_F1.0", "D_sep", "E_sep", "H_sep", "planar"))])
def test_uniform_sampling(tmp_path, name, groups, items, accuracy):
    """Instants are raised until they do not matter, or the accuracy is not claimed."""
    answer = solve(tmp_path, groups, accuracy=accuracy, sampling="uniform")
    claimed = answer.estimate <= accuracy
    assert claimed != ("is missed" in answer.text)
    if claimed:
        assert largest_error(answer, whole(tmp_path, groups, items)) <= accuracy
    # Slip in two directions is of first order in the instants: more than are tried for 1e-3.
    assert claimed or (name.startswith("planar") and accuracy < 1e-2)


def test_instants_are_raised(tmp_path):
    """The stick-slip motion of two directions needs more than the 16 H of the automatic choice."""
    groups = cases.planar(PLANAR["A"]["params"], 1)
    answer = solve(tmp_path, groups, accuracy=1e-2, sampling="uniform")
    assert answer.instants > max(64, 16 * answer.harmonics)


def test_ceiling_is_kept_and_said(tmp_path):
    groups = cases.gap(GAP["gap_g0.5_F0.3_w0.9"]["params"], 1)
    answer = solve(tmp_path, groups, accuracy=1e-4, n_harmonics=9)
    assert answer.harmonics == 9 and answer.coefficients.shape[0] == 19
    assert answer.estimate > 1e-4 and "raise harmonics%n_harmonics" in answer.text
    reference = [coefficients_of(GAP["gap_g0.5_F0.3_w0.9"])]
    assert largest_error(answer, reference) <= answer.estimate
