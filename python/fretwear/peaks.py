"""The maxima of a response, as a run has found them between its points too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import AbsentError
from .result_file import ResultFile, plain_text

__all__ = ["Peak", "read_peaks"]


@dataclass(frozen=True)
class Peak:
    """A maximum of one observed quantity.

    Attributes
    ----------
    observed : str
        Name of the quantity.
    omega : float
        Angular frequency [rad/s].
    amplitude : float
        Largest magnitude over the period, static part included.
    bandwidth : float
        Width at half of the power of the vibration [rad/s]; NaN where it is not known.
    found_by : str
        'row' (a point of the result stands on it), 'search', 'jump' (the response falls there all
        at once), 'end of the sweep' (it may go on to rise outside) or 'not resolved'.
    coefficients : (2H+1,)
        Fourier coefficients (0, c1, s1, ...) of the quantity there.
    """

    observed: str
    omega: float
    amplitude: float
    bandwidth: float
    found_by: str
    coefficients: NDArray[np.float64]

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return self.omega / (2.0 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio of a mode that has a peak of this width; NaN where it is not known."""
        return 0.5 * self.bandwidth / self.omega


def read_peaks(result: ResultFile) -> tuple[Peak, ...]:
    """Every maximum in a result; raises AbsentError where the run looked for none."""
    if "peak/omega" not in result and not np.any(result["amplitude"]):
        raise AbsentError(f"{result.name}: has no peak: what is observed stays at rest at every "
                          "point; observe another dof (output%observe), or load it more")
    omega = result["peak/omega"]
    names = result["observed/name"]
    with result.open() as file:
        words = [plain_text(word) for word in file["peak/found_by"].attrs["names"]]
    return tuple(
        Peak(str(names[result["peak/observed"][k]]), float(omega[k]),
             float(result["peak/amplitude"][k]), float(result["peak/bandwidth"][k]),
             words[result["peak/found_by"][k]], result["peak/coefficients"][k])
        for k in range(len(omega)))
