"""`fretwear export`: the mesh of a model with the deformation of a result, for ParaView."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, OutputError
from ..result import Result
from ..rows import choose_point
from .fields import Fields

if TYPE_CHECKING:
    import meshio

__all__ = ["add_arguments", "main"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear export`."""
    parser.add_argument("result", help="result file")
    parser.add_argument("output", help="file to write, .vtu (or another format of meshio)")
    parser.add_argument("--point", type=int, metavar="N",
                        help="solution point or wear step, from 1; -1 is the last (default: the "
                             "largest amplitude, or the last wear step)")
    parser.add_argument("--phase", type=float, metavar="DEGREES",
                        help="instant of the period for `displacement` (default: where the first "
                             "observed quantity is largest)")
    parser.add_argument("--frames", type=int, metavar="N",
                        help="write N instants of a period as OUTPUT_000.vtu, ..., and OUTPUT.pvd "
                             "that plays them")
    parser.add_argument("--sectors", metavar="N",
                        help="how many sectors of a cyclic structure, or `all` (default: 1)")
    parser.add_argument("--axis", metavar="AXIS", default="z",
                        help="axis about which the next sector is turned: x, y, z, or -x, -y, -z "
                             "for the other way; write --axis=-z (default: z)")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear export`."""
    result, output = Result(options.result), Path(options.output)
    point = choose_point(result, options.point)
    if options.frames is None:
        written = [(output, options.phase)]
    elif options.frames < 1:
        raise InputError(f"--frames {options.frames}: must be at least 1")
    else:
        written = [(output.with_name(f"{output.stem}_{k:03d}{output.suffix}"),
                    360.0 * k / options.frames) for k in range(options.frames)]
    fields = Fields(result, point, sectors=_sectors(options.sectors), axis=options.axis)
    for path, phase in written:
        _write(fields.at(phase), path)
    if options.frames is not None:
        _write_collection(output.with_suffix(".pvd"), [path for path, _ in written])
    print(fields.summary())
    return 0


def _sectors(text: str | None) -> int:
    """How many sectors; 0 are all."""
    if text is None or text == "all":
        return 1 if text is None else 0
    if not text.isdigit() or int(text) < 1:
        raise InputError(f"--sectors {text}: must be a number of at least 1, or all")
    return int(text)


def _write(mesh: meshio.Mesh, path: Path) -> None:
    if not path.absolute().parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.absolute().parent}")
    import meshio

    try:
        mesh.write(path)
    except (meshio.WriteError, meshio.ReadError, KeyError) as error:
        raise InputError(f"{path}: meshio cannot write this: {error}") from None


def _write_collection(path: Path, files: list[Path]) -> None:
    """ParaView collection of instants; time runs from 0 to 1 over the period."""
    entries = "".join(f'    <DataSet timestep="{k / len(files):.6f}" file="{name.name}"/>\n'
                      for k, name in enumerate(files))
    path.write_text('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n'
                    f"  <Collection>\n{entries}  </Collection>\n</VTKFile>\n")
