"""Harmonics by an accuracy: as accurate as with many of them, at fewer where fewer do."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pytest

# A stiff stop: far from the resonance the mass does not reach it, near it harmonics matter.
STOP = """
&case title = 'stop' analysis = 'frf' /
&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.1 /
&contact n_pairs = 1 law = 'penalty' side_1 = 0 0 -1 gap = 0.5 normal_stiffness = 5 mu = 0 /
&load cosine = 0.3 /
&harmonics n_harmonics = {most} {keys} /
&sweep start = 0.3 end = 1.0 n_points = 15 /
"""

FRICTION = """
&case title = 'friction' analysis = 'frf' /
&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.04 /
&contact n_pairs = 1 law = 'penalty' tangential_stiffness = 1 side_1 = 1 0 0 mu = 1 normal_load = 0.5 /
&load cosine = 1 /
&harmonics n_harmonics = {most} {keys} /
&sweep start = 0.3 end = 1.6 n_points = 27 /
"""


def run(fw_run, text, status=0, **words):
    fw_run.write(text.format(**words))
    done = fw_run("-q", "case.nml")
    assert done.returncode == status, done.stderr
    with h5py.File(fw_run.directory / "case.h5") as file:
        return {name: file[name][()] for name in file if isinstance(file[name], h5py.Dataset)}, done


def test_summary_counts_the_work_at_every_number_of_harmonics(fw_run):
    text = FRICTION.format(most=41, keys="accuracy = 1e-3")
    fw_run.write(text + "&solver linear = 'lu' /\n")
    done = fw_run("case.nml")
    assert done.returncode == 0, done.stderr
    iterations = int(re.search(r"iterations +(\d+)", done.stdout)[1])
    # A step has one factorization, but where nothing moves the contact: there it needs none.
    assert int(re.search(r"(\d+) LU factorizations", done.stdout)[1]) >= 0.9 * iterations
    with h5py.File(fw_run.directory / "case.h5") as file:
        most = file["harmonics"][()].max()
        assert len(np.unique(file["harmonics"][()])) > 1
    coefficients = int(re.search(r"(\d+) coefficients", done.stdout)[1])
    assert coefficients >= most  # odd harmonics only: H + 1


def test_harmonics_where_they_are_needed(fw_run):
    few, _ = run(fw_run, STOP, most=41, keys="accuracy = 1e-4")
    amplitude, harmonics = few["amplitude"][:, 0], few["harmonics"]
    # Away from the stop the motion is one sine: the fewest, with others to compare them with.
    assert (harmonics[amplitude < 0.5] == 3).all() and (amplitude < 0.5).any()
    assert harmonics.max() > 7


ACCURATE = FRICTION.replace("n_harmonics = {most} {keys}", "accuracy = {accuracy} {more}")


def test_accuracy_along_a_sweep(fw_run):
    """Every point keeps it; harmonics rise towards the peaks and fall behind them."""
    whole, _ = run(fw_run, FRICTION, most=61, keys="n_time = 1024")
    for accuracy in (1e-2, 1e-3):
        found, done = run(fw_run, ACCURATE, accuracy=accuracy, more="")
        assert (found["error_estimate"] <= accuracy).all() and "is missed" not in done.stderr
        # 123 columns against 107: the default ceiling is 53 harmonics.
        difference = whole["coefficients"][:, :107, 0] - found["coefficients"][:, :, 0]
        error = np.sqrt((difference ** 2).sum(axis=1) / (whole["coefficients"][:, 1:, 0] ** 2).sum(
            axis=1))
        assert (error <= accuracy).all()
        for row, n, instants in zip(found["coefficients"], found["harmonics"], found["instants"]):
            # The tail of the answer stands above the harmonics of the balance.
            assert row[2 * n + 1:].any() and not row[2 * (4 * n + 8) + 1:].any()
            assert instants >= 4 * n
    # The superharmonic peak at 0.4 takes more than the end of the sweep.
    assert found["harmonics"][:5].max() > found["harmonics"][-1]


def test_accuracy_reads_back_what_it_chose(fw_run):
    """The effective input of a run with accuracy is a valid input with the same answer."""
    fw_run.write(ACCURATE.format(accuracy=1e-2, more=""))
    shown = fw_run("--check", "case.nml").stdout
    assert "n_harmonics = 53" in shown
    fw_run.write(shown, "again.nml")
    assert fw_run("-q", "again.nml").returncode == 0


@pytest.mark.parametrize("setting, remedy", [
    ("harmonics%n_time=64", "leave it out"),
    ("harmonics%n_harmonics=2", "at least 3"), ("harmonics%method='tcm'", "use 'hbm'"),
    ("harmonics%method='hdhb'", "use 'hbm'"), ("harmonics%accuracy=1e-7", "lower the tolerance"),
    ("harmonics%accuracy=1", "below 1"), ("output%histories=.true.", "give n_harmonics and n_time"),
    ("contact%memory='carried'", "use 'assembly'"),
    ("sweep%continuation='arclength'", "leave it out, and give n_harmonics"),
    ("case%analysis='time'", "leave it out, and give n_harmonics")])
def test_accuracy_refuses_what_does_not_go_with_it(fw_run, setting, remedy):
    fw_run.write(ACCURATE.format(accuracy=1e-2, more=""))
    assert remedy in fw_run.refused("--set", setting, "case.nml")


def test_instants_beside_an_accuracy_are_named_once(fw_run):
    """The least n_time is of no use to one who has to leave it out."""
    fw_run.write(ACCURATE.format(accuracy=1e-2, more="n_time = 64"))
    assert len(fw_run.refused().splitlines()) == 1


def test_summary_counts_the_points_without_a_claim(fw_run):
    """Few harmonics are enough where the mass does not reach the stop, and too few where it does;
    points between the rows are among those that are counted."""
    fw_run.write(STOP.format(most=5, keys="accuracy = 1e-4"))
    done = fw_run("case.nml")
    with h5py.File(fw_run.directory / "case.h5") as file:
        found = {"error_estimate": file["error_estimate"][()]}
    claimed = found["error_estimate"] <= 1e-4
    told = re.search(r"at most (\S+) by estimate, 1.0E-04 asked for; nothing is claimed at (\d+) of "
                     r"(\d+) points", done.stdout)
    assert 0 < claimed.sum() < len(claimed)
    assert float(told[1]) <= 1e-4
    assert int(told[2]) >= (~claimed).sum()
    assert int(told[3]) - int(told[2]) >= claimed.sum()


def test_a_number_of_points_that_was_not_meant_is_refused(fw_run):
    fw_run.write(FRICTION.format(most=3, keys="")
                 .replace("n_points = 27", "n_points = 1000000000"))
    done = fw_run("--check", "case.nml")
    assert done.returncode == 3 and "n_points = 1000000000: must be" in done.stderr
