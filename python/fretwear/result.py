"""Results as arrays with names and units: points, contact, wear, and single quantities."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import whole
from ._native import namelist_values
from ._notebook import result_dataset, result_html
from ._words import did_you_mean
from .bifurcation import Bifurcation, read_bifurcations
from .case import Case
from .cycle import Cycle, read_cycle, read_peak_cycle
from .errors import AbsentError, InputError, OutputError
from .natural_modes import NaturalModes, read_natural_modes
from .nonlinear_mode import NonlinearMode, read_mode
from .peaks import Peak, read_peaks
from .resonance_track import ResonanceTrack, read_resonance
from .result_file import Quantity, ResultFile, plain_text
from .sensitivity import Sensitivities, read_sensitivities

if TYPE_CHECKING:
    import pyvista
    import xarray
    from matplotlib.figure import Figure

    from .export.animation import Animation

__all__ = ["DIRECTIONS", "STATES", "Quantity", "Result"]

Floats = NDArray[np.float64]

#: Components of a contact pair, in the order of `Result.force`.
DIRECTIONS = ("t1", "t2", "n")
#: Contact states, in the order of `Result.fraction`.
STATES = ("stick", "slip", "open")
#: Kinds of pictures that show a whole run, the best one first.
_WHOLE = ("wear_evolution", "mode", "resonance", "bounds", "response", "nodal_diameters", "cycle",
          "ringdown", "campbell", "population")


class Result(ResultFile):
    """What a run has left in its result file.

    Nothing is read before it is asked for; arrays are read once, kept, and read-only. The file is
    open only while it is read, so a result can be pickled, and replaced by a later run.

    Parameters
    ----------
    path : str or Path
        Result file, or the `.part` file of a run at work.
    case : Case, optional
        The case that was run; the one that the file tells of without it.

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

    def __init__(self, path: str | Path, case: Case | None = None) -> None:
        self._begin(Path(path), None, case)

    @classmethod
    def from_bytes(cls, image: bytes, case: Case | None = None) -> Result:
        """A result that lives in memory.

        Parameters
        ----------
        image : bytes
            What a result file would hold.
        case : Case, optional
            The case that was run.
        """
        result = cls.__new__(cls)
        result._begin(None, image, case)
        return result

    @classmethod
    def of_run(cls, case: Case, path: str, image: bytes | None) -> Result:
        """The result that the library has just made of a case, in a file or in memory."""
        result = cls.__new__(cls)
        result._begin(Path(path) if image is None else None, image, case, is_ours=True)
        return result

    def _begin(self, path: Path | None, image: bytes | None, case: Case | None = None, *,
               is_ours: bool = False) -> None:
        self._case = case
        self._cycles: dict[int, Cycle] = {}
        super()._begin(path, image, is_ours=is_ours)

    # ------------------------------------------------------------------ the case

    def save(self, path: str | Path) -> Result:
        """Write the result to a file; returns the result of that file.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        path = Path(path)
        partial = path.with_name(path.name + ".part")
        try:
            image = self.path.read_bytes() if self._image is None else self._image
            partial.write_bytes(image)
            partial.replace(path)
        except OSError as error:
            partial.unlink(missing_ok=True)
            raise OutputError(f"{path}: cannot be written: {error.strerror}") from None
        return Result(path, self._case)

    @property
    def case(self) -> Case:
        """The case that was run: what `fretwear.run` was given, or the input that the file holds.

        A model file that has moved is looked for beside the result.

        Raises
        ------
        AbsentError
            The model was in the memory of another program, or its file is gone.
        """
        if self._case is None:
            self._case = self._case_of_file()
        return self._case

    def _case_of_file(self) -> Case:
        if namelist_values(self.namelist).get("model%source") == ["memory"]:
            raise AbsentError(f"{self.name}: its model was in the memory of the program that ran "
                              "it: keep the Result that `run` returned, or write the model with "
                              "to_hdf5 and run that file")
        case = Case.from_text(self.namelist, self._path or "case.nml")
        try:
            moved = str(self.model_file.absolute())
        except AbsentError:
            if namelist_values(self.namelist).get("model%source") == ["hdf5"]:
                raise
            return case
        return case.replace(structure={"file": moved})

    @property
    def model_file(self) -> Path:
        """Model file (HDF5) of the case, also where it has moved together with the result.

        Raises
        ------
        AbsentError
            The model is in no such file, or the file is not there.
        """
        values = namelist_values(self.namelist)
        source = values.get("model%source", ["inline"])[0]
        if source != "hdf5":
            raise AbsentError(f"{self.name}: has no model file: model%source = '{source}'; write "
                              "the model with Model.to_hdf5 and run that file")
        path = Path(values["model%file"][0])
        if path.exists():
            return path
        if self._path is not None and (beside := self._path.parent / path.name).exists():
            return beside
        raise AbsentError(f"{self.name}: its model file {path} is not there; put it there, or "
                          f"beside the result as {path.name}")

    def cycle(self, point: int) -> Cycle:
        """One period of the contact at a point (from 0): what the law gives at the instants.

        From the histories of the file where it holds them. Otherwise the point is solved once more,
        with histories, and has to come out as it stands in the result.

        Raises
        ------
        AbsentError
            There are no contact pairs, or the point cannot be had again; the message says why.
        """
        whole("point", point, 0, self.n_points - 1)
        if point not in self._cycles:
            self._cycles[point] = read_cycle(self, point)
        return self._cycles[point]

    @property
    def peak_cycle(self) -> Cycle:
        """One period at the peak of the first observed quantity, of the six pairs that dissipate
        most there; every sweep keeps it.

        Raises
        ------
        AbsentError
            The run was no sweep with contact, or has not come to its end.
        """
        return read_peak_cycle(self)

    def __repr__(self) -> str:
        points = f"{len(self.omega)} points, " if "omega" in self else ""
        return f"<Result {self.name!r}: {points}{self._attributes.get('status', 'no status')}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: a table, and the curve."""
        return result_html(self)

    # ------------------------------------------------------------------ points

    @property
    def n_points(self) -> int:
        """Solution points in the file; natural frequencies have none."""
        return 0 if "omega" not in self and "modes/open" in self else len(self.omega)

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
    def parameter(self) -> Floats:
        """Value of what a sweep goes over in place of the frequency (n_points).

        Raises
        ------
        AbsentError
            It goes over the frequency.
        """
        return self["parameter"]

    @property
    def parameter_name(self) -> str:
        """What a sweep goes over: 'load%harmonic_scale' for one, or 'frequency'."""
        if "parameter" not in self:
            return "frequency"
        with self.open() as file:
            return plain_text(file["parameter"].attrs["name"])

    @property
    def load_scale(self) -> Floats:
        """Factor of the vibratory loads, of a controlled response or a load sweep (n_points).

        Raises
        ------
        AbsentError
            The load of the case holds for all points.
        """
        return self["load/scale"]

    @property
    def control_amplitude(self) -> Floats:
        """Amplitude for which the load of each point was found (n_points) [length].

        Raises
        ------
        AbsentError
            The case has no `&control`.
        """
        return self["control/amplitude"]

    @property
    def coefficients(self) -> Floats:
        """Fourier coefficients (0, c1, s1, c2, ...) (n_points, 2H+1, n_observed)."""
        return self["coefficients"]

    def sector(self, j: int, name: str = "coefficients") -> Floats:
        """Fourier coefficients of sector j of a cyclic structure: those of sector 0, delayed, or,
        where sectors differ (`&cyclic mistuned`), its own.

        Parameters
        ----------
        j : int
            Any whole number; sectors are counted from 0.
        name : str
            "coefficients" or "contact/force".

        Returns
        -------
        (n_points, 2H+1, ..) array

        Raises
        ------
        AbsentError
            The result is of no cyclic structure.
        """
        if "engine_order" not in self.attributes:
            raise AbsentError(f"{self.name}: has no sectors: give the case &cyclic n_sectors and "
                              "engine_order")
        if name not in ("coefficients", "contact/force"):
            raise InputError(f"name = {name!r}: must be 'coefficients' or 'contact/force'")
        values = np.array(self[name])
        n_sectors = int(self.attributes["n_sectors"])
        if self.is_mistuned:
            # Sector after sector: observed quantities, or pairs.
            n = values.shape[2] // n_sectors
            first = j % n_sectors * n
            return values[:, :, first:first + n]
        turn = j * int(self.attributes["engine_order"]) % n_sectors / n_sectors
        for n in range(1, (values.shape[1] + 1) // 2):
            # U_n = c_n - i s_n of sector j is that of sector 0 times exp(-i n j phi).
            c, s = np.cos(2.0 * np.pi * n * turn), np.sin(2.0 * np.pi * n * turn)
            cosine, sine = values[:, 2 * n - 1].copy(), values[:, 2 * n].copy()
            values[:, 2 * n - 1] = c * cosine - s * sine
            values[:, 2 * n] = s * cosine + c * sine
        return values

    @property
    def is_mistuned(self) -> bool:
        """Whether all sectors of a cyclic structure were solved for."""
        return bool(self.attributes.get("mistuned", 0))

    @property
    def sector_amplitude(self) -> Floats:
        """Amplitudes of every sector of a cyclic structure (n_points, n_sectors, n_observed): where
        contact differs from sector to sector, the largest over that of the wave is the
        amplification factor."""
        if "engine_order" not in self.attributes:
            raise AbsentError(f"{self.name}: has no sectors: give the case &cyclic n_sectors and "
                              "engine_order")
        n_sectors = int(self.attributes["n_sectors"])
        if self.is_mistuned:
            return self.amplitude.reshape(len(self.amplitude), n_sectors, -1)
        return np.repeat(self.amplitude[:, None, :], n_sectors, axis=1)

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
            names = [plain_text(name) for name in file["served_by"].attrs["names"]]
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
        """Contact pairs of the case."""
        # Most files have the first, which spares going through all.
        for quantity in ([self.declared("contact/dissipation")] if "contact/dissipation" in self
                         else self._declared.values()):
            if "pair" in quantity.dimensions:
                return quantity.shape[quantity.dimensions.index("pair")]
        return int(namelist_values(self.namelist).get("contact%n_pairs", ["0"])[0])

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
    def stable(self) -> NDArray[np.int_]:
        """1 stable, 0 unstable, -1 undecided or not known (n_points).

        Undecided: a multiplier is as near to the unit circle as its error (`"floquet/error"`).
        """
        return self["floquet/stable"].astype(int)

    @property
    def modes(self) -> NaturalModes:
        """Natural frequencies, free and stuck, of a run with `analysis = 'modes'`."""
        return read_natural_modes(self)

    @property
    def bifurcations(self) -> list[Bifurcation]:
        """Where the response turns or its stability changes, in the order along it.

        Folds of branches, and with `stability` in `&sweep` all else; empty where there are none.
        """
        return read_bifurcations(self)

    # ------------------------------------------------------------------ derivatives

    @property
    def sensitivities(self) -> Sensitivities:
        """Derivatives by parameters: `result.sensitivities["largest"]["contact%mu"]`."""
        return read_sensitivities(self)

    # ------------------------------------------------------------------ modes

    @property
    def mode(self) -> NonlinearMode:
        """The curve of a nonlinear mode: amplitude, frequency, damping, limit cycles."""
        return read_mode(self)

    @property
    def resonance(self) -> ResonanceTrack:
        """A resonance over a parameter: amplitude, frequency, curvature, the optimum."""
        return read_resonance(self)

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
    def steady_state(self) -> str:
        """'reached', 'not reached' or 'none: gross slip'."""
        self.declared("wear/depth")
        with self.open() as file:
            found = file["wear"].attrs.get("steady_state", file.attrs.get("steady_state"))
        if found is None:
            raise AbsentError(f"{self.name}: does not say whether a steady state was reached: the "
                              "run has not come to its end")
        return plain_text(found)

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
                raise InputError(f"{self.name}: '{observe}' is not observed; available: "
                                 + ", ".join(names) + did_you_mean(observe, words=names))
            return names.index(observe)
        if not names:
            raise AbsentError(f"{self.name}: nothing is observed; name something in "
                              "output%observe")
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
            raise AbsentError(f"{self.name}: has no peak: no point has converged")
        return int(np.nanargmax(values))

    def maximum(self, observe: str | int | None = None) -> tuple[float, float]:
        """Where the curve is highest [rad/s], and how high.

        The highest of the maxima that the run has looked for between its points (`/peak`) and of
        the points themselves; the latter alone where the file holds no maxima.
        """
        column, point = self.index(observe), self.peak(observe)
        found = [(float(self.amplitude[point, column]), float(self.omega[point]))]
        if "peak/omega" in self:
            of_it = self["peak/observed"] == column
            found += zip(self["peak/amplitude"][of_it].tolist(),
                         self["peak/omega"][of_it].tolist())
        height, omega = max(found)
        return omega, height

    @property
    def peaks(self) -> tuple[Peak, ...]:
        """The maxima of every observed quantity, those between the points included.

        In the order of the file: quantity by quantity, each by rising frequency.

        Raises
        ------
        AbsentError
            The run was no sweep, or has not come to its end.
        """
        return read_peaks(self)

    # ------------------------------------------------------------------ notebooks

    def plot(self, kind: str | None = None, *, observe: str | None = None,
             point: int | None = None) -> Figure:
        """A picture of the result; as the last line of a cell a notebook shows it.

        Parameters
        ----------
        kind : str, optional
            As of `fretwear plot --kind`; what shows the whole run without it: response, mode,
            resonance, wear over the cycles, natural frequencies, a range, a decay, or one cycle.
        observe : str, optional
            Observed quantity; the first one without it.
        point : int, optional
            Solution point or wear step from 0; the largest amplitude, or the last step, without it.

        Raises
        ------
        InputError
            There is no such kind, or the result has nothing to draw of it.
        """
        # Pictures stand above results: loaded when one is asked for.
        kinds = importlib.import_module("fretwear.plot.kinds")
        fitting = kinds.fitting(self)
        if kind is None:
            kind = next((name for name in _WHOLE if name in fitting), None)
        if kind not in fitting:
            if kind is not None and kind not in kinds.KINDS:
                raise InputError(f"kind = {kind!r}: must be among {', '.join(kinds.KINDS)}"
                                 + did_you_mean(kind, words=kinds.KINDS))
            asked = "nothing is there to draw" if kind is None else f"kind = {kind!r} does not fit"
            raise AbsentError(f"{self.name}: {asked}; of this result "
                              + (", ".join(fitting) or "no picture") + " can be drawn")
        figure: Figure = kinds.KINDS[kind].draw(self, kinds.Choices(observe=observe, point=point))
        return figure

    def to_pyvista(self, point: int | None = None, phase: float | None = None, *,
                   sectors: int = 1, axis: str = "z") -> pyvista.UnstructuredGrid:
        """The mesh of the model with the motion and the contact at one point, for PyVista.

        `grid.warp_by_vector("displacement", factor=50).plot(scalars="slip")` shows it.

        Parameters
        ----------
        point, phase, sectors, axis
            See `fretwear.export.export_mesh`.

        Returns
        -------
        pyvista.UnstructuredGrid
            Point and cell data as there.

        Raises
        ------
        InputError
            No mesh belongs to the model, or PyVista is not installed.
        """
        # Meshes stand above results: loaded when one is asked for.
        export_mesh = importlib.import_module("fretwear.export").export_mesh
        try:
            import pyvista
        except ImportError:
            raise InputError("to_pyvista needs pyvista: pip install pyvista") from None
        return pyvista.wrap(export_mesh(self, point, phase, sectors=sectors, axis=axis))

    def animate(self, file: str | Path | None = None, **options: Any) -> Animation:
        """One period on the mesh of the model, as a picture that moves in a notebook.

        Parameters
        ----------
        file : str or Path, optional
            Picture to write, .gif, .webp or .png.
        **options
            See `fretwear.export.animate`: `point`, `scalars`, `sectors`, `frames`, `turn`, ...

        Returns
        -------
        Animation
        """
        return importlib.import_module("fretwear.export").animate(self, file, **options)

    def to_xarray(self) -> xarray.Dataset:
        """Everything with one row per point or per wear step, with coordinates and units.

        Returns
        -------
        xarray.Dataset
            Dimensions point (step in a wear analysis), coefficient, observed, pair, direction,
            state and patch, as the file declares them; names as in the file with `_` for `/`.
            Of the coordinates, omega and frequency are indices:
            ``data.sel(frequency=1022, method="nearest")``.

        Raises
        ------
        ImportError
            xarray is not installed.
        """
        return result_dataset(self)
