"""Structures whose supports or whose ground moves, against the equations of the absolute motion."""
import subprocess

import h5py
import numpy as np

TITLE = "Motion of the base"
TEXT = """
Structures of one to six dofs, full matrices, on one or two supports (dofs of the model, some turned
round) or on a ground that moves in a direction; one to three harmonics of the base, some with a
constant part, given as displacement, velocity or acceleration; an elastic pair that slips and a
cubic spring between the supports and the structure, or within it; loads of their own beside in a
half; 3 to 15 harmonics, one frequency. Every other structure has further matrices, each in a half:
Coriolis and circulatory forces and a stiffness of a rotation speed, which is given or follows the
frequency, stiffness and damping of any shape, hysteretic damping by a matrix and by a loss factor.

The judge knows no relative motion. It takes the absolute displacements of the result (of a ground:
what it adds itself) and writes the equation of motion of every free dof anew with the whole
matrices: each harmonic has to hold to 1e-7 of the largest force. Supports have to move as they were
told. The force of the pair is marched over 8,192 instants (0.5 % of its limit), that of the spring
is the cube of its elongation at the instants.
"""
COUNT = 100
SMALL = (0, 1, 2, 5)
COLUMNS = {"solved": "solved", "failed": "ended in words", "slips": "with slip",
           "balance": "balance off", "supports": "supports off", "pair": "force of the pair off"}
ZERO = ("balance", "supports", "pair")
INSTANTS = 8192
MATRICES = ("stiffness_rotation", "coriolis", "circulatory", "stiffness_unsymmetric",
            "damping_unsymmetric", "structural_damping")


def drawn(seed):
    random = np.random.default_rng(seed)
    on_ground = random.random() < 0.4
    n_free = int(random.integers(1, 7))
    n = n_free + (0 if on_ground else int(random.integers(1, 3)))
    root = random.normal(size=(n, n))
    stiffness = root @ root.T / n + np.diag(random.uniform(0.5, 1.5, n))
    root = random.normal(size=(n, n))
    mass = 0.1 * root @ root.T / n + np.diag(random.uniform(0.5, 1.5, n))
    h = int(random.choice([3, 5, 9, 15]))
    terms = [(int(random.integers(1, min(h, 3) + 1)), random.uniform(0.1, 1.0),
              random.uniform(-180.0, 180.0)) for _ in range(int(random.integers(1, 4)))]
    motion = int(random.integers(0, 3))
    if motion == 0 and random.random() < 0.4:
        terms.append((0, random.normal(), 0.0))
    dof = [] if on_ground else [int(s * (n_free + k + 1)) for k, s in enumerate(
        random.choice([-1, 1], n - n_free))]
    # Elements from the first mass: to a support, which takes it along, or within the structure.
    to_support = not on_ground and random.random() < 0.6
    other = abs(dof[0]) if to_support else int(random.integers(2, n_free + 1)) if n_free > 1 else 0
    loaded = random.random() < 0.5
    return {**further(seed, n, any(t[0] == 0 for t in terms)),
            "mass": mass, "stiffness": stiffness, "n_free": n_free,
            "damping": random.uniform(0.01, 0.05) * mass + random.uniform(0.01, 0.05) * stiffness,
            "dof": dof, "direction": random.normal(size=n) if on_ground else None,
            "motion": motion, "terms": terms, "harmonics": h,
            "other": other if on_ground or to_support or other else -1,
            "limit": 10.0**random.uniform(-1.5, 0.5), "kt": random.uniform(0.3, 2.0),
            "cubic": random.uniform(0.0, 0.3), "loaded": loaded,
            "cosine": np.append(random.normal(size=n_free), np.zeros(n - n_free)) * loaded,
            "static": np.append(random.normal(size=n_free), np.zeros(n - n_free)) * loaded,
            "omega": random.uniform(0.4, 2.0)}


def further(seed, n, is_constant):
    """Matrices of every other seed, and the speed that they are for; zeros of the rest."""
    random = np.random.default_rng([seed, 7])
    found = {name: np.zeros((n, n)) for name in MATRICES}
    found.update(loss_factor=0.0, speed=0.0, order=0.0)
    if seed % 2 == 0:
        return found
    for name in MATRICES:
        if random.random() < 0.5:
            continue
        root = random.normal(size=(n, n))
        found[name] = {"stiffness_rotation": 0.05 * (root @ root.T),
                       "coriolis": 0.4 * (root - root.T), "circulatory": 0.05 * root,
                       "stiffness_unsymmetric": 0.1 * root, "damping_unsymmetric": 0.02 * root,
                       "structural_damping": 0.05 * (root @ root.T)}[name]
    if random.random() < 0.5:
        found["loss_factor"] = random.uniform(0.01, 0.2)
    if any(np.any(found[name]) for name in ("coriolis", "circulatory", "stiffness_rotation")):
        # A constant motion does not go with a speed that follows the frequency.
        follows = random.random() < 0.5 and not is_constant
        found["order" if follows else "speed"] = random.uniform(0.5, 3.0)
    return found


def write_model(case, path):
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name in ("mass", "damping", "stiffness", *MATRICES):
            if name not in MATRICES or np.any(case[name]):
                file[name] = case[name]


def text(case):
    def row(values):
        return ", ".join(f"{float(v)!r}" for v in np.ravel(values))

    words = ("displacement", "velocity", "acceleration")
    lines = ["&case", "analysis = 'point'", "/", "&model", "source = 'hdf5'", "file = 'm.h5'",
             f"loss_factor = {case['loss_factor']!r}", f"rotation_speed = {case['speed']!r}"]
    lines += ["/", "&base", f"n_terms = {len(case['terms'])}",
              f"motion = '{words[case['motion']]}'",
              "harmonic = " + ", ".join(str(t[0]) for t in case["terms"]),
              f"amplitude = {row([t[1] for t in case['terms']])}",
              f"phase = {row([t[2] for t in case['terms']])}"]
    lines.append(f"direction = {row(case['direction'])}" if case["direction"] is not None else
                 "dof = " + ", ".join(map(str, case["dof"])) + "\nframe = 'absolute'")
    if case["other"] >= 0:
        lines += ["/", "&contact", "n_pairs = 1", "law = 'penalty'", "side_1 = 1, 0, 0",
                  f"side_2 = {case['other']}, 0, 0", "mu = 1.0", f"normal_load = {case['limit']!r}",
                  f"tangential_stiffness = {case['kt']!r}", "/", "&spring", "n_springs = 1",
                  "side_1 = 1", f"side_2 = {case['other']}", f"coefficient = {case['cubic']!r}"]
    lines += ["/", "&load", f"cosine = {row(case['cosine'])}", f"static = {row(case['static'])}",
              "/", "&harmonics", f"n_harmonics = {case['harmonics']}", "parity = 'all'", "/",
              "&sweep", f"start = {case['omega']!r}", f"speed_order = {case['order']!r}", "/",
              "&solver", "tolerance = 1e-10", "/"]
    return "\n".join(lines) + "\n"


def amplitudes(coefficients, h):
    """Complex amplitudes of harmonic h of rows (2H+1, ...)."""
    if h == 0:
        return coefficients[0].astype(complex)
    return coefficients[2 * h - 1] - 1j * coefficients[2 * h]


def base_of(case, h):
    """Complex amplitude of u_b in a harmonic."""
    found = 0.0 + 0.0j
    for n, amplitude, phase in case["terms"]:
        if n == h:
            turned = amplitude * np.exp(1j * np.radians(phase))
            found += turned.real if h == 0 else turned / (1j * h * case["omega"])**case["motion"]
    return found


def marched(y, limit):
    x, force = 0.0, np.empty_like(y)
    for _ in range(3):
        for k, value in enumerate(y):
            force[k] = min(max(value - x, -limit), limit)
            x = value - force[k]
    return force


def trial(seed, program, folder):
    case = drawn(seed)
    write_model(case, folder / "m.h5")
    (folder / "case.nml").write_text(text(case))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    kind = ("ground" if case["direction"] is not None else "supports")
    if seed % 2:
        kind += ", further matrices"
    found = {**dict.fromkeys(COLUMNS, 0), "kind": kind}
    if done.returncode == 4:
        return {**found, "failed": 1}
    assert done.returncode == 0, done.stderr
    n, h_max, omega = len(case["mass"]), case["harmonics"], case["omega"]
    pair = None
    with h5py.File(folder / "case.h5") as file:
        u = file["coefficients"][0]
        if case["other"] >= 0:
            pair = file["contact/force"][0][:, 0, 0]
    elastic = np.zeros((2 * h_max + 1, n))
    if pair is not None:
        # On a ground elements see what the result has, between dofs also of the absolute motion.
        far = u[:, case["other"] - 1] if case["other"] else 0.0
        e = u[:, 0] - far
        tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
        rows = [np.ones(INSTANTS)]
        for h in range(1, h_max + 1):
            rows += [np.cos(h * tau), np.sin(h * tau)]
        rows = np.array(rows)
        values = e @ rows
        weights = np.full(2 * h_max + 1, 2.0 / INSTANTS)
        weights[0] = 1.0 / INSTANTS
        force = weights * (rows @ marched(case["kt"] * values, case["limit"]))
        found["pair"] = int(np.abs(force - pair).max() > 5e-3 * case["limit"])
        found["slips"] = int(np.ptp(case["kt"] * values) > 2.0 * case["limit"])
        cubic = weights * (rows @ (case["cubic"] * values**3))
        elastic[:, 0] += pair + cubic
        if case["other"]:
            elastic[:, case["other"] - 1] -= pair + cubic
    speed = omega / case["order"] if case["order"] else case["speed"]
    gyroscopic = speed * case["coriolis"]
    stiffness = case["stiffness"] + speed**2 * case["stiffness_rotation"]
    loss = case["structural_damping"] + case["loss_factor"] * stiffness
    stiffness = stiffness + case["stiffness_unsymmetric"] + speed * case["circulatory"]
    damping = case["damping"] + case["damping_unsymmetric"] + gyroscopic
    free = np.arange(case["n_free"])
    worst = largest = 0.0
    for h in range(h_max + 1):
        s = h * omega
        z = stiffness - s**2 * case["mass"] + 1j * s * damping + 1j * (h > 0) * loss
        v = amplitudes(u, h)
        parts = [z @ v, amplitudes(elastic, h)]
        if case["direction"] is not None:
            # Inertia of the ground; a constant acceleration is one too.
            carried = base_of(case, h)
            inertia = -s**2 * case["mass"] + 1j * s * gyroscopic
            parts.append(inertia @ case["direction"] * carried)
        else:
            told = np.sign(case["dof"]) * base_of(case, h)
            found["supports"] |= int(np.abs(v[case["n_free"]:] - told).max() > 1e-10)
        parts.append(-{0: case["static"], 1: case["cosine"]}.get(h, np.zeros(n)).astype(complex))
        largest = max(largest, *(np.abs(part[free]).max() for part in parts))
        worst = max(worst, np.abs(sum(parts)[free]).max())
    found.update(solved=1, balance=int(worst > 1e-7 * largest))
    return found
