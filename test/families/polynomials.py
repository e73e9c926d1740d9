"""Polynomial forces of several dofs against a balance of their own."""
import subprocess

import h5py
import numpy as np
from histories import projected, series

TITLE = "Polynomial forces"
TEXT = """
Chains of one to six masses with one to six terms of degree 2 to 6, as a potential or as forces on
single dofs, each with up to four different dofs of either sign; some with a static load, some
nearly linear, some with forces far above those of the structure. One frequency, 1 to 15 harmonics.

The judge takes the displacements of the result and writes every balance anew at 8,192 instants,
with derivatives of the potential by differences of its own: it has to hold to 1e-6 of the load.
Where all terms are odd powers of one dof the case is run again with springs, and has to be the same
to 1e-7. No solution found counts as failed.
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 4, 7)
COLUMNS = {"solved": "solved", "failed": "ended in words", "springs": "compared with springs",
           "balance": "balance off", "other": "other than springs"}
ZERO = ("balance", "other")

INSTANTS = 8192
BALANCE, SAME = 1e-6, 1e-7


def drawn(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 7))
    springs = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) \
        - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = random.uniform(0.01, 0.05) * mass + random.uniform(0.005, 0.05) * stiffness
    single = random.random() < 0.3
    energy = bool(random.random() < 0.5) and not single
    strength = 10.0 ** random.uniform(-3.0, 0.5)
    terms = []
    for _ in range(int(random.integers(1, 7))):
        if single:
            dof = int(random.integers(1, n + 1))
            terms.append((strength, [dof] * int(random.choice([1, 3, 5])), dof))
            continue
        dofs = random.choice(np.arange(1, n + 1), size=min(n, int(random.integers(1, 5))),
                             replace=False)
        degree = int(random.integers(3 if energy else 2, 6))
        factors = [int(f) for f in random.choice(dofs, size=degree)]
        factors = [f * int(random.choice([-1, 1])) for f in factors]
        terms.append((strength * random.normal() * 0.3, factors, int(random.choice(dofs))))
    # What keeps softening potentials from being left.
    if not single:
        for dof in range(1, n + 1):
            terms.append((strength, [dof] * (6 if energy else 5), dof))
    first = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6).min())
    return {"mass": mass, "damping": damping, "stiffness": stiffness, "terms": terms,
            "energy": energy, "single": single, "cosine": 0.3 * random.normal(size=n),
            "sine": 0.3 * random.normal(size=n),
            "static": 0.2 * random.normal(size=n) * (random.random() < 0.5),
            "omega": first * random.uniform(0.5, 2.0),
            "harmonics": int(random.choice([1, 3, 5, 9, 15]))}


def text(case, springs=False):
    def row(values):
        return ", ".join(f"{float(v)!r}" for v in np.ravel(values))

    lines = ["&case", "analysis = 'point'", "/", "&model", f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    terms = case["terms"]
    if springs:
        lines += ["/", "&spring", f"n_springs = {len(terms)}",
                  "side_1 = " + ", ".join(str(dof) for _, _, dof in terms),
                  "coefficient = " + row([c for c, _, _ in terms]),
                  "power = " + ", ".join(str(len(f)) for _, f, _ in terms)]
    else:
        lines += ["/", "&polynomial", f"n_terms = {len(terms)}",
                  "of = 'energy'" if case["energy"] else "of = 'force'",
                  "coefficient = " + row([c for c, _, _ in terms]),
                  "factors = " + ", ".join(str(f) for _, factors, _ in terms
                                           for f in factors + [0] * (8 - len(factors)))]
        if not case["energy"]:
            lines.append("dof = " + ", ".join(str(dof) for _, _, dof in terms))
    lines += ["/", "&load"] + [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", f"n_harmonics = {case['harmonics']}", "parity = 'all'", "/",
              "&sweep", f"start = {float(case['omega'])!r}", "/", "&solver", "tolerance = 1e-10",
              "/"]
    return "\n".join(lines) + "\n"


def value(term, u):
    """The product of a term, with its coefficient, at instants."""
    coefficient, factors, _ = term
    product = np.full(u.shape[1], coefficient)
    for factor in factors:
        product = product * np.sign(factor) * u[abs(factor) - 1]
    return product


def forces(case, u):
    """(dof, instant): derivatives of a potential by central differences of fourth order."""
    found = np.zeros_like(u)
    if not case["energy"]:
        for term in case["terms"]:
            found[term[2] - 1] += value(term, u)
        return found
    for dof in range(len(u)):
        step = 1e-3 * max(1e-3, np.abs(u[dof]).max())
        for weight, far in ((8.0, 1), (-8.0, -1), (-1.0, 2), (1.0, -2)):
            moved = u.copy()
            moved[dof] += far * step
            found[dof] += weight * sum(value(term, moved) for term in case["terms"]) / (12.0 * step)
    return found


def balance(case, coefficients):
    """The largest residual of a harmonic over the load."""
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    u = np.array([series(coefficients[:, j], tau)[0] for j in range(coefficients.shape[1])])
    own = np.array([projected(f, tau, len(coefficients)) for f in forces(case, u)]).T
    worst = np.abs(case["stiffness"] @ coefficients[0] + own[0] - case["static"]).max()
    for h in range(1, case["harmonics"] + 1):
        z = case["stiffness"] - (h * case["omega"]) ** 2 * case["mass"] \
            + 1j * h * case["omega"] * case["damping"]
        residual = z @ (coefficients[2 * h - 1] - 1j * coefficients[2 * h]) \
            + own[2 * h - 1] - 1j * own[2 * h]
        if h == 1:
            residual -= case["cosine"] - 1j * case["sine"]
        worst = max(worst, np.abs(residual).max())
    return worst / np.linalg.norm([case["cosine"], case["sine"]])


def solved(program, folder, name, case, springs):
    (folder / f"{name}.nml").write_text(text(case, springs))
    done = subprocess.run([program, "-q", f"{name}.nml"], cwd=folder, capture_output=True,
                          text=True, timeout=120, check=False)
    if done.returncode not in (0, 4):
        raise AssertionError(done.stderr)
    if done.returncode:
        return None
    with h5py.File(folder / f"{name}.h5") as file:
        return file["coefficients"][0]


def trial(seed, program, folder):
    case = drawn(seed)
    found = solved(program, folder, "case", case, springs=False)
    if found is None:
        return {"failed": 1}
    counts = {"solved": 1, "balance": int(not balance(case, found) < BALANCE)}
    if case["single"]:
        other = solved(program, folder, "springs", case, springs=True)
        if other is not None:
            counts["springs"] = 1
            # Both may have found another of several solutions.
            counts["other"] = int(np.abs(other - found).max() > SAME * np.abs(found).max())
    return counts
