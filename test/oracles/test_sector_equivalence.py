"""The blade sector with 16 pairs: the same answer however it is computed."""
from __future__ import annotations

import h5py
import numpy as np
import pytest
import slow_balance as slow
from cases import read, run
from oracle_runs import run_case
from project import ROOT

MODEL = ROOT / "example" / "blade_sector" / "sector_16.h5"
SPEED = 460.8
# A load that a few points near the resonance slip under.
SMALL = 0.02
# The solver stops at 1e-12 of the load; the resonance amplifies that a hundredfold.
SAME = 1e-9
# The damping of modes whose stiffness is round-off is the root of that; measured: 1.2e-8.
STUCK = 1e-7
# The penalty is formed anew by another route, 1e-3 off, which the forces feel; measured: 2.6e-5.
LAW = 1e-4


def sector(n_points=13, threads=1, contact=None, harmonics=None, output=None, **solver):
    """Resonance of the sector where half of the pairs slip."""
    return {
        "case": {"analysis": "frf", "threads": threads},
        "model": {"source": "hdf5", "file": str(MODEL), "modal_damping": 1e-3,
                  "rotation_speed": SPEED},
        "contact": contact or {"mu": 0.5},
        "load": {"harmonic_scale": 0.5},
        "harmonics": {"n_harmonics": 3, "n_time": 128, **(harmonics or {})},
        "sweep": {"start": 1020.0, "end": 1026.0, "n_points": n_points, "unit": "Hz"},
        "solver": {"tolerance": 1e-12, **solver},
        "output": output or {"observe": "tip"},
    }


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The defaults."""
    result = run_case(tmp_path_factory.mktemp("sector"), sector())
    assert result.converged.all()
    return result


@pytest.mark.parametrize("groups", [
    pytest.param(sector(threads=2), id="two threads"),
    pytest.param(sector(linear="lu"), id="lu"),
    pytest.param(sector(linear="krylov"), id="krylov"),
    pytest.param(sector(skips=False), id="no skips"),
    pytest.param(sector(harmonics={"parity": "all"}), id="all harmonics"),
    pytest.param(sector(contact={"mu": 0.5, "memory": "assembly"}), id="memory spelt out"),
])
def test_same_answer(tmp_path, reference, groups):
    result = run_case(tmp_path, groups)
    for name in ("coefficients", "force"):
        expected, found = getattr(reference, name), getattr(result, name)
        assert np.abs(found - expected).max() < SAME * np.abs(expected).max()
    assert np.abs(result.fraction - reference.fraction).max() < 0.5 / 128


@pytest.mark.parametrize("output", [{"contact": False}, {"histories": True}])
def test_what_is_not_asked_for_changes_nothing(tmp_path, reference, output):
    result = run_case(tmp_path, sector(output={"observe": "tip", **output}))
    assert np.array_equal(result.coefficients, reference.coefficients)


def test_a_sweep_that_is_linear_in_part(tmp_path):
    """Points where the joint stays stuck solve nothing, and the result file says so."""
    found = []
    for name, skips in (("with", True), ("without", False)):
        groups = sector(skips=skips)
        groups["load"]["harmonic_scale"] = SMALL
        (tmp_path / name).mkdir()
        found.append(run_case(tmp_path / name, groups))
        with h5py.File(next((tmp_path / name).glob("*.h5"))) as file:
            said = list(file.attrs.get("skipped", []))
        assert skips == any("linear problems: the joint stays stuck" in words for words in said)
    stuck = found[0].fraction[:, :, 0].min(axis=1) == 1.0
    assert stuck.any() and not stuck.all()
    scale = np.abs(found[1].coefficients).max()
    assert np.abs(found[0].coefficients - found[1].coefficients).max() < SAME * scale


def test_sweep_direction_does_not_matter(tmp_path, reference):
    groups = sector()
    groups["sweep"].update(start=1026.0, end=1020.0)
    downwards = run_case(tmp_path, groups)
    difference = downwards.coefficients[::-1] - reference.coefficients
    assert np.abs(difference).max() < SAME * np.abs(reference.coefficients).max()


def structure():
    """Matrices, loads and contact rows of the model file at the rotation speed, in NumPy."""
    with h5py.File(MODEL, "r") as file:
        mass = file["mass"][()]
        stiffness = file["stiffness"][()] + SPEED**2 * file["stiffness_rotation"][()]
        static = file["load/static"][()] + SPEED**2 * file["load/static_rotation"][()]
        cosine, tip = 0.5 * file["load/cosine"][()], file["observe/matrix"][0]
        sides = file["contact/side_1"][()], file["contact/side_2"][()]
    # Modes of the structure with its contact open; those without stiffness are not damped.
    root = np.linalg.inv(np.linalg.cholesky(mass))
    values, vectors = np.linalg.eigh(root @ stiffness @ root.T)
    modes = mass @ root.T @ vectors
    damping = 2e-3 * modes * np.sqrt(np.maximum(values, 0.0)) @ modes.T
    rows = np.vstack([slow.pair_rows(a, b, len(mass)) for a, b in zip(*sides, strict=True)])
    return (mass, damping, stiffness), static, cosine, tip, rows


def test_stuck_sector_is_linear_algebra(tmp_path):
    """An interference and much friction hold every pair: the bonded structure, solved directly."""
    result = run_case(tmp_path, sector(contact={"mu": 100.0, "gap": -0.01}))
    (mass, damping, stiffness), _, cosine, tip, rows = structure()
    free = np.flatnonzero(~np.any(rows != 0.0, axis=0))
    for omega, computed in zip(result.omega, result.coefficients[:, :, 0], strict=True):
        dynamic = (stiffness - omega**2 * mass + 1j * omega * damping)[np.ix_(free, free)]
        expected = tip[free] @ np.linalg.solve(dynamic, cosine[free])
        assert abs(computed[1] - 1j * computed[2] - expected) < STUCK * abs(expected)
        # The interference is static: no other harmonic moves.
        assert np.abs(computed[3:]).max() < 1e-10


def test_sector_obeys_equilibrium_and_contact_law(tmp_path):
    """The equations with friction at the peak, formed anew from the result file."""
    (mass, damping, stiffness), static, cosine, _, rows = structure()
    groups = sector(output={"observe": list(range(1, len(mass) + 1)), "histories": True})
    groups["case"]["analysis"] = "point"
    groups["sweep"] = {"start": 1022.7, "unit": "Hz"}
    result = run_case(tmp_path, groups)
    u, force = result.coefficients[0], result.force[0].reshape(7, -1)
    load = np.zeros_like(u)
    load[0], load[1] = static, cosine
    # Relative to the load, of which the centrifugal part is by far the largest.
    defect = slow.equilibrium((mass, damping, stiffness), result.omega[0], u, force @ rows, load)
    assert defect < 1e-9
    penalty = slow.automatic_penalty(stiffness, rows)
    relative = u @ rows.T
    slipping = 0
    for pair in range(16):
        own = slice(3 * pair, 3 * pair + 3)
        defect = slow.law_defect(force[:, own], relative[:, own], 0.0, 0.5, penalty[own], 128, True)
        assert defect < LAW, pair
        slipping += result.fraction[0, pair, 1] > 0.0
    assert slipping == 8


def test_a_branch_of_a_given_amplitude(tmp_path):
    """By arc length past the smallest load: under the loads that were found the sector moves so."""
    groups = sector(harmonics={"n_time": 32})
    groups["control"] = {"amplitude": [0.6]}
    groups["sweep"].update(start=1021.5, end=1024.5, n_points=4, continuation="arclength")
    run(tmp_path, groups)
    branch = read(tmp_path / "case.h5")
    assert branch["converged"].all()
    scale, motion = branch["load/scale"], branch["coefficients"]
    assert 0 < scale.argmin() < len(scale) - 1
    assert np.hypot(*motion[:, 1:3, 0].T) == pytest.approx(np.full(len(scale), 0.6), rel=SAME)
    for k in (scale.argmin(), len(scale) - 1):
        alone = sector(harmonics={"n_time": 32})
        alone["case"]["analysis"] = "point"
        alone["load"]["harmonic_scale"] = float(scale[k])
        alone["sweep"] = {"start": float(branch["omega"][k])}
        found = run_case(tmp_path, alone)
        size = np.abs(found.coefficients).max()
        assert np.abs(found.coefficients[0] - motion[k]).max() < 1e-7 * size


def test_speeds_are_sectors_of_their_own(tmp_path):
    """Stiffness and static load of each speed, condensed again; rows are those of single runs."""
    groups = sector(harmonics={"n_time": 32})
    groups["case"]["analysis"] = "frf"
    speeds = [SPEED, 0.7 * SPEED, 0.9 * SPEED]
    groups["sweep"] = {"parameter": "model%rotation_speed", "frequency": 1022.0, "unit": "Hz",
                       "values": speeds}
    swept = run_case(tmp_path, groups)
    assert swept.converged.all()
    for k, speed in enumerate(speeds):
        alone = sector(harmonics={"n_time": 32})
        alone["case"]["analysis"] = "point"
        alone["model"]["rotation_speed"] = speed
        alone["sweep"] = {"start": 1022.0, "unit": "Hz"}
        found = run_case(tmp_path, alone)
        size = np.abs(found.coefficients).max()
        assert np.abs(found.coefficients[0] - swept.coefficients[k]).max() < SAME * size
