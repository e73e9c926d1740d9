"""Namelists written on the fly, fw_run, and the result file as arrays."""
from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
FW_RUN = os.environ.get("FW_RUN", str(ROOT / "build" / "release" / "fw_run"))
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
    history_force: np.ndarray | None
    history_relative: np.ndarray | None


def read_reference(letter):
    """Reference solutions of one problem, with all their parameters."""
    (path,) = (ROOT / "test" / "reference").glob(f"oracle_{letter}_*.json")
    return json.loads(path.read_text())


def literal(value):
    """A value as a namelist takes it."""
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, (int, np.integer)):
        return str(value)
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return ", ".join(literal(item) for item in np.ravel(value).tolist())


def write_namelist(path, groups):
    """Write {group: {key: value}} as a namelist."""
    lines = []
    for group, keys in groups.items():
        lines += [f"&{group}", *(f"  {key} = {literal(value)}" for key, value in keys.items()), "/"]
    path.write_text("\n".join(lines) + "\n")


def read_result(path):
    """Read a result file."""
    with h5py.File(path, "r") as file:
        def optional(name):
            return file[name][()] if name in file else None

        return Result(
            file["omega"][()], file["coefficients"][()], file["amplitude"][()],
            file["converged"][()].astype(bool), optional("contact/force"),
            optional("contact/fraction"), optional("contact/dissipation"),
            optional("history/force"), optional("history/relative_displacement"))


def run_case(folder, groups, converged=True):
    """Write the namelist into a folder, run it, read what comes out.

    With converged=False points may have failed (exit status 4); the caller looks at them.
    """
    write_namelist(folder / "case.nml", groups)
    done = subprocess.run(
        [FW_RUN, "-q", "-o", str(folder / "case.h5"), str(folder / "case.nml")],
        capture_output=True, text=True, check=False, timeout=TIME_LIMIT,
        # Threads that spin while they wait starve each other where other tests run as well.
        env={**os.environ, "OMP_WAIT_POLICY": "passive"})
    accepted = (0,) if converged else (0, 4)
    assert done.returncode in accepted, (
        f"fw_run ended with status {done.returncode}: {done.stderr}\n"
        + (folder / "case.nml").read_text())
    return read_result(folder / "case.h5")
