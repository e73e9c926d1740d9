"""Random deviations of sectors: as parts of a model file, and as matrices of every sector."""
from __future__ import annotations

import h5py
import numpy as np
from annulus import Annulus

WAYS = ("rows", "blade", "sectors", "full", "together")


def low_rank(rng, n, rank, size):
    """Symmetric and positive, on some dofs."""
    dofs = rng.choice(n, size=int(rng.integers(1, n + 1)), replace=False)
    a = np.zeros((rank, n))
    a[:, dofs] = rng.normal(size=(rank, len(dofs)))
    return size * a.T @ a / n


def draw(rng, case, way, size):
    """Parts of /mistuning, and dK, dM, dC of each sector (n_sectors, n, n)."""
    n, n_sectors = len(case["model"]["mass"]), case["n_sectors"]
    parts = {}
    change = {key: np.zeros((n_sectors, n, n)) for key in ("stiffness", "mass", "damping")}
    scale = float(rng.choice([1.0, 0.5, -1.0]))
    if way in ("rows", "together"):
        r = int(rng.integers(1, 4))
        rows = 0.5 * rng.normal(size=(r, n))
        if rng.random() < 0.3:
            rows[0] = np.eye(n)[int(rng.integers(n))]
        omega = rng.uniform(0.8, 3.0, r)
        d = size * rng.uniform(-1.0, 1.0, (n_sectors, r))
        z = 0.1 * size * rng.uniform(0.0, 1.0, (n_sectors, r))
        if rng.random() < 0.3:
            d = np.repeat(d[:, :1], r, axis=1)
            parts["frequency"] = d[:, 0]
        else:
            parts["frequency"] = d
        parts |= {"rows": rows, "row_omega": omega, "damping_ratio": z}
        for j in range(n_sectors):
            change["stiffness"][j] += rows.T @ np.diag(
                omega**2 * ((1.0 + scale * d[j])**2 - 1.0)) @ rows
            change["damping"][j] += rows.T @ np.diag(2.0 * omega * scale * z[j]) @ rows
    if way in ("blade", "together"):
        parts["blade_stiffness"] = low_rank(rng, n, int(rng.integers(1, 4)), 3.0)
        parts["blade_mass"] = low_rank(rng, n, int(rng.integers(1, 4)), 0.2)
        parts["stiffness"] = size * rng.uniform(-1.0, 1.0, n_sectors)
        parts["mass"] = size * rng.uniform(0.0, 1.0, n_sectors) * np.sign(scale)
        for key in ("stiffness", "mass"):
            change[key] += scale * parts[key][:, None, None] * parts[f"blade_{key}"]
    for j in range(n_sectors):
        if way not in ("sectors", "full", "together") or rng.random() < 0.3:
            continue
        full = way == "full" or (way == "together" and rng.random() < 0.5)
        for key, part in (("stiffness", 2.0), ("mass", 0.2), ("damping", 0.02)):
            if rng.random() < 0.3:
                continue
            own = size * low_rank(rng, n, int(rng.integers(1, n + 1)), part)
            own *= np.sign(scale) if key != "stiffness" else 1.0
            change[key][j] += scale * own
            parts[f"sector/{j}/{key}"] = own + np.array(case["model"][key]) if full else own
        if full and any(name.startswith(f"sector/{j}/") for name in parts):
            parts[f"sector/{j}@kind"] = "full"
    return parts, scale, change


def write(path, case, parts):
    """The sector with its deviations as a model file."""
    model, contact = case["model"], case["contact"]
    found = {key: model[key] for key in ("mass", "stiffness", "damping")}
    found |= {f"load/{key}": value for key, value in case["load"].items()}
    found |= {f"contact/{key}": value for key, value in contact.items()} \
        if len(contact["side_1"]) else {}
    found |= {f"mistuning/{key}": value for key, value in parts.items()}
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        file.require_group("cyclic").attrs["n_sectors"] = case["n_sectors"]
        file["cyclic/left"], file["cyclic/right"] = model["left"], model["right"]
        for name, values in found.items():
            group, _, attribute = name.partition("@")
            if attribute:
                file.require_group(group).attrs[attribute] = values
            else:
                file[name] = np.array(values)


def annulus(case, change):
    """All sectors as one structure, each with matrices of its own."""
    whole = Annulus(case)
    for key, matrices in change.items():
        whole.case["model"][key] = (np.array(whole.case["model"][key]) + sum(
            t.T @ matrix @ t for t, matrix in zip(whole.maps, matrices))).tolist()
    return whole
