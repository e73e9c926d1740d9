"""The part of docs/benchmarks.md on speed, with its pictures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from bench.common.layout import finish, microseconds, milliseconds, new_figure, table
from bench.common.sector import HARMONICS as SECTOR_HARMONICS
from bench.common.sector import LARGEST_LU, PAIRS, THREADED, Crossing, PointTime, Sweep, ThreadTimes

__all__ = ["Measurements", "write_speed"]

#: Time [s] that a sweep may take.
TARGETS = {"48 pairs, H = 7": 5.0, "16 pairs, H = 3": 1.0}


@dataclass(frozen=True)
class Measurements:
    """Everything that this part needs."""

    transforms: list[dict[str, str]]
    crossing: list[Crossing]
    points: list[PointTime]
    threads: list[ThreadTimes]
    sweeps: list[Sweep]


def write_speed(images: Path, data: Measurements) -> str:
    """Draw the pictures into a folder; the text of the part."""
    draw_points(images / "benchmark_points.png", data.points)
    draw_transforms(images / "benchmark_transforms.png", data.transforms)
    draw_crossing(images / "benchmark_linear.png", data.crossing)
    parts = [sweeps_part(data.sweeps), points_part(data.points), threads_part(data.threads),
             crossing_part(data.crossing),
             transforms_part(data.transforms)]
    return "## Speed\n\n" + "\n\n".join(parts)


def sweeps_part(sweeps: list[Sweep]) -> str:
    """The sweeps that have a target."""
    rows = []
    for sweep in sweeps:
        target = next(value for key, value in TARGETS.items() if sweep.title.startswith(key))
        met = "met" if sweep.seconds < target else "missed"
        rows.append((sweep.title, len(sweep.run.seconds), sweep.run.usable,
                     int(sweep.run.is_loose.sum()), int(sweep.run.iterations.sum()),
                     f"{sweep.seconds:.2f}", f"< {target:g} s: {met}"))
    return "\n".join([
        "### Whole sweeps", "",
        "Bladed-disk sector at 2500 rpm (`rotation_speed = 261.8`), tip force 0.5 N, modal damping "
        "0.1 %, `n_time = 128`, 41 points between 1000 and 1015 Hz. A *loose* point converged to "
        "a solution in which no pair touches at any instant; it satisfies the equations and means "
        "nothing for a blade in its slot. A time with loose points is no measure of the program.",
        "",
        *table(["sweep", "points", "usable", "loose", "Newton steps", "time [s]", "target"], rows)])


def points_part(points: list[PointTime]) -> str:
    """Time of a point against harmonics and pairs."""
    rows = []
    for pairs in PAIRS:
        for n_harmonics in SECTOR_HARMONICS:
            found = {p.linear: p for p in points
                     if (p.pairs, p.n_harmonics) == (pairs, n_harmonics)}
            if not found:
                continue
            krylov, lu = found["krylov"], found["lu"]
            usable = f"{krylov.run.usable} of {len(krylov.run.seconds)}"
            rows.append((pairs, n_harmonics, krylov.unknowns, krylov.run.unknowns_left, usable,
                         milliseconds(krylov.seconds),
                         "not run" if lu.run is None else milliseconds(lu.seconds)))
    return "\n".join([
        "### Time of a frequency point", "",
        "The sector at 4400 rpm (`rotation_speed = 460.8`), else the same: 9 points within 2 Hz of "
        "the peak, where the joint slips. Unknowns are those of the system; stuck rows "
        "leave the linear problems, whose mean size stands beside. Dense LU was not run for more "
        f"than {LARGEST_LU} unknowns: its time grows with their cube.", "",
        *table(["pairs", "H", "unknowns", "in linear problems", "usable points",
                "GMRES [ms/point]", "LU [ms/point]"], rows), "",
        "![Time of a frequency point](images/benchmark_points.png)"])


def threads_part(rows: list[ThreadTimes]) -> str:
    """One thread against two."""
    lines = [(row.n_harmonics, milliseconds(row.one), milliseconds(row.two),
              f"{row.one / row.two:.2f}", milliseconds(row.two_passive),
              f"{row.one / row.two_passive:.2f}") for row in rows]
    return "\n".join([
        "### Threads", "",
        f"{THREADED} pairs, 9 points within 2 Hz of the peak, on the coarser mesh of "
        "[scaling](#scaling): joints of fewer than 64 pairs stay in one thread. Idle threads of "
        "`fw_run` spin for a fraction of a millisecond, then sleep; `OMP_WAIT_POLICY=passive` lets "
        "them sleep at once.", "",
        *table(["H", "1 thread [ms/point]", "2 threads [ms/point]", "speed-up",
                "2 threads, passive [ms/point]", "speed-up"], lines)])


def crossing_part(rows: list[Crossing]) -> str:
    """LU against GMRES."""
    # Less than a tenth is the noise of the measurement.
    wins = [row.unknowns_left for row in rows if row.lu < 0.9 * row.krylov]
    losses = [row.unknowns_left for row in rows if row.krylov < 0.9 * row.lu]
    text = f"LU is faster by more than a tenth up to {max(wins)} unknowns" if wins else \
        "LU is nowhere faster by more than a tenth"
    text += f", GMRES from {min(losses)} unknowns on" if losses else ""
    lines = [(r.case, r.n_harmonics, r.unknowns_left, milliseconds(r.lu), milliseconds(r.krylov),
              f"{r.lu / r.krylov:.2f}") for r in rows]
    return "\n".join([
        "### LU against GMRES", "",
        "Time of a point, with residuals, condensation and recovery, against "
        "the mean number of unknowns that were left in the linear problems: the sector near its "
        f"peak, and the oscillator with two dofs, stick and slip. {text}. "
        "`lu_of_step` in src/base/size_options.f90, up to which LU is taken, is 60: where GMRES is "
        "the faster below that, the program has yet to follow.", "",
        *table(["case", "H", "unknowns left", "LU [ms]", "GMRES [ms]", "LU / GMRES"], lines), "",
        "![LU against GMRES](images/benchmark_linear.png)"])


def transforms_part(rows: list[dict[str, str]]) -> str:
    """Matrix products against FFTW."""
    wrong = [row for row in rows if better(row) != row["chosen"]]
    costly = [row for row in wrong if ratio(row) > 1.25 or ratio(row) < 0.8]
    lines = [(row["n_harmonics"], row["n_time"], row["n_rows"], microseconds(row["matrix"]),
              microseconds(row["fft"]), f"{ratio(row):.2f}", row["chosen"]) for row in rows]
    worst = max((float(row["difference"]) for row in rows), default=0.0)
    return "\n".join([
        "### Matrix products against FFTW", "",
        "Time of one transform to the instants and one back (bench/speed/transforms.f90). Three "
        "rows belong to a contact pair. The results of the two ways differ by "
        f"{worst:.0e} at most (inputs between 0 and 1). `fft_pays` in src/math/fourier.f90 "
        f"chooses the slower way in {len(costly)} of {len(rows)} sizes by more than a quarter.", "",
        "![Matrix products against FFTW](images/benchmark_transforms.png)", "",
        *table(["H", "n_time", "rows", "matrix [us]", "FFTW [us]", "matrix / FFTW", "chosen"],
               lines)])


def better(row: dict[str, str]) -> str:
    """The faster way for a size."""
    return "matrix" if float(row["matrix"]) <= float(row["fft"]) else "fft"


def ratio(row: dict[str, str]) -> float:
    """Time of the matrix product by that of FFTW."""
    return float(row["matrix"]) / float(row["fft"])


def draw_points(path: Path, points: list[PointTime]) -> None:
    """Time of a point against harmonics."""
    figure, axes = new_figure()
    names = {"krylov": "GMRES", "lu": "LU"}
    for pairs, colour in zip(PAIRS, ("#1f4e79", "#c0392b")):
        for linear, style in (("krylov", "o-"), ("lu", "s--")):
            found = [p for p in points
                     if (p.pairs, p.linear) == (pairs, linear) and not math.isnan(p.seconds)]
            axes.plot([p.n_harmonics for p in found], [1e3 * p.seconds for p in found], style,
                      color=colour, label=f"{pairs} pairs, {names[linear]}")
    axes.set(xscale="log", yscale="log", xlabel="harmonics H", ylabel="time of a point [ms]")
    axes.set_xticks(SECTOR_HARMONICS, [str(h) for h in SECTOR_HARMONICS], minor=False)
    axes.minorticks_off()
    left_out = [p for p in points if p.linear == "lu" and math.isnan(p.seconds)]
    if left_out:
        axes.set_title(f"LU is not run for more than {LARGEST_LU} unknowns", fontsize=9, loc="left")
    finish(figure, axes, path)


def draw_transforms(path: Path, rows: list[dict[str, str]]) -> None:
    """Ratio of the times against the number of coefficients."""
    figure, axes = new_figure()
    colours = dict(zip(("3", "48", "144"), ("#f58518", "#54a24b", "#1f4e79")))
    for rows_of, colour in colours.items():
        for chosen, marker in (("matrix", "o"), ("fft", "^")):
            found = [row for row in rows if (row["n_rows"], row["chosen"]) == (rows_of, chosen)]
            axes.plot([2 * int(row["n_harmonics"]) + 1 for row in found],
                      [ratio(row) for row in found], marker, color=colour, alpha=0.75,
                      label=f"{rows_of} rows, {'FFTW' if chosen == 'fft' else chosen} chosen")
    axes.axhline(1.0, color="0.4", linewidth=1.0)
    axes.set(xscale="log", yscale="log", xlabel="coefficients 2H + 1",
             ylabel="time of matrix products / time of FFTW")
    finish(figure, axes, path)


def draw_crossing(path: Path, rows: list[Crossing]) -> None:
    """Time of a point against the unknowns."""
    figure, axes = new_figure()
    for case, marker in zip(dict.fromkeys(row.case for row in rows), "voxs^"):
        found = [row for row in rows if row.case == case]
        x = [row.unknowns_left for row in found]
        axes.plot(x, [1e3 * row.lu for row in found], marker + "--", color="#c0392b",
                  label=f"LU, {case}")
        axes.plot(x, [1e3 * row.krylov for row in found], marker + "-", color="#1f4e79",
                  label=f"GMRES, {case}")
    axes.set(xscale="log", yscale="log", xlabel="unknowns left in the linear problem",
             ylabel="time of a point [ms]")
    finish(figure, axes, path)
