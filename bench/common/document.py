"""docs/benchmarks.md: a head and one part for each measurement, which its command replaces.

A part stands between two comments with its name, so that a command that measures one of them
leaves the others as they are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from bench.common.layout import table, wrapped

__all__ = ["COMMON", "ORDER", "anchor", "targets", "update_document", "with_origin"]

#: Parts in the order of the document.
ORDER = ("speed", "precision", "events", "solvers", "paper", "iterations", "aliasing", "time",
         "joints", "scaling", "limit", "skips", "laws", "peers", "sectors", "blades",
         "populations", "modes", "imports",
         "patches", "kernels", "workers", "busy", "missions")
#: A verdict on a target: met or missed, and the words behind it up to the end of its cell or
#: sentence.
VERDICT = re.compile(r"[|:;] (met|missed)\b((?:[^|;\n.]|\.(?=\d))*)")
#: What the head says; the rest of the description goes with each part.
COMMON = ("processor", "compiler", "flags")
HEAD = """# Benchmarks

Written by bench/run.py: do not edit. `make bench` measures the speed, `make bench-precision` \
errors against run time, `make bench-solvers` the solvers, `make bench-paper` the methods, \
`make bench-time` the comparison with integration in time, `make bench-scaling` what finer flanks \
and more harmonics cost, `make bench-limit` how far a sweep is from its floor and what is \
skipped, and `make bench-peers` another program; `make bench-full` does it all. Each part says \
what it was measured on. Times are medians of repeated runs, in one thread unless it is said \
otherwise, without reading the input; compare their ratios."""


def update_document(path: Path, part: str, text: str, machine: dict[str, str],
                    order: Sequence[str] = ORDER, head: str = HEAD) -> None:
    """Replace one part (a Markdown section) of the document, or make the document with it."""
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    parts = {name: body for name in order if (body := find_part(old, name)) is not None}
    parts[part] = with_origin(text, machine)
    lines = [head, "", *table(["", ""], ((key, machine[key]) for key in COMMON if key in machine)),
             *targets(parts.values())]
    for name in order:
        if name in parts:
            lines += ["", begin(name), "", parts[name], "", end(name)]
    path.write_text(wrapped("\n".join(lines)) + "\n", encoding="utf-8")


def targets(parts: Iterable[str]) -> list[str]:
    """A table of what the parts say of their targets, in words behind a bar, colon or semicolon."""
    rows = []
    for part in parts:
        for section in re.split(r"\n(?=#+ )", part):
            heading = section.partition("\n")[0].lstrip("# ")
            verdicts = VERDICT.findall(section)
            missed = [words for word, words in verdicts if word == "missed"]
            if verdicts:
                rows.append((f"[{heading}](#{anchor(heading)})", len(verdicts) - len(missed),
                             len(missed), worst(missed)))
    if not rows:
        return []
    return ["", "## Targets", "", "How often each is met and missed; the reasons are in the "
            "sections.", "", *table(["section", "met", "missed", "at worst"], rows)]


def worst(missed: Sequence[str]) -> str:
    """The words of the largest miss; none where there is none."""
    def size(words: str) -> float:
        return max(map(float, re.findall(r"\d+\.?\d*", words)), default=0.0)

    return max(missed, key=size).strip(" :()") if missed else ""


def anchor(heading: str) -> str:
    """The name of a heading in links, as GitHub makes it."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def with_origin(text: str, machine: dict[str, str]) -> str:
    """The section with a line below its heading that says what was measured and when."""
    heading, _, body = text.partition("\n")
    origin = "; ".join(f"{key} {value}" for key, value in machine.items() if key not in COMMON)
    return f"{heading}\n\n*Measured: {origin}.*\n{body}"


def find_part(document: str, name: str) -> str | None:
    """The text of a part."""
    found = re.search(re.escape(begin(name)) + r"\n\n(.*?)\n\n" + re.escape(end(name)), document,
                      re.DOTALL)
    return found[1] if found else None


def begin(name: str) -> str:
    """Comment before a part."""
    return f"<!-- part: {name} -->"


def end(name: str) -> str:
    """Comment behind a part."""
    return f"<!-- end: {name} -->"
