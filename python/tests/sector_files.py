"""A sector of the shrouded disk as files of another program: matrices, labels, node tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp

from fretwear.disk import DiskParameters, FullDisk
from fretwear.sector.assembly import Assembly

__all__ = ["SMALL", "command", "write_sector"]

#: Few elements; what is tested is the way of the matrices, not the disk.
SMALL = DiskParameters(n_sectors=12, blade_angle=8.0, disk_rows=1, blade_rows=1, axial_layers=1,
                       side_columns=1, radial_patches=1, axial_patches=1, n_modes=20)


def write_sector(full: FullDisk, path: Path) -> None:
    """Matrices in Cartesian components, with labels and tables of the interface nodes."""
    scipy.io.mmwrite(path / "mass.mtx", sp.coo_array(full.mass), symmetry="symmetric")
    scipy.io.mmwrite(path / "stiffness.mtx", sp.coo_array(full.stiffness), symmetry="symmetric")
    lines = [f"{i + 1} {dof // 3 + 1} {dof % 3 + 1}" for i, dof in enumerate(full.free)]
    (path / "labels.txt").write_text("\n".join(["eq node component", *lines]))
    nodes = Assembly(full.sector.mesh, full.parameters.material).nodes
    n = full.n_interface
    for side, rows in (("left", full.rows[:n]), ("right", full.rows[n:2 * n])):
        found = np.unique(full.free[np.unique(rows.tocoo().col)] // 3)
        # Another order on either side.
        found = found[::-1] if side == "right" else found
        table = [f"{k + 1}, {', '.join(f'{x:.12g}' for x in nodes[:, k])}" for k in found]
        (path / f"{side}.csv").write_text("\n".join(["node, x, y, z", *table]))


def command(folder: Path, *more: str) -> list[str]:
    """Import of that sector."""
    return ["import", str(folder / "mass.mtx"), str(folder / "stiffness.mtx"), "--labels",
            str(folder / "labels.txt"), "--sectors", "12", "--left", str(folder / "left.csv"),
            "--right", str(folder / "right.csv"), *more]
