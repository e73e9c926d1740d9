"""docs/benchmarks.md, one page to read, and docs/benchmarks/PART.md with all that was measured.

A measurement replaces the page of its part; the first page is made anew from all of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from bench.common.document import COMMON, ORDER, anchor, targets, with_origin
from bench.common.headlines import rows
from bench.common.layout import table, unwrapped, wrapped

__all__ = ["read_pages", "update_page", "write_overview"]

HEAD = (
    "# Benchmarks\n\n"
    "Written by `python -m bench.run`: do not edit. Times are medians of repeated runs in one "
    "thread unless it is said otherwise, without reading the input; compare their ratios. Every "
    "line leads to the page with its tables, which says what was measured, when, and under which "
    "load of the machine.")
PICTURES = (("Time of a frequency point against harmonics and pairs", "benchmark_points.png"),
            ("Error against run time on the sector", "benchmark_errors_sector.png"),
            ("Time and memory against pairs and harmonics", "benchmark_scaling.png"))
COMMANDS = """## Measure

| command | pages |
| --- | --- |
| `make bench` | speed |
| `make bench-precision` | precision, events |
| `make bench-solvers` | solvers |
| `make bench-paper` | paper, iterations, aliasing |
| `make bench-time` | time, joints |
| `make bench-scaling` | scaling |
| `make bench-limit` | limit, skips, laws |
| `make bench-peers` | peers |
| `python -m bench.speed.sectors` | sectors |
| `python -m bench.speed.blades` | blades |
| `python -m bench.speed.populations` | populations |
| `python -m bench.speed.sector_modes` | modes |
| `python -m bench.speed.imports` | imports |
| `python -m bench.speed.patches` | patches |
| `python -m bench.speed.kernels` | kernels |
| `python -m bench.speed.workers` | workers |
| `python -m bench.speed.busy` | busy |
| `python -m bench.speed.missions` | missions |
| `make bench-full` | all others |
| `make compare OTHER=fw_run TIMES=9` | two builds side by side, on the screen |"""


def update_page(folder: Path, part: str, text: str, machine: Mapping[str, str]) -> None:
    """Write the page of a part (a Markdown section of level 2) and the first page."""
    target = folder / "benchmarks"
    target.mkdir(parents=True, exist_ok=True)
    pages = read_pages(target)
    body = with_origin(text, dict(machine))
    body = re.sub(r"^#(#+ )", r"\1", body, flags=re.MULTILINE)
    # Written as a part of the first page, from where other documents are beside it.
    body = re.sub(r"\]\((?=images/|[\w-]+\.md)", "](../", body)
    facts = "; ".join(f"{key} {machine[key]}" for key in COMMON if key in machine)
    body = body.replace("*Measured: ", f"*Measured: {facts}; " if facts else "*Measured: ", 1)
    pages[part] = body
    (target / f"{part}.md").write_text(wrapped(relinked(part, pages)) + "\n", encoding="utf-8")
    write_overview(folder)


def read_pages(target: Path) -> dict[str, str]:
    """The pages that there are, in their order."""
    return {part: (target / f"{part}.md").read_text(encoding="utf-8") for part in ORDER
            if (target / f"{part}.md").exists()}


def write_overview(folder: Path) -> None:
    """The first page, from the pages of all parts."""
    pages = {part: unwrapped(page) for part, page in read_pages(folder / "benchmarks").items()}
    lines = [HEAD, "", *table(["", "measured", "target"], rows(pages)), "", *verdicts(pages)]
    for title, name in PICTURES:
        if (folder / "images" / name).exists():
            lines += ["", f"![{title}](images/{name})"]
    lines += ["", "## Pages", ""]
    lines += [f"* [{heading(page)}](benchmarks/{part}.md)" for part, page in pages.items()]
    lines += ["", COMMANDS]
    (folder / "benchmarks.md").write_text(wrapped("\n".join(lines)) + "\n", encoding="utf-8")


def verdicts(pages: Mapping[str, str]) -> list[str]:
    """The table of what is met and missed, with links to the pages."""
    lines = []
    for part, page in pages.items():
        # Of a table by itself the rows are behind its head.
        found = [line for line in targets([page]) if line.startswith("| [")]
        lines += [line.replace("](#", f"](benchmarks/{part}.md#") for line in found]
    if not lines:
        return []
    return ["## Targets", "", "How often each is met and missed; the reasons are on the pages.", "",
            *table(["section", "met", "missed", "at worst"], []), *lines]


def heading(page: str) -> str:
    """The title of a page."""
    return page.partition("\n")[0].lstrip("# ")


def relinked(part: str, pages: Mapping[str, str]) -> str:
    """The page of a part with links to headings of other pages made whole."""
    homes = {anchor(line.lstrip("# ")): name for name, page in pages.items()
             for line in page.splitlines() if line.startswith("#")}

    def link(found: re.Match[str]) -> str:
        home = homes.get(found[1], part)
        return found[0] if home == part else f"]({home}.md#{found[1]})"

    return re.sub(r"\]\(#([^)]+)\)", link, pages[part])
