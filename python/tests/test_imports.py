"""The package as a graph: no circles, every module alone in a fresh interpreter."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import fretwear

PACKAGE = Path(fretwear.__file__).parent
NAMES = sorted(
    ".".join(("fretwear", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__") for path in PACKAGE.rglob("*.py"))
#: The program of the command runs as it is imported.
ALONE = [name for name in NAMES if not name.endswith("__main__")]
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


#: Imports each module in a process that has nothing of the package, only what `import fretwear`,
#: which comes before any of its modules, and pictures bring from elsewhere: a fork takes a tenth of
#: the time of a new interpreter.
EACH_ALONE = """
import contextlib, importlib, json, os, sys, tempfile, traceback
import fretwear
for package in ("matplotlib.pyplot", "skfem"):
    with contextlib.suppress(ImportError):
        importlib.import_module(package)
for name in [name for name in sys.modules if name.split(".")[0] == "fretwear"]:
    del sys.modules[name]
said = {}
for name in sys.argv[1:]:
    with tempfile.TemporaryFile("w+") as error:
        child = os.fork()
        if child == 0:
            try:
                importlib.import_module(name)
            except BaseException:
                error.write(traceback.format_exc())
                error.flush()
                os._exit(1)
            os._exit(0)
        status = os.waitpid(child, 0)[1]
        error.seek(0)
        said[name] = error.read() + (f"status {status}" if status else "")
print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def said_alone() -> dict[str, str]:
    """What is said when a module is imported alone: nothing where it can be."""
    done = subprocess.run([sys.executable, "-c", EACH_ALONE, *ALONE], capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", ALONE)
def test_every_module_can_be_imported_alone(name: str, said_alone: dict[str, str]) -> None:
    for module, package in NEEDS.items():
        if name.startswith(module):
            pytest.importorskip(package)
    assert not said_alone[name]
