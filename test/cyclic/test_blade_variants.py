"""Wrong variants of disks whose blades differ are told from the right one, and inputs that say the
same give the same.

Right: the annulus of every disk by numpy (`populations` of test/families). Each variant changes one
word of what the judge solves; its number is the largest error of an amplitude of all blades over a
sweep, in parts of the largest, as the median of some disks.
"""
import sys

import numpy as np
import pytest
from annulus import random_case
from cases import read, run
from deviations import write
from project import ROOT

sys.path.insert(0, str(ROOT / "test/families"))
from populations import Disk

EQUAL = 1e-8
N_SECTORS, N_DISKS = 8, 6
OMEGAS = np.linspace(0.6, 2.0, 15)


def blades(seed):
    """A sector, rows of its blade, a pattern, the matrices of every sector."""
    rng = np.random.default_rng([67, seed])
    case = random_case(rng, n_sectors=N_SECTORS, n_pairs=1, engine_order=3)
    case["contact"] = {"side_1": [], "side_2": [], "sector_2": []}
    rows = 0.5 * rng.normal(size=(1, len(case["model"]["mass"])))
    omega = rng.uniform(0.8, 2.0, 1)
    return case, rows, omega, 0.05 * rng.uniform(-1.0, 1.0, N_SECTORS)


def judged(case, rows, omega, parts):
    """Amplitudes (n_omegas, n_sectors, n_dof) where the stiffness of each blade has such parts."""
    block = rows.T @ np.diag(omega**2) @ rows
    zero = np.zeros((N_SECTORS, *block.shape))
    disk = Disk(case, {"stiffness": np.array([part * block for part in parts]), "mass": zero,
                       "damping": zero})
    return np.array([disk.amplitude(w) for w in OMEGAS])


def amplitudes(folder, case, rows, omega, d):
    """Those of the program."""
    write(folder / "model.h5", case, {"rows": rows, "row_omega": omega, "frequency": d})
    run(folder, {"case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
                 "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
                 "sweep": {"values": OMEGAS.tolist()}, "harmonics": {"n_harmonics": 1}})
    c = read(folder / "case.h5")["coefficients"]
    return np.hypot(c[:, 1], c[:, 2]).reshape(len(OMEGAS), N_SECTORS, -1)


def test_wrong_variants_are_told(tmp_path):
    numbers = {name: [] for name in ("right", "2 d", "backwards", "turned", "twice")}
    for seed in range(N_DISKS):
        case, rows, omega, d = blades(seed)
        found = amplitudes(tmp_path, case, rows, omega, d)
        other_way = case | {"engine_order": -case["engine_order"]}
        wrong = {"right": (case, (1.0 + d)**2 - 1.0), "2 d": (case, 2.0 * d),
                 "backwards": (case, ((1.0 + d)**2 - 1.0)[::-1]),
                 "turned": (other_way, (1.0 + d)**2 - 1.0), "twice": (case, (1.0 + d)**4 - 1.0)}
        for name, (of, parts) in wrong.items():
            error = np.abs(judged(of, rows, omega, parts) - found).max() / found.max()
            numbers[name].append(error)
    medians = {name: float(np.median(values)) for name, values in numbers.items()}
    print("median errors of variants:", {name: f"{value:.2g}" for name, value in medians.items()})
    assert max(numbers["right"]) < EQUAL
    for name, least in (("2 d", 1e-3), ("backwards", 0.05), ("turned", 0.05), ("twice", 0.02)):
        assert medians[name] > least, name
        assert min(numbers[name]) > 100.0 * EQUAL, name


# ------------------------------------------------------------------ the same in other words

#: Residuals of 1e-14; both are one structure in other words.
SAME = 1e-12


def solve(folder, case, parts, **more):
    folder.mkdir(exist_ok=True)
    write(folder / "model.h5", case, parts)
    groups = {"case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
              "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
              "sweep": {"values": [0.7, 1.3, 1.9]}, "solver": {"tolerance": 1e-14},
              "harmonics": {"n_harmonics": 3, "sampling": "uniform", "n_time": 80}}
    if len(case["contact"]["side_1"]):
        groups["contact"] = {"law": case["law"]}
    run(folder, groups | more)
    return read(folder / "case.h5")["coefficients"]


def with_pairs(n_pairs, n_sectors=5):
    rng = np.random.default_rng([68, n_pairs, n_sectors])
    case = random_case(rng, n_sectors=n_sectors, n_pairs=1, engine_order=2)
    if n_pairs == 0:
        case["contact"] = {"side_1": [], "side_2": [], "sector_2": []}
    rows = 0.5 * rng.normal(size=(1, len(case["model"]["mass"])))
    return case, rows, np.array([1.3]), 0.05 * rng.uniform(-1.0, 1.0, n_sectors)


def off(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


@pytest.mark.parametrize("n_pairs", [0, 1])
def test_inputs_that_say_the_same(tmp_path, n_pairs):
    case, rows, omega, d = with_pairs(n_pairs)
    block, part = rows.T @ np.diag(omega**2) @ rows, (1.0 + d)**2 - 1.0
    blade = {"rows": rows, "row_omega": omega}
    found = solve(tmp_path / "rows", case, blade | {"frequency": d})
    n = case["n_sectors"]
    whole = {f"sector/{j}/stiffness": e * block for j, e in enumerate(part)}
    ways = {"blade": {"blade_stiffness": block, "stiffness": part}, "sectors": whole,
            "full": {name: value + np.array(case["model"]["stiffness"])
                     for name, value in whole.items()}
            | {f"sector/{j}@kind": "full" for j in range(n)}}
    for way, parts in ways.items():
        assert off(solve(tmp_path / way, case, parts), found) < SAME, way
    # A pattern turned by a sector turns the answer, a phase later.
    turned = solve(tmp_path / "turned", case, blade | {"frequency": np.roll(d, 1)})
    wave = (found[:, 1::2] - 1j * found[:, 2::2]).reshape(3, 3, n, -1)
    phase = np.exp(-2j * np.pi * case["engine_order"] / n * np.arange(1, 4))[None, :, None, None]
    wanted = (np.roll(wave, 1, axis=2) * phase).reshape(3, 3, -1)
    assert off(turned[:, 1::2] - 1j * turned[:, 2::2], wanted) < SAME
    # All alike: the tuned wave of the stiffness with what each has.
    alike = solve(tmp_path / "alike", case, blade | {"frequency": np.full(n, d[0])})
    stiffer = case | {"model": case["model"] | {
        "stiffness": (np.array(case["model"]["stiffness"]) + part[0] * block).tolist()}}
    tuned = solve(tmp_path / "tuned", stiffer, {},
                  cyclic={"engine_order": case["engine_order"], "mistuned": False})
    wave, size = alike.reshape(3, 7, n, -1)[:, :, 0], np.abs(alike).max()
    assert np.abs(wave - tuned).max() / size < SAME


def test_one_sector(tmp_path):
    """Itself joined to itself, with what the blade has more."""
    case, rows, omega, _ = with_pairs(0, n_sectors=1)
    found = solve(tmp_path / "one", case, {"rows": rows, "row_omega": omega,
                                           "frequency": np.array([0.03])})
    stiffer = case | {"model": case["model"] | {"stiffness": (
        np.array(case["model"]["stiffness"])
        + (1.03**2 - 1.0) * rows.T @ np.diag(omega**2) @ rows).tolist()}}
    wanted = solve(tmp_path / "other", stiffer, {},
                   cyclic={"engine_order": case["engine_order"], "mistuned": False})
    assert off(found, wanted) < SAME
