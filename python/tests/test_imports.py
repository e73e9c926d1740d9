"""The package as a graph: no circles, every module alone in a fresh interpreter."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import fretwear

PACKAGE = Path(fretwear.__file__).parent
NAMES = sorted(
    ".".join(("fretwear", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__") for path in PACKAGE.rglob("*.py"))
#: What optional packages some modules need at once.
NEEDS = {"fretwear.disk": "skfem", "fretwear.sector": "skfem"}


def imports(name: str) -> set[str]:
    """Modules of the package that a module imports anywhere, but for type checkers."""
    path = PACKAGE.joinpath(*name.split(".")[1:])
    inside = path.is_dir()
    source = (path / "__init__.py" if inside else path.with_suffix(".py")).read_text()
    tree = ast.parse(source)
    typing_only = {node for block in ast.walk(tree) if isinstance(block, ast.If)
                   and getattr(block.test, "id", "") == "TYPE_CHECKING"
                   for node in ast.walk(block)}
    found: set[str] = set()
    for node in ast.walk(tree):
        if node in typing_only or not isinstance(node, ast.ImportFrom):
            continue
        start = name.split(".") if inside else name.split(".")[:-1]
        base = start[:len(start) - node.level + 1] if node.level else []
        module = ".".join([*base, *(node.module or "").split(".")]).rstrip(".")
        if module.split(".")[0] != "fretwear":
            continue
        for alias in node.names:
            below = f"{module}.{alias.name}"
            found.add(below if below in NAMES else module)
    return found - {name}


def test_there_are_no_circles() -> None:
    graph = {name: imports(name) for name in NAMES}
    assert graph["fretwear.plot.kinds"] >= {"fretwear.plot.response", "fretwear.result"}
    order: list[str] = []

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " -> ".join((*path[path.index(name):], name))
        if name not in order:
            for other in sorted(graph.get(name, ())):
                visit(other, (*path, name))
            order.append(name)

    for name in NAMES:
        visit(name, ())


def test_no_folder_reaches_up_to_what_is_made_of_it() -> None:
    """The structure and the results know neither pictures, meshes nor studies."""
    upper = ("fretwear.plot", "fretwear.export", "fretwear.study", "fretwear.report",
             "fretwear.compare", "fretwear.cli")
    for name in ("result", "case", "model", "analyses", "operators", "rows", "mesh"):
        assert not [other for other in imports(f"fretwear.{name}") if other.startswith(upper)]


@pytest.mark.parametrize("name", [name for name in NAMES if not name.endswith("__main__")])
def test_every_module_can_be_imported_alone(name: str) -> None:
    for module, package in NEEDS.items():
        if name.startswith(module):
            pytest.importorskip(package)
    done = subprocess.run([sys.executable, "-c", f"import {name}"], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stderr
