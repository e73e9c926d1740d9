"""A cylinder that is pressed on a half-plane and rubbed to and fro in partial slip, in cells, and
its wear by a march of cycles in NumPy that shares no code with the program.

Both bodies are alike, so that normal and tangential displacements do not know of each other: the
cycle of friction is known from two normal problems (Ciavarella 1998, Jaeger 1998). With the
pressure p(P) that the gap makes of a load P, the tangential traction that a load Q brings is
mu (p(P) - p(P - Q/mu)), and cells slide by mu times the gap that is left under P - Q/mu: to one
side, back through twice as much, and again. Its steady state is the one in which all load ends on
the cells that never slide.
"""
from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import h5py
import numpy as np

#: Depth of the datum of displacements, over the half width of the contact.
DATUM = 200.0
#: Growth of the largest depth in a step of the march, as a part of the largest so far.
GROWTH = 0.01
#: The same at the start, as a part of the largest gap.
LEAST = 0.01
#: Rate, as a part of the largest, that is none.
STEADY = 1e-7


@dataclass
class Scar:
    """A contact of n cells of width `cell`; loads of a unit of length."""
    n: int
    cell: float
    modulus: float
    radius: float
    load: float
    mu: float
    drag: float
    wear: float = 1e-7
    #: Depth of the datum; 0 for DATUM.
    datum: float = 0.0

    @property
    def place(self):
        """Middles of the cells."""
        return (np.arange(self.n) - 0.5 * (self.n - 1)) * self.cell

    @property
    def gap(self):
        """Of the unworn cylinder."""
        return self.place**2 / (2.0 * self.radius)

    def compliance(self):
        """Displacement of a cell by the traction force of another."""
        edges = np.abs(self.place[:, None] - self.place[None, :])
        datum = self.datum or DATUM * self.n * self.cell

        def primitive(s):
            return s * (np.log(datum / np.maximum(np.abs(s), 1e-300)) + 1.0)

        width = primitive(edges + 0.5 * self.cell) - primitive(edges - 0.5 * self.cell)
        return 2.0 / (np.pi * self.modulus * self.cell) * width


def pressed(compliance, gap, load):
    """Cell forces and gaps of bodies that a load presses together: an active set that only the
    signs of forces and gaps change."""
    n = len(gap)
    active = np.ones(n, dtype=bool)
    for _ in range(50 * n):
        k = np.flatnonzero(active)
        system = np.zeros((len(k) + 1, len(k) + 1))
        system[:-1, :-1] = compliance[np.ix_(k, k)]
        system[:-1, -1] = -1.0
        system[-1, :-1] = 1.0
        solution = np.linalg.solve(system, [*-gap[k], load])
        force = np.zeros(n)
        force[k] = solution[:-1]
        left = gap + compliance @ force - solution[-1]
        left[k] = 0.0
        pull, cross = force < 0.0, left < 0.0
        if not pull.any():
            if not (cross & ~active).any():
                return force, left
            active[np.argmin(left)] = True
        else:
            active &= ~pull
    raise AssertionError("the contact does not settle")


def rates(compliance, scar, depth):
    """Pressure times slide, but for a factor that all cells share."""
    gap = scar.gap + depth
    force, _ = pressed(compliance, gap, scar.load)
    _, left = pressed(compliance, gap, scar.load - scar.drag / scar.mu)
    return force * left


def marched(scar):
    """Depths of the steady state."""
    compliance = scar.compliance()
    depth = np.zeros(scar.n)
    largest = 0.0
    for _ in range(100_000):
        rate = rates(compliance, scar, depth)
        largest = max(largest, rate.max())
        if rate.max() <= STEADY * largest:
            return depth
        # Heun's method, in cycles.
        step = GROWTH * max(depth.max(), LEAST * scar.gap.max()) / rate.max()
        depth = depth + 0.5 * step * (rate + rates(compliance, scar, depth + step * rate))
    raise AssertionError("no steady state")


def left_in_the_end(scar):
    """Depths of the steady state, and the cells that never slide: they carry all load in the end,
    and what wears is the gap that this closes. No march, one linear problem."""
    compliance = scar.compliance()
    force, _ = pressed(compliance, scar.gap, scar.load - scar.drag / scar.mu)
    k = np.flatnonzero(force)
    system = np.zeros((len(k) + 1, len(k) + 1))
    system[:-1, :-1] = compliance[np.ix_(k, k)]
    system[:-1, -1] = -1.0
    system[-1, :-1] = 1.0
    solution = np.linalg.solve(system, [*-scar.gap[k], scar.load])
    depth = np.maximum(solution[-1] - scar.gap - compliance[:, k] @ solution[:-1], 0.0)
    depth[k] = 0.0
    return depth, k


def slid(compliance, scar, depth, motion):
    """Path of every cell in a cycle in which the ground is led by `motion` to either side, times
    its force: cells slide by mu times the gap that is left where the body is raised by
    motion / mu; they all do where that lifts it off."""
    gap = scar.gap + depth
    force, left = pressed(compliance, gap, scar.load)
    k = np.argmax(force)
    # What the cell of the largest force says of the approach.
    approach = gap[k] + compliance[k] @ force - left[k]
    raised = approach - motion / scar.mu
    assert raised < gap.min(), "the ground is led too little for gross slip"
    return force * 4.0 * scar.mu * (gap - raised)


def led(scar, motion, cycles):
    """Depths after so many cycles of gross slip."""
    compliance = scar.compliance()
    depth, done = np.zeros(scar.n), 0.0
    # What wears by d bears less by d over the smallest compliance: half of the step at which
    # pressures would swing from one cell to the next.
    stiffest = 1.0 / np.linalg.eigvalsh(compliance)[0]
    longest = 1.0 / (scar.wear / scar.cell * 4.0 * motion * stiffest)
    while done < cycles:
        rate = scar.wear / scar.cell * slid(compliance, scar, depth, motion)
        step = GROWTH * max(depth.max(), LEAST * scar.gap.max()) / rate.max()
        step = min(step, longest, cycles - done)
        middle = depth + 0.5 * step * rate
        depth = depth + step * scar.wear / scar.cell * slid(compliance, scar, middle, motion)
        done += step
    return depth


def write_model(path, scar, motion=0.0):
    """The model of `fw_run`: the displacements of the cells across and along, the approach of the
    cylinder, and its tangential motion, which the drag moves to and fro; or is led so far."""
    n = scar.n
    held = np.linalg.inv(scar.compliance())
    stiffness = np.zeros((2 * n + 2, 2 * n + 2))
    stiffness[:n, :n] = held
    stiffness[n:2 * n, n:2 * n] = held
    side = np.zeros((2, n, 3), dtype=int)
    side[0, :, 0], side[0, :, 2] = 2 * n + 2, 2 * n + 1
    side[1, :, 0], side[1, :, 2] = n + 1 + np.arange(n), 1 + np.arange(n)
    loads = {"static": np.zeros(2 * n + 2), "cosine": np.zeros(2 * n + 2)}
    loads["static"][-2] = -scar.load
    loads["cosine"][-1] = scar.drag
    if motion:
        # The ground slides past the cells; the dof of the drag only has to be held.
        side[0, :, 0], stiffness[-1, -1] = 0, 1.0
        loads["cosine"] = np.concatenate([np.zeros(n), -held.sum(axis=1) * motion, [0.0, 0.0]])
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "fretwear-model"
        file.attrs["format_version"] = 1
        file["mass"] = np.zeros_like(stiffness)
        file["stiffness"] = 0.5 * (stiffness + stiffness.T)
        file["contact/side_1"], file["contact/side_2"] = side
        file["contact/mu"] = np.full(n, scar.mu)
        file["contact/gap"] = scar.gap
        file["contact/area"] = np.full(n, scar.cell)
        for name, load in loads.items():
            file[f"load/{name}"] = load


def groups(scar, n_harmonics, model="model.h5", **wear):
    """The case of analysis 'wear' until nothing wears."""
    return {"case": {"analysis": "wear", "threads": 1},
            "model": {"source": "hdf5", "file": model},
            "contact": {"law": "dlft"}, "harmonics": {"n_harmonics": n_harmonics},
            "sweep": {"start": 1.0}, "output": {"observe": [2 * scar.n + 2]},
            "wear": {"coefficient": scar.wear, "steady_tolerance": 1e-5, **wear}}
