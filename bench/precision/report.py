"""The part of docs/benchmarks.md on error against run time, with its pictures."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from bench.common.layout import COLOURS, milliseconds, sentence, table
from bench.precision.responses import HARMONICS, SECTOR, SETTINGS, Kept, Precision, Sample

__all__ = ["write_precision"]

PLANAR = "planar friction"
AUTOMATIC, EVENTS = "HBM, automatic n_time", "HBM, events"
#: Settings in the pictures, with their marks.
DRAWN = {AUTOMATIC: "o-", "HBM, n_time = 1024": "v:", EVENTS: "s-",
         "TCM, automatic n_time": "^--", "HDHB": "x--"}
#: Errors that differ by less are alike: a setting that is faster by it is better.
ALIKE = 1.2
#: Harmonics from which the laws of rigid friction are compared.
MANY = 7


def write_precision(images: Path, data: Precision) -> str:
    """Draw the pictures; the text of the part."""
    names = list(dict.fromkeys(sample.case for sample in data.samples))
    draw(images / "benchmark_errors.png", data, [name for name in names if name != SECTOR])
    draw(images / "benchmark_errors_sector.png", data, [SECTOR])
    return "\n".join([
        "## Error against run time", "",
        "Relative L2 error of the Fourier coefficients of the first observed quantity, and the "
        "time of a point (median of three runs in one thread). Oscillators start from the first "
        "guess of a run; their references were computed without harmonic balance "
        "(test/reference). The sector is swept over 9 points within 2 Hz of its peak at 4400 "
        "rpm, where the joint slips in two directions; its reference is the solution with "
        "H = 63 and events, the error the largest of the 9 points, the time their mean.", "",
        "![Error against run time of oscillators](images/benchmark_errors.png)", "",
        "![Error against run time of the sector](images/benchmark_errors_sector.png)", "",
        *sampling_part(data.samples, names), "", *instants_part(data.samples, names), "",
        *law_part(data.samples), "", *accuracy_part(data), "", "### All of it", "",
        "Error and time [ms]; n_time is automatic but where it is given.",
        *(line for name in names for line in case_part(data.samples, name))])


def sampling_part(samples: list[Sample], names: list[str]) -> list[str]:
    """Events against instants."""
    rows, times, planar = [], {n: [] for n in HARMONICS}, {n: [] for n in HARMONICS}
    for name in names:
        pairs = [(find(samples, name, AUTOMATIC, n), find(samples, name, EVENTS, n))
                 for n in HARMONICS]
        ratios = [f"{b.error / a.error:.2g}, {b.seconds / a.seconds:.2g}"
                  if is_usable(a) and is_usable(b) else "-" for a, b in pairs]
        if any(ratio != "-" for ratio in ratios):
            rows.append((sentence(name), *ratios))
        ratios_of_time = planar if name in (PLANAR, SECTOR) else times
        for n, (a, b) in zip(HARMONICS, pairs):
            if is_usable(a) and is_usable(b):
                ratios_of_time[n].append(b.seconds / a.seconds)
    medians = ", ".join(f"{statistics.median(found):.2g} at H = {n}"
                        for n, found in times.items() if found)
    range_of_planar = [ratio for found in planar.values() for ratio in found]
    return ["### Events or instants", "",
            "With `sampling = 'events'` stick, slip and separation are located on the series. Its "
            "error and its time as parts of those of the automatic n_time:", "",
            *table(["case", *(f"H = {n}" for n in HARMONICS)], rows), "",
            f"With one tangential direction the median of the times is {medians}, and nothing but "
            "the truncation of the series is left of the error. There `sampling = 'auto'` takes "
            "events (`locates_events` in src/driver/problem.f90). With two tangential directions "
            f"they take {min(range_of_planar):.2g} to {max(range_of_planar):.2g} times as long at "
            "the same H and their error is of fourth order in n_time; instants are the default "
            "there, as on the sector the truncation outweighs what they leave. Where it does not, "
            "as with planar friction, `sampling = 'events'` is worth its time."]


def instants_part(samples: list[Sample], names: list[str]) -> list[str]:
    """The automatic n_time against the best of those given."""
    rows = []
    for name in names:
        found = [frontier(samples, name, n) for n in HARMONICS]
        cells = ["-" if pair is None else f"{pair[0]:.2g}, {pair[1]:.2g}" for pair in found]
        times = [pair[1] for pair in found if pair]
        if times:
            rows.append((sentence(name), *cells, f"{statistics.median(times):.2g}"))
    return ["### Is the automatic n_time on the frontier?", "",
            "Uniform sampling: the error of the automatic n_time over that of the most "
            "instants, and its time over that of the fastest given n_time whose error is at most "
            f"{ALIKE:g} times as large. 1 is the frontier.", "",
            *table(["case", *(f"H = {n}" for n in HARMONICS), "median time"], rows)]


def frontier(samples: list[Sample], name: str, n_harmonics: int) -> tuple[float, float] | None:
    """Both ratios; none where a solution is missing."""
    automatic = find(samples, name, AUTOMATIC, n_harmonics)
    given = [sample for setting in SETTINGS if "n_time =" in setting
             if is_usable(sample := find(samples, name, setting, n_harmonics))]
    if not is_usable(automatic) or not given:
        return None
    alike = [sample.seconds for sample in given if sample.error <= ALIKE * automatic.error]
    return automatic.error / given[-1].error, automatic.seconds / min(alike, default=math.nan)


def law_part(samples: list[Sample]) -> list[str]:
    """Rigid friction on a mass by either law."""
    rows, gains = [], []
    for kind in ("slip only", "stick and slip"):
        for law in ("dlft", "dlft_velocity"):
            found = [find(samples, f"Coulomb, {kind}, {law}", EVENTS, n) for n in HARMONICS]
            rows.append((kind, f"`{law}`", *map(cell, found)))
        gains += gains_of_velocity(samples, kind)
    gain = f"{min(gains):.0f} to {max(gains):.0f} times" if gains else "(not measured)"
    return ["### Laws of rigid friction", "",
            "On a dof with mass, events located: error and time [ms]. "
            f"From {MANY} harmonics on `dlft_velocity` is {gain} as accurate; on massless nodes "
            "and with a varying normal gap only `dlft` (or `penalty`, where the interface has a "
            "stiffness) serves.",
            "", *table(["motion", "law", *(f"H = {n}" for n in HARMONICS)], rows)]


def gains_of_velocity(samples: list[Sample], kind: str) -> list[float]:
    """Errors of `dlft` over those of `dlft_velocity` with many harmonics."""
    pairs = [[find(samples, f"Coulomb, {kind}, {law}", EVENTS, n)
              for law in ("dlft", "dlft_velocity")] for n in HARMONICS if n >= MANY]
    return [rigid.error / velocity.error for rigid, velocity in pairs
            if is_usable(rigid) and is_usable(velocity)]


def accuracy_part(data: Precision) -> list[str]:
    """What was asked for, chosen and reached."""
    rows = []
    for kept in data.kept:
        best = cheapest(data.samples, kept)
        rows.append((sentence(kept.case), f"{kept.accuracy:.0e}", kept.n_harmonics, kept.n_time,
                     f"{kept.estimate:.1e}", f"{kept.error:.1e}", verdict(kept),
                     milliseconds(kept.seconds), milliseconds(best),
                     "-" if math.isnan(best) else f"{kept.seconds / best:.1f}"))
    return ["### With an accuracy asked for", "",
            "`accuracy` in &harmonics: what the program chose (the most of the points), the bound "
            "that it claims, the true error, and its time beside that of the cheapest setting of "
            "the tables below whose true error is within the accuracy, which nobody knows "
            "beforehand. Where the bound stays above the accuracy the run says so.", "",
            *table(["case", "accuracy", "H", "instants", "bound", "error", "", "time [ms]",
                    "cheapest [ms]", "ratio"], rows)]


def verdict(kept: Kept) -> str:
    """Whether it was claimed, and rightly."""
    if not kept.estimate <= kept.accuracy:
        return "not claimed"
    return "kept" if kept.error <= kept.accuracy else "BROKEN"


def cheapest(samples: list[Sample], kept: Kept) -> float:
    """Shortest time of a given setting that is as accurate as asked for."""
    return min((sample.seconds for sample in samples if sample.case == kept.case
                and sample.error <= kept.accuracy and is_usable(sample)), default=math.nan)


def case_part(samples: list[Sample], name: str) -> list[str]:
    """Every setting of a case."""
    rows = [(setting, *(cell(find(samples, name, setting, n)) for n in HARMONICS))
            for setting in SETTINGS if any((s.case, s.setting) == (name, setting) for s in samples)]
    return ["", f"#### {sentence(name)}", "",
            *table(["setting", *(f"H = {n}" for n in HARMONICS)], rows)]


def cell(sample: Sample | None) -> str:
    """Error and time of a solution."""
    if sample is None:
        return "-"
    if math.isnan(sample.seconds):
        return "not converged"
    return f"{sample.error:.1e}, {milliseconds(sample.seconds)}"


def find(samples: Iterable[Sample], case: str, setting: str, n_harmonics: int) -> Sample | None:
    """One solution, if it was computed."""
    return next((s for s in samples
                 if (s.case, s.setting, s.n_harmonics) == (case, setting, n_harmonics)), None)


def is_usable(sample: Sample | None) -> bool:
    """Whether it was computed and converged."""
    return sample is not None and not math.isnan(sample.seconds)


#: Errors below this are drawn at it: what is exact to round-off needs no decades of its own.
EXACT = 1e-10


def draw(path: Path, data: Precision, names: list[str]) -> None:
    """One panel for each case."""
    columns = min(3, len(names))
    n_rows = math.ceil(len(names) / columns)
    size = (10.5, 3.0 * n_rows + 0.6) if len(names) > 1 else (6.6, 4.8)
    figure = Figure(figsize=size, dpi=130, layout="constrained")
    panels = figure.subplots(n_rows, columns, squeeze=False, sharex=True)
    for axes, name in zip(panels.flat, names):
        for (setting, mark), colour in zip(DRAWN.items(), COLOURS):
            found = [s for s in data.samples
                     if (s.case, s.setting) == (name, setting) and is_usable(s)]
            if found or len(names) > 1:
                axes.plot([1e3 * s.seconds for s in found],
                          [max(s.error, EXACT) for s in found], mark, color=colour,
                          markersize=4, linewidth=1.1, label=setting)
        kept = [k for k in data.kept if k.case == name and k.estimate <= k.accuracy]
        axes.plot([1e3 * k.seconds for k in kept], [max(k.error, EXACT) for k in kept], "*",
                  color="black", markersize=8, label="accuracy 1e-2, 1e-3, 1e-4")
        axes.set(xscale="log", yscale="log")
        if min((line.get_ydata().min() for line in axes.lines if len(line.get_ydata())),
               default=1.0) <= EXACT:
            axes.set_ylim(bottom=0.4 * EXACT)
            axes.axhline(EXACT, color="0.6", linestyle=":", linewidth=0.8)
            axes.annotate("at most", (0.02, EXACT), xycoords=("axes fraction", "data"), fontsize=7,
                          color="0.4", va="bottom")
        axes.xaxis.set_major_locator(LogLocator(numticks=5))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_title(sentence(name), fontsize=10)
        axes.grid(alpha=0.3)
    for axes in panels.flat[len(names):]:
        axes.set_axis_off()
    for axes in panels[:, 0]:
        axes.set_ylabel("relative error")
    for axes in list(panels.flat)[max(0, len(names) - columns):len(names)]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("time of a point [ms]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center",
                  ncols=3 if len(names) > 1 else 2, frameon=False, fontsize=9)
    figure.savefig(path)
