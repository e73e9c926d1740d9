"""One result of several pieces, as one process would have written it.

Every dataset whose first dimension is the point is put together from the rows that each piece owns;
peaks and bifurcations are those that lie there; the rest is alike in all pieces.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .overlap import Part
from .peaks import found_peaks, peak_remarks, with_widths

__all__ = ["join"]

Floats = NDArray[np.float64]
Picks = list[NDArray[np.intp]]

_STATUSES = ("complete", "not converged", "stopped")
#: Remarks that the joined peaks say anew, and what every piece has to say for the sweep to say it.
_OF_PEAKS, _OF_ALL = ("peak at the end", "peak not resolved"), ("no mode",)


def join(parts: Sequence[Part], places: Floats, namelist: str, elapsed: float,
         several: Sequence[str], *, was_stopped: bool) -> bytes:
    """The joined result file.

    Parameters
    ----------
    parts : sequence of Part
        In the order of the sweep.
    places : (n_points,) array
        Of all rows of the sweep.
    namelist : str
        The effective case of the whole.
    elapsed : float
        Time of the run [s].
    several : sequence of str
        Where pieces did not agree.
    was_stopped : bool
        Whether some rows are missing.

    Returns
    -------
    bytes
        What the file holds.
    """
    rising = len(places) < 2 or places[1] > places[0]
    sign = 1.0 if rising else -1.0
    cuts = np.array([0.5 * (places[part.piece.first - 2] + places[part.piece.first - 1])
                     for part in parts[1:]])

    def owned(k: int, at: Floats, beyond: float = 0.0) -> NDArray[np.intp]:
        """What lies between the cuts of part k, or beyond them by so much."""
        inside = np.ones(len(at), dtype=bool)
        if k > 0:
            inside &= sign * (at - cuts[k - 1]) >= -beyond
        if k < len(parts) - 1:
            inside &= sign * (at - cuts[k]) < beyond
        return np.flatnonzero(inside)

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as target:
        files = [h5py.File(h5py.h5f.open_file_image(part.image)) for part in parts]
        try:
            rows = [owned(k, part.places) for k, part in enumerate(parts)]
            _copy(files, target, rows)
            step = float(np.abs(np.diff(places)).min()) if len(places) > 1 else 0.0
            if any("peak/omega" in file for file in files):
                near = [owned(k, file["peak/omega"][()], 0.25 * step) if "peak/omega" in file
                        else np.zeros(0, dtype=np.intp) for k, file in enumerate(files)]
                picked, cycle = found_peaks(files, near, same=1e-3 * step)
                _stack(files, target, "peak", picked)
                if cycle is not None:
                    files[cycle].copy("peak/cycle", target["peak"])
                with_widths(target)
            _join_bifurcations(files, target, owned)
            _join_remarks(parts, files, target, several, complete=not was_stopped)
            _finish(files, target, namelist, elapsed, was_stopped=was_stopped)
        finally:
            for file in files:
                file.close()
    return buffer.getvalue()


def _copy(files: Sequence[h5py.File], target: h5py.File, rows: Picks) -> None:
    """Attributes, what is of the points, and what is alike in all."""
    _copy_attributes(files[0], target)

    def take(name: str, item: Any) -> None:
        if name.split("/")[0] in ("peak", "bifurcation", "remarks"):
            return
        if isinstance(item, h5py.Group):
            _copy_attributes(item, target.require_group(name))
        elif _is_of_points(item):
            _stack_one(files, target, name, rows)
        else:
            files[0].copy(name, target, name)

    files[0].visititems(take)


def _is_of_points(item: h5py.Dataset) -> bool:
    labels = item.attrs.get("DIMENSION_LABELS", [""])
    return len(labels) > 0 and str(labels[0]) == "point"


def _stack(files: Sequence[h5py.File], target: h5py.File, group: str, picks: Picks) -> None:
    """The picked rows of every dataset of a group; datasets of groups in it are left out."""
    first = next(file for file in files if group in file)
    _copy_attributes(first[group], target.require_group(group))
    for name, item in first[group].items():
        if isinstance(item, h5py.Dataset):
            _stack_one(files, target, f"{group}/{name}", picks)


def _stack_one(files: Sequence[h5py.File], target: h5py.File, name: str, picks: Picks) -> None:
    like = next(file[name] for file in files if name in file)
    data = np.concatenate([file[name][()][pick] if name in file
                           else np.zeros((0, *like.shape[1:]), dtype=like.dtype)
                           for file, pick in zip(files, picks)])
    new = target.create_dataset(name, data=data, dtype=like.dtype, chunks=like.chunks,
                                maxshape=like.maxshape if like.chunks else None,
                                compression=like.compression, shuffle=like.shuffle,
                                compression_opts=like.compression_opts)
    _copy_attributes(like, new)


def _copy_attributes(source: Any, target: Any) -> None:
    for name in source.attrs:
        target.attrs.create(name, source.attrs[name], dtype=source.attrs.get_id(name).dtype)


def _join_bifurcations(files: Sequence[h5py.File], target: h5py.File, owned: Any) -> None:
    if not any("bifurcation" in file for file in files):
        return
    where = "bifurcation/parameter" if any("bifurcation/parameter" in file for file in files) else (
        "bifurcation/omega")
    _stack(files, target, "bifurcation",
           [owned(k, file[where][()]) if where in file else np.zeros(0, dtype=np.intp)
            for k, file in enumerate(files)])


def _join_remarks(parts: Sequence[Part], files: Sequence[h5py.File], target: h5py.File,
                  several: Sequence[str], *, complete: bool) -> None:
    """Those of the case once; what is of some of the points says of which."""
    said: dict[str, dict[str, list[int]]] = {}
    for k, file in enumerate(files):
        if "remarks" in file:
            for name, text in zip(file["remarks/name"].asstr()[()],
                                  file["remarks/text"].asstr()[()]):
                said.setdefault(name, {}).setdefault(text, []).append(k)
    found: list[tuple[str, str]] = []
    for name, texts in said.items():
        if name in _OF_PEAKS:
            continue
        for text, by in texts.items():
            if len(by) == len(files):
                found.append((name, text))
            elif name not in _OF_ALL:
                found += [(name, f"points {parts[k].piece.first} to {parts[k].piece.last}: {text}")
                          for k in by]
    if complete and "peak" in target:
        undamped = any("nothing but contact damps" in text
                       for text in said.get("peak not resolved", {}))
        found += peak_remarks(target, undamped=undamped)
    found += [("several solutions", text) for text in several]
    if found:
        text_type = h5py.string_dtype()
        group = target.create_group("remarks")
        for column, name in enumerate(("name", "text")):
            group.create_dataset(name, data=[row[column] for row in found], dtype=text_type)


def _finish(files: Sequence[h5py.File], target: h5py.File, namelist: str, elapsed: float, *,
            was_stopped: bool) -> None:
    worst = max((str(file.attrs["status"]) for file in files),
                key=lambda word: _STATUSES.index(word) if word in _STATUSES else len(_STATUSES))
    # A piece may have failed in a row that another one owns.
    if worst == "not converged" and target["converged"][()].all():
        worst = "complete"
    target.attrs["status"] = "stopped" if was_stopped else worst
    target.attrs["namelist"] = namelist
    target.attrs["elapsed"] = elapsed
