"""`fretwear plot`, and all plot functions: each takes a result and returns a matplotlib figure.

>>> from fretwear.plot import plot_response                                # doctest: +SKIP
>>> plot_response("frf.h5").savefig("frf.png")                             # doctest: +SKIP
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from .errors import InputError, OutputError
from .export import choose_point
from .export_recovery import model_path
from .plot_convergence import plot_convergence
from .plot_cycle import plot_cycle, plot_harmonics, plot_hysteresis
from .plot_flanks import plot_flanks
from .plot_response import plot_response
from .plot_wear import plot_wear_bars, plot_wear_evolution, plot_wear_maps
from .result import Result

__all__ = ["KINDS", "Choices", "Kind", "add_arguments", "fitting", "main", "plot_convergence",
           "plot_cycle", "plot_flanks", "plot_harmonics", "plot_hysteresis", "plot_response",
           "plot_wear_bars", "plot_wear_evolution", "plot_wear_maps"]


@dataclass(frozen=True)
class Choices:
    """What the user has chosen of a result.

    Attributes
    ----------
    point : int or None
        Point or wear step from 0.
    pairs : list of int or None
        Pairs from 0.
    observe : str or None
        Observed quantity.
    linear : str or None
        Result with every pair stuck.
    modal_mass : float or None
        See ``friction_damping``.
    """

    point: int | None = None
    pairs: list[int] | None = None
    observe: str | None = None
    linear: str | None = None
    modal_mass: float | None = None


@dataclass(frozen=True)
class Kind:
    """A kind of picture: what it shows, when a result has it, and how to draw it."""

    title: str
    fits: Callable[[Result], bool]
    draw: Callable[[Result, Choices], Figure]


def _has(*names: str) -> Callable[[Result], bool]:
    return lambda result: all(name in result for name in names)


def _has_cycle(result: Result) -> bool:
    """Whether the period of the pairs is stored or can be recovered."""
    if "contact/force" not in result:
        return False
    # A wear analysis has one row of both for each of its steps.
    if "wear/depth" in result and len(result.depth) != result.n_points:
        return False
    try:
        return "history/force" in result or model_path(result) is None or (
            "spring%n_springs" not in result.namelist)
    except InputError:
        return False


#: Every kind of picture, in the order in which a report shows them.
KINDS: dict[str, Kind] = {
    "response": Kind(
        "Frequency response", lambda r: r.n_points > 1 and "wear/depth" not in r,
        lambda r, c: plot_response(r, c.observe, linear=c.linear, modal_mass=c.modal_mass)),
    "cycle": Kind(
        "One cycle", lambda r: "coefficients" in r and r.n_points > 0 and (
            "contact/force" not in r or _has_cycle(r)),
        lambda r, c: plot_cycle(r, c.point, c.pairs, c.observe)),
    "hysteresis": Kind("Hysteresis loops", _has_cycle,
                       lambda r, c: plot_hysteresis(r, c.point, c.pairs)),
    "harmonics": Kind("Harmonics", lambda r: "coefficients" in r and r.n_points > 0,
                      lambda r, c: plot_harmonics(r, c.point, c.observe)),
    "flanks": Kind("Contact on the flanks", _has("contact/position", "contact/fraction"),
                   lambda r, c: plot_flanks(r, c.point)),
    "wear_maps": Kind("Wear on the flanks", _has("contact/position", "wear/depth"),
                      lambda r, c: plot_wear_maps(r, c.point)),
    "wear_bars": Kind("Wear depth of the pairs", _has("wear/depth"),
                      lambda r, c: plot_wear_bars(r, c.point)),
    "wear_evolution": Kind("Wear over the cycles", _has("wear/depth", "wear/cycles"),
                           lambda r, c: plot_wear_evolution(r)),
    "convergence": Kind("Convergence", lambda r: r.n_points > 0 and "iterations" in r,
                        lambda r, c: plot_convergence(r)),
}


def fitting(result: Result) -> list[str]:
    """Kinds of pictures for which a result has the data."""
    return [name for name, kind in KINDS.items() if kind.fits(result)]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear plot`."""
    parser.add_argument("result", help="result file")
    parser.add_argument("-o", "--output", metavar="FILE",
                        help="picture, its suffix is the format (png, svg, pdf); with several "
                             "kinds FILE_kind.png and so on (default: RESULT_kind.png in the "
                             "current folder)")
    parser.add_argument("--kind", metavar="KIND,...",
                        help=f"what to draw: {', '.join(KINDS)} (default: all that fits)")
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


def main(options: argparse.Namespace) -> int:
    """Run `fretwear plot`."""
    result = Result(options.result)
    kinds = _kinds(result, options.kind)
    choices = Choices(
        None if options.point is None else choose_point(result, options.point),
        _numbers(options.pairs), options.observe, options.linear, options.modal_mass)
    target = Path(options.output or f"{result.path.stem}.png")
    if not target.absolute().parent.is_dir():
        raise OutputError(f"{target}: there is no folder {target.absolute().parent}")
    for name in kinds:
        alone = len(kinds) == 1 and options.output is not None
        path = target if alone else target.with_name(f"{target.stem}_{name}{target.suffix}")
        try:
            KINDS[name].draw(result, choices).savefig(path)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: {error}") from None  # such as a format not known
        print(path)
    return 0


def _kinds(result: Result, text: str | None) -> list[str]:
    if text is None:
        return fitting(result)
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in KINDS:
            raise InputError(f"--kind {name}: must be among {', '.join(KINDS)}")
    return names


def _numbers(text: str | None) -> list[int] | None:
    """Pair numbers from 1 as indices from 0."""
    if text is None:
        return None
    try:
        return [int(word) - 1 for word in text.split(",")]
    except ValueError:
        raise InputError(f"--pairs {text}: must be numbers separated by commas") from None
