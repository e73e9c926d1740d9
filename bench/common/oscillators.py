"""Oscillators whose exact periodic responses are known (test/reference), as cases.

The references were computed without harmonic balance: event by event, in closed form, or by
shooting.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from bench.common.measure import ROOT, Floats, Groups

__all__ = ["Case", "coulomb", "duffing_points", "jenkins", "load_cases", "planar",
           "relative_error", "rigid", "single", "two_dof"]


@dataclass(frozen=True)
class Case:
    """An oscillator with its reference coefficients (0, c1, s1, ...)."""

    name: str
    groups: Groups
    reference: Floats


def relative_error(coefficients: Floats, reference: Floats) -> float:
    """Relative L2 error over the harmonics of the reference."""
    n = max(len(coefficients), len(reference))
    difference = np.zeros(n)
    difference[:len(coefficients)] = coefficients
    difference[:len(reference)] -= reference
    difference = difference[:len(reference)]
    weights = np.full(len(reference), 0.5)
    weights[0] = 1.0
    return float(np.sqrt((weights * difference**2).sum() / (weights * reference**2).sum()))


def load_cases() -> list[Case]:
    """One or two cases of each kind, none of them near a fold."""
    return [duffing(), jenkins("jenkins_F1.0_w1.2"), gap("gap_g0.0_F0.3_w1.35"),
            two_dof("A_stickslip"), two_dof("E_separation"), rigid(two_dof("E_separation")),
            planar("A"),
            coulomb("c0.1_N0.4_w0.9", "dlft"), coulomb("c0.1_N0.4_w0.9", "dlft_velocity"),
            coulomb("ss_c0.1_N1.2_w0.4", "dlft"), coulomb("ss_c0.1_N1.2_w0.4", "dlft_velocity")]


def duffing() -> Case:
    """Cubic spring, below the resonance."""
    data = read("a_duffing")
    point = next(p for p in data["points"] if p["omega"] == 0.8)
    p = data["params"]
    groups = single(p, p["F"], point["omega"])
    groups["spring"] = {"n_springs": 1, "side_1": 1, "coefficient": p["alpha"], "power": 3}
    return Case("Duffing", groups, reference(point))


def duffing_points() -> tuple[dict[str, float], list[tuple[float, Floats]]]:
    """Parameters, and every solution that is known with its frequency, unstable ones included."""
    data = read("a_duffing")
    return data["params"], [(point["omega"], reference(point)) for point in data["points"]]


def coulomb(key: str, law: str) -> Case:
    """Rigid friction under a constant normal load on a mass."""
    item = read("b_coulomb")[key]
    p = item["params"]
    groups = single(p, p["F"], p["omega"])
    groups["contact"] = {"n_pairs": 1, "law": law, "side_1": [1, 0, 0], "mu": p["mu"],
                         "normal_load": p["N0"]}
    kind = "stick and slip" if key.startswith("ss") else "slip only"
    return Case(f"Coulomb, {kind}, {law}", groups, reference(item))


def jenkins(key: str) -> Case:
    """Elastic dry friction."""
    item = read("c_jenkins")[key]
    p = item["params"]
    groups = single(p, p["F"], p["omega"])
    groups["contact"] = {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "mu": 1.0,
                         "normal_load": p["muN"], "tangential_stiffness": p["kt"]}
    return Case("Jenkins", groups, reference(item))


def gap(key: str) -> Case:
    """Unilateral spring behind a gap; x > gap closes, hence the negative dof."""
    item = read("e_gap")[key]
    p = item["params"]
    groups = single(p, p["F"], p["omega"])
    groups["contact"] = {"n_pairs": 1, "law": "penalty", "side_1": [0, 0, -1], "gap": p["gap"],
                         "normal_stiffness": p["kc"]}
    return Case("gap", groups, reference(item))


def two_dof(key: str) -> Case:
    """Tangential and normal motion with stick, slip and separation."""
    item = read("d_2dof")[key]
    p = item["params"]
    groups: Groups = {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": flat(p["M"]), "stiffness": flat(p["K"]),
                  "damping": flat(p["C"])},
        "load": {"static": [0.0, p["P0"]], "cosine": [p["Ft"][0], p["Fn"][0]],
                 "sine": [-p["Ft"][1], -p["Fn"][1]]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, -2], "mu": p["mu"],
                    "gap": p["gap"], "tangential_stiffness": p["kt"], "normal_stiffness": p["kn"]},
        "sweep": {"start": p["omega"]}}
    q = item["q1"]
    return Case("two dofs, " + key.split("_")[1].replace("stickslip", "stick and slip"), groups,
                reference(q))


def rigid(case: Case) -> Case:
    """The same with rigid contact on massless nodes (dofs 3, 4) behind the contact springs."""
    contact, model = case.groups["contact"], case.groups["model"]
    springs = np.diag([contact["tangential_stiffness"], contact["normal_stiffness"]])

    def extended(values: list[float], coupling: Floats) -> list[float]:
        matrix = np.kron([[1.0, -1.0], [-1.0, 1.0]], coupling)
        matrix[:2, :2] += np.reshape(values, (2, 2))
        return flat(matrix.tolist())

    groups = case.groups | {
        "model": {"n_dof": 4, "mass": extended(model["mass"], 0.0 * springs),
                  "stiffness": extended(model["stiffness"], springs),
                  "damping": extended(model["damping"], 0.0 * springs)},
        "load": {key: [*values, 0.0, 0.0] for key, values in case.groups["load"].items()},
        "contact": {"n_pairs": 1, "law": "dlft", "side_1": [3, 0, -4], "mu": contact["mu"],
                    "gap": contact["gap"]}}
    return Case(f"{case.name}, rigid", groups, case.reference)


def planar(key: str) -> Case:
    """Elastic dry friction in two tangential directions."""
    item = read("f_2dfriction")[key]
    p = item["params"]
    groups: Groups = {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": [p["m"], 0, 0, p["m"]], "stiffness": [p["kx"], 0, 0, p["ky"]],
                  "damping": [p["cx"], 0, 0, p["cy"]]},
        "load": {"cosine": [p["Fx"], float(p["Fy"] * np.cos(p["phi"]))],
                 "sine": [0.0, float(-p["Fy"] * np.sin(p["phi"]))]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 2, 0], "mu": 1.0,
                    "normal_load": p["muN"], "tangential_stiffness": p["kt"]},
        "sweep": {"start": p["omega"]}}
    return Case("planar friction", groups, np.array(item["x"]))


def single(p: dict[str, float], force: float, omega: float) -> Groups:
    """Mass, damper and spring under a cosine force."""
    return {"case": {"analysis": "point"},
            "model": {"n_dof": 1, "mass": p["m"], "stiffness": p["k"], "damping": p["c"]},
            "load": {"cosine": force}, "sweep": {"start": omega}}


def read(name: str) -> dict:
    """A file of references."""
    return json.loads((ROOT / "test" / "reference" / f"oracle_{name}.json").read_text())


def reference(item: dict) -> Floats:
    """Coefficients in the order (0, c1, s1, ...)."""
    c, s = (item["xc"], item["xs"]) if "xc" in item else (item["c"], item["s"])
    mean = item["x0"] if "x0" in item else item["a0"]
    return np.concatenate([[mean], np.column_stack([c, s]).ravel()])


def flat(matrix: list[list[float]]) -> list[float]:
    """Values of a symmetric matrix, in any order."""
    return [float(value) for row in matrix for value in row]
