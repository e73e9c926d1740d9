"""Obstacles that move past the sectors of a disk: each case against itself in other words."""
import re

import numpy as np
from rub_copies import PLANAR, UNITS, later, off, scaled, shifted, side_turned, solved
from rubs import drawn as drawn_alone
from rubs import listed
from rubs import text as text_alone

TITLE = "Rubs around a disk"
TEXT = """
The cases of [rubs](rubs.md) as sectors of a disk: 3 to 24 of them, tied along one interface, in a
wave of any engine order, each said in other ways: in millimetres, tonnes and Newtons and in units
of no system; with t1 turned round, and the speed with it; mirrored, with both interfaces exchanged
and the wave the other way; with an engine order that is larger or smaller by the number of sectors;
with all loads and gaps later by a whole number of instants (of events by any angle). The judge is
the case itself, to 1e-10 of its largest displacement and force (paths by events, which two
directions follow to a tolerance, later 1e-7). Of four sectors, whose waves are later from one to
the next by whole instants, all are one structure too, whose motion has to be that of the wave
(1e-10; by events 1e-7).
"""
COUNT = 60
SMALL = (0, 1, 2, 3, 7)
COLUMNS = {"solved": "solved", "failed": "ended in words", "units": "other units off",
           "turned": "turned off", "mirrored": "mirrored off", "round": "other order off",
           "later": "later off", "wholes": "as one structure", "whole": "that off"}
ZERO = ("units", "turned", "mirrored", "round", "later", "whole")

#: Solved to residuals of 1e-12, conditions below 10, margin of ten.
SAME = 1e-10


def drawn(seed):
    random = np.random.default_rng([seed, 5])
    sectors = int(random.choice([4, random.integers(3, 25)]))
    return drawn_alone(seed) | {
        "sectors": sectors, "order": int(random.integers(0, sectors)), "left": 1,
        "right": int(random.choice([-3, 3]))}


def text(case):
    return text_alone(case) + "\n".join([
        "&cyclic", f"n_sectors = {case['sectors']}", f"engine_order = {case['order']}",
        "n_interface = 1", f"left = {case['left']}", f"right = {case['right']}", "/", ""])


def whole(case):
    """All sectors as one structure: three dofs, the tips, then other dofs of the sectors; and where
    the displacements of each sector stand among them, with their signs."""
    n_sectors, n = case["sectors"], len(case["mass"])
    n_tips = n - 3
    sign = np.sign(case["right"])
    # The first interface and the dof between both of every sector are left.
    body = [(j, dof) for j in range(n_sectors) for dof in (0, 1)]
    place = {key: k if k < 3 else k + n_sectors * n_tips for k, key in enumerate(body)}
    size = 2 * n_sectors + n_sectors * n_tips
    at, signs = np.zeros((n_sectors, n), int), np.ones((n_sectors, n))
    for j in range(n_sectors):
        at[j] = [place[j, 0], place[j, 1], place[(j + 1) % n_sectors, 0],
                 *(3 + j * n_tips + np.arange(n_tips))]
        signs[j, 2] = sign
    found = dict(case)
    for key in ("mass", "damping", "stiffness"):
        found[key] = np.zeros((size, size))
        for j in range(n_sectors):
            found[key][np.ix_(at[j], at[j])] += np.outer(signs[j], signs[j]) * case[key]
    for key in ("mu", "kt", "kn", "gap", "speed"):
        found[key] = np.concatenate([case[key]] * n_sectors)
    pairs, found["terms"], loads = len(case["gap"]), [], np.zeros((2, size))
    for j in range(n_sectors):
        angle = 2.0 * np.pi * j * case["order"] / n_sectors
        moved = later(case, angle)
        for pair, order, amplitude, phase in moved["terms"]:
            found["terms"] += [(j * pairs + i + 1, order, amplitude, phase)
                               for i in (range(pairs) if pair == 0 else [pair - 1])]
        for row, key in zip(loads, ("cosine", "sine")):
            row[at[j, :3]] += signs[j, :3] * moved[key]
    words = text_alone(found)
    for row, key in zip(loads, ("cosine", "sine")):
        words = re.sub(rf"(?m)^{key} = .*$", f"{key} = {listed(row)}", words)
    return words, at, signs


def judge_whole(case, wanted, program, folder):
    """How far all sectors as one structure are from the wave."""
    words, at, signs = whole(case)
    copy = solved(words, program, folder)
    if copy is None:
        return np.inf
    pairs, most = len(case["gap"]), 0.0
    for j in range(case["sectors"]):
        angle = 2.0 * np.pi * j * case["order"] / case["sectors"]
        own = copy[0][:, at[j]] * signs[j], copy[1][:, j * pairs:(j + 1) * pairs]
        most = max(most, off(own, [shifted(values, angle) for values in wanted]))
    return most


def copies(case, seed):
    """(name, words, angle, factors) of each."""
    one = (1.0, 1.0)
    for units in UNITS:
        copy, length, force = scaled(case, *units)
        yield "units", text(copy), 0.0, (length, force)
    turned = case | {"speed": case["speed"] * np.array([-1.0, 1.0])}
    yield "turned", side_turned(text(turned)), 0.0, one
    sign = -1 if case["right"] < 0 else 1
    mirrored = case | {"order": -case["order"], "left": abs(case["right"]),
                       "right": sign * case["left"]}
    yield "mirrored", text(mirrored), 0.0, one
    around = case | {"order": case["order"] + case["sectors"] * (-1 if seed % 2 else 2)}
    yield "round", text(around), 0.0, one
    angle = 2.0 * np.pi * (1 + seed % 7) / (8 if not case["events"] else 7.3)
    moved = later(case, angle)
    yield "later", text(moved), angle, one


def trial(seed, program, folder):
    case = drawn(seed)
    kind = "events" if case["events"] else case["law"]
    found = {**dict.fromkeys(COLUMNS, 0), "kind": f"{kind}, {case['sliding']}"}
    wanted, notes = solved(text(case), program, folder), []
    if wanted is None:
        return {**found, "failed": 1}
    found["solved"] = 1
    for name, words, angle, factors in copies(case, seed):
        copy = solved(words, program, folder)
        if copy is None:
            notes.append(f"{name}: not solved")
            found[name] = 1
            continue
        if name == "turned":
            copy[1][:, :, 0] *= -1.0
        difference = off(copy, [shifted(values, angle) for values in wanted], factors)
        within = PLANAR if name == "later" and case["events"] else SAME
        if not difference < within:
            notes.append(f"{name}: off by {difference:.1e}")
            found[name] = 1
    if case["sectors"] == 4:
        difference = judge_whole(case, wanted, program, folder)
        found["wholes"], found["whole"] = 1, int(
            not difference < (PLANAR if case["events"] else SAME))
        if found["whole"]:
            notes.append(f"as one structure: off by {difference:.1e}")
    return {**found, "notes": notes}
