"""Onset of slip or separation of nonlinear modes, against the bound of shakedown."""
import itertools
import subprocess

import h5py
import numpy as np
import scipy.linalg
from scipy.optimize import linprog

TITLE = "Onsets"
TEXT = """
One to four masses in a row with one to three pairs, to the ground or between two of them, that move
in one or two tangential directions, under a dead load or with normal dofs that a static load and an
interference press together; coupled stiffness between all directions, light damping, not always
proportional; the laws `rigid`, `dlft`, `dlft_velocity` and `penalty`. Each mode is followed by
natural steps and by arc length, with 15 and with 60 points, to 1.2 to 8 times its onset.

The judge takes the stuck mode with its damping from scipy, and the forces that it makes in each
pair. The stuck motion of an amplitude is possible where some constant offset of the tangential
forces (a position of each pair) keeps every pair below its limit at each of 2,880 instants; offsets
and normal forces depend on each other through the structure. The largest amplitude is that of a
linear program, whose planes follow circles of friction by cuts: the bound, above which no stuck
motion exists. Below it one may not be reached from the assembly where tangential motion changes the
normal forces. In one direction a pair is where it was assembled, or has been pushed just as far as
its limit asks for: the judge tries these three states of each pair together and halves the
amplitudes between a motion that is stuck and none; that is the onset. In two directions paths
decide: where the onset is below the bound by more than 3e-4, a row between the two, of a run of its
own, has to slip or part.

*Wrong* is what differs by more than 3e-4 from the onset, or from the bound if the row between
sticks. *Steps differ*: the runs of one structure give onsets that differ by more than 3e-4.
*Highest stuck* are those where no solution was found just above, which the result says.
"""
COUNT = 80
SMALL = (0, 3, 4)
COLUMNS = {"runs": "runs", "refused": "no mode", "ended": "ended below the onset",
           "below": "onset below the bound", "stuck": "highest stuck", "wrong": "wrong",
           "differ": "steps differ"}
ZERO = ("wrong", "differ")

#: Instants of uniform sampling leave 2e-5; the judge's leave 2e-6.
CLOSE = 3e-4
LAWS = ("rigid", "dlft", "dlft_velocity", "penalty")
INSTANTS = 2 * np.pi * np.arange(2880) / 2880
STEPS = [(word, n) for word in ("natural", "arclength") for n in (15, 60)]


def drawn(seed):
    """A structure: matrices, rows of its pairs, constants, loads."""
    random = np.random.default_rng(seed)
    law = LAWS[seed % 4]
    planes, normal = 1 + seed // 4 % 2, bool(random.random() < 0.75)
    width = planes + normal
    n = int(random.integers(1 if law == "penalty" else 2, 5))
    size = n * width
    mass = np.repeat(random.uniform(0.6, 1.6, n), width)
    stiffness = np.diag(random.uniform(0.2, 1.5, size))
    for k in range(size - width):
        stiffness[np.ix_([k, k + width], [k, k + width])] += (
            random.uniform(0.3, 1.5) * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    mixed = random.normal(size=(size, size)) * random.choice([0.0, 0.03, 0.1])
    stiffness += mixed @ mixed.T if random.random() < 0.5 else 0.5 * (mixed + mixed.T)
    low = np.linalg.eigvalsh(stiffness)[0]
    stiffness += max(0.0, 0.1 - low) * np.eye(size)
    damping = random.uniform(0.002, 0.02) * stiffness
    if random.random() < 0.4:
        damping[0, 0] += random.uniform(0.0, 0.05)
    # Rigid pairs leave a mass free, of which there is a mode.
    pairs = int(random.integers(1, max(2, min(n, 4))))
    places = random.permutation(n)[:pairs]
    sides = [(int(place), int(place) - 1 if place > 0 and random.random() < 0.25 else None)
             for place in places]
    static = random.normal(size=size) * 0.1
    if normal:
        static[planes::width] -= random.uniform(0.3, 1.2, n)
    stiff = random.uniform(0.5, 4.0, (pairs, 2))
    return {"law": law, "planes": planes, "normal": normal, "width": width, "sides": sides,
            "mass": np.diag(mass), "stiffness": stiffness, "damping": damping, "static": static,
            "mu": random.uniform(0.2, 0.8, pairs), "load": random.uniform(0.2, 1.0, pairs),
            "gap": -random.uniform(0.0, 0.4, pairs) * normal,
            "kt": stiff[:, 0], "kn": stiff[:, 1], "beyond": float(random.uniform(1.2, 8.0)),
            "choice": float(random.random()), "harmonics": int(random.choice([1, 3, 5]))}


def pair_rows(case):
    """Rows of relative displacements (pair, component; dof), tangential ones first."""
    width, size = case["width"], len(case["mass"])
    rows = np.zeros((len(case["sides"]), width, size))
    for k, (one, other) in enumerate(case["sides"]):
        for c in range(width):
            rows[k, c, one * width + c] = 1.0
            if other is not None:
                rows[k, c, other * width + c] = -1.0
    return rows


def stuck_modes(case, rows):
    """Shapes of unit modal mass, with their dynamic stiffness: [(U, Z)]."""
    mass, damping, planes = case["mass"], case["damping"], case["planes"]
    stiffness = case["stiffness"].copy()
    if case["law"] == "penalty":
        for k, row in enumerate(rows):
            for c, one in enumerate(row):
                stiffness += case["kt" if c < planes else "kn"][k] * np.outer(one, one)
        basis = np.eye(len(mass))
    else:
        basis = scipy.linalg.null_space(rows.reshape(-1, len(mass)))
    if not basis.shape[1]:
        return []
    k, m, c = (basis.T @ a @ basis for a in (stiffness, mass, damping))
    squares, shapes = scipy.linalg.eigh(k, m)
    found = []
    for j, square in enumerate(squares):
        omega, shape = np.sqrt(square), shapes[:, j].astype(complex)
        for _ in range(60):
            values, vectors = scipy.linalg.eig(k + 1j * omega * c, m)
            near = np.argmax(np.abs(shape.conj() @ m @ vectors)
                             / np.sqrt(np.einsum("ij,ij->j", vectors.conj(), m @ vectors).real))
            shape, theta = vectors[:, near], values[near]
            omega = np.sqrt(theta.real)
        motion = basis @ shape
        motion /= np.sqrt((motion.conj() @ mass @ motion).real)
        found.append((motion, case["stiffness"] - theta * mass + 1j * omega * damping))
    return found


def forces(case, rows, motion, dynamic):
    """Forces of all pairs: at rest, by the position of each tangential row, by the amplitude."""
    planes, law = case["planes"], case["law"]
    n_rows, size = rows.shape[0] * rows.shape[1], len(case["mass"])
    flat = rows.reshape(n_rows, size)
    tangential = np.tile(np.arange(rows.shape[1]) < planes, len(rows))
    compliance = np.zeros(n_rows)
    if law == "penalty":
        compliance = 1.0 / np.concatenate([[case["kt"][k]] * planes + [case["kn"][k]]
                                           * case["normal"] for k in range(len(rows))])
    whole = np.block([[case["stiffness"], flat.T], [flat, -np.diag(compliance)]])
    place = np.zeros((n_rows, 1 + tangential.sum()))
    place[~tangential, 0] = -case["gap"] if case["normal"] else 0.0
    place[tangential, 1:] = np.eye(tangential.sum())
    given = np.zeros((size, place.shape[1]))
    given[:, 0] = case["static"]
    rest = np.linalg.solve(whole, np.vstack([given, place]))[size:]
    vibrating = -np.linalg.lstsq(flat.T.astype(complex), dynamic @ motion, rcond=None)[0]
    return rest[:, 0], rest[:, 1:], vibrating


def bound(case, rows, motion, dynamic):
    """The largest amplitude at which the stuck motion is possible; None: no pair bears at rest."""
    first, moved, vibrating = forces(case, rows, motion, dynamic)
    planes, width = case["planes"], case["width"]
    cycle = (vibrating[:, None] * np.exp(1j * INSTANTS)).real
    # Rows of a x <= b, x the positions and the amplitude.
    left, right = [], []

    def cut(k, instants, direction):
        """n . T <= mu N of a pair at instants, n along a direction; none: 0 <= N."""
        share = np.zeros((len(instants), width))
        if direction is not None:
            share[:, :planes] = direction
        mu = case["mu"][k] if direction is not None else 1.0
        if case["normal"]:
            share[:, planes] = mu
        span = slice(k * width, (k + 1) * width)
        left.append(np.column_stack([share @ moved[span],
                                     np.einsum("ic,ci->i", share, cycle[span][:, instants])]))
        right.append((0.0 if case["normal"] else mu * case["load"][k]) - share @ first[span])

    some = np.arange(0, len(INSTANTS), 60 if planes == 2 else 1)
    angles = 2 * np.pi * np.arange(8) / 8
    for k in range(len(rows)):
        around = ([[1.0], [-1.0]] if planes == 1 else
                  np.column_stack([np.cos(angles), np.sin(angles)]))
        for direction in around:
            cut(k, some, direction)
        if case["normal"]:
            cut(k, np.arange(len(INSTANTS))[::4], None)
    n = moved.shape[1] + 1
    for _ in range(60):
        a, b = np.vstack(left), np.concatenate(right)
        found = linprog([0.0] * (n - 1) + [-1.0], a, b, bounds=[(None, None)] * (n - 1)
                        + [(0.0, 1e3)], method="highs")
        if found.status != 0:
            return None
        x = found.x
        if planes == 1 or not add_cuts(case, cut, first + moved @ x[:-1], x[-1] * cycle):
            break
    rest = linprog([0.0] * n, a, b, bounds=[(None, None)] * (n - 1) + [(0.0, 1e-6)],
                   method="highs")
    return float(x[-1]) if rest.status == 0 else None


def add_cuts(case, cut, still, cycle):
    """Planes where circles of friction are left; whether there were any."""
    planes, width = case["planes"], case["width"]
    any_left = False
    for k in range(len(case["sides"])):
        force = still[k * width:(k + 1) * width, None] + cycle[k * width:(k + 1) * width]
        size = np.hypot(*force[:planes])
        limit = case["mu"][k] * (-force[planes] if case["normal"] else case["load"][k])
        over = size - limit - 1e-7 * size.max()
        worst = np.argsort(over)[-40:]
        worst = worst[over[worst] > 0.0]
        if len(worst):
            any_left = True
            cut(k, worst, (force[:planes, worst] / size[worst]).T)
    return any_left


def stuck_from_assembly(case, first, moved, cycle, states):
    """Whether a motion sticks with its pairs where they were assembled (0), or pushed along or
    against their direction as far as their limit asks for (1, -1)."""
    width, size = case["width"], np.abs(first).max()
    place = np.zeros(len(states))

    def left():
        """What is left of the limits in both directions (pair, 2, instant), and normal forces."""
        force = (first + moved @ place)[:, None] + cycle
        tangential, normal = force[::width], np.tile(case["load"][:, None], cycle.shape[1])
        if case["normal"]:
            normal = -force[1::width]
        limit = case["mu"][:, None] * normal
        return np.stack([limit - tangential, limit + tangential], axis=1), normal

    for _ in range(50):
        margin, _ = left()
        rest, slope = place.copy(), np.eye(len(states))
        for k, state in enumerate(states):
            if state:
                side = margin[k, 0 if state > 0 else 1]
                rest[k] = side.min()
                slope[k] = -state * moved[k * width]
                if case["normal"]:
                    slope[k] -= case["mu"][k] * moved[k * width + 1]
        change = np.linalg.solve(slope, rest)
        place = place - change
        if np.abs(change).max() <= 1e-12 * (1.0 + np.abs(place).max()):
            break
    else:
        return False
    margin, normal = left()
    return bool(margin.min() >= -1e-9 * size and normal.min() >= -1e-9 * size
                and np.all(np.asarray(states) * place >= 0.0))


def onset_from_assembly(case, rows, motion, dynamic, limit):
    """The amplitude from which on nothing sticks that the assembly leads to (one direction)."""
    first, moved, vibrating = forces(case, rows, motion, dynamic)
    cycle = (vibrating[:, None] * np.exp(1j * INSTANTS)).real

    def sticks(amplitude):
        return any(stuck_from_assembly(case, first, moved, amplitude * cycle, states)
                   for states in itertools.product((0, 1, -1), repeat=len(rows)))

    low, high = 0.0, limit * (1.0 + 1e-6)
    if sticks(limit * (1.0 - 1e-6)):
        return limit
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sticks(middle) else (low, middle)
    return low


def text(case, number, start, end, word, n_points):
    def listed(values):
        return ", ".join(repr(float(x)) for x in np.ravel(values))

    width, planes, normal = case["width"], case["planes"], case["normal"]

    def side(mass):
        dofs = [0, 0, 0]
        if mass is not None:
            dofs[:planes] = [mass * width + c + 1 for c in range(planes)]
            dofs[2] = (mass + 1) * width if normal else 0
        return ", ".join(map(str, dofs))

    size = len(case["mass"])
    sides = case["sides"]
    lines = [f"mu = {listed(case['mu'])}"]
    lines.append(f"gap = {listed(case['gap'])}" if normal else
                 f"normal_load = {listed(case['load'])}")
    if case["law"] == "penalty":
        lines.append(f"tangential_stiffness = {listed(case['kt'])}")
        lines += [f"normal_stiffness = {listed(case['kn'])}"] if normal else []
    sampled = "n_time = 512 sampling = 'uniform'" if case["law"] != "rigid" else ""
    return f"""&case analysis = 'mode' threads = 1 /
&model n_dof = {size}
   mass = {listed(case["mass"])}
   stiffness = {listed(case["stiffness"])}
   damping = {listed(case["damping"])} /
&contact n_pairs = {len(sides)} law = '{case["law"]}'
   side_1 = {", ".join(side(one) for one, _ in sides)}
   side_2 = {", ".join(side(other) for _, other in sides)}
   {chr(10).join(lines)} /
&load static = {listed(case["static"])} cosine = {listed(np.zeros(size))} /
&harmonics n_harmonics = {case["harmonics"]} {sampled} /
&mode number = {number} start = {start!r} end = {end!r} control = 'modal'
   n_points = {n_points} continuation = '{word}' /
&output observe = {", ".join(str(k + 1) for k in range(size))} /
"""


def run(program, folder, words):
    """Onset, how it is known; amplitudes, work and largest open share of rows; None where a run is
    refused."""
    (folder / "case.nml").write_text(words)
    target = folder / "case.h5"
    target.unlink(missing_ok=True)
    done = subprocess.run([program, "-q", "-o", target, "case.nml"], cwd=folder, check=False,
                          capture_output=True, text=True, timeout=600)
    if done.returncode not in (0, 4) or not target.exists():
        return None
    with h5py.File(target) as file:
        if "mode" not in file:
            return None
        good = file["converged"][()].astype(bool)
        about = file["mode"].attrs
        return (float(about["onset_amplitude"]), about.get("onset_known_by", ""),
                file["mode/modal_amplitude"][()][good],
                file["contact/dissipation"][()].sum(axis=1)[good],
                file["contact/fraction"][()][good][:, :, 2].max(axis=1))


def sticks_between(program, folder, case, number, low, high, scale):
    """Whether a row between two amplitudes sticks; None where there is none."""
    middle = float(np.sqrt(low * high))
    found = run(program, folder, text(case, number, middle, high, "natural", 2))
    if found is None or not len(found[2]) or abs(found[2][0] / middle - 1.0) > 1e-9:
        return None
    # A row that parts does not dissipate.
    return bool(found[3][0] < 1e-8 * scale * middle and not found[4][0])


def trial(seed, program, folder):
    case = drawn(seed)
    rows = pair_rows(case)
    counts = {"kind": case["law"] + (", two directions" if case["planes"] == 2 else "")}
    modes = stuck_modes(case, rows)
    if not modes:
        return counts
    number = int(case["choice"] * len(modes)) + 1
    motion, dynamic = modes[number - 1]
    limit = bound(case, rows, motion, dynamic)
    if limit is None or not 1e-4 < limit < 100.0:
        return counts
    exact = case["planes"] == 1
    expected = onset_from_assembly(case, rows, motion, dynamic, limit) if exact else limit
    scale = np.abs(forces(case, rows, motion, dynamic)[0]).max()
    notes, onsets = [], []
    for word, n_points in STEPS:
        found = run(program, folder, text(case, number, limit / 300.0, case["beyond"] * limit,
                                          word, n_points))
        counts["runs"] = counts.get("runs", 0) + 1
        if found is None:
            counts["refused"] = counts.get("refused", 0) + 1
            continue
        onset = found[0]
        if np.isnan(onset):
            counts["ended"] = counts.get("ended", 0) + 1
            continue
        onsets.append(onset)
        counts["stuck"] = counts.get("stuck", 0) + (found[1] == "stuck")
        counts["below"] = counts.get("below", 0) + (onset < (1.0 - CLOSE) * limit)
        if abs(onset / expected - 1.0) <= CLOSE:
            continue
        if not exact and 0.0 < onset < limit and sticks_between(
                program, folder, case, number, onset, limit, scale) is False:
            continue
        counts["wrong"] = counts.get("wrong", 0) + 1
        notes.append(f"{word} {n_points}: {onset:.6g} for {expected:.6g} (bound {limit:.6g})")
    if onsets and max(onsets) > (1.0 + CLOSE) * min(onsets):
        counts["differ"] = 1
    return {**counts, "notes": notes}
