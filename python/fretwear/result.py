"""Result files (format "fretwear-result") as arrays with names and units."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ._arguments import text, whole
from .errors import InputError, OutputError

if TYPE_CHECKING:
    import xarray

__all__ = ["DIRECTIONS", "STATES", "Result"]

Floats = NDArray[np.float64]

FORMAT, FORMAT_VERSION = "fretwear-result", 1
#: Components of a contact pair, in the order of `Result.force`.
DIRECTIONS = ("t1", "t2", "n")
#: Contact states, in the order of `Result.fraction`.
STATES = ("stick", "slip", "open")

#: Dimensions of every dataset that `Result.to_xarray` takes over.
_DIMENSIONS: dict[str, tuple[str, ...]] = {
    "coefficients": ("point", "coefficient", "observed"),
    "amplitude": ("point", "observed"),
    "converged": ("point",),
    "iterations": ("point",),
    "residual": ("point",),
    "seconds": ("point",),
    "served_by": ("point",),
    "fold": ("point",),
    "harmonics": ("point",),
    "instants": ("point",),
    "error_estimate": ("point",),
    "floquet/stable": ("point",),
    "contact/force": ("point", "coefficient", "pair", "direction"),
    "contact/fraction": ("point", "pair", "state"),
    "contact/dissipation": ("point", "pair"),
    "wear/depth": ("step", "pair"),
    "wear/rate": ("step", "pair"),
    "wear/energy": ("step", "pair"),
    "wear/volume": ("step", "patch"),
}


class Result:
    """What a run has left in its result file.

    Nothing is read before it is asked for; arrays are read once, kept, and read-only. The file is
    open only while it is read, so a result can be pickled, and replaced by a later run.

    Parameters
    ----------
    path : str or Path
        Result file, or the `.part` file of a run at work.

    Raises
    ------
    OutputError
        The file cannot be read.
    InputError
        The file is no result file, or of a later format.

    Examples
    --------
    >>> result = Result("frf.h5")                                         # doctest: +SKIP
    >>> result.frequency[result.peak("tip")], result.amplitude_of("tip").max()  # doctest: +SKIP
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._arrays: dict[str, NDArray[Any]] = {}
        with self.open() as file:
            kind = _text(file.attrs.get("format", ""))
            if kind != FORMAT:
                raise InputError(f"{self.path}: format is '{kind}', expected '{FORMAT}'")
            version = int(file.attrs.get("format_version", 0))
            if version > FORMAT_VERSION:
                raise InputError(f"{self.path}: format_version is {version}, this package reads "
                                 f"up to {FORMAT_VERSION}; update fretwear")

    @cached_property
    def _names(self) -> frozenset[str]:
        """Every dataset of the file."""
        found: list[str] = []

        def note(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset):
                found.append(name)

        with self.open() as file:
            file.visititems(note)
        return frozenset(found)

    @cached_property
    def _attributes(self) -> dict[str, Any]:
        with self.open() as file:
            return {name: _plain(value) for name, value in file.attrs.items()}

    def __repr__(self) -> str:
        return f"<Result {str(self.path)!r}: {self.n_points} points, {self.status}>"

    @contextmanager
    def open(self) -> Iterator[h5py.File]:
        """Open the file for reading with h5py.

        Yields
        ------
        h5py.File
            Closed at the end of the `with` block.
        """
        try:
            file = h5py.File(self.path, "r")
        except OSError as error:
            reason = "there is no such file" if not self.path.exists() else str(error)
            raise OutputError(f"{self.path}: cannot be read: {reason}") from None
        with file:
            yield file

    # ------------------------------------------------------------------ any dataset

    def __contains__(self, name: str) -> bool:
        return isinstance(name, str) and name.strip("/") in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._names))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Read a dataset by its name in the file, such as "contact/force"."""
        name = text("name", name).strip("/")
        if name not in self._arrays:
            self._arrays[name] = self._read(name)
        return self._arrays[name]

    def _read(self, name: str) -> NDArray[Any]:
        with self.open() as file:
            array: NDArray[Any] = np.asarray(self._find(file, name)[()])
        if array.dtype.kind in "SO":
            array = np.array([_text(word) for word in array.ravel()]).reshape(array.shape)
        array.flags.writeable = False
        return array

    def _find(self, file: h5py.File, name: str) -> h5py.Dataset:
        found = file.get(name) if name else None
        if not isinstance(found, h5py.Dataset):
            raise InputError(f"{self.path}: holds no dataset /{name}; there are "
                             + ", ".join("/" + known for known in self))
        return found

    def units(self, name: str) -> str:
        """Units of a dataset; '' where the file does not say (units of the model)."""
        name = text("name", name).strip("/")
        with self.open() as file:
            return _text(self._find(file, name).attrs.get("units", ""))

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the file: format, title, status, namelist, elapsed, ..."""
        return dict(self._attributes)

    # ------------------------------------------------------------------ the run

    @property
    def title(self) -> str:
        """Title of the case."""
        return str(self._attributes.get("title", ""))

    @property
    def status(self) -> str:
        """'complete', 'not converged', 'stopped', 'incomplete' or 'failed: ...'."""
        return str(self._attributes.get("status", ""))

    @property
    def namelist(self) -> str:
        """The effective input, every default written out."""
        return str(self._attributes.get("namelist", ""))

    @property
    def elapsed(self) -> float:
        """Time of the run [s]."""
        return float(self._attributes.get("elapsed", 0.0))

    # ------------------------------------------------------------------ points

    @property
    def n_points(self) -> int:
        """Solution points in the file."""
        return len(self.omega) if "omega" in self else 0

    @property
    def n_harmonics(self) -> int:
        """H, the number of harmonics beside the static one."""
        return (self.coefficients.shape[1] - 1) // 2

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of the observed quantities (n_observed)."""
        return tuple(str(name) for name in self["observed/name"])

    @property
    def omega(self) -> Floats:
        """Angular frequency of every point [rad/s] (n_points)."""
        return self["omega"]

    @property
    def frequency(self) -> Floats:
        """Frequency of every point [Hz] (n_points)."""
        return self.omega / (2.0 * np.pi)

    @property
    def coefficients(self) -> Floats:
        """Fourier coefficients (0, c1, s1, c2, ...) (n_points, 2H+1, n_observed)."""
        return self["coefficients"]

    @property
    def amplitude(self) -> Floats:
        """Largest magnitude over the period, static part included (n_points, n_observed)."""
        return self["amplitude"]

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Which points converged (n_points)."""
        return self["converged"].astype(bool)

    @property
    def served_by(self) -> list[str]:
        """What gave the solution of each point: 'newton', 'other guess', 'pseudo-time', 'smaller
        steps', 'raised load', 'free guess', 'powell', 'kinsol' or 'arclength'; 'none' where the
        point did not converge. Of sweeps and single points (n_points).
        """
        codes = self["served_by"]
        with self.open() as file:
            names = [_text(name) for name in file["served_by"].attrs["names"]]
        return [names[int(code)] for code in codes]

    @property
    def iterations(self) -> NDArray[np.int_]:
        """Iterations of the solver (n_points)."""
        return self["iterations"].astype(int)

    @property
    def residual(self) -> Floats:
        """norm(R)/norm(F) at the end (n_points)."""
        return self["residual"]

    @property
    def seconds(self) -> Floats:
        """Time spent on every point [s] (n_points)."""
        return self["seconds"]

    # ------------------------------------------------------------------ contact

    @property
    def n_pairs(self) -> int:
        """Contact pairs of which the file knows; 0 without any."""
        for name, axis in (("contact/fraction", 1), ("wear/depth", 1)):
            if name in self:
                return int(self[name].shape[axis])
        return 0

    @property
    def force(self) -> Floats:
        """Fourier coefficients of the contact forces (n_points, 2H+1, n_pairs, 3) [force]."""
        return self["contact/force"]

    @property
    def fraction(self) -> Floats:
        """Shares of the period in stick, slip and open (n_points, n_pairs, 3)."""
        return self["contact/fraction"]

    @property
    def dissipation(self) -> Floats:
        """Friction energy per cycle (n_points, n_pairs) [force * length]."""
        return self["contact/dissipation"]

    # ------------------------------------------------------------------ stability

    @property
    def stable(self) -> NDArray[np.int_] | None:
        """1 stable, 0 unstable, -1 not known (n_points); None where it was not asked for."""
        return self["floquet/stable"].astype(int) if "floquet/stable" in self else None

    # ------------------------------------------------------------------ wear

    @property
    def cycles(self) -> Floats:
        """Cycles of vibration at every wear step; pseudo-time for that scheme (n_steps)."""
        return self["wear/cycles"]

    @property
    def depth(self) -> Floats:
        """Wear depth of every pair (n_steps, n_pairs) [length]."""
        return self["wear/depth"]

    @property
    def rate(self) -> Floats:
        """Wear depth per cycle (n_steps, n_pairs) [length]."""
        return self["wear/rate"]

    @property
    def volume(self) -> Floats:
        """Worn volume of every patch (n_steps, n_patches) [length^3]."""
        return self["wear/volume"]

    @property
    def steady_state(self) -> str | None:
        """'reached', 'not reached' or 'none: gross slip'; None without a wear analysis."""
        if "wear/depth" not in self:
            return None
        with self.open() as file:
            found = file["wear"].attrs.get("steady_state", file.attrs.get("steady_state"))
        return None if found is None else _text(found)

    # ------------------------------------------------------------------ one quantity

    def index(self, observe: str | int | None = None) -> int:
        """Column of an observed quantity.

        Parameters
        ----------
        observe : str or int, optional
            Name, or column from 0; the first one without it.
        """
        names = self.observed
        if observe is None:
            observe = 0
        if isinstance(observe, str):
            if observe not in names:
                raise InputError(f"{self.path}: '{observe}' is not observed; available: "
                                 + ", ".join(names))
            return names.index(observe)
        if not names:
            raise InputError(f"{self.path}: nothing is observed")
        return whole("observe, a column,", observe, 0, len(names) - 1)

    def amplitude_of(self, observe: str | int | None = None) -> Floats:
        """Amplitude of one observed quantity (n_points), NaN at points that did not converge."""
        values: Floats = self.amplitude[:, self.index(observe)]
        return np.where(self.converged, values, np.nan)

    def harmonic(self, n: int, observe: str | int | None = None) -> NDArray[np.complex128]:
        """Complex amplitude ``U_n = c_n - i s_n`` of one observed quantity (n_points).

        Parameters
        ----------
        n : int
            Harmonic, 0 to H; the static one is real.
        observe : str or int, optional
            See `index`.
        """
        whole("n, a harmonic,", n, 0, self.n_harmonics)
        values = self.coefficients[:, :, self.index(observe)]
        if n == 0:
            return values[:, 0].astype(np.complex128)
        return values[:, 2 * n - 1] - 1j * values[:, 2 * n]

    def peak(self, observe: str | int | None = None) -> int:
        """Number (from 0) of the converged point of largest amplitude."""
        values = self.amplitude_of(observe)
        if not np.isfinite(values).any():
            raise InputError(f"{self.path}: no converged point")
        return int(np.nanargmax(values))

    # ------------------------------------------------------------------ notebooks

    def to_xarray(self) -> xarray.Dataset:
        """Everything with one row per point or per wear step, with coordinates and units.

        Returns
        -------
        xarray.Dataset
            Dimensions point (step in a wear analysis), coefficient, observed, pair, direction,
            state and patch; coordinates omega, frequency and cycles. Names as in the file with
            `_` for `/`.

        Raises
        ------
        ImportError
            xarray is not installed.
        """
        import xarray

        variables = {}
        for name in self:
            if name not in _DIMENSIONS:
                continue
            units = self.units(name)
            values = self.converged if name == "converged" else self[name]
            dimensions = [self._row if dimension in ("point", "step") else dimension
                          for dimension in _DIMENSIONS[name]]
            variables[name.replace("/", "_")] = xarray.Variable(
                dimensions, values, {"units": units} if units else {})
        return xarray.Dataset(variables, self._coordinates(), {
            key: value for key, value in self._attributes.items() if key != "format_version"})

    @property
    def _row(self) -> str:
        """What a row is: a point of a sweep, or a step of wear."""
        return "step" if "wear/cycles" in self else "point"

    def _coordinates(self) -> dict[str, Any]:
        known: dict[str, Any] = {
            "observed": ("observed", list(self.observed)), "direction": list(DIRECTIONS),
            "state": list(STATES)}
        if "omega" in self:
            known["omega"] = (self._row, self.omega, {"units": "rad/s"})
            known["frequency"] = (self._row, self.frequency, {"units": "Hz"})
        if "coefficients" in self:
            harmonics = range(1, self.n_harmonics + 1)
            known["coefficient"] = ["0", *(f"{part}{n}" for n in harmonics for part in "cs")]
        if self.n_pairs:
            known["pair"] = np.arange(1, self.n_pairs + 1)
        else:
            del known["direction"], known["state"]
        if "wear/cycles" in self:
            known["cycles"] = ("step", self.cycles, {"units": self.units("wear/cycles") or "1"})
        if "wear/patch" in self:
            known["patch"] = self["wear/patch"].tolist()
        return known


def _text(value: object) -> str:
    """Text of an attribute or element, whatever string type HDF5 has used."""
    return (value.decode() if isinstance(value, bytes) else str(value)).strip()


def _plain(value: object) -> Any:
    """An attribute as a Python value."""
    if isinstance(value, (bytes, str)):
        return _text(value)
    return value.item() if isinstance(value, np.generic) else value
