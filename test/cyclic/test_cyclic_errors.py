"""What is refused of sectors, each with its key, what was found and what is accepted."""
import copy

import h5py
import numpy as np
import pytest
from annulus import random_case
from cases import merged, run
from cyclic_cases import model_groups
from nodal_file import tied, write_nodal_file

CASE = random_case(np.random.default_rng([3, 1]), n_sectors=6, engine_order=1, n_pairs=1)
GROUPS = model_groups(CASE) | {"case": {"analysis": "point"}, "sweep": {"start": 1.0},
                               "harmonics": {"n_harmonics": 3}}
LEFT, RIGHT = CASE["model"]["left"], CASE["model"]["right"]
N = len(CASE["model"]["mass"])
SIDE = CASE["contact"]["side_1"][0], CASE["contact"]["side_2"][0]

REFUSED = {
    "no engine order": ({"cyclic": {"engine_order": None}}, ["engine_order", "missing"]),
    "no sectors": ({"cyclic": {"n_sectors": None}}, ["n_sectors", "missing"]),
    "zero sectors": ({"cyclic": {"n_sectors": 0}}, ["n_sectors", "1"]),
    "too few on the right": ({"cyclic": {"n_interface": len(LEFT) + 1}}, ["left"]),
    "interfaces without their number": ({"cyclic": {"n_interface": None}},
                                        ["n_interface", "missing"]),
    "no interface, with its dofs": ({"cyclic": {"n_interface": 0}}, ["n_interface", "0"]),
    "out of range": ({"cyclic": {"left": [N + 1, *LEFT[1:]]}}, ["left", str(N)]),
    "sign on the left": ({"cyclic": {"left": [-1, *LEFT[1:]]}}, ["left", "-1"]),
    "on both": ({"cyclic": {"right": [LEFT[0], *RIGHT[1:]]}}, ["twice"]),
    "sectors without cyclic": ({"cyclic": {"n_sectors": None, "engine_order": None,
                                           "n_interface": None, "left": None, "right": None}},
                               ["sector_2", "&cyclic"]),
    "too far": ({"contact": {"sector_2": [6]}}, ["sector_2", "-5 to 5"]),
    "ground of another sector": ({"contact": {"side_2": [[0, 0, 0]]}}, ["sector_2", "ground"]),
    "mirrored": ({"contact": {
        "n_pairs": 2, "side_1": [SIDE[0], [-d for d in SIDE[1]]],
        "side_2": [SIDE[1], [-d for d in SIDE[0]]], "sector_2": [1, -1],
        "mu": 0.3, "gap": 0.0, "tangential_stiffness": 1.0, "normal_stiffness": 1.0}},
        ["pair 2", "pair 1", "other sector"]),
    "same dof": ({"contact": {"side_2": [SIDE[0]], "sector_2": [0]}}, ["both sides"]),
    "in time": ({"case": {"analysis": "time"}}, ["analysis", "cyclic"]),
    "stability": ({"sweep": {"stability": True}}, ["stability", "cyclic"]),
    "flow": ({"solver": {"kind": "pseudo_time"}}, ["pseudo_time", "cyclic"]),
    "spring to itself": ({"spring": {"n_springs": 1, "side_1": 1, "side_2": 1,
                                     "coefficient": 1.0}}, ["spring", "both sides"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(tmp_path, name):
    changes, words = REFUSED[name]
    done = run(tmp_path, merged(GROUPS, changes), status=3)
    for word in words:
        assert word in done.stderr, done.stderr


def test_sound(tmp_path):
    run(tmp_path, GROUPS)


def nodal(path, change=None, **options):
    diameters = {}
    for k in range(4):
        diameters[k], kept = tied(CASE, k)
    if change:
        change(diameters)
    for parts in diameters.values():
        parts.pop("observe/matrix", None)
    write_nodal_file(path, 6, options.pop("n_physical", len(kept)), diameters, **options)


def skew(diameters):
    diameters[1]["stiffness"] = diameters[1]["stiffness"] + np.triu(
        np.ones_like(diameters[1]["stiffness"]))


def turn(diameters):
    n = len(diameters[3]["mass"])
    diameters[3]["mass"] = diameters[3]["mass"] + 1j * (np.eye(n, k=1) - np.eye(n, k=-1))


NODAL = {
    "not Hermitian": (skew, ["stiffness", "nodal diameter 1", "Hermitian"]),
    "not real": (turn, ["mass", "nodal diameter 3", "real"]),
    "above N/2": (lambda d: d.update({4: dict(d[1])}), ["/nodal_diameter/4", "from 0 to 3"]),
    "misspelt": (lambda d: d[1].update({"dampimg": d[1]["damping"]}),
                 ["/nodal_diameter/1/dampimg", "damping", "coriolis"]),
    "misspelt load": (lambda d: d[1].update({"load/cosin": d[1]["load/cosine"]}),
                      ["/nodal_diameter/1/load/cosin", "static, cosine"]),
    "missing": (lambda d: d.pop(2), ["harmonic 2", "nodal diameter 2"]),
}


@pytest.mark.parametrize("name", NODAL)
def test_refused_nodal_diameters(tmp_path, name):
    change, words = NODAL[name]
    nodal(tmp_path / "model.h5", change)
    done = run(tmp_path, {
        "case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
        "cyclic": {"engine_order": 1}, "sweep": {"start": 1.0},
        "harmonics": {"n_harmonics": 3}}, status=3)
    for word in words:
        assert word in done.stderr, done.stderr


def test_refused_parts_of_files(tmp_path):
    groups = {"case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
              "cyclic": {"engine_order": 1}, "sweep": {"start": 1.0}}
    nodal(tmp_path / "model.h5")
    with h5py.File(tmp_path / "model.h5", "a") as file:
        file["mass"] = np.eye(2)
    assert "/mass beside" in run(tmp_path, groups, status=3).stderr
    nodal(tmp_path / "model.h5", n_physical=3)
    contact = {"n_pairs": 1, "law": "penalty", "side_1": [[4, 0, 0]], "mu": 0.1, "normal_load": 1.0,
               "tangential_stiffness": 1.0}
    done = run(tmp_path, copy.deepcopy(groups) | {"contact": contact}, status=3)
    assert "side_1" in done.stderr and "3" in done.stderr
    nodal(tmp_path / "model.h5", phase="sideways")
    assert "phase" in run(tmp_path, groups, status=3).stderr
    nodal(tmp_path / "model.h5")
    other = groups | {"cyclic": {"engine_order": 1, "n_sectors": 7}}
    assert "the model has 6" in run(tmp_path, other, status=3).stderr
