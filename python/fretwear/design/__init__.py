"""Optimisation and calibration of the parameters of a case, by exact derivatives."""

from .calibration import Calibration, Fit, calibrate
from .measured import ControlData, Measured, ModeData, Predicted, ResponseData
from .objectives import OBJECTIVES, Evaluation
from .optimum import Optimum, optimise

__all__ = ["OBJECTIVES", "Calibration", "ControlData", "Evaluation", "Fit", "Measured",
           "ModeData", "Optimum", "Predicted", "ResponseData", "calibrate", "optimise"]
