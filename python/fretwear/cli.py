"""Command `fretwear`: each subcommand is a module of this package.

A module offers ``add_arguments(parser)``, which adds its arguments to an argparse parser, and
``main(options) -> int``, which does the work and returns the exit status. It may raise a
`FretwearError`. Exit status: 0 done, 2 usage, 3 bad input, 4 not converged, 5 a file cannot be
read or written, 130 interrupted, 141 nobody reads the output any more, 1 anything else.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import sys
from collections.abc import Sequence

from . import __version__
from ._words import HintingParser
from .errors import FretwearError, OutputError

__all__ = ["COMMANDS", "main"]

#: What a shell makes of SIGPIPE.
_BROKEN_PIPE = 141

#: Subcommand: module below `fretwear`, and what it does.
COMMANDS = {
    "run": ("run_command", "a run of a case, of a sweep by many workers if wanted"),
    "join": ("join_command", "one result of the pieces of a sweep"),
    "modes": ("modes_command", "natural frequencies, free and stuck, beside the sweep"),
    "plot": ("plot", "pictures of a result file"),
    "compare": ("compare", "two result files beside each other"),
    "report": ("report", "one self-contained HTML page of a result file"),
    "export": ("export", "mesh with deformation, contact state and wear, for ParaView"),
    "import": ("importer", "a model file from the matrices of another program"),
    "optimise": ("design.optimise_command", "parameters that make a quantity smallest or largest"),
    "damper": ("damper_command", "a model file with a body that only rotation presses"),
    "calibrate": ("design.calibrate_command", "parameters of a case from measured curves"),
    "explore": ("explore", "a page with sliders: curve, loops and flanks follow"),
    "population": ("population_command", "many disks whose blades differ at random"),
    "study": ("study", "a parameter study on all local cores or a cluster"),
}

#: Modules of this package that make models of their own: no subcommands.
_GENERATORS = ("beam", "disk", "halfplane", "sector")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand; returns the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser(words).parse_args(words)
    try:
        status = int(options.run(options))
        sys.stdout.flush()
    except FretwearError as error:
        return _complain(options.command, error, error.exit_status)
    except BrokenPipeError:
        # Who reads the output has seen enough, such as `head`: no error of ours. What is left in
        # the buffer has nowhere to go, which the interpreter would remark at its end.
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _BROKEN_PIPE
    except OSError as error:
        return _complain(options.command, error, OutputError.exit_status)
    except KeyboardInterrupt:
        return _complain(options.command, "interrupted", 130)
    return status


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """The parser; only the module of the subcommand at hand is imported."""
    parser = HintingParser(
        prog="fretwear", allow_abbrev=False,
        description="Pictures, reports, models and studies around fw_run.",
        epilog="Models to begin with: " + ", ".join(f"python -m fretwear.{name}"
                                                    for name in _GENERATORS) + ".")
    parser.add_argument("--version", action="version", version=f"fretwear {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    wanted = next((word for word in words if not word.startswith("-")), None)
    for name, (module_name, purpose) in COMMANDS.items():
        command = commands.add_parser(name, help=purpose, description=purpose.capitalize() + ".",
                                      allow_abbrev=False)
        if name == wanted:
            module = importlib.import_module(f"fretwear.{module_name}")
            module.add_arguments(command)
            command.set_defaults(run=module.main)
    if wanted in _GENERATORS:
        parser.error(f"{wanted} is no command: its model is made by python -m fretwear.{wanted}")
    return parser


def _complain(command: str, problem: object, status: int) -> int:
    for line in str(problem).splitlines() or [""]:
        print(f"fretwear {command}: error: {line}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
