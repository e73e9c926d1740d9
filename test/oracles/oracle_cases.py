"""The reference problems as cases of fw_run, and their solutions as coefficient vectors."""
from __future__ import annotations

import numpy as np

# As in the table of errors to reach: sampling must not hide the truncation of the series.
N_TIME = 1024
# Far below every error that is looked at.
TOLERANCE = 1e-11


def to_vector(mean, cosines, sines):
    """Coefficients in the order 0, c1, s1, c2, s2, .."""
    vector = np.zeros(2 * len(cosines) + 1)
    vector[0], vector[1::2], vector[2::2] = mean, cosines, sines
    return vector


def coefficients_of(solution):
    """Coefficient vector of one coordinate of a reference solution, however it was stored."""
    if isinstance(solution, dict) and "xc" in solution:
        return to_vector(solution["x0"], solution["xc"], solution["xs"])
    if isinstance(solution, dict):
        return to_vector(solution["a0"], solution["c"], solution["s"])
    return np.array(solution)


def error(computed, reference):
    """Relative L2 error over the harmonics both have, against the norm of the whole reference.

    Harmonics above H are no error of the computed ones: this is the reading under which the
    tabled errors are found again.
    """
    n = min(len(computed), len(reference))
    return np.linalg.norm(computed[:n] - reference[:n]) / np.linalg.norm(reference)


def point(model, load, omega, n_harmonics, contact=None, spring=None, **harmonics):
    """A case of analysis 'point'."""
    groups = {"case": {"analysis": "point", "threads": 1}, "model": model}
    if contact:
        groups["contact"] = {"n_pairs": 1, **contact}
    if spring:
        groups["spring"] = {"n_springs": 1, **spring}
    groups["load"] = load
    groups["harmonics"] = {"n_harmonics": n_harmonics, "n_time": N_TIME, **harmonics}
    groups["sweep"] = {"start": omega}
    groups["solver"] = {"tolerance": TOLERANCE}
    return groups


def sweep(groups, start, end, n_points):
    """The same case as a sweep, for branches that no point alone is led to."""
    return {**groups, "case": {"analysis": "frf", "threads": 1},
            "sweep": {"start": start, "end": end, "n_points": n_points}}


def oscillator(p):
    """Mass, damper and spring."""
    return {"n_dof": 1, "mass": p["m"], "stiffness": p["k"], "damping": p["c"]}


def duffing(p, omega, n_harmonics):
    """Oscillator with a cubic spring."""
    return point(oscillator(p), {"cosine": p["F"]}, omega, n_harmonics,
                 spring={"side_1": 1, "coefficient": p["alpha"], "power": 3}, n_time=0)


def jenkins(p, n_harmonics, **harmonics):
    """Oscillator with elastic dry friction."""
    return point(oscillator(p), {"cosine": p["F"]}, p["omega"], n_harmonics,
                 {"law": "penalty", "side_1": [1, 0, 0], "mu": 1.0, "normal_load": p["muN"],
                  "tangential_stiffness": p["kt"]}, **harmonics)


def gap(p, n_harmonics):
    """Oscillator with an elastic stop above it: the stop is met by u > gap."""
    return point(oscillator(p), {"cosine": p["F"]}, p["omega"], n_harmonics,
                 {"law": "penalty", "side_1": [0, 0, -1], "gap": p["gap"],
                  "normal_stiffness": p["kc"]})


def coulomb(p, n_harmonics, **contact):
    """Oscillator with rigid friction; a varying normal load presses a massless dof down."""
    contact = {"law": "dlft", "mu": p["mu"], **contact}
    if p["N1"] == 0.0:
        return point(oscillator(p), {"cosine": p["F"]}, p["omega"], n_harmonics,
                     {"side_1": [1, 0, 0], "normal_load": p["N0"], **contact})
    # The spring of the massless dof carries nothing while the pair is closed, and gives the
    # dof a place while it is open; neither enters the sliding motion.
    model = {"n_dof": 2, "mass": np.diag([p["m"], 0.0]), "stiffness": np.diag([p["k"], 1.0]),
             "damping": np.diag([p["c"], 0.0])}
    load = {"static": [0.0, -p["N0"]], "cosine": [p["F"], -p["N1"] * np.cos(p["psi"])],
            "sine": [0.0, p["N1"] * np.sin(p["psi"])]}
    return point(model, load, p["omega"], n_harmonics, {"side_1": [1, 0, 2], **contact})


def two_dof(p, n_harmonics):
    """Sliding and pressing coordinates on an elastic frictional contact; q2 > gap closes."""
    model = {"n_dof": 2, "mass": p["M"], "stiffness": p["K"], "damping": p["C"]}
    forces = np.array([p["Ft"], p["Fn"]])
    load = {"static": [0.0, p["P0"]], "cosine": forces[:, 0], "sine": -forces[:, 1]}
    return point(model, load, p["omega"], n_harmonics,
                 {"law": "penalty", "side_1": [1, 0, -2], "mu": p["mu"], "gap": p["gap"],
                  "tangential_stiffness": p["kt"], "normal_stiffness": p["kn"]})


def two_dof_massless(p, n_harmonics):
    """The same with rigid contact on massless nodes (dofs 3, 4) behind the contact springs."""
    springs, none = np.diag([p["kt"], p["kn"]]), np.zeros((2, 2))

    def extended(matrix):
        return np.block([[np.array(matrix), none], [none, none]])

    groups = two_dof(p, n_harmonics)
    stiffness = extended(p["K"]) + np.block([[springs, -springs], [-springs, springs]])
    groups["model"] = {"n_dof": 4, "mass": extended(p["M"]), "damping": extended(p["C"]),
                       "stiffness": stiffness}
    groups["load"] = {key: [*values, 0.0, 0.0] for key, values in groups["load"].items()}
    groups["contact"] = {"n_pairs": 1, "law": "dlft", "side_1": [3, 0, -4], "mu": p["mu"],
                         "gap": p["gap"]}
    return groups


def chain(p, n_harmonics, **contact):
    """Two masses, the second on rigid friction."""
    k, c = p["k2"], p["c2"]
    model = {"n_dof": 2, "mass": np.diag([p["m1"], p["m2"]]),
             "stiffness": [p["k1"] + k, -k, -k, k], "damping": [p["c1"] + c, -c, -c, c]}
    return point(model, {"cosine": [p["F"], 0.0]}, p["omega"], n_harmonics,
                 {"law": "dlft", "side_1": [2, 0, 0], "mu": 1.0, "normal_load": p["muN"],
                  **contact})


def planar(p, n_harmonics, **harmonics):
    """Elastic dry friction in two tangential directions."""
    model = {"n_dof": 2, "mass": p["m"] * np.eye(2), "stiffness": np.diag([p["kx"], p["ky"]]),
             "damping": np.diag([p["cx"], p["cy"]])}
    load = {"cosine": [p["Fx"], p["Fy"] * np.cos(p["phi"])],
            "sine": [0.0, -p["Fy"] * np.sin(p["phi"])]}
    return point(model, load, p["omega"], n_harmonics,
                 {"law": "penalty", "side_1": [1, 2, 0], "mu": 1.0, "normal_load": p["muN"],
                  "tangential_stiffness": p["kt"]}, **harmonics)
