"""What the first page says: a question, where its answer stands on the page of a part, and words.

The answer is read from the page that the measurement has written, so that it is that of the last
one. An answer that cannot be found shows as a dash, and a test fails.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["HEADLINES", "Headline", "rows"]


@dataclass(frozen=True)
class Headline:
    """A row of the first page.

    Attributes
    ----------
    question : what is asked
    part : page that answers
    pattern : regular expression that finds the numbers on it
    words : the answer, with the numbers in the places of {}
    target : what is wanted, and whether it is met; numbers may stand here too
    """

    question: str
    part: str
    pattern: str
    words: str
    target: str = ""


SWEEP = (r"{} pairs, H = {}, down \|(?: \S+ \|){{4}} (\S+) \| (< \d+ s): (\w+) \|\n"
         r".*?up \|(?: \S+ \|){{4}} (\S+) \| < \d+ s: (\w+)")

HEADLINES = (
    Headline("A sweep of 41 frequencies of the blade sector, 48 pairs, H = 7", "speed",
             SWEEP.format(48, 7), "{0} s down, {3} s up", "{1}: {2}, {4}"),
    Headline("The same, 16 pairs, H = 3", "speed", SWEEP.format(16, 3), "{0} s down, {3} s up",
             "{1}: {2}, {4}"),
    Headline("One frequency near the peak, 48 pairs, H = 17 (5040 unknowns)", "speed",
             r"\| 48 \| 17 \|(?: [^|]+ \|){3} (\S+) \|", "{0} ms"),
    Headline("17 harmonics against one, 16 pairs", "scaling",
             r"H = 1 takes \S+ ms, (\S+) times less \(target at most (\d+): (\w+); (\d+) in",
             "{0} times the time ({3} in the paper)", "at most {1}: {2}"),
    Headline("Growth with the harmonics, exponent at 768 pairs", "scaling",
             r"\| 768 \| ([\d.]+) \| [^\n]*?\| 1: (\w+)", "{0}", "1: {1}"),
    Headline("Distance from the floor of what a sweep must compute", "limit",
             r"at most (\S+) times the floor; (\w+)(?: in (\d+ of \d+) cases, (\S+) times)?",
             "{3} times at worst", "at most {0}: {1}"),
    Headline("What a second thread costs where it cannot help", "limit",
             r"Target: at most (1\.\d+); (\w+) \((\S+) at worst", "{2} times",
             "at most {0}: {1}"),
    Headline("Without the skips (stuck pairs, kept preconditioners), 48 pairs, H = 7", "skips",
             r"\| 48 pairs, H = 7 \| \S+ \| \S+ \| (\S+) \|", "{0} times the time"),
    Headline("Against pyHarm, a chain of 8 masses, H = 3", "peers",
             r"chain, N = 8 \| 3 \| \S+ \| \S+ \| (\S+) \| (\d+): (\w+)", "{0} times faster",
             "{1}: {2}"),
    Headline("Against pyHarm, a chain of 48 masses, H = 17", "peers",
             r"chain, N = 48 \| 17 \| \S+ \| \S+ \| (\S+) \| (\d+): (\w+)", "{0} times faster",
             "{1}: {2}"),
    Headline("Error of HDHB at the peak, H = 3, from its aliases", "aliasing",
             r"\n\| 3 \| \S+ \| \S+ \| (\S+ %) \| (\S+ %)", "{1} (HBM {0})"),
    Headline("Located events with one tangential direction, 30 instants", "events",
             r"Jenkins \| uniform \| (\S+),[^\n]*\n\| Jenkins \| events \| (\S+),",
             "error {1} of sampling, {0} without them"),
    Headline("Pseudo-time against Newton's method, 50 frequencies of the sector", "iterations",
             r"\| newton \| \S+ of \S+ \| (\S+) \|[^\n]*(?s:.*?)\| rotated, implicit_euler "
             r"\| \S+ of \S+ \| (\S+) \|", "{1} against {0} linear solutions"),
)


def rows(pages: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Question with a link, answer and target, of every part that has a page."""
    return [(f"[{one.question}](benchmarks/{one.part}.md)", *answer(one, pages[one.part]))
            for one in HEADLINES if one.part in pages]


def answer(headline: Headline, page: str) -> tuple[str, str]:
    """The answer and what is said of the target."""
    found = re.search(headline.pattern, page)
    if not found:
        return "-", ""
    groups = [group or "-" for group in found.groups()]
    return headline.words.format(*groups), headline.target.format(*groups)
