"""Many disks whose blades differ at random: the largest amplitude of each."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._identity import digest, identity
from ._native import namelist_values
from ._pool import Pool, core_count
from .analyses import run
from .case import Case
from .errors import InputError, OutputError, RunStopped
from .result import Result

__all__ = ["Population", "population"]

#: Results of a disk, and what stands for them until it is solved.
_OF_DISKS: dict[str, Any] = {"amplitude": np.nan, "sector": -1, "omega": np.nan,
                             "amplification": np.nan, "converged": 0, "solved": 0}
#: Disks of one run: the tuned disk is solved in each. With contact that differs a run is one disk.
_AT_ONCE = 25
#: Values of pairs that may differ.
_OF_PAIRS = ("mu", "gap", "area", "normal_load", "tangential_stiffness", "normal_stiffness")
_LEVELS = (50.0, 95.0, 99.0)

#: Called with the disks that are done, and all of them.
Told = Callable[[int, int], object]


@dataclass(frozen=True)
class Population:
    """The largest amplitudes of many disks over their blades and the sweep.

    Attributes
    ----------
    patterns : (n_patterns, n_sectors) or (n_patterns, n_sectors, n_rows)
        By which part the blade frequencies are above the tuned ones.
    amplitude, omega, amplification : (n_patterns, n_observed)
        The largest amplitude, its frequency [rad/s], its ratio to that of the tuned disk.
    sector : (n_patterns, n_observed)
        The blade, from 0.
    tuned : (n_observed,)
        Of the tuned disk.
    converged, solved : (n_patterns,)
        Points that were solved, of how many.
    names : tuple of str
        Observed quantities of a sector.
    seed : int
        Of the patterns.
    """

    patterns: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    omega: NDArray[np.float64]
    amplification: NDArray[np.float64]
    sector: NDArray[np.int64]
    tuned: NDArray[np.float64]
    converged: NDArray[np.int64]
    solved: NDArray[np.int64]
    names: tuple[str, ...]
    seed: int

    def quantiles(self, levels: Sequence[float] = _LEVELS, *, confidence: float = 95.0,
                  n_samples: int = 2000) -> NDArray[np.float64]:
        """Quantiles of the amplification with the interval that the number of disks leaves.

        Parameters
        ----------
        levels : sequence of float
            [%]
        confidence : float
            Share of the bootstrap samples inside of the interval [%].
        n_samples : int
            Bootstrap samples, drawn by `seed`.

        Returns
        -------
        (n_observed, n_levels, 3) array
            The quantile, the lower and the upper end of its interval.
        """
        found = np.full((self.amplification.shape[1], len(levels), 3), np.nan)
        rng = np.random.default_rng(self.seed)
        ends = (50.0 - confidence / 2.0, 50.0 + confidence / 2.0)
        for i, values in enumerate(self.amplification.T):
            known = values[np.isfinite(values)]
            if known.size == 0:
                continue
            found[i, :, 0] = np.percentile(known, levels)
            samples = np.array([
                np.percentile(known[rng.integers(known.size, size=known.size)], levels)
                for _ in range(n_samples)])
            found[i, :, 1:] = np.percentile(samples, ends, axis=0).T
        return found


def population(case: Case | str | Path, patterns: int | ArrayLike = 100, *, seed: int = 0,
               deviation: float = 0.02, contact: Mapping[str, float] | None = None,
               workers: int = 0, file: str | Path | None = None,
               stop: threading.Event | None = None, progress: Told | None = None) -> Population:
    """Solve disks whose blade frequencies are drawn at random.

    Parameters
    ----------
    case : Case, str or Path
        Of any analysis, with ``cyclic%mistuned`` and rows of blade modes; its &sweep is taken.
    patterns : int or array_like
        Disks, or their patterns (n_patterns, n_sectors) or (n_patterns, n_sectors, n_rows).
    seed : int
        Patterns are `deviation` times ``numpy.random.default_rng(seed).standard_normal`` of the
        shape (n_patterns, n_sectors).
    deviation : float
        Standard deviation of the blade frequencies, in parts of the tuned ones.
    contact : mapping, optional
        Standard deviations of values of the pairs in parts of these, such as ``{"mu": 0.1}``,
        drawn behind the patterns, pair by pair of all sectors.
    workers : int
        Disks at once (0: one for each core). The numbers do not depend on it.
    file : str or Path, optional
        Where the disks are kept as they are solved. Of one that holds disks of the same input the
        others are solved: a population that was ended goes on.
    stop : threading.Event, optional
        Ends the work where it is set.
    progress : callable, optional
        Called with the disks that are done and all of them.

    Returns
    -------
    Population

    Raises
    ------
    InputError
        What the library does not accept.
    RunStopped
        The work was ended; `file` has the disks that were done.
    """
    base = case if isinstance(case, Case) else Case.from_file(case)
    base = base.replace(case={"analysis": "population"})
    drawn, factors = _draw(base, patterns, seed, deviation, contact or {})
    key = _key(base, drawn, factors)
    kept = _Kept(None if file is None else Path(file), key, drawn, seed)
    left = np.flatnonzero(~kept.done)
    size = 1 if factors else _AT_ONCE
    items = [left[k:k + size] for k in range(0, len(left), size)]
    ended = stop if stop is not None else threading.Event()

    def solve(numbers: NDArray[np.int64], stopped: threading.Event) -> tuple[
            NDArray[np.int64], Result | None]:
        # Asked here too: the pool looks at it only now and then.
        if ended.is_set():
            return numbers, None
        groups: Any = {"population": {"patterns": drawn[numbers].ravel().tolist(),
                                      "n_patterns": len(numbers)},
                       "case": {"threads": 1}}
        if factors:
            groups["contact"] = {name: values[numbers[0]].tolist()
                                 for name, values in factors.items()}
        try:
            return numbers, run(base.replace(**groups), stop=stopped, check=False, in_memory=True)
        except RunStopped:
            return numbers, None

    pool = Pool(workers or core_count())
    for numbers, result in pool.run(solve, items, tick=ended.is_set):
        if result is None:
            continue
        kept.take(numbers, result, bool(factors))
        if progress is not None:
            progress(int(kept.done.sum()), len(drawn))
    if not kept.done.all():
        raise RunStopped(f"{int(kept.done.sum())} of {len(drawn)} disks were solved", None)
    return kept.population()


def _draw(case: Case, patterns: int | ArrayLike, seed: int, deviation: float,
          contact: Mapping[str, float]) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Patterns, and the values of all pairs of each disk by name."""
    rng = np.random.default_rng(seed)
    if np.ndim(patterns) == 0:
        n = int(patterns)  # type: ignore[arg-type]
        if n < 1:
            raise InputError(f"patterns: is {n}, must be a number of disks, or their patterns")
        if not np.isfinite(deviation) or deviation < 0.0:
            raise InputError(f"deviation: is {deviation:g}, must be a standard deviation, such as "
                             "0.02")
        drawn = deviation * rng.standard_normal((n, _n_sectors(case)))
        if (drawn <= -1.0).any():
            raise InputError(f"deviation: is {deviation:g}, which draws blades without a frequency"
                             ": it is a standard deviation in parts of the tuned frequencies, such "
                             "as 0.02 (2 %)")
    else:
        drawn = np.asarray(patterns, dtype=np.float64)
        if drawn.ndim not in (2, 3) or not np.isfinite(drawn).all() or len(drawn) == 0:
            raise InputError("patterns: must be finite, of shape (n_patterns, n_sectors) or "
                             "(n_patterns, n_sectors, n_rows)")
    factors: dict[str, Any] = {}
    for name, spread in contact.items():
        if name not in _OF_PAIRS:
            raise InputError(f"contact: has {name}, must be among {', '.join(_OF_PAIRS)}")
        values = np.tile(_of_pairs(case, name), 1)
        factors[name] = values * (1.0 + spread * rng.standard_normal((len(drawn), len(values))))
        if name != "gap" and (factors[name] < 0.0).any():
            raise InputError(f"contact: {name} = {spread:g} draws values below 0: must be smaller")
    return drawn, factors


def _n_sectors(case: Case) -> int:
    model = case.model
    if model is not None and model.sectors is not None:
        return model.sectors.n_sectors
    values = namelist_values(_plain(case).namelist())
    for name in ("cyclic%n_sectors",):
        if name in values and int(values[name][0]) > 1:
            return int(values[name][0])
    path = _model_file(case, values)
    if path is not None:
        with h5py.File(path) as file:
            if "cyclic" in file and "n_sectors" in file["cyclic"].attrs:
                return int(file["cyclic"].attrs["n_sectors"])
    raise InputError("patterns: the case has no sectors, must have &cyclic n_sectors or a model "
                     "of sectors")


def _plain(case: Case) -> Case:
    """The same as a list of natural frequencies, which needs no patterns."""
    return case.replace(case={"analysis": "modes"})


def _model_file(case: Case, values: dict[str, list[str]]) -> Path | None:
    words = values.get("model%file")
    return None if not words else case.path.parent / words[0]


def _of_pairs(case: Case, name: str) -> NDArray[np.float64]:
    """Values of the pairs of all sectors."""
    values = namelist_values(_plain(case).namelist())
    n_sectors, n_pairs, found = _n_sectors(case), None, None
    path = _model_file(case, values)
    if case.model is not None and case.model.contact is not None:
        n_pairs = len(np.atleast_2d(case.model.contact.side_1))
        found = getattr(case.model.contact, name)
    elif path is not None:
        with h5py.File(path) as file:
            if "contact/side_1" in file:
                n_pairs = len(file["contact/side_1"])
            if f"contact/{name}" in file:
                found = file[f"contact/{name}"][()]
    if "contact%n_pairs" in values and int(values["contact%n_pairs"][0]) > 0:
        n_pairs = int(values["contact%n_pairs"][0])
    if f"contact%{name}" in values:
        found = np.array([float(word) for word in values[f"contact%{name}"]])
    if found is None or not n_pairs:
        raise InputError(f"contact: {name} is not given for any pair, must have values to differ "
                         "from")
    found = np.atleast_1d(np.asarray(found, dtype=np.float64))
    n_pairs = n_pairs if n_pairs % n_sectors or len(found) != n_pairs else n_pairs // n_sectors
    if len(found) == 1:
        found = np.full(n_pairs, found[0])
    if len(found) == n_pairs:
        found = np.tile(found, n_sectors)
    if not found.any():
        raise InputError(f"contact: {name} of all pairs is 0, and parts of it are 0: must be "
                         "another value")
    return found


def _key(case: Case, drawn: NDArray[np.float64], factors: Mapping[str, Any]) -> str:
    """What the numbers depend on."""
    first: Any = {"patterns": drawn[:1].ravel().tolist(), "n_patterns": 1}
    whole = case.replace(population=first)
    with whole.open() as session:
        session.check()
        name = identity(session, case.path)
    parts = [np.ascontiguousarray(values).tobytes() for _, values in sorted(factors.items())]
    model = "" if case.model is None else case.model.identity()
    return digest([name, model, drawn.tobytes(), *parts])


def _names(result: Result, values: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    """Observed quantities of a sector, of those of all sectors."""
    return tuple(name.rpartition("@")[0]
                 for name in result.observed[:values["amplitude"].shape[1]])


class _Kept:
    """Disks that are solved, in a file where one is named."""

    def __init__(self, path: Path | None, key: str, drawn: NDArray[np.float64], seed: int) -> None:
        self.path, self.key, self.drawn, self.seed = path, key, drawn, seed
        self.done = np.zeros(len(drawn), dtype=bool)
        self.values: dict[str, NDArray[Any]] = {}
        self.tuned: NDArray[np.float64] | None = None
        self.names: tuple[str, ...] = ()
        self._first: Result | None = None
        if path is not None and path.exists():
            self._read(path)

    def _read(self, path: Path) -> None:
        try:
            with h5py.File(path) as file:
                group = file.get("population")
                if group is None or group.attrs.get("key") != self.key:
                    raise InputError(f"{path}: is not of this input: name another file, or remove "
                                     "it")
                self.done = group["done"][()].astype(bool)
                self.values = {name: group[name][()] for name in _OF_DISKS}
                self.tuned = group["tuned"][()]
        except OSError as error:
            raise OutputError(f"{path}: cannot be read: {error}") from None
        self._first = Result(path)
        self.names = _names(self._first, self.values)

    def take(self, numbers: NDArray[np.int64], result: Result, has_own_tuned: bool) -> None:
        """Disks of a run."""
        found = {name: result[f"population/{name}"] for name in _OF_DISKS}
        if not self.values:
            self._first = result
            self.names = _names(result, found)
            for name, none in _OF_DISKS.items():
                shape = (len(self.drawn), *found[name].shape[1:])
                self.values[name] = np.full(shape, none, dtype=found[name].dtype)
        for name, values in found.items():
            self.values[name][numbers] = values
        # Of pairs that differ each disk has a mean of its own, hence a tuned disk of its own.
        tuned = result["population/tuned"]
        if self.tuned is None:
            self.tuned = np.full_like(tuned, np.nan) if has_own_tuned else tuned
        self.done[numbers] = True
        if self.path is not None:
            self._write(self.path)

    def _write(self, path: Path) -> None:
        """All at once: a file is whole whenever the work ends."""
        assert self._first is not None
        partial = path.with_name(path.name + ".part")
        self._first.save(partial)
        try:
            with h5py.File(partial, "r+") as file:
                group = file["population"]
                attributes = {name: dict(group[name].attrs) for name in _OF_DISKS}
                for name, values in (*self.values.items(), ("done", self.done.astype(np.int8)),
                                     ("patterns", self.drawn), ("tuned", self.tuned)):
                    if name in group:
                        del group[name]
                    group[name] = values
                    for key, value in attributes.get(name, {}).items():
                        if key not in ("DIMENSION_LIST", "REFERENCE_LIST"):
                            group[name].attrs[key] = value
                group.attrs["key"], group.attrs["seed"] = self.key, self.seed
            partial.replace(path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error}") from None

    def population(self) -> Population:
        assert self.tuned is not None
        return Population(patterns=self.drawn, tuned=self.tuned, names=self.names, seed=self.seed,
                          **self.values)
