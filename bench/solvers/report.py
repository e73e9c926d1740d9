"""The part of docs/benchmarks.md on solvers: one table a problem."""

from __future__ import annotations

import math
import statistics

from bench.common.layout import milliseconds, sentence, table
from bench.solvers.many_starts import (
    DUFFING_FREQUENCIES,
    DUFFING_SPREADS,
    N_STARTS,
    SECTOR_FREQUENCIES,
    SECTOR_SPREAD,
    SOLVERS,
    Outcome,
    Solver,
    summarize,
)

__all__ = ["write_solvers"]

#: The two that the paper compares.
NEWTON, EULER = Solver("newton"), Solver("pseudo_time", "rotated", "implicit_euler")


def write_solvers(outcomes: list[Outcome]) -> str:
    """The text of the part."""
    names = list(dict.fromkeys(outcome.problem for outcome in outcomes))
    duffing = [name for name in names if name.startswith("Duffing")]
    parts = ["## Solvers, flows and schemes", introduction(), duffing_part(outcomes, duffing)]
    parts += [problem_part(outcomes, name) for name in names if name not in duffing]
    parts.append(claim_part(outcomes, names))
    return "\n\n".join(parts)


def introduction() -> str:
    """What was run."""
    return (
        "Every solver, and every scheme of pseudo-time on every flow, from the same starts, with "
        "`fallback = .false.` and no guess but the start (bench/solvers/starts.f90). Random "
        "starts have coefficients of all harmonics, drawn evenly from an interval, with a fixed "
        "seed. Iterations (as in `/iterations`: linear solutions; of the explicit scheme, "
        "steps) and times are medians over the starts that converged; the error is the largest "
        "relative L2 error of the coefficients among them, against the nearest known solution. "
        "It is the error of the balance wherever solvers share it. Newton's method has a line "
        "search, and ends each pseudo-time path (see the user guide). Every run ends: "
        "`max_iterations = 60`, `max_steps = 500`. *The flow runs away from its start* stands "
        "for: it has no stable steady state there, or the steps are too long for the scheme. "
        "Above a resonance, where the identity flow grows, it ends so or runs out of steps, "
        "unless Newton's method converges on the way.")


def duffing_part(outcomes: list[Outcome], names: list[str]) -> str:
    """Shares for every width of the starts; the rest for the middle one."""
    middle = names[len(names) // 2]
    rows = []
    for solver in SOLVERS:
        found = {o.problem: summarize(o) for o in outcomes if o.solver == solver}
        shares = [share(found[name].converged, found[name].total) for name in names]
        rest = found[middle]
        rows.append((solver.name, *shares, count(rest.iterations), milliseconds(rest.seconds),
                     scientific(rest.error), failures(rest.failures)))
    frequencies = ", ".join(f"{omega:g}" for omega in DUFFING_FREQUENCIES)
    spreads = ", ".join(f"{spread:g}" for spread in DUFFING_SPREADS)
    return "\n".join([
        "### Duffing", "",
        f"{N_STARTS} starts at each of omega = {frequencies}, between the folds at 1.233 and "
        "1.457, where three solutions exist; H = 5. Coefficients start within "
        f"{spreads} of zero; the largest response is 1.5. Iterations, time, error and failures "
        f"are those of {middle.split(',')[1].strip()}; at omega = 1.25 no reference is stored.",
        "",
        *table(["solver", *(f"within {name.rsplit(' ', 1)[1]}" for name in names), "iterations",
                "time [ms]", "error", "failures"], rows)])


def problem_part(outcomes: list[Outcome], name: str) -> str:
    """One row a solver."""
    rows = []
    for outcome in outcomes:
        if outcome.problem != name:
            continue
        if outcome.timed_out:
            rows.append((outcome.solver.name, "-", "-", "-", "-", "stopped by the clock"))
            continue
        s = summarize(outcome)
        rows.append((outcome.solver.name, share(s.converged, s.total), count(s.iterations),
                     milliseconds(s.seconds), scientific(s.error), failures(s.failures)))
    return "\n".join([f"### {sentence(name)}", "", description(name), "",
                      *table(["solver", "converged", "iterations", "time [ms]", "error",
                              "failures"], rows)])


def description(name: str) -> str:
    """What a problem is."""
    if name.startswith("Sector"):
        hertz = ", ".join(f"{f:g}" for f in SECTOR_FREQUENCIES)
        return (f"4400 rpm, tip force 0.5 N, H = 3, n_time = 128, at {hertz} Hz: before, at and "
                "behind the peak. The first start of each frequency is the first guess of a run "
                "(every pair stuck); the others are relative displacements within "
                f"{SECTOR_SPREAD:g} mm, four times those at the peak. The reference of the tip "
                "displacement is a solution of a sweep at a tolerance of 1e-11.")
    return f"{N_STARTS} starts within 3 at one frequency; H = 7, n_time = 256."


def claim_part(outcomes: list[Outcome], names: list[str]) -> str:
    """Pseudo-time against Newton, start by start."""
    rows = []
    for name in names:
        newton = {(s.omega, s.number): s for o in outcomes
                  if (o.problem, o.solver) == (name, NEWTON) for s in o.starts if s.converged}
        euler = {(s.omega, s.number): s for o in outcomes
                 if (o.problem, o.solver) == (name, EULER) for s in o.starts if s.converged}
        both = newton.keys() & euler.keys()
        ratio = (statistics.median(euler[key].seconds / newton[key].seconds for key in both)
                 if both else math.nan)
        rows.append((sentence(name), len(newton), len(euler), len(both),
                     f"{ratio:.2g}" if both else "-"))
    return "\n".join([
        "### Is pseudo-time faster than Newton's method?", "",
        "The paper finds it so. Here, start by start: implicit Euler on the rotated flow against "
        "Newton's method, median of the ratios of their times over the starts from which both "
        "converge. A ratio above 1 means that pseudo-time is slower; what it buys is the "
        "starts that Newton's method loses.", "",
        *table(["problem", "Newton converges", "rotated implicit Euler converges", "both",
                "time of pseudo-time / Newton"], rows)])


def share(converged: int, total: int) -> str:
    """Part of the starts that converged."""
    return f"{converged}/{total} ({100.0 * converged / total:.0f} %)" if total else "-"


def failures(counts: list[tuple[str, int]]) -> str:
    """The words of failure, the most frequent two."""
    return "; ".join(f"{number} x {message}" for message, number in counts[:2])


def count(value: float) -> str:
    """A median of counts."""
    return "-" if math.isnan(value) else f"{value:g}"


def scientific(value: float) -> str:
    """Two digits of an error."""
    return "-" if math.isnan(value) else f"{value:.1e}"
