"""Model files of cyclic structures, written as the user guide says."""
from __future__ import annotations

import h5py
import numpy as np


def _pair(values):
    """Real and imaginary part in the last dimension."""
    values = np.asarray(values, dtype=complex)
    return np.stack([values.real, values.imag], axis=-1)


def write_nodal_file(path, n_sectors, n_physical, diameters, *, phase="delay", load=None,
                     contact=None, observe=None):
    """Matrices of nodal diameters: {K: {"mass": .., "load/cosine": ..}}."""
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "fretwear-model"
        file.attrs["format_version"] = 1
        group = file.create_group("cyclic")
        group.attrs["n_sectors"] = n_sectors
        group.attrs["n_physical"] = n_physical
        if phase != "delay":
            group.attrs["phase"] = phase
        for k, parts in diameters.items():
            for name, values in parts.items():
                values = np.conj(values) if phase == "advance" else values
                file[f"nodal_diameter/{k}/{name}"] = _pair(values)
        for name, values in (load or {}).items():
            file[f"load/{name}"] = values
        for name, values in (contact or {}).items():
            file[f"contact/{name}"] = values
        if observe is not None:
            file["observe/name"] = np.array(observe, dtype="S8")


def tied(case, k):
    """Matrices of a sector tied in nodal diameter k, its loads and rows of all its dofs."""
    model = case["model"]
    n = len(model["mass"])
    right = [abs(r) - 1 for r in model.get("right", [])]
    kept = [i for i in range(n) if i not in right]
    t = np.zeros((n, len(kept)), dtype=complex)
    for column, i in enumerate(kept):
        t[i, column] = 1.0
    z = np.exp(-2j * np.pi * k / case["n_sectors"])
    for left, signed in zip(model.get("left", []), model.get("right", [])):
        t[abs(signed) - 1, kept.index(left - 1)] = np.sign(signed) * z
    parts = {key: t.conj().T @ np.array(model[key]) @ t for key in ("mass", "stiffness", "damping")}
    parts |= {f"load/{key}": t.conj().T @ np.array(values) for key, values in case["load"].items()}
    return parts | {"observe/matrix": t}, kept
