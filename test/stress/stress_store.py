"""Ends of cases that were run before: a suite that was stopped goes on where it was.

One file of JSON lines a family. A line belongs to the program that made it, by its checksum: a
changed program runs everything anew. The commit of its sources is kept for the document.
"""
from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from stress_run import Outcome

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from revision import revision

KEPT = ("verdict", "n_points", "n_converged", "saved", "text", "seconds", "revision")


def checksum(program):
    return hashlib.sha256(Path(program).read_bytes()).hexdigest()[:16]


class Store:
    """Ends on disk; without a folder, nowhere."""

    def __init__(self, folder, program):
        self.folder, self.revision = folder, revision()
        self.program = checksum(program) if folder else ""
        if folder:
            folder.mkdir(parents=True, exist_ok=True)

    def path(self, family):
        return self.folder / f"{family.replace(' ', '_')}.jsonl"

    def ends(self, family, every):
        """Ends of those of the cases that are there, by title."""
        if not self.folder or not self.path(family).exists():
            return {}
        by_title = {case.title: case for case in every}
        found = {}
        for line in self.path(family).read_text().splitlines():
            values = json.loads(line)
            case = by_title.get(values["title"])
            if case is not None and values["program"] == self.program:
                found[case.title] = Outcome(case, **{key: values[key] for key in KEPT})
        return found

    def add(self, family, end):
        end.revision = self.revision
        if not self.folder:
            return
        values = {"program": self.program, "title": end.case.title,
                  **{key: getattr(end, key) for key in KEPT}}
        with self.path(family).open("a") as file:
            file.write(json.dumps(values) + "\n")
