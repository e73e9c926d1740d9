"""Order of convergence in n_time: events against instants, H being given."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bench.common.layout import COLOURS, sentence, table
from bench.common.measure import Bench, Floats
from bench.common.oscillators import Case, jenkins, planar, rigid, two_dof

__all__ = ["Limit", "measure_events", "write_events", "write_pairs"]

N_HARMONICS = 7
#: From 4H + 2 on.
INSTANTS = (30, 64, 128, 256, 512, 1024, 4096, 16384)
#: Events do not need so many.
LARGEST_EVENTS = 1024
SAMPLINGS = ("uniform", "events")
#: Instants of events that stand for the limit.
LIMIT = 4096
#: Time of an evaluation of a pair with two directions at N_HARMONICS [us], and its error.
PAIR_TARGET, PAIR_ERROR = 50.0, 1e-6
#: Error of the solutions themselves.
ROUND_OFF = 1e-11


@dataclass(frozen=True)
class Limit:
    """Distance of a solution from the limit, and its time [s]; NaN where it did not converge."""

    case: str
    sampling: str
    n_time: int
    error: float
    seconds: float


def measure_events(bench: Bench) -> list[Limit]:
    """Both samplings on every number of instants."""
    cases = [jenkins("jenkins_F1.0_w1.2"), two_dof("E_separation"), rigid(two_dof("E_separation")),
             *(named(planar(key), f"planar friction, {key}") for key in "ABC")]
    return [limit for case in cases for limit in approach(bench, case)]


def named(case: Case, name: str) -> Case:
    """The same under another name."""
    return Case(name, case.groups, case.reference)


def approach(bench: Bench, case: Case) -> list[Limit]:
    """One case."""
    exact = bench.run(with_instants(case, "events", LIMIT)).coefficients[0]
    return [distance(bench, case, sampling, n_time, exact) for sampling in SAMPLINGS
            for n_time in (INSTANTS[:3] if bench.quick else INSTANTS)
            if sampling == "uniform" or n_time <= LARGEST_EVENTS]


def with_instants(case: Case, sampling: str, n_time: int) -> dict[str, dict[str, object]]:
    """The groups of a case."""
    return case.groups | {"solver": {"tolerance": 1e-12},
                          "harmonics": {"n_harmonics": N_HARMONICS, "sampling": sampling,
                                        "n_time": n_time}}


def distance(bench: Bench, case: Case, sampling: str, n_time: int, exact: Floats) -> Limit:
    """Relative L2 distance of all observed quantities."""
    seconds, run = bench.repeat(with_instants(case, sampling, n_time),
                                lambda run: float(run.seconds.mean()), most=3, budget=1.0)
    error = float(np.linalg.norm(run.coefficients[0] - exact) / np.linalg.norm(exact))
    return Limit(case.name, sampling, n_time, error, seconds if run.converged[0] else math.nan)


def write_events(images: Path, limits: list[Limit]) -> str:
    """Draw the picture; the text of the part."""
    names = list(dict.fromkeys(limit.case for limit in limits))
    draw(images / "benchmark_events.png", limits, names)
    numbers = sorted({limit.n_time for limit in limits})
    rows = [(sentence(name), sampling, *(cell(find(limits, name, sampling, n)) for n in numbers),
             order(limits, name, sampling)) for name in names for sampling in SAMPLINGS]
    return "\n".join([
        "## Events: convergence in n_time", "",
        f"Relative distance of the solution with H = {N_HARMONICS} from that of the same H with "
        f"events and n_time = {LIMIT}, and the time of the point [ms]; the truncation of the "
        "series is not part of it. Order is the slope of the last three distances above "
        f"{ROUND_OFF:.0e}, the round-off of a solution. Events do not depend on n_time, and both "
        "samplings have the same limit. With two tangential directions slip is integrated in steps "
        "of its own tolerance, and uniform sampling is of first order.", "",
        "![Distance from the limit against n_time](images/benchmark_events.png)", "",
        *table(["case", "sampling", *(f"n_time = {n}" for n in numbers), "order"], rows)])


def write_pairs(rows: list[dict[str, str]]) -> str:
    """The section on single pairs, from the table of the measuring program: amplitudes that fall
    with the square of the harmonic, as those of structures do."""
    shown = [row for row in rows if row["power"] == "2" and int(row["n_harmonics"]) > 1]
    judged = next(row for row in shown if row["directions"] == "2" and row["sampling"] == "events"
                  and int(row["n_harmonics"]) == N_HARMONICS)
    met = (float(judged["from_rest_us"]) <= PAIR_TARGET
           and float(judged["error"]) <= PAIR_ERROR)
    return "\n".join([
        "## Forces of a pair", "",
        "Processor time of one evaluation [us] for each of 96 random pairs whose amplitudes fall "
        "with the square of the harmonic: from rest, again from where that ended, and the "
        "derivative; errors of the forces against events in a period that starts elsewhere, the "
        "worst pair and the median.", "",
        *table(["directions", "H", "sampling", "n_time", "from rest [us]", "again [us]",
                "derivative [us]", "worst error", "median error"],
               [(row["directions"], row["n_harmonics"], row["sampling"], row["n_time"],
                 *(f"{float(row[key]):.3g}" for key in ("from_rest_us", "again_us",
                                                        "linearize_us")),
                 *(f"{float(row[key]):.1e}" for key in ("error", "median_error")))
                for row in shown]), "",
        f"Target: events in two directions at H = {N_HARMONICS} in {PAIR_TARGET:g} us with an "
        f"error of {PAIR_ERROR:.0e}; {'met' if met else 'missed'} "
        f"({float(judged['from_rest_us']):.3g} us from rest, {float(judged['again_us']):.3g} us "
        f"again, {float(judged['error']):.1e})."])


def find(limits: list[Limit], name: str, sampling: str, n_time: int) -> Limit | None:
    """One solution, if it was computed."""
    return next((limit for limit in limits
                 if (limit.case, limit.sampling, limit.n_time) == (name, sampling, n_time)), None)


def cell(limit: Limit | None) -> str:
    """Distance and time of a solution."""
    if limit is None:
        return "-"
    return "not converged" if math.isnan(limit.seconds) else \
        f"{limit.error:.1e}, {1e3 * limit.seconds:.3g}"


def order(limits: list[Limit], name: str, sampling: str) -> str:
    """Slope in the logarithms of the last three distances that are no round-off."""
    found = [limit for limit in limits if (limit.case, limit.sampling) == (name, sampling)
             and limit.error > ROUND_OFF and not math.isnan(limit.seconds)][-3:]
    if len(found) < 3:
        return "exact" if not found else "-"
    slope = np.polyfit(np.log([limit.n_time for limit in found]),
                       np.log([limit.error for limit in found]), 1)[0]
    return f"{-slope:.1f}"


#: Distances below this are drawn at it: round-off needs no decades of its own.
EXACT = 1e-10


def draw(path: Path, limits: list[Limit], names: list[str]) -> None:
    """One panel for each case."""
    figure = Figure(figsize=(10.5, 6.2), dpi=130, layout="constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey=True)
    for axes, name in zip(panels.flat, names):
        for sampling, mark, colour in zip(SAMPLINGS, ("o-", "s-"), COLOURS):
            found = [limit for limit in limits if (limit.case, limit.sampling) == (name, sampling)
                     and not math.isnan(limit.seconds)]
            axes.plot([limit.n_time for limit in found], [max(limit.error, EXACT)
                                                          for limit in found],
                      mark, color=colour, markersize=4, linewidth=1.1, label=sampling)
        axes.set(xscale="log", yscale="log")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_title(sentence(name), fontsize=10)
        axes.grid(alpha=0.3)
    for axes in panels[:, 0]:
        axes.set_ylabel("distance from the limit\n(1e-10: or less)")
    for axes in panels[-1, :]:
        axes.set_xlabel("n_time")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2,
                  frameon=False)
    figure.savefig(path)
