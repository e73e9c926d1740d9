"""The low-pass filter of LaBryer and Attar (2009) on the Duffing oscillator: what it does to the
error of HDHB, and to solutions that the aliases make and the oscillator does not have.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from bench.common.layout import COLOURS, table
from bench.common.measure import Bench, Groups
from bench.common.oscillators import duffing_points, relative_error, single
from bench.solvers.many_starts import Problem, Solver, references_by_frequency, solve_starts

__all__ = ["Filtering", "measure_filtering", "write_filtering"]

#: Methods: their keys, and the part of the harmonics that reach the spring.
CURVES: dict[str, tuple[str, float]] = {
    "HBM": ("hbm", 0.0), "HDHB": ("hdhb", 0.0), "HDHB, filter 2H/3": ("hdhb", 2.0 / 3.0),
    "HDHB, filter H/2": ("hdhb", 0.5)}
#: Frequencies below the folds, where one solution exists.
FREQUENCIES = (0.5, 0.8, 1.2)
HARMONICS = (3, 5, 7, 11, 17)
#: Frequencies between the folds where every solution is known, and the starts at each.
FOLDED = (1.3, 1.4, 1.43)
SPURIOUS_HARMONICS, N_STARTS, SPREAD = (3, 5, 7), 21, 10.0
#: A solution further from every known one is none of the oscillator.
FAR = 0.1


@dataclass(frozen=True)
class Filtering:
    """Errors by (curve, omega, H), NaN where it did not converge; solutions that are none of the
    oscillator, and all that converged, by (curve, H)."""

    errors: dict[tuple[str, float, int], float]
    spurious: dict[tuple[str, int], tuple[int, int]]


def measure_filtering(bench: Bench, starts: Path) -> Filtering:
    """Errors, and solutions from random starts (bench/solvers/starts.f90)."""
    return Filtering(measure_errors(bench), measure_spurious(bench, starts))


def oscillator(curve: str, omega: float, n_harmonics: int) -> Groups:
    """The Duffing oscillator of the references."""
    p, _ = duffing_points()
    method, kept = CURVES[curve]
    return single(p, p["F"], omega) | {
        "spring": {"n_springs": 1, "side_1": 1, "coefficient": p["alpha"], "power": 3},
        "harmonics": {"method": method, "n_harmonics": n_harmonics, "parity": "all",
                      "filter_harmonics": int(kept * n_harmonics + 1e-9)},
        "solver": {"tolerance": 1e-12}}


def measure_errors(bench: Bench) -> dict[tuple[str, float, int], float]:
    """Relative L2 errors where one solution exists."""
    _, points = duffing_points()
    errors = {}
    for omega in FREQUENCIES:
        reference = next(c for at, c in points if abs(at - omega) < 1e-9)
        for n_harmonics in HARMONICS[:1] if bench.quick else HARMONICS:
            for curve in CURVES:
                run = bench.run(oscillator(curve, omega, n_harmonics))
                errors[curve, omega, n_harmonics] = (
                    relative_error(run.coefficients[0, :, 0], reference)
                    if run.converged[0] else math.nan)
    return errors


def measure_spurious(bench: Bench, starts: Path) -> dict[tuple[str, int], tuple[int, int]]:
    """Where rotated implicit Euler ends from random starts."""
    found = {}
    for n_harmonics in SPURIOUS_HARMONICS[:1] if bench.quick else SPURIOUS_HARMONICS:
        for curve in CURVES:
            problem = Problem(curve, oscillator(curve, FOLDED[0], n_harmonics),
                              {"frequencies": FOLDED, "n_starts": 2 if bench.quick else N_STARTS,
                               "spread": SPREAD}, references_by_frequency())
            outcome = solve_starts(bench, starts, problem,
                                   Solver("pseudo_time", "rotated", "implicit_euler"))
            good = [start for start in outcome.starts if start.converged]
            found[curve, n_harmonics] = (sum(start.error > FAR for start in good), len(good))
    return found


def write_filtering(images: Path, data: Filtering) -> str:
    """Draw the picture; the text of the section."""
    draw(images / "benchmark_filter.png", data.errors)
    harmonics = sorted({h for _, _, h in data.errors})
    rows = [(f"{omega:g}", curve, *(error_text(data.errors[curve, omega, h]) for h in harmonics))
            for omega in FREQUENCIES for curve in CURVES]
    few = sorted({h for _, h in data.spurious})
    counts = [(curve, *("{} of {}".format(*data.spurious[curve, h]) for h in few))
              for curve in CURVES]
    folded = ", ".join(f"{omega:g}" for omega in FOLDED)
    return "\n".join([
        "### Low-pass filter", "",
        "`filter_harmonics` keeps the harmonics above it from nonlinear springs (LaBryer and Attar "
        "2009), whose powers then have fewer aliases: with a cube and everything above H/2 "
        "filtered, none on the harmonics that are kept. It does not act on contact, whose forces "
        "are no polynomials. Duffing oscillator, relative L2 errors of the coefficients against "
        "references computed by shooting:", "",
        *table(["omega", "method", *(f"H = {h}" for h in harmonics)], rows), "",
        verdict(data.errors), "",
        "![Error with and without filter](images/benchmark_filter.png)", "",
        "Aliases also make solutions that the oscillator does not have. Of the solutions that "
        f"rotated implicit Euler reaches from {N_STARTS} random starts within {SPREAD:g} at each "
        f"of omega = {folded}, where all solutions of the oscillator are known, so many are "
        f"further than {100.0 * FAR:g} % from every known one:", "",
        *table(["method", *(f"H = {h}" for h in few)], counts)])


def verdict(errors: dict[tuple[str, float, int], float]) -> str:
    """Whether the filters lower the error, in figures."""
    lines = []
    for curve in CURVES:
        if "filter" not in curve:
            continue
        pairs = [(errors[curve, omega, h], errors["HDHB", omega, h])
                 for name, omega, h in errors if name == curve]
        both = [(a, b) for a, b in pairs if not (math.isnan(a) or math.isnan(b))]
        lines.append(f"{curve.split(', ')[1]} lowers the error of HDHB in "
                     f"{sum(a < b for a, b in both)} of {len(both)} cases")
    return ("The filter removes aliases and takes harmonics from the spring: " +
            ", ".join(lines) + ".")


def error_text(value: float) -> str:
    """Two digits."""
    return "not converged" if math.isnan(value) else f"{value:.1e}"


#: Errors below this are drawn at it: round-off needs no decades of its own.
EXACT = 1e-12


def draw(path: Path, errors: dict[tuple[str, float, int], float]) -> None:
    """Error against H, one panel for each frequency."""
    figure = Figure(figsize=(9.0, 3.6), dpi=130, layout="constrained")
    panels = figure.subplots(1, len(FREQUENCIES), sharey=True, squeeze=False)[0]
    for axes, omega in zip(panels, FREQUENCIES):
        for curve, colour, style in zip(CURVES, COLOURS, ("o-", "s--", "^:", "v-.")):
            found = sorted((h, e) for (c, o, h), e in errors.items() if (c, o) == (curve, omega))
            axes.plot([h for h, _ in found], [max(e, EXACT) for _, e in found], style, color=colour,
                      markersize=4, label=curve)
        axes.set(yscale="log", xlabel="harmonics H")
        axes.set_title(f"omega = {omega:g}", fontsize=10)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("relative error (1e-12: or less)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4,
                  frameon=False)
    figure.savefig(path)
