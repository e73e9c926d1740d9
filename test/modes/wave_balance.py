"""Equilibrium and work of a mode of a sector in the whole annulus, written out in NumPy."""
import numpy as np
from cyclic_cases import model_groups
from mode_cases import amplitudes


def around(case, values, n):
    """Complex amplitudes of harmonic n of a sector, as those of all sectors of the annulus."""
    phase = 2.0 * np.pi * case["engine_order"] / case["n_sectors"]
    return [values * np.exp(-1j * n * j * phase) for j in range(case["n_sectors"])]


def whole_motion(ring, case, u, n):
    """Field of the annulus: each dof from its own sector; of one sector it is that already."""
    size = ring.maps[0].shape[1]
    if len(u) == size and case["n_sectors"] == 1:
        return u
    whole = np.zeros(size, complex)
    for t, sector in zip(ring.maps, around(case, u, n), strict=True):
        for i in ring.inner:
            whole[np.flatnonzero(t[i])[0]] = sector[i]
    return whole


def whole_force(ring, case, row, n):
    """Contact forces of all pairs of all sectors in harmonic n (dofs of the annulus)."""
    contact, total = case["contact"], np.zeros(ring.maps[0].shape[1], complex)
    for pair, (one, two, shift) in enumerate(zip(
            contact["side_1"], contact["side_2"], contact["sector_2"], strict=True)):
        for component in range(3):
            force = amplitudes(row[:, pair, component][:, None])[n, 0]
            for j, here in enumerate(around(case, force, n)):
                for dof, sector, sign in ((one[component], j, 1.0),
                                          (two[component], j + shift, -1.0)):
                    at = ring.dof(sector, dof)
                    if at:
                        total[abs(at) - 1] += sign * np.sign(at) * here
    return total


def whole_matrices(ring):
    """Mass, stiffness, damping and static load of the annulus."""
    whole = model_groups(ring.case)
    size = whole["model"]["n_dof"]
    return *(np.reshape(whole["model"][name], (size, size))
             for name in ("mass", "stiffness", "damping")), np.array(whole["load"]["static"])


def unbalanced(ring, case, found, k):
    """(K - theta M + i n omega C) U_n + contact - static load, over the largest elastic force."""
    mass, stiffness, damping, static = whole_matrices(ring)
    omega, xi = found["omega"][k], found["mode/self_excitation"][k]
    u = amplitudes(found["coefficients"][k])
    scale = max(np.abs(stiffness @ whole_motion(ring, case, u[1], 1)).max(), np.abs(static).max())
    worst = 0.0
    for n in range(len(u)):
        theta = (n * omega) ** 2 + 1j * n * omega * xi
        z = stiffness - theta * mass + 1j * n * omega * damping
        left = z @ whole_motion(ring, case, u[n], n) + whole_force(
            ring, case, found["contact/force"][k], n)
        worst = max(worst, np.abs(left - static if n == 0 else left).max())
    return worst / scale


def work_error(ring, case, found, k):
    """Work of the self-excitation less that of dampers and friction, over the largest of them."""
    mass, _, damping, _ = whole_matrices(ring)
    omega, xi = found["omega"][k], found["mode/self_excitation"][k]
    u = amplitudes(found["coefficients"][k])
    taken = case["n_sectors"] * found["contact/dissipation"][k].sum()
    given = lost = 0.0
    for n in range(1, len(u)):
        motion = whole_motion(ring, case, u[n], n)
        given += np.pi * n**2 * omega * xi * (motion.conj() @ mass @ motion).real
        lost += np.pi * n**2 * omega * (motion.conj() @ damping @ motion).real
    return abs(given - lost - taken) / max(abs(given), lost, taken)
