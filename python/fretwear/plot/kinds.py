"""The kinds of pictures: what each shows, when a result has it, how it is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from ..errors import NotBuiltError
from ..result import Result
from .backbone import plot_backbone
from .blades import plot_blades, plot_content
from .bounds import plot_bounds
from .campbell import plot_campbell_result
from .convergence import plot_convergence
from .cycle import plot_cycle, plot_harmonics, plot_hysteresis
from .dampers import has_bodies, plot_damper
from .disks import plot_nodal_diameters, plot_safe, plot_wave, rotation_speed
from .flanks import plot_flanks
from .haigh import plot_haigh
from .mission import plot_mission
from .mode import plot_mode
from .population import plot_population
from .resonance import plot_resonance
from .response import plot_response
from .ringdown import plot_ringdown
from .sensitivity import plot_sensitivity
from .wear import plot_wear_bars, plot_wear_evolution, plot_wear_maps

__all__ = ["KINDS", "Choices", "Kind", "fitting"]


@dataclass(frozen=True)
class Choices:
    """What the user has chosen of a result.

    Attributes
    ----------
    point : int or None
        Point or wear step from 0.
    pairs : list of int or None
        Pairs from 0.
    observe : str or None
        Observed quantity.
    linear : str or None
        Result with every pair stuck.
    modal_mass : float or None
        See ``friction_damping``.
    speed : float or None
        Rotation speed [rad/s] of the line in a SAFE diagram.
    """

    point: int | None = None
    pairs: list[int] | None = None
    observe: str | None = None
    linear: str | None = None
    modal_mass: float | None = None
    speed: float | None = None


@dataclass(frozen=True)
class Kind:
    """A kind of picture: what it shows, when a result has it, and how to draw it."""

    title: str
    fits: Callable[[Result], bool]
    draw: Callable[[Result, Choices], Figure]


def _has(*names: str) -> Callable[[Result], bool]:
    return lambda result: all(name in result for name in names)


def _is_mode(result: Result) -> bool:
    return "mode/damping_ratio" in result


def _is_resonance(result: Result) -> bool:
    return "resonance/value" in result


def _has_cycle(result: Result) -> bool:
    """Whether there are pairs that have a period to show."""
    if "contact/force" not in result or not (
            result.converged.any() or "history/force" in result):
        return False
    # The contact of a nonlinear mode, or of other values of a parameter, cannot be asked for again.
    if _is_mode(result) or _is_resonance(result):
        return False
    # A wear analysis has one row of both for each of its steps.
    return "wear/depth" not in result or len(result.depth) == result.n_points


def _has_diameters(result: Result) -> bool:
    return "modes/open" in result and len(result["modes/open"]) > 1


def _has_blades(result: Result) -> bool:
    return "blades/largest" in result and result.n_points > 0 and bool(result.converged.any())


#: Every kind of picture, in the order in which a report shows them.
KINDS: dict[str, Kind] = {
    "response": Kind(
        "Frequency response",
        lambda r: ("omega" in r and r.n_points > 1 and "wear/depth" not in r
                   and not (_is_mode(r) or _is_resonance(r))),
        lambda r, c: plot_response(r, c.observe, linear=c.linear, modal_mass=c.modal_mass)),
    "cycle": Kind(
        "One cycle", lambda r: "coefficients" in r and r.n_points > 0 and (
            "contact/force" not in r or _has_cycle(r)),
        lambda r, c: plot_cycle(r, c.point, c.pairs, c.observe)),
    "hysteresis": Kind("Hysteresis loops", _has_cycle,
                       lambda r, c: plot_hysteresis(r, c.point, c.pairs)),
    "harmonics": Kind("Harmonics", lambda r: "coefficients" in r and r.n_points > 0,
                      lambda r, c: plot_harmonics(r, c.point, c.observe)),
    "bounds": Kind("Range over residual tractions", _has("bounds/lowest"),
                   lambda r, c: plot_bounds(r)),
    "damper": Kind("A body between blades", has_bodies, lambda r, c: plot_damper(r, c.point)),
    "flanks": Kind("Contact on the flanks", _has("contact/position", "contact/fraction"),
                   lambda r, c: plot_flanks(r, c.point)),
    "wear_maps": Kind("Wear on the flanks", _has("contact/position", "wear/depth"),
                      lambda r, c: plot_wear_maps(r, c.point)),
    "wear_bars": Kind("Wear depth of the pairs", _has("wear/depth"),
                      lambda r, c: plot_wear_bars(r, c.point)),
    "wear_evolution": Kind("Wear over the cycles", _has("wear/depth", "wear/cycles"),
                           lambda r, c: plot_wear_evolution(r)),
    "mission": Kind("Wear over the flights of a mission", _has("mission/depth"),
                    lambda r, c: plot_mission(r)),
    "wave": Kind("Wave over the sectors", lambda r: (
        "coefficients" in r and r.n_points > 0 and "engine_order" in r.attributes
        and bool(r.converged.any())), lambda r, c: plot_wave(r, c.point, c.observe)),
    "blades": Kind("All sectors", _has_blades, lambda r, c: plot_blades(r, c.observe)),
    "content": Kind("Waves of sectors that differ", _has_blades,
                    lambda r, c: plot_content(r, c.point, c.observe)),
    "nodal_diameters": Kind("Frequencies over the nodal diameter", _has_diameters,
                            lambda r, c: plot_nodal_diameters(r)),
    "safe": Kind("Engine orders at a speed",
                 lambda r: _has_diameters(r) and rotation_speed(r) > 0.0,
                 lambda r, c: plot_safe(r, c.speed)),
    "campbell": Kind("Campbell diagram", _has("campbell/speed"),
                     lambda r, c: plot_campbell_result(r)),
    "population": Kind("Amplification of many disks", _has("population/amplification"),
                       lambda r, c: plot_population(r, c.observe)),
    "haigh": Kind("Stress amplitude over mean stress", lambda r: (
        "stress/amplitude" in r and r.n_points > 0 and bool(r.converged.any())),
        lambda r, c: plot_haigh(r, c.point)),
    "ringdown": Kind("Free decay", _has("ringdown/observed"), lambda r, c: plot_ringdown(r)),
    "mode": Kind("Nonlinear mode", _is_mode, lambda r, c: plot_mode(r)),
    "backbone": Kind("Backbone of the mode", _is_mode, lambda r, c: plot_backbone(r, c.observe)),
    "resonance": Kind("Resonance over a parameter", _is_resonance, lambda r, c: plot_resonance(r)),
    "sensitivity": Kind(
        "What the parameters do", lambda r: _has("sensitivity/value/first_harmonic")(r) or _has(
            "sensitivity/value/dissipation")(r),
        lambda r, c: plot_sensitivity(r, c.point, c.observe)),
    "convergence": Kind("Convergence", lambda r: "iterations" in r and r.n_points > 0,
                        lambda r, c: plot_convergence(r)),
}


def fitting(result: Result) -> list[str]:
    """Kinds of pictures for which a result has the data."""
    return [name for name, kind in KINDS.items() if _fits(kind, result)]


def _fits(kind: Kind, result: Result) -> bool:
    try:
        return kind.fits(result)
    except NotBuiltError:  # the input of the run is asked for, and nothing can read it
        return False
