"""Abaqus .mtx files, for which no maintained reader was found.

Three layouts of text, told apart by their lines:

* ``*MATRIX OUTPUT, FORMAT=MATRIX INPUT``: row node, row dof, column node, column dof, value;
* ``FORMAT=COORDINATE``: row, column, value;
* ``*SUBSTRUCTURE MATRIX OUTPUT``: a ``*USER ELEMENT`` with its nodes and components, then
  ``*MATRIX, TYPE=...`` with the lower triangle by rows.

Symmetric matrices come as one triangle. A boundary condition is a diagonal entry of 1e36.
Source: Abaqus Analysis User's Guide, "Generating structural matrices" and "Defining matrices".
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from .labels import Label
from .matrix_file import MatrixFile, mirrored, one_triangle

__all__ = ["read_mtx"]


def read_mtx(path: Path) -> MatrixFile:
    """Matrices of a .mtx file; an assembled one is called by the name of the file."""
    lines = path.read_text().splitlines()
    if any(line.upper().replace(" ", "").startswith("*USERELEMENT") for line in lines):
        return _read_substructure(path, lines)
    rows = [[float(word) for word in line.replace(",", " ").split()]
            for line in lines if line.strip() and not line.startswith("*")]
    widths = {len(row) for row in rows}
    if widths not in ({3}, {5}):
        raise InputError(f"{path}: lines have {sorted(widths)} values; expected 5 (node, dof, "
                         "node, dof, value) or 3 (row, column, value)")
    table = np.array(rows)
    name = path.stem.lower()
    if widths == {3}:
        number = table[:, :2].astype(np.int64) - 1
        return MatrixFile(path, {name: _assembled(number, table[:, 2], int(number.max()) + 1)})
    pairs = table[:, :4].astype(np.int64).reshape(-1, 2)
    unique, number = np.unique(pairs, axis=0, return_inverse=True)
    labels = [(int(node), int(component)) for node, component in unique]
    return MatrixFile(path, {name: _assembled(number.reshape(-1, 2), table[:, 4], len(labels))},
                      labels)


def _assembled(number: np.ndarray, values: np.ndarray, n: int) -> sp.csr_array:
    matrix = sp.csr_array((values, (number[:, 0], number[:, 1])), (n, n))
    return mirrored(matrix) if one_triangle(matrix) else matrix


def _read_substructure(path: Path, lines: list[str]) -> MatrixFile:
    labels, n_nodes = _element_dofs(path, lines)
    matrices: dict[str, sp.csr_array] = {}
    n = len(labels)
    for keyword, parameters, data in _blocks(lines):
        if keyword != "MATRIX":
            continue
        name = parameters.get("TYPE", "matrix").lower().replace(" ", "_")
        values = np.array([float(word) for line in data for word in _words(line)])
        full = np.zeros((n, n))
        if len(values) == n * (n + 1) // 2:
            full[np.tril_indices(n)] = values
            full = full + np.tril(full, -1).T
        elif len(values) == n * n:
            full[:] = values.reshape(n, n)
        else:
            raise InputError(f"{path}: matrix {name} has {len(values)} values; expected "
                             f"{n * (n + 1) // 2}, the lower triangle for the {n} degrees of "
                             f"freedom of {n_nodes} nodes")
        matrices[name] = sp.csr_array(full)
    return MatrixFile(path, matrices, labels)


def _element_dofs(path: Path, lines: list[str]) -> tuple[list[Label], int]:
    """Nodes and their components: a data line without a node number starts the list, others
    change the components from that node position on."""
    data = next((data for keyword, _, data in _blocks(lines) if keyword == "USER ELEMENT"), [])
    components: dict[int, list[int]] = {}
    for k, line in enumerate(data):
        numbers = [int(word) for word in _words(line)]
        components[1 if k == 0 else numbers[0]] = numbers if k == 0 else numbers[1:]
    nodes = _element_nodes(lines)
    if not nodes or 1 not in components:
        raise InputError(f"{path}: *USER ELEMENT lacks the comment 'ELEMENT NODES' with its node "
                         "numbers, or its components")
    labels: list[Label] = []
    current = components[1]
    for position, node in enumerate(nodes, 1):
        current = components.get(position, current)
        labels += [(node, component) for component in current]
    return labels, len(nodes)


def _element_nodes(lines: list[str]) -> list[int]:
    """Node numbers in the comment lines after `** ELEMENT NODES`."""
    nodes: list[int] = []
    inside = False
    for line in lines:
        if line.startswith("**") and "ELEMENT NODES" in line.upper():
            inside = True
        elif inside and re.fullmatch(r"\*\*[\s\d,]+", line):
            nodes += [int(word) for word in _words(line[2:])]
        elif inside:
            break
    return nodes


def _blocks(lines: list[str]) -> list[tuple[str, dict[str, str], list[str]]]:
    """Keyword, parameters and data lines of every block, without comments."""
    blocks: list[tuple[str, dict[str, str], list[str]]] = []
    for line in lines:
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            keyword, *words = (word.strip() for word in line[1:].split(","))
            pairs = (word.partition("=") for word in words)
            blocks.append((keyword.upper(), {key.strip().upper(): value.strip()
                                             for key, _, value in pairs}, []))
        elif blocks:
            blocks[-1][2].append(line)
    return blocks


def _words(line: str) -> list[str]:
    return [word for word in re.split(r"[,\s]+", line.strip()) if word]
