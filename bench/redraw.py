"""Pictures of the benchmark pages drawn anew from the tables of the pages; nothing is measured.

    python -m bench.redraw [PART ...] [--docs docs] [--images docs/images]

Parts: precision, events, speed; without any, all of them. Where the way of drawing has changed,
pictures follow it here without times of another day, of a machine that is perhaps busy.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from pathlib import Path

from bench.common.measure import ROOT
from bench.common.sector import PointTime
from bench.precision import events, report
from bench.precision.responses import SECTOR, Kept, Precision, Sample
from bench.speed.report import draw_points

__all__ = ["read_limits", "read_points", "read_precision", "redraw"]

#: A table: its heading, its columns, its rows.
Table = tuple[str, list[str], list[list[str]]]


def tables(path: Path) -> list[Table]:
    """Every table of a page with the heading that it stands below."""
    found: list[Table] = []
    heading, is_open = "", False
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if not line.startswith("|"):
            is_open = False
            continue
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not is_open:
            found.append((heading, cells, []))
            is_open = True
        elif not set(line) <= set("|- "):
            found[-1][2].append(cells)
    return found


def case_of(title: str) -> str:
    """The name of a case from its heading, whose first letter is a capital; names of people keep
    theirs."""
    small = title[0].lower() + title[1:]
    return small if small == SECTOR else title


def pair(cell: str) -> tuple[float, float]:
    """Error and time [s] of a cell; NaN where there was no solution."""
    found = re.fullmatch(r"(\S+), (\S+)", cell)
    return (float(found[1]), 1e-3 * float(found[2])) if found else (math.nan, math.nan)


def read_precision(path: Path) -> Precision:
    """Errors and times of docs/benchmarks/precision.md."""
    samples, kept = [], []
    for heading, columns, rows in tables(path):
        if columns[0] == "setting":
            numbers = [int(column.removeprefix("H = ")) for column in columns[1:]]
            samples += [Sample(case_of(heading), row[0], n, *pair(cell))
                        for row in rows for n, cell in zip(numbers, row[1:]) if cell != "-"]
        elif columns[:3] == ["case", "accuracy", "H"]:
            kept += [Kept(case_of(row[0]), float(row[1]), int(row[2]), int(row[3]), float(row[4]),
                          float(row[5]), 1e-3 * float(row[7])) for row in rows]
    return Precision(samples, kept)


def read_limits(path: Path) -> list[events.Limit]:
    """Distances and times of docs/benchmarks/events.md."""
    for _, columns, rows in tables(path):
        if columns[:2] == ["case", "sampling"]:
            numbers = [int(column.removeprefix("n_time = ")) for column in columns[2:-1]]
            return [events.Limit(row[0], row[1], n, *pair(cell))
                    for row in rows for n, cell in zip(numbers, row[2:-1]) if cell != "-"]
    raise SystemExit(f"{path}: no table of distances")


def read_points(path: Path) -> list[PointTime]:
    """Times of points of docs/benchmarks/speed.md."""
    for _, columns, rows in tables(path):
        if columns[:3] == ["pairs", "H", "unknowns"]:
            return [PointTime(int(row[0]), int(row[1]), linear,
                              math.nan if cell == "not run" else 1e-3 * float(cell), int(row[2]),
                              None)
                    for row in rows for linear, cell in zip(("krylov", "lu"), row[-2:])]
    raise SystemExit(f"{path}: no table of times")


def draw_precision(page: Path, images: Path) -> None:
    """Oscillators and sector."""
    data = read_precision(page)
    names = list(dict.fromkeys(sample.case for sample in data.samples))
    report.draw(images / "benchmark_errors.png", data, [name for name in names if name != SECTOR])
    report.draw(images / "benchmark_errors_sector.png", data, [SECTOR])


def draw_events(page: Path, images: Path) -> None:
    """Both samplings."""
    limits = read_limits(page)
    events.draw(images / "benchmark_events.png", limits,
                list(dict.fromkeys(limit.case for limit in limits)))


def draw_speed(page: Path, images: Path) -> None:
    """Times of a point."""
    draw_points(images / "benchmark_points.png", read_points(page))


PARTS: dict[str, Callable[[Path, Path], None]] = {
    "precision": draw_precision, "events": draw_events, "speed": draw_speed}


def redraw(parts: list[str], docs: Path, images: Path) -> None:
    """The pictures of some parts."""
    for part in parts:
        PARTS[part](docs / "benchmarks" / f"{part}.md", images)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Draw pictures from the tables of their pages.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (all)")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    parser.add_argument("--images", type=Path, default=ROOT / "docs" / "images")
    options = parser.parse_args()
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]!r}; choose from {', '.join(PARTS)}")
    redraw(options.parts or list(PARTS), options.docs, options.images)


if __name__ == "__main__":
    main()
