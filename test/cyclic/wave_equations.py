"""Balance of a sector under a travelling wave, formed anew in NumPy from sector matrices, and the
same with the mistakes that come to mind: a test that they do not fail has no power."""
from __future__ import annotations

import numpy as np
from nodal_file import tied

VARIANTS = ("right", "sign of EO", "phi for n phi", "B^T for B^H")
#: Share of the motion in the higher harmonics above which they tell their nodal diameters.
SEEN = 1e-3


def contact_rows(case, t, kept, k):
    """Rows B of nodal diameter k on the tied dofs (3 n_pairs, n_kept)."""
    contact, n = case["contact"], len(case["model"]["mass"])
    z = np.exp(-2j * np.pi * k / case["n_sectors"])
    rows = np.zeros((3 * len(contact["side_1"]), n), dtype=complex)
    for i, (first, second, sector) in enumerate(
            zip(contact["side_1"], contact["side_2"], contact["sector_2"])):
        for c in range(3):
            for signed, factor in ((first[c], 1.0), (second[c], -(z**sector))):
                if signed:
                    rows[3 * i + c, abs(signed) - 1] += factor * np.sign(signed)
    return rows @ t


def shows(case, variant, coefficients):
    """Whether a mistake changes anything: not where the wave stands, or a joint that sticks leaves
    all of the motion in harmonic 1."""
    k = case["engine_order"] % case["n_sectors"]
    if variant == "phi for n phi":
        return k != 0 and np.abs(coefficients[3:]).max() > SEEN * np.abs(coefficients).max()
    return 2 * k % case["n_sectors"] != 0


def defect(case, omega, coefficients, force, variant="right"):
    """Norm of Z_n U_n + B_n^H Lambda_n - F_n over all harmonics, over that of the load.

    coefficients (2H+1, n) of all dofs of the sector, force (2H+1, n_pairs, 3).
    """
    total = reference = 0.0
    for n in range((len(coefficients) + 1) // 2):
        k = n * case["engine_order"]
        if variant == "phi for n phi":
            k = case["engine_order"] if n else 0
        elif variant == "sign of EO":
            k = -k
        parts, kept = tied(case, k)
        rows = contact_rows(case, parts["observe/matrix"], kept, k)
        u, lam = ((c[0] if n == 0 else c[2 * n - 1] - 1j * c[2 * n])
                  for c in (coefficients, force.reshape(len(force), -1)))
        dynamic = parts["stiffness"] - (n * omega)**2 * parts["mass"] \
            + 1j * n * omega * parts["damping"]
        load = {0: parts["load/static"], 1: parts["load/cosine"] - 1j * parts["load/sine"]}.get(
            n, 0.0)
        back = rows.T if variant == "B^T for B^H" else rows.conj().T
        total += np.linalg.norm(dynamic @ u[kept] + back @ lam - load) ** 2
        reference += np.linalg.norm(load) ** 2
    return float(np.sqrt(total / reference))
