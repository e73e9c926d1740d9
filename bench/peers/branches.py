"""Branches of another program's own examples: NLvib (Krack, Gross 2019), by arc-length.

Its examples 01 (Duffing oscillator), 03 (two masses and a unilateral spring) and 07 (three masses
with two friction elements, two cubic springs and a unilateral one), with its harmonics and its
instants. How many points it takes is kept here; with its folder, Octave counts them again.
"""

from __future__ import annotations

import re
import shutil
import statistics
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bench.common.layout import milliseconds, table
from bench.common.measure import Bench, Groups, Run

__all__ = ["BRANCHES", "BranchRow", "PeerBranch", "count_again", "measure_branches",
           "write_branches"]

#: Runs of each program, in turn.
TIMES = 5
#: Seconds that Octave is given for an example.
LIMIT = 3600.0
#: The commit of github.com/maltekrack/NLvib whose points are kept here, and what ran it.
SOURCE = "commit 69598c5, GNU Octave 7.3.0"
#: Where a branch counts as at its end, over the frequency.
AT_END = 1e-3


@dataclass(frozen=True)
class PeerBranch:
    """An example: its file, the case, points that the other program takes, and the last of their
    frequencies."""

    name: str
    example: str
    groups: Groups
    points: int
    last: float


@dataclass(frozen=True)
class BranchRow:
    """What a branch took: of both programs the points, seconds, and the last frequency."""

    branch: PeerBranch
    instants: str
    points: int
    seconds: float
    ended: bool
    points_before: int | None = None
    seconds_before: float | None = None


def chain(masses: int, stiffness: list[float], damping: float) -> dict[str, object]:
    """Unit masses in a row; spring i before mass i, the last behind it."""
    matrix = [0.0] * masses**2
    for i in range(masses):
        matrix[i * masses + i] = stiffness[i] + stiffness[i + 1]
        if i:
            matrix[i * masses + i - 1] = matrix[(i - 1) * masses + i] = -stiffness[i]
    return {"n_dof": masses, "mass": [float(i % (masses + 1) == 0) for i in range(masses**2)],
            "stiffness": matrix, "damping": [damping * value for value in matrix]}


def case(model: dict[str, object], cosine: list[float], n_harmonics: int, start: float,
         end: float, **groups: dict[str, object]) -> Groups:
    """A frequency response along its branch."""
    return {"case": {"analysis": "frf"}, "model": model, "load": {"cosine": cosine},
            "harmonics": {"n_harmonics": n_harmonics},
            "sweep": {"start": start, "end": end, "n_points": 41, "continuation": "arclength"},
            **groups}


#: Keys of pairs that a component does not have get a value nobody reads.
BRANCHES = (
    PeerBranch("Duffing", "01_Duffing/Duffing", case(
        {"n_dof": 1, "mass": [1.0], "stiffness": [1.0], "damping": [0.05]}, [0.18], 7, 0.5, 1.6,
        spring={"n_springs": 1, "side_1": [1], "coefficient": [0.1], "power": [3]}),
        192, 1.618097),
    PeerBranch("unilateral spring",
               "03_twoDOFoscillator_unilateralSpring/twoDOFoscillator_unilateralSpring", case(
                   chain(2, [0.0, 1.0, 1.0], 0.03), [0.0, 0.1], 21, 0.8, 0.5,
                   contact={"n_pairs": 1, "law": "penalty", "side_1": [0, 0, -1], "mu": [0.0],
                            "gap": [1.0], "normal_stiffness": [100.0]}), 127, 0.580641),
    PeerBranch("five elements",
               "07_multiDOFoscillator_multipleNonlinearities/"
               "multiDOFoscillator_multipleNonlinearities", case(
                   chain(3, [1.0] * 4, 0.02), [0.0, 1.0, 0.0], 7, 0.5, 2.0,
                   spring={"n_springs": 2, "side_1": [2, 3], "side_2": [0, 2],
                           "coefficient": [1.0, 1.0], "power": [3, 3]},
                   contact={"n_pairs": 3, "law": "penalty",
                            "side_1": [1, 0, 0, 2, 0, 0, 0, 0, -3],
                            "side_2": [0, 0, 0, 1, 0, 0, 0, 0, 0], "mu": [0.5, 0.5, 0.0],
                            "normal_load": [2.0, 2.0, 0.0], "gap": [0.0, 0.0, 0.25],
                            "tangential_stiffness": [20.0, 20.0, 1.0],
                            "normal_stiffness": [1.0, 1.0, 1.0]}), 148, 1.653))
#: Instants that the other program takes, where there is contact.
INSTANTS = 1024


def measure_branches(bench: Bench, before: Bench | None,
                     branches: Sequence[PeerBranch] = BRANCHES) -> list[BranchRow]:
    """Every example, contact with located events and with the other program's instants."""
    rows = []
    for branch in branches:
        rows.append(compare(bench, before, branch, "chosen"))
        if "contact" in branch.groups:
            harmonics = branch.groups["harmonics"] | {"n_time": INSTANTS}
            sampled = replace(branch, groups=branch.groups | {"harmonics": harmonics})
            rows.append(compare(bench, before, sampled, str(INSTANTS)))
    return rows


def compare(bench: Bench, before: Bench | None, branch: PeerBranch, instants: str) -> BranchRow:
    """Both programs in turn."""
    ours, theirs = [], []
    for _ in range(1 if bench.quick else TIMES):
        ours.append(bench.run(branch.groups))
        if before:
            theirs.append(before.run(branch.groups))
    end = branch.groups["sweep"]["end"]
    row = BranchRow(branch, instants, len(ours[0].omega), median(ours),
                    abs(ours[0].omega[-1] / end - 1.0) < AT_END)
    if not before:
        return row
    return replace(row, points_before=len(theirs[0].omega), seconds_before=median(theirs))


def median(runs: list[Run]) -> float:
    """Time of a run."""
    return statistics.median(run.elapsed for run in runs)


def count_again(branch: PeerBranch, folder: Path) -> PeerBranch:
    """What the other program takes now: the example up to its first branch, in Octave.

    Octave's optimset does not take a function, which MATLAB's does: that call is left out.
    """
    copy = folder.with_name(folder.name + "_octave")
    shutil.copytree(folder, copy, dirs_exist_ok=True)
    solver = copy / "SRC" / "solve_and_continue.m"
    solver.write_text(solver.read_text().replace("optimset(optimset(@fsolve),", "optimset("))
    path = copy / "EXAMPLES" / f"{branch.example}.m"
    text = path.read_text()
    text = text[:re.search(r"solve_and_continue\(.*?\);", text, re.DOTALL).end()]
    text = re.sub(r"(?m)^\s*(clearvars|close all|clc).*$", "", text)
    text += ("\nif exist('X_HB', 'var'), X = X_HB; end\n"
             "printf('points %d last %.6f\\n', size(X, 2), X(end, end));")
    done = subprocess.run(["octave-cli", "--no-gui", "--quiet", "--eval", text], cwd=path.parent,
                          capture_output=True, text=True, check=False, timeout=LIMIT)
    found = re.search(r"points (\d+) last ([-.\d]+)", done.stdout)
    if not found:
        raise RuntimeError(f"{branch.name}: Octave ended with {done.returncode}:\n{done.stderr}")
    return replace(branch, points=int(found[1]), last=float(found[2]))


def write_branches(rows: list[BranchRow]) -> str:
    """The part of the document."""
    return "\n".join([
        "## Branches of another program's examples",
        "",
        "[NLvib](https://github.com/maltekrack/NLvib) is the program of M. Krack and J. Gross, "
        "Harmonic Balance for Nonlinear Vibration Problems, 2019. Its examples 01, 03 and 07 by "
        f"arc-length, with its harmonics; points of NLvib: {SOURCE}, with the steps that its "
        "examples choose (`--nlvib FOLDER` counts again). *Chosen* are the instants that the "
        "program takes by itself, where contact locates its events; NLvib takes 1024. The number "
        "of points of this program follows from the curve: a cubic between two of them is true "
        "to 0.5 % of the response. Before is another build, in turn with this one. Times of a "
        "whole run, without reading the input, with its maxima and folds. NLvib's steps do not "
        "converge in Octave beyond 0.5806 in example 03, and shrink to the shortest at 1.65 in "
        "example 07, where it was stopped. With 1024 instants the balance of example 03 has teeth: "
        "each instant that closes turns the curve back by 2e-5 of the frequency, and this program "
        "follows those turns and leaves most of them open; located events have none.",
        "",
        *table(["example", "instants", "points of NLvib", "its last frequency", "points",
                "points before", "time [ms]", "before [ms]", "to its end"],
               (row_of(row) for row in rows))])


def row_of(row: BranchRow) -> tuple[object, ...]:
    """Cells of a branch."""
    before = "-" if row.seconds_before is None else milliseconds(row.seconds_before)
    return (row.branch.name, row.instants, row.branch.points or "not ended",
            f"{row.branch.last:.4g}" if row.branch.points else "-", row.points,
            "-" if row.points_before is None else row.points_before, milliseconds(row.seconds),
            before, "yes" if row.ended else "no")
