"""Periodic motions of masses with contact and springs by a march in time (march.c) and shooting.

It takes the groups of a namelist and shares no code with the program. Dofs without mass follow
statically; between two instants the masses are a linear system whose matrices are exact; forces
are linear in time, so that an error of second order is left, which the same with half of the
instants tells.
"""
from __future__ import annotations

import ctypes
import os
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from scipy.linalg import expm

#: Halvings of a step in which a pair changes its state; instants that are kept.
LEVELS, SAMPLES = 12, 512
#: Of a step times the highest frequency; steps of a period at least and at most.
RESOLVED, FEWEST, MOST = 0.06, 2048, 131072
#: Plain periods before Newton's method, its steps, and the change over a period that is none.
PERIODS, STEPS, CLOSED = 6, 25, 1e-9
#: Motion of a mass, as a part of the largest, that is rest.
AT_REST = 1e-6
PLASTIC, ON_MASS, SMOOTH, SPRING = range(4)


@cache
def library():
    """march.c, compiled once in a process."""
    folder = Path(tempfile.mkdtemp())
    target = folder / "march.so"
    subprocess.run([os.environ.get("CC", "cc"), "-O2", "-shared", "-fPIC",
                    Path(__file__).with_name("march.c"), "-o", target, "-lm"], check=True)
    return ctypes.CDLL(str(target))


def pointer(array):
    return array.ctypes.data_as(ctypes.c_void_p)


class Joint:
    """Blocks of the march: pairs and springs, each with up to three components."""

    def __init__(self, groups, mass):
        self.rows, self.softness, self.moving = [], [], []
        self.kind, self.at, self.mu, self.load, self.gap, self.speed = [], [], [], [], [], []
        self.n_dof, self.massless = len(mass), ~np.any(mass, axis=1)
        contact, spring = groups.get("contact"), groups.get("spring")
        if contact:
            self.pairs(contact)
        if spring:
            side = np.atleast_1d(spring["side_1"])
            for i, dof in enumerate(side):
                self.block(SPRING, [dof, 0, 0], [0.0] * 3, [False] * 3,
                           np.atleast_1d(spring["coefficient"])[i],
                           np.atleast_1d(spring["power"])[i])

    def pairs(self, contact):
        n, law = contact["n_pairs"], contact.get("law", "rigid")

        def value(key, i, default):
            return float(np.broadcast_to(contact.get(key, default), n)[i])

        for i, side in enumerate(np.reshape(contact["side_1"], (n, 3))):
            tangential = [abs(d) - 1 for d in side[:2] if d]
            soft, moving, kind = [0.0] * 3, [False] * 3, PLASTIC
            if law == "penalty":
                soft = [1.0 / value("tangential_stiffness", i, 1.0)] * 2
            if law in ("penalty", "regularised"):
                soft = [*soft[:2], 1.0 / value("normal_stiffness", i, 1.0)]
            if law == "regularised":
                kind = SMOOTH
            elif law != "penalty" and tangential and not self.massless[tangential].any():
                kind = ON_MASS
            if kind != PLASTIC:
                moving = [True, True, False]
            self.block(kind, side, soft, moving, value("mu", i, 0.0),
                       value("normal_load", i, 0.0), value("gap", i, 0.0),
                       value("slip_speed", i, 1.0))

    def block(self, kind, side, soft, moving, mu, load, gap=0.0, speed=1.0):
        at = []
        for c, dof in enumerate(side):
            at.append(len(self.rows) if dof else -1)
            if dof:
                row = np.zeros(self.n_dof)
                row[abs(dof) - 1] = np.sign(dof)
                self.rows.append(row)
                self.softness.append(soft[c])
                self.moving.append(moving[c])
        for values, one in zip((self.kind, self.at, self.mu, self.load, self.gap, self.speed),
                               (kind, at, mu, load, gap, speed)):
            values.append(one)


class March:
    """A case, ready to be marched from a state (y: what the contact adds to the motion without
    it; place: where plastic components stand)."""

    def __init__(self, groups):
        model, load = groups["model"], groups["load"]
        n_dof = model["n_dof"]
        mass, damping, stiffness = (np.reshape(np.asarray(model[key], float), (n_dof, n_dof))
                                    for key in ("mass", "damping", "stiffness"))
        static, cosine, sine = (np.asarray(load.get(key, np.zeros(n_dof)), float)
                                for key in ("static", "cosine", "sine"))
        self.omega = omega = float(groups["sweep"]["start"])
        joint = self.joint = Joint(groups, mass)
        m = self.m = len(joint.rows)
        masses, light = np.flatnonzero(~joint.massless), np.flatnonzero(joint.massless)
        k = stiffness[np.ix_(masses, masses)]
        to_light = np.zeros((0, len(masses)))
        give = np.zeros((0, 0))
        if len(light):
            give = np.linalg.inv(stiffness[np.ix_(light, light)])
            to_light = -give @ stiffness[np.ix_(light, masses)]
            k = k - stiffness[np.ix_(masses, light)] @ give @ stiffness[np.ix_(light, masses)]
        self.spread = np.zeros((n_dof, len(masses)))
        self.spread[masses], self.spread[light] = np.eye(len(masses)), to_light
        rows = np.reshape(joint.rows, (m, n_dof))
        own = np.zeros((n_dof, n_dof))
        own[np.ix_(light, light)] = give
        #: Displacements of all dofs by forces of the components, the masses held.
        self.by_force = -own @ rows.T
        self.still = rows @ own @ rows.T + np.diag(joint.softness)
        inputs = rows @ self.spread
        reach = self.spread.T @ rows.T
        mm, cc = mass[np.ix_(masses, masses)], damping[np.ix_(masses, masses)]
        size = self.size = 2 * len(masses)
        inverse = np.linalg.inv(mm)
        state = np.block([[np.zeros_like(mm), np.eye(len(masses))], [-inverse @ k, -inverse @ cc]])
        push = np.vstack([np.zeros((len(masses), m)), -inverse @ reach])
        self.state, self.push = state, push
        # The motion without contact.
        whole = np.linalg.solve(stiffness, static)
        wave = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping,
                               cosine - 1j * sine)
        self.free = whole, wave
        moving = np.asarray(joint.moving, bool)
        self.row = np.zeros((m, size))
        self.row[~moving, :len(masses)] = inputs[~moving]
        self.row[moving, len(masses):] = inputs[moving]
        lin = np.zeros((m, 3))
        lin[~moving, 0] = rows[~moving] @ whole
        swing = rows @ wave * np.where(moving, 1j * omega, 1.0)
        lin[:, 1], lin[:, 2] = swing.real, -swing.imag
        self.lin = np.ascontiguousarray(lin)
        self.constant = np.zeros(m, bool)
        for kind, at in zip(joint.kind, joint.at):
            if kind == ON_MASS:
                self.constant[[g for g in at[:2] if g >= 0]] = True
        self.start = self.still.copy()
        self.start[self.constant, self.constant] += 1e-12
        self.plastic = np.zeros(m, bool)
        for kind, at in zip(joint.kind, joint.at):
            if kind == PLASTIC:
                self.plastic[[g for g in at[:2] if g >= 0]] = True
        soft = np.array(joint.softness)
        held = k + reach @ np.linalg.pinv(self.still + 0.0 * np.diag(soft)) @ reach.T \
            if m and np.any(self.still) else k
        self.highest = float(np.sqrt(np.linalg.eigvals(inverse @ held).real.max()))
        self.masses = masses
        self.built = {}

    def steps(self):
        """As many as resolve the highest frequency, a multiple of the samples."""
        n = FEWEST
        while n < MOST and 2.0 * np.pi / self.omega / n * self.highest > RESOLVED:
            n *= 2
        return n

    def matrices(self, n):
        """State and forces of a step and its halves."""
        if n not in self.built:
            m, size = self.m, self.size
            a, g0, g1, s = [], [], [], []
            for level in range(LEVELS):
                h = 2.0 * np.pi / self.omega / n / 2**level
                block = np.zeros((size + 2 * m, size + 2 * m))
                block[:size, :size] = self.state * h
                block[:size, size:size + m] = self.push * h
                block[size:size + m, size + m:] = np.eye(m)
                e = expm(block)
                end = e[:size, size + m:]
                begin = e[:size, size:size + m] - end
                begin[:, self.constant], end[:, self.constant] = \
                    0.0, (begin + end)[:, self.constant]
                a.append(e[:size, :size])
                g0.append(begin)
                g1.append(end)
                s.append(self.still - self.row @ end)
            self.built[n] = [np.ascontiguousarray(x) for x in (a, g0, g1, s)]
        return self.built[n]

    def period(self, n, y, place, keep=False):
        """State at the end, and what was kept (SAMPLES, size + 2 m)."""
        joint = self.joint
        a, g0, g1, s = self.matrices(n)
        kept = np.zeros((SAMPLES, self.size + 2 * self.m))
        y, place = np.array(y), np.array(place)
        arrays = [np.ascontiguousarray(x, float) for x in
                  (joint.mu, joint.load, joint.gap, joint.speed)]
        kind, at = np.array(joint.kind, np.int32), np.array(joint.at, np.int32).ravel()
        row, lin, start = (np.ascontiguousarray(x) for x in (self.row, self.lin, self.start))
        wrong = library().period(
            self.size, self.m, LEVELS, len(joint.kind), *map(pointer, (a, g0, g1, s, start, row,
                                                                       lin)),
            ctypes.c_double(self.omega), pointer(kind), pointer(at), *map(pointer, arrays), n,
            SAMPLES, pointer(y), pointer(place), pointer(kept) if keep else None)
        if wrong:
            raise ArithmeticError("the march grows without bound")
        return y, place, kept

    def motion(self, kept):
        """All dofs (n_dof, SAMPLES) of what was kept."""
        tau = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
        whole, wave = self.free
        moved = self.spread @ kept[:, :len(self.masses)].T
        forced = self.by_force @ kept[:, self.size:self.size + self.m].T
        return whole[:, None] + (wave[:, None] * np.exp(1j * tau)).real + moved + forced

    def state_of(self, coefficients):
        """State at the start of the period of an answer (2H+1, n_dof)."""
        h = np.arange(1, (len(coefficients) - 1) // 2 + 1)
        q = coefficients[0] + coefficients[1::2].sum(axis=0)
        v = self.omega * (h[:, None] * coefficients[2::2]).sum(axis=0)
        whole, wave = self.free
        q0, v0 = q - whole - wave.real, v - (1j * self.omega * wave).real
        return np.concatenate([q0[self.masses], v0[self.masses]]), self.places(coefficients)

    def places(self, coefficients):
        """Where plastic components stand at the start of the period of an answer: its motion, turn
        after turn from the unstrained assembly."""
        joint, place = self.joint, np.zeros(self.m)
        motion = np.reshape(joint.rows, (self.m, -1)) @ synthesis(coefficients)
        for kind, at, mu, load, gap in zip(joint.kind, joint.at, joint.mu, joint.load, joint.gap):
            own = [g for g in at[:2] if g >= 0]
            if kind != PLASTIC or not own:
                continue
            if max(joint.softness[g] for g in own) <= 0.0:
                place[own] = motion[own, 0]
                continue
            limit = np.full(SAMPLES, mu * load)
            if at[2] >= 0:
                limit = mu * np.maximum(-(motion[at[2]] + gap) / joint.softness[at[2]], 0.0)
            limit *= joint.softness[own[0]]
            for k in range(3 * SAMPLES):
                away = motion[own, k % SAMPLES] - place[own]
                far = np.linalg.norm(away)
                if far > limit[k % SAMPLES]:
                    place[own] += away * (1.0 - limit[k % SAMPLES] / far)
        return place

    def solve(self, n, x):
        """Periodic state for n steps, from a near one, and its drift; Newton's method."""
        size, where = self.size, np.flatnonzero(self.plastic)

        def turn(x):
            place = np.zeros(self.m)
            place[where] = x[size:]
            y, place, _ = self.period(n, x[:size], place)
            return np.concatenate([y, place[where]])

        best, least = x, np.inf
        jacobian = None
        for k in range(STEPS):
            after = turn(x)
            scale = self.scale(x)
            drift = np.linalg.norm((after - x) / scale)
            if drift < least:
                best, least = x, drift
            if drift <= CLOSED:
                break
            if k < 2:
                x = after
                continue
            if jacobian is None or k % 2 == 0:
                step = 1e-6 * scale
                jacobian = np.array([(turn(x + np.eye(len(x))[i] * step[i]) - after) / step[i]
                                     for i in range(len(x))]).T
            dx = np.linalg.lstsq((np.eye(len(x)) - jacobian) * scale, after - x,
                                 rcond=1e-9)[0] * scale
            share = 1.0
            while share > 0.05:
                trial = x + share * dx
                new = turn(trial)
                if np.linalg.norm((new - trial) / scale) < 0.9 * drift:
                    break
                share *= 0.4
            x = trial if share > 0.05 else turn(turn(after))
            if share < 1.0:
                jacobian = None
        return best, least

    def scale(self, x):
        n = self.size // 2
        q, v = np.abs(x[:n]).max(), np.abs(x[n:self.size]).max()
        wave = np.abs(self.free[1]).max() + 1e-300
        q = max(q, 1e-3 * wave)
        v = max(v, self.omega * q)
        return np.concatenate([np.full(n, q), np.full(n, v),
                               np.full(int(self.plastic.sum()), q)])

    def periodic(self, coefficients, wanted):
        """Motion (n_dof, SAMPLES) near an answer, and its own error, which is brought below
        `wanted` where that is possible; None where there is none."""
        y, place = self.state_of(coefficients)
        x = np.concatenate([y, place[self.plastic]])
        n = self.steps()
        before = None
        while n <= MOST:
            try:
                x, drift = self.solve(n, x)
            except (ArithmeticError, np.linalg.LinAlgError):
                return None
            if drift > 1e-6:
                return None
            place = np.zeros(self.m)
            place[self.plastic] = x[self.size:]
            _, _, kept = self.period(n, x[:self.size], place, keep=True)
            motion = self.motion(kept)
            stands = kept[:, self.size + self.m:][:, self.plastic]
            self.rests = bool(np.any(np.ptp(stands, axis=0) <= 1e-9 * self.scale(x)[self.size:]))
            moves = np.ptp(motion, axis=1)
            held = np.reshape(self.joint.rows, (self.m, -1))[self.constant]
            self.rests |= bool(np.any(np.abs(held) @ moves <= AT_REST * moves.max()))
            if before is not None:
                own = error(motion, before)
                if own <= wanted:
                    return motion, own
            before, n = motion, 2 * n
        return (motion, own) if before is not None else None


def error(motion, reference):
    """Root mean square over the period, of the worst dof, relative to its vibration or to a
    thousandth of the largest."""
    vibration = reference - reference.mean(axis=1, keepdims=True)
    size = np.linalg.norm(vibration, axis=1)
    size = np.maximum(size, 1e-3 * size.max())
    return float((np.linalg.norm(motion - reference, axis=1) / size).max())


def synthesis(coefficients, n_time=SAMPLES):
    """Motions (n, n_time) from coefficients (2H+1, n)."""
    tau = 2.0 * np.pi * np.arange(n_time) / n_time
    h = np.arange(1, (len(coefficients) - 1) // 2 + 1)[:, None]
    return (coefficients[:1] + 0.0).T + coefficients[1::2].T @ np.cos(h * tau) \
        + coefficients[2::2].T @ np.sin(h * tau)
