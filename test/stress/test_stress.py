"""The short form of the stress suite, and proof that its judge sees what is wrong."""
from __future__ import annotations

import numpy as np
import pytest
import stress
import stress_cases as cases
import stress_check as check
import stress_run as runs
from stress_models import interface
from stress_store import Store


def test_every_end_is_converged_or_in_words():
    families = stress.outcomes([], 2, True, Store(None, runs.PROGRAM))
    ends = [end for _, family in families for end in family]
    bad = [f"{end.verdict}: {end.case.title}\n{end.text}" for end in ends
           if end.verdict in stress.BAD]
    assert not bad, "\n".join(bad)
    assert sum(end.verdict == "converged" for end in ends) > 0.8 * len(ends)


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A sliding joint with its solution: case, omega, u, force, dissipation."""
    import subprocess

    import h5py
    folder = tmp_path_factory.mktemp("solved")
    case = cases.make("judge", "sliding", interface(2, preload=0.5))
    runs.write_case(case, folder)
    subprocess.run([runs.PROGRAM, "-q", str(folder / "case.nml")], check=True)
    with h5py.File(folder / "case.h5") as file:
        return (case, file["omega"][0], file["coefficients"][0], file["contact/force"][0],
                file["contact/dissipation"][0])


def test_the_judge_accepts_a_solution(solved):
    assert check.verify(*solved) == []


# What a solver could leave wrong, each 1e-4 of its size: more than 100 tolerances.
@pytest.mark.parametrize(("what", "complaint"), [
    ("displacement", "equilibrium"), ("force", "equilibrium"), ("both", "contact law"),
    ("dissipation", "dissipation")])
def test_the_judge_sees_a_wrong_solution(solved, what, complaint):
    case, omega, u, force, dissipation = solved
    u, force, dissipation = u.copy(), force.copy(), dissipation.copy()
    if what == "displacement":
        u[1] *= 1 + 1e-4
    if what == "force":
        force[1] *= 1 + 1e-4
    if what == "dissipation":
        dissipation *= 1 + 1e-2
    if what == "both":
        # Equilibrium with other forces than those of the law.
        change = 1e-4 * np.abs(force[0]).max() * np.ones_like(force[0])
        force[0] += change
        u[0] -= np.linalg.solve(case.joint.stiffness,
                                check.pair_matrix(case.joint).T @ change.ravel())
    assert any(complaint in said for said in check.verify(case, omega, u, force, dissipation))
