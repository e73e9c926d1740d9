"""The same numbers, bit for bit, from one thread and from several."""
from __future__ import annotations

import os
import subprocess

import h5py
import numpy as np
import pytest
import stress_cases as cases
import stress_run as runs
from stress_models import interface

# More pairs and coordinates than the numbers above which loops are shared among threads.
N_PAIRS = 70


@pytest.mark.parametrize(("law", "solver"), [("dlft", "newton, krylov"), ("penalty", "kinsol"),
                                         ("dlft", "newton")])
def test_numbers_do_not_depend_on_the_threads(tmp_path, law, solver):
    joint = interface(N_PAIRS, preload=0.5 / N_PAIRS)
    results = []
    for threads in (1, 2, 4):
        folder = tmp_path / str(threads)
        folder.mkdir()
        case = cases.make("threads", str(threads), joint, solver, law, n_harmonics=1, n_time=64,
                          omegas=(0.5, 0.6, 2))
        case.groups["case"]["threads"] = threads
        runs.write_case(case, folder)
        # Threads that spin while they wait starve each other on a busy machine.
        subprocess.run([runs.PROGRAM, "-q", str(folder / "case.nml")], check=True,
                       env={**os.environ, "OMP_WAIT_POLICY": "passive", "OMP_NUM_THREADS": "4",
                            "OMP_DYNAMIC": "false"})
        with h5py.File(folder / "case.h5") as file:
            results.append({name: file[name][()] for name in (
                "coefficients", "contact/force", "contact/fraction", "iterations")})
    slips = results[0]["contact/fraction"][:, :, 1]
    assert slips.max() > 0.0  # the march and its derivative are in it
    for other in results[1:]:
        for name, value in results[0].items():
            assert np.array_equal(value, other[name]), name
