"""A case frequency by frequency: what a host program drives itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._progress import CONTROL
from .case import Case
from .errors import AbsentError, InputError

__all__ = ["Point", "Steps"]

Floats = NDArray[np.float64]


class Point(Mapping[str, Any]):
    """One solution point: arrays by the names of their datasets in a result file.

    The arrays are rows of those datasets, such as ``point["contact/force"]`` (2H+1, n_pairs, 3).

    Parameters
    ----------
    values : mapping of str to array
        What the point holds.
    """

    def __init__(self, values: Mapping[str, Floats]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> Floats:
        if name not in self._values:
            raise AbsentError(f"the point holds no '{name}': histories need output%histories = "
                              ".true., contact values contact pairs and output%contact = .true.; "
                              "there are " + ", ".join(self._values))
        return self._values[name]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        words = "converged" if self.converged else "not converged"
        return f"<Point: {self.frequency:.6g} Hz, {words}>"

    @property
    def omega(self) -> float:
        """Angular frequency [rad/s]."""
        return float(self["omega"])

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return self.omega / (2.0 * np.pi)

    @property
    def converged(self) -> bool:
        """Whether the point converged."""
        return bool(self["converged"])

    @property
    def amplitude(self) -> Floats:
        """Largest magnitude over the period (n_observed)."""
        return self["amplitude"]

    @property
    def coefficients(self) -> Floats:
        """Fourier coefficients (2H+1, n_observed)."""
        return self["coefficients"]


class Steps:
    """A case that is solved at one frequency after the other, each from the solutions before it.

    To be used in a `with` block. For natural sweeps of harmonic balance with a given number of
    harmonics; the frequencies lie between those of `sweep`. Those of the sweep, in their order,
    give the numbers of the whole run to the bit.

    Parameters
    ----------
    case : Case
        What is to be solved; no file is written.

    Raises
    ------
    InputError
        The library does not accept the case, or it does not go step by step.

    Examples
    --------
    >>> with Steps(case) as steps:                                        # doctest: +SKIP
    ...     for omega in steps.frequencies:
    ...         print(steps.solve(omega).amplitude)
    """

    def __init__(self, case: Case) -> None:
        if not isinstance(case, Case):
            raise InputError(f"case: is a {type(case).__name__}, must be a Case")
        self._session = case.open()
        try:
            self._session.start()
            lines = [line.split() for line in self._session.text("quantities").splitlines()]
            self._shapes = {name: tuple(int(size) for size in sizes) for name, *sizes in lines}
        except BaseException:
            self._session.close()
            raise

    def __enter__(self) -> Steps:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free what the library holds."""
        self._session.close()

    @property
    def frequencies(self) -> Floats:
        """Frequencies of the sweep [rad/s]."""
        return self._session.frequencies()

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of the observed quantities (n_observed)."""
        return tuple(self._session.text("observed").splitlines())

    def solve(self, omega: float) -> Point:
        """Solve at a frequency [rad/s]; the interpreter lock is released meanwhile.

        Returns
        -------
        Point
            Converged or not.
        """
        self.advance(omega)
        values = {}
        for name, shape in self._shapes.items():
            try:
                flat = self._session.point(name)
            except InputError:  # nothing of it at this point
                continue
            values[name] = flat.reshape(shape)
        return Point(values)

    def advance(self, omega: float) -> bool:
        """Solve at a frequency [rad/s] as `solve`, and copy nothing but whether it converged."""
        self._session.solve(float(omega), np.zeros(CONTROL, dtype=np.int64))
        return bool(self._session.point("converged")[0])

    def numbers(self, name: str) -> Floats:
        """Numbers of the last point by the name of their dataset in a result file, flattened.

        Also of those whose shape the case alone does not tell, such as
        "sensitivity/largest/contact_mu".
        """
        return self._session.point(name)
