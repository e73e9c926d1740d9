"""What a run is known by: a hash of all that its numbers depend on."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

from ._native import Session, library_version

__all__ = ["digest", "identity"]

#: How a key begins in the effective input.
_BEGINNING = re.compile(r"   (\w+) = ")
#: What does not change the numbers of a run, or counts by its content.
_INDIFFERENT = ("case%threads", "case%title", "output%file", "model%file", "contact%worn")


def identity(session: Session, case: Path) -> str:
    """Hash of the effective input, of the version, and of what the files hold that are read beside
    the namelist `case`; a model in memory does not count."""
    effective = _effective(session.text("namelist"))
    # Of the namelist its effect counts, of every other file that is read what it holds.
    contents = [digest([Path(path).read_bytes()]) for path in session.text("inputs").splitlines()
                if Path(path) != case]
    return digest([library_version(), effective, *contents])


def digest(parts: Iterable[str | bytes]) -> str:
    """Hash of texts or bytes, one after the other."""
    whole = hashlib.sha256()
    for part in parts:
        whole.update(part.encode() if isinstance(part, str) else part)
        whole.update(b"\0")
    return whole.hexdigest()[:20]


def _effective(namelist: str) -> str:
    """The effective input without what does not change the numbers of a run."""
    kept, group, skips = [], "", False
    for line in namelist.splitlines():
        if line.startswith("&"):
            group = line[1:].strip()
        found = _BEGINNING.match(line)
        # Long values go on in lines of their own.
        if found or line.startswith(("&", "/")):
            skips = found is not None and f"{group}%{found[1]}" in _INDIFFERENT
        if not skips:
            kept.append(line)
    return "\n".join(kept)
