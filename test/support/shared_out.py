"""A plugin of pytest: several processes share the test files out among themselves.

Each of them collects all tests. One takes files from the front of the list, the next from its end,
one at a time until all are taken, so that what a folder's files share is seldom made twice. A file
belongs to the process that makes a file of its number in FW_SHARED_OUT. FW_FROM_THE_END is set for
those who begin at the end.
"""
from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path

import pytest


def files_of(items: list[pytest.Item]) -> list[list[pytest.Item]]:
    """The tests of each file, in the order of the collection."""
    return [list(tests) for _, tests in itertools.groupby(items, key=lambda item: item.path)]


def taken(files: list[list[pytest.Item]], claims: Path,
          from_the_end: bool) -> Iterator[pytest.Item]:
    """The tests of files that no other process has taken yet."""
    numbered = list(enumerate(files))
    for number, tests in reversed(numbered) if from_the_end else numbered:
        try:
            (claims / str(number)).open("x").close()
        except FileExistsError:
            continue
        yield from tests


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool:
    """Run the tests of the files taken; the next is known before one ends, for its fixtures."""
    if session.testsfailed and not session.config.option.continue_on_collection_errors:
        count = session.testsfailed
        raise session.Interrupted(f"{count} error{'s' if count != 1 else ''} during collection")
    claims = Path(os.environ["FW_SHARED_OUT"])
    (claims / "collected").write_text(str(len(session.items)))
    mine = taken(files_of(session.items), claims, "FW_FROM_THE_END" in os.environ)
    item = next(mine, None)
    while item is not None:
        following = next(mine, None)
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.shouldfail:
            raise session.Failed(session.shouldfail)
        if session.shouldstop:
            raise session.Interrupted(session.shouldstop)
        item = following
    return True
