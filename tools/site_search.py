"""What the search of the site knows: sections and rows of its pages, and the words of users.

`write_search` makes `_static/pages.js` of the pages that Sphinx has written. `index_page` is a page
with every key and every message. `synonyms` reads the glossary.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from pathlib import Path

__all__ = ["index_page", "pages_of", "synonyms", "write_search"]

#: Elements whose text is none of the page.
_SILENT = {"script", "style", "nav", "form"}
#: Elements without an end.
_VOID = {"img", "br", "hr", "input", "meta", "link", "col", "wbr"}
_HEADINGS = ("h1", "h2", "h3", "h4", "h5")


@dataclass
class Entry:
    """A section of a page, or a row of a table that begins with a word of code.

    A row that begins with several names of keys is an entry for each.
    """

    anchor: str
    title: str = ""
    text: list[str] = field(default_factory=list)
    #: Spans of code in the first cell of a row.
    names: list[str] = field(default_factory=list)

    def shown(self) -> str:
        """Its text in one line."""
        return re.sub(r"\s+", " ", "".join(self.text)).strip()


class _Page(HTMLParser):
    """Sections and rows within the body of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.entries: list[Entry] = []
        self._sections: list[Entry] = []
        self._open: list[tuple[str, str]] = []
        self._row: Entry | None = None
        self._n_cells = 0

    def _is_within(self, *names: str) -> bool:
        return any(tag in names for tag, _ in self._open)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in _VOID:
            return
        given = {name: value or "" for name, value in attrs}
        self._open.append((tag, given.get("class", "")))
        if tag == "section":
            self._sections.append(Entry(given.get("id", "")))
            self.entries.append(self._sections[-1])
        elif tag == "tr" and self._sections:
            self._row, self._n_cells = Entry(self._sections[-1].anchor), 0
        elif tag in ("td", "th"):
            self._n_cells += 1
        elif tag == "code" and self._row is not None and self._n_cells == 1:
            self._row.names.append("")

    def handle_endtag(self, tag: str) -> None:
        if tag in _VOID or not any(tag == name for name, _ in self._open):
            return
        while self._open and self._open.pop()[0] != tag:
            pass
        if tag == "section" and self._sections:
            self._sections.pop()
        elif tag == "tr" and self._row is not None:
            are_keys = all(re.fullmatch(r"\w+", name) for name in self._row.names)
            self.entries += [replace(self._row, title=name)
                             for name in (self._row.names if are_keys else self._row.names[:1])]
            self._row = None
        elif tag in ("p", "td", "th", "li", "div", *_HEADINGS) and self._sections:
            self._add(" ")

    def handle_data(self, data: str) -> None:
        if not self._sections or self._is_within(*_SILENT) or any(
                "headerlink" in kind for _, kind in self._open):
            return
        if self._is_within(*_HEADINGS):
            self._sections[-1].title += data
            return
        if self._row and self._row.names and self._n_cells == 1 and self._is_within("code"):
            self._row.names[-1] += data
        self._add(data)

    def _add(self, data: str) -> None:
        self._sections[-1].text.append(data)
        if self._row is not None:
            self._row.text.append(data)


def pages_of(html: str, url: str) -> list[dict[str, str]]:
    """What the search finds on one page."""
    parser = _Page()
    parser.feed(html)
    page = parser.entries[0].title.strip() if parser.entries else ""
    return [{"title": entry.title.strip() or page, "page": page, "text": entry.shown(),
             "url": f"{url}#{entry.anchor}"} for entry in parser.entries
            if entry.shown() or entry.title]


def synonyms(glossary: str) -> list[list[str]]:
    """Names of one thing, of the rows of the glossary: the term, and what else it is called."""
    rows = re.findall(r"^\| \**([^|*]+?)\** \| ([^|]*) \|", glossary, re.MULTILINE)
    found = []
    for term, others in rows:
        names = [re.sub(r"[`*]", "", name).strip() for name in (term, *others.split(","))]
        if set("".join(names)) - {"-"} and term not in ("term", "---"):
            found.append([name for name in names if name and name != "-"])
    return [names for names in found if len(names) > 1]


def write_search(target: Path, glossary: str) -> None:
    """Write `_static/pages.js` beside the pages of a site."""
    pages = [page for path in sorted(target.rglob("*.html"))
             if path.name not in ("search.html", "genindex.html", "index.html")
             for page in pages_of(path.read_text(encoding="utf-8"),
                                  path.relative_to(target).as_posix())]
    text = (f"const PAGES = {json.dumps(pages, ensure_ascii=False)};\n"
            f"const SYNONYMS = {json.dumps(synonyms(glossary), ensure_ascii=False)};\n")
    (target / "_static" / "pages.js").write_text(text, encoding="utf-8")


def index_page(docs: Path) -> str:
    """A page with every key of the tables of `keys.md` and every message of `messages.md`."""
    keys = []
    for group, rows in re.findall(r"<!-- keys of (\w+) -->\n(.*?)<!-- end of keys -->",
                                  (docs / "keys.md").read_text(encoding="utf-8"), re.DOTALL):
        heading = _heading_before(docs / "keys.md", f"<!-- keys of {group} -->")
        keys += [f"* [`{key}`](keys.md#{heading}) of `&{group}`"
                 for cell in re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", rows, re.MULTILINE)
                 for key in re.findall(r"\w+", cell)]
    messages = []
    heading = ""
    for line in (docs / "messages.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            heading = _anchor(line.lstrip("# "))
        elif (row := re.match(r"\| (?!-)([^|]+?) \|", line)) and heading:
            messages.append(f"* [{row[1]}](messages.md#{heading})")
    said = "Every key of a case, and every row of the tables of messages."
    return "\n".join(["# Index", "", said, "", "## Keys", "", *sorted(keys, key=str.lower), "",
                      "## Messages", "", *messages, ""])


def _heading_before(page: Path, mark: str) -> str:
    """Anchor of the last heading before a mark."""
    before = page.read_text(encoding="utf-8").split(mark)[0]
    return _anchor(re.findall(r"^#+ (.*)$", before, re.MULTILINE)[-1])


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
