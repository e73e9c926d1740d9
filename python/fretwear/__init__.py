"""Fretwear: vibration with contact, friction and fretting wear by harmonic balance.

    import fretwear as fw
    result = fw.frf("sector.h5", 1017, 1029, 121, unit="Hz", load={"harmonic_scale": 0.5})

Modules
-------
fretwear.model, fretwear.case, fretwear.settings
    The structure, and what is to be computed.
fretwear.laws
    Contact laws made of parallel pairs.
fretwear.dampers
    Bodies between blades that only rotation presses.
fretwear.halfplane
    Generator of a cylinder on a flat, with the closed forms of its wear.
fretwear.analyses
    Runs of the library in this process.
fretwear.steps
    A case frequency by frequency.
fretwear.populations, fretwear.worst_pattern
    Many disks whose blades differ at random; the pattern that amplifies most.
fretwear.design
    Optimisation and calibration of the parameters of a case.
fretwear.result, fretwear.bifurcation
    Results, and where their stability changes.
fretwear.importer
    Models of other programs.
fretwear.surfaces
    Contact pairs of two surfaces of a mesh.
fretwear.reduction
    Reduction of sparse models on relative displacements.
fretwear.operators
    Operators of the library: harmonics, dynamic stiffness, condensation, contact forces.
fretwear.errors
    Errors.
fretwear.study
    Parameter studies.
fretwear.sector
    Generator of the reduced bladed-disk sector with a dovetail root.
fretwear.beam
    Generator of the Brake-Reuss beam, two half beams with a bolted lap joint.
fretwear.plot
    Pictures of results, as matplotlib figures.
fretwear.compare, fretwear.report, fretwear.export
    Two results beside each other; one HTML page; meshes for ParaView.
fretwear.cli
    The command `fretwear`.
"""

from pkgutil import extend_path

# In a build tree the compiled part lies in a directory of its own.
__path__ = extend_path(__path__, __name__)

__version__: str = "0.1.0"

from .analyses import frf, mode, resonance, run, wear
from .bifurcation import Bifurcation
from .case import Case
from .dampers import Flank, damper
from .design import calibrate, optimise
from .elements import Damper, Polynomial
from .errors import (
    AbsentError,
    ConvergenceError,
    FretwearError,
    InputError,
    OutputError,
    RunInterrupted,
    RunStopped,
)
from .loose_bodies import Bodies
from .mistuning import Mistuning
from .model import ContactPairs, Model, Spring
from .populations import Population, population
from .result import Result
from .sectors import Air, NodalDiameter, Sectors
from .steps import Point, Steps
from .stress import Stress
from .user_law import Law
from .worst_pattern import WorstPattern, worst_pattern

__all__ = ["AbsentError", "Air", "Bifurcation", "Bodies", "Case", "ContactPairs",
           "ConvergenceError", "Damper", "Flank", "FretwearError", "InputError", "Law", "Mistuning",
           "Model", "NodalDiameter", "OutputError", "Point", "Polynomial", "Population", "Result",
           "RunInterrupted", "RunStopped", "Sectors", "Spring", "Steps", "Stress", "WorstPattern",
           "__version__", "calibrate", "damper", "frf", "mode", "optimise", "population",
           "resonance", "run", "wear", "worst_pattern"]


def __getattr__(name: str) -> object:
    """The functions of `fretwear.plot`, so that matplotlib is loaded when it is needed."""
    if name.startswith("plot_"):
        from importlib import import_module

        plot = import_module(".plot", __name__)
        if name in plot.__all__:
            return getattr(plot, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
