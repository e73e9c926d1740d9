"""Modes without damping that a harmonic meets, as linear springs and stuck pairs hold them, against
rational arithmetic."""
import subprocess
from fractions import Fraction

import h5py
import numpy as np

TITLE = "Undetermined modes"
TEXT = """
A loaded part of one or two masses, which rubs, sticks or has no pair, and a second part with a mode
on the first, second or third harmonic: a chain of one to four masses with an integer shape, or two
to four equal masses on the hub, which move against each other. Stiffness is partly in the matrix,
partly in springs of power 1, partly in pairs that stick (`penalty`, `dlft`, `dlft_velocity`,
`rigid`). All numbers are sums of few powers of two in units between 2^-20 and 2^30, so that the
mode is met to the last bit; then the frequency is left there or moved by 1e-12, 1e-9 or 1e-6, the
second part is damped by nothing, 1e-15, 1e-12 or 1e-3 of its stiffness, joined to the first by a
spring of 1e-12 to 1 or by none, and loaded by nothing, by a load that the mode does no work with,
or by one that drives it.

The judge solves each harmonic in rational numbers from the numbers of the namelist. *Undetermined*
is a matrix without full rank that has the load in its range, *driven* one that has not. Of all
others the judge has the exact inverse, and with it the change of the entries, in parts of epsilon,
that would make the matrix singular: *near* are those below 1e4. False is a remark beside a matrix
that is not near. Missed is an undetermined motion without a remark. Wrong without a word is a
motion that is off by 3 % of the largest displacement (undetermined ones with their mode at rest),
or by more than the condition of the matrix explains.

Not judged are motions above 30 with pairs, which slip there, and those of a part that rubs and is
joined to the second one; of a regular motion the solver's tolerance may leave 3e-4. A mode that
nothing couples counts as met within 1e-12 of its frequency or damping, 4500 epsilon: such a case
(one of these, at 2250 epsilon) is among the near ones.
"""
COUNT = 600
SMALL = tuple(range(40))
COLUMNS = {"idle": "undetermined", "driven": "driven", "near": "near", "regular": "regular",
           "false": "false remarks", "missed": "missed without a word",
           "wrong": "wrong without a word", "moves": "undetermined, not at rest",
           "passed": "driven, taken for a solution", "failed": "regular, not converged",
           "ended": "undetermined, not converged"}
ZERO = ("false", "missed", "wrong", "moves", "passed")

LAWS = ("none", "penalty", "dlft", "dlft_velocity", "rigid")
EPSILON = 2.0**-52
#: Changes of the entries, in parts of epsilon, above which a matrix is regular whatever is asked:
#: what nothing couples to counts as met within 1e-12, 4500 of them.
NEAR = 1e4
#: What the tolerance of the solver may make of a regular motion.
TOLERANCE = 3e-4
#: Displacements up to which pairs bear what sticking takes.
STUCK = 30.0
OFF = 0.03


class Case:
    """Masses, entries of the stiffness, springs and pairs to the ground, dampers, load."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.law, self.size = LAWS[seed % 5], Fraction(2)**int(random.choice([0, 0, -20, 30]))
        self.mass, self.entries, self.springs, self.pairs = [], {}, [], []
        self.damping, self.load, self.second = [], [], []
        self.harmonic = int(random.choice([1, 1, 1, 2, 3]))
        self.kind = str(random.choice(["chain", "chain", "equals"]))
        self.first(random)
        (self.chain if self.kind == "chain" else self.equals)(random)
        self.weak = float(random.choice([0, 0, 0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-6, 1e-3, 1]))
        if self.weak and self.kind == "chain":
            self.spring(0, int(random.choice(self.second)), Fraction(self.weak), True)
        elif self.weak:
            self.spring(self.second[0], self.second[1], Fraction(self.weak), True)
        off = float(random.choice([0, 0, 0, 1e-12, -1e-9, 1e-6]))
        self.omega = 1.0 + off
        damper = float(random.choice([0, 0, 0, 1e-15, 1e-12, 1e-3]))
        for dof in self.second:
            self.damping[dof] = damper
        self.drive(random)

    def add(self, mass):
        self.mass.append(Fraction(mass))
        self.damping.append(0.0)
        self.load.append(Fraction(0))
        return len(self.mass) - 1

    def spring(self, a, b, value, apart):
        """In the matrix or as an element (b None: to the ground)."""
        if apart:
            self.springs.append((a, b, value))
            return
        for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
            if i is not None and j is not None:
                self.entries[i, j] = self.entries.get((i, j), Fraction(0)) + sign * value

    def first(self, random):
        self.add(1)
        self.spring(0, None, Fraction(int(random.integers(5, 12)), 4), False)
        self.damping[0] = float(random.choice([0.05, 0.05, 0.0]))
        if random.random() < 0.4:
            dof = self.add(Fraction(int(random.integers(1, 4)), 2))
            self.spring(0, dof, Fraction(int(random.integers(1, 9)), 4), random.random() < 0.3)
            self.damping[dof] = self.damping[0]
        self.load[0] = Fraction(1, 2)
        self.rubs = self.law != "none" and random.random() < 0.5
        if self.law != "none":
            # (dof, stiffness, normal load)
            self.pairs.append((0, Fraction(2), 0.1 if self.rubs else 1e3))

    def chain(self, random):
        n, theta = int(random.integers(1, 5)), Fraction(self.harmonic**2)
        shape = [Fraction(int(random.choice([1, 1, 2]))) for _ in range(n)]
        dofs = [self.add(Fraction(int(random.choice([1, 2, 4])), 2)) for _ in range(n)]
        rest = [theta * self.mass[dof] for dof in dofs]
        for a in range(n - 1):
            value = Fraction(int(random.integers(1, 9)), 4)
            self.spring(dofs[a], dofs[a + 1], value, random.random() < 0.3)
            rest[a] -= value * (1 - shape[a + 1] / shape[a])
            rest[a + 1] -= value * (1 - shape[a] / shape[a + 1])
        self.second, self.shape = dofs, shape
        if self.law != "none" and random.random() < 0.8:
            place, value = int(random.integers(0, n)), Fraction(int(random.integers(1, 5)), 2)
            rest[place] -= value
            if self.law == "penalty":
                self.pairs.append((dofs[place], value, 1e6))
            else:
                # A mass that the pair holds.
                held = self.add(1)
                self.spring(dofs[place], held, value, random.random() < 0.3)
                self.pairs.append((held, value, 1e6))
        for dof, value in zip(dofs, rest):
            self.spring(dof, None, value, bool(random.random() < 0.5))

    def equals(self, random):
        n, theta = int(random.integers(2, 5)), Fraction(self.harmonic**2)
        mass = Fraction(int(random.choice([1, 2, 3])), 2)
        self.second = [self.add(mass) for _ in range(n)]
        part = Fraction(int(random.choice([1, 2, 4])), 4)
        to_ground = self.law == "penalty" and random.random() < 0.7
        for dof in self.second:
            apart = bool(random.random() < 0.5)
            self.spring(0, dof, part * theta * mass, apart)
            value = (1 - part) * theta * mass
            if to_ground and value:
                self.pairs.append((dof, value, 1e6))
            elif value:
                self.spring(dof, None, value, bool(random.random() < 0.5))
        self.shape = None

    def drive(self, random):
        kind = str(random.choice(["none", "none", "orthogonal", "driving"]))
        one, two = self.second[0], self.second[-1]
        if kind == "driving":
            self.load[one] += Fraction(1, 8)
        elif kind == "orthogonal" and self.kind == "equals":
            for dof in self.second:
                self.load[dof] += Fraction(1, 4)
        elif kind == "orthogonal" and one != two:
            self.load[one], self.load[two] = self.shape[-1], -self.shape[0]

    # What the namelist holds, as floating-point numbers.

    def stiffness(self):
        n = len(self.mass)
        return [[float(self.entries.get((i, j), Fraction(0)) * self.size) for j in range(n)]
                for i in range(n)]

    def masses(self):
        return [float(m * self.size) for m in self.mass]

    def elements(self):
        """(dof, dof or None, coefficient)"""
        return [(a, b, float(value * self.size)) for a, b, value in self.springs]

    def dampers(self):
        return [c * float(self.size) for c in self.damping]

    def loads(self):
        return [float(f * self.size) for f in self.load]

    def text(self):
        n = len(self.mass)

        def listed(values):
            return ", ".join(repr(float(x)) for x in values)

        text = f"""&case analysis = 'point' threads = 1 /
&model n_dof = {n}
   mass = {listed(np.diag(self.masses()).ravel())}
   stiffness = {listed(x for row in self.stiffness() for x in row)}
   damping = {listed(np.diag(self.dampers()).ravel())} /
&load cosine = {listed(self.loads())} /
&harmonics n_harmonics = 3 parity = 'all' /
&sweep start = {self.omega!r} /
&output observe = {", ".join(str(k + 1) for k in range(n))} /
"""
        if self.pairs:
            stiff = listed(float(k * self.size) for _, k, _ in self.pairs)
            text += f"""&contact n_pairs = {len(self.pairs)} law = '{self.law}'
   side_1 = {", ".join(f"{dof + 1}, 0, 0" for dof, _, _ in self.pairs)}
   mu = {listed([1.0] * len(self.pairs))}
   normal_load = {listed(load * float(self.size) for _, _, load in self.pairs)}
   {f"tangential_stiffness = {stiff}" if self.law == "penalty" else ""} /
"""
        springs = self.elements()
        if springs:
            text += f"""&spring n_springs = {len(springs)}
   side_1 = {", ".join(str(a + 1) for a, _, _ in springs)}
   side_2 = {", ".join(str(0 if b is None else b + 1) for _, b, _ in springs)}
   coefficient = {listed(k for _, _, k in springs)}
   power = {", ".join("1" for _ in springs)} /
"""
        return text

    # The judge.

    def free(self):
        """Dofs that no rigid pair holds; a pair that rubs is a dashpot to motions of round-off."""
        held = set() if self.law in ("none", "penalty") else {
            dof for dof, _, load in self.pairs if load > 1.0}
        return [dof for dof in range(len(self.mass)) if dof not in held]

    def block(self, n):
        """Real and imaginary part of a harmonic in rational numbers, and the sizes of its sums."""
        size = len(self.mass)
        s = n * Fraction(self.omega)
        real = [[Fraction(x) for x in row] for row in self.stiffness()]
        terms = np.abs(np.array(self.stiffness()))
        imag = [[Fraction(0)] * size for _ in range(size)]
        for a, mass in enumerate(self.masses()):
            real[a][a] -= s**2 * Fraction(mass)
            imag[a][a] += s * Fraction(self.dampers()[a])
            terms[a, a] += float(s)**2 * mass + float(s) * self.dampers()[a]
        stuck = [(dof, None, float(k * self.size)) for dof, k, load in self.pairs
                 if self.law == "penalty" and load > 1.0]
        for a, b, value in self.elements() + stuck:
            for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                if i is not None and j is not None:
                    real[i][j] += sign * Fraction(value)
                    terms[i, j] += abs(value)
        for dof, k, load in self.pairs:
            if load <= 1.0:
                imag[dof][dof] += k * self.size
                terms[dof, dof] += float(k * self.size)
        free = self.free()
        return ([[real[i][j] for j in free] for i in free],
                [[imag[i][j] for j in free] for i in free], terms[np.ix_(free, free)])


def eliminated(matrix, right):
    """Reduced rows of [matrix, right], and the columns with pivots."""
    rows = [[*row, *more] for row, more in zip(matrix, right)]
    n, pivots = len(matrix), []
    for c in range(n):
        r = len(pivots)
        pivot = next((i for i in range(r, n) if rows[i][c]), None)
        if pivot is None:
            continue
        rows[r], rows[pivot] = rows[pivot], rows[r]
        rows[r] = [x / rows[r][c] for x in rows[r]]
        for i in range(n):
            if i != r and rows[i][c]:
                factor = rows[i][c]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[r])]
        pivots.append(c)
    return rows, pivots


def judged(case, n):
    """(verdict, changes that make it singular in parts of epsilon, motion) of a harmonic."""
    real, imag, terms = case.block(n)
    size = len(real)
    whole = [[*a, *(-x for x in b)] for a, b in zip(real, imag)] + [
        [*b, *a] for a, b in zip(real, imag)]
    load = [Fraction(case.loads()[dof]) if n == 1 else Fraction(0) for dof in case.free()]
    right = [[f, *(Fraction(int(i == j)) for j in range(size))]
             for i, f in enumerate([*load, *[Fraction(0)] * size])]
    rows, pivots = eliminated(whole, right)
    motion = np.zeros(2 * size)
    motion[pivots] = [float(rows[r][2 * size]) for r in range(len(pivots))]
    motion = motion[:size] + 1j * motion[size:]
    if len(pivots) < 2 * size:
        inside = not any(row[2 * size] for row in rows[len(pivots):])
        return ("idle" if inside else "driven"), 0.0, at_rest(case, whole, motion)
    # Entries of the inverse are rounded once; they are not of one size.
    parts = np.array([[float(x) for x in row[2 * size + 1:]] for row in rows])
    inverse = np.abs(parts[:size] + 1j * parts[size:])
    return "regular", 1.0 / (EPSILON * np.abs(np.linalg.eigvals(inverse @ terms)).max()), motion


def at_rest(case, whole, motion):
    """Without what it has of motions without forces, which it is orthogonal to with the mass."""
    size = len(motion)
    rows, pivots = eliminated(whole, [[] for _ in whole])
    null = []
    for c in range(2 * size):
        if c not in pivots:
            vector = np.zeros(2 * size)
            vector[c] = 1.0
            vector[pivots] = [-float(rows[r][c]) for r in range(len(pivots))]
            null.append(vector[:size] + 1j * vector[size:])
    root = np.sqrt(np.array(case.masses())[case.free()])
    basis = np.linalg.svd(np.array(null).T * root[:, None], full_matrices=False)
    basis = basis[0][:, basis[1] > 1e-10 * basis[1][0]]
    scaled = root * motion
    return (scaled - basis @ (basis.conj().T @ scaled)) / root


def trial(seed, program, folder):
    case = Case(seed)
    counts = {"kind": case.law}
    (folder / "case.nml").write_text(case.text())
    target = folder / "case.h5"
    target.unlink(missing_ok=True)
    done = subprocess.run([program, "-q", "-o", target, "case.nml"], cwd=folder, check=False,
                          capture_output=True, text=True, timeout=300)
    if done.returncode not in (0, 4):
        return {**counts, "failed": 1, "notes": [(done.stdout + done.stderr)[:200]]}
    with h5py.File(target) as file:
        converged = bool(file["converged"][0])
        names = [x.decode() for x in file["remarks/name"][()]] if "remarks" in file else []
        motion = file["coefficients"][0]
    said = "undetermined mode" in names
    verdicts = [judged(case, n) for n in (1, 2, 3)]
    words, least = [word for word, _, _ in verdicts], min(change for _, change, _ in verdicts)
    word = next((w for w in ("driven", "idle") if w in words),
                "near" if least < NEAR else "regular")
    counts[word] = 1
    error, allowed = distance(case, verdicts, motion)
    off = converged and error > max(OFF * (word != "regular"), allowed)
    # What a stuck pair bears has a limit: beyond, it slips, and the motion is finite.
    slips = bool(case.pairs) and np.abs(motion).max() > STUCK
    counts["passed"] = int(word == "driven" and converged and not slips)
    counts["missed"] = int(word == "idle" and converged and not said)
    counts["false"] = int(word == "regular" and said)
    counts["moves"] = int(word == "idle" and off)
    counts["wrong"] = int(word in ("near", "regular") and off and not said)
    counts["failed"] = int(word == "regular" and not converged)
    counts["ended"] = int(word == "idle" and not converged)
    if any(counts.get(key) for key in (*ZERO, "failed")):
        counts["notes"] = [f"{word} {least:.3g}, error {error:.2g} of {allowed:.2g}, "
                           f"joined by {case.weak:g}, {'said' if said else 'not said'}"]
    return counts


def distance(case, verdicts, motion):
    """The largest error in parts of the largest displacement, and what round-off explains."""
    free = case.free()
    # What rubs, and what is joined to it, is not the judge's.
    kept = range(len(free))
    if case.rubs:
        if case.weak or case.kind == "equals":
            return 0.0, 1.0
        kept = [k for k, dof in enumerate(free) if dof in case.second]
    largest = max(np.abs(exact[kept]).max() for _, _, exact in verdicts)
    if case.pairs and largest > STUCK:
        return 0.0, 1.0
    error, allowed = 0.0, TOLERANCE
    for n, (_, change, exact) in enumerate(verdicts, 1):
        found = motion[2 * n - 1, free] - 1j * motion[2 * n, free]
        error = max(error, np.abs(found - exact)[kept].max() / max(largest, 1e-9))
        if change:
            allowed = max(allowed, 30.0 / change)
    return float(error), float(allowed)
