"""Pictures of results: each function takes a result and returns a matplotlib figure.

>>> from fretwear.plot import plot_response                                # doctest: +SKIP
>>> plot_response("frf.h5").savefig("frf.png")                             # doctest: +SKIP

`fretwear plot` is in `fretwear.plot.command`.
"""

from .backbone import plot_backbone
from .blades import plot_blades, plot_content
from .bounds import plot_bounds
from .campaigns import plot_campbell, plot_damping, plot_force, read_damping
from .campbell import plot_campbell_result
from .command import add_arguments, main
from .convergence import plot_convergence
from .cycle import plot_cycle, plot_harmonics, plot_hysteresis
from .dampers import plot_damper
from .disks import plot_nodal_diameters, plot_safe, plot_wave
from .flanks import plot_flanks
from .found import plot_calibration, plot_optimum
from .haigh import plot_haigh
from .kinds import KINDS, Choices, Kind, fitting
from .mission import plot_mission
from .mode import plot_mode
from .population import plot_population
from .resonance import plot_resonance
from .response import (
    Response,
    friction_damping,
    half_power_damping,
    plot_response,
    read_response,
)
from .ringdown import plot_ringdown
from .sensitivity import plot_sensitivity
from .table import plot_table
from .together import plot_envelope, plot_responses
from .wear import plot_wear_bars, plot_wear_evolution, plot_wear_maps

__all__ = ["KINDS", "Choices", "Kind", "Response", "add_arguments", "fitting", "friction_damping",
           "half_power_damping", "main", "plot_backbone", "plot_blades", "plot_bounds",
           "plot_calibration", "plot_campbell", "plot_campbell_result", "plot_content",
           "plot_convergence", "plot_cycle", "plot_damper", "plot_damping", "plot_envelope",
           "plot_flanks", "plot_force", "plot_haigh", "plot_harmonics", "plot_hysteresis",
           "plot_mission", "plot_mode", "plot_nodal_diameters", "plot_optimum", "plot_population",
           "plot_resonance", "plot_response", "plot_responses", "plot_ringdown", "plot_safe",
           "plot_sensitivity", "plot_table", "plot_wave", "plot_wear_bars", "plot_wear_evolution",
           "plot_wear_maps", "read_damping", "read_response"]
