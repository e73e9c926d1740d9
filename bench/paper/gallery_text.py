"""Pieces of the gallery of the paper: what it reports beside what is found here; pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from bench.common.layout import table
from fretwear.plot.style import new_figure

__all__ = ["beside", "new_figure", "percent", "picture", "save"]

#: Fine enough for a page, and small.
DPI = 90


def beside(*rows: Sequence[str]) -> list[str]:
    """Lines of a table: what the paper reports, what is found here, and whether they agree."""
    return table(["the paper", "here", ""], rows)


def picture(name: str, caption: str) -> list[str]:
    """Lines that show a picture of the folder."""
    return ["", f"![{caption}]({name})", ""]


def save(figure: Figure, path: Path) -> None:
    """Write a picture."""
    figure.savefig(path, dpi=DPI)


def percent(part: float, digits: int = 2) -> str:
    """A part of one in percent."""
    value = 100.0 * part
    return f"{value:.0f} %" if value >= 10.0**digits else f"{value:.{digits}g} %"
