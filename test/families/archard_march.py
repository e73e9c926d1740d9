"""A judge of wear: elastic contact with friction integrated in time until the motion repeats, the
depth of a cycle by Archard's law, and the depths over the cycles by a Runge-Kutta method."""
import numpy as np

STEPS = 240
#: Periods until the motion repeats, at most; and how nearly it does.
PERIODS, REPEATS = 150, 1e-5
#: Differences of periods from which the next state is put together, and plain periods before.
DEPTH, PLAIN = 6, 4
#: Steps of the Runge-Kutta method.
STAGES = 3


class Joint:
    """A structure whose pairs rub by springs with Coulomb's limit (t, n: own dofs)."""

    def __init__(self, groups):
        contact = groups["contact"]
        self.n_pairs = int(contact["n_pairs"])
        side = np.reshape(contact["side_1"], (self.n_pairs, 3))
        self.t, self.n = side[:, 0] - 1, side[:, 2] - 1
        self.mu, self.area = (np.broadcast_to(contact[key], self.n_pairs) for key in ("mu", "area"))
        self.kt = np.broadcast_to(contact["tangential_stiffness"], self.n_pairs)
        self.kn = np.broadcast_to(contact["normal_stiffness"], self.n_pairs)
        self.gap = np.broadcast_to(contact.get("gap", 0.0), self.n_pairs)
        self.mass, self.stiffness, self.damping = (
            np.asarray(groups["model"][key], float) for key in ("mass", "stiffness", "damping"))
        self.load = {key: np.asarray(groups["load"][key], float)
                     for key in ("static", "cosine", "sine")}
        self.omega = float(groups["sweep"]["start"])
        self.k_w = float(groups["wear"]["coefficient"])
        self.by_energy = groups["wear"]["law"] == "energy"
        self.step = 2.0 * np.pi / self.omega / STEPS
        # Average acceleration for the structure; the forces of the pairs by iteration.
        self.inverse = np.linalg.inv(self.mass + 0.5 * self.step * self.damping
                                     + 0.25 * self.step**2 * self.stiffness)
        n = len(self.mass)
        self.light = np.linalg.inv(self.mass)
        self.state = (np.zeros(n), np.zeros(n), np.zeros(self.n_pairs))
        phase = 2.0 * np.pi * np.arange(STEPS) / STEPS
        self.outer = (self.load["static"] + np.outer(np.cos(phase), self.load["cosine"])
                      + np.outer(np.sin(phase), self.load["sine"]))

    def pairs(self, u, slider, worn):
        """Forces on the structure's dofs, sliders after, pressures."""
        pressure = np.maximum(0.0, -self.kn * (u[self.n] + self.gap + worn))
        trial = self.kt * (u[self.t] - slider)
        limit = self.mu * pressure
        friction = np.clip(trial, -limit, limit)
        force = np.zeros(len(u))
        force[self.t], force[self.n] = -friction, pressure
        return force, u[self.t] - friction / self.kt, pressure

    def period(self, worn):
        """One period from the state; the depth that it wears."""
        u, v, slider = self.state
        force, _, _ = self.pairs(u, slider, worn)
        a = self.light @ (self.outer[0] + force - self.damping @ v - self.stiffness @ u)
        slid = np.zeros(self.n_pairs)
        before, h = None, self.step
        for k in range(STEPS):
            outer = self.outer[(k + 1) % STEPS]
            start = u + h * v + 0.25 * h**2 * a
            speed = v + 0.5 * h * a
            a_new = a
            for _ in range(30):
                u_new = start + 0.25 * h**2 * a_new
                force, after, pressure = self.pairs(u_new, slider, worn)
                known = outer + force - self.damping @ speed - self.stiffness @ start
                better = self.inverse @ known
                done = np.abs(better - a_new).max() <= 1e-11 * (1e-300 + np.abs(better).max())
                a_new = better
                if done:
                    break
            u, v, a = start + 0.25 * h**2 * a_new, speed + 0.5 * h * a_new, a_new
            mean = pressure if before is None else 0.5 * (pressure + before)
            slid += mean * np.abs(after - slider)
            slider, before = after, pressure
        self.state = (u, v, slider)
        factor = self.k_w / self.area
        return factor * slid * (self.mu if self.by_energy else 1.0)

    def rate(self, worn):
        """Depth of a cycle once the motion repeats."""
        n, starts, ends = len(self.mass), [], []
        for k in range(PERIODS):
            starts.append(np.concatenate(self.state))
            found = self.period(worn)
            ends.append(np.concatenate(self.state))
            change = ends[-1] - starts[-1]
            if np.abs(change).max() <= REPEATS * np.abs(ends[-1]).max():
                break
            if k >= PLAIN:
                # Anderson's: the combination of the last ends whose changes cancel best.
                starts, ends = starts[-DEPTH:], ends[-DEPTH:]
                changes = np.array(ends) - np.array(starts)
                weight = np.linalg.lstsq((changes[1:] - changes[:-1]).T, changes[-1],
                                         rcond=1e-10)[0]
                better = ends[-1] - np.diff(np.array(ends), axis=0).T @ weight
                self.state = tuple(np.split(better, (n, 2 * n)))
        return found

    def start(self, motion):
        """From coefficients (0, c1, s1, ..) of the dofs."""
        order = np.arange(1, motion.shape[1] // 2 + 1)
        u = motion[:, 0] + motion[:, 1::2].sum(axis=1)
        # A pair that never slips stays where it was assembled.
        self.state = (u, self.omega * motion[:, 2::2] @ order, np.zeros(self.n_pairs))


def rate_by_time(groups, depth, motion):
    """Depth of a cycle of the vibration next to a motion."""
    joint = Joint(groups)
    joint.start(motion)
    return joint.rate(depth)


def worn_by_time(groups, cycles, motion):
    """Depths after so many cycles, by the classical method of order 4.

    motion: coefficients of the dofs, from which the first integration starts: of several vibrations
    the one that is meant.
    """
    joint = Joint(groups)
    joint.start(motion)
    depth, h = np.zeros(joint.n_pairs), cycles / STAGES
    for _ in range(STAGES):
        a = joint.rate(depth)
        b = joint.rate(depth + 0.5 * h * a)
        c = joint.rate(depth + 0.5 * h * b)
        d = joint.rate(depth + h * c)
        depth = depth + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return depth
