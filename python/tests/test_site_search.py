"""What the search of the site knows, and how it answers from a file."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path
from typing import Any

from browsing import headless_browser, wait_for

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
from site_search import index_page, pages_of, synonyms, write_search  # noqa: E402

__all__ = ["headless_browser"]  # a fixture

GLOSSARY = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
PAGE = """<html><body><div class="sphinxsidebar"><nav>menu</nav></div><div class="body" role="main">
<section id="bodies"><h1>Bodies<a class="headerlink" href="#bodies">#</a></h1>
<p>A wedge between two blades is a friction damper that rotation presses.</p>
<section id="keys"><h2>Keys</h2>
<table><thead><tr><th><p>key</p></th><th><p>meaning</p></th></tr></thead>
<tr><td><p><code><span>normal_load</span></code></p></td><td><p>constant force</p></td></tr>
<tr><td><p><code>speed_1</code>, <code>speed_2</code></p></td><td><p>of a belt</p></td></tr>
<tr><td><p><code><span>no</span> <span>load</span></code></p></td><td><p>nothing acts</p></td></tr>
</table>
</section></section></div></body></html>"""


def test_sections_and_rows_of_keys_are_found() -> None:
    found = pages_of(PAGE, "docs/bodies.html")
    assert [(one["title"], one["url"]) for one in found] == [
        ("Bodies", "docs/bodies.html#bodies"), ("Keys", "docs/bodies.html#keys"),
        ("normal_load", "docs/bodies.html#keys"), ("speed_1", "docs/bodies.html#keys"),
        ("speed_2", "docs/bodies.html#keys"), ("no load", "docs/bodies.html#keys")]
    assert found[0]["text"] == ("A wedge between two blades is a friction damper that rotation "
                                "presses.")
    assert found[2]["text"] == "normal_load constant force" and found[2]["page"] == "Bodies"


def test_the_words_of_users_stand_for_those_of_the_documents() -> None:
    """The words that newcomers looked for are in the glossary, each with a name used here."""
    groups = synonyms(GLOSSARY)
    for word in ("underplatform damper", "cyclic symmetry", "Campbell", "microslip", "penalty",
                 "contact stiffness", "eps", "tail", "tcm", "hdhb", "rigid", "assembly memory"):
        assert any(word in names for names in groups), word
    assert all(len(set(names)) == len(names) > 1 for names in groups)


def test_every_key_and_message_is_in_the_index() -> None:
    index = index_page(ROOT / "docs")
    cells = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", (ROOT / "docs" / "keys.md").read_text(),
                       re.MULTILINE)
    keys = {key for cell in cells for key in re.findall(r"\w+", cell)}
    assert {"modal_damping", "speed_1", "speed_2"} <= keys
    assert all(f"* [`{key}`](keys.md#" in index for key in keys)
    assert index.count("](messages.md#") > 100


def test_a_search_from_a_file_has_excerpts(browser: Any, tmp_path: Path) -> None:
    """No server, another word than the page has, and the excerpt that shows why."""
    static = tmp_path / "_static"
    static.mkdir()
    shutil.copy(ROOT / "docs" / "site" / "static" / "find.js", static)
    (tmp_path / "bodies.html").write_text(PAGE, encoding="utf-8")
    write_search(tmp_path, GLOSSARY)
    template = (ROOT / "docs" / "site" / "templates" / "search.html").read_text(encoding="utf-8")
    (tmp_path / "search.html").write_text(re.sub(r"\{%.*?%\}", "", template), encoding="utf-8")
    page = (tmp_path / "search.html").as_uri()
    for words, address, shown in (("underplatform damper", "#bodies", "friction damper"),
                                  ("normal_load", "#keys", "constant force")):
        browser.get(f"{page}?q={words.replace(' ', '+')}")
        texts = wait_for(browser, "return [...document.querySelectorAll('#found li')].map("
                         "item => [item.querySelector('a').href, item.textContent])", bool)
        assert texts[0][0].endswith(f"bodies.html{address}") and shown in texts[0][1]
