"""Optimisation and calibration of the parameters of a case, by exact derivatives."""

from .objectives import OBJECTIVES, Evaluation
from .optimum import Optimum, optimise

__all__ = ["OBJECTIVES", "Evaluation", "Optimum", "optimise"]
