"""Keyword files of Abaqus and CalculiX: keywords with parameters and data, through included files.

Source: CalculiX CrunchiX USER'S MANUAL version 2.20, "Input deck format"; Abaqus Keywords Guide.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError, OutputError

__all__ = ["Card", "cards", "numbers_of", "words_of"]

#: Files that include each other are refused at this depth.
_DEEPEST = 20
#: What stands between commas; in quotes it may hold commas and blanks.
_WORD = re.compile(r"""(?:"[^"]*"|'[^']*'|[^,"'])*""")


@dataclass(frozen=True)
class Card:
    """A keyword with its parameters and its data lines.

    Attributes
    ----------
    where : str
        File and line, for messages.
    word : str
        The keyword in capital letters, without its star.
    parameters : dict of str to str
        By names in capital letters, without blanks.
    lines : list of str
        Of data.
    """

    where: str
    word: str
    parameters: dict[str, str]
    lines: list[str]

    def name(self, key: str) -> str:
        return self.parameters.get(key, "").upper()


def cards(path: Path) -> Iterator[Card]:
    """Keywords with their data; included files stand in their place, also amid data.

    Raises
    ------
    InputError
        Files include each other.
    OutputError
        A file cannot be read.
    """
    card: Card | None = None
    for line, where in _lines(path, path.parent, 0):
        if not line.startswith("*"):
            if card is not None:
                card.lines.append(line)
            continue
        if card is not None:
            yield card
        word, parameters = _keyword(line)
        card = Card(where, word, parameters, [])
    if card is not None:
        yield card


def _lines(path: Path, folder: Path, depth: int) -> Iterator[tuple[str, str]]:
    """Lines that are no comments, and where they are; those of a keyword as one. Included files are
    named from the folder of the deck."""
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    k = 0
    while k < len(lines):
        line, where = lines[k].strip(), f"{path}, line {k + 1}"
        k += 1
        if not line or line.startswith("**"):
            continue
        while line.startswith("*") and line.endswith(",") and k < len(lines):
            line, k = line + lines[k].strip(), k + 1   # parameters go on in the next line
        word, parameters = _keyword(line) if line.startswith("*") else ("", {})
        if word != "INCLUDE":
            yield line, where
        elif depth == _DEEPEST:
            raise InputError(f"{where}: files include each other")
        else:
            yield from _lines(folder / parameters.get("INPUT", ""), folder, depth + 1)


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    word, *parameters = _split(line[1:])
    pairs = (part.partition("=") for part in parameters)
    return " ".join(word.upper().split()), {
        key.strip().upper().replace(" ", ""): _bare(value) for key, _, value in pairs}


def numbers_of(line: str, where: str) -> list[float]:
    """The numbers of a data line."""
    try:
        return [float(word) for word in line.split(",") if word.strip()]
    except ValueError:
        raise InputError(f"{where}: expected numbers, found '{line}'") from None


def words_of(line: str) -> list[str]:
    """What stands between the commas of a data line, in capitals and without quotes."""
    return [_bare(part).upper() for part in _split(line)]


def _split(line: str) -> list[str]:
    if '"' not in line and "'" not in line:
        return [part.strip() for part in line.split(",")]
    parts, at = [], 0
    while at <= len(line):
        match = _WORD.match(line, at)
        end = len(line) if match is None else match.end()
        # A quote that nothing closes is a letter.
        if end < len(line) and line[end] != ",":
            comma = line.find(",", end)
            end = len(line) if comma < 0 else comma
        parts.append(line[at:end].strip())
        at = end + 1
    return parts


def _bare(text: str) -> str:
    text = text.strip()
    return text[1:-1].strip() if len(text) > 1 and text[0] == text[-1] in "'\"" else text
