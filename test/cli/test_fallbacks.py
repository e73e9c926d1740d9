"""Which of its ways gave each point of a result."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

EXAMPLE = Path(__file__).parents[2] / "example" / "blade_sector"


def _served_by(path: Path) -> list[str]:
    with h5py.File(path) as file:
        names = file["served_by"].attrs["names"]
        served = [names[code] for code in file["served_by"][:]]
        # What converged was served by something, and nothing else was.
        assert ((file["served_by"][:] > 0) == file["converged"][:].astype(bool)).all()
    return [name.decode() if isinstance(name, bytes) else name for name in served]


@pytest.mark.parametrize(("kind", "name"), [
    ("newton", "newton"), ("powell", "powell"), ("kinsol", "kinsol"),
    ("pseudo_time", "pseudo-time")])
def test_the_solver_that_was_asked_for(fw_run, kind: str, name: str) -> None:
    done = fw_run("-q", "-o", "case.h5", "--set", f"solver%kind='{kind}'", "case.nml")
    assert done.returncode == 0, done.stderr
    assert set(_served_by(fw_run.directory / "case.h5")) == {name}


def test_a_point_that_does_not_converge_was_served_by_none(fw_run) -> None:
    done = fw_run("-q", "-o", "case.h5", "--set", "solver%max_iterations=1", "--set",
                  "solver%fallback=.false.", "--set", "solver%tolerance=1e-15", "case.nml")
    assert done.returncode == 4
    assert "none" in _served_by(fw_run.directory / "case.h5")


def test_a_tolerance_below_round_off_is_blamed(fw_run) -> None:
    """Not the joint, which has its solution to the last digits."""
    done = fw_run("-o", "case.h5", "--set", "solver%tolerance=1e-30", "--set", "sweep%n_points=1",
                  "--set", "solver%fallback=.false.", EXAMPLE / "frf.nml")
    assert done.returncode == 4
    assert "which is round-off, and solver%tolerance" in done.stderr
    with h5py.File(fw_run.directory / "case.h5") as file:
        assert (file["residual"][:] < 1e-12).all()


def test_smaller_steps_before_pseudo_time_where_unknowns_are_many(fw_run) -> None:
    """Steps of the sweep too large for five iterations: 1,488 unknowns."""
    done = fw_run("-q", "-o", "case.h5", "--set", "solver%max_iterations=5", "--set",
                  "harmonics%n_harmonics=15", "--set", "sweep%n_points=5",
                  "--set", "sweep%continuation='natural'", EXAMPLE / "frf.nml")
    assert done.returncode == 0, done.stderr
    served = _served_by(fw_run.directory / "case.h5")
    assert "smaller steps" in served and "pseudo-time" not in served


def test_branches_say_so(fw_run) -> None:
    done = fw_run("-q", "-o", "case.h5", "--set", "sweep%continuation='arclength'", "case.nml")
    assert done.returncode == 0, done.stderr
    served = _served_by(fw_run.directory / "case.h5")
    assert served[0] == "newton" and set(served[1:]) == {"arclength"}


@pytest.mark.parametrize("load", [0.5, 1.0])
@pytest.mark.parametrize("harmonics", [1, 3])
def test_sweep_of_the_locked_blade(fw_run, harmonics: int, load: float) -> None:
    """2000 rpm: beyond 1008 Hz all flanks slip in every period, and the lock alone holds the blade
    along its slot. Every point converges."""
    done = fw_run("-q", "-o", "locked.h5", "--set", "sweep%continuation='natural'",
                  "--set", f"harmonics%n_harmonics={harmonics}",
                  "--set", f"load%harmonic_scale={load}", "--set", "sweep%start=990",
                  "--set", "sweep%end=1012", EXAMPLE / "frf_2000rpm.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "locked.h5") as file:
        assert file["converged"][:].all() and len(file["omega"]) == 41
        fraction, hertz = file["contact/fraction"][:], file["omega"][:] / (2 * np.pi)
    assert (fraction[(hertz > 1008) & (hertz < 1010), :, 1] > 0).all()
    assert "none" not in _served_by(fw_run.directory / "locked.h5")
