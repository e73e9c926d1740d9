"""Random worn joints: coupled masses in a row, every second of which presses a contact."""
import numpy as np

LAWS = ("penalty", "dlft", "dlft_velocity")


def own(size, gaps):
    """One to three pairs on a row of coupled masses: (groups, their number of pairs)."""
    n_pairs = int(size.integers(1, 4))
    n = 2 * n_pairs
    stiffness = np.diag(size.uniform(0.3, 2.0, n))
    for i in range(n - 1):
        stiffness[i:i + 2, i:i + 2] += size.uniform(0.05, 0.6) * np.array([[1, -1], [-1, 1]])
    mass = np.diag(size.uniform(0.5, 1.5, n))
    static, cosine, sine = np.zeros((3, n))
    static[1::2] = -size.uniform(0.3, 1.6, n_pairs)
    cosine[0::2] = size.uniform(-0.6, 0.6, n_pairs)
    cosine[1::2] = size.uniform(-0.2, 0.2, n_pairs)
    sine[0::2] = size.uniform(-0.3, 0.3, n_pairs)
    side = np.zeros((n_pairs, 3), int)
    side[:, 0], side[:, 2] = np.arange(1, n, 2), np.arange(2, n + 1, 2)
    contact = {"n_pairs": n_pairs, "side_1": side.ravel(), "mu": size.uniform(0.2, 0.7, n_pairs),
               "area": np.exp(size.uniform(np.log(0.1), np.log(8.0), n_pairs))}
    if gaps and size.random() < 0.5:
        contact["gap"] = -size.uniform(0.0, 0.3, n_pairs)
    return {
        "case": {"analysis": "wear", "threads": 1},
        "model": {"n_dof": n, "mass": mass, "stiffness": stiffness,
                  "damping": size.uniform(0.005, 0.03) * stiffness
                  + size.uniform(0.0, 0.01) * mass},
        "contact": contact, "load": {"static": static, "cosine": cosine, "sine": sine},
        "harmonics": {"n_harmonics": int(size.choice([5, 7, 9]))},
        "sweep": {"start": float(size.uniform(0.8, 2.0))},
        "wear": {"coefficient": float(np.exp(size.uniform(np.log(1e-6), np.log(5e-4)))),
                 "law": str(size.choice(["archard", "energy"]))}}


def elastic(size, groups):
    """The law of springs with friction, its stiffness of the order of the structure's."""
    n_pairs = groups["contact"]["n_pairs"]
    groups["contact"].update(
        law="penalty",
        tangential_stiffness=np.exp(size.uniform(np.log(0.5), np.log(4.0), n_pairs)),
        normal_stiffness=np.exp(size.uniform(np.log(0.5), np.log(5.0), n_pairs)))
    return groups
