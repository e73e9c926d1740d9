"""Work of fixed cases in counts, which noise cannot change: Newton steps, GMRES iterations,
factorisations, preconditioners. A limit is the count measured when it was set and a twentieth,
for what compilers and libraries differ by."""
import re

import h5py
import numpy as np
import pytest
from project import ROOT

ALLOWANCE = 1.05


def work(done):
    """Newton steps, LU factorizations, Krylov iterations, preconditioners."""
    assert done.returncode == 0, done.stderr
    steps = int(re.search(r"^iterations +(\d+)", done.stdout, re.MULTILINE)[1])
    counts = re.search(r"(\d+) LU factorizations, (\d+) Krylov iterations, (\d+) preconditioners",
                       done.stdout)
    return (steps, *map(int, counts.groups()))


def sector(fw_run, n_pairs, n_harmonics, start, end, linear="auto", name="sector.h5", more="",
           speed=460.8):
    fw_run.write(f"""&model source = 'hdf5', rotation_speed = {speed}, modal_damping = 1e-3
   file = '{ROOT / "example" / "blade_sector" / f"sector_{n_pairs}.h5"}' /
&load harmonic_scale = 0.5 /
&harmonics n_harmonics = {n_harmonics}, n_time = 128 /
&solver {more} linear = '{linear}', tolerance = 1e-10 /
&sweep start = {start}, end = {end}, n_points = 11, unit = 'Hz' /
""", "sector.nml")
    return fw_run("-o", name, "sector.nml")


@pytest.mark.parametrize(("n_pairs", "n_harmonics", "start", "end", "limits"), [
    (16, 3, 1021, 1024, (41, 0, 192, 2)),
    (48, 7, 1016, 1019, (64, 0, 391, 32)),
])
def test_work_on_the_sector(fw_run, n_pairs, n_harmonics, start, end, limits):
    counts = work(sector(fw_run, n_pairs, n_harmonics, start, end))
    assert counts[1] == 0, "GMRES everywhere"
    assert all(count <= ALLOWANCE * limit for count, limit in zip(counts, limits)), counts


def test_without_skips_every_step_has_its_preconditioner(fw_run):
    done = sector(fw_run, 16, 3, 1021, 1024, "krylov", more="skips = .false.,")
    steps, _, _, preconditioners = work(done)
    assert preconditioners == steps
    assert "skipped" not in done.stdout


def test_the_result_file_says_what_was_skipped(fw_run):
    done = sector(fw_run, 16, 3, 1021, 1024)
    with h5py.File(fw_run.directory / "sector.h5") as file:
        said = list(file.attrs["skipped"])
    assert said == re.findall(r"^skipped +(.*)$", done.stdout, re.MULTILINE)
    assert len(said) == 1 and said[0].startswith("stuck pairs, 67 % of the unknowns")


def test_no_line_for_work_that_was_hardly_skipped(fw_run):
    """A pair sticks at a few of the steps, which is less than half a per cent of the unknowns."""
    fw_run.write("""&case analysis = 'wear' /
&model n_dof = 4, mass = 1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1
   stiffness = 2,-1,0,0, -1,2,0,0, 0,0,3,-1, 0,0,-1,3
   damping = 0.02,0,0,0, 0,0.02,0,0, 0,0,0.02,0, 0,0,0,0.02 /
&contact n_pairs = 2, law = 'penalty', tangential_stiffness = 2, normal_stiffness = 2
   side_1 = 1,0,3, 2,0,4, mu = 0.4, area = 1 /
&load static = 0,0,-1,-2, cosine = 1.3,0,0,0 /
&harmonics n_harmonics = 5 /
&sweep start = 1 /
&wear coefficient = 1e-6, n_cycles = 1e5 /
""")
    done = fw_run("case.nml")
    assert done.returncode == 0, done.stderr
    assert "skipped" not in done.stdout


def test_near_singular_steps_are_not_factored(fw_run):
    """Nearly all of the joint slips at low speed: exact steps lead away, and take longer."""
    done = sector(fw_run, 16, 3, 1008, 1012, speed=261.8)
    steps, factorizations, _, _ = work(done)
    assert factorizations <= 0.1 * steps
    assert "11 of 11 points" in done.stdout


def test_small_problems_are_factored(fw_run):
    steps, factorizations, krylov, preconditioners = work(fw_run("case.nml"))
    assert factorizations <= steps
    assert krylov == preconditioners == 0
    assert steps <= 13


# The pairs that slip change at every step of 48.
@pytest.mark.parametrize(("n_pairs", "n_harmonics", "start", "end", "share"), [
    (16, 3, 1021, 1024, 0.1), (48, 1, 1016, 1019, 0.5)])
def test_kept_preconditioners_change_no_answer(fw_run, n_pairs, n_harmonics, start, end, share):
    """GMRES with preconditioners from other points against LU, through the resonance."""
    found = {}
    for linear in ("krylov", "lu"):
        counts = work(sector(fw_run, n_pairs, n_harmonics, start, end, linear, f"{linear}.h5"))
        with h5py.File(fw_run.directory / f"{linear}.h5") as file:
            found[linear] = file["coefficients"][()]
        if linear == "krylov":
            assert 0 < counts[3] < share * counts[0], "most preconditioners are kept"
    scale = np.abs(found["lu"]).max()
    # Residuals of 1e-10 of the load, at a resonance of a damping of 0.1 %.
    assert np.abs(found["krylov"] - found["lu"]).max() < 1e-6 * scale
