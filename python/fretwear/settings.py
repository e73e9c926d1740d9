"""Settings of a case: the groups of the namelist, by the same names.

Each is a dictionary of which every key may be left out; the library knows the defaults
(`Case.namelist()` shows them) and refuses what it does not know. See the user guide for advice.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypedDict

from numpy.typing import ArrayLike

__all__ = ["CaseGroup", "Contact", "Groups", "Harmonics", "Load", "Output", "PseudoTime", "Solver",
           "Spring", "Structure", "Sweep", "Time", "Wear"]


class CaseGroup(TypedDict, total=False):
    """Group &case: title, kind of analysis, OpenMP threads (0: all)."""

    title: str
    analysis: Literal["frf", "point", "wear", "time"]
    threads: int


class Structure(TypedDict, total=False):
    """Group &model: where the matrices come from, and what is added to them."""

    source: Literal["inline", "hdf5", "matrix_market"]
    file: str
    n_dof: int
    mass: ArrayLike
    stiffness: ArrayLike
    damping: ArrayLike
    rayleigh_mass: float  # [1/s]
    rayleigh_stiffness: float  # [s]
    modal_damping: float  # of critical
    rotation_speed: float  # [rad/s]


class Contact(TypedDict, total=False):
    """Group &contact: law and constants of the pairs, one for all or one per pair."""

    n_pairs: int
    law: Literal["dlft", "dlft_velocity", "penalty"]
    side_1: ArrayLike
    side_2: ArrayLike
    mu: ArrayLike
    gap: ArrayLike  # [length]
    worn: str
    worn_step: int
    area: ArrayLike  # [length^2]
    normal_load: ArrayLike  # [force]
    tangential_stiffness: ArrayLike  # [force/length]
    normal_stiffness: ArrayLike  # [force/length]
    penalty_scale: float
    memory: Literal["assembly", "carried"]


class Spring(TypedDict, total=False):
    """Group &spring: nonlinear springs."""

    n_springs: int
    side_1: ArrayLike
    side_2: ArrayLike
    coefficient: ArrayLike  # [force/length^power]
    power: ArrayLike


class Load(TypedDict, total=False):
    """Group &load: loads per dof [force], and factors of those of a model."""

    static: ArrayLike
    cosine: ArrayLike
    sine: ArrayLike
    static_scale: float
    harmonic_scale: float


class Harmonics(TypedDict, total=False):
    """Group &harmonics: the approximation."""

    method: Literal["hbm", "tcm", "tcm_least_squares", "hdhb"]
    n_harmonics: int
    n_time: int
    n_collocation: int
    filter_harmonics: int
    sampling: Literal["uniform", "events", "auto"]
    parity: Literal["auto", "all", "odd"]
    adaptive: bool
    adaptive_tolerance: float
    accuracy: float


class Sweep(TypedDict, total=False):
    """Group &sweep: frequencies [unit]."""

    start: float
    end: float
    n_points: int
    unit: Literal["rad/s", "Hz"]
    continuation: Literal["natural", "arclength"]
    max_points: int
    stability: bool


class Solver(TypedDict, total=False):
    """Group &solver: the nonlinear solver."""

    kind: Literal["newton", "powell", "kinsol", "pseudo_time"]
    linear: Literal["auto", "lu", "krylov"]
    jacobian: Literal["analytic", "difference"]
    tolerance: float
    max_iterations: int
    fallback: bool
    skips: bool


class PseudoTime(TypedDict, total=False):
    """Group &pseudo_time: pseudo-time integration."""

    flow: Literal["rotated", "identity", "preconditioned"]
    scheme: Literal["implicit_euler", "bdf", "rosenbrock", "runge_kutta"]
    step: float
    cfl: float
    max_steps: int


class Wear(TypedDict, total=False):
    """Group &wear: fretting wear at the frequency of `sweep["start"]`."""

    scheme: Literal["explicit", "implicit", "pseudo_time"]
    law: Literal["archard", "energy"]
    order: int
    coefficient: float  # [length^2/force]
    n_cycles: float
    max_depth_step: float  # [length]
    error_tolerance: float
    steady_tolerance: float
    max_steps: int
    check_steps: bool
    follow_resonance: bool


class Time(TypedDict, total=False):
    """Group &time: integration in time."""

    n_periods: int
    steps_per_period: int


class Output(TypedDict, total=False):
    """Group &output: the result file and what is observed."""

    file: str
    observe: str | int | Sequence[str | int]
    histories: bool
    contact: bool


class Groups(TypedDict, total=False):
    """All groups; `model` is the one that `structure` stands for where a model is an argument."""

    case: CaseGroup
    structure: Structure
    contact: Contact
    spring: Spring
    load: Load
    harmonics: Harmonics
    sweep: Sweep
    solver: Solver
    pseudo_time: PseudoTime
    wear: Wear
    time: Time
    output: Output
