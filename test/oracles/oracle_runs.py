"""Namelists written on the fly, fw_run, and the result file as arrays."""
from __future__ import annotations

import json
from dataclasses import dataclass

import h5py
import numpy as np
from cases import run
from project import ROOT

# A case takes milliseconds; this only ends one that hangs.
TIME_LIMIT = 120.0


@dataclass(frozen=True)
class Result:
    """Points of a result file; arrays of the contact are None where there is none."""

    omega: np.ndarray
    coefficients: np.ndarray  # (point, 0 c1 s1 c2 s2 .., observed)
    amplitude: np.ndarray
    converged: np.ndarray
    force: np.ndarray | None
    fraction: np.ndarray | None
    dissipation: np.ndarray | None
    obstacle_work: np.ndarray | None
    history_force: np.ndarray | None
    history_relative: np.ndarray | None


def read_reference(letter):
    """Reference solutions of one problem, with all their parameters."""
    (path,) = (ROOT / "test" / "reference").glob(f"oracle_{letter}_*.json")
    return json.loads(path.read_text())


def read_result(path):
    """Read a result file."""
    with h5py.File(path, "r") as file:
        def optional(name):
            return file[name][()] if name in file else None

        return Result(
            file["omega"][()], file["coefficients"][()], file["amplitude"][()],
            file["converged"][()].astype(bool), optional("contact/force"),
            optional("contact/fraction"), optional("contact/dissipation"), optional("contact/obstacle_work"),
            optional("history/force"), optional("history/relative_displacement"))


def run_case(folder, groups, converged=True):
    """Write the namelist into a folder, run it, read what comes out.

    With converged=False points may have failed (exit status 4); the caller looks at them.
    """
    run(folder, groups, status=(0,) if converged else (0, 4), seconds=TIME_LIMIT)
    return read_result(folder / "case.h5")
