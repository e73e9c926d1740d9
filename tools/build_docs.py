#!/usr/bin/env python3
"""Build the documents as a site, the reference of the library (FORD) and that of the Python
package (Sphinx), offline.

    tools/build_docs.py OUTPUT_DIRECTORY [site] [fortran] [python]

The references come from the comments of the sources alone; nothing has to be compiled. Any warning
is an error, and no page may ask another host for a script or a style.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from site_search import index_page, write_search

ROOT = Path(__file__).resolve().parents[1]
CONFIGURATION = ROOT / "docs" / "api"

#: Elements of FORD's pages that load scripts, styles and fonts from other hosts, or use them.
REMOTE = re.compile(r"""<script[^>]*\bsrc="https?://[^>]*>\s*</script>
                      | <link[^>]*\bhref="https?://[^>]*>
                      | <script\ type="text/x-mathjax-config">.*?</script>
                      | <script>\s*//\ Enable\ Bootstrap\ tooltips.*?</script>""",
                    re.VERBOSE | re.DOTALL)
#: What must not be left of them.
LOADED = re.compile(r"""<(?:script|link|img)\b[^>]*\b(?:src|href)="(?:https?:)?//[^"]*""")


def run(*command: str | Path) -> str:
    """Everything a command says; ends the program where it fails."""
    done = subprocess.run([str(word) for word in command], cwd=ROOT, text=True, check=False,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        sys.exit(f"{done.stdout}\n{command[0]}: ended with status {done.returncode}")
    return done.stdout


def build_fortran(target: Path) -> list[str]:
    """FORD's pages of src/; what it warned of."""
    version = re.search(r"version = '([0-9.]+)'",
                        (ROOT / "src" / "base" / "version.f90").read_text())
    assert version is not None
    said = run(sys.executable, "-m", "ford", "--quiet", "--output_dir", target,
               "--config", f'version = "{version.group(1)}"', CONFIGURATION / "ford.md")
    for page in target.rglob("*.html"):
        page.write_text(REMOTE.sub("", page.read_text(encoding="utf-8")), encoding="utf-8")
    return [line for line in said.splitlines() if re.search("warning|error", line, re.IGNORECASE)]


def build_python(target: Path) -> list[str]:
    """Sphinx's pages of python/fretwear; a warning ends the program."""
    run(sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html",
        "-d", target.with_name(target.name + ".doctrees"), CONFIGURATION, target)
    return []


def build_site(target: Path) -> list[str]:
    """The documents of the tree with a search; links into the tree are downloads."""
    with tempfile.TemporaryDirectory() as folder:
        stage = Path(folder)
        for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE", "CITATION.cff"):
            shutil.copy(ROOT / name, stage)
        for name in ("docs", "example"):
            shutil.copytree(ROOT / name, stage / name,
                            ignore=shutil.ignore_patterns("*.h5", "api", "site"))
        for name in ("conf.py", "contents.md"):
            shutil.copy(ROOT / "docs" / "site" / name, stage)
        for name in ("static", "templates"):
            shutil.copytree(ROOT / "docs" / "site" / name, stage / name)
        (stage / "docs" / "index_of_words.md").write_text(index_page(ROOT / "docs"),
                                                          encoding="utf-8")
        for page in stage.rglob("*.md"):
            page.write_text(_whole_links(page.read_text(encoding="utf-8"), page.parent),
                            encoding="utf-8")
        run(sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html",
            "-D", "root_doc=contents", "-d", stage / "_build", stage, target)
    shutil.copy(target / "README.html", target / "index.html")
    write_search(target, (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8"))
    return []


#: Target of a Markdown link, without its anchor.
_TARGET = re.compile(r"(?<=\]\()([^)#: ]+)(?=[)#])")


def _whole_links(text: str, folder: Path) -> str:
    """A link to a folder leads to its page, as it does where the tree is read."""
    def led(match: re.Match[str]) -> str:
        page = folder / match.group(1) / "README.md"
        return f"{match.group(1).rstrip('/')}/README.md" if page.is_file() else match.group(1)
    return _TARGET.sub(led, text)


BUILDERS = {"site": build_site, "fortran": build_fortran, "python": build_python}


def main() -> None:
    """Build what is asked for, all without a word."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path, help="directory of the pages")
    parser.add_argument("parts", nargs="*", metavar="site|fortran|python",
                        help="all by default")
    options = parser.parse_args()
    for part in options.parts or BUILDERS:
        if part not in BUILDERS:
            parser.error(f"{part}: must be among {', '.join(BUILDERS)}")
        target = options.output.resolve() / part
        target.mkdir(parents=True, exist_ok=True)
        problems = BUILDERS[part](target)
        for page in sorted(target.rglob("*.html")):
            problems += [f"{page}: loads {found}"
                         for found in LOADED.findall(page.read_text(encoding="utf-8"))]
        if problems:
            sys.exit("\n".join(problems))
        print(target / "index.html")


if __name__ == "__main__":
    main()
