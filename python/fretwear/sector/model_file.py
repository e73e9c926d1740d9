"""Model file (HDF5, format_version 1) of a reduced sector.

The contact coordinates are degrees of freedom of the reduced model: side_1 holds their numbers
and side_2 is the ground.
"""

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
from .model import ReducedModel
from .parameters import Discretisation, Geometry, Material, Retention, SectorParameters

__all__ = ["read_parameters", "write_model"]

UNIT_SYSTEM = "mm-tonne-s-N"


def write_model(model: ReducedModel, path: str | Path, title: str | None = None,
                mesh: RecoveryMesh | None = None, stress: Stress | None = None) -> None:
    """Write a reduced sector as a model file.

    Parameters
    ----------
    model : ReducedModel
        The sector.
    path : str or Path
        Target; an older file of that name is replaced once the new one is complete.
    title : str, optional
        Title attribute.
    mesh : RecoveryMesh, optional
        Written as group /mesh. Without it `fretwear export` generates the mesh again.
    stress : Stress, optional
        Written as group /stress.
    """
    datasets = _datasets(model)
    if mesh is not None:
        datasets.update(mesh_datasets(mesh))
    if stress is not None:
        datasets.update(stress.datasets())
    default = f"Bladed-disk sector with a dovetail root, {model.n_pairs} contact pairs"
    if model.parameters.retention.retention > 0.0:
        default += f", axial lock of {model.parameters.retention.retention:g} N/mm"
    # The parameters are not part of the format; they make the file reproducible.
    write_model_file(path, datasets, title=title or default, unit_system=UNIT_SYSTEM,
                     attributes={"parameters": json.dumps(asdict(model.parameters))})


def read_parameters(path: str | Path) -> SectorParameters:
    """Parameters from which a model file was generated."""
    with h5py.File(path, "r") as file:
        groups = json.loads(bytes(file.attrs.get("parameters", b"{}")))
    if "geometry" not in groups:
        raise ValueError(f"{path}: no attribute 'parameters' of a sector; it was not written by "
                         "fretwear.sector")
    return SectorParameters(Geometry(**groups["geometry"]), Material(**groups["material"]),
                            Discretisation(**groups["discretisation"]),
                            # Files of a blade without a lock may not have this group.
                            Retention(**groups.get("retention", {})))


def _datasets(model: ReducedModel) -> dict[str, NDArray[Any]]:
    """Datasets of the model file by name."""
    n_pairs, n = model.n_pairs, len(model.mass)
    return {
        "mass": model.mass,
        "stiffness": model.stiffness,
        "stiffness_rotation": model.stiffness_rotation,
        "contact/side_1": np.arange(1, 3 * n_pairs + 1, dtype=np.int32).reshape(n_pairs, 3),
        "contact/side_2": np.zeros((n_pairs, 3), dtype=np.int32),
        "contact/mu": np.full(n_pairs, model.parameters.material.mu),
        "contact/gap": np.zeros(n_pairs),
        "contact/area": model.area,
        "contact/position": model.position,
        "contact/patch": strings(model.patch),
        "load/static": np.zeros(n),
        "load/cosine": model.cosine,
        "load/sine": np.zeros(n),
        "load/static_rotation": model.static_rotation,
        "observe/name": strings(model.observe_name),
        "observe/matrix": model.observe_matrix,
    }
