"""The reference of the library (FORD) and of the Python package (Sphinx) builds without a warning,
without the network, and has a page for everything that is public."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

#: Nothing answers there: what asks for the network fails.
OFFLINE = dict.fromkeys(("http_proxy", "https_proxy", "all_proxy"), "http://127.0.0.1:9")


def build(part: str, target: Path) -> Path:
    """Build one part; the folder of its pages."""
    done = subprocess.run([sys.executable, ROOT / "tools" / "build_docs.py", target, part],
                          env={**os.environ, **OFFLINE}, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return target / part


def names(page: Path) -> set[str]:
    """Targets of the links that a page offers for its own headings."""
    return set(re.findall(r'id="([\w.]+)"', page.read_text(encoding="utf-8")))


@pytest.mark.skipif(find_spec("ford") is None, reason="FORD is not installed")
def test_the_library_has_its_reference(tmp_path: Path) -> None:
    pages = build("fortran", tmp_path)
    modules = set()
    for source in sorted((ROOT / "src").rglob("*.[fF]90")):
        modules |= set(re.findall(r"^module (?!procedure)(\w+)", source.read_text(), re.MULTILINE))
    assert len(modules) > 100
    assert {module for module in modules
            if not (pages / "module" / f"{module}.html").exists()} == set()
    assert "session_type" in (pages / "module" / "fretwear.html").read_text(encoding="utf-8")
    # Comments arrive there.
    assert "Newton's method with a backtracking line search" in (
        pages / "module" / "fw_newton.html").read_text(encoding="utf-8")


@pytest.mark.skipif(find_spec("sphinx") is None or find_spec("numpydoc") is None,
                    reason="Sphinx or numpydoc is not installed")
def test_the_package_has_its_reference(tmp_path: Path) -> None:
    import fretwear

    pages = build("python", tmp_path)
    found = set().union(*(names(page) for page in pages.glob("*.html")))
    missing = set(fretwear.__all__) - {"__version__"} - {name.rpartition(".")[2] for name in found}
    assert missing == set()
    # The modules that the package tells of are those of the reference.
    told = re.search(r"^Modules\n-+\n(.*)", fretwear.__doc__ or "", re.MULTILINE | re.DOTALL)
    assert told is not None
    listed = set(re.findall(r"fretwear\.\w+", told.group(1)))
    assert len(listed) > 10
    assert {f"module-{name}" for name in listed} - set().union(
        *(set(re.findall(r'id="(module-[\w.]+)"', page.read_text(encoding="utf-8")))
          for page in pages.glob("*.html"))) == set()
    assert "fretwear.Result.amplitude_of" in found or (
        "fretwear.result.Result.amplitude_of" in found)


@pytest.mark.skipif(find_spec("sphinx") is None or find_spec("myst_parser") is None,
                    reason="Sphinx or MyST is not installed")
def test_the_documents_are_a_site_with_a_search(tmp_path: Path) -> None:
    """Every document is a page; its links and anchors lead somewhere, or Sphinx would warn."""
    pages = build("site", tmp_path)
    for document in [*ROOT.glob("docs/*.md"), *ROOT.glob("docs/benchmarks/*.md"),
                     *ROOT.glob("example/*/README.md"), ROOT / "README.md"]:
        assert (pages / document.relative_to(ROOT).with_suffix(".html")).is_file()
    assert "A first case" in (pages / "index.html").read_text(encoding="utf-8")
    assert "hysteresi" in (pages / "searchindex.js").read_text(encoding="utf-8")
