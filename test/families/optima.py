"""Optima of one parameter, against separate runs on a fine grid of it."""
import subprocess

import h5py
import numpy as np

import fretwear as fw
from fretwear.errors import FretwearError

TITLE = "Optima"
TEXT = """
Chains of one to four masses with one or two pairs that rub (a linear spring with Coulomb's limit),
or that open and close (`gap`), under a force at one mass. The highest amplitude of a sweep is made
smallest over one parameter: the normal load, the tangential stiffness, the friction coefficient, or
the gap, between bounds a factor of 1000 apart, from a start that is drawn too, often where all
sticks.

The judge knows nothing of slopes. It runs `fw_run` at other values of the parameter, finds the peak
of each by three narrower sweeps and a parabola, and looks whether it is lower beside what is called
an optimum (0.4 % up and down, by more than a slope of 1e-3 would make it), whether it is lower
anywhere within a factor of 1.5 (17 values, by 1e-4), and on 13 values between the bounds. *Unsaid*
are those where no other optimum is said to be possible. Where a narrow sweep comes to another
response than the whole one, nothing is judged.
"""
COUNT = 200
SMALL = (1, 2, 3, 12)
COLUMNS = {"optimum": "called an optimum", "corner": "at a corner", "plateau": "on a plateau",
           "none": "none found", "unjudged": "not judged", "sloping": "lower beside it",
           "near": "lower within a factor of 1.5, unsaid", "near_said": "said",
           "far": "lower elsewhere, unsaid", "far_said": "said", "evaluations": "evaluations",
           "failed": "first run failed"}
ZERO = ("sloping", "near")

#: Of the parameter, beside an optimum; what counts as a slope; what counts as lower.
BESIDE, SLOPE, LOWER = 4e-3, 1e-3, 1e-4
#: Rows within this of the highest are sought about.
TIED = 0.04
#: A narrow sweep that is lower than the whole one by more has found another response.
SAME = 5e-3
KINDS = {"normal load": "normal_load", "stiffness": "tangential_stiffness", "friction": "mu",
         "gap": "gap"}


def drawn(seed):
    """Parts of a case, the kind of its parameter, its start."""
    random = np.random.default_rng(seed)
    kind = list(KINDS)[seed % 4]
    n = int(random.integers(1, 5))
    mass = np.diag(random.uniform(0.5, 2.0, n))
    springs = random.uniform(0.5, 2.0, n)
    stiffness = np.zeros((n, n))
    for k, spring in enumerate(springs):
        stiffness[k, k] += spring
        if k:
            stiffness[k - 1, k - 1] += spring
            stiffness[k, k - 1] -= spring
            stiffness[k - 1, k] -= spring
    pairs = 1 if kind == "gap" else min(n, int(random.integers(1, 3)))
    dofs = random.choice(n, pairs, replace=False) + 1
    side = [f"0, 0, {dof}" if kind == "gap" else f"{dof}, 0, 0" for dof in dofs]
    modes = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6))
    modes.sort()
    first, last = modes[0], modes[-1 if random.random() < 0.5 else 0]
    damping = float(np.exp(random.uniform(np.log(0.005), np.log(0.03))))
    values = {"mu": 0.5, "tangential_stiffness": float(random.uniform(0.3, 2.0)),
              "normal_load": float(np.exp(random.uniform(np.log(0.1), np.log(5.0))))}
    if kind == "gap":
        values = {"mu": 0.0, "tangential_stiffness": 1.0, "gap": 1.0,
                  "normal_stiffness": float(random.uniform(0.1, 0.6))}
        damping *= 3.0
    case = {"mass": mass, "stiffness": stiffness, "damping": damping, "side": side,
            "values": values, "observe": int(random.integers(1, n + 1)),
            "low": float(0.6 * first), "high": float(1.6 * last)}
    start = float(np.exp(random.uniform(np.log(0.05), np.log(10.0))))
    return kind, case, start


def text(case, low=None, high=None, n_points=141, **values):
    """The namelist, of a part of the sweep and with other values."""
    n = len(case["mass"])
    rows = ", ".join
    low, high = case["low"] if low is None else low, case["high"] if high is None else high
    pairs = "\n   ".join(f"{key} = {float(value)!r}" for key, value in
                         {**case["values"], **values}.items())
    return f"""&case analysis = 'frf' /
&model n_dof = {n}
   mass = {rows(repr(float(x)) for x in case["mass"].ravel())}
   stiffness = {rows(repr(float(x)) for x in case["stiffness"].ravel())}
   modal_damping = {case["damping"]!r} /
&contact n_pairs = {len(case["side"])} law = 'penalty'
   side_1 = {rows(case["side"])}
   {pairs} /
&load cosine = {rows(["1.0"] + ["0.0"] * (n - 1))} /
&harmonics n_harmonics = 5 /
&solver tolerance = 1e-10 /
&sweep start = {low!r} end = {high!r} n_points = {n_points} /
&output observe = {case["observe"]} /
"""


class Judge:
    """The highest amplitude of the sweep at values of the parameter, by runs of the program."""

    def __init__(self, case, key, program, folder):
        self.case, self.key, self.program, self.folder = case, key, program, folder
        self.runs = 0

    def sweep(self, value, low=None, high=None, n_points=141):
        """Frequencies and amplitudes; infinite where a row is missing, which proves nothing."""
        self.runs += 1
        path = self.folder / f"judge{self.runs}.nml"
        path.write_text(text(self.case, low, high, n_points, **{self.key: value}))
        target = path.with_suffix(".h5")
        subprocess.run([self.program, "-q", "-o", target, path.name], cwd=self.folder,
                       check=False, capture_output=True, timeout=600)
        with h5py.File(target, "r") as file:
            omega, amplitude = file["omega"][()], file["amplitude"][()][:, 0]
            good = file["converged"][()].astype(bool)
            peaks = [tuple(file[f"peak/{name}"][()]) if "peak" in file else ()
                     for name in ("omega", "amplitude")]
        for name in (path, target):
            name.unlink()
        return omega, np.where(good, amplitude, np.inf), list(zip(*peaks))

    def height(self, value):
        """The highest peak, by narrower sweeps about each row that may be it, and about peaks."""
        omega, amplitude, peaks = self.sweep(value)
        if not np.isfinite(amplitude).all():
            return np.inf
        inner = (amplitude[1:-1] >= amplitude[:-2]) & (amplitude[1:-1] >= amplitude[2:])
        tops = [(omega[k], amplitude[k]) for k in
                (0, *(np.flatnonzero(inner) + 1), len(omega) - 1)] + peaks
        highest, step = max(top for _, top in tops), omega[1] - omega[0]
        found = max(self.top(value, place, step) for place, top in tops
                    if top >= (1.0 - TIED) * highest)
        # Of several responses a narrow sweep may come to a lower one, which proves nothing.
        return found if found > (1.0 - SAME) * highest else np.inf

    def top(self, value, place, reach):
        for _ in range(3):
            low, high = max(place - reach, self.case["low"]), min(place + reach, self.case["high"])
            omega, amplitude, _ = self.sweep(value, float(low), float(high), 21)
            k = int(np.argmax(amplitude))
            place, reach = omega[k], omega[1] - omega[0]
        if not 0 < k < len(omega) - 1:
            return amplitude[k]
        a, b, c = amplitude[k - 1:k + 2]
        return b - 0.125 * (c - a)**2 / (a - 2.0 * b + c) if a + c < 2.0 * b else b

    def coarse(self, value):
        """Not above the peak by more than 1e-3."""
        _, amplitude, peaks = self.sweep(value)
        return max(float(amplitude.max()), *(top for _, top in peaks)) * (1.0 - 1e-3)


def is_lower(judge, value, height):
    """Whether the peak is lower by more than `LOWER`; coarse sweeps tell most of it."""
    return (judge.coarse(value) < height
            and judge.height(value) < (1.0 - LOWER) * height)


def bounds_of(case, key):
    return (0.02 * case["values"].get(key, 1.0), 20.0 * case["values"].get(key, 1.0))


def said_between(doubt, value):
    """Whether another optimum is said to be possible there."""
    ends = [words.split(" and ") for words in doubt.split("between ")[1:]]
    return any(float(low) * 0.999 <= value <= float(high.split(",")[0]) * 1.001
               for low, high in ends)


def trial(seed, program, folder):
    kind, case, start = drawn(seed)
    key = KINDS[kind]
    low, high = bounds_of(case, key)
    path = folder / "case.nml"
    path.write_text(text(case))
    counts = {"kind": kind}
    try:
        found = fw.optimise(path, minimise="max_amplitude", over=f"contact%{key}",
                            bounds=(low, high),
                            start=float(np.clip(start * case["values"][key], low, high)))
    except FretwearError as error:
        return {**counts, "failed": 1, "notes": [str(error)[:160]]}
    counts["evaluations"] = found.n_evaluations
    if not found.converged:
        return {**counts, "none": 1, "notes": [found.word]}
    counts.update(optimum=1, corner=int("corner" in found.word),
                  plateau=int("plateau" in found.word))
    judge, x = Judge(case, key, program, folder), float(found.values[0])
    height, doubt = judge.height(x), getattr(found, "doubt", "")
    notes = []
    if not np.isfinite(height):
        return {**counts, "unjudged": 1, "notes": [f"{x:.6g}: several responses"]}
    for beside in (x * (1.0 - BESIDE), x * (1.0 + BESIDE)):
        if low <= beside <= high and judge.height(beside) < (1.0 - SLOPE * BESIDE) * height:
            counts["sloping"] = 1
            notes.append(f"{found.word}: lower at {beside:.6g} than at {x:.6g}")
    grids = {"near": np.geomspace(max(low, x / 1.5), min(high, x * 1.5), 17),
             "far": np.geomspace(low, high, 13)}
    for where, grid in grids.items():
        lower = [value for value in grid if is_lower(judge, value, height)]
        said = [value for value in lower if said_between(doubt, value)]
        if lower and not counts.get("near") and not counts.get("near_said"):
            counts[where if len(said) < len(lower) else f"{where}_said"] = 1
            notes.append(f"{found.word} at {x:.6g}: lower at {lower[0]:.6g}; {doubt}")
    return {**counts, "notes": notes}
