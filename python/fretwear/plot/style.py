"""What all pictures share: colours, figures, axis labels with units, the choice of pairs."""

from __future__ import annotations

from pathlib import Path
from typing import Union

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..result import Result

__all__ = ["CURVE", "FAILED", "PALETTE", "STATE_COLOURS", "UNSTABLE", "Floats", "Source",
           "as_result", "label", "new_figure", "pair_name", "tidy", "units_of"]

Floats = NDArray[np.float64]
#: What every plot takes: a result, or the path of its file.
Source = Union[Result, str, Path]

CURVE, FAILED, UNSTABLE = "#1f4e79", "#c0392b", "#c0392b"
#: Stick, slip, open.
STATE_COLOURS = ("#4c78a8", "#f58518", "#b8b8b8")
#: Told apart by colour-blind readers too (Okabe and Ito 2008).
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")

#: Units of the quantities where the file does not say: the user's own length, force and time.
_GENERIC = {
    "amplitude": "L", "coefficients": "L", "contact/force": "F", "contact/dissipation": "F L",
    "contact/position": "L", "contact/area": "L^2", "wear/depth": "L", "wear/rate": "L",
    "history/force": "F", "history/relative_displacement": "L", "history/observed": "L"}


def as_result(source: Source) -> Result:
    """The result itself, or that of a path."""
    return source if isinstance(source, Result) else Result(source)


def units_of(result: Result, name: str) -> str:
    """Units of a dataset; L, F and their products where the file does not say."""
    known = result.units(name) if name in result else ""
    return known or _GENERIC.get(name, "1")


def label(text: str, units: str) -> str:
    """Text of an axis: quantity and unit in brackets."""
    return f"{text} [{units.replace('^2', '²')}]"


def new_figure(width: float = 8.0, height: float = 4.6) -> Figure:
    """Figure of the given size [inch] whose panels keep clear of each other."""
    return Figure(figsize=(width, height), dpi=130, layout="constrained")


def pair_name(result: Result, pair: int) -> str:
    """Number (from 1) of a pair (from 0), with its patch where that has a name."""
    if "contact/patch" in result:
        return f"pair {pair + 1}, {result['contact/patch'][pair]}"
    return f"pair {pair + 1}"


def tidy(axes: Axes) -> None:
    """Grid and frame that stay behind the data."""
    axes.grid(alpha=0.3)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
