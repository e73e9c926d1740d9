"""`fretwear report`: one self-contained HTML page of a result file."""

from __future__ import annotations

import argparse
import base64
import io
from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ._native import namelist_values
from .errors import AbsentError, InputError, OutputError
from .plot import KINDS, Choices, fitting
from .plot.style import label, units_of
from .plot.table import plot_table
from .result import Result
from .shown import dissipation, highest
from .study.table import is_table, read_table

__all__ = ["add_arguments", "main", "render_report", "render_study", "write_report"]

#: Rows of the table of points; of a longer result every k-th, the peak and failures are shown.
_MOST_ROWS = 500
#: Letters of a cell from which it is a sentence.
_SENTENCE = 28

_STYLE = """
:root { color: #1c2733; background: #fff; font: 16px/1.5 system-ui, sans-serif; }
body { max-width: 68rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: .5rem 0; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; border-bottom: 2px solid #1f4e79; }
p.status { margin: 0; color: #46586a; overflow-wrap: anywhere; }
p.warning { background: #fdecea; border-left: 4px solid #c0392b; padding: .5rem .8rem; }
nav a { margin-right: 1rem; color: #1f4e79; white-space: nowrap; }
figure { margin: 1rem 0; }
figure img { max-width: 100%; height: auto; display: block; margin: 0 auto; }
.scroll { overflow: auto; max-height: 32rem; max-width: 100%; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
th, td { padding: .2rem .8rem .2rem 0; text-align: left; border-bottom: 1px solid #dde3e9; }
td, th { min-width: 3.5rem; overflow-wrap: normal; }
td.words { min-width: 10rem; max-width: 44rem; }
td.number, th.number { text-align: right; white-space: nowrap; }
thead th { position: sticky; top: 0; background: #fff; }
tr.failed td { color: #c0392b; }
pre { overflow-x: auto; background: #f4f6f8; padding: .8rem; font-size: .85rem; }
@media (max-width: 45rem) {
  figure { overflow-x: auto; }
  figure img { max-width: none; width: 44rem; }
}
@media print { .scroll { max-height: none; } nav { display: none; } }
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear report`."""
    parser.add_argument("result", help="result file, or the table of a study")
    parser.add_argument("-o", "--output", metavar="HTML",
                        help="page to write (default: RESULT.html in the current folder)")
    parser.add_argument("--interactive", action="store_true",
                        help="with pictures that answer: a click on the response shows the loops "
                             "and the flanks of that point; 2 MB more (needs bokeh)")
    parser.add_argument("--linear", metavar="FILE",
                        help="result with every pair stuck, drawn dashed in the response")
    parser.add_argument("--observe", metavar="NAME",
                        help="observed quantity of the pictures (default: the first)")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear report`."""
    if is_table(options.result):
        if options.interactive or options.linear or options.observe:
            raise InputError("the report of a study takes no --interactive, --linear, --observe")
        target = Path(options.output or f"{Path(options.result).stem}.html")
        _write(target, render_study(options.result))
        print(target)
        return 0
    result = Result(options.result)
    target = Path(options.output or f"{Path(result.name).stem}.html")
    write_report(result, target, Choices(observe=options.observe, linear=options.linear),
                 interactive=options.interactive)
    print(target)
    return 0


def write_report(result: Result, path: str | Path, choices: Choices | None = None, *,
                 interactive: bool = False) -> None:
    """Write the page of a result.

    Parameters
    ----------
    result : Result
        Any result file.
    path : str or Path
        HTML file.
    choices : Choices, optional
        What to draw of it.
    interactive : bool
        Whether the page begins with pictures that answer to clicks.
    """
    _write(Path(path), render_report(result, choices or Choices(), interactive=interactive))


def _write(path: Path, page: str) -> None:
    if not path.absolute().parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.absolute().parent}")
    path.write_text(page, encoding="utf-8")


def render_study(path: str | Path) -> str:
    """The page of a study: its quantities over what varies, and its table."""
    table = read_table(path)
    n, good = len(table["run"]), int((table["status"] == "ok").sum())
    status = (f'<p class="status">{escape(Path(path).name)}: {n} runs, {good} without a '
              "complaint</p>")
    if good < n:
        status += (f'\n<p class="warning">{n - good} of {n} runs did not end well: see the column '
                   "status.</p>")
    sections = []
    try:
        sections.append(("curves", "Quantities", _image(plot_table(path), "quantities of a study")))
    except AbsentError as error:
        sections.append(("curves", "Quantities", f'<p class="warning">{escape(str(error))}</p>'))
    names = [name for name in table if name not in ("run", "exit_status", "result")
             and not (name == "message" and good == n)]
    rows = zip(*(table[name].tolist() for name in names))
    sections.append(("runs", "Runs", _table(names, rows, (table["status"] != "ok").tolist())))
    return _page(Path(path).stem, status, sections)


def render_report(result: Result, choices: Choices, *, interactive: bool = False) -> str:
    """The page as text: nothing in it refers to anything outside of it."""
    head, sections = "", [("numbers", "Numbers", _numbers(result))]
    if interactive:
        head, pictures = _answering(result)
        sections.insert(0, ("look", "Look around", pictures))
    for name in fitting(result):
        try:
            content = _image(KINDS[name].draw(result, choices), KINDS[name].title)
        except AbsentError as error:
            content = f'<p class="warning">{escape(str(error))}</p>'
        sections.append((name, KINDS[name].title, content))
    if "modes/open" in result:
        frequencies, *rows = result.modes.table()
        sections.append(("modes", "Natural frequencies", _table(frequencies, rows)))
    if result.n_points:
        sections.append(("points", "Points", _points(result)))
    if "wear/depth" in result:
        sections.append(("steps", "Wear steps", _steps(result)))
    sections.append(("input", "Input", f"<pre>{escape(result.namelist)}</pre>"))
    title = result.title or Path(result.name).name
    return _page(title, _status(result), sections, head)


def _page(title: str, status: str, sections: Sequence[tuple[str, str, str]], head: str = "") -> str:
    links = "".join(f'<a href="#{key}">{escape(name)}</a> ' for key, name, _ in sections)
    body = "\n".join(f'<section id="{key}"><h2>{escape(name)}</h2>\n{content}</section>'
                     for key, name, content in sections)
    return (f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n{head}\n</head>\n<body>\n"
            f"<h1>{escape(title)}</h1>\n{status}\n<nav>{links}</nav>\n{body}\n</body>\n</html>\n")


def _answering(result: Result) -> tuple[str, str]:
    """Pictures that answer to clicks."""
    if not KINDS["response"].fits(result):
        raise AbsentError(f"{result.name}: is no sweep: --interactive has nothing to click on")
    try:
        from .explore.standing import standing_page
    except ImportError as error:
        raise InputError(f"--interactive needs bokeh ({error}): pip install 'fretwear[explore]'"
                         ) from None
    return standing_page(result)


def _status(result: Result) -> str:
    version = result.attributes.get("fretwear_version", "")
    elapsed = _or_not_known(lambda: f"{result.elapsed:.3g} s")
    text = (f'<p class="status">{escape(Path(result.name).name)}: {escape(result.status)}, '
            f"{elapsed}, fretwear {escape(str(version))}</p>")
    if result.n_points and not result.converged.all():
        failed = np.flatnonzero(~result.converged)
        listed = ", ".join(f"{result.frequency[k]:.6g} Hz" for k in failed[:12])
        more = ", ..." if len(failed) > 12 else ""
        text += (f'\n<p class="warning">{len(failed)} of {result.n_points} points did not '
                 f"converge: {listed}{more}. Their values are the best that was found.</p>")
    return text


def _image(figure: Figure, title: str) -> str:
    """Figure as an SVG that needs no font, inside of the page."""
    buffer = io.StringIO()
    # Fixed identifiers and no date: the same result gives the same page.
    with matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": "fretwear"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    data = base64.b64encode(buffer.getvalue().encode()).decode()
    width = round(96.0 * figure.get_figwidth())
    return (f'<figure><img alt="{escape(title)}" width="{width}" '
            f'src="data:image/svg+xml;base64,{data}"></figure>')


def _table(head: Sequence[str], rows: Iterable[Sequence[object]],
           failed: Sequence[bool] | None = None) -> str:
    """Table whose numbers are aligned to the right."""
    def cell(value: object) -> str:
        if isinstance(value, (float, np.floating)):
            return f'<td class="number">{value:.6g}</td>'
        if isinstance(value, (int, np.integer)):
            return f'<td class="number">{value}</td>'
        text = str(value)
        # A sentence keeps the width of a line; beside it the table scrolls.
        wide = ' class="words"' if len(text) > _SENTENCE else ""
        return f"<td{wide}>{escape(text)}</td>"

    lines = []
    for k, row in enumerate(rows):
        mark = ' class="failed"' if failed is not None and failed[k] else ""
        lines.append(f"<tr{mark}>" + "".join(map(cell, row)) + "</tr>")
    top = "".join(f"<th>{escape(text)}</th>" for text in head)
    return (f'<div class="scroll"><table><thead><tr>{top}</tr></thead>\n<tbody>'
            + "\n".join(lines) + "</tbody></table></div>")


def _numbers(result: Result) -> str:
    """What is asked first: how the run went, peaks, contact and wear."""
    analysis = _or_not_known(
        lambda: str(namelist_values(result.namelist).get("case%analysis", ["?"])[0]))
    rows: list[tuple[str, object, str]] = [("analysis", analysis, "")]
    if result.n_points:
        rows += [("converged points", f"{result.converged.sum()} of {result.n_points}", ""),
                 ("iterations", int(result.iterations.sum()), ""),
                 ("harmonics", result.n_harmonics, "")]
    if "modes/open" in result:
        rows.append(("natural frequencies", int(np.isfinite(result.modes.free).sum()), ""))
    pairs = _or_not_known(lambda: str(result.n_pairs))
    if pairs != "0":
        rows.append(("contact pairs", int(pairs) if pairs.isdigit() else pairs, ""))
    if "wear/depth" in result:
        rows += _wear_numbers(result)
    else:
        rows += _peak_numbers(result)
    return _table(("", "value", "unit"), rows)


def _peak_numbers(result: Result) -> list[tuple[str, object, str]]:
    rows: list[tuple[str, object, str]] = []
    for name in result.observed if result.n_points else ():
        top = highest(result, name)
        if top is None:  # not one point converged: said at the top of the page
            break
        peak, what = result.peak(name), "peak" if top.is_peak else "largest value"
        rows += [(f"{what} of {name}" + (f", {top.words}" if top.words else ""), top.height,
                  units_of(result, "amplitude")),
                 _place_of(result, peak, top.place, what)]
        if "sensitivity/deviation/largest" in result:
            spread = result["sensitivity/deviation/largest"][peak, result.index(name)]
            rows.append((f"standard deviation of the amplitude, at point {peak + 1}",
                         float(spread), units_of(result, "amplitude")))
        if name == result.observed[0] and "contact/fraction" in result:
            shares = result.fraction[peak].mean(axis=0)
            rows += [(f"pairs and period in {state}, at this {what}", float(share), "")
                     for state, share in zip(("stick", "slip", "open"), shares)]
            rows.append((f"friction energy per cycle, at this {what}",
                         float(dissipation(result)[peak].sum()),
                         units_of(result, "contact/dissipation")))
    return rows


def _place_of(result: Result, peak: int, place: float, what: str) -> tuple[str, object, str]:
    if "parameter" in result:
        name = result.parameter_name
        return f"{name} of this {what}, point {peak + 1}", result.parameter[peak], ""
    return f"frequency of this {what}, near point {peak + 1}", place, "Hz"


def _wear_numbers(result: Result) -> list[tuple[str, object, str]]:
    depth, worst = result.depth[-1], int(np.argmax(result.depth[-1]))
    return [("wear steps", len(result.depth), ""),
            ("cycles", float(result.cycles[-1]), ""),
            ("steady state", _or_not_known(lambda: result.steady_state), ""),
            (f"largest depth, pair {worst + 1}", float(depth[worst]),
             units_of(result, "wear/depth")),
            ("mean depth", float(depth.mean()), units_of(result, "wear/depth")),
            ("largest depth per cycle, at the end", float(result.rate[-1].max()),
             units_of(result, "wear/rate"))]


def _or_not_known(value: Callable[[], str]) -> str:
    """A text, or that a run which has not come to its end does not tell."""
    try:
        return value()
    except AbsentError:
        return "not known"


def _rows_shown(result: Result) -> np.ndarray:
    n = result.n_points
    if n <= _MOST_ROWS:
        return np.arange(n)
    kept = set(range(0, n, -(-n // _MOST_ROWS))) | {n - 1} | set(np.flatnonzero(~result.converged))
    if result.converged.any():
        kept.add(result.peak())
    return np.array(sorted(kept), dtype=int)


def _points(result: Result) -> str:
    """One row a point."""
    units = units_of(result, "amplitude")
    shown = _rows_shown(result)
    head = ["point", "frequency [Hz]"]
    columns: list[np.ndarray] = [shown + 1, result.frequency[shown]]
    for k, name in enumerate(result.observed):
        head.append(label(name, units))
        columns.append(result.amplitude[shown, k])
    if "contact/fraction" in result:
        head += ["stick", "slip", "open",
                 label("dissipation", units_of(result, "contact/dissipation"))]
        columns += [*result.fraction[shown].mean(axis=1).T,
                    dissipation(result)[shown].sum(axis=1)]
    if "floquet/stable" in result:
        head.append("stable")
        columns.append(np.array(["no", "yes", "?"])[result.stable[shown]])
    head += ["iterations", "residual"]
    columns += [result.iterations[shown], result.residual[shown]]
    note = ("" if len(shown) == result.n_points else
            f"<p>{len(shown)} of {result.n_points} points.</p>")
    return note + _table(head, zip(*columns), list(~result.converged[shown]))


def _steps(result: Result) -> str:
    """One row a wear step."""
    depths, rates = units_of(result, "wear/depth"), units_of(result, "wear/rate")
    head = ["step", "cycles", label("largest depth", depths), label("mean depth", depths),
            label("largest depth per cycle", rates)]
    n = len(result.depth)
    shown = np.unique(np.linspace(0, n - 1, min(n, _MOST_ROWS)).astype(int))
    depth, rate = result.depth[shown], result.rate[shown]
    return _table(head, zip(shown + 1, result.cycles[shown], depth.max(axis=1),
                            depth.mean(axis=1), rate.max(axis=1)))
