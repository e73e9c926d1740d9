"""`fretwear compare`: two result files beside each other, as numbers and as one picture."""

from __future__ import annotations

import argparse
import difflib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .errors import InputError, OutputError
from .plot.response import Response, read_response
from .plot.style import PALETTE, Floats, Source, as_result, label_y, new_figure, tidy, units_of
from .result import Result
from .rows import choose_point, synthesis

__all__ = ["Comparison", "Difference", "add_arguments", "compare", "main", "plot_comparison"]

#: What tells of the work done, not of the answer: shown, but no difference.
_WORK = ("seconds", "iterations", "residual")


@dataclass(frozen=True)
class Difference:
    """One dataset of two files.

    Attributes
    ----------
    name : str
        Dataset.
    size : float
        Largest absolute value in either file.
    error : float
        Largest absolute difference; NaN in one file only, or another shape, makes it infinite.
    units : str
        Of both.
    remark : str
        What stands against comparing the values, '' where nothing does.
    """

    name: str
    size: float
    error: float
    units: str
    remark: str = ""

    @property
    def relative(self) -> float:
        """Difference over size."""
        if self.error == 0.0:
            return 0.0
        return self.error / self.size if self.size > 0.0 else np.inf

    @property
    def counts(self) -> bool:
        """Whether it says something of the answer."""
        return self.name not in _WORK


@dataclass(frozen=True)
class Comparison:
    """All differences of two results.

    Attributes
    ----------
    first, second : Result
        The results.
    differences : list of Difference
        One for every dataset of either file.
    namelist : list of str
        Lines of the effective input that differ, with - (first) or + (second).
    """

    first: Result
    second: Result
    differences: list[Difference]
    namelist: list[str]

    def equal(self, tolerance: float) -> bool:
        """Whether every answer agrees within a relative tolerance."""
        return all(item.relative <= tolerance for item in self.differences if item.counts)

    def text(self, tolerance: float) -> str:
        """What differs, for people."""
        lines = [f"- {self.first.name}: {self.first.title} ({self.first.status})",
                 f"+ {self.second.name}: {self.second.title} ({self.second.status})"]
        lines += self.namelist
        lines.append(f"{'dataset':28s} {'largest':>12s} {'difference':>12s} {'relative':>10s}")
        for item in self.differences:
            beyond = item.counts and item.relative > tolerance
            line = (f"{'!' if beyond else ' '} {item.name:26s} {item.size:12.5g} "
                    f"{item.error:12.5g} {item.relative:10.2e} {item.units}")
            lines.append(f"{line}  {item.remark}".rstrip())
        lines += _peaks(self.first, self.second)
        lines.append(f"the same within {tolerance:g}" if self.equal(tolerance) else
                     f"different beyond {tolerance:g}")
        return "\n".join(lines)


def compare(first: Source, second: Source) -> Comparison:
    """Compare every dataset of two results.

    Parameters
    ----------
    first, second : Result or path
        Results; points are compared one by one where both have the same frequencies, else the
        amplitudes of two sweeps are interpolated to the frequencies of the first.
    """
    a, b = as_result(first), as_result(second)
    names = sorted(set(a) | set(b))
    lines = [line for line in difflib.unified_diff(
        _settings(a), _settings(b), lineterm="", n=0) if line[:3] not in ("---", "+++")
        and not line.startswith("@@")]
    return Comparison(a, b, [_compare_one(a, b, name) for name in names], lines)


def _settings(result: Result) -> list[str]:
    """Lines of the effective input, each with its group, without comments and result file."""
    found, group = [], ""
    for line in result.namelist.splitlines():
        if line.startswith("&"):
            group = line[1:].strip()
        elif line.strip() not in ("", "/") and not (group == "output" and "file =" in line):
            found.append(f" {group}%{line.split(' ! ')[0].strip()}")
    return found


def _compare_one(a: Result, b: Result, name: str) -> Difference:
    for result, other in ((a, b), (b, a)):
        if name not in result:
            return Difference(name, 0.0, np.inf, other.units(name), f"only in {other.path}")
    x, y = a[name], b[name]
    if x.dtype.kind in "US":
        same = x.shape == y.shape and bool((x == y).all())
        return Difference(name, 0.0, 0.0 if same else np.inf, "", "" if same else "other names")
    x, y = x.astype(float), y.astype(float)
    remark = ""
    if name in ("coefficients", "contact/force") and x.shape[1:2] != y.shape[1:2]:
        remark = f"harmonics up to {(x.shape[1] - 1) // 2} and {(y.shape[1] - 1) // 2}"
        x, y = _same_harmonics(x, y)
    if x.shape != y.shape:
        if name != "amplitude" or not _interpolates(a, b):
            return Difference(name, _largest(x, y), np.inf, a.units(name),
                              f"shapes {x.shape} and {y.shape}")
        x, y = _common_amplitudes(a, b)
        remark = f"interpolated to {len(x)} common frequencies"
    unlike = np.isnan(x) != np.isnan(y)
    error = np.nanmax(np.abs(x - y), initial=0.0) if not unlike.any() else np.inf
    if unlike.any():
        remark = "NaN in one file only"
    return Difference(name, _largest(x, y), float(error), a.units(name), remark)


def _same_harmonics(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Coefficients (n_points, 2H+1, ...) with zeros for the harmonics that one does not have."""
    n = max(x.shape[1], y.shape[1])
    padded = [np.pad(z, [(0, 0), (0, n - z.shape[1])] + [(0, 0)] * (z.ndim - 2)) for z in (x, y)]
    return padded[0], padded[1]


def _largest(x: Floats, y: Floats) -> float:
    return float(max(np.nanmax(np.abs(x), initial=0.0), np.nanmax(np.abs(y), initial=0.0)))


def _interpolates(a: Result, b: Result) -> bool:
    return (a.observed == b.observed and min(a.n_points, b.n_points) > 1
            and not read_response(a).is_branch and not read_response(b).is_branch)


def _common_amplitudes(a: Result, b: Result) -> tuple[Floats, Floats]:
    """Amplitudes of both at the frequencies of the first that the second covers."""
    order = np.argsort(b.frequency)
    f = b.frequency[order]
    inside = (a.frequency >= f[0]) & (a.frequency <= f[-1])
    columns = [np.interp(a.frequency[inside], f, b.amplitude[order, k])
               for k in range(len(b.observed))]
    return a.amplitude[inside], np.column_stack(columns)


def _peaks(a: Result, b: Result) -> list[str]:
    """Peak of every quantity that both observe."""
    if "wear/depth" in a or "wear/depth" in b or min(a.n_points, b.n_points) == 0:
        return []
    lines = []
    for name in (name for name in a.observed if name in b.observed):
        try:
            (fa, xa), (fb, xb) = ((r.frequency[r.peak(name)],
                                   r.amplitude[r.peak(name), r.index(name)]) for r in (a, b))
        except InputError:
            continue
        lines.append(f"peak {name}: {xa:.6g} -> {xb:.6g} {a.units('amplitude')} "
                     f"({_percent(xa, xb)}), {fa:.6g} -> {fb:.6g} Hz ({_percent(fa, fb)})")
    return lines


def _percent(before: float, after: float) -> str:
    return f"{100.0 * (after / before - 1.0):+.3g} %" if before else "-"


def plot_comparison(first: Source, second: Source, observe: str | None = None) -> Figure:
    """Both results in one picture, with their difference below.

    Parameters
    ----------
    first, second : Result or path
        Two sweeps are drawn against frequency, two wear analyses pair by pair at their last
        step, anything else over one cycle at the largest amplitude.
    observe : str, optional
        Observed quantity; the first of the first file without it.
    """
    a, b = as_result(first), as_result(second)
    figure = new_figure(8.0, 5.8)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    if "wear/depth" in a and "wear/depth" in b:
        _draw_wear(upper, lower, a, b)
    elif min(a.n_points, b.n_points) > 1:
        _draw_sweeps(upper, lower, a, b, observe)
    else:
        _draw_cycles(upper, lower, a, b, observe)
    upper.legend(frameon=False)
    lower.axhline(0.0, color="0.4", linewidth=0.8)
    first_name, second_name = _names(a, b)
    lower.set_title(f"difference: {second_name} minus {first_name}", fontsize=9, loc="left")
    for axes in (upper, lower):
        tidy(axes)
    return figure


def _names(a: Result, b: Result) -> tuple[str, str]:
    """How the legend calls them: file names, with the folder where these are the same."""
    short = Path(a.name).name, Path(b.name).name
    return short if short[0] != short[1] else (a.name, b.name)


def _draw_wear(upper: Axes, lower: Axes, a: Result, b: Result) -> None:
    x, y = a.depth[-1], b.depth[-1]
    for k, (depth, name) in enumerate(zip((x, y), _names(a, b))):
        upper.bar(np.arange(len(depth)) + 0.8 + 0.4 * k, depth, width=0.38, color=PALETTE[k],
                  label=name)
    units = units_of(a, "wear/depth")
    label_y(upper, "wear depth", units)
    if len(x) == len(y):
        lower.bar(np.arange(len(x)) + 1, y - x, width=0.7, color=PALETTE[2])
    label_y(lower, "difference", units)
    lower.set_xlabel("pair")


def _draw_sweeps(upper: Axes, lower: Axes, a: Result, b: Result, observe: str | None) -> None:
    one = read_response(a, observe)
    two = read_response(b, one.name)
    styles = ("-", "--")
    for k, (response, name) in enumerate(zip((one, two), _names(a, b))):
        upper.plot(response.frequency, np.where(response.converged, response.amplitude, np.nan),
                   styles[k], color=PALETTE[k], label=name)
    label_y(upper, f"amplitude of {one.name}", one.units)
    upper.set_ylim(bottom=0.0)
    if one.is_branch or two.is_branch:
        lower.set_visible(False)
        upper.tick_params(labelbottom=True)
        upper.set_xlabel("frequency [Hz]")
        return
    f, difference = _difference(one, two)
    lower.plot(f, difference, ".-", color=PALETTE[2], markersize=3)
    label_y(lower, "difference", one.units)
    lower.set_xlabel("frequency [Hz]")


def _difference(one: Response, two: Response) -> tuple[Floats, Floats]:
    """Second minus first at the frequencies of the first."""
    order = np.argsort(two.frequency)
    order = order[two.converged[order]]
    f, a = two.frequency[order], two.amplitude[order]
    keep = one.converged & (one.frequency >= f[0]) & (one.frequency <= f[-1])
    at = one.frequency[keep]
    return at, np.interp(at, f, a) - one.amplitude[keep]


def _draw_cycles(upper: Axes, lower: Axes, a: Result, b: Result, observe: str | None) -> None:
    degrees = np.linspace(0.0, 360.0, 257)
    name = a.observed[a.index(observe)]
    curves = []
    for k, (result, title) in enumerate(zip((a, b), _names(a, b))):
        c = result.coefficients[choose_point(result, None), :, result.index(name)]
        curves.append(c @ synthesis(len(c), np.radians(degrees)))
        upper.plot(degrees, curves[-1], ("-", "--")[k], color=PALETTE[k], label=title)
    label_y(upper, name, units_of(a, "amplitude"))
    lower.plot(degrees, curves[1] - curves[0], color=PALETTE[2])
    label_y(lower, "difference", units_of(a, "amplitude"))
    lower.set_xlabel("phase of the excitation [degrees]")
    lower.set(xlim=(0.0, 360.0), xticks=range(0, 361, 60))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear compare`."""
    parser.description = ("Compare two result files. Exit status 0: the same within the "
                          "tolerance, 1: different, 3 or 5: a file cannot be used.")
    parser.add_argument("first", help="result file")
    parser.add_argument("second", help="result file")
    parser.add_argument("-o", "--output", metavar="FILE", help="also draw both into a picture")
    parser.add_argument("--tolerance", type=float, default=1e-6, metavar="X",
                        help="relative to the largest value of each dataset (default 1e-6)")
    parser.add_argument("--observe", metavar="NAME", help="observed quantity of the picture")
    parser.add_argument("-q", "--quiet", action="store_true", help="only the exit status")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear compare`; 0 the same, 1 different."""
    found = compare(options.first, options.second)
    if options.output:
        target = Path(options.output)
        if not target.absolute().parent.is_dir():
            raise OutputError(f"{target}: there is no folder {target.absolute().parent}")
        plot_comparison(found.first, found.second, options.observe).savefig(target)
    if not options.quiet:
        print(found.text(options.tolerance))
    return 0 if found.equal(options.tolerance) else 1
