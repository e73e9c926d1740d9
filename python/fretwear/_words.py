"""What was meant by a word that is not known."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Iterable, Iterator
from typing import NoReturn

__all__ = ["HintingParser", "did_you_mean", "near_options", "where_it_belongs"]


def did_you_mean(*wrong: str, words: Iterable[str]) -> str:
    """``; did you mean ...?`` where some of the words are near; else nothing."""
    known = list(words)
    near = [match for word in wrong for match in difflib.get_close_matches(word, known, 1)]
    return f"; did you mean {', '.join(near)}?" if near else ""


def where_it_belongs(word: str) -> str:
    """What to do about a keyword that is no group of settings; empty where it is one."""
    from . import settings  # needed for this message alone

    groups = {group: getattr(settings, "CaseGroup" if group == "case" else "".join(
        part.capitalize() for part in group.split("_"))).__annotations__
        for group in settings.Groups.__annotations__}
    if word in groups:
        return ""
    of = [f"{group}={{{word!r}: ...}}" for group, keys in groups.items() if word in keys]
    if of:
        return f"is a key: give {' or '.join(of)}"
    keys = {key for found in groups.values() for key in found}
    return ("is no group of settings" + did_you_mean(word, words=[*groups, *keys])
            + f" (groups: {', '.join(groups)})")


class HintingParser(argparse.ArgumentParser):
    """Parser that names the nearest option, command or word."""

    def error(self, message: str) -> NoReturn:
        super().error(message + near_options(self, message))


def near_options(parser: argparse.ArgumentParser, message: str) -> str:
    """What a message of a parser says of words that are not known, and the words near to them."""
    if "unrecognized arguments" in message:
        return did_you_mean(*re.findall(r"--[\w-]+", message), words=_words(parser))
    wrong = re.search(r"invalid choice: '([^']*)'", message)
    return did_you_mean(wrong[1], words=_words(parser)) if wrong else ""


def _words(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Options, commands and words of a parser and of its subcommands."""
    for action in parser._actions:
        yield from action.option_strings
        yield from (str(word) for word in action.choices or ())
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _words(command)
