"""Random populations of linear disks, against dense solutions of every annulus."""
from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "cyclic"), str(HERE.parent / "support"), str(HERE.parents[1])]

import numpy as np  # noqa: E402
from annulus import random_case  # noqa: E402
from cases import read, run  # noqa: E402
from deviations import WAYS, annulus, draw, write  # noqa: E402

TITLE = "Populations of linear disks"
TEXT = """
Sectors without symmetry, 2 to 9 of them, engine orders from -N to 2 N, no joints, three patterns of
blade frequencies up to 10 % on one to three random rows, beside what the sectors differ in anyhow:
stiffness and mass of blades, matrices of single sectors. Judge: numpy, which solves the annulus of
each disk densely at every row; between the rows, the sum over the modes of the annulus at 4,001
frequencies. Equal: 1e-8 of the amplitude. Missed: a maximum 1e-6 higher than what was found.
"""
COUNT = 1000
SMALL = range(12)
COLUMNS = {"disks": "disks", "equal": "equal", "wrong": "different", "peaks": "with peaks",
           "missed": "missed", "false_peaks": "not on the curve"}
ZERO = ("wrong", "missed", "false_peaks")
ALSO = [HERE.parent / "cyclic" / name for name in ("annulus.py", "deviations.py")]
EQUAL, SAME_PEAK = 1e-8, 1e-6
N_FINE = 4001
N_PATTERNS = 3


class Disk:
    """An annulus with its load, and the displacements of the dofs of all sectors."""

    def __init__(self, case, change):
        self.whole = annulus(case, change)
        model, load = self.whole.case["model"], self.whole.case["load"]
        self.mass, self.damping, self.stiffness = (
            np.array(model[key]) for key in ("mass", "damping", "stiffness"))
        self.force = np.array(load["cosine"]) - 1j * np.array(load["sine"])
        self.show = np.concatenate(self.whole.maps)

    def amplitude(self, omega):
        """(n_sectors, n_dof)."""
        z = self.stiffness - omega**2 * self.mass + 1j * omega * self.damping
        return np.abs(self.show @ np.linalg.solve(z, self.force)).reshape(
            self.whole.n_sectors, -1)

    def amplitudes(self, omegas):
        """The same at many frequencies, by modes (n_omegas, n_sectors, n_dof)."""
        n = len(self.force)
        zero, one = np.zeros((n, n)), np.eye(n)
        solved = np.linalg.solve(self.mass, np.hstack([-self.stiffness, -self.damping]))
        poles, modes = np.linalg.eig(np.vstack([np.hstack([zero, one]), solved]))
        shares = np.linalg.solve(modes, np.concatenate(
            [np.zeros(n), np.linalg.solve(self.mass, self.force)]))
        gain = shares[:, None] / (1j * np.asarray(omegas)[None] - poles[:, None])
        return np.abs(self.show @ (modes[:n] @ gain)).T.reshape(
            len(omegas), self.whole.n_sectors, -1)


def trial(seed, program, folder):
    rng = np.random.default_rng([61, seed])
    way, n_sectors = WAYS[seed % len(WAYS)], int(rng.integers(2, 10))
    case = random_case(rng, n_sectors=n_sectors, n_pairs=1,
                       engine_order=int(rng.integers(-n_sectors, 2 * n_sectors + 1)))
    case["contact"] = {"side_1": [], "side_2": [], "sector_2": []}
    parts, scale, change = draw(rng, case, way, float(rng.uniform(0.0, 0.1)))
    if "rows" not in parts:
        r = int(rng.integers(1, 4))
        parts |= {"rows": 0.5 * rng.normal(size=(r, len(case["model"]["mass"]))),
                  "row_omega": rng.uniform(0.8, 3.0, r)}
    rows, omega = parts["rows"], parts["row_omega"]

    def stiffness(d):
        return rows.T @ np.diag(omega**2 * ((1.0 + scale * d)**2 - 1.0)) @ rows

    if "frequency" in parts:
        given = np.broadcast_to(np.array(parts["frequency"]).reshape(n_sectors, -1),
                                (n_sectors, len(rows)))
        change["stiffness"] -= np.array([stiffness(d) for d in given])
    patterns = float(rng.uniform(0.0, 0.1)) * rng.uniform(
        -1.0, 1.0, (N_PATTERNS, n_sectors, len(rows)))
    parts["patterns"] = patterns
    if rng.random() < 0.3:
        patterns = np.repeat(patterns[:, :, :1], len(rows), axis=2)
        parts["patterns"] = patterns[:, :, 0]
    disks = [Disk(case, {key: 0.0 * values for key, values in change.items()})]
    for pattern in patterns:
        disks.append(Disk(case, change | {"stiffness": change["stiffness"] + np.array(
            [stiffness(d) for d in pattern])}))
    counts = {"kind": way, "notes": []} | dict.fromkeys(COLUMNS, 0)
    write(folder / "model.h5", case, parts)
    groups = {"case": {"analysis": "population"}, "model": {"source": "hdf5", "file": "model.h5"},
              "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
              "mistuning": {"scale": scale}, "harmonics": {"n_harmonics": 1}}
    omegas = np.sort(rng.uniform(0.5, 2.5, int(rng.integers(3, 9))))
    run(folder, groups | {"sweep": {"values": omegas.tolist()}, "population": {"peaks": False}},
        program=program)
    found = read(folder / "case.h5")
    amplitude = np.vstack([found["population/tuned"], found["population/amplitude"]])
    for k, disk in enumerate(disks):
        wanted = np.array([disk.amplitude(w) for w in omegas])
        high = wanted.max(axis=(0, 1))
        error = np.abs(amplitude[k] - high).max() / high.max()
        if k > 0:
            at = [np.abs(omegas - w).argmin() for w in found["population/omega"][k - 1]]
            there = wanted[at, found["population/sector"][k - 1], range(len(at))]
            error = max(error, np.abs(there - high).max() / high.max())
        counts["disks"] += 1
        counts["equal" if error <= EQUAL else "wrong"] += 1
        if error > EQUAL:
            counts["notes"].append(f"{error:.1e} of disk {k}")
    judge_peaks(rng, folder, groups, disks, counts, program)
    return counts


def judge_peaks(rng, folder, groups, disks, counts, program):
    """Maxima of the first disk and of the tuned one between the rows of a sweep."""
    start = float(rng.uniform(0.5, 1.5))
    sweep = {"start": start, "end": start + 1.0, "n_points": 41}
    run(folder, groups | {"sweep": sweep}, "--set", "population%n_patterns=1", program=program)
    found = read(folder / "case.h5")
    amplitude = np.vstack([found["population/tuned"], found["population/amplitude"]])
    for k in range(2):
        fine = disks[k].amplitudes(np.linspace(start, start + 1.0, N_FINE)).max(axis=(0, 1))
        counts["peaks"] += 1
        missed = (fine / amplitude[k]).max() - 1.0
        if missed > SAME_PEAK:
            counts["missed"] += 1
            counts["notes"].append(f"{missed:.1e} above disk {k}")
        if k == 0:
            continue
        on_curve = np.array([disks[k].amplitude(w)[j, i] for i, (w, j) in enumerate(zip(
            found["population/omega"][0], found["population/sector"][0]))])
        if np.abs(on_curve / amplitude[k] - 1.0).max() > EQUAL:
            counts["false_peaks"] += 1
