"""Names of degrees of freedom: numbers from 1, or node:component where the file has nodes, also by
the name of a set of nodes."""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from ..errors import InputError, OutputError

__all__ = ["COMPONENTS", "Dofs", "component_number", "read_label_table"]

Label = tuple[int, int]

#: Names of the components of a node; 0 is a scalar point.
COMPONENTS = {"s": 0, "ux": 1, "uy": 2, "uz": 3, "rotx": 4, "roty": 5, "rotz": 6}
_TOKEN = re.compile(r"([+-]?)(\d+)(?::(\w+))?$")
_SET = re.compile(r"([+-]?)([^\d+\-:][^:]*):(\w+)$")


def component_number(text: str) -> int:
    """Number of a component given as 0 to 6 or as UX ... ROTZ."""
    if text.isdigit():
        return int(text)
    return COMPONENTS[text.lower()]


class Dofs:
    """The degrees of freedom of a matrix.

    Parameters
    ----------
    n : int
        How many.
    labels : sequence of (node, component), optional
        One for each, in order; without them only numbers name a degree of freedom.
    held : set of (node, component), optional
        Labels of degrees of freedom that were left out because they do not move.
    sets : dict of str to sequence of int, optional
        Nodes by the name of their set, in capital letters.
    """

    def __init__(self, n: int, labels: Sequence[Label] | None = None,
                 held: Collection[Label] = (),
                 sets: Mapping[str, Sequence[int]] | None = None) -> None:
        self.n, self.held, self.sets = n, frozenset(held), dict(sets or {})
        self.labels = None if labels is None else [(int(a), int(b)) for a, b in labels]
        self._index = {} if self.labels is None else {
            label: i for i, label in enumerate(self.labels)}

    def name(self, index: int) -> str:
        """How a message calls degree of freedom `index` (from 0)."""
        if self.labels is None:
            return f"dof {index + 1}"
        node, component = self.labels[index]
        return f"dof {index + 1} ({node}:{component})"

    def signed(self, token: str, where: str) -> int:
        """Signed number (from 1) of a degree of freedom; 0 for none or the ground.

        Parameters
        ----------
        token : str
            '', '0', '12', '-12', '1021:3' or '-1021:uz'; 'TIP:3' with the name of a set of one
            node.
        where : str
            Place of the token, for the message.

        Raises
        ------
        InputError
            It is no such text, or there is no such degree of freedom.
        """
        text = token.strip()
        if text in ("", "0"):
            return 0
        if _SET.match(text):
            numbers = self.several(text, where)
            if len(numbers) > 1:
                raise InputError(f"{where}: {text} names {len(numbers)} nodes; expected one")
            return numbers[0]
        match = _TOKEN.match(text)
        if not match:
            raise InputError(f"{where}: '{token}' names no degree of freedom; expected a number "
                             f"from 1 to {self.n}, or node:component such as 1021:3")
        sign = -1 if match[1] == "-" else 1
        if match[3] is None:
            number = int(match[2])
            if number > self.n:
                raise InputError(f"{where}: dof {number} is not there; the matrices have {self.n}")
            return sign * number
        return sign * self._labelled(int(match[2]), match[3], where)

    def several(self, token: str, where: str) -> list[int]:
        """Signed numbers of the degrees of freedom of a token as `signed` takes it, one for each
        node of a set."""
        match = _SET.match(token.strip())
        if not match:
            return [self.signed(token, where)]
        sign, name = -1 if match[1] == "-" else 1, match[2].strip().upper()
        return [sign * self._labelled(node, match[3], where) for node in self.nodes(name, where)]

    def nodes(self, name: str, where: str) -> list[int]:
        """Nodes of a set.

        Raises
        ------
        InputError
            There is no such set, or it is empty.
        """
        nodes = [int(node) for node in self.sets.get(name.upper(), ())]
        if not nodes:
            known = ", ".join(sorted(self.sets))
            raise InputError(f"{where}: there is no set of nodes {name}; "
                             + (f"there are {known}" if known else "sets come with a mesh "
                                "(--mesh) or the deck of a job"))
        return nodes

    def with_sets(self, sets: Mapping[str, Sequence[int]], held: Collection[Label] = ()) -> Dofs:
        """The same degrees of freedom with sets of nodes, and further labels that do not move."""
        known = set(self._index)
        return Dofs(self.n, self.labels, self.held | {label for label in held
                                                      if label not in known}, sets)

    def _labelled(self, node: int, component: str, where: str) -> int:
        if self.labels is None:
            raise InputError(f"{where}: {node}:{component} names a node, but the files name no "
                             "nodes; use numbers, or give a label table (--labels)")
        try:
            label = node, component_number(component)
        except KeyError:
            raise InputError(f"{where}: '{component}' is no component; expected 0 to 6, or one of "
                             f"{', '.join(COMPONENTS)}") from None
        found = self._index.get(label)
        if found is None and label in self.held:
            return 0
        if found is None:
            there = sorted(c for n, c in self._index if n == node)
            raise InputError(f"{where}: {node}:{component} is not in the matrices; "
                             + (f"node {node} has the components {there}" if there
                                else f"they have no node {node}"))
        return found + 1


def read_label_table(path: str | Path) -> list[Label]:
    """Labels from a table of equation, node and component, as ANSYS writes beside HBMAT.

    Lines that do not start with a number are headings. Columns are separated by blanks, commas
    or tabs; the component is a number or a name such as UX.
    """
    found: dict[int, Label] = {}
    try:
        with open(path, newline="") as file:
            lines = list(csv.reader(line.replace(",", " ").replace("\t", " ") for line in file))
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    for number, line in enumerate(lines, 1):
        words = " ".join(line).split()
        if not words or not words[0].isdigit():
            continue
        try:
            found[int(words[0])] = int(words[1]), component_number(words[2])
        except (IndexError, ValueError, KeyError):
            raise InputError(f"{path}, line {number}: expected equation, node and component, "
                             f"found '{' '.join(words)}'") from None
    if sorted(found) != list(range(1, len(found) + 1)):
        raise InputError(f"{path}: the equations are not numbered 1 to {len(found)}")
    return [found[i] for i in sorted(found)]
