"""Aliasing on the sector: HDHB, which sees 2H+1 instants, against HBM with 105."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bench.common.layout import COLOURS, table
from bench.common.measure import Bench, Floats, Groups, Run
from bench.paper.methods import HARMONICS, INSTANTS, first_bending

__all__ = ["Aliasing", "draw_cycles", "measure_aliasing", "measure_cycles", "write_aliasing"]

#: Curves of the relative displacement over a cycle: method and H.
CYCLES = (("hbm", 7), ("hdhb", 7), ("hdhb", 17), ("hbm", 17))
#: Around the peak [Hz].
NEAR = {"start": 1020.5, "end": 1025.5, "n_points": 51, "unit": "Hz"}


@dataclass(frozen=True)
class Aliasing:
    """Sweeps by (method, H), and the relative displacement of a pair over a cycle by the same."""

    sweeps: dict[tuple[str, int], Run]
    cycles: dict[tuple[str, int], Floats]
    pair: int


def measure_aliasing(bench: Bench) -> Aliasing:
    """Sweeps, and cycles at the peak of the best of them."""
    sweeps = {}
    for n_harmonics in HARMONICS[:2] if bench.quick else HARMONICS:
        for method in ("hbm", "hdhb"):
            sweeps[method, n_harmonics] = bench.run(sector(method, n_harmonics))
    reference = sweeps["hbm", max(h for _, h in sweeps)]
    peak = float(reference.omega[np.argmax(np.where(reference.converged,
                                                    reference.amplitude[:, 0], 0.0))])
    return Aliasing(sweeps, *measure_cycles(bench, peak))


def measure_cycles(bench: Bench, omega: float) -> tuple[dict[tuple[str, int], Floats], int]:
    """The tangential displacement of the pair that moves most at a frequency [rad/s]: its
    coefficients by method and H, and its number."""
    pair, cycles = 0, {}
    for method, n_harmonics in CYCLES[:1] if bench.quick else CYCLES:
        run = bench.run(at_peak(method, n_harmonics, omega))
        if not cycles:
            vibration = np.linalg.norm(run.coefficients[-1, 1:, :], axis=0)
            pair = int(np.argmax(vibration))
        cycles[method, n_harmonics] = run.coefficients[-1, :, pair]
    return cycles, pair


def sector(method: str, n_harmonics: int) -> Groups:
    """A sweep through the peak."""
    n_time = 2 * n_harmonics + 1 if method == "hdhb" else INSTANTS
    return first_bending(n_harmonics, n_time, method) | {"sweep": NEAR}


def at_peak(method: str, n_harmonics: int, omega: float) -> Groups:
    """A short sweep that ends at the peak; the first tangential displacement of every pair (the
    relative displacements are the first dofs of the model)."""
    groups = sector(method, n_harmonics)
    groups["sweep"] = {"start": omega * 1.004, "end": omega, "n_points": 13}
    groups["output"] = {"observe": [3 * pair + 1 for pair in range(16)]}
    return groups


def write_aliasing(images: Path, data: Aliasing) -> str:
    """Draw the pictures; the text of the part."""
    draw_sweeps(images / "benchmark_aliasing.png", data.sweeps)
    draw_cycles(images / "benchmark_cycle.png", data.cycles)
    harmonics = sorted({h for _, h in data.sweeps})
    best = peak(data.sweeps["hbm", harmonics[-1]])
    rows = []
    for h in harmonics:
        hbm, hdhb = data.sweeps["hbm", h], data.sweeps["hdhb", h]
        rows.append((h, peak_text(hbm), peak_text(hdhb), difference(peak(hbm), best),
                     difference(peak(hdhb), best), f"{int(hdhb.converged.sum())} of "
                     f"{len(hdhb.converged)}"))
    return "\n".join([
        "## Aliasing", "",
        f"The sector through its peak at 4400 rpm by HBM with {INSTANTS} instants and by HDHB, "
        "whose 2H+1 instants alias the harmonics of the contact forces above H onto those below. "
        f"Largest tip displacement among the points that converged, and its difference from HBM "
        f"with H = {harmonics[-1]}.", "",
        *table(["H", "HBM [mm]", "HDHB [mm]", "HBM, difference", "HDHB, difference",
                "HDHB converged"], rows), "",
        "![Response by HBM and HDHB](images/benchmark_aliasing.png)", "",
        f"First tangential displacement of pair {data.pair + 1} over a cycle at the peak:", "",
        "![Displacement over a cycle](images/benchmark_cycle.png)"])


def peak(run: Run) -> float:
    """Largest tip displacement among the converged points."""
    good = run.amplitude[run.converged, 0]
    return float(good.max()) if good.size else math.nan


def peak_text(run: Run) -> str:
    """The same for a table."""
    value = peak(run)
    return "none" if math.isnan(value) else f"{value:.4f}"


def difference(value: float, reference: float) -> str:
    """In percent."""
    return "-" if math.isnan(value) else f"{100.0 * (value / reference - 1.0):+.2f} %"


def draw_sweeps(path: Path, sweeps: dict[tuple[str, int], Run]) -> None:
    """One panel for each H."""
    harmonics = sorted({h for _, h in sweeps})
    figure = Figure(figsize=(8.4, 6.0), dpi=130, layout="constrained")
    panels = figure.subplots(math.ceil(len(harmonics) / 2), 2, sharex=True, sharey=True,
                             squeeze=False)
    for axes, h in zip(panels.flat, harmonics):
        for method, colour, style, name in (("hbm", COLOURS[0], "-", f"HBM, {INSTANTS} instants"),
                                            ("hdhb", COLOURS[1], "o--", "HDHB, 2H+1 instants")):
            run = sweeps[method, h]
            good = run.converged
            axes.plot(run.omega[good] / (2.0 * np.pi), run.amplitude[good, 0], style, color=colour,
                      markersize=3, linewidth=1.2, label=name)
        axes.set_title(f"H = {h}", fontsize=10)
        axes.grid(alpha=0.3)
        axes.set_ylim(bottom=0.0)
    for axes in panels[-1]:
        axes.set_xlabel("frequency [Hz]")
    for axes in panels[:, 0]:
        axes.set_ylabel("tip displacement [mm]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2,
                  frameon=False)
    figure.savefig(path)


def draw_cycles(path: Path, cycles: dict[tuple[str, int], Floats]) -> None:
    """Displacement of a pair over a cycle."""
    figure = Figure(figsize=(6.6, 4.2), dpi=130, layout="constrained")
    axes = figure.subplots()
    turn = np.linspace(0.0, 1.0, 401)
    for ((method, h), coefficients), colour, style in zip(cycles.items(), COLOURS,
                                                          ("-", "--", "-.", ":")):
        axes.plot(turn, 1e3 * series(coefficients, turn), style, color=colour,
                  label=f"{method.upper()}, H = {h}")
    axes.set(xlabel="part of the cycle", ylabel="tangential displacement [µm]")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(path)


def series(coefficients: Floats, turn: Floats) -> Floats:
    """Values of a Fourier series at parts of the cycle."""
    value = np.full_like(turn, coefficients[0])
    for n in range(1, (len(coefficients) + 1) // 2):
        value += coefficients[2 * n - 1] * np.cos(2.0 * np.pi * n * turn)
        value += coefficients[2 * n] * np.sin(2.0 * np.pi * n * turn)
    return value
