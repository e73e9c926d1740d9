"""Models reduced to an accuracy in place of a number of modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Accuracy", "mode_options", "range_datasets"]


@dataclass(frozen=True)
class Accuracy:
    """In place of a number of modes: what they are to reach.

    Attributes
    ----------
    error : float
        Estimated error of the stiffness of the joint, relative.
    up_to : float
        Highest frequency [Hz].
    """

    error: float
    up_to: float


def mode_options(n_modes: int | Accuracy) -> dict[str, Any]:
    """What `fretwear.reduction.reduce` takes for it."""
    if isinstance(n_modes, Accuracy):
        return {"accuracy": n_modes.error, "up_to": 2.0 * np.pi * n_modes.up_to}
    return {"n_modes": n_modes}


def range_datasets(frequency: float, error: float) -> dict[str, NDArray[Any]]:
    """The part of a model file that says how far its reduction reaches [rad/s]."""
    return {"reduction/frequency": np.array([frequency / (2.0 * np.pi)]),
            "reduction/error": np.array([error])}
