"""Bolted beam: two half beams with a lap joint of three bolts, as the Brake-Reuss beam has it.

Units: m, kg, s, N. ``generate()`` returns the reduced model, its ``model()`` runs, and
``python -m fretwear.beam --help`` writes it from a shell.
"""

from .model import FullBeam, ReducedBeam, build_full, generate, limits
from .parameters import BeamParameters, ParameterError

__all__ = ["BeamParameters", "FullBeam", "ParameterError", "ReducedBeam", "build_full", "generate",
           "limits"]
