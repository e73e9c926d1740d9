"""Model file (HDF5, format_version 1) of a reduced sector of the shrouded disk."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..mesh import RecoveryMesh, mesh_datasets
from ..model_file import strings, write_model_file
from ..stress import Stress
from .blades import Blade
from .model import ReducedDisk
from .parameters import DiskParameters

__all__ = ["read_parameters", "write_model"]

UNIT_SYSTEM = "mm-tonne-s-N"


def write_model(model: ReducedDisk, path: str | Path, title: str | None = None,
                mesh: RecoveryMesh | None = None, blade: Blade | None = None,
                stress: Stress | None = None) -> None:
    """Write a reduced sector as a model file.

    Parameters
    ----------
    model : ReducedDisk
        The sector.
    path : str or Path
        Target; an older file of that name is replaced once the new one is complete.
    title : str, optional
        Title attribute.
    mesh : RecoveryMesh, optional
        Written as group /mesh. Without it `fretwear export` generates the mesh again.
    blade : Blade, optional
        Written as group /mistuning: what the blades may differ by.
    stress : Stress, optional
        Written as group /stress.
    """
    datasets = _datasets(model)
    if mesh is not None:
        datasets.update(mesh_datasets(mesh))
    if blade is not None:
        datasets.update(blade.datasets())
    if stress is not None:
        datasets.update(stress.datasets())
    p = model.parameters
    write_model_file(
        path, datasets, title=title or f"Shrouded disk, one of {p.n_sectors} sectors",
        unit_system=UNIT_SYSTEM, groups={"cyclic": {"n_sectors": p.n_sectors}},
        # The parameters are not part of the format; they make the file reproducible.
        attributes={"disk_parameters": json.dumps(asdict(p))})


def read_parameters(path: str | Path) -> DiskParameters:
    """Parameters from which a model file was generated."""
    with h5py.File(path, "r") as file:
        if "disk_parameters" not in file.attrs:
            raise ValueError(f"{path}: no attribute 'disk_parameters'; it was not written by "
                             "fretwear.disk")
        return DiskParameters(**json.loads(bytes(file.attrs["disk_parameters"])))


def _datasets(model: ReducedDisk) -> dict[str, NDArray[Any]]:
    """Datasets of the model file by name."""
    n, n_pairs, p = len(model.mass), len(model.area), model.parameters
    load, observe = np.zeros(n), np.zeros((2, n))
    load[model.load_point - 1] = 1.0
    observe[0, model.tip - 1] = observe[1, model.load_point - 1] = 1.0
    return {
        "mass": model.mass,
        "stiffness": model.stiffness,
        # Single precision, of a part that moves frequencies by some percent: half of the bytes.
        "stiffness_rotation": model.stiffness_rotation.astype(np.float32),
        "cyclic/left": model.left,
        "cyclic/right": model.right,
        "contact/side_1": model.side_1,
        "contact/side_2": model.side_2,
        "contact/sector_2": np.ones(n_pairs, dtype=np.int32),
        "contact/mu": np.full(n_pairs, p.mu),
        "contact/gap": np.full(n_pairs, -p.interference),
        "contact/area": model.area,
        "contact/position": model.position,
        "contact/patch": strings(["shroud"] * n_pairs),
        "load/static": np.zeros(n),
        "load/cosine": load,
        "load/sine": np.zeros(n),
        "load/static_rotation": model.static_rotation,
        "observe/name": strings(["tip", "load_point"]),
        "observe/matrix": observe,
    }
