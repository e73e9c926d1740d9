"""Model files (HDF5, format_version 1): the one place that writes them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

__all__ = ["strings", "write_model_file"]

FORMAT, FORMAT_VERSION = "fretwear-model", 1
#: Numbers that are packed within a second or two.
_SMALL = 3_000_000


def write_model_file(path: str | Path, datasets: Mapping[str, NDArray[Any]], *, title: str,
                     unit_system: str = "", attributes: Mapping[str, str] | None = None,
                     groups: Mapping[str, Mapping[str, int | str]] | None = None) -> None:
    """Write a model file; an older one of that name is replaced once the new one is complete.

    Parameters
    ----------
    path : str or Path
        Target.
    datasets : mapping of str to array
        By their names in the file, such as "contact/side_1".
    title, unit_system : str
        Attributes of the format.
    attributes : mapping of str to str, optional
        Further attributes, which are no part of the format.
    groups : mapping of str to mapping, optional
        Attributes of groups.
    """
    path = Path(path)
    partial = path.with_name(path.name + ".part")
    try:
        with h5py.File(partial, "w") as file:
            file.attrs["format"] = np.bytes_(FORMAT)
            file.attrs["format_version"] = np.int32(FORMAT_VERSION)
            texts = {"title": title, "unit_system": unit_system, **(attributes or {})}
            for name, text in texts.items():
                if text:
                    file.attrs[name] = np.bytes_(text.encode())
            for name, data in datasets.items():
                # Filters pay for themselves on matrices only; the last percent only where it
                # takes no time.
                packed = {"compression": "gzip", "shuffle": True,
                          "compression_opts": 9 if data.size < _SMALL else 4}
                if name == "mesh/basis":
                    packed["chunks"] = data.shape   # read as one
                file.create_dataset(name, data=data, **(packed if data.size > 10_000 else {}))
            for group, values in (groups or {}).items():
                file.require_group(group).attrs.update(
                    {name: np.bytes_(value.encode()) if isinstance(value, str) else np.int32(value)
                     for name, value in values.items()})
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def strings(values: Iterable[str]) -> NDArray[np.bytes_]:
    """Texts of fixed length, which Fortran reads without pointers."""
    return np.array([value.encode("ascii") for value in values])
