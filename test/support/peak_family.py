"""Random sweeps of few points with fixed seeds, and what their peaks really are.

The judge of linear chains is their sum over modes; that of others a sweep of this program that
leaves nothing between its rows, with a parabola through the highest of them.
"""
import h5py
import numpy as np
from cases import run

#: A reported peak is right within this part of the true one.
RIGHT = 1e-3
#: Points of a fine sweep in half of the narrowest width: a parabola through three of them is good
#: to the fourth power of their distance.
PER_HALF_WIDTH = 8
#: Words of /peak/found_by that say that a peak may not be the last word.
REMARKS = ("not resolved", "end of the sweep")


def _chain(rng, n_dof, ground):
    mass = rng.uniform(0.5, 2.0, n_dof)
    spring = 10.0 ** rng.uniform(0.0, 1.5, n_dof + 1)
    spring[-1] *= ground
    stiffness = np.diag(spring[:-1] + spring[1:])
    for j in range(1, n_dof):
        stiffness[j - 1, j] = stiffness[j, j - 1] = -spring[j]
    root = np.sqrt(mass)
    squares, shapes = np.linalg.eigh(stiffness / np.outer(root, root))
    return mass, stiffness, np.sqrt(squares), shapes / root[:, None]


def _groups(rng, mass, stiffness, omega, ratio, observe, points):
    load = np.zeros(len(mass))
    load[rng.integers(len(mass))] = 1.0
    start, end = omega[0] * rng.uniform(0.3, 0.8), omega[-1] * rng.uniform(1.1, 1.5)
    return {"case": {"analysis": "frf"},
            "model": {"n_dof": len(mass), "mass": np.diag(mass).ravel().tolist(),
                      "stiffness": stiffness.ravel().tolist(), "modal_damping": ratio},
            "load": {"cosine": load.tolist()}, "harmonics": {"n_harmonics": 3},
            "sweep": {"start": float(start), "end": float(end), "n_points": points},
            "output": {"observe": [observe + 1]}}


def linear(seed):
    """A chain of 2 to 4 masses: the case, and its highest amplitude by modes."""
    rng = np.random.default_rng(seed)
    n_dof = int(rng.integers(2, 5))
    mass, stiffness, omega, shapes = _chain(rng, n_dof, rng.integers(2))
    ratio = float(10.0 ** rng.uniform(-3.0, np.log10(0.02)))
    observe = int(rng.integers(n_dof))
    groups = _groups(rng, mass, stiffness, omega, ratio, observe, int(rng.choice([5, 11, 21, 41])))
    start, end = groups["sweep"]["start"], groups["sweep"]["end"]
    near = (omega[:, None] * (1.0 + ratio * np.linspace(-8.0, 8.0, 4001))).ravel()
    fine = np.concatenate([np.linspace(start, end, 20001), near])
    fine = fine[(fine >= start) & (fine <= end)]
    gains = shapes[observe] * (shapes.T @ np.array(groups["load"]["cosine"]))
    response = sum(gain / (w**2 - fine**2 + 2j * ratio * w * fine)
                   for gain, w in zip(gains, omega, strict=True))
    return groups, float(np.abs(response).max())


def nonlinear(seed):
    """One to three masses with a slider, friction, a stop or a cubic spring: the case and its
    family; the narrowest width of its modes as a part of the first frequency."""
    rng = np.random.default_rng(100_000 + seed)
    n_dof = int(rng.integers(1, 4))
    mass, stiffness, omega, _ = _chain(rng, n_dof, 0)
    ratio = float(10.0 ** rng.uniform(-2.5, -1.7))
    dof = int(rng.integers(n_dof))
    groups = _groups(rng, mass, stiffness, omega, ratio, dof, int(rng.choice([11, 21, 41])))
    family = str(rng.choice(["slider", "friction", "stop", "cubic spring"]))
    level = float(10.0 ** rng.uniform(-1.0, 1.0))
    typical = float(np.diag(stiffness).mean())
    if family == "cubic spring":
        groups["spring"] = {"n_springs": 1, "side_1": dof + 1, "power": 3,
                            "coefficient": typical * float(10.0 ** rng.uniform(-4.0, -2.0))}
        return groups, family, ratio
    pair = {"n_pairs": 1, "law": "dlft" if family == "friction" else "penalty"}
    if family == "stop":
        pair |= {"side_1": [0, 0, dof + 1], "mu": 0.0, "gap": 0.3 * level,
                 "normal_stiffness": typical * float(rng.uniform(0.2, 1.0))}
    else:
        pair |= {"side_1": [dof + 1, 0, 0], "mu": 0.5, "normal_load": level}
        if family == "slider":
            pair["tangential_stiffness"] = typical * float(rng.uniform(0.2, 2.0))
    groups["contact"] = pair
    if rng.random() < 0.3:
        sweep = groups["sweep"]
        sweep["start"], sweep["end"] = sweep["end"], sweep["start"]
    return groups, family, ratio


def fine_peak(folder, groups, ratio):
    """The highest amplitude of a sweep with points in every half-width, and a parabola on top;
    None where points of it fail."""
    sweep = groups["sweep"]
    spacing = ratio * min(sweep["start"], sweep["end"]) / PER_HALF_WIDTH
    points = int(abs(sweep["end"] - sweep["start"]) / spacing) + 2
    run(folder, {**groups, "sweep": {**sweep, "n_points": points}}, name="fine", status=(0, 4))
    with h5py.File(folder / "fine.h5") as file:
        if not file["converged"][:].all():
            return None
        omega, amplitude = file["omega"][:], file["amplitude"][:, 0]
    k = int(np.clip(amplitude.argmax(), 1, len(amplitude) - 2))
    if amplitude[k - 1:k + 2].min() <= 0.0:
        return float(amplitude.max())
    s, g = omega[k - 1:k + 2] ** 2, 1.0 / amplitude[k - 1:k + 2] ** 2
    a, b, _ = np.polyfit(s - s[1], g, 2)
    top = -0.5 * b / a
    least = g[1] - 0.25 * b * b / a if a > 0.0 else 0.0
    inside = least > 0.0 and min(s - s[1]) < top < max(s - s[1])
    return float(least**-0.5) if inside else float(amplitude.max())


def reported(path):
    """The highest amplitude that a result reports, and whether it says that this may not be the
    last word. A program without /peak reports its highest row, and nothing else."""
    with h5py.File(path) as file:
        if not file["converged"][:].all():
            return 0.0, True
        if "peak" not in file:
            return float(file["amplitude"][:, 0].max()), False
        amplitude, codes = file["peak/amplitude"][:], file["peak/found_by"][:]
        words = [name.decode() if isinstance(name, bytes) else str(name)
                 for name in file["peak/found_by"].attrs["names"]]
    known = [words[code] for code in codes]
    return (float(amplitude.max()),
            "not resolved" in known or known[int(amplitude.argmax())] in REMARKS)


def stands_elsewhere(path, true):
    """Whether a solution is reported, row or peak, above the highest of the fine sweep: one that
    this does not reach, because it jumps off its branch sooner or runs on another one."""
    with h5py.File(path) as file:
        highest = file["amplitude"][:, 0].max()
        if "peak" in file:  # not where nothing moves
            highest = max(highest, file["peak/amplitude"][:].max())
    return bool(highest > true * (1.0 + RIGHT))
