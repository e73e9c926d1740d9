"""Tables and pictures of the report."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fretwear.plot.style import PALETTE

__all__ = ["COLOURS", "finish", "microseconds", "milliseconds", "new_figure", "sentence",
           "table", "unwrapped", "wrapped"]

#: Widest line of text; tables and pictures are as wide as they are.
WIDTH = 120

#: Lines of a picture, in this order: those of the package.
COLOURS = PALETTE


def new_figure() -> tuple[Figure, Axes]:
    """A picture of one panel."""
    figure = Figure(figsize=(6.6, 4.4), dpi=130, layout="constrained")
    return figure, figure.subplots()


def finish(figure: Figure, axes: Axes, path: Path) -> None:
    """Grid, legend, file."""
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Lines of a Markdown table."""
    def line(cells: Iterable[object]) -> str:
        return "| " + " | ".join(str(cell) for cell in cells) + " |"

    return [line(header), line("---" for _ in header), *(line(row) for row in rows)]


def sentence(name: str) -> str:
    """With a capital."""
    return name[0].upper() + name[1:]


def milliseconds(seconds: float) -> str:
    """Three digits are more than a time is worth; a dash where there is no time."""
    return "-" if math.isnan(seconds) else f"{1e3 * seconds:.3g}"


def microseconds(seconds: str) -> str:
    """The same for a text in seconds."""
    return f"{1e6 * float(seconds):.3g}"


def unwrapped(text: str) -> str:
    """Text with each of its paragraphs in one line."""
    return re.sub(r"(?<=[^\n|])\n(?=[^\n|#!*<-])", " ", text)


def wrapped(text: str) -> str:
    """Text with its paragraphs in lines of `WIDTH`; tables, headings and pictures as they are."""
    lines = []
    for line in text.split("\n"):
        if len(line) <= WIDTH or line.startswith(("|", "#", "!", "    ", "<!--")):
            lines.append(line)
            continue
        indent = "  " if line.startswith(("* ", "- ")) else ""
        lines += textwrap.wrap(line, WIDTH, subsequent_indent=indent, break_long_words=False,
                               break_on_hyphens=False)
    return "\n".join(lines)
