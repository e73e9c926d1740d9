"""Jobs of CalculiX: matrices that ``*FREQUENCY, SOLVER=MATRIXSTORAGE`` stores beside the deck.

``job.sti`` and ``job.mas`` hold row, column and value of one triangle, ``job.dof`` node.component
of each row. The components are along the global axes, whatever ``*TRANSFORM`` says: that turns
supports and loads only. Held components have no row, nor have those that an equation or a tie
makes depend on others.
Source: CalculiX CrunchiX USER'S MANUAL version 2.20, "*FREQUENCY"; files of version 2.20.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from .deck import Deck
from .labels import Dofs, Label
from .matrix_file import MatrixFile, mirrored

__all__ = ["SUFFIXES", "Job", "deck_loads", "find_job", "read_stored", "supports_of"]

Floats = NDArray[np.float64]

#: Files that CalculiX stores, by what they hold.
_STORED = {"stiffness": ".sti", "mass": ".mas"}
SUFFIXES = (*_STORED.values(), ".dof")


@dataclass(frozen=True)
class Job:
    """Files of a job.

    Attributes
    ----------
    dofs : Path
        Names of the rows (.dof); the matrices lie beside it.
    deck : Path or None
        The deck (.inp), where it is there.
    """

    dofs: Path
    deck: Path | None


def find_job(path: Path) -> Job | None:
    """The job that a deck or a stored matrix belongs to; None of any other file.

    Raises
    ------
    InputError
        The deck has no stored matrices beside it, or not all of them.
    """
    suffix = path.suffix.lower()
    if suffix != ".inp" and suffix not in SUFFIXES:
        return None
    if suffix == ".inp" and not path.is_file():
        raise OutputError(f"{path}: cannot be read: there is no such file")
    missing = [path.with_suffix(end).name for end in SUFFIXES
               if not path.with_suffix(end).is_file()]
    if missing:
        raise InputError(f"{path}: {', '.join(missing)} "
                         + ("is" if len(missing) == 1 else "are")
                         + " not beside it: let CalculiX store the matrices, by a step with "
                         f"*FREQUENCY, SOLVER=MATRIXSTORAGE, and run ccx {path.stem}")
    deck = path.with_suffix(".inp")
    return Job(path.with_suffix(".dof"), deck if deck.is_file() else None)


def read_stored(path: Path) -> MatrixFile:
    """Stiffness and mass of a job, any of whose files is given."""
    labels = _labels(path.with_suffix(".dof"))
    matrices = {}
    for name, end in _STORED.items():
        file = path.with_suffix(end)
        if file.is_file():
            matrices[name] = _triangle(file, len(labels))
    return MatrixFile(path, matrices, labels)


def _labels(path: Path) -> list[Label]:
    """Node and component of each row: not a number with a fraction, 5.10 is none of 5.1."""
    try:
        words = path.read_text().split()
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    labels = []
    for number, word in enumerate(words, 1):
        node, _, component = word.partition(".")
        if not (node.isdigit() and component.isdigit()):
            raise InputError(f"{path}, line {number}: expected node.component, found '{word}'")
        labels.append((int(node), int(component)))
    if len(set(labels)) < len(labels):
        raise InputError(f"{path}: names a component of a node twice")
    strange = next((label for label in labels if not 1 <= label[1] <= 6), None)
    if strange is not None:
        raise InputError(f"{path}: component {strange[1]} of node {strange[0]} is none of a "
                         "displacement; let CalculiX store a mechanical model")
    return labels


def _triangle(path: Path, n: int) -> sp.csr_array:
    """A matrix of n rows from lines of row, column and value of one triangle."""
    words = path.read_bytes().split()
    if len(words) % 3:
        raise InputError(f"{path}: ends within a line; expected row, column and value")
    table = np.array(words).reshape(-1, 3)
    row, column = (table[:, k].astype(np.int64) - 1 for k in (0, 1))
    if len(row) and (min(row.min(), column.min()) < 0 or max(row.max(), column.max()) >= n):
        raise InputError(f"{path}: names row {max(row.max(), column.max()) + 1}; the file .dof "
                         f"beside it has {n} rows, so they are of different runs")
    matrix = sp.csr_array((table[:, 2].astype(float), (row, column)), (n, n))
    below, above = (row > column).any(), (row < column).any()
    return matrix if below and above else mirrored(matrix)


def supports_of(deck: Deck, dofs: Dofs) -> tuple[set[Label], list[Label]]:
    """Displacements without a row: those that a support holds, and those that follow others."""
    known = set(dofs.labels or ())
    used = {node for kind, nodes in deck.elements.values() for node in nodes}
    held = {(node, c) for node, c in deck.supports - known
            if node not in deck.turned or all((node, k) in deck.supports for k in (1, 2, 3))}
    dependent = sorted((node, c) for node in used for c in (1, 2, 3)
                       if (node, c) not in known and (node, c) not in held)
    return held, dependent


def deck_loads(deck: Deck, dofs: Dofs) -> tuple[dict[str, Floats], list[str]]:
    """Loads of a model by the *CLOAD of a deck, and what is to be known of them.

    Those of a *STATIC step are static; of a *STEADY STATE DYNAMICS step they are
    F = F_re + i F_im of exp(i omega t), which is F_re cos - F_im sin.

    Raises
    ------
    InputError
        Several steps of one kind have loads.
    """
    loads: dict[str, Floats] = {}
    steps: dict[str, set[int]] = {}
    left_out, known = 0, {label: k for k, label in enumerate(dofs.labels or ())}
    for load in deck.loads:
        if not load.kind:
            left_out += 1
            continue
        steps.setdefault(load.kind, set()).add(load.step)
        if len(steps[load.kind]) > 1:
            raise InputError(f"{deck.path}: steps {sorted(steps[load.kind])} have {load.kind} "
                             "loads; say which with --loads or --load")
        name, sign = ("static", 1.0) if load.kind == "static" else (
            ("sine", -1.0) if load.imaginary else ("cosine", 1.0))
        vector = loads.setdefault(name, np.zeros(dofs.n))
        for component, value in enumerate(load.direction, 1):
            place = known.get((load.node, component))
            if place is not None:
                vector[place] += sign * value
            elif value != 0.0 and (load.node, component) not in dofs.held:
                raise InputError(f"{deck.path}: step {load.step} loads {load.node}:{component}, "
                                 "which is not in the matrices")
    notes = [f"{deck.path}: {name} load of *CLOAD in step "
             f"{min(steps['static' if name == 'static' else 'harmonic'])}" for name in loads]
    if left_out:
        notes.append(f"{deck.path}: {left_out} loads of *CLOAD are left out, whose steps are "
                     "neither *STATIC nor *STEADY STATE DYNAMICS")
    return loads, notes
