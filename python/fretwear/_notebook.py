"""Results in notebooks: as an xarray.Dataset, and as a small table."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import FretwearError

if TYPE_CHECKING:
    import xarray

    from .result import Result

__all__ = ["result_dataset", "result_html"]

#: Remarks shown in the table.
_MOST_REMARKS = 5
#: Names along axes of fixed length.
_NAMES = {"direction": ["t1", "t2", "n"], "state": ["stick", "slip", "open"],
          "axis": ["x", "y", "z"], "part": ["real", "imaginary"]}


def result_dataset(result: Result) -> xarray.Dataset:
    """Everything of a result that has one row per point or per wear step."""
    import xarray

    # A row of a wear analysis is a step.
    wears = "wear/cycles" in result and len(result.cycles) == result.n_points
    row = "step" if wears else "point"
    variables: dict[str, Any] = {}
    lengths: dict[str, int] = {}
    for name in result:
        declared = result.declared(name)
        if declared.dimensions[:1] not in (("point",), ("step",)):
            continue
        if declared.shape[0] != result.n_points:  # fewer steps of wear than points
            continue
        dimensions = (row, *declared.dimensions[1:])
        lengths.update(zip(dimensions, declared.shape))
        about = {"units": declared.units, "long_name": declared.long_name}
        values = result.converged if name == "converged" else result[name]
        variables[name.replace("/", "_")] = xarray.Variable(
            dimensions, values, {key: text for key, text in about.items() if text})
    attributes = {key: value for key, value in result.attributes.items()
                  if key != "format_version"}
    for name in ("omega", "wear_cycles"):
        variables.pop(name, None)
    data = xarray.Dataset(variables, _coordinates(result, row, lengths), attributes)
    return data.set_xindex("omega").set_xindex("frequency")


def _coordinates(result: Result, row: str, lengths: dict[str, int]) -> dict[str, Any]:
    known: dict[str, Any] = {
        "omega": (row, result.omega, {"units": "rad/s"}),
        "frequency": (row, result.frequency, {"units": "Hz"})}
    if "observed" in lengths:
        known["observed"] = list(result.observed)
    if "coefficient" in lengths:
        harmonics = range(1, (lengths["coefficient"] - 1) // 2 + 1)
        known["coefficient"] = ["0", *(f"{part}{n}" for n in harmonics for part in "cs")]
    if "pair" in lengths:
        known["pair"] = np.arange(1, lengths["pair"] + 1)
    known.update((axis, names) for axis, names in _NAMES.items() if axis in lengths)
    if row == "step":
        known["cycles"] = (row, result.cycles, {"units": result.units("wear/cycles") or "1"})
    if "patch" in lengths and "wear/patch" in result:
        known["patch"] = result["wear/patch"].tolist()
    return known


def result_html(result: Result) -> str:
    """A table of what is asked first: how the run went, its range, its peaks, its remarks; and the
    curve."""
    about = result.attributes
    title = escape(str(about.get("title") or result.name))
    rows = [("status", str(about.get("status", "not known")))]
    if "omega" in result and result.n_points:
        converged = int(result.converged.sum()) if "converged" in result else 0
        rows.append(("points", f"{result.n_points}, {converged} converged"))
        low, high = result.frequency.min(), result.frequency.max()
        rows.append(("frequencies", f"{low:.6g} Hz" + (f" to {high:.6g} Hz" if high > low else "")))
        if "amplitude" in result and "observed/name" in result and converged:
            units = result.units("amplitude")
            for name in result.observed:
                omega, height = result.maximum(name)
                value = f"{height:.6g} {units}".strip()
                place = f"{omega / (2.0 * np.pi):.6g} Hz"
                if "parameter" in result:
                    place = f"{result.parameter_name} = {result.parameter[result.peak(name)]:.6g}"
                rows.append((f"largest {name}", f"{value} at {place}"))
    if result.bifurcations:
        shown = [str(place) for place in result.bifurcations[:_MOST_REMARKS]]
        more = len(result.bifurcations) - len(shown)
        rows.append(("bifurcations", ", ".join(shown) + (f" and {more} more" if more else "")))
    if "wear/depth" in result and len(result.depth):
        depth = f"{result.depth[-1].max():.4g} {result.units('wear/depth')}".strip()
        rows.append(("wear", f"{depth} deep after {result.cycles[-1]:.4g} cycles"))
    rows += [("remark", remark) for remark in result.remarks[:_MOST_REMARKS]]
    if len(result.remarks) > _MOST_REMARKS:
        rows.append(("remark", f"and {len(result.remarks) - _MOST_REMARKS} more: result.remarks"))
    cells = "".join(f'<tr><th style="text-align:left">{escape(name)}</th>'
                    f'<td style="text-align:left">{escape(value)}</td></tr>'
                    for name, value in rows)
    return f"<table><caption>{title}</caption><tbody>{cells}</tbody></table>{_curve(result)}"


def _curve(result: Result) -> str:
    """The picture of the whole run; nothing where there is none, as of a run at work."""
    try:
        image = result.plot()._repr_png_()  # type: ignore[attr-defined]
    except FretwearError:
        return ""
    data = base64.b64encode(image).decode()
    return f'<img src="data:image/png;base64,{data}" style="max-width:100%" alt="the whole run">'
