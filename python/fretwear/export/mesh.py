"""Meshes on which the displacement of a reduced model can be shown.

A model file may hold the group `/mesh`. A sector model without it says from which parameters it
was generated; then the mesh is generated again.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from ..errors import InputError, OutputError
from ..mesh import Floats, RecoveryMesh, mesh_datasets, mesh_of_group

__all__ = ["RecoveryMesh", "mesh_datasets", "read_mesh"]


def read_mesh(path: Path) -> RecoveryMesh:
    """Mesh of a model file, generated again for a sector model that does not hold it.

    Raises
    ------
    OutputError
        The file cannot be read.
    InputError
        There is no mesh, or its datasets do not fit each other.
    """
    try:
        with h5py.File(path, "r") as file:
            if "stiffness" not in file:
                raise InputError(f"{path}: holds matrices of nodal diameters, whose coordinates "
                                 "are no displacements of one mesh")
            n_dof = len(file["stiffness"])
            if "mesh" in file:
                return mesh_of_group(file["mesh"], path, n_dof)
            is_disk = "disk_parameters" in file.attrs
            # Of fretwear.sector; fretwear.beam leaves parameters too, and has no mesh.
            is_sector = b'"geometry"' in bytes(file.attrs.get("parameters", b""))
            if not is_sector and not is_disk:
                raise InputError(f"{path}: holds no group /mesh, so there is nothing to show a "
                                 "displacement on (docs/files.md says what it holds)")
            observe = file["observe/matrix"][()]
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error}") from None
    return _regenerated(path, observe, is_disk)


def _regenerated(path: Path, observe: Floats, is_disk: bool) -> RecoveryMesh:
    try:
        made = _disk_mesh(path) if is_disk else _sector_mesh(path)
    except ImportError as error:
        raise InputError(f"{path}: holds no group /mesh, and generating it again needs "
                         f"scikit-fem ({error})") from None
    mesh, tip = made
    # Of the order of what another order of summation changes; another generator is far off.
    if tip.shape != observe.shape or np.abs(tip - observe).max() > 1e-6 * np.abs(observe).max():
        raise InputError(f"{path}: this version of the generator does not give its coordinates; "
                         "write the model again, with --mesh")
    return mesh


def _sector_mesh(path: Path) -> tuple[RecoveryMesh, Floats]:
    from ..sector import build_full, read_parameters
    from ..sector.recovery import recovery_mesh

    mesh, rows = recovery_mesh(build_full(read_parameters(path)))
    return mesh, rows


def _disk_mesh(path: Path) -> tuple[RecoveryMesh, Floats]:
    from ..disk import build_full, read_parameters
    from ..disk.recovery import recovery_mesh

    mesh, rows = recovery_mesh(build_full(read_parameters(path)))
    return mesh, rows
