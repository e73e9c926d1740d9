"""Bodies that only rotation presses between blades, against forces and balances of the judge's
own."""
import subprocess

import h5py
import numpy as np

import fretwear as fw
from fretwear._namelist import write_namelist as namelist_text

TITLE = "Bodies between blades"
TEXT = """
Wedges, cylinders and strips in a plane, made by `fretwear.damper`: 2 to 8 points of contact, flanks
at 30 to 65 degrees (strips: 90), friction 0.1 to 0.6, with and without rotation, with and without
compliance, between two blades or one in each of 3 to 24 sectors along any engine order. The law is
'penalty', at 128 instants. Loads reach from pairs that stick to those that lift off. One frequency
between half and twice that of the blades, 5 harmonics.

The judge takes the displacements of the result, and of the case the mass, the places of contact and
the angles. It moves the points by formulas of its own (no rows), marches friction from instant to
instant, and wants the forces of the result, and the balance of every harmonic with them, each
within 1e-7 of the largest force and load. A case whose load no friction can balance has to be
refused before any point, and no other; the judge asks a linear program of SciPy.

The derivatives of all first harmonics by the mass of the bodies (`body%mass`) are held against
central differences of two runs each (1e-4 of the largest; of two steps the nearer one, as an
instant may switch between the runs).
"""
COUNT = 200
SMALL = (0, 1, 2, 3, 4, 5, 6, 7)
COLUMNS = {"solved": "solved", "failed": "ended in words", "refused": "refused", "force":
           "forces off", "balance": "balance off", "wrong": "refused or taken wrongly",
           "slope": "derivative off"}
ZERO = ("force", "balance", "wrong", "slope")

HARMONICS, INSTANTS, WITHIN = 5, 128, 1e-7
#: Differences of these steps: round-off of the solver leaves 1e-6 of the larger ones.
STEPS, SLOPE = (1e-5, 1e-6), 1e-4


def drawn(seed):
    random = np.random.default_rng(seed)
    kind = ("wedge", "cylinder", "strip")[seed % 3]
    wave = random.random() < 0.5
    angles = np.array([90.0, 90.0]) if kind == "strip" else random.uniform(30.0, 65.0, 2)
    n_points = random.integers(1, 2 if kind == "cylinder" else 5, 2)
    size = random.uniform(3.0, 8.0) * 1e-3
    places = [np.column_stack([
        (2 * k - 1) * random.uniform(2.0, 8.0, n) * 1e-3,
        np.sort(random.uniform(-4.0, 4.0, n)) * 1e-3]) for k, n in enumerate(n_points)]
    if kind == "strip":
        places = [np.column_stack([p[:, 0], np.full(len(p), 1e-3)]) for p in places]
    n = int(n_points.sum())
    stiff = random.uniform(0.7e4, 2.2e4, 4)
    sectors = int(random.integers(3, 25))
    return {
        "kind": kind, "wave": wave, "angles": angles, "places": places, "size": size,
        "mass": float(10.0**random.uniform(-2.5, -1.0)),
        "inertia": float(10.0**random.uniform(-7.0, -5.5)) if random.random() < 0.7 else None,
        "compliance": tuple(random.uniform(3e4, 1e5, 2)) if random.random() < 0.3 else None,
        "mu": random.uniform(0.1, 0.6, n), "kt": random.uniform(1.5e4, 2.5e4, n),
        "kn": random.uniform(2.5e4, 3.5e4, n), "stiff": stiff,
        "tie": float(random.uniform(1e4, 8e4)), "damping": float(random.uniform(2e-4, 2e-3)),
        "sectors": sectors, "order": int(random.integers(0, sectors)),
        "pressing": float(random.uniform(20.0, 80.0)),
        "cosine": random.normal(size=4) * 10.0**random.uniform(-0.5, 1.0),
        "sine": random.normal(size=4) * 10.0**random.uniform(-0.5, 0.5),
        "omega": float(np.sqrt(stiff.mean()) * random.uniform(0.5, 2.0))}


def blades(case):
    """Two blades of two dofs, or the two sides of a blade in a sector: mass and stiffness."""
    stiffness = np.diag(case["stiff"])
    if case["wave"]:
        for k in (0, 1):
            stiffness[k, k] += case["tie"]
            stiffness[k + 2, k + 2] += case["tie"]
            stiffness[k, k + 2] -= case["tie"]
            stiffness[k + 2, k] -= case["tie"]
    return np.eye(4), stiffness


#: Rotation speed and radius.
SPEED, RADIUS = 100.0, 0.2


def model_of(case):
    M, K = blades(case)
    plain = fw.Model(M, case["damping"] * K, K, cosine=case["cosine"], sine=case["sine"],
                     sectors=fw.Sectors(case["sectors"]) if case["wave"] else None)
    # Left of the body is the right side of the blade of its own sector.
    on_left, on_right = ([3, 4], [1, 2]) if case["wave"] else ([1, 2], [3, 4])
    n_left, n_right = (len(places) for places in case["places"])
    points = [None, None] if case["kind"] == "cylinder" else case["places"]
    return fw.damper(
        plain, case["kind"], mass=case["pressing"] / RADIUS / SPEED**2, inertia=case["inertia"],
        radius=RADIUS, angles=tuple(case["angles"]), size=case["size"],
        left=fw.Flank([on_left] * n_left, points[0]),
        right=fw.Flank([on_right] * n_right, points[1], sector=int(case["wave"])),
        mu=case["mu"], tangential_stiffness=case["kt"], normal_stiffness=case["kn"],
        compliance=case["compliance"], law="penalty")


def points_of(case, variant=""):
    """Of each point its place, tangent, normal, first dof of its platform and whether that lies in
    the next sector."""
    found = []
    for k, places in enumerate(case["places"]):
        angle = np.radians(case["angles"][k])
        turn = 1.0 if k == 0 else -1.0
        tangent = np.array([turn * np.sin(angle), np.cos(angle)])
        normal = np.array([turn * np.cos(angle), -np.sin(angle)])
        if variant == "normal":
            normal = -normal
        first = (2 if k == 0 else 0) if case["wave"] else 2 * k
        onward = case["wave"] and k == (0 if variant == "sector" else 1)
        for place in places:
            at = -case["size"] * normal if case["kind"] == "cylinder" else place
            found.append((at, tangent, normal, first, onward))
    return found


def wanted_refusal(case):
    """Whether no forces of friction balance the load of the body."""
    from scipy.optimize import linprog

    columns = []
    for i, (at, tangent, normal, _, _) in enumerate(points_of(case)):
        for side in (-1.0, 1.0):
            force = normal + side * case["mu"][i] * tangent
            columns.append([*force, at[0] * force[1] - at[1] * force[0]])
    load = np.array([0.0, case["pressing"], 0.0])
    rows = slice(0, 2 if case["inertia"] is None else 3)
    A = np.array(columns).T
    A[2] *= 1e3
    return linprog(np.zeros(len(columns)), A_eq=A[rows], b_eq=-load[rows]).status == 2


def force_of(case, motion, variant=""):
    """Forces on the dofs by the displacements at instants (instant, dof), and those of the pairs
    (pair, 2, instant)."""
    n_body = 2 + (case["inertia"] is not None)
    total, pairs = np.zeros_like(motion), []
    shift = 0
    if case["wave"]:
        shift = case["order"] / case["sectors"]
    onward = delayed(motion, shift)
    for i, (at, tangent, normal, first, is_onward) in enumerate(points_of(case, variant)):
        x = motion[:, 4].copy()
        y = motion[:, 5].copy()
        if n_body == 3:
            turn = -1.0 if variant == "turn" else 1.0
            x -= turn * at[1] * motion[:, 6]
            y += turn * at[0] * motion[:, 6]
        platform = (onward if is_onward else motion)[:, first:first + 2]
        along, across = (d[0] * x + d[1] * y for d in (tangent, normal))
        if case["compliance"]:
            node = 4 + n_body + 2 * i
            stretch = [motion[:, node] - along, motion[:, node + 1] - across]
            springs = [k * s for k, s in zip(case["compliance"], stretch)]
            along, across = motion[:, node], motion[:, node + 1]
        slip = along - platform @ tangent
        press = np.minimum(0.0, case["kn"][i] * (across - platform @ normal))
        rub = marched(case["kt"][i] * slip, -case["mu"][i] * press)
        pairs.append([rub, press])
        on_platform = -np.outer(rub, tangent) - np.outer(press, normal)
        if is_onward:
            on_platform = delayed(on_platform, -shift)
        total[:, first:first + 2] += on_platform
        if case["compliance"]:
            total[:, node] += rub + springs[0]
            total[:, node + 1] += press + springs[1]
            rub, press = -springs[0], -springs[1]
        body = np.outer(rub, tangent) + np.outer(press, normal)
        total[:, 4:6] += body
        if n_body == 3:
            total[:, 6] += turn * (at[0] * body[:, 1] - at[1] * body[:, 0])
    return total, np.array(pairs)


def marched(pull, limit):
    """Coulomb's law from instant to instant until the turn repeats; an unstrained start."""
    force, at = np.zeros_like(pull), 0.0
    for _ in range(20):
        before = at
        for k, (y, most) in enumerate(zip(pull, limit)):
            force[k] = np.clip(y - at, -most, most)
            at = y - force[k]
        if abs(at - before) <= 1e-14 * np.abs(pull).max():
            break
    return force


def delayed(values, part):
    """Series of instants, later by a part of the period."""
    spectrum = np.fft.rfft(values, axis=0)
    n = np.arange(len(spectrum))
    return np.fft.irfft(spectrum * np.exp(-2j * np.pi * n * part)[:, None], len(values), axis=0)


def complex_rows(values):
    """Coefficients (0, c1, s1, ..) as U_n = c_n - i s_n."""
    return np.vstack([values[:1], values[1::2] - 1j * values[2::2]])


def judged(case, u, said, variant=""):
    """How far forces and balances are off, beside the largest."""
    n = u.shape[1]
    U = complex_rows(u)
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    motion = np.real(np.exp(1j * np.outer(tau, np.arange(len(U)))) @ U)
    total, pairs = force_of(case, motion, variant)
    spectrum = np.fft.rfft(np.concatenate([total, pairs.reshape(-1, INSTANTS).T], axis=1),
                           axis=0)[:HARMONICS + 1] / INSTANTS
    spectrum[1:] *= 2.0
    forces, of_pairs = spectrum[:, :n], spectrum[:, n:]
    M, K = np.zeros((2, n, n))
    M[:4, :4], K[:4, :4] = blades(case)
    C = case["damping"] * K
    M[4:6, 4:6] = np.eye(2) * case["pressing"] / RADIUS / SPEED**2
    if case["inertia"] is not None:
        M[6, 6] = case["inertia"]
    load = np.zeros((HARMONICS + 1, n), complex)
    load[0, 5] = case["pressing"]
    load[1, :4] = case["cosine"] - 1j * case["sine"]
    worst = 0.0
    for h in range(HARMONICS + 1):
        s = h * case["omega"]
        worst = max(worst, np.abs((K - s**2 * M + 1j * s * C) @ U[h] + forces[h] - load[h]).max())
    told = np.hstack([complex_rows(said[:, i, [0, 2]]) for i in range(said.shape[1])])
    size = np.abs(of_pairs).max()
    return np.abs(told - of_pairs).max() / size, worst / max(size, np.abs(load).max())


def run_of(case, program, folder, **more):
    model_of(case).to_hdf5(folder / "model.h5")
    groups = {
        "case": {"analysis": "point"},
        "model": {"source": "hdf5", "file": "model.h5", "rotation_speed": SPEED},
        "harmonics": {"n_harmonics": HARMONICS, "n_time": INSTANTS, "sampling": "uniform"},
        "sweep": {"start": case["omega"]}, "solver": {"tolerance": 1e-11}} | more
    if case["wave"]:
        groups["cyclic"] = {"engine_order": case["order"]}
    (folder / "case.nml").write_text(namelist_text(groups))
    return subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)


def slope_off(case, program, folder):
    """How far the derivatives by the mass are from differences, beside the largest; none where a
    run ends in words."""
    mass, tight = case["pressing"] / RADIUS / SPEED**2, {"solver": {"tolerance": 1e-12}}

    def first(name, **more):
        done = run_of(case, program, folder, **tight, **more)
        with h5py.File(folder / "case.h5") as file:
            return None if done.returncode else np.array(file[name][0])

    slope = first("sensitivity/first_harmonic/body_mass",
                  sensitivity={"parameters": ["body%mass"]})
    if slope is None:
        return 0.0
    off = []
    for step in STEPS:
        ends = [first("coefficients", body={"mass": [(1.0 + side * step) * mass]})
                for side in (-1, 1)]
        if ends[0] is None or ends[1] is None:
            continue
        difference = np.subtract(*(np.hypot(end[1], end[2]) for end in ends[::-1])) / (
            2.0 * step * mass)
        off.append(np.abs(slope.ravel() - difference).max() / np.abs(difference).max())
    return min(off, default=0.0)


def trial(seed, program, folder):
    case = drawn(seed)
    done = run_of(case, program, folder)
    found = dict.fromkeys(COLUMNS, 0) | {"kind": case["kind"], "notes": []}
    refused = done.returncode == 3 and "cannot hold it" in done.stderr
    found["wrong"] = int(refused != wanted_refusal(case))
    if refused:
        return {**found, "refused": 1}
    if done.returncode == 4:
        return {**found, "failed": 1, "notes": [f"not converged: {done.stderr.strip()[-200:]}"]}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u, said = file["coefficients"][0], file["contact/force"][0]
    found["solved"] = 1
    force, balance = judged(case, u, np.asarray(said))
    found["force"], found["balance"] = int(force > WITHIN), int(balance > WITHIN)
    if found["force"] + found["balance"]:
        found["notes"].append(f"forces off by {force:.1e}, balance by {balance:.1e}")
    slope = slope_off(case, program, folder)
    found["slope"] = int(slope > SLOPE)
    if found["slope"]:
        found["notes"].append(f"derivative off by {slope:.1e}")
    return found
