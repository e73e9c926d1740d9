"""Small tables with a heading: contact pairs and loads, separated by commas, semicolons or tabs."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import InputError, OutputError
from .labels import Dofs

__all__ = ["LOADS", "Pairs", "add_load", "contact_rows", "read_loads", "read_pairs", "read_table",
           "rows_by_sector", "side_rows"]

Floats = NDArray[np.float64]

DIRECTIONS = ("t1", "t2", "n")
#: Loads of a model file; the last per square of the rotation speed.
LOADS = ("static", "cosine", "sine", "static_rotation")
_SIDES = [f"side_{side}_{direction}" for side in (1, 2) for direction in DIRECTIONS]
_NODES = ["node_1", "node_2"]
_NORMAL, _TANGENT = ["nx", "ny", "nz"], ["t1x", "t1y", "t1z"]
_POSITION = ["x", "y", "z"]
_VALUES = ["mu", "gap", "area"]
#: Nodes at one place are within this share of the size of their set.
_TOUCH = 1e-4


@dataclass(frozen=True)
class Pairs:
    """Contact pairs of a table.

    Attributes
    ----------
    side_1, side_2 : (n_pairs, 3) int
        Signed dof numbers (from 1) of t1, t2 and n; 0 for none or the ground.
    rows : (n_rows, n) sparse array or None
        Relative displacements of pairs given by nodes and normals; their side_1 counts these rows.
        Where `rows_2` is there too, displacements of side 1.
    mu, gap, area : (n_pairs,) or None
        Where the table has them; area [L^2], gap [L].
    position : (n_pairs, 3) or None
        [L].
    patch : list of str or None
        Names.
    where : list of str
        Line of the table, for messages.
    sector_2 : (n_pairs,) int or None
        Sector of side 2, where the table has it.
    rows_2 : (n_rows, n) sparse array or None
        Displacements of side 2 in its sector, which the relative ones are less; none where
        `sector_2` is 0.
    """

    side_1: NDArray[np.int32]
    side_2: NDArray[np.int32]
    rows: sp.csr_array | None
    mu: Floats | None
    gap: Floats | None
    area: Floats | None
    position: Floats | None
    patch: list[str] | None
    where: list[str]
    sector_2: NDArray[np.int32] | None = None
    rows_2: sp.csr_array | None = None

    def __len__(self) -> int:
        return len(self.where)


@dataclass(frozen=True)
class _Table:
    path: Path
    columns: list[str]
    lines: list[dict[str, str]]
    where: list[str]

    def has(self, names: Sequence[str]) -> bool:
        return all(name in self.columns for name in names)

    def numbers(self, name: str) -> Floats | None:
        """A column of finite numbers; None where there is none."""
        if name not in self.columns:
            return None
        values = []
        for line, where in zip(self.lines, self.where):
            try:
                value = float(line[name])
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise InputError(f"{where}, column {name}: '{line[name]}' is not a finite number")
            values.append(value)
        return np.array(values)

    def vectors(self, names: Sequence[str]) -> Floats | None:
        """Columns side by side, all or none of them there."""
        if not any(name in self.columns for name in names):
            return None
        missing = [name for name in names if name not in self.columns]
        if missing:
            raise InputError(f"{self.path}: column {missing[0]} is missing beside "
                             + ", ".join(name for name in names if name in self.columns))
        columns = [self.numbers(name) for name in names]
        return np.column_stack([column for column in columns if column is not None])


def read_pairs(path: str | Path, dofs: Dofs, rows: sp.csr_array | None = None,
               places: Mapping[int, Floats] | None = None) -> Pairs:
    """Read contact pairs.

    Parameters
    ----------
    path : str or Path
        Table with a heading. Either columns side_1_t1 ... side_2_n with signed degrees of
        freedom (numbers, node:component, empty or 0 for none), or node_1, node_2 (0 for the
        ground) with the normal nx, ny, nz from side 2 to side 1 and, if wanted, the first
        tangent t1x, t1y, t1z. Then any of mu, gap, area, x, y, z, patch, and of
        sectors sector_2. Lines that start with # are comments. The name of a set in place of a
        node makes a pair of each of its nodes; sets on both sides have their nodes at the same
        places.
    dofs : Dofs
        Degrees of freedom of the matrices.
    rows : (3 n_pairs, n) sparse array, optional
        Relative displacements t1, t2, n of one pair after the other, such as averages over
        patches; the table then names no sides.
    places : mapping of int to (3,), optional
        Positions of nodes, by which sets on both sides are matched.

    Raises
    ------
    InputError
        A column is not known or missing, or a value is wrong; the message names the line.
    """
    table = read_table(Path(path), [*_SIDES, *_NODES, *_NORMAL, *_TANGENT, *_POSITION, *_VALUES,
                                    "patch", "sector_2"])
    if rows is None:
        table = _expanded(table, dofs, places or {})
    if rows is not None:
        side_1 = _numbers_of_rows(table, dofs, rows)
        side_2 = np.zeros_like(side_1)
    elif table.has(_NODES) and table.has(_NORMAL):
        side_1, rows = _rows_of_nodes(table, dofs)
        side_2 = np.zeros_like(side_1)
    elif any(name in table.columns for name in _SIDES):
        side_1, side_2 = (_sides(table, dofs, side) for side in (1, 2))
    else:
        raise InputError(f"{path}: names no sides; expected columns side_1_t1 ... side_2_n, or "
                         "node_1, node_2, nx, ny, nz")
    mu, gap, area = (table.numbers(name) for name in _VALUES)
    patch = [line["patch"] for line in table.lines] if "patch" in table.columns else None
    across = table.numbers("sector_2")
    if across is not None and (across != np.round(across)).any():
        raise InputError(f"{path}: column sector_2 holds whole numbers: 0, 1, -1, ...")
    if across is not None and across.any() and rows is not None:
        raise InputError(f"{path}: column sector_2 goes with columns side_1_t1 ... side_2_n: both "
                         "sides of such a pair have degrees of freedom of their own")
    return Pairs(side_1, side_2, rows, mu, gap, area, table.vectors(_POSITION), patch, table.where,
                 None if across is None else across.astype(np.int32))


def contact_rows(pairs: Pairs, n: int) -> tuple[sp.csr_array, NDArray[np.int32]]:
    """Relative displacements u_side1 - u_side2 as rows of B, and their numbers by pair.

    Returns
    -------
    rows : (n_rows, n) sparse array
        One for every direction that a pair has.
    number : (n_pairs, 3) int
        Row (from 1) of t1, t2 and n; 0 where the pair has no such direction.
    """
    one, two, number, _ = rows_by_sector(pairs, n)
    return sp.csr_array(one - two), number


def rows_by_sector(pairs: Pairs, n: int) -> tuple[sp.csr_array, sp.csr_array, NDArray[np.int32],
                                                   NDArray[np.int64]]:
    """Displacements of side 1 and of side 2 of pairs, which are those of sector 0 and of another.

    Returns
    -------
    one, two : (n_rows, n) sparse array
        Relative displacements are one u_0 - two u_s; two is empty where `one` has them whole.
    number : (n_pairs, 3) int
        Row (from 1) of t1, t2 and n; 0 where the pair has no such direction.
    sector : (n_rows,) int
        The sector s.
    """
    if pairs.rows is None:
        one, two, number = side_rows(pairs, n)
    else:
        one, number = pairs.rows, pairs.side_1
        two = sp.csr_array(one.shape) if pairs.rows_2 is None else pairs.rows_2
    across = (np.zeros(len(pairs), dtype=np.int64) if pairs.sector_2 is None
              else pairs.sector_2.astype(np.int64))
    # Rows are numbered pair by pair.
    return one, two, number, across[np.nonzero(number)[0]]


def side_rows(pairs: Pairs, n: int) -> tuple[sp.csr_array, sp.csr_array, NDArray[np.int32]]:
    """Displacements of side 1 and of side 2 of pairs by degrees of freedom, and their numbers as
    those of `contact_rows`."""
    number = np.zeros_like(pairs.side_1)
    there = (pairs.side_1 != 0) | (pairs.side_2 != 0)
    number[there] = np.arange(1, there.sum() + 1)
    found = []
    for sides in (pairs.side_1[there], pairs.side_2[there]):
        row = np.flatnonzero(sides)
        found.append(sp.csr_array((np.sign(sides[row]).astype(float),
                                   (row, np.abs(sides[row]) - 1)), (int(there.sum()), n)))
    return found[0], found[1], number


def read_loads(path: str | Path, dofs: Dofs) -> dict[str, Floats]:
    """Loads (n) by name from a table with the columns dof and some of `LOADS`; lines add up."""
    table = read_table(Path(path), ["dof", *LOADS])
    names = [name for name in LOADS if name in table.columns]
    if "dof" not in table.columns or not names:
        raise InputError(f"{path}: expected the column dof and at least one of "
                         + ", ".join(LOADS))
    loads = {}
    for name in names:
        values = table.numbers(name)
        assert values is not None
        loads[name] = np.zeros(dofs.n)
        for line, where, value in zip(table.lines, table.where, values):
            add_load(loads[name], dofs, line["dof"], value, f"{where}, column dof")
    return loads


def add_load(load: Floats, dofs: Dofs, token: str, value: float, where: str) -> None:
    """Add a force at a degree of freedom, or at each node of a set."""
    for dof in dofs.several(token, where):
        if dof == 0:
            raise InputError(f"{where}: a load needs a degree of freedom")
        load[abs(dof) - 1] += math.copysign(1.0, dof) * value


def read_table(path: Path, known: Sequence[str]) -> _Table:
    """Columns of a table with a heading, of known names."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    numbered = [(k, line) for k, line in enumerate(text.splitlines(), 1)
                if line.strip() and not line.lstrip().startswith("#")]
    if len(numbered) < 2:
        raise InputError(f"{path}: expected a heading and at least one line")
    heading = numbered[0][1]
    separator = next((mark for mark in "\t;," if mark in heading), ",")
    rows = list(csv.reader((line for _, line in numbered), delimiter=separator))
    columns = [name.strip().lower() for name in rows[0]]
    for name in columns:
        if name not in known:
            raise InputError(f"{path}: column '{name}' is not known; expected some of "
                             + ", ".join(known))
        if columns.count(name) > 1:
            raise InputError(f"{path}: column {name} is there twice")
    lines, where = [], []
    for (number, _), row in zip(numbered[1:], rows[1:]):
        where.append(f"{path}, line {number}")
        if len(row) != len(columns):
            raise InputError(f"{where[-1]}: has {len(row)} values; expected {len(columns)}, one "
                             "per column")
        lines.append({name: value.strip() for name, value in zip(columns, row)})
    return _Table(path, columns, lines, where)


def _expanded(table: _Table, dofs: Dofs, places: Mapping[int, Floats]) -> _Table:
    """The table with a line for each node of the sets that a line names."""
    lines, where = [], []
    for line, at in zip(table.lines, table.where):
        named: list[dict[str, str]] = [{}, {}]
        for side in (1, 2):
            for column in (f"node_{side}", *(f"side_{side}_{c}" for c in DIRECTIONS)):
                word, colon, _ = line.get(column, "").lstrip("+-").partition(":")
                word = word.strip()
                # A component belongs to a degree of freedom; a node stands alone.
                if word and not word.isdigit() and (colon or column.startswith("node")):
                    named[side - 1][column] = word
        sets = [list(dict.fromkeys(word.upper() for word in side.values())) for side in named]
        if not sets[0] and not sets[1]:
            lines.append(line)
            where.append(at)
            continue
        if max(map(len, sets)) > 1:
            several = sets[0] if len(sets[0]) > 1 else sets[1]
            raise InputError(f"{at}: names the sets {', '.join(several)} on one side; expected "
                             "one")
        nodes = [dofs.nodes(words[0], at) if words else [] for words in sets]
        if nodes[0] and nodes[1]:
            nodes[1] = _opposite(nodes, [words[0] for words in sets], places, at)
        for side, words in enumerate(sets):
            other = [line.get(column, "").strip() for column in (
                f"node_{side + 1}", *(f"side_{side + 1}_{c}" for c in DIRECTIONS))]
            if not words and len(nodes[1 - side]) > 1 and any(
                    word not in ("", "0") for word in other):
                raise InputError(f"{at}: {len(nodes[1 - side])} nodes of {sets[1 - side][0]} "
                                 "against one: name a set on either side, or the ground on one")
        for k in range(max(map(len, nodes))):
            own = dict(line)
            for side, columns in enumerate(named):
                for column, word in columns.items():
                    own[column] = line[column].replace(word, str(nodes[side][k]), 1)
            lines.append(own)
            where.append(f"{at}, node {(nodes[0] or nodes[1])[k]}")
    return _Table(table.path, table.columns, lines, where)


def _opposite(nodes: Sequence[Sequence[int]], names: Sequence[str],
              places: Mapping[int, Floats], where: str) -> list[int]:
    """Node of the second set at the place of each of the first."""
    missing = next((node for side in nodes for node in side if node not in places), None)
    if missing is not None:
        raise InputError(f"{where}: node {missing} has no place in the mesh, by which the sets "
                         f"{names[0]} and {names[1]} are matched")
    one, two = (np.array([places[node] for node in side]) for side in nodes)
    distance, partner = cKDTree(two).query(one)
    size = float(np.ptp(one, axis=0).max()) or 1.0
    worst = int(distance.argmax())
    if distance[worst] > _TOUCH * size:
        raise InputError(f"{where}: node {nodes[0][worst]} of {names[0]} is {distance[worst]:.3g} "
                         f"from the nearest of {names[1]}; sets on both sides have their nodes at "
                         "the same places")
    if len(one) != len(two) or len(set(partner.tolist())) < len(partner):
        raise InputError(f"{where}: {names[0]} has {len(one)} nodes and {names[1]} {len(two)}, "
                         "which do not match one by one")
    return [nodes[1][k] for k in partner.tolist()]


def _sides(table: _Table, dofs: Dofs, side: int) -> NDArray[np.int32]:
    names = [f"side_{side}_{direction}" for direction in DIRECTIONS]
    return np.array([[dofs.signed(line.get(name, ""), f"{where}, column {name}")
                      for name in names]
                     for line, where in zip(table.lines, table.where)], dtype=np.int32)


def _numbers_of_rows(table: _Table, dofs: Dofs, rows: sp.csr_array) -> NDArray[np.int32]:
    """Numbers (from 1) of given rows by pair (n_pairs, 3)."""
    sides = [name for name in (*_SIDES, *_NODES) if name in table.columns]
    if sides:
        raise InputError(f"{table.path}: column {sides[0]} has no meaning beside --contact-rows")
    shape = (3 * len(table.lines), dofs.n)
    if rows.shape != shape:
        raise InputError(f"--contact-rows: the matrix is {rows.shape[0]} x {rows.shape[1]}; "
                         f"expected {shape[0]} x {shape[1]}: t1, t2 and n of {len(table.lines)} "
                         f"pairs in {table.path.name}, for {dofs.n} degrees of freedom")
    return np.arange(1, shape[0] + 1, dtype=np.int32).reshape(-1, 3)


def _rows_of_nodes(table: _Table, dofs: Dofs) -> tuple[NDArray[np.int32], sp.csr_array]:
    """Rows of B in the frames of the pairs, and their numbers by pair (n_pairs, 3)."""
    normals, tangents = table.vectors(_NORMAL), table.vectors(_TANGENT)
    assert normals is not None
    blocks = []
    for k, (line, where) in enumerate(zip(table.lines, table.where)):
        frame = _frame(normals[k], None if tangents is None else tangents[k], where)
        block = np.zeros((3, dofs.n))
        for name, factor in (("node_1", 1.0), ("node_2", -1.0)):
            if line[name] in ("", "0"):
                continue
            columns = [dofs.signed(f"{line[name]}:{component}", f"{where}, column {name}") - 1
                       for component in (1, 2, 3)]
            block[:, columns] += factor * frame
        blocks.append(sp.csr_array(block))
    number = np.arange(1, 3 * len(blocks) + 1, dtype=np.int32).reshape(-1, 3)
    return number, sp.csr_array(sp.vstack(blocks))


def _frame(normal: Floats, tangent: Floats | None, where: str) -> Floats:
    """Rows t1, t2 = n x t1, n; t1 as given, made normal to n, or the nearest global axis."""
    length = np.linalg.norm(normal)
    if length == 0.0:
        raise InputError(f"{where}: the normal is zero")
    n = normal / length
    if tangent is None:
        tangent = np.eye(3)[np.abs(n).argmin()]
    t1 = tangent - (tangent @ n) * n
    if np.linalg.norm(t1) < 1e-6 * np.linalg.norm(tangent) or not tangent.any():
        raise InputError(f"{where}: the tangent is zero or along the normal")
    t1 /= np.linalg.norm(t1)
    return np.stack((t1, np.cross(n, t1), n))
