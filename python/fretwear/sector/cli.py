"""Command line of the sector generator.

Every parameter of the geometry, the material and the discretisation is an option of the same
name with dashes. Exit status: 0 done, 2 usage, 3 parameters not accepted, 5 file not written.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import fields
from pathlib import Path
from typing import Any, NoReturn

from .. import __version__
from .._progress import stages
from .._words import near_options
from ..errors import InputError
from ..factors import ENGINES, chosen_engine
from .model import (
    FullModel,
    ReducedModel,
    build_full,
    needs,
    reduce_model,
    reduced_system,
)
from .model_file import write_model
from .parameters import (
    Discretisation,
    Geometry,
    Material,
    ParameterError,
    Retention,
    SectorParameters,
    patch_grid,
)
from .recovery import recovery_mesh
from .stress import reduced_stress, stress_points

__all__ = ["main"]

_GROUPS: tuple[type, ...] = (Geometry, Material, Retention, Discretisation)
_USAGE, _BAD_PARAMETER, _NOT_WRITTEN = 2, 3, 5
_RPM = math.pi / 30.0
#: What takes longer [s], or more [bytes], is said before it begins.
_LONG, _MUCH = 60.0, 2.0e9


class _Parser(argparse.ArgumentParser):
    """Parser that names the nearest option instead of printing all of them."""

    def error(self, message: str) -> NoReturn:
        hint = near_options(self, message)
        self.exit(_USAGE, f"fretwear.sector: {message}{hint} (--help lists all options)\n")


def main(arguments: list[str] | None = None) -> int:
    """Generate a model file as told by the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except (InputError, ParameterError) as error:
        print(f"fretwear.sector: {error}", file=sys.stderr)
        return _BAD_PARAMETER
    except OSError as error:
        print(f"fretwear.sector: cannot write: {error}", file=sys.stderr)
        return _NOT_WRITTEN


def _run(options: argparse.Namespace) -> int:
    parameters = _parameters(options)
    for target in filter(None, (options.output, options.picture)):
        # Said before the work, not after it.
        if not Path(target).absolute().parent.is_dir():
            raise FileNotFoundError(f"no folder to write {target} into")
    chosen_engine(options.factor)   # refused before the work
    started = time.perf_counter()
    full = build_full(parameters, stages(quiet=options.quiet),
                      None if options.quiet else _say_what_it_takes, options.factor)
    system = reduced_system(full)
    reduced = reduce_model(full, system)
    mesh = recovery_mesh(full, system)[0] if options.mesh else None
    stress = None
    if options.stress:
        points = stress_points(full.sector.mesh, full.sector.body, parameters.material)
        stress = reduced_stress(points, full.free, system.reduction, full.centrifugal)
    write_model(reduced, options.output, options.title, mesh, stress)
    if options.picture:
        from .picture import draw_sector  # matplotlib only where a picture is wanted

        draw_sector(full, options.picture)
    if not options.quiet:
        _summary(full, reduced, options.output, time.perf_counter() - started)
    return 0


def _say_what_it_takes(n_dof: int, n_contact: int) -> None:
    """Time and memory, where they are worth a word."""
    seconds, memory = needs(n_dof, n_contact)
    if seconds > _LONG or memory > _MUCH:
        print(f"fretwear.sector: {n_dof} degrees of freedom and {n_contact} contact coordinates "
              f"take roughly {max(1, round(seconds / 60.0))} min and {memory / 1e9:.0f} GB, "
              "an estimate fitted to two small meshes (a coarser mesh takes less: "
              "--airfoil-rows, --blade-columns, --disk-rows)", file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="python -m fretwear.sector", usage="%(prog)s -o FILE [--pairs N] [options]",
        allow_abbrev=False,
        description="Generate the reduced model of a bladed-disk sector with a dovetail root "
                    "(units mm, tonne, s, N).")
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="model file to write")
    parser.add_argument("--pairs", type=int, metavar="N",
                        help="contact pairs on both flanks, such as 16, 48, 768; sets the patches "
                             "of a flank to the most nearly square grid")
    parser.add_argument("--picture", metavar="PNG", help="also draw the mesh")
    parser.add_argument("--mesh", action="store_true",
                        help="also store the mesh and the displacement of its vertices, for "
                             "fretwear export where the generator is not at hand")
    parser.add_argument("--stress", action="store_true",
                        help="also store rows of the stress inside of the elements and at their "
                             "vertices (&stress)")
    parser.add_argument("--factor", choices=ENGINES, default="auto",
                        help="who factors the stiffness: the first of mumps, cholmod and superlu "
                             "that is installed, or one of them by name (default auto)")
    parser.add_argument("--title", help="title stored in the file")
    parser.add_argument("-q", "--quiet", action="store_true", help="no summary")
    parser.add_argument("--version", action="version", version=f"fretwear {__version__}")
    for group in _GROUPS:
        section = parser.add_argument_group(group.__name__.lower())
        for item in fields(group):
            section.add_argument(
                "--" + item.name.replace("_", "-"), metavar="X", default=None,
                type=int if isinstance(item.default, int) else float,
                help=f"{item.metadata['help']} (default {item.default})")
    return parser


def _parameters(options: argparse.Namespace) -> SectorParameters:
    """Parameters with what the command line overrides."""
    given: dict[type, dict[str, Any]] = {
        group: {item.name: value for item in fields(group)
                if (value := getattr(options, item.name)) is not None} for group in _GROUPS}
    if options.pairs is not None:
        patches = given[Discretisation]
        if {"axial_patches", "slope_patches"} & patches.keys():
            raise ParameterError("--pairs cannot be combined with --axial-patches or "
                                 "--slope-patches")
        patches["axial_patches"], patches["slope_patches"] = patch_grid(options.pairs)
    return SectorParameters(Geometry(**given[Geometry]), Material(**given[Material]),
                            Discretisation(**given[Discretisation]),
                            Retention(**given[Retention]))


def _summary(full: FullModel, reduced: ReducedModel, path: str, seconds: float) -> None:
    print(f"{path}: {len(reduced.mass)} coordinates, {reduced.n_pairs} pairs, from "
          f"{len(full.free)} free degrees of freedom in {seconds:.1f} s")
    print("stuck frequencies [Hz]")
    for rpm in (0.0, 2000.0, 4400.0, 8000.0):
        values = reduced.frequencies(rpm * _RPM)[:5]
        print(f"  {rpm:6.0f} rpm" + "".join(f"{value:10.2f}" for value in values))
