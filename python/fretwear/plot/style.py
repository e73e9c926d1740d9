"""What all pictures share: colours, figures, axis labels with units, the choice of pairs."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Union

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import Formatter
from numpy.typing import NDArray

from ..result import Result

__all__ = ["CURVE", "FAILED", "PALETTE", "STATE_COLOURS", "UNDECIDED", "UNSTABLE", "Floats",
           "Picture", "ScaledFormatter", "Source", "as_result", "label", "label_y", "largest_of",
           "new_figure", "pair_name", "scale", "scale_axis", "tidy", "units_of"]

Floats = NDArray[np.float64]
#: What every plot takes: a result, or the path of its file.
Source = Union[Result, str, Path]

CURVE, FAILED, UNSTABLE = "#1f4e79", "#c0392b", "#c0392b"
UNDECIDED = "#8a6d00"
#: Stick, slip, open.
STATE_COLOURS = ("#4c78a8", "#f58518", "#b8b8b8")
#: Told apart by colour-blind readers too (Okabe and Ito 2008).
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")

#: Names of units a thousand times smaller and larger, from 10^-9 to 10^9 of the first.
_FAMILIES = (
    ("m", {-9: "nm", -6: "µm", -3: "mm", 0: "m", 3: "km"}),
    ("N", {-6: "µN", -3: "mN", 0: "N", 3: "kN", 6: "MN"}))
#: Values whose largest lies between these are shown in the unit of the model.
_READABLE = (0.1, 1e5)
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def as_result(source: Source) -> Result:
    """The result itself, or that of a path."""
    return source if isinstance(source, Result) else Result(source)


def units_of(result: Result, name: str) -> str:
    """Units of a dataset; "" where the file does not say (then those of the user's model)."""
    return result.units(name) if name in result else ""


def label(text: str, units: str) -> str:
    """Text of an axis: quantity and, where it has one, the unit in brackets."""
    return text if units in ("", "1") else f"{text} [{units.replace('^2', '²')}]"


def scale(largest: float, units: str) -> tuple[float, str]:
    """A factor that makes values readable, and the unit that they have then.

    Micrometres for a thousandth of a millimetre; a power of ten where the unit has no such names.
    """
    if not np.isfinite(largest) or largest == 0.0 or _READABLE[0] <= largest < _READABLE[1]:
        return 1.0, units
    power = int(3 * np.floor(np.log10(largest) / 3.0))
    for _, names in _FAMILIES:
        own = next((exponent for exponent, name in names.items() if name == units), None)
        if own is not None and own + power in names:
            return 10.0 ** -power, names[own + power]
    own_power = f"10{str(power).translate(_SUPERSCRIPTS)}"
    return 10.0 ** -power, own_power if units in ("", "1") else f"{own_power} {units}"


class ScaledFormatter(Formatter):
    """Numbers at the ticks in another unit than the data, with no power of ten above the axis.

    Parameters
    ----------
    factor : float
        What the data are multiplied by.
    """

    def __init__(self, factor: float) -> None:
        self._factor, self._digits = factor, 2

    def set_locs(self, locs: Any) -> None:
        """Take as many digits as tell the ticks apart."""
        values = np.unique(self._factor * np.asarray(locs, dtype=float))
        if len(values) > 1:
            step = float(np.diff(values).min())
            first = int(np.clip(np.ceil(-np.log10(step) - 1e-9), 0, 9))
            fits = np.abs(np.round(values, first) - values).max() < 1e-3 * step
            self._digits = first if fits else first + 1

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.fix_minus(f"{self._factor * x:.{self._digits}f}")

    def format_data_short(self, value: float) -> str:
        """What the window shows of the place of the mouse."""
        return self.fix_minus(f"{self._factor * value:.4g}")


def scale_axis(axis: Axis, largest: float, units: str) -> str:
    """Let an axis show its numbers in a readable unit; the data stay. Returns that unit."""
    factor, shown = scale(largest, units)
    axis.set_major_formatter(ScaledFormatter(factor))
    return shown


def largest_of(*values: Floats) -> float:
    """Largest magnitude that is finite; 0 without any."""
    finite = [np.abs(array[np.isfinite(array)]) for array in values]
    return max((float(array.max()) for array in finite if array.size), default=0.0)


def label_y(axes: Axes, text: str, units: str) -> None:
    """Name the vertical axis, in a readable unit for what is drawn."""
    heights = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
    heights += [np.array([patch.get_height()]) for patch in axes.patches
                if isinstance(patch, Rectangle)]
    axes.set_ylabel(label(text, scale_axis(axes.yaxis, largest_of(*heights), units)))


class Picture(Figure):
    """A figure that a notebook shows as the value of a cell."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def new_figure(width: float = 8.0, height: float = 4.6) -> Figure:
    """Figure of the given size [inch] whose panels keep clear of each other."""
    return Picture(figsize=(width, height), dpi=130, layout="constrained")


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
