"""Command line of the shrouded disk.

Every parameter is an option of the same name with dashes. Exit status: 0 done, 2 usage, 3
parameters not accepted, 5 file not written.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import fields
from pathlib import Path

from .. import __version__
from .._words import HintingParser
from .blades import find_blade
from .model import ReducedDisk, build_full, reduce_disk, reduced_system
from .model_file import write_model
from .parameters import DiskParameters, ParameterError
from .recovery import recovery_mesh
from .stress import find_stress

__all__ = ["main"]

_BAD_PARAMETER, _NOT_WRITTEN = 3, 5


def main(arguments: list[str] | None = None) -> int:
    """Generate a model file as told by the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except ParameterError as error:
        print(f"fretwear.disk: {error}", file=sys.stderr)
        return _BAD_PARAMETER
    except OSError as error:
        print(f"fretwear.disk: cannot write: {error}", file=sys.stderr)
        return _NOT_WRITTEN


def _run(options: argparse.Namespace) -> int:
    given = {item.name: value for item in fields(DiskParameters)
             if (value := getattr(options, item.name)) is not None}
    parameters = DiskParameters(**given)
    if not Path(options.output).absolute().parent.is_dir():
        raise FileNotFoundError(f"no folder to write {options.output} into")
    started = time.perf_counter()
    full = build_full(parameters)
    system = reduced_system(full)
    model = reduce_disk(full, system)
    blade = find_blade(full, system.reduction, options.blade) if options.blade else None
    write_model(model, options.output, options.title,
                recovery_mesh(full)[0] if options.mesh else None, blade,
                find_stress(full, system.reduction) if options.stress else None)
    if not options.quiet:
        _summary(model, len(full.free), options.output, time.perf_counter() - started)
        if blade is not None:
            print("frequencies of the blade alone [Hz]: " + ", ".join(
                f"{omega / (2.0 * math.pi):.1f}" for omega in blade.omega))
    return 0


def _summary(model: ReducedDisk, n_free: int, output: str, seconds: float) -> None:
    size = Path(output).stat().st_size / 1e6
    print(f"{output}: {n_free} free degrees of freedom reduced to {len(model.mass)}, "
          f"{len(model.area)} pairs, {size:.2f} MB, {seconds:.1f} s")
    for name, closed in (("shrouds apart", False), ("shrouds held", True)):
        found = ", ".join(f"{k}: {model.frequencies(k, closed=closed, n=1)[0]:.1f}"
                          for k in (0, 1, 2, 4, 9, 18) if 2 * k <= model.parameters.n_sectors)
        print(f"first frequency of nodal diameters [Hz], {name}: {found}")


def _parser() -> argparse.ArgumentParser:
    parser = HintingParser(
        prog="python -m fretwear.disk", allow_abbrev=False,
        description="Generate the reduced model of one sector of a shrouded bladed disk (units "
                    "mm, tonne, s, N).")
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="model file to write")
    parser.add_argument("--mesh", action="store_true",
                        help="also store the mesh and the displacement of its vertices, for "
                             "fretwear export where the generator is not at hand")
    parser.add_argument("--blade", type=int, default=0, metavar="MODES",
                        help="also store so many modes of the blade alone, and its matrices, by "
                             "which blades may differ (&mistuning)")
    parser.add_argument("--stress", action="store_true",
                        help="also store rows of the stress inside of the elements and at their "
                             "vertices (&stress)")
    parser.add_argument("--title", help="title stored in the file")
    parser.add_argument("-q", "--quiet", action="store_true", help="no summary")
    parser.add_argument("--version", action="version", version=f"fretwear {__version__}")
    for item in fields(DiskParameters):
        parser.add_argument("--" + item.name.replace("_", "-"), metavar="X", default=None,
                            type=int if isinstance(item.default, int) else float,
                            help=f"{item.metadata['help']} (default {item.default})")
    return parser
