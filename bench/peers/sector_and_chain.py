"""The same problems with another open program in the same run: pyHarm (`pyharm-os` on PyPI).

A Duffing oscillator, and a chain of masses with elastic friction to the ground on every mass. The
ratios of times per frequency count; both programs solve to the same tolerance, and their answers
are compared.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.common.layout import table
from bench.common.measure import Bench, Floats, Groups

__all__ = ["PeerCase", "measure_peers", "write_peers"]

#: Relative to the load, whose norm is its amplitude.
TOLERANCE = 1e-8
#: Chains as (masses, harmonics), and the ratios that are wanted; one mass is the oscillator.
CHAINS = ((8, 3), (8, 7), (8, 17), (48, 3), (48, 7), (48, 17))
TARGETS = {(1, 17): 50.0, (8, 3): 150.0, (48, 7): 250.0, (48, 17): 1000.0}
#: Both are within the tolerance times what a resonance magnifies, ten here; a margin of ten.
SAME = 1e-6
#: Seconds of a frequency that two other open programs were reported to take, not run here.
REPORTED = {(8, 3): 0.012, (48, 7): 0.3, (48, 17): 2.1}
#: Seconds that pyHarm is given for all frequencies of a case.
LIMIT = 300.0


@dataclass(frozen=True)
class PeerCase:
    """Times of a frequency [s], Newton steps, and the largest difference of coefficients over
    the largest coefficient. The times of the other program and its steps are NaN where it did
    not end within the limit; `reported` is the time of further programs, where there is one."""

    name: str
    n_harmonics: int
    n_time: int
    ours: float
    theirs: float
    our_steps: float
    their_steps: float
    difference: float
    target: float | None
    reported: float | None


def measure_peers(bench: Bench, interpreter: Path) -> list[PeerCase] | None:
    """Every case; None where the interpreter has no pyHarm."""
    probe = subprocess.run([interpreter, "-c", "import pyHarm"], capture_output=True, check=False,
                           cwd=bench.folder)
    if probe.returncode != 0:
        return None
    rows = [compare(bench, interpreter, "Duffing", duffing(n), TARGETS.get((1, n)))
            for n in (3, 7, 17)]
    for size in CHAINS[:1] if bench.quick else CHAINS:
        rows.append(compare(bench, interpreter, f"chain, N = {size[0]}", chain(*size),
                            TARGETS.get(size), REPORTED.get(size)))
    return rows


def chain(n: int, n_harmonics: int) -> dict:
    """Unit masses, fixed and free end, first natural frequency 1, C = 0.05 K."""
    k = 1.0 / (4.0 * np.sin(np.pi / (2.0 * (2 * n + 1)))**2)
    stiffness = k * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    stiffness[-1, -1] = k
    return {"kind": "friction", "mass": np.eye(n), "stiffness": stiffness,
            "damping": 0.05 * stiffness, "force": 0.3 * n, "contact": 0.3, "limit": 1.0,
            "n_harmonics": n_harmonics, "n_time": 256,
            "omega": np.linspace(1.2, 1.1, 3 if n > 8 else 11)}


def duffing(n_harmonics: int) -> dict:
    """Hardening oscillator up to its resonance."""
    return {"kind": "cubic", "mass": np.eye(1), "stiffness": np.eye(1),
            "damping": 0.1 * np.eye(1), "force": 0.2, "cubic": 1.0, "n_harmonics": n_harmonics,
            "n_time": 256, "omega": np.linspace(0.8, 1.1, 11)}


def compare(bench: Bench, interpreter: Path, name: str, case: dict,
            target: float | None = None, reported: float | None = None) -> PeerCase:
    """One case with both."""
    theirs = run_theirs(bench.folder, interpreter, case)
    seconds, run = bench.repeat(namelist(case), lambda run: float(run.seconds.mean()), most=5)
    if not run.converged.all():
        raise RuntimeError(f"{name}: not every frequency converged")
    their_seconds = their_steps = apart = math.nan
    if theirs is not None:
        their_seconds = float(np.mean([row["seconds"] for row in theirs]))
        their_steps = float(np.mean([row["iterations"] for row in theirs]))
        apart = difference(run.coefficients, np.array([row["coefficients"] for row in theirs]))
    return PeerCase(name, case["n_harmonics"], case["n_time"], seconds, their_seconds,
                    float(run.iterations.mean()), their_steps, apart, target, reported)


def difference(ours: Floats, theirs: Floats) -> float:
    """Largest difference over the largest value."""
    return float(np.abs(ours - theirs).max() / np.abs(ours).max())


def run_theirs(folder: Path, interpreter: Path, case: dict) -> list[dict] | None:
    """Coefficients, seconds and Newton steps of pyHarm; None where the limit ended it."""
    path = folder / "peer.json"
    plain = {key: value.tolist() if isinstance(value, np.ndarray) else value
             for key, value in case.items()}
    path.write_text(json.dumps(plain | {"tolerance": TOLERANCE * case["force"]}))
    single = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    try:
        done = subprocess.run([interpreter, Path(__file__).with_name("pyharm_chain.py"), path],
                              capture_output=True, text=True, check=False, cwd=folder,
                              env=os.environ | single, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return None
    if done.returncode != 0:
        raise RuntimeError(f"pyHarm ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout)


def namelist(case: dict) -> Groups:
    """The same case for fw_run; every coordinate is observed."""
    n = len(case["mass"])
    groups: Groups = {
        "case": {"analysis": "frf"},
        "model": {"n_dof": n} | {key: case[key].ravel().tolist()
                                 for key in ("mass", "stiffness", "damping")},
        "load": {"cosine": [0.0] * (n - 1) + [case["force"]]},
        "harmonics": {"n_harmonics": case["n_harmonics"], "n_time": case["n_time"],
                      "parity": "all"},
        "sweep": {"start": float(case["omega"][0]), "end": float(case["omega"][-1]),
                  "n_points": len(case["omega"])},
        "solver": {"tolerance": TOLERANCE}}
    if case["kind"] == "cubic":
        groups["spring"] = {"n_springs": 1, "side_1": 1, "coefficient": case["cubic"], "power": 3}
    else:
        groups["contact"] = {"n_pairs": n, "law": "penalty",
                             "side_1": [j for i in range(n) for j in (i + 1, 0, 0)],
                             "mu": [1.0] * n, "normal_load": [case["limit"]] * n,
                             "tangential_stiffness": [case["contact"]] * n}
    return groups


def write_peers(rows: list[PeerCase] | None) -> str:
    """The part of the document."""
    head = ["## Against another program", "",
            "[pyHarm](https://pypi.org/project/pyharm-os/) is an open program for harmonic balance "
            "in Python, whose kernels are compiled as they run."]
    if rows is None:
        return "\n".join([*head, "", "**Not measured**: the Python that was given has no pyHarm. "
                          "`pip install pyharm-os` into an environment of its own and run "
                          "`python -m bench.run peers --peer-python ITS/bin/python`."])
    return "\n".join([
        *head,
        f"Both solve every frequency to a residual of {TOLERANCE:g} of the load with exact "
        "derivatives, in one thread, in the same run, with `n_time = 256` and all harmonics; "
        "what is compiled is compiled before the clock starts. pyHarm starts from the last "
        "solution, Fretwear extrapolates those before. *Duffing*: m = k = 1, c = 0.1, cubic "
        "coefficient 1, force 0.2, 11 frequencies from 0.8 to 1.1. *Chain*: N unit masses between "
        "a fixed and a free end, coupled so that the first natural frequency is 1, C = 0.05 K; an "
        "elastic friction element of stiffness 0.3 and limit 1 from each mass to the ground, force "
        "0.3 times N on the last; 11 frequencies (3 for N = 48) from 1.2 to 1.1. The difference is "
        "the largest of all coefficients of all masses over the largest coefficient; up to "
        f"{SAME:g} the answers count as the same. pyHarm has {LIMIT:g} s for the frequencies of a "
        "case. *Others* are times that two further open programs were reported to take on a "
        "comparable machine; they were not run here.",
        "",
        *table(["case", "H", "Fretwear [ms]", "pyHarm [ms]", "ratio", "target", "steps",
                "steps of pyHarm", "difference", "others [ms]"], (row_of(row) for row in rows))])


def row_of(row: PeerCase) -> tuple[object, ...]:
    """Cells of a case."""
    others = "-" if row.reported is None else f"{1e3 * row.reported:.3g}"
    if math.isnan(row.theirs):
        theirs: tuple[object, ...] = ("not within the limit", "-", "-" if row.target is None else
                                      f"{row.target:g}: not known", f"{row.our_steps:.1f}", "-",
                                      "-")
    else:
        ratio = row.theirs / row.ours
        target = "-"
        if row.target is not None:
            target = f"{row.target:g}: {'met' if ratio >= row.target else 'missed'}"
        theirs = (f"{1e3 * row.theirs:.3g}", f"{ratio:.0f}", target, f"{row.our_steps:.1f}",
                  f"{row.their_steps:.1f}",
                  f"{row.difference:.0e}" + ("" if row.difference <= SAME else " (not the same)"))
    return (row.name, row.n_harmonics, f"{1e3 * row.ours:.3g}", *theirs, others)
