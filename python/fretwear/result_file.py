"""A result file (format "fretwear-result"): where it is, its datasets, what it says of its run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ._arguments import text
from .errors import AbsentError, InputError, OutputError

__all__ = ["Quantity", "ResultFile", "plain_text"]

FORMAT, FORMAT_VERSION = "fretwear-result", 1

#: What makes a dataset present, by its name or the group that it is in.
_REMEDIES = {
    "contact/position": "give the pairs places (contact/position of a model)",
    "contact/area": "give the pairs areas (contact%area)",
    "contact/patch": "give the pairs patches (contact/patch of a model)",
    "contact/law": "all pairs have one law: contact%law of the namelist",
    "contact/": "it needs contact pairs, and output%contact = .true.",
    "history/": "run with output%histories = .true.",
    "floquet/": "run with sweep%stability = .true.",
    "wear/depth_halved": "run with wear%check_steps = .true.",
    "wear/": "run with case%analysis = 'wear'",
    "error_estimate": "run with harmonics%accuracy",
    "instants": "run with harmonics%accuracy",
    "harmonics": "run with harmonics%accuracy",
    "tangent/": "run with sweep%continuation = 'arclength'",
    "fold": "run with sweep%continuation = 'arclength'",
    "served_by": "run with case%analysis = 'frf' or 'point'",
    "bifurcation/": "run a sweep with sweep%stability = .true., or a branch that turns",
    "cyclic/": "give the case sectors (&cyclic n_sectors, engine_order)",
    "mode/": "run with case%analysis = 'mode'",
    "synthesis/": "run case%analysis = 'mode' with mode%synthesis",
    "resonance/": "run with case%analysis = 'resonance'",
    "parameter": "run with case%analysis = 'resonance'",
    "modes/": "run with case%analysis = 'modes'",
    "sensitivity/": "run with sensitivity%parameters",
    "peak/cycle/": "run a sweep with contact with this version of fretwear",
    "peak/": "run a sweep (case%analysis = 'frf') with this version of fretwear",
    "observed/": "name what to observe in output%observe",
}


@dataclass(frozen=True)
class Quantity:
    """A dataset as its file declares it.

    Attributes
    ----------
    name : str
        In the file, such as "contact/force".
    shape : tuple of int
        Of the array.
    dimensions : tuple of str
        Names of its axes ("point", "pair", ...); empty where the file names none.
    units : str
        Units of the model; "" where the file does not say.
    long_name : str
        What it is, in words.
    """

    name: str
    shape: tuple[int, ...]
    dimensions: tuple[str, ...]
    units: str
    long_name: str


class ResultFile:
    """A result file, or one in memory, as named arrays with units.

    Nothing is read before it is asked for; arrays are read once, kept, and read-only. The file is
    open only while it is read.
    """

    def _begin(self, path: Path | None, image: bytes | None, *, is_ours: bool = False) -> None:
        """Take a file or its bytes; refuse what is no result, unless the library has just made it.
        """
        self._path, self._image = path, image
        self._arrays: dict[str, NDArray[Any]] = {}
        self._held: h5py.File | None = None
        if is_ours:
            return
        with self.open() as file:
            kind = plain_text(file.attrs.get("format", ""))
            if kind != FORMAT:
                raise InputError(f"{self.name}: format is '{kind}', expected '{FORMAT}'")
            version = int(file.attrs.get("format_version", 0))
            if version > FORMAT_VERSION:
                raise InputError(f"{self.name}: format_version is {version}, this package reads "
                                 f"up to {FORMAT_VERSION}; update fretwear")

    # ------------------------------------------------------------------ where it is

    @property
    def name(self) -> str:
        """Path of the file, as a text; 'result in memory' of one that has none."""
        return str(self._path) if self._path is not None else "result in memory"

    @property
    def path(self) -> Path:
        """The file.

        Raises
        ------
        AbsentError
            The result is in memory.
        """
        if self._path is None:
            raise AbsentError("the result is in memory and has no file: write one with save(path), "
                              "or run with file=...")
        return self._path

    @cached_property
    def _declared(self) -> dict[str, Quantity]:
        """Every dataset of the file."""
        found: dict[str, Quantity] = {}

        def note(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset):
                found[name] = _declare(name, item)

        with self.open() as file:
            file.visititems(note)
        return found

    @cached_property
    def _attributes(self) -> dict[str, Any]:
        with self.open() as file:
            return {name: _plain(value) for name, value in file.attrs.items()}

    @contextmanager
    def open(self) -> Iterator[h5py.File]:
        """Open the file for reading with h5py.

        Yields
        ------
        h5py.File
            Closed at the end of the `with` block.
        """
        if self._held is not None:
            yield self._held
            return
        try:
            if self._image is not None:
                file = h5py.File(h5py.h5f.open_file_image(self._image))
            else:
                file = h5py.File(self.path, "r")
        except OSError as error:
            reason = str(error) if self._path is None or self._path.exists() else (
                "there is no such file")
            if "file signature not found" in reason:
                reason = "it is no HDF5 file; a run of fw_run writes one"
            raise OutputError(f"{self.name}: cannot be read: {reason}") from None
        with file:
            yield file

    @contextmanager
    def kept_open(self) -> Iterator[None]:
        """Keep the file open in a `with` block, for many small readings."""
        with self.open() as file:
            before, self._held = self._held, file
            try:
                yield
            finally:
                self._held = before

    # ------------------------------------------------------------------ any dataset

    def __contains__(self, name: str) -> bool:
        if not isinstance(name, str) or not name.strip("/"):
            return False
        if name.strip("/") in self._arrays:
            return True
        with self.open() as file:
            return isinstance(file.get(name.strip("/")), h5py.Dataset)

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._declared))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Read a dataset by its name in the file, such as "contact/force"."""
        name = text("name", name).strip("/")
        if name not in self._arrays:
            with self.open() as file:
                item = file.get(name) if name else None
                if not isinstance(item, h5py.Dataset):
                    raise self._absent(name)
                array: NDArray[Any] = np.asarray(item[()])
            if array.dtype.kind in "SO":
                array = np.array([plain_text(word) for word in array.ravel()]).reshape(array.shape)
            array.flags.writeable = False
            self._arrays[name] = array
        return self._arrays[name]

    def declared(self, name: str) -> Quantity:
        """Shape, dimensions, units and meaning of a dataset, as the file declares them.

        Raises
        ------
        AbsentError
            The file does not hold it; the message says what would.
        """
        name = text("name", name).strip("/")
        if name not in self:
            raise self._absent(name)
        with self.open() as file:
            return _declare(name, file[name])

    def _absent(self, name: str) -> AbsentError:
        for start, how in _REMEDIES.items():
            if name == start or (start.endswith("/") and name.startswith(start)):
                return AbsentError(f"{self.name}: holds no dataset /{name}: {how}")
        return AbsentError(f"{self.name}: holds no dataset /{name}; there are "
                           + ", ".join("/" + known for known in self))

    def units(self, name: str) -> str:
        """Units of a dataset; '' where the file does not say (units of the model)."""
        return self.declared(name).units

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the file: format, title, status, namelist, elapsed, ..."""
        return dict(self._attributes)

    # ------------------------------------------------------------------ the run

    def _attribute(self, name: str) -> Any:
        with self.open() as file:
            if name in file.attrs:
                return _plain(file.attrs[name])
        raise AbsentError(f"{self.name}: has no attribute {name}; a run of this version of "
                          "fretwear writes it")

    @property
    def title(self) -> str:
        """Title of the case."""
        return str(self._attribute("title"))

    @property
    def status(self) -> str:
        """'complete', 'not converged', 'stopped', 'incomplete' or 'failed: ...'."""
        return str(self._attribute("status"))

    @property
    def namelist(self) -> str:
        """The effective input, every default written out."""
        return str(self._attribute("namelist"))

    @property
    def elapsed(self) -> float:
        """Time of the run [s]."""
        if self.status == "incomplete":
            raise AbsentError(f"{self.name}: has no time of the run: it has not come to its end, "
                              "or was killed")
        return float(self._attribute("elapsed"))

    @property
    def remarks(self) -> list[str]:
        """What the program remarked on the input and the answer; empty where nothing."""
        name = next((name for name in ("remarks/text", "remarks") if name in self), None)
        return [] if name is None else [str(remark) for remark in self[name]]


def _declare(name: str, item: h5py.Dataset) -> Quantity:
    return Quantity(
        name, tuple(item.shape),
        tuple(plain_text(word) for word in item.attrs.get("DIMENSION_LABELS", ())),
        plain_text(item.attrs.get("units", "")), plain_text(item.attrs.get("long_name", "")))


def plain_text(value: object) -> str:
    """Text of an attribute or element, whatever string type HDF5 has used."""
    return (value.decode() if isinstance(value, bytes) else str(value)).strip()


def _plain(value: object) -> Any:
    """An attribute as a Python value."""
    if isinstance(value, (bytes, str)):
        return plain_text(value)
    return value.item() if isinstance(value, np.generic) else value
