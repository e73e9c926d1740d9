"""Fretwear: vibration with contact, friction and fretting wear by harmonic balance.

Modules
-------
fretwear.sector
    Generator of the reduced bladed-disk sector with a dovetail root.
fretwear.plots
    Pictures of result files.
"""

__all__ = ["__version__"]

__version__: str = "0.1.0"
