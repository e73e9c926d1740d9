"""Random cylinders in partial slip, by the defaults, against what has to be left in the end."""
from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import numpy as np
from cases import read, run
from project import PROGRAM
from scar_cases import Scar, groups, left_in_the_end

from fretwear.halfplane import Cylinder, PartialSlip, partial_slip

#: Of the largest depth, and of the volume: what the page promises.
RIGHT = 1e-3
WORDS = ("right", "right, with a remark", "wrong, with a remark", "wrong without a word",
         "not reached")


def random_cylinder(seed):
    """A case and its number of cells."""
    rng = np.random.default_rng([seed, 41])
    one = Cylinder(radius=10.0**float(rng.uniform(0.0, 1.7)),
                   young=10.0**float(rng.uniform(4.7, 5.5)), poisson=float(rng.uniform(0.2, 0.4)),
                   load=10.0**float(rng.uniform(0.5, 1.7)), mu=float(rng.uniform(0.2, 1.0)))
    case = PartialSlip(one, float(rng.uniform(0.2, 0.8)) * one.mu * one.load)
    reach = int(np.ceil(1.5 * case.scar_half_width / case.stick_half_width))
    return case, 2 * reach * int(rng.integers(6, 15))


def verdict(folder, seed, n_harmonics=7, program=PROGRAM):
    """One of WORDS, the largest error of the profile over the largest depth, and the remarks."""
    case, n = random_cylinder(seed)
    model = partial_slip(case, n=n)
    model.to_hdf5(folder / "model.h5")
    one, cell = case.cylinder, float(np.asarray(model.contact.area)[0])
    scar = Scar(n, cell, one.contact_modulus, one.radius, one.load, one.mu, case.tangential_load)
    true, _ = left_in_the_end(scar)
    keys = groups(scar, n_harmonics)
    keys["wear"].pop("steady_tolerance")
    run(folder, keys, status=(0, 4), program=program, seconds=600)
    found = read(folder / "case.h5")
    remarks = [name.decode() for name in found.get("remarks/name", [])]
    depth = found["wear/depth"][-1]
    error = float(abs(depth - true).max() / true.max())
    if found["wear"]["steady_state"] not in ("reached", b"reached"):
        return WORDS[4], error, remarks
    right = error <= RIGHT and abs(depth.sum() / true.sum() - 1.0) <= RIGHT
    return WORDS[(0 if right else 3) if not remarks else (1 if right else 2)], error, remarks
