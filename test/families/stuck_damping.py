"""Modal damping of the stuck joint: small vibrations against linear algebra of another origin."""
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
from scipy.linalg import eigh, null_space

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "cyclic"), str(HERE.parent / "support")]
from annulus import Annulus, random_case  # noqa: E402
from cases import namelist_text  # noqa: E402
from cyclic_cases import model_groups  # noqa: E402

TITLE = "Modal damping of the stuck joint"
TEXT = """
`modal_damping_of = 'stuck'` with a ratio from 0.001 to 0.3. Chains of three to nine masses with one
to three pairs between masses or to the ground, which slide and press, some dofs without mass,
linear springs, other damping beside; in kinds: `elastic` (`penalty`), `rigid` (`dlft`, `rigid`),
`both` (`penalty` beside `dlft`), `gaps` (elastic pairs that stand open: they count as stuck in the
damping and do nothing else), and `sector`, a sector of 5 to 12 with pairs across and inside,
`penalty` or `dlft`, in any engine order. The load is small: no pair slips, opens or closes. Half of
the plain ones damp the modes up to a frequency alone.

The judge knows the matrices and the rows of the pairs. Of M over K with the springs of elastic
pairs, in the null space of the rows that rigid pairs hold, he takes the modes that have mass, makes
`M Phi diag(2 zeta omega) Phi^T M` of them, and solves the linear equations of the first harmonic,
those of the whole annulus for a sector. The response has to be his within 1e-6 of the largest
displacement, and that with open modes has to differ (`told apart`).
"""
COUNT = 200
SMALL = (0, 1, 2, 3, 4, 9)
COLUMNS = {"solved": "solved", "failed": "ended in words", "massless": "with massless dofs",
           "apart": "told apart", "response": "response off"}
ZERO = ("response",)
ALSO = [HERE.parent / "cyclic" / name for name in ("annulus.py", "cyclic_cases.py")]

KINDS = ("elastic", "rigid", "both", "gaps", "sector")
#: Of the displacement; the load over what pairs bear.
SAME, LOAD = 1e-6, 1e-4
HELD = ("dlft", "rigid")


def chain(random, kind):
    """Groups, and rows of the joint: (row, stiffness or None, whether it acts here)."""
    n_pairs = int(random.integers(1, 4))
    n = 3 * n_pairs
    k = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    mass, unit = np.diag(random.uniform(0.5, 2.0, n)), np.eye(n)
    laws = {"rigid": ("dlft", "rigid"), "both": ("penalty", "dlft")}.get(
        kind, ("penalty",))
    chosen = [str(random.choice(laws)) for _ in range(n_pairs)]
    if kind == "rigid":
        chosen = [chosen[0]] * n_pairs
    k_t, k_n = random.uniform(1.0, 4.0, (2, n_pairs))
    order, joint, side_1, side_2 = random.permutation(n), [], [], []
    massless = bool(random.random() < 0.3)
    for i, law in enumerate(chosen):
        a, b, c = order[3 * i:3 * i + 3]
        if massless:
            mass[a, a] = mass[c, c] = 0.0
        to_ground = random.random() < 0.3
        side_1.append([int(a) + 1, 0, int(c) + 1])
        side_2.append([0 if to_ground else int(b) + 1, 0, 0])
        acts = kind != "gaps"
        joint.append((unit[a] - (0.0 if to_ground else unit[b]),
                      None if law in HELD else k_t[i], acts))
        joint.append((unit[c], None if law in HELD else k_n[i], acts))
    contact = {"n_pairs": n_pairs, "law": chosen, "side_1": side_1, "side_2": side_2, "mu": 0.5,
               "gap": 0.5 if kind == "gaps" else -0.5}
    if any(law not in HELD for law in chosen):
        contact |= {"tangential_stiffness": k_t.tolist(), "normal_stiffness": k_n.tolist()}
    springs = [(unit[order[0]], 0.6, True)] if random.random() < 0.5 else []
    groups = {"model": {"n_dof": n, "mass": mass, "stiffness": stiffness,
                        "damping": 0.01 * stiffness}, "contact": contact,
              "load": {"cosine": random.normal(size=n), "sine": random.normal(size=n)}}
    if springs:
        groups["spring"] = {"n_springs": 1, "side_1": [int(order[0]) + 1], "coefficient": [0.6],
                            "power": [1]}
    whole = {"mass": mass, "stiffness": stiffness, "damping": 0.01 * stiffness,
             "force": groups["load"]["cosine"] - 1j * groups["load"]["sine"]}
    return groups, whole, joint + springs, lambda u: u, massless


def sector(random):
    """The same of a sector; the judge's is the annulus."""
    law = str(random.choice(["penalty", "dlft"]))
    case = random_case(random, law=law, n_sectors=int(random.integers(5, 13)))
    case["load"]["static"] = [0.0] * len(case["load"]["static"])
    annulus = Annulus(case)
    model, contact = annulus.case["model"], annulus.case["contact"]
    unit = np.eye(len(model["mass"]))
    joint = []
    for i, (one, two) in enumerate(zip(contact["side_1"], contact["side_2"], strict=True)):
        for c, name in ((0, "tangential_stiffness"), (2, "normal_stiffness")):
            row = sum(sign * np.sign(side[c]) * unit[abs(side[c]) - 1]
                      for sign, side in ((1.0, one), (-1.0, two)))
            joint.append((row, contact[name][i] if law == "penalty" else None, True))
    load = annulus.case["load"]
    whole = {key: np.array(model[key]) for key in ("mass", "stiffness", "damping")}
    whole["force"] = np.array(load["cosine"]) - 1j * np.array(load["sine"])
    return model_groups(case), whole, joint, annulus.sector, law == "dlft"


def joined(whole, joint):
    """Stiffness and basis of what the joint leaves free."""
    stiffness, held = whole["stiffness"].copy(), []
    for row, k, _ in joint:
        if k is None:
            held.append(row)
        else:
            stiffness += k * np.outer(row, row)
    return stiffness, null_space(np.array(held)) if held else np.eye(len(stiffness))


def response(whole, joint, ratio, up_to):
    """Of the first harmonic, c - i s."""
    stiffness, basis = joined(whole, joint)
    mass, n = whole["mass"], basis.shape[1]
    damping = whole["damping"].astype(float)
    if n > 0:
        theta, x = eigh(basis.T @ mass @ basis, basis.T @ stiffness @ basis)
        kept = theta > 1e-11 * theta.max()
        omega = 1.0 / np.sqrt(theta[kept])
        sides = mass @ basis @ x[:, kept] / np.sqrt(theta[kept])
        damping = damping + (sides * np.where(omega <= up_to, 2.0 * ratio * omega, 0.0)) @ sides.T
    stiffness, basis = joined(whole, [row for row in joint if row[2]])
    w = whole["omega"]
    z = basis.T @ (stiffness + 1j * w * damping - w**2 * mass) @ basis
    return basis @ np.linalg.solve(z, basis.T @ whole["force"])


def solve(groups, program, folder):
    (folder / "case.nml").write_text(namelist_text(groups))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    if done.returncode == 4:
        return None
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u = file["coefficients"][0]
    return (u[1] - 1j * u[2]) / LOAD


def trial(seed, program, folder):
    random, kind = np.random.default_rng([2027, seed]), KINDS[seed % len(KINDS)]
    groups, whole, joint, of_sector, massless = sector(random) if kind == "sector" else \
        chain(random, kind)
    ratio = float(10.0**random.uniform(-3.0, -0.5))
    whole["omega"] = float(random.uniform(0.4, 3.0))
    up_to = float(random.uniform(0.5, 2.0)) if kind != "sector" and seed % 2 else 0.0
    groups["case"] = {"analysis": "point"}
    groups["load"]["harmonic_scale"] = LOAD
    groups["model"] |= {"modal_damping": ratio, "modal_damping_of": "stuck"}
    if up_to:
        groups["model"]["modal_damping_up_to"] = up_to / (2.0 * np.pi)
    groups["harmonics"] = {"n_harmonics": 1}
    groups["sweep"] = {"start": whole["omega"]}
    groups["solver"] = {"tolerance": 1e-11}
    found = {"kind": kind, **dict.fromkeys(COLUMNS, 0), "massless": int(massless)}
    u = solve(groups, program, folder)
    if u is None:
        return {**found, "failed": 1}
    wanted = response(whole, joint, ratio, up_to or np.inf)
    wanted = of_sector(wanted[None, :])[0]
    size = np.abs(wanted).max()
    off = np.abs(u - wanted).max() / size
    groups["model"]["modal_damping_of"] = "open"
    other = solve(groups, program, folder)
    apart = other is not None and np.abs(other - wanted).max() > 10.0 * SAME * size
    return {**found, "solved": 1, "apart": int(apart), "response": int(off > SAME),
            "notes": [f"off by {off:.1e}"] if off > SAME else []}
