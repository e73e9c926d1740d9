"""Cases of nonlinear modes: reference values, runs, and a slow harmonic balance to judge them."""
import json
from pathlib import Path

import h5py
import numpy as np
from cases import merged, read, run

REFERENCES = json.loads(Path(__file__).with_name("mode_references.json").read_text())


def mode_groups(groups, start, end, n_harmonics, *, n_points=2, changes=None, **mode):
    """Groups of a case of analysis 'mode'."""
    keys = {"start": start, "end": end, "n_points": n_points, "control": "modal",
            "continuation": "natural"} | mode
    case = merged(groups, {"case": {"analysis": "mode"}, "mode": keys,
                           "harmonics": {"n_harmonics": n_harmonics},
                           "solver": {"tolerance": 1e-12}})
    return merged(case, changes or {})


def read_mode(folder):
    """Every dataset of the result, and the attributes of /mode."""
    found = read(folder / "case.h5")
    with h5py.File(folder / "case.h5") as file:
        found["attributes of mode"] = dict(file["mode"].attrs) if "mode" in file else {}
    return found


def follow(folder, groups, start, end, n_harmonics, *, status=0, **options):
    """Run a mode and read it."""
    run(folder, mode_groups(groups, start, end, n_harmonics, **options), status=status)
    return read_mode(folder)


def at_amplitude(folder, groups, amplitude, n_harmonics, **options):
    """Frequency and damping ratio at one modal amplitude."""
    found = follow(folder, groups, amplitude, 1.001 * amplitude, n_harmonics, **options)
    return found["omega"][0], found["mode/damping_ratio"][0]


def matrices(groups):
    """M, K and C of the namelist groups."""
    model = groups["model"]
    shape = (model["n_dof"],) * 2
    return [np.reshape(model[name], shape).T for name in ("mass", "stiffness", "damping")]


def amplitudes(coefficients):
    """Complex amplitudes U_n = c_n - i s_n of (0, c1, s1, ...), the harmonics in rows."""
    return np.vstack([coefficients[:1], coefficients[1::2] - 1j * coefficients[2::2]])


def pair_force(groups, row):
    """Complex amplitudes of the contact forces on the dofs, from their coefficients."""
    contact = groups["contact"]
    n_dof = groups["model"]["n_dof"]
    sides = [np.reshape(contact[side], (contact["n_pairs"], 3)) for side in ("side_1", "side_2")]
    total = np.zeros((n_dof, (row.shape[0] + 1) // 2), complex)
    for pair in range(contact["n_pairs"]):
        for component in range(3):
            force = amplitudes(row[:, pair, component][:, None])[:, 0]
            for side, sign in zip(sides, (1.0, -1.0), strict=True):
                dof = side[pair, component]
                if dof:
                    total[abs(dof) - 1] += sign * np.sign(dof) * force
    return total.T
