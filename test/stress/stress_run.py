"""Run a case in a process of its own and say how it ended."""
from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import stress_check as check

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from cases import write_namelist
from limited import limited
from project import PROGRAM

# Processor time that no case needs [s]; a busy machine only lengthens the wall clock.
TIME_LIMIT, GRACE = 60, 5
WALL_LIMIT = 600
# Models above this go through a file: their matrices make long namelists.
INLINE_DOFS = 12
# The lock of a model file may still be held by a process that another thread has just forked.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "HDF5_USE_FILE_LOCKING": "FALSE"}
# Words of `served_by` for what is tried where the first guess fails.
FALLBACKS = ("other guess", "pseudo-time", "smaller steps", "raised load", "free guess",
             "other balance", "integration")
# What a message has to say for a failure to be one in words: what to try.
REMEDIES = ("needs", "need ", "use ", "try ", "give it", "check ", "raise", "smaller", "help")


@dataclass
class Outcome:
    """converged, words, or one of the four that must not be: crash, hang, nan, false."""

    case: object
    verdict: str
    n_points: int = 0
    n_converged: int = 0
    saved: list = field(default_factory=list)
    text: str = ""
    coefficients: np.ndarray | None = None
    seconds: float = 0.0
    revision: str = ""


def write_case(case, folder):
    """The namelist, and a model file beside it where the model is not small."""
    joint = case.joint
    if joint.n_dof <= INLINE_DOFS:
        model = {"n_dof": joint.n_dof, "mass": joint.mass, "stiffness": joint.stiffness,
                 "damping": joint.damping}
        load = {"static": joint.static, "cosine": joint.cosine, "sine": joint.sine}
        contact = {"n_pairs": joint.n_pairs, "side_1": joint.side_1}
    else:
        model, load, contact = {"source": "hdf5", "file": "model.h5"}, {}, {}
        write_model(joint, folder / "model.h5")
    if joint.modal_damping:
        model["modal_damping"] = joint.modal_damping
    groups = {"case": case.groups["case"], "model": model}
    if joint.n_pairs:
        contact |= {"law": case.law, "mu": joint.mu, "gap": joint.gap}
        if not joint.side_1[:, :2].any():
            del contact["mu"]
        if not joint.side_1[:, 2].all():
            contact["normal_load"] = joint.normal_load
        if case.law == "penalty":
            if joint.side_1[:, :2].any():
                contact["tangential_stiffness"] = joint.contact_stiffness
            if joint.side_1[:, 2].any():
                contact["normal_stiffness"] = joint.contact_stiffness
        else:
            contact["penalty_scale"] = case.penalty_scale
        if "wear" in case.groups:
            contact["area"] = 1.0
        groups["contact"] = contact
    if load:
        groups["load"] = load
    groups |= {name: keys for name, keys in case.groups.items() if name != "case"}
    write_namelist(folder / "case.nml", groups)


def write_model(joint, path):
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name in ("mass", "stiffness", "damping"):
            file[name] = getattr(joint, name)
        for name in ("static", "cosine", "sine"):
            file[f"load/{name}"] = getattr(joint, name)
        if joint.n_pairs:
            file["contact/side_1"] = joint.side_1
            file["contact/side_2"] = np.zeros_like(joint.side_1)


def run(case, program=PROGRAM):
    """Outcome of a case, and the time that it took by the clock."""
    started = time.monotonic()
    end = run_once(case, program)
    end.seconds = time.monotonic() - started
    return end


def run_once(case, program):
    with tempfile.TemporaryDirectory(prefix="fw_stress_") as name:
        folder = Path(name)
        write_case(case, folder)
        try:
            command = [program, folder / "case.nml", "-o", folder / "r.h5"]
            done = subprocess.run(limited(command, TIME_LIMIT, GRACE), capture_output=True,
                                  text=True, check=False, timeout=WALL_LIMIT, env=ENVIRONMENT)
        except subprocess.TimeoutExpired:
            return Outcome(case, "hang", text=f"more than {WALL_LIMIT} s")
        return judge(case, done, folder / "r.h5")


def judge(case, done, path):
    text = done.stderr.strip() + "\n" + done.stdout.strip()
    if done.returncode in (-24, -9):
        return Outcome(case, "hang", text=text)
    if done.returncode not in (0, 3, 4):
        return Outcome(case, "crash", text=f"status {done.returncode}\n{text}")
    if done.returncode == 3:
        return Outcome(case, in_words(text), text=text)
    with h5py.File(path) as file:
        omega, converged = file["omega"][()], file["converged"][()].astype(bool)
        values = {key: file[key][()] for key in ("coefficients", "amplitude", "contact/force",
                                                 "contact/dissipation", "wear/depth", "wear/rate",
                                                 "residual")
                  if key in file}
        saved = []
        if "served_by" in file:  # a sweep or a point
            names = list(file["served_by"].attrs["names"])
            saved = [names[k] for k in file["served_by"] if names[k] in FALLBACKS]
    outcome = Outcome(case, "converged", len(omega), int(converged.sum()), saved, text,
                      values["coefficients"])
    if not all(np.isfinite(value).all() for value in values.values()):
        outcome.verdict = "nan"
        return outcome
    complaints = verify_points(case, omega, converged, values)
    if complaints:
        outcome.verdict, outcome.text = "false", "; ".join(complaints) + "\n" + text
    elif done.returncode == 4:
        outcome.verdict = in_words(text)
    elif not converged.all() and "wear" not in case.groups:
        outcome.verdict, outcome.text = "false", "status 0 with points that failed"
    return outcome


def verify_points(case, omega, converged, values):
    """Complaints about the converged points."""
    complaints = []
    n_pairs = case.joint.n_pairs
    for k in np.flatnonzero(converged):
        point = case
        u = values["coefficients"][k]
        force = values.get("contact/force", np.zeros((len(omega), len(u), n_pairs, 3)))[k]
        dissipation = values["contact/dissipation"][k] if "contact/dissipation" in values else None
        if "wear/depth" in values:
            depth = values["wear/depth"][k]
            point = type(case)(**{**vars(case), "joint": case.joint.with_(
                gap=case.joint.gap + depth)})
            if (depth < 0).any() or (k and (depth < values["wear/depth"][k - 1] - 1e-12).any()):
                complaints.append(f"row {k + 1}: the depth falls")
        complaints += [f"omega = {omega[k]:g}: {c}"
                       for c in check.verify(point, omega[k], u, force, dissipation,
                                             lag_of(case, values, k))]
    return complaints


def lag_of(case, values, row):
    """The residual that a row of wear by pseudo-time states, by which its vibration lags."""
    by_pseudo_time = case.groups.get("wear", {}).get("scheme") == "pseudo_time"
    return float(values["residual"][row]) if by_pseudo_time else 0.0


def in_words(text):
    """Whether a failure says what to try."""
    return "words" if any(word in text for word in REMEDIES) else "silent"
