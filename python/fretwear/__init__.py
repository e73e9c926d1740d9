"""Fretwear: vibration with contact, friction and fretting wear by harmonic balance.

Modules
-------
fretwear.result
    Result files.
fretwear.importer
    Models of other programs.
fretwear.reduction
    Reduction of sparse models on relative displacements.
fretwear.sector
    Generator of the reduced bladed-disk sector with a dovetail root.
fretwear.plots
    Pictures of result files.
fretwear.cli
    The command `fretwear`.
"""

from .errors import (
    ConvergenceError,
    FretwearError,
    InputError,
    OutputError,
    RunInterrupted,
)

__all__ = ["ConvergenceError", "FretwearError", "InputError", "OutputError", "RunInterrupted",
           "__version__"]

__version__: str = "0.1.0"
