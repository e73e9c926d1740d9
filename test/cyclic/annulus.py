"""Random sectors, and the whole annulus of one as a case of its own, without any cyclic key."""
from __future__ import annotations

import numpy as np


def random_case(rng, *, law="penalty", planar=False, engine_order=None, n_sectors=None,
                n_pairs=None):
    """A sector without any symmetry, with masses and springs at random, contact across sectors and
    inside, as `cyclic_cases` takes it."""
    n_sectors = int(rng.choice([5, 6, 7, 12])) if n_sectors is None else n_sectors
    if engine_order is None:
        engine_order = int(rng.integers(-n_sectors - 1, n_sectors + 2))
    n_inner, n_interface = int(rng.integers(2, 4)), int(rng.integers(1, 3))
    n_pairs = int(rng.integers(1, 3)) if n_pairs is None else n_pairs
    directions = 3 if planar else 2
    # Interfaces, inner masses, then contact nodes: both sides of each pair.
    nodes = 2 * directions * n_pairs
    n = 2 * n_interface + n_inner + nodes
    first = 2 * n_interface + n_inner
    mass = np.diag(rng.uniform(0.5, 1.5, n))
    for i in range(2 * n_interface, first - 1):
        mass[i, i + 1] = mass[i + 1, i] = rng.uniform(0.0, 0.2)
    stiffness = np.zeros((n, n))

    def spring(i, j, k):
        stiffness[i, i] += k
        stiffness[j, j] += k
        stiffness[i, j] -= k
        stiffness[j, i] -= k

    for i in range(first):
        for j in range(i):
            if rng.random() < 0.6:
                spring(i, j, rng.uniform(0.2, 2.0))
        stiffness[i, i] += rng.uniform(0.2, 0.8)
    small = 0.02 if law in ("penalty", "regularised") else 0.0
    for i in range(first, n):
        mass[i, i] = small
        for j in rng.choice(first, 2, replace=False):
            spring(i, int(j), rng.uniform(2.0, 5.0))
    if law == "dlft_velocity" or law == "rigid":
        mass[range(first, n), range(first, n)] = 0.2
    damping = 0.02 * mass + 0.012 * stiffness
    contact = {"side_1": [], "side_2": [], "sector_2": [], "mu": [], "gap": []}
    for i in range(n_pairs):
        dofs = first + 1 + directions * 2 * i + np.arange(2 * directions)
        a, b = dofs[:directions], dofs[directions:]
        sign = int(rng.choice([-1, 1]))
        for side, at in (("side_1", a), ("side_2", b)):
            t2 = int(at[2]) if planar else 0
            contact[side].append([int(at[0]), t2, sign * int(at[1])])
        contact["sector_2"].append(int(rng.choice([0, 1, -1])) if i else int(rng.choice([1, -1])))
        contact["mu"].append(float(rng.uniform(0.2, 0.5)))
        contact["gap"].append(float(-rng.uniform(0.03, 0.1)))
    if law == "penalty":
        contact["tangential_stiffness"] = rng.uniform(1.0, 4.0, n_pairs).tolist()
    if law in ("penalty", "regularised"):
        contact["normal_stiffness"] = rng.uniform(2.0, 6.0, n_pairs).tolist()
    if law == "regularised":
        contact["slip_speed"] = rng.uniform(0.1, 0.3, n_pairs).tolist()
    load = {key: np.zeros(n) for key in ("static", "cosine", "sine")}
    load["static"][first - 1] = 0.03
    for key in ("cosine", "sine"):
        load[key][:first] = rng.normal(size=first) * 0.15
    right = [int(n_interface + 1 + i) * int(rng.choice([-1, 1])) for i in range(n_interface)]
    return {
        "n_sectors": n_sectors, "engine_order": engine_order, "n_harmonics": 5, "law": law,
        "model": {"mass": mass.tolist(), "stiffness": stiffness.tolist(),
                  "damping": damping.tolist(),
                  "left": list(range(1, n_interface + 1)), "right": right},
        "contact": contact, "load": {key: values.tolist() for key, values in load.items()}}


def mistuned(rng, case, spread=0.3):
    """The case with contact data that differ from sector to sector by up to a part of them."""
    contact = dict(case["contact"])
    n = case["n_sectors"] * len(contact["side_1"])
    for key in set(contact) - {"side_1", "side_2", "sector_2"}:
        factors = 1.0 + spread * rng.uniform(-1.0, 1.0, n)
        contact[key] = (np.tile(contact[key], case["n_sectors"]) * factors).tolist()
    return {**case, "mistuned": True, "contact": contact}


class Annulus:
    """All sectors of a case as one structure: its dofs are those of the sectors but the right
    interfaces, sector by sector."""

    def __init__(self, case):
        model = case["model"]
        self.n_sectors, self.n = case["n_sectors"], len(model["mass"])
        self.right = {abs(r) - 1: (left - 1, int(np.sign(r)))
                      for left, r in zip(model.get("left", []), model.get("right", []))}
        self.inner = [i for i in range(self.n) if i not in self.right]
        place = {i: p for p, i in enumerate(self.inner)}
        size = self.n_sectors * len(self.inner)
        #: Of every sector, from its dofs to those of the annulus.
        self.maps = []
        for j in range(self.n_sectors):
            t = np.zeros((self.n, size))
            for i in range(self.n):
                source, sign, sector = i, 1, j
                if i in self.right:
                    (source, sign), sector = self.right[i], (j + 1) % self.n_sectors
                t[i, sector * len(self.inner) + place[source]] = sign
            self.maps.append(t)
        self.case = self._case(case)

    def dof(self, sector, signed):
        """Signed dof of the annulus for one of a sector."""
        if signed == 0:
            return 0
        row = self.maps[sector % self.n_sectors][abs(signed) - 1]
        place = int(np.abs(row).argmax())
        return int(np.sign(signed) * row[place]) * (place + 1)

    def _case(self, case):
        model, n = case["model"], self.n_sectors
        whole = {key: case[key] for key in ("n_harmonics", "law")}
        whole["model"] = {
            key: sum(t.T @ np.array(model[key]) @ t for t in self.maps).tolist()
            for key in ("mass", "stiffness", "damping")}
        load = {key: np.array(values) for key, values in case["load"].items()}
        force = load["cosine"] - 1j * load["sine"]
        phase = 2.0 * np.pi * case["engine_order"] / n
        whole["load"] = {"static": sum(t.T @ load["static"] for t in self.maps).tolist()}
        delayed = sum(t.T @ (force * np.exp(-1j * j * phase)) for j, t in enumerate(self.maps))
        whole["load"] |= {"cosine": delayed.real.tolist(), "sine": (-delayed.imag).tolist()}
        if "waves" in case:
            whole["waves"] = {
                h: sum(t.T @ (np.asarray(f) * np.exp(-1j * h * j * phase))
                       for j, t in enumerate(self.maps))
                for h, f in case["waves"].items()}
        pairs = case["contact"]
        # Values of all sectors, or of one for all.
        contact = {key: values * (n * len(pairs["side_1"]) // len(values))
                   for key, values in pairs.items()
                   if key not in ("side_1", "side_2", "sector_2")}
        contact["side_1"] = [[self.dof(j, d) for d in side]
                             for j in range(n) for side in pairs["side_1"]]
        contact["side_2"] = [[self.dof(j + s, d) for d in side]
                             for j in range(n)
                             for side, s in zip(pairs["side_2"], pairs["sector_2"])]
        whole["contact"] = contact
        return whole

    def sector(self, coefficients, j=0):
        """Coefficients of all dofs of a sector (.., n) from those of the annulus."""
        return coefficients @ self.maps[j].T
