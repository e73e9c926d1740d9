"""Random small structures with friction, a gap or a cubic spring; branch against fine sweeps."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KINDS = ("friction", "gap", "cubic")
# Points of the natural sweeps that a branch is held against.
FINE = 801
# How far a solution may be from the cubics through the rows of a branch, of its size: those have
# tangents from differences only. In omega, what counts as near.
NEAR, NEAR_OMEGA = 0.05, 0.005
# Two solutions of one frequency.
DIFFERENT = 0.1
# Places at which a cubic is looked at.
PLACES = 24


@dataclass
class Joint:
    """A structure with one nonlinear element, as text of a namelist."""

    kind: str
    text: str
    start: float
    end: float

    def case(self, n_points, continuation, backwards=False):
        ends = (self.end, self.start) if backwards else (self.start, self.end)
        return (f"&case title = '{self.kind}' analysis = 'frf' /\n{self.text}"
                f"&sweep start = {ends[0]!r}, end = {ends[1]!r}, n_points = {n_points}, "
                f"continuation = '{continuation}' /\n")


def row(values):
    return ", ".join(repr(float(x)) for x in np.ravel(values))


def random_joint(seed):
    """1 to 3 masses, damping of 0.5 to 5 %, the element at the first mass."""
    rng = np.random.default_rng(10_000 + seed)
    kind = KINDS[seed % len(KINDS)]
    n = int(rng.integers(1, 4))
    springs = rng.uniform(0.5, 2, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) \
        - np.diag(springs[1:-1], -1)
    square, modes = np.linalg.eigh(stiffness)
    omega = np.sqrt(square)
    ratio = 10 ** rng.uniform(np.log10(0.005), np.log10(0.05), n)
    damping = modes @ np.diag(2 * ratio * omega) @ modes.T
    # About what the element sees at the first resonance.
    size = 1 / (2 * ratio[0] * square[0])
    text = (f"&model n_dof = {n}, mass = {row(np.eye(n))}, stiffness = {row(stiffness)},\n"
            f"   damping = {row(damping)} /\n&load cosine = {row([1.0] + [0.0] * (n - 1))} /\n")
    top = omega[0]
    if kind == "friction":
        k = rng.uniform(0.3, 2) * springs[0]
        text += (f"&contact n_pairs = 1, law = 'penalty', side_1 = 1, 0, 0, mu = 0.5,\n"
                 f"   normal_load = {float(k * size * 10 ** rng.uniform(-1.5, -0.2))!r},\n"
                 f"   tangential_stiffness = {float(k)!r} /\n&harmonics n_harmonics = 5 /\n")
        top = np.sqrt(np.linalg.eigvalsh(stiffness + k * np.diag([1.0] + [0.0] * (n - 1)))[0])
    elif kind == "gap":
        k = rng.uniform(0.2, 1.5) * springs[0]
        text += (f"&contact n_pairs = 1, law = 'penalty', side_1 = 0, 0, -1, mu = 0,\n"
                 f"   gap = {float(size * rng.uniform(0.1, 0.8))!r},\n"
                 f"   normal_stiffness = {float(k)!r} /\n&harmonics n_harmonics = 5 /\n")
        top = 1.2 * omega[0]
    else:
        strength = rng.uniform(0.02, 0.3) * square[0] / size**2 * rng.choice([-0.3, 1.0, 1.0])
        text += (f"&spring n_springs = 1, side_1 = 1, coefficient = {float(strength)!r} /\n"
                 f"&harmonics n_harmonics = 5 /\n")
        top = 1.3 * omega[0]
    return Joint(kind, text, float(0.6 * omega[0]), float(1.3 * top))


def curve(omega, x, tangent=None):
    """Places along the cubics through rows and tangents. Of a branch without tangents: with those of
    parabolas through three rows, and along straight lines, for at a corner these are of no use."""
    scale = np.maximum(np.linalg.norm(x, axis=1), 1e-3 * np.linalg.norm(x, axis=1).max())
    z = np.column_stack([omega, x])
    middle = 0.5 * (scale[1:] + scale[:-1])
    step = np.hypot(np.linalg.norm(np.diff(x, axis=0), axis=1) / middle,
                    np.diff(omega) / (omega.max() - omega.min()))
    s = np.concatenate([[0], np.cumsum(np.maximum(step, 1e-12))])
    u = np.linspace(0, 1, PLACES, endpoint=False)[None, :, None]
    h = np.diff(s)[:, None, None]
    a, b = z[:-1, None], z[1:, None]
    if tangent is None:
        slope = np.gradient(z, s, axis=0, edge_order=1)
        ends = slope[:-1], slope[1:]
    else:
        # Tangents of any length: those of the step have the length one in its scales.
        scale = np.column_stack([np.full(len(step), np.ptp(omega)),
                                 np.repeat(middle[:, None], x.shape[1], axis=1)])
        ends = [side / np.linalg.norm(side / scale, axis=1)[:, None]
                for side in (tangent[:-1], tangent[1:])]
        cosine = (ends[0] * ends[1] / scale**2).sum(axis=1)
        h = h * (1 + (1 - np.maximum(cosine, 0)) / 12)[:, None, None]
    places = ((1 + 2 * u) * (1 - u)**2 * a + u**2 * (3 - 2 * u) * b
              + h * u * (1 - u) * ((1 - u) * ends[0][:, None] - u * ends[1][:, None]))
    kinds = [places] if tangent is not None else [places, (1 - u) * a + u * b]
    return [np.vstack([kind.reshape(-1, z.shape[1]), z[-1:]]) for kind in kinds]


def distances(omega, x, at, points, tangent=None):
    """Of solutions from a branch, over their size."""
    return np.min([distances_from(places[:, 0], places[:, 1:], at, points)
                   for places in curve(omega, x, tangent)], axis=0)


def distances_from(along, values, at, points):
    result = np.empty(len(at))
    for i, (w, point) in enumerate(zip(at, points, strict=True)):
        size = max(np.linalg.norm(point), 1e-300)
        left, right = along[:-1], along[1:]
        k = np.flatnonzero((left - w) * (right - w) <= 0)
        share = (w - left[k]) / np.where(right[k] == left[k], 1, right[k] - left[k])
        across = values[k] + share[:, None] * (values[k + 1] - values[k])
        at_omega = np.linalg.norm(across - point, axis=1).min(initial=np.inf)
        near = np.abs(along - w) <= NEAR * NEAR_OMEGA * w
        beside = np.linalg.norm(values[near] - point, axis=1).min(initial=np.inf)
        result[i] = min(at_omega, beside) / size
    return result


def several(up, down):
    """Frequencies at which sweeps both ways give different solutions: between folds."""
    (omega, good, x, *_), (_, other_good, other, *_) = up, [part[::-1] for part in down]
    x, other = x.reshape(len(omega), -1), other.reshape(len(omega), -1)
    size = np.maximum(np.linalg.norm(x, axis=1), np.linalg.norm(other, axis=1))
    return omega[good & other_good & (np.linalg.norm(x - other, axis=1) > DIFFERENT * size)]


@dataclass
class Verdict:
    """What is wrong with a branch."""

    n_points: int = 0
    incomplete: bool = False
    off: int = 0
    missed: int = 0


def judge(joint, branch, sweeps, status):
    """branch and sweeps: (omega, converged, coefficients (n, 2H+1, n_dof), fold), and the tangents of
    a branch that has them (omega and coefficients in a row)."""
    omega, converged, x, fold, *tangent = branch
    x = x.reshape(len(omega), -1)
    tangent = tangent[0] if tangent else None
    verdict = Verdict(len(omega))
    verdict.incomplete = status != 0 or not converged.all() or abs(omega[-1] / joint.end - 1) > 1e-9
    for at, good, points, *_ in sweeps:
        points = points.reshape(len(at), -1)
        inside = good & (at <= omega.max()) & (at >= omega.min())
        verdict.off += int((distances(omega, x, at[inside], points[inside], tangent) > NEAR).sum())
    folds = omega[fold]
    step = 3 * abs(at[1] - at[0])
    verdict.missed = sum(not (len(folds) and folds.min() - step <= w <= folds.max() + step)
                         for w in several(*sweeps))
    return verdict
