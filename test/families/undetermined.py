"""Modes without damping that a harmonic meets exactly, as linear springs and stuck pairs hold them,
against rational arithmetic."""
import subprocess
from fractions import Fraction

import h5py
import numpy as np

TITLE = "Undetermined modes"
TEXT = """
Chains of two to five masses of which the stiffness is partly in the matrix and partly in springs of
power 1 and in pairs that stick under a high normal load (`penalty`, `dlft`, `dlft_velocity`,
`rigid`), beside a part of one mass that is loaded and rubs or not. All numbers are sums of few
powers of two, so that a mode of the chain stands on a harmonic exactly: chosen integer squares of
frequencies and an integer shape. The chain has no damping, or 1e-15 or 1e-12 of the stiffness, or
1e-3; a load that is orthogonal to the mode, one that drives it, or none.

The judge forms Z of each harmonic in rational numbers with springs and stuck pairs in it, and finds
its rank: without a full one the motion is undetermined, which has to be said where the load is in
its range, and to fail where it is not. *Missed*: neither. *False*: said of what is regular by 1e-9
of its size. *Moves*: an undetermined motion that is not zero.
"""
COUNT = 60
SMALL = tuple(range(17))
COLUMNS = {"idle": "undetermined", "driven": "driven", "regular": "regular", "near": "within 1e-9",
           "missed": "missed", "passed": "driven, taken for a solution", "false": "false",
           "moves": "moves", "failed": "regular, not converged"}
ZERO = ("missed", "passed", "false", "moves")

LAWS = ("none", "penalty", "dlft", "dlft_velocity", "rigid")
#: Parts of the frequency or of the damping within which nothing is asked.
NEAR = 1e-9


def drawn(seed):
    """A structure whose second part, held by springs and pairs too, may meet a harmonic."""
    random = np.random.default_rng(seed)
    law, n = LAWS[seed % 5], int(random.integers(1, 5))
    harmonic = int(random.choice([1, 1, 1, 2, 3]))
    theta = Fraction(harmonic**2)
    mass = [Fraction(int(random.choice([1, 2, 4])), 2) for _ in range(n)]
    # K = L + D with L a chain and an integer shape v: (K - theta M) v = 0 makes D.
    chain = [Fraction(int(random.integers(1, 9)), 4) for _ in range(n - 1)]
    k = [[Fraction(0)] * n for _ in range(n)]
    for j, spring in enumerate(chain):
        for a, b, sign in ((j, j, 1), (j + 1, j + 1, 1), (j, j + 1, -1), (j + 1, j, -1)):
            k[a][b] += sign * spring
    shape = [Fraction(int(random.choice([1, 1, 2]))) for _ in range(n)]
    ground = []
    for a in range(n):
        ground.append(theta * mass[a] - sum(k[a][b] * shape[b] for b in range(n)) / shape[a])
    pair = None
    if law != "none":
        place = int(random.integers(0, n))
        pair = (place, Fraction(int(random.integers(1, 5)), 2))
        if law != "penalty":
            # One more mass that the pair holds, joined to the chain by a spring to the ground then.
            join = Fraction(int(random.integers(1, 5)), 2)
            ground[place] -= join
            pair = (place, join)
    detuned = random.random() < 0.2
    if detuned:
        ground[0] += Fraction(1, int(random.choice([4, 64])))
    return {"law": law, "harmonic": harmonic, "mass": mass, "chain": k, "ground": ground,
            "pair": pair, "shape": shape, "detuned": detuned,
            "springs": [bool(random.random() < 0.5) for _ in range(n)],
            "damping": float(random.choice([0.0, 0.0, 1e-15, 1e-12, 1e-3])),
            "load": str(random.choice(["none", "none", "orthogonal", "driving"])),
            "rubs": bool(random.random() < 0.4), "size": float(random.choice([1.0, 1e-3]))}


def assembled(case):
    """The matrix and springs of the namelist, and K with all of it (rational); loads."""
    n = len(case["mass"])
    held = case["pair"] is not None and case["law"] != "penalty"
    size = 1 + n + held
    mass = [Fraction(1), *case["mass"], *([Fraction(1)] if held else [])]
    given = [[Fraction(0)] * size for _ in range(size)]
    given[0][0] = Fraction(5, 2)
    for a in range(n):
        for b in range(n):
            given[1 + a][1 + b] += case["chain"][a][b]
    springs = []
    whole = [row[:] for row in given]
    for a in range(n):
        whole[1 + a][1 + a] += case["ground"][a]
    if case["pair"] is not None:
        place, value = case["pair"]
        if held:
            for target in (given, whole):
                target[1 + place][1 + place] += value
                target[size - 1][size - 1] += value
                target[1 + place][size - 1] -= value
                target[size - 1][1 + place] -= value
    for a in range(n):
        # What the pair holds at a dof of the chain is not in the matrix.
        rest = case["ground"][a]
        if case["pair"] is not None and not held and case["pair"][0] == a:
            rest -= case["pair"][1]
        if case["springs"][a] and rest > 0:
            springs.append((2 + a, rest))
        else:
            given[1 + a][1 + a] += rest
    load = [Fraction(0)] * size
    load[0] = Fraction(1, 2)
    if case["load"] == "driving":
        load[1] = Fraction(1, 8)
    elif case["load"] == "orthogonal" and n > 1:
        load[1], load[2] = case["shape"][1], -case["shape"][0]
    return mass, given, whole, springs, load, held


def rank_and_range(matrix, load):
    """Whether a rational matrix has full rank, and whether a load is in its range."""
    rows = [[*row, value] for row, value in zip(matrix, load)]
    n, r = len(load), 0
    for c in range(n):
        pivot = next((i for i in range(r, n) if rows[i][c]), None)
        if pivot is None:
            continue
        rows[r], rows[pivot] = rows[pivot], rows[r]
        for i in range(n):
            if i != r and rows[i][c]:
                factor = rows[i][c] / rows[r][c]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[r])]
        r += 1
    return r == n, not any(row[-1] for row in rows[r:])


def text(case, parts):
    mass, given, _, springs, load, held = parts
    size = len(mass)

    def listed(values):
        return ", ".join(repr(float(x)) for x in values)

    damping = np.zeros((size, size))
    damping[0, 0] = 0.05
    for k in range(1, size):
        damping[k, k] = case["damping"]
    sides, loads, stiff = [], [], []
    if case["rubs"] or case["pair"] is not None:
        # A pair on the loaded part: it rubs, or sticks.
        sides, loads, stiff = ["1, 0, 0"], [0.1 if case["rubs"] else 1e3], [2.0]
    if case["pair"] is not None:
        sides.append(f"{size if held else case['pair'][0] + 2}, 0, 0")
        loads.append(1e6)
        stiff.append(float(case["pair"][1]))
    law = case["law"] if case["law"] != "none" else "penalty"
    contact = "" if not sides else f"""&contact n_pairs = {len(sides)} law = '{law}'
   side_1 = {", ".join(sides)} mu = {listed([1.0] * len(sides))} normal_load = {listed(loads)}
   {f"tangential_stiffness = {listed(stiff)}" if law == "penalty" else ""} /
"""
    spring = "" if not springs else f"""&spring n_springs = {len(springs)}
   side_1 = {", ".join(str(dof) for dof, _ in springs)}
   coefficient = {listed(value for _, value in springs)}
   power = {", ".join("1" for _ in springs)} /
"""
    return f"""&case analysis = 'point' threads = 1 /
&model n_dof = {size}
   mass = {listed(np.diag([float(m) for m in mass]).ravel())}
   stiffness = {listed(x for row in given for x in row)}
   damping = {listed(damping.ravel())} /
{contact}{spring}&load cosine = {listed(load)} /
&harmonics n_harmonics = 3 parity = 'all' /
&sweep start = 1.0 /
&output observe = {", ".join(str(k + 1) for k in range(size))} /
"""


def verdict(case, parts):
    """What the second part is: idle, driven, regular, or near to a mode."""
    mass, _, whole, _, load, held = parts
    last = len(mass) - held
    worst = "regular"
    for n in range(1, 4):
        matrix = [[whole[a][b] - (a == b) * n**2 * mass[a] for b in range(1, last)]
                  for a in range(1, last)]
        full, inside = rank_and_range(matrix, load[1:last] if n == 1 else [0] * (last - 1))
        if full:
            continue
        if case["damping"] > NEAR:
            continue
        if case["damping"] > 1e-13:
            worst = "near" if worst == "regular" else worst
        elif not inside:
            return "driven"
        else:
            worst = "idle"
    return worst


def trial(seed, program, folder):
    case = drawn(seed)
    parts = assembled(case)
    counts = {"kind": case["law"]}
    (folder / "case.nml").write_text(text(case, parts))
    target = folder / "case.h5"
    target.unlink(missing_ok=True)
    done = subprocess.run([program, "-q", "-o", target, "case.nml"], cwd=folder, check=False,
                          capture_output=True, text=True, timeout=300)
    if done.returncode not in (0, 4):
        return {**counts, "notes": [(done.stdout + done.stderr)[:200]]}
    with h5py.File(target) as file:
        converged = bool(file["converged"][0])
        names = [x.decode() for x in file["remarks/name"][()]] if "remarks" in file else []
        motion = file["coefficients"][0]
    word, said = verdict(case, parts), "undetermined mode" in names
    counts[word] = 1
    if word == "idle":
        counts["missed"] = int(not said)
        counts["moves"] = int(converged and moved(case, parts, motion))
    elif word == "driven":
        counts["passed"] = int(converged)
    elif word == "regular":
        counts["false"] = int(said)
        counts["failed"] = int(not converged)
    return counts


def moved(case, parts, motion):
    """Whether an undetermined motion has a part in the shape of the mode."""
    mass = np.array([float(m) for m in parts[0]])[1:1 + len(case["mass"])]
    shape = np.array([float(x) for x in case["shape"]])
    row = motion[2 * case["harmonic"] - 1:2 * case["harmonic"] + 1, 1:1 + len(shape)]
    part = np.abs(row @ (mass * shape)).max() / np.sqrt(shape @ (mass * shape))
    return bool(case["load"] == "none" and part > 1e-7)
