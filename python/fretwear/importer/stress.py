"""Stress of other programs: as rows of a matrix, or as a table of unit coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from ..reduction import Reduction
from .labels import Dofs
from .tables import read_table

__all__ = ["StressRows", "read_stress_points", "read_stress_table", "stress_datasets",
           "stress_of_rows"]

Floats = NDArray[np.float64]

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
#: Words in place of a coordinate: stress without motion, and for each (rad/s)^2.
WITHOUT_MOTION = ("static", "static_rotation")
_OF_POINTS = ("endurance", "ultimate")


@dataclass(frozen=True)
class StressRows:
    """Stress at points by the degrees of freedom of the matrices.

    Attributes
    ----------
    rows : (6 n_points, n) sparse
        Components xx, yy, zz, xy, yz, zx of one point after the other.
    points : list of str
        Their names.
    values : dict of str to array
        Further parts of /stress by their names there.
    """

    rows: sp.csr_array
    points: list[str]
    values: dict[str, Floats]


def stress_of_rows(rows: sp.csr_array, n: int) -> StressRows:
    """The rows of a matrix, in the order of the degrees of freedom of the files."""
    if rows.shape[0] % 6 or rows.shape[0] == 0 or rows.shape[1] != n:
        raise InputError(f"--stress-rows: the matrix is {rows.shape[0]} x {rows.shape[1]}; "
                         f"expected 6 rows for each point (xx, yy, zz, xy, yz, zx), of {n} columns")
    return StressRows(rows, [str(k + 1) for k in range(rows.shape[0] // 6)], {})


def read_stress_table(path: Path, dofs: Dofs) -> StressRows:
    """Lines of point, dof and the six stresses of a unit of it; lines of one add up.

    In place of a dof `static` stands for the stress without motion, and `static_rotation` for
    that of each (rad/s)^2.
    """
    table = read_table(path, ["point", "dof", *COMPONENTS])
    columns = [table.numbers(name) for name in COMPONENTS]
    for name, column in zip(("point", "dof", *COMPONENTS),
                            ("point" in table.columns, "dof" in table.columns, *columns)):
        if column is None or column is False:
            raise InputError(f"{path}: column {name} is missing; expected point, dof, "
                             + ", ".join(COMPONENTS))
    stresses = np.column_stack([column for column in columns if column is not None])
    points = list(dict.fromkeys(line["point"] for line in table.lines))
    place = {point: k for k, point in enumerate(points)}
    still = {name: np.zeros((len(points), 6)) for name in WITHOUT_MOTION}
    used, rows, numbers, values = set(), [], [], []
    for line, where, stress in zip(table.lines, table.where, stresses):
        k, word = place[line["point"]], line["dof"].lower()
        if word in still:
            still[word][k] += stress
            used.add(word)
            continue
        dof = dofs.signed(line["dof"], f"{where}, column dof")
        if dof == 0:
            continue   # held: it does not move
        rows.append(6 * k + np.arange(6))
        numbers.append(np.full(6, abs(dof) - 1))
        values.append(np.sign(dof) * stress)
    if not rows:
        raise InputError(f"{path}: names no degree of freedom that moves")
    matrix = sp.csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(numbers))),
                          (6 * len(points), dofs.n))
    return StressRows(matrix, points, {name: still[name] for name in sorted(used)})


def read_stress_points(path: Path, stress: StressRows) -> StressRows:
    """The same with places and strengths of a table: point, x, y, z, endurance, ultimate."""
    table = read_table(path, ["point", "x", "y", "z", *_OF_POINTS])
    if "point" not in table.columns:
        raise InputError(f"{path}: expected the column point")
    line_of: dict[str, int] = {}
    for k, line in enumerate(table.lines):
        if line["point"] in line_of:
            raise InputError(f"{table.where[k]}: point {line['point']} is there twice")
        if line["point"] not in stress.points:
            raise InputError(f"{table.where[k]}: point {line['point']} has no stress; there are "
                             + ", ".join(stress.points[:5])
                             + (", ..." if len(stress.points) > 5 else ""))
        line_of[line["point"]] = k
    missing = [point for point in stress.points if point not in line_of]
    if missing:
        raise InputError(f"{path}: point {missing[0]} is missing")
    order = [line_of[point] for point in stress.points]
    found: dict[str, Any] = {"position": table.vectors(["x", "y", "z"])}
    for name in _OF_POINTS:
        values = found[name] = table.numbers(name)
        if values is not None and (values <= 0.0).any():
            raise InputError(f"{table.where[int((values <= 0.0).argmax())]}, column {name}: must "
                             "be above 0")
    if (found["endurance"] is None) != (found["ultimate"] is None):
        raise InputError(f"{path}: endurance and ultimate stand side by side, or neither")
    return replace(stress, values=stress.values | {
        name: values[order] for name, values in found.items() if values is not None})


def stress_datasets(stress: StressRows, reduction: Reduction | None) -> dict[str, NDArray[Any]]:
    """The group /stress, on the coordinates of a reduction."""
    rows = stress.rows.toarray() if reduction is None else reduction.row(stress.rows)
    return {"stress/matrix": np.ascontiguousarray(rows).reshape(len(stress.points), 6, -1)} | {
        f"stress/{name}": values for name, values in stress.values.items()}
