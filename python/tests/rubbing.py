"""The cases that runs of the package are tried on, and what "the same numbers" means."""

from __future__ import annotations

import subprocess
from pathlib import Path

from project import PROGRAM

import fretwear as fw
from fretwear.settings import Groups

SECTOR: Groups = {
    "structure": {"modal_damping": 1e-3, "rotation_speed": 460.8},
    "contact": {"mu": 0.5, "law": "dlft"},
    "load": {"harmonic_scale": 0.5}, "harmonics": {"n_harmonics": 3, "n_time": 128},
    "output": {"observe": ["tip"]}}
# Rubbing oscillator: one dof, one pair without a normal direction.
PAIR = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5, tangential_stiffness=1.0)
RUBBING = fw.Model([[1.0]], [[0.04]], [[1.0]], contact=PAIR, cosine=[1.0], title="rubbing")


def by_program(directory: Path, namelist: Path, *options: str) -> fw.Result:
    """What fw_run makes of a namelist."""
    target = directory / "program.h5"
    subprocess.run([PROGRAM, "-q", *options, "-o", target, namelist], check=True)
    return fw.Result(target)


def assert_same_numbers(one: fw.Result, other: fw.Result) -> None:
    """Every dataset but the times, to the last bit."""
    assert list(one) == list(other)
    for name in one:
        if name == "seconds":
            continue
        if one[name].dtype.kind == "U":
            assert list(one[name]) == list(other[name])
        else:
            assert one[name].tobytes() == other[name].tobytes(), name
