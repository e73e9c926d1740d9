"""Matrices by CalculiX in one command: `fretwear import MESH --ccx`.

A mesh of Gmsh becomes a deck of solids with the materials of the command line; its physical groups
become sets of nodes and elements. A deck of one's own is run as it is.
Source: CalculiX CrunchiX USER'S MANUAL version 2.20, "*FREQUENCY" and "Element Types".
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from .calculix import SUFFIXES
from .gmsh import GmshMesh, is_text, read_gmsh

__all__ = ["add_ccx_arguments", "ccx_files", "write_deck"]

Ints = NDArray[np.int64]

#: Solids of meshio by CalculiX. Linear hexahedra are not C3D8I, whose incompatible modes it stores
#: as displacements of nodes that no mesh has.
_SOLIDS = {"tetra": "C3D4", "tetra10": "C3D10", "wedge": "C3D6", "wedge15": "C3D15",
           "hexahedron": "C3D8", "hexahedron20": "C3D20"}
#: First line of decks that are written here, and may be written anew.
_MARK = "** Written by fretwear import --ccx from "
#: Numbers in a line of a deck.
_WIDTH = 10
#: Lines of a run that failed that a message quotes.
_QUOTED = 4


def add_ccx_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand about matrices that CalculiX is to make."""
    parser.add_argument("--ccx", action="store_true",
                        help="let CalculiX (ccx) make the matrices first, of a FILE that is a mesh "
                             "of Gmsh (.msh, with --material) or a deck (.inp) with a step "
                             "*FREQUENCY, SOLVER=MATRIXSTORAGE")
    parser.add_argument("--material", action="append", default=[],
                        metavar="[GROUP=]YOUNG,POISSON,DENSITY",
                        help="of a mesh with --ccx, or of a group of its volumes; repeatable")


def ccx_files(options: argparse.Namespace) -> list[Path]:
    """Files of the command line, the mesh or deck run by CalculiX, if that is wanted: a mesh is
    replaced by its deck, and names the surfaces of contact pairs."""
    if not options.ccx:
        if options.material:
            raise InputError("--material goes with --ccx, of a mesh of Gmsh (.msh)")
        return list(options.files)
    chosen = [path for path in options.files if path.suffix.lower() in (".msh", ".inp")]
    if len(chosen) != 1:
        raise InputError("--ccx needs one FILE that is a mesh of Gmsh (.msh) or a deck (.inp)"
                         + (": there are " + ", ".join(map(str, chosen)) if chosen else ""))
    path = chosen[0]
    others = [other for other in options.files if other != path]
    if not path.is_file():
        raise OutputError(f"{path}: cannot be read: there is no such file")
    if path.suffix.lower() == ".inp":
        if options.material:
            raise InputError(f"--material goes with a mesh of Gmsh (.msh); {path} has its own "
                             "*MATERIAL")
        _run(path, path.parent, path, options.quiet)
        return [path, *others]
    deck = write_deck(path, materials_of(options.material))
    with tempfile.TemporaryDirectory(dir=path.absolute().parent) as name:
        folder = Path(name)
        shutil.copy(deck, folder / deck.name)
        _run(folder / deck.name, folder, deck, options.quiet)
        for end in SUFFIXES:
            (folder / deck.name).with_suffix(end).replace(deck.with_suffix(end))
    if (options.contact or options.contact_neighbour) and options.contact_mesh is None:
        options.contact_mesh = path
    return [deck, *others]


def materials_of(texts: Sequence[str]) -> dict[str, tuple[float, float, float]]:
    """Young's modulus, Poisson's ratio and density by the group of volumes; '' for all."""
    found: dict[str, tuple[float, float, float]] = {}
    for text in texts:
        group, _, values = text.rpartition("=")
        try:
            young, poisson, density = map(float, values.split(","))
        except ValueError:
            raise InputError(f"--material {text}: expected [GROUP=]YOUNG,POISSON,DENSITY, such as "
                             "210000,0.3,7.85e-9 (N, mm, tonne)") from None
        if not (0.0 < young < np.inf and -1.0 < poisson < 0.5 and 0.0 < density < np.inf):
            raise InputError(f"--material {text}: Young's modulus and density must be above 0, "
                             "Poisson's ratio between -1 and 0.5")
        if group.upper() in found:
            raise InputError(f"--material {text}: is the second one of "
                             + (group or "the whole mesh"))
        found[group.upper()] = young, poisson, density
    return found


def write_deck(path: Path, materials: Mapping[str, tuple[float, float, float]]) -> Path:
    """Write the deck of a mesh of Gmsh beside it, as NAME_ccx.inp; returns its place.

    Raises
    ------
    InputError
        The mesh has no solids that CalculiX knows, some of them have no material or two, or a file
        of that name is somebody else's.
    """
    if not is_text(path):
        raise InputError(f"{path}: is not text of format 2.2 or 4.1; write it with gmsh -3 -format "
                         "msh41")
    if not materials:
        raise InputError(f"{path}: needs --material YOUNG,POISSON,DENSITY for the matrices")
    mesh = read_gmsh(path)
    deck = path.with_name(path.stem + "_ccx.inp")
    if deck.is_file() and not deck.read_text(errors="replace").startswith(_MARK):
        raise InputError(f"{deck}: is there and was not written by fretwear import --ccx; move it, "
                         "or import it with --ccx in place of the mesh")
    text = "\n".join(_lines(path, mesh, materials)) + "\n"
    try:
        deck.write_text(text)
    except OSError as error:
        raise OutputError(f"{deck}: cannot be written: {error.strerror}") from None
    return deck


def _lines(path: Path, mesh: GmshMesh,
           materials: Mapping[str, tuple[float, float, float]]) -> Iterator[str]:
    solids = [(kind, table, numbers) for (kind, table), numbers in zip(mesh.blocks, mesh.numbers)
              if kind in _SOLIDS]
    strange = sorted({kind for kind, _ in mesh.blocks if kind not in _SOLIDS
                      and kind.startswith(("tetra", "wedge", "hexahedron", "pyramid"))})
    if strange:
        raise InputError(f"{path}: CalculiX has no {strange[0]}; mesh without pyramids, and with "
                         "Mesh.SecondOrderIncomplete = 1")
    if not solids:
        raise InputError(f"{path}: has no solid cells; mesh in three dimensions (gmsh -3) and put "
                         "the volumes into a physical group")
    used = np.unique(np.concatenate([table.ravel() for _, table, _ in solids]))
    yield _MARK + path.name
    yield "*NODE"
    for node, (x, y, z) in zip(mesh.nodes[used].tolist(), mesh.points[used].tolist()):
        # Of a number CalculiX reads 20 characters, and refuses what is longer.
        yield f"{node}, {x:.13e}, {y:.13e}, {z:.13e}"
    for kind, table, numbers in solids:
        yield f"*ELEMENT, TYPE={_SOLIDS[kind]}"
        for number, row in zip(numbers.tolist(), mesh.nodes[table].tolist()):
            yield from _rows([number, *row])
    cells = np.sort(np.concatenate([numbers for _, _, numbers in solids]))
    yield from _sets(mesh, used, cells)
    yield from _sections(path, mesh, cells, materials)
    yield from ("*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "*END STEP")


def _rows(numbers: Sequence[int]) -> Iterator[str]:
    """Lines that go on in the next one where they end with a comma."""
    for k in range(0, len(numbers), _WIDTH):
        yield ", ".join(map(str, numbers[k:k + _WIDTH])) + ("," if k + _WIDTH < len(numbers)
                                                           else "")


def _set(kind: str, name: str, numbers: Iterable[int]) -> Iterator[str]:
    yield f"*{kind}, {kind}={name}"
    chosen = list(numbers)
    for k in range(0, len(chosen), _WIDTH):
        yield ", ".join(map(str, chosen[k:k + _WIDTH]))


def _sets(mesh: GmshMesh, used: Ints, cells: Ints) -> Iterator[str]:
    """Groups: nodes of all, elements of those of solids."""
    nodes = set(mesh.nodes[used].tolist())
    of_cell = {int(number): row for (_, table), numbers in zip(mesh.blocks, mesh.numbers)
               for number, row in zip(numbers, mesh.nodes[table].tolist())}
    for name, members in mesh.groups.items():
        chosen = sorted({node for cell in members for node in of_cell[cell] if node in nodes})
        if chosen:
            yield from _set("NSET", name, chosen)
        own = np.intersect1d(members, cells)
        if len(own):
            yield from _set("ELSET", name, own.tolist())


def _sections(path: Path, mesh: GmshMesh, cells: Ints,
              materials: Mapping[str, tuple[float, float, float]]) -> Iterator[str]:
    """Elements of each material, and the material; that of all is of those without another."""
    left: set[int] = set(cells.tolist())
    taken: set[int] = set()
    parts: list[tuple[str, list[int]]] = []
    for name in materials:
        if not name:
            continue
        own = set(np.intersect1d(mesh.groups.get(name, []), cells).tolist())
        if not own:
            known = [group for group, members in mesh.groups.items()
                     if len(np.intersect1d(members, cells))]
            raise InputError(f"--material {name}: {path} has no such group of volumes; it has "
                             + (", ".join(known) or "none"))
        if own & taken:
            raise InputError(f"--material {name}: element {min(own & taken)} of {path} has "
                             "another material already")
        parts.append((name, sorted(own)))
        taken |= own
    left -= taken
    if left and "" not in materials:
        raise InputError(f"{path}: {len(left)} elements have no material, {min(left)} for one; "
                         "give --material YOUNG,POISSON,DENSITY for all others")
    if left:
        parts.append(("", sorted(left)))
    for number, (name, members) in enumerate(parts, 1):
        young, poisson, density = materials[name]
        yield from _set("ELSET", f"FRETWEAR_{number}", members)
        yield from (f"*MATERIAL, NAME=FRETWEAR_{number}", "*ELASTIC",
                    f"{young:.12g}, {poisson:.12g}", "*DENSITY", f"{density:.12g}",
                    f"*SOLID SECTION, ELSET=FRETWEAR_{number}, MATERIAL=FRETWEAR_{number}")


def _run(deck: Path, folder: Path, shown: Path, quiet: bool) -> None:
    """Let CalculiX store the matrices of a deck beside it."""
    program = shutil.which("ccx")
    if program is None:
        raise InputError("--ccx: CalculiX is not installed, or ccx is not on the PATH (Debian: apt "
                         f"install calculix-ccx); or run ccx {shown.stem} elsewhere, bring "
                         f"{', '.join(shown.with_suffix(end).name for end in SUFFIXES)} here, and "
                         f"import {shown.name} without --ccx")
    if not quiet:
        print(f"ccx {shown.stem}: makes the matrices", file=sys.stderr)
    # Matrices of an earlier run must not pass for those of this one, and come back where it fails.
    kept = {end: deck.with_suffix(end + ".before") for end in SUFFIXES
            if deck.with_suffix(end).is_file()}
    for end, aside in kept.items():
        deck.with_suffix(end).replace(aside)
    try:
        _store(program, deck, folder, shown)
    except BaseException:
        for end, aside in kept.items():
            aside.replace(deck.with_suffix(end))
        raise
    for aside in kept.values():
        aside.unlink()


def _store(program: str, deck: Path, folder: Path, shown: Path) -> None:
    """Run CalculiX, and see that it has stored all."""
    try:
        done = subprocess.run([program, deck.stem], cwd=folder, capture_output=True, text=True,
                              errors="replace", check=False)
    except OSError as error:
        raise InputError(f"--ccx: {program} cannot be started ({error.strerror}); install it anew "
                         "(Debian: apt install calculix-ccx)") from error
    missing = [end for end in SUFFIXES if not deck.with_suffix(end).is_file()]
    if done.returncode or missing:
        said = (done.stdout + done.stderr).splitlines()
        first = next((k for k, line in enumerate(said) if "*ERROR" in line), None)
        if first is None and missing and not done.returncode:
            raise InputError(f"ccx {shown.stem}: stored no {', '.join(missing)}; the deck needs a "
                             "step with *FREQUENCY, SOLVER=MATRIXSTORAGE")
        part = said[-_QUOTED:] if first is None else said[first:first + _QUOTED]
        raise InputError(f"ccx {shown.stem}: status {done.returncode}; it said: "
                         + " ".join(line.strip() for line in part))
