"""Derivatives of a response by numbers of its case, as a run with `&sensitivity` has found them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from .elements import KINDS
from .errors import AbsentError
from .result_file import ResultFile

__all__ = ["Sensitivities", "read_sensitivities"]

Floats = NDArray[np.float64]


class _ByName(dict[str, Floats]):
    """Derivatives of one quantity by the names of the parameters; says which there are."""

    def __init__(self, quantity: str, found: Mapping[str, Floats]) -> None:
        super().__init__(found)
        self._quantity = quantity

    def __missing__(self, name: str) -> Floats:
        raise AbsentError(f"there is no derivative of {self._quantity} by {name}; there are by "
                          f"{', '.join(self)}: name it in sensitivity%parameters")


@dataclass(frozen=True, repr=False)
class Sensitivities(Mapping[str, Mapping[str, Floats]]):
    """Derivatives by quantity and parameter: `sensitivities["largest"]["contact%mu"]`.

    It prints as a table: per cent of each quantity, where it is largest, for one per cent of each
    parameter.

    Attributes
    ----------
    derivative : dict
        Arrays (n_points[, n_observed][, n_pairs or n_springs]) by quantity, then by parameter.
    value : dict
        The quantities (n_points[, n_observed]) and the parameters (n_points[, n_pairs or
        n_springs]) themselves.
    deviation : dict
        Standard deviation of each quantity (n_points[, n_observed]); empty where none was asked
        for.
    observed : tuple of str
        Names of the observed quantities.
    """

    derivative: dict[str, dict[str, Floats]]
    value: dict[str, Floats]
    deviation: dict[str, Floats]
    observed: tuple[str, ...] = ()

    def __getitem__(self, quantity: str) -> dict[str, Floats]:
        if quantity not in self.derivative:
            raise AbsentError(f"there are no derivatives of {quantity}; there are of "
                              f"{', '.join(self.derivative)}: name it in sensitivity%quantities")
        return self.derivative[quantity]

    def __contains__(self, quantity: object) -> bool:
        return quantity in self.derivative

    def __iter__(self) -> Iterator[str]:
        return iter(self.derivative)

    def __len__(self) -> int:
        return len(self.derivative)

    def __repr__(self) -> str:
        head, rows = self._table()
        widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
        lines = ["  ".join(word.ljust(width) if k == 0 else word.rjust(width)
                           for k, (word, width) in enumerate(zip(row, widths)))
                 for row in [head, *rows]]
        return "\n".join(["per cent of a quantity, where it is largest, for one per cent of a "
                          "parameter:", *lines])

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        head, rows = self._table()

        def line(words: list[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{escape(word)}</{tag}>" for word in words) + "</tr>"

        return ("<table><caption>per cent of a quantity, where it is largest, for one per cent of "
                f"a parameter</caption><thead>{line(head, 'th')}</thead><tbody>"
                + "".join(line(row, "td") for row in rows) + "</tbody></table>")

    def _table(self) -> tuple[list[str], list[list[str]]]:
        parameters = list(dict.fromkeys(name for by in self.values() for name in by))
        rows = []
        for quantity, by in self.items():
            values = self.value[quantity]
            columns = range(values.shape[1]) if values.ndim > 1 else [None]
            for column in columns:
                series = values if column is None else values[:, column]
                name = quantity if column is None else f"{quantity}[{self._name(column)}]"
                if not np.isfinite(series).any():
                    rows.append([name, "none", *[""] * (len(parameters) + bool(self.deviation))])
                    continue
                point = int(np.nanargmax(series))
                cells = [name, f"{series[point]:.5g}"]
                if self.deviation:
                    spread = self.deviation[quantity][point]
                    cells.append(f"{spread if column is None else spread[column]:.2g}")
                cells += [f"{self.relative(quantity, one, point, column or 0).sum():.4f}"
                          if one in by else "" for one in parameters]
                rows.append(cells)
        return ["quantity", "value", *(["deviation"] if self.deviation else []), *parameters], rows

    def _name(self, column: int) -> str:
        return self.observed[column] if column < len(self.observed) else str(column)

    def relative(self, quantity: str, parameter: str, point: int, observed: int = 0) -> Floats:
        """p/Q dQ/dp of every pair or spring, or of the one parameter.

        Per cent of the quantity for one per cent of the parameter; the sum is that of all pairs.

        Parameters
        ----------
        quantity, parameter : str
            Such as "first_harmonic" and "contact%mu".
        point : int
            Point from 0.
        observed : int
            Observed quantity from 0, where the quantity is of those.
        """
        slope, size = self[quantity][parameter][point], self.value[quantity][point]
        if size.ndim == 1:
            slope, size = slope[observed], size[observed]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.atleast_1d(self.value[parameter][point] * slope / size)


def read_sensitivities(result: ResultFile) -> Sensitivities:
    """All derivatives of a result; raises AbsentError where it holds none."""
    parts: dict[str, dict[str, Floats]] = {}
    with result.open() as file:
        if "sensitivity" not in file:
            raise AbsentError(f"{result.name}: holds no dataset /sensitivity: run with "
                              "sensitivity%parameters")
        for group, members in file["sensitivity"].items():
            parts[group] = {_key(name): data[()] for name, data in members.items()}
    value, deviation = parts.pop("value", {}), parts.pop("deviation", {})
    names = tuple(str(name) for name in result["observed/name"]) if (
        "observed/name" in result) else ()
    return Sensitivities({name: _ByName(name, by) for name, by in parts.items()}, value,
                         deviation, names)


def _key(name: str) -> str:
    """contact%mu of contact_mu; quantities keep their names."""
    group, _, key = name.partition("_")
    known = ("load", "contact", "spring", "model", *KINDS)
    return f"{group}%{key}" if group in known else name
