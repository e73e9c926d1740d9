"""Maxima of a joined sweep: each once, with the width and the remarks that the whole gives it."""

from __future__ import annotations

from collections.abc import Sequence

import h5py
import numpy as np
from numpy.typing import NDArray

__all__ = ["found_peaks", "peak_remarks", "with_widths"]

Floats = NDArray[np.float64]
Picks = list[NDArray[np.intp]]

_BOUND, _UNRESOLVED = "end of the sweep", "not resolved"
#: As in the search of the library: a width is known where a sample is near the edge, one that has
#: fallen so many times deeper at most, or one that has come so near to it.
_FAR, _AT_EDGE = 2.0, 0.9


def found_peaks(files: Sequence[h5py.File], near: Picks, same: float) -> tuple[Picks, int | None]:
    """Which maxima of each piece count, and the piece that has the highest one.

    Parameters
    ----------
    files : sequence of h5py.File
        Of the pieces.
    near : list of int arrays
        Maxima of each that lie between its cuts, or just beyond.
    same : float
        Maxima of a quantity that are nearer than this [rad/s] are one.

    Returns
    -------
    list of int arrays, int or None
        None where no piece has kept a period.
    """
    kept: list[tuple[int, float]] = []
    picks: Picks = []
    best, cycle = -1.0, None
    for k, (file, candidates) in enumerate(zip(files, near)):
        pick = []
        for row in candidates:
            observed = int(file["peak/observed"][row])
            omega = float(file["peak/omega"][row])
            if any(other == observed and abs(omega - at) <= same for other, at in kept):
                continue
            kept.append((observed, omega))
            pick.append(row)
            height = float(file["peak/amplitude"][row])
            if observed == 0 and height > best and "peak/cycle" in file:
                best, cycle = height, k
        picks.append(np.array(pick, dtype=np.intp))
    if cycle is None:
        with_cycle = [k for k, file in enumerate(files) if "peak/cycle" in file]
        cycle = with_cycle[0] if with_cycle else None
    return picks, cycle


def with_widths(target: h5py.File) -> None:
    """Put the maxima in the order of a result, and give a width to those whose flanks other pieces
    have."""
    group = target["peak"]
    order = np.lexsort((group["omega"][()], group["observed"][()]))
    for item in group.values():
        if isinstance(item, h5py.Dataset):
            item[...] = item[()][order]
    good = target["converged"][()].astype(bool)
    omega, mean = target["omega"][()][good], np.abs(target["coefficients"][:, 0, :][good])
    amplitude = target["amplitude"][()][good]
    observed, at, width = (group[name][()] for name in ("observed", "omega", "bandwidth"))
    for k in np.flatnonzero(np.isnan(width)):
        i = int(observed[k])
        others = np.flatnonzero(observed == i)
        # Its samples: the rows and the maxima between them.
        places = np.concatenate([omega, at[others]])
        values = np.concatenate([amplitude[:, i], group["amplitude"][()][others]])
        means = np.concatenate([mean[:, i], np.abs(group["coefficients"][()][others, 0])])
        width[k] = _width(places, values, means, at[k])
    group["bandwidth"][...] = width


def _width(omega: Floats, amplitude: Floats, mean: Floats, at: float) -> float:
    """Width at half of the power between samples, of which one is at the maximum; else NaN."""
    order = np.argsort(omega, kind="stable")
    omega, amplitude, mean = omega[order], amplitude[order], mean[order]
    # A row may stand on the maximum: the last of two at one place is the maximum itself.
    k = int(np.flatnonzero(omega == at)[-1])
    swing = np.maximum(amplitude - np.minimum(mean[k], mean), 1e-12 * amplitude)
    squares = omega**2
    with np.errstate(divide="ignore"):
        fallen = np.sqrt(np.maximum((swing[k] / swing)**2 - 1.0, 0.0))
    edges = []
    for side in (-1, 1):
        inner, j = (squares[k], 0.0), k + side
        while 0 <= j < len(omega) and fallen[j] < 1.0:
            inner = (squares[j], fallen[j])
            j += side
        if not 0 <= j < len(omega) or not (fallen[j] <= _FAR or inner[1] >= _AT_EDGE):
            return float("nan")
        share = (1.0 - inner[1]) / (fallen[j] - inner[1])
        edges.append(np.sqrt(inner[0] + share * (squares[j] - inner[0])))
    return float(edges[1] - edges[0])


def peak_remarks(target: h5py.File, *, undamped: bool) -> list[tuple[str, str]]:
    """What the program remarks of its maxima (src/driver/remarks.f90), of all of them."""
    group = target["peak"]
    words = [str(word) for word in group["found_by"].attrs["names"]]
    found = [words[k] for k in group["found_by"][()]]
    observed, height = group["observed"][()], group["amplitude"][()]
    names = target["observed/name"].asstr()[()]
    bound = []
    for i, name in enumerate(names):
        own = np.flatnonzero(observed == i)
        if len(own) and found[own[np.argmax(height[own])]] == _BOUND:
            bound.append(str(name))
    remarks = []
    if bound:
        others = f" and of {len(bound) - 1} more" if len(bound) > 1 else ""
        remarks.append(("peak at the end", f"the largest amplitude of {bound[0]}{others} is at an "
                        "end of the sweep: it may rise further outside"))
    n_open = found.count(_UNRESOLVED)
    if n_open:
        remedy = ("nothing but contact damps the structure, and a resonance without damping has no "
                  "height: set model%damping or model%modal_damping") if undamped else (
                  "take more points around them (/peak/omega), or continuation = 'arclength'")
        remarks.append(("peak not resolved",
                        f"{n_open} of {len(found)} maxima are not resolved: {remedy}"))
    return remarks
