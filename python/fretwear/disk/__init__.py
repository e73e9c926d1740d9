"""Sector of a shrouded bladed disk, for travelling waves: mesh, reduction and model file.

Units: mm, tonne, s, N. ``generate()`` returns the reduced model, ``write_model`` stores it, and
``python -m fretwear.disk --help`` does both from a shell.
"""

from .model import FullDisk, ReducedDisk, build_full, generate, reduce_disk
from .model_file import read_parameters, write_model
from .parameters import DiskParameters

__all__ = ["DiskParameters", "FullDisk", "ReducedDisk", "build_full", "generate",
           "read_parameters", "reduce_disk", "write_model"]
