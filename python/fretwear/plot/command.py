"""`fretwear plot`: pictures of a result, of several beside each other, or of a study."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from matplotlib.figure import Figure

from .._words import did_you_mean
from ..errors import AbsentError, InputError, OutputError
from ..result import Result
from ..rows import choose_point
from ..study.table import is_table
from .backbone import plot_backbone
from .campaigns import plot_campbell, plot_damping, plot_force
from .kinds import KINDS, Choices, fitting
from .table import plot_table
from .together import plot_envelope, plot_responses

__all__ = ["add_arguments", "main"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear plot`."""
    parser.add_argument("result", nargs="+",
                        help="result file, or the table of a study; of several results the "
                             "responses are drawn into one picture")
    parser.add_argument("-o", "--output", metavar="FILE",
                        help="picture, its suffix is the format (png, svg, pdf); with several "
                             "kinds FILE_kind.png and so on (default: RESULT_kind.png in the "
                             "current folder)")
    parser.add_argument("--kind", metavar="KIND,...",
                        help=f"what to draw: {', '.join(KINDS)} (default: all that fits); of "
                             f"several results {', '.join(TOGETHER)}")
    parser.add_argument("--point", type=int, metavar="N",
                        help="solution point or wear step, from 1; -1 is the last (default: the "
                             "largest amplitude, or the last wear step)")
    parser.add_argument("--pairs", metavar="N,...",
                        help="pairs to draw, from 1 (default: those that dissipate most)")
    parser.add_argument("--observe", metavar="NAME", help="observed quantity (default: the first)")
    parser.add_argument("--linear", metavar="FILE",
                        help="result with every pair stuck, drawn dashed in the response")
    parser.add_argument("--modal-mass", type=float, metavar="M",
                        help="modal mass at the observed quantity: damping from the dissipation")
    parser.add_argument("--speed", type=float, metavar="OMEGA",
                        help="rotation speed [rad/s] of the line in a SAFE diagram")
    parser.add_argument("--nodal-diameter", type=int, metavar="K",
                        help="of a Campbell diagram (default: 0)")


#: What is drawn of several results.
TOGETHER = ("response", "backbone", "campbell", "damping", "force", "envelope")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear plot`."""
    if len(options.result) > 1:
        return _draw_together(options)
    source = options.result[0]
    if is_table(source):
        _only(options, "the table of a study")
        return _save(plot_table(source), options.output, Path(source).stem)
    return _draw_kinds(Result(source), options)


def _draw_together(options: argparse.Namespace) -> int:
    """The picture of several results."""
    kind = options.kind or "response"
    if kind not in TOGETHER:
        raise InputError(f"--kind {options.kind}: of several results one of "
                         f"{', '.join(TOGETHER)} is drawn" + did_you_mean(kind, words=TOGETHER))
    _only(options, "several results", "kind",
          "nodal_diameter" if kind == "campbell" else "observe")
    stem = f"{Path(options.result[0]).stem}_{'together' if kind == 'response' else kind}"
    if kind == "campbell":
        figure = plot_campbell(options.result, options.nodal_diameter)
    else:
        draw = {"response": plot_responses, "backbone": plot_backbone, "damping": plot_damping,
                "force": plot_force, "envelope": plot_envelope}
        figure = draw[kind](options.result, options.observe)
    return _save(figure, options.output, stem)


def _draw_kinds(result: Result, options: argparse.Namespace) -> int:
    """Every kind of picture that was asked for, or that fits."""
    if options.nodal_diameter is not None:
        raise InputError("--nodal-diameter goes with several results and --kind campbell")
    kinds = _kinds(result, options.kind)
    choices = Choices(
        None if options.point is None else choose_point(result, options.point),
        _numbers(options.pairs), options.observe, options.linear, options.modal_mass,
        options.speed)
    target = _target(options.output, Path(result.name).stem)
    for name in kinds:
        alone = len(kinds) == 1 and options.output is not None
        path = target if alone else target.with_name(f"{target.stem}_{name}{target.suffix}")
        try:
            figure = KINDS[name].draw(result, choices)
        except AbsentError as error:
            if options.kind is not None:
                raise
            print(f"fretwear plot: {name}: {error}", file=sys.stderr)
            continue
        _write(figure, path)
    return 0


def _only(options: argparse.Namespace, what: str, *served: str) -> None:
    """Refuse options that a picture of several results or of a study does not take."""
    for name in ("kind", "point", "pairs", "observe", "linear", "modal_mass", "speed",
                 "nodal_diameter"):
        if name not in served and getattr(options, name) is not None:
            raise InputError(f"--{name.replace('_', '-')} does not go with {what}")


def _target(output: str | None, stem: str) -> Path:
    target = Path(output or f"{stem}.png")
    if not target.absolute().parent.is_dir():
        raise OutputError(f"{target}: there is no folder {target.absolute().parent}")
    return target


def _save(figure: Figure, output: str | None, stem: str) -> int:
    _write(figure, _target(output, stem))
    return 0


def _write(figure: Figure, path: Path) -> None:
    try:
        figure.savefig(path)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None  # such as a format not known
    print(path)


def _kinds(result: Result, text: str | None) -> list[str]:
    if text is None:
        return fitting(result)
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name in TOGETHER and name not in KINDS:
            raise InputError(f"--kind {name}: is drawn of several results: name two or more, at "
                             "several loads")
        if name not in KINDS:
            raise InputError(f"--kind {name}: must be among {', '.join(KINDS)}"
                             + did_you_mean(name, words=KINDS))
    return names


def _numbers(text: str | None) -> list[int] | None:
    """Pair numbers from 1 as indices from 0."""
    if text is None:
        return None
    try:
        return [int(word) - 1 for word in text.split(",")]
    except ValueError:
        raise InputError(f"--pairs {text}: must be numbers separated by commas") from None
