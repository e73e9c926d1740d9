"""Numbers of linear modes with Coriolis forces, heavy dampers and forces of the air, against all
solutions of the stuck pencil, and the mode that each number and each `near` starts from."""
import subprocess

import h5py
import numpy as np
import scipy.linalg

TITLE = "Linear modes with Coriolis forces and heavy dampers"
TEXT = """
Structures of two to six masses and sectors of two to six dofs in waves both ways, each with one or
two pairs: stuck springs (`penalty`) or held (`dlft`), also across sectors. Coriolis forces from
0.003 to 1 of the frequencies, one to three dashpots of 0.1 to 2 of critical, forces of the air,
massless dofs with a spring or a dashpot of their own, and rotors whose frequencies at rest are
equal in pairs. Of every case each `number` is run, one more than there are, and three values of
`near`, also between two modes.

The judge puts the stuck matrices together itself. A mode is a real omega > 0 with a xi for which
(K - (omega^2 + i omega xi) M + i omega C) U = 0, that is i omega is an eigenvalue of lambda^2 M +
lambda (C - xi M) + K. It takes all of them at once from an eigenproblem of the square of the order,
in omega alone: (K + i omega C) x conj(M) + M x conj(K + i omega C) - 2 omega^2 M x conj(M) is
singular. Those with xi < 2 omega oscillate and have numbers, in ascending order of omega. With
dampers that are light they are the eigenvalues lambda to second order; without, these themselves.

*Another* is a number that gives no such mode or one of another number, *twice* a mode under two
numbers, *first row* a curve whose first row below the onset is another mode. `modes` counts lists
of `analysis = 'modes'` that are not the imaginary parts of lambda in ascending order, of structures
with Coriolis forces or those of the air. *Double* are two modes of the same omega and xi, which are
to be refused.
"""
COUNT = 500
SMALL = (0, 1, 2, 3, 4, 8, 9, 14, 22)
COLUMNS = {"numbers": "numbers run", "another": "another mode", "twice": "twice",
           "negative": "negative", "row": "first row another", "near": "values of near",
           "near_wrong": "another than the nearest", "beyond": "number too high not refused",
           "refused": "refused in words", "double": "double, refused", "unsaid": "failed unsaid",
           "overdamped": "modes that do not oscillate", "modes": "lists of modes off",
           "unjudged": "not judged"}
ZERO = ("another", "twice", "negative", "row", "near_wrong", "beyond", "unsaid", "modes", "refused")

#: Of omega and xi, over omega: eigenvalues of non-normal matrices with margins.
SAME = 1e-6
#: Of the eigenproblem of the square of the order, before a solution is made exact.
ROUGH = 1e-4
KINDS = ("Coriolis", "dashpots", "both", "wave", "wave, both")


def positive(random, n):
    """A positive definite matrix with eigenvalues of one order."""
    root = random.normal(size=(n, n))
    return root @ root.T / n + np.diag(random.uniform(0.3, 1.5, n))


def skew(random, n):
    root = random.normal(size=(n, n))
    return root - root.T


def plain(random, n):
    """Mass, stiffness and Coriolis matrix of a structure, and the dofs of its pairs."""
    mass, stiffness, coriolis = positive(random, n), positive(random, n), skew(random, n)
    if n > 2 and random.random() < 0.25:
        mass[-1], mass[:, -1], coriolis[-1], coriolis[:, -1] = 0.0, 0.0, 0.0, 0.0
    sides = [[int(dof), 0, 0] for dof in random.choice(n, int(random.integers(1, 3)), False) + 1]
    if len(sides) == 1 and n > 2 and random.random() < 0.4:
        sides[0][2] = int(random.choice([d for d in range(1, n + 1) if d != sides[0][0]]))
    return mass, stiffness, coriolis, sides


def rotor(random, n):
    """Of which all frequencies at rest are equal in pairs, with its pair."""
    half, plane = max(1, n // 2), np.eye(2)
    mass = np.kron(np.diag(random.uniform(0.5, 2.0, half)), plane)
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    coriolis = np.kron(np.diag(random.uniform(0.2, 1.0, half)), turn)
    dof = 2 * int(random.integers(half)) + 1
    return mass, np.kron(positive(random, half), plane), coriolis, [[dof, dof + 1, 0]]


def dashpots(random, mass, stiffness):
    """One to three, of 0.1 to 2 of critical."""
    n, total = len(mass), np.zeros_like(mass)
    scale = np.sqrt(np.trace(stiffness) * np.trace(mass)) / n
    for _ in range(int(random.integers(1, 4))):
        row = np.zeros(n)
        first, second = random.choice(n, 2, False)
        row[first] = 1.0
        row[second] = -1.0 if random.random() < 0.4 else 0.0
        total += 2.0 * scale * np.exp(random.uniform(np.log(0.1), np.log(2.0))) * np.outer(row, row)
    return total


def drawn(seed):
    """A case; `speed` is 0 where it has no Coriolis forces."""
    random = np.random.default_rng([17, seed])
    kind = KINDS[seed % len(KINDS)]
    is_wave = kind.startswith("wave")
    n = int(random.integers(2, 7)) + is_wave
    turns = not is_wave and kind != "dashpots" and random.random() < 0.35
    mass, stiffness, coriolis, sides = (rotor if turns else plain)(random, n)
    case = {"kind": kind, "is_wave": is_wave, "mass": mass, "stiffness": stiffness,
            "law": "dlft" if random.random() < 0.3 else "penalty", "side_1": sides,
            "side_2": [[0, 0, 0] for _ in sides], "sector_2": [0 for _ in sides],
            "tangential": float(random.uniform(0.2, 1.5)),
            "normal": float(random.uniform(0.5, 2.0)),
            "n_sectors": 1, "order": 0, "left": [], "right": [], "air": {}, "speed": 0.0}
    light = random.choice([0.0, 0.003, 0.02])
    case["damping"] = light * stiffness
    if kind in ("dashpots", "both", "wave, both"):
        case["damping"] = case["damping"] + dashpots(random, mass, stiffness)
    rate = np.sqrt(np.trace(stiffness) / np.trace(mass)) * np.trace(mass) / n
    if kind != "dashpots":
        case["speed"] = float(np.exp(random.uniform(np.log(0.003), 0.0)))
        coriolis = coriolis * rate / np.abs(coriolis).max()
    case["coriolis"] = coriolis
    if is_wave:
        as_sector(random, case)
    if sum(dof != 0 for side in case["side_1"] for dof in side) >= n - is_wave:
        # Held pairs would leave nothing that vibrates.
        case["law"] = "penalty"
    return case


def as_sector(random, case):
    """One interface dof, an engine order, pairs to the next sector, and the air."""
    n = len(case["mass"])
    case.update(n_sectors=int(random.integers(3, 9)), left=[1], right=[2])
    case["order"] = int(random.integers(-case["n_sectors"], case["n_sectors"] + 1))
    inner = list(range(3, n + 1)) or [1]
    case["side_1"] = [[int(random.choice(inner)), 0, 0]]
    case["side_2"], case["sector_2"] = [[0, 0, 0]], [0]
    if len(inner) > 1 and random.random() < 0.5:
        other = int(random.choice([dof for dof in inner if dof != case["side_1"][0][0]]))
        case["side_2"], case["sector_2"] = [[other, 0, 0]], [1]
    if random.random() < 0.35:
        case["air"] = {m: 0.05 * complex(*random.normal(size=2)) for m in (-1, 0, 1)}


def stuck(case):
    """K, M and C of the wave, or of the structure, with its pairs stuck."""
    n = len(case["mass"])
    z = np.exp(-2j * np.pi * case["order"] / case["n_sectors"])
    tie = np.eye(n, dtype=complex)
    for left, right in zip(case["left"], case["right"]):
        tie[right - 1] = z * tie[left - 1]
    tie = np.delete(tie, [right - 1 for right in case["right"]], axis=1)
    k = case["stiffness"] - sum((q * z**m for m, q in case["air"].items()), 0j) * np.outer(
        np.eye(n)[-1], np.eye(n)[-1])
    rows, springs = [], []
    for first, second, sector in zip(case["side_1"], case["side_2"], case["sector_2"]):
        for c, spring in ((0, case["tangential"]), (1, case["tangential"]), (2, case["normal"])):
            row = np.zeros(n, dtype=complex)
            for dof, factor in ((first[c], 1.0), (second[c], -(z**sector))):
                if dof:
                    row[dof - 1] += factor
            if np.any(row):
                rows.append(row @ tie)
                springs.append(spring)
    k, m, c = (tie.conj().T @ x @ tie for x in (
        k, case["mass"], case["damping"] + case["speed"] * case["coriolis"]))
    rows = np.array(rows)
    if case["law"] == "penalty":
        return k + rows.conj().T @ (np.array(springs)[:, None] * rows), m, c
    free = scipy.linalg.null_space(rows)
    return tuple(free.conj().T @ x @ free for x in (k, m, c))


def theta_at(k, m, c, omega):
    """theta of all finite solutions of (K + i omega C) U = theta M U."""
    value = scipy.linalg.eigvals(m, k + 1j * omega * c)
    return 1.0 / value[np.abs(value) > 1e-12 * np.abs(value).max()]


def solutions(k, m, c):
    """(omega, xi) of all modes, in ascending order; None where they are not as many as masses."""
    n = len(k)
    if n == 0:
        return []
    size = n * n
    conj = np.conj
    zero = np.kron(k, conj(m)) + np.kron(m, conj(k))
    first = 1j * (np.kron(c, conj(m)) - np.kron(m, conj(c)))
    second = -2.0 * np.kron(m, conj(m))
    a = np.block([[np.zeros((size, size)), np.eye(size)], [-zero, -first]])
    b = np.block([[np.eye(size), np.zeros((size, size))], [np.zeros((size, size)), second]])
    value, scale = scipy.linalg.eig(a, b, right=False, homogeneous_eigvals=True)
    omega = value[np.abs(scale) > 1e-9 * np.abs(value)] / scale[
        np.abs(scale) > 1e-9 * np.abs(value)]
    omega = omega[(omega.real > 1e-6) & (np.abs(omega.imag) < ROUGH * np.abs(omega))].real
    found = []
    for start in np.sort(omega):
        for theta in theta_at(k, m, c, start):
            if abs(theta.real - start**2) < 30 * ROUGH * start * max(abs(theta), start**2)**0.5:
                found += exact(k, m, c, start, theta)
    found.sort()
    modes = []
    for mode in found:
        if not any(near(mode, other, 1e-9) for other in modes):
            modes.append(mode)
    # Of one frequency those of less damping come first.
    for j in range(len(modes)):
        while j and modes[j][0] < (1 + 1e-9) * modes[j - 1][0] and modes[j][1] < modes[j - 1][1]:
            modes[j - 1], modes[j], j = modes[j], modes[j - 1], j - 1
    # Repeated ones as often as they are.
    modes = [mode for mode in modes for _ in range(sum(
        abs(theta - complex(mode[0]**2, mode[0] * mode[1])) < 1e-7 * abs(theta)
        for theta in theta_at(k, m, c, mode[0])))]
    return modes if len(modes) == np.linalg.matrix_rank(m, 1e-9) else None


def exact(k, m, c, omega, theta):
    """By secants on Re theta - omega^2 along the theta that is nearest."""
    points = [(omega, theta), (omega * (1 + 1e-6), None)]
    for _ in range(40):
        omega = points[-1][0]
        all_theta = theta_at(k, m, c, omega)
        theta = all_theta[np.argmin(np.abs(all_theta - points[-2][1]))]
        points[-1] = (omega, theta)
        (w0, t0), (w1, t1) = points[-2:]
        f0, f1 = t0.real - w0**2, t1.real - w1**2
        if abs(f1) < 1e-13 * w1**2 or w1 == w0 or f1 == f0:
            break
        step = np.clip(-f1 * (w1 - w0) / (f1 - f0), -0.01 * w1, 0.01 * w1)
        points.append((w1 + step, None))
    omega, theta = points[-1] if points[-1][1] is not None else points[-2]
    return [(omega, theta.imag / omega)] if abs(theta.real - omega**2) < 1e-9 * omega**2 else []


def near(one, other, part=SAME):
    return max(abs(one[0] - other[0]), abs(one[1] - other[1])) < part * other[0]


def eigenvalues(k, m, c):
    """Of lambda^2 M + lambda C + K."""
    n = len(k)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-k, -c]])
    b = np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), m]])
    value, scale = scipy.linalg.eig(a, b, right=False, homogeneous_eigvals=True)
    kept = np.abs(scale) > 1e-10 * np.abs(value)
    return value[kept] / scale[kept]


def write_model(path, case):
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name in ("mass", "stiffness", "damping"):
            file[name] = case[name]
        if not case["is_wave"] and case["speed"] == 0.0:
            return
        file["coriolis"] = case["coriolis"]
        file.create_group("cyclic").attrs["n_sectors"] = case["n_sectors"]
        if case["is_wave"]:
            file["cyclic/left"], file["cyclic/right"] = case["left"], case["right"]
        if case["air"]:
            file["aero/modes"] = np.eye(len(case["mass"]))[-1:]
            for m, q in case["air"].items():
                file[f"aero/sector/{m}"] = np.array([[[q.real, q.imag]]])


def text(case, keys):
    """The namelist of a mode, or of the list of modes without keys."""
    n_pairs, is_cyclic = len(case["side_1"]), case["is_wave"] or case["speed"] > 0.0
    analysis = "mode" if keys else "modes"
    lines = [f"&case analysis = '{analysis}' /", "&model source = 'hdf5' file = 'model.h5m'"
             + (f" rotation_speed = {case['speed']!r}" if case["speed"] > 0.0 else "") + " /"]
    if is_cyclic:
        lines.append(f"&cyclic engine_order = {case['order']} /" if keys
                     else f"&cyclic n_modes = {2 * len(case['mass'])} /")
    flat = {side: ", ".join(str(d) for pair in case[side] for d in pair)
            for side in ("side_1", "side_2")}
    contact = (f"&contact n_pairs = {n_pairs} law = '{case['law']}' side_1 = {flat['side_1']}\n"
               f"   side_2 = {flat['side_2']} mu = 0.5")
    if case["is_wave"]:
        contact += f" sector_2 = {', '.join(map(str, case['sector_2']))}"
    if case["side_1"][0][2]:
        contact += " gap = -0.3"
    else:
        contact += " normal_load = 1.0"
    if case["law"] == "penalty":
        contact += f" tangential_stiffness = {case['tangential']!r}"
        if case["side_1"][0][2]:
            contact += f" normal_stiffness = {case['normal']!r}"
    lines.append(contact + " /")
    if keys:
        lines += ["&harmonics n_harmonics = 1 /", f"&mode {keys} start = 1e-5 end = 2e-5",
                  "   control = 'modal' n_points = 2 continuation = 'natural' /",
                  "&output observe = 1 /"]
    return "\n".join(lines) + "\n"


class Runs:
    """Runs of a case."""

    def __init__(self, case, program, folder):
        self.case, self.program, self.folder = case, program, folder
        write_model(folder / "model.h5m", case)

    def run(self, keys):
        """Status, what was said, and the result."""
        path, target = self.folder / "case.nml", self.folder / "case.h5"
        path.write_text(text(self.case, keys))
        target.unlink(missing_ok=True)
        try:
            done = subprocess.run([self.program, "-q", "-o", target.name, path.name],
                                  cwd=self.folder, check=False, capture_output=True, text=True,
                                  timeout=60)
        except subprocess.TimeoutExpired:
            return -1, "", target
        return done.returncode, done.stderr, target

    def mode(self, keys):
        """What was said where it was refused, or number, stuck mode and the first row below the
        onset."""
        status, said, target = self.run(keys)
        if status == 3 and len(said) > 40:
            return said
        if status not in (0, 4):
            return None
        with h5py.File(target) as file:
            about = file["mode"].attrs
            stuck_mode = (float(about["stuck_omega"]),
                          2.0 * float(about["stuck_omega"] * about["stuck_damping_ratio"]))
            row = None
            onset = about.get("onset_amplitude", np.nan)
            if file["converged"][0] and not onset < 1.0e-5:
                omega = float(file["omega"][0])
                row = omega, float(file["mode/self_excitation"][0])
            return int(about["number"]), stuck_mode, row


def one(counts, notes, found, modes, number, key):
    """Judge one run; `key` counts those that are another mode."""
    if found is None:
        counts["unsaid"] += 1
        notes.append(f"{key} {number}: neither a result nor a message")
    elif isinstance(found, str):
        double = any(near(modes[number - 1], other) for k, other in enumerate(modes)
                     if k != number - 1)
        counts["double" if double else "refused"] += 1
        if not double:
            notes.append(f"number {number}: {found.strip()[:200]}")
    else:
        got, stuck_mode, row = found
        if not near(stuck_mode, modes[number - 1]) or got != number:
            counts[key] += 1
            notes.append(f"{key}: number {number} is {modes[number - 1]}, not {stuck_mode}")
        counts["negative"] += int(stuck_mode[0] <= 0.0)
        if row is not None and not near(row, stuck_mode):
            counts["row"] += 1
            notes.append(f"number {number}: first row {row}, stuck {stuck_mode}")
        return stuck_mode
    return None


def listed(runs, case, k, m, c):
    """Whether the list of modes is the one of the eigenvalues, where it has them with damping."""
    if not (case["speed"] > 0.0 or case["air"]) or len(k) == 0:
        return True
    status, _, target = runs.run("")
    if status != 0:
        return False
    with h5py.File(target) as file:
        order = (case["order"] + (case["n_sectors"] - 1) // 2) % case["n_sectors"] - (
            case["n_sectors"] - 1) // 2
        row = list(file["modes/nodal_diameter"][()]).index(order)
        ours = file["modes/closed"][row]
    root = eigenvalues(k, m, c)
    exact_ones = np.sort(root.imag[root.imag > 1e-7 * np.abs(root).max()])
    ours = ours[np.isfinite(ours)]
    ours = ours[ours > 1e-7 * np.abs(root).max()]
    return len(ours) == len(exact_ones) and np.allclose(ours, exact_ones, rtol=1e-5, atol=1e-6)


def trial(seed, program, folder):
    case = drawn(seed)
    counts, notes = dict.fromkeys(COLUMNS, 0), []
    k, m, c = stuck(case)
    everything = solutions(k, m, c)
    if everything is None:
        return {"kind": case["kind"], "unjudged": 1, "notes": ["another count than of masses"]}
    if not everything:
        return {"kind": case["kind"], "unjudged": 1, "notes": ["no mass moves with stuck pairs"]}
    modes = [mode for mode in everything if mode[1] < 2.0 * mode[0]]
    counts["overdamped"] = len(everything) - len(modes)
    runs, starts = Runs(case, program, folder), []
    for number in range(1, len(modes) + 1):
        counts["numbers"] += 1
        starts.append(one(counts, notes, runs.mode(f"number = {number}"), modes, number, "another"))
    starts = [start for start in starts if start is not None]
    counts["twice"] = sum(any(near(start, other) for other in starts[:j])
                          for j, start in enumerate(starts))
    beyond = runs.mode(f"number = {len(modes) + 1}")
    if len(k) and not isinstance(beyond, str):
        counts["beyond"] += 1
        notes.append(f"number {len(modes) + 1} of {len(modes)}: {beyond}")
    random = np.random.default_rng([18, seed])
    for _ in range(3 if modes else 0):
        j = int(random.integers(len(modes)))
        low, high = modes[j][0], modes[min(j + 1, len(modes) - 1)][0]
        place = float(low + random.choice([0.0, 0.45, 0.55, 1.3]) * (high - low))
        apart = [round(abs(mode[0] - place), 9) for mode in modes]
        number = int(np.argmin(apart)) + 1
        counts["near"] += 1
        one(counts, notes, runs.mode(f"near = {place!r}"), modes, number, "near_wrong")
    if not listed(runs, case, k, m, c):
        counts["modes"] += 1
        notes.append("list of modes")
    return {"kind": case["kind"], **counts, "notes": notes}
