"""Write what the three programs of this directory take for their own model, as plain numbers.

    export_model.py ../blade_sector/sector_16.h5 sector.dat

A host program has its matrices in memory already; these read them from a file that any language can
read. Seventeen digits give back every bit.
"""
import sys

import h5py
import numpy as np

REALS = ["mass", "stiffness", "stiffness_rotation", "load/static", "load/static_rotation",
         "load/cosine", "load/sine", "contact/mu", "contact/gap", "contact/area"]
INTEGERS = ["contact/side_1", "contact/side_2"]


def main(model_path, data_path):
    with h5py.File(model_path) as model, open(data_path, "w", encoding="ascii") as data:
        n_dof, n_pairs = model["mass"].shape[0], model["contact/mu"].size
        print(n_dof, n_pairs, file=data)
        for name in REALS:
            np.savetxt(data, model[name][()].ravel(), fmt="%.17g")
        for name in INTEGERS:
            np.savetxt(data, model[name][()].ravel(), fmt="%d")
        tip = list(model["observe/name"].asstr()).index("tip")
        np.savetxt(data, model["observe/matrix"][tip], fmt="%.17g")


if __name__ == "__main__":
    main(*sys.argv[1:])
