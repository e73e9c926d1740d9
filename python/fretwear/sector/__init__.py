"""Bladed-disk sector with a dovetail root: geometry, mesh, reduction and model file.

Units: mm, tonne, s, N. ``generate()`` returns the reduced model, ``write_model`` stores it, and
``python -m fretwear.sector --help`` does both from a shell.
"""

from .model import FullModel, ReducedModel, build_full, generate, reduce_model
from .model_file import read_parameters, write_model
from .parameters import (
    Discretisation,
    Geometry,
    Material,
    ParameterError,
    Retention,
    SectorParameters,
    patch_grid,
)

__all__ = [
    "Discretisation",
    "FullModel",
    "Geometry",
    "Material",
    "ParameterError",
    "ReducedModel",
    "Retention",
    "SectorParameters",
    "build_full",
    "generate",
    "patch_grid",
    "read_parameters",
    "reduce_model",
    "write_model",
]
