"""`fretwear damper MODEL.h5 -o OUT.h5`: a model with a body that only rotation presses."""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from pathlib import Path

from .dampers import KINDS, Flank, damper
from .errors import InputError
from .model import Model

__all__ = ["add_arguments", "main"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    # Places such as -5,0 are no options.
    parser._negative_number_matcher = re.compile(r"^-[\d.,eE+-]+$")
    parser.add_argument("model", type=Path, metavar="MODEL.h5", help="model file")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.h5",
                        help="model file to write")
    parser.add_argument("--kind", choices=[kind for kind in KINDS if kind != "mesh"],
                        default="wedge", help="what the body is (default: %(default)s)")
    parser.add_argument("--name", default="damper", help="of the body (default: %(default)s)")
    parser.add_argument("--mass", type=float, required=True, help="mass of the body")
    parser.add_argument("--inertia", type=float, nargs="+", metavar="J",
                        help="about z in a plane, about x, y and z in space; without it the body "
                             "does not rotate")
    parser.add_argument("--radius", type=float, default=0.0, metavar="R",
                        help="of the centre of mass from the axis (default: 0, no load by it)")
    parser.add_argument("--angles", type=float, nargs=2, metavar="A",
                        help="of the left and the right flank to the radial direction [degrees]")
    parser.add_argument("--size", type=float, metavar="R", help="radius of a cylinder")
    for where in ("left", "right"):
        parser.add_argument(f"--{where}", nargs="+", metavar="X,Y", default=[],
                            help=f"dofs of the platform under each point of the {where} flank, x,y "
                                 "or x,y,z")
        parser.add_argument(f"--{where}-at", nargs="+", metavar="X,Y", default=[],
                            help="places of these points from the centre of mass; of cylinders "
                                 "along its axis, or none")
    parser.add_argument("--sector", type=int, default=0,
                        help="sector of the platform of the right flank, counted from that of the "
                             "body (default: %(default)s)")
    parser.add_argument("--mu", type=float, required=True, help="friction coefficient")
    parser.add_argument("--stiffness", type=float, nargs=2, metavar="K",
                        help="tangential and normal stiffness of each point, for law = 'penalty'")
    parser.add_argument("--compliance", type=float, nargs=2, metavar="K",
                        help="tangential and normal stiffness of the body at each point")
    parser.add_argument("--law", help="law of the pairs, where the model names those of its own")


def main(options: argparse.Namespace) -> int:
    """Add the body; returns the exit status."""
    stiffness = options.stiffness or (None, None)
    flanks = {where: _flank(options, where) for where in ("left", "right")}
    plain = Model.from_hdf5(options.model)
    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        model = damper(
            plain, options.kind, mass=options.mass,
            inertia=None if options.inertia is None else
            options.inertia[0] if len(options.inertia) == 1 else options.inertia,
            radius=options.radius, angles=options.angles and tuple(options.angles),
            size=options.size, left=flanks["left"], right=flanks["right"], mu=options.mu,
            tangential_stiffness=stiffness[0], normal_stiffness=stiffness[1],
            compliance=options.compliance and tuple(options.compliance), law=options.law,
            name=options.name)
    for remark in remarks:
        print(f"remark: {remark.message}", file=sys.stderr)
    model.to_hdf5(options.output)
    assert model.bodies is not None
    print(f"{options.output}: {model.n_dof} dofs, {model.n_pairs} pairs, "
          f"{len(model.bodies.name)} bodies")
    return 0


def _flank(options: argparse.Namespace, where: str) -> Flank | None:
    dofs, places = getattr(options, where), getattr(options, f"{where}_at")
    if not dofs:
        if places:
            raise InputError(f"--{where}-at: is given without --{where}, the dofs under the points")
        return None
    return Flank([_numbers(f"--{where}", text, int) for text in dofs],
                 [_numbers(f"--{where}-at", text, float) for text in places] or None,
                 options.sector if where == "right" else 0)


def _numbers(argument: str, text: str, kind: type) -> list[float]:
    try:
        return [kind(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{argument}: '{text}' must be numbers with commas between them, such as "
                         "101,102") from None
