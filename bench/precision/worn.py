"""Time against the error of the worn profile for every scheme of wear, on the sector."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from matplotlib.ticker import LogLocator, NullFormatter

from bench.common.layout import COLOURS, new_figure, table
from bench.common.measure import Bench
from bench.common.wear_runs import (
    FAST,
    N_PAIRS,
    Scheme,
    WearRun,
    difference,
    rosenbrock,
    run_wear,
    stage_order,
)

__all__ = ["WearPoint", "measure_wear_precision", "write_wear_precision"]

#: Parts of the final depth that the largest depth grows by in a step.
STEPS = (5, 10, 20, 40, 80)
#: Errors that set the steps of the higher orders [of the largest depth].
TOLERANCES = (0.3, 0.1, 0.03, 0.01, 0.003)
#: Error of the run that says what the final profile is.
REFERENCE, QUICK_REFERENCE = 1e-5, 1e-2


@dataclass(frozen=True)
class WearPoint:
    """A run to the steady state; error and cpu [s] are NaN where none was reached."""

    scheme: str
    setting: str
    n_steps: int
    n_solves: int
    error: float
    cpu: float


def measure_wear_precision(bench: Bench) -> list[WearPoint]:
    """Every scheme over its settings."""
    reference = run_wear(bench, "precision_reference",
                         stage_order(2, QUICK_REFERENCE if bench.quick else REFERENCE))
    if not reference.is_steady:
        raise RuntimeError("the reference of the wear runs has no steady state")
    return [point(scheme, setting, run_wear(bench, "precision_wear", scheme), reference)
            for scheme, setting in settings(reference.deepest, bench.quick)]


def settings(deepest: float, quick: bool) -> Iterator[tuple[Scheme, str]]:
    """Schemes with their steps or tolerances."""
    steps, tolerances = (STEPS[:2], TOLERANCES[:2]) if quick else (STEPS, TOLERANCES)
    for n in steps:
        step = {"max_depth_step": deepest / n}
        yield Scheme("explicit, order 1", {"scheme": "explicit"} | step), f"1/{n}"
        yield Scheme("explicit, order 2", {"scheme": "explicit", "order": 2} | step), f"1/{n}"
        yield Scheme("implicit, order 1", {"scheme": "implicit"} | step), f"1/{n}"
        yield Scheme("pseudo-time, order 1", {"scheme": "pseudo_time"} | step), f"1/{n}"
    for tolerance in tolerances:
        for order in (2, 3, 4):
            yield stage_order(order, tolerance), f"{tolerance:g}"
        chosen = rosenbrock(tolerance)
        yield Scheme("pseudo-time, Rosenbrock", chosen.wear, chosen.pseudo_time), f"{tolerance:g}"
        yield Scheme("pseudo-time, BDF", chosen.wear, {"scheme": "bdf"}), f"{tolerance:g}"


def point(scheme: Scheme, setting: str, run: WearRun, reference: WearRun) -> WearPoint:
    """What a run is worth."""
    error = difference(run.depth, reference.depth) if run.is_steady else math.nan
    return WearPoint(scheme.name, setting, run.n_steps, run.n_solves, error,
                     run.cpu if run.is_steady else math.nan)


def write_wear_precision(images: Path, points: list[WearPoint]) -> str:
    """Draw the picture; the text of the part."""
    names = list(dict.fromkeys(p.scheme for p in points))
    draw(images / "benchmark_wear.png", points, names)
    rows = [(p.scheme, p.setting, p.n_steps, p.n_solves,
             "no steady state" if math.isnan(p.error) else f"{p.error:.1e}",
             "-" if math.isnan(p.cpu) else f"{p.cpu:.2f}")
            for name in names for p in points if p.scheme == name]
    return "\n".join([
        "### Wear: error of the profile against run time", "",
        f"The sector with {N_PAIRS} pairs at {FAST.name}, H = 3, from the unworn joint to its "
        "steady state. The error is the largest difference of the depth of a pair from the profile "
        "of order 2 with an error tolerance of 1e-5, as a part of the largest depth; the time is "
        "that of the processor for the whole program, in one thread. First-order schemes (and the "
        "explicit one of order 2) take steps in which the largest depth grows by the part of its "
        "final value in the table; the others set their steps by the tolerance there.", "",
        "![Error of the worn profile against run time](images/benchmark_wear.png)", "",
        *table(["scheme", "step or tolerance", "steps", "linear solutions", "error",
                "time [s]"], rows)])


def draw(path: Path, points: list[WearPoint], names: list[str]) -> None:
    """One line for each scheme."""
    figure, axes = new_figure()
    marks = ("o-", "s-", "^-", "v--", "D--", "x--", "*:", "P:", "<-.")
    for k, (name, mark) in enumerate(zip(names, marks)):
        found = [p for p in points if p.scheme == name and not math.isnan(p.error)]
        axes.plot([p.cpu for p in found], [p.error for p in found], mark,
                  color=COLOURS[k % len(COLOURS)], markersize=5, linewidth=1.1, label=name)
    axes.set(xscale="log", yscale="log", xlabel="processor time [s]",
             ylabel="error of the profile / largest depth")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.3)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=8)
    figure.savefig(path)
