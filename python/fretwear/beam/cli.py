"""Command line of the bolted beam.

Every parameter is an option of the same name with dashes. Exit status: 0 done, 2 usage, 3
parameters not accepted, 5 file not written.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, fields
from pathlib import Path

import h5py
import numpy as np

from .. import __version__
from .._words import HintingParser
from ..errors import FretwearError, InputError
from .model import ReducedBeam, generate
from .parameters import BeamParameters, ParameterError

__all__ = ["main", "read_parameters", "write_model"]

_BAD_PARAMETER, _NOT_WRITTEN = 3, 5


def main(arguments: list[str] | None = None) -> int:
    """Generate a model file as told by the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    given = {item.name: value for item in fields(BeamParameters)
             if (value := getattr(options, item.name)) is not None}
    try:
        beam = generate(BeamParameters(**given))
        write_model(beam, options.output)
    except (ParameterError, InputError) as error:
        print(f"fretwear.beam: {error}", file=sys.stderr)
        return _BAD_PARAMETER
    except (OSError, FretwearError) as error:
        print(f"fretwear.beam: cannot write: {error}", file=sys.stderr)
        return _NOT_WRITTEN
    if not options.quiet:
        frequency, mass = beam.modes(5)
        print(f"{options.output}: {beam.full.mass.shape[0]} degrees of freedom reduced to "
              f"{len(beam.mass)}, {len(beam.full.cell)} pairs")
        print("frequencies with the lap stuck [Hz]: "
              + ", ".join(f"{one:.2f}" for one in frequency))
        print(f"mass of the first mode at the driven point [kg]: {mass[0]:.4f}")
    return 0


def write_model(beam: ReducedBeam, path: str | Path) -> None:
    """Write the beam as one model file, with the parameters that it was made of."""
    if not Path(path).absolute().parent.is_dir():
        raise FileNotFoundError(f"no folder to write {path} into")
    beam.model().to_hdf5(path)
    with h5py.File(path, "r+") as file:
        # They make the file reproducible.
        file.attrs["parameters"] = np.bytes_(json.dumps({"beam": asdict(beam.full.parameters)}))


def read_parameters(path: str | Path) -> BeamParameters:
    """Parameters from which a model file was generated."""
    with h5py.File(path, "r") as file:
        groups = json.loads(bytes(file.attrs.get("parameters", b"{}")))
    if "beam" not in groups:
        raise ValueError(f"{path}: was not written by fretwear.beam")
    return BeamParameters(**groups["beam"])


def _parser() -> argparse.ArgumentParser:
    parser = HintingParser(
        prog="python -m fretwear.beam", allow_abbrev=False,
        description="Generate the reduced model of a beam of two halves with a bolted lap joint "
                    "(units m, kg, s, N).")
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="model file to write")
    parser.add_argument("-q", "--quiet", action="store_true", help="no summary")
    parser.add_argument("--version", action="version", version=f"fretwear {__version__}")
    for item in fields(BeamParameters):
        parser.add_argument("--" + item.name.replace("_", "-"), metavar="X", default=None,
                            type=int if isinstance(item.default, int) else float,
                            help=f"{item.metadata['help']} (default {item.default:g})")
    return parser
