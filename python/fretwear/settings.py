"""Settings of a case: the groups of the namelist, by the same names.

Each is a dictionary of which every key may be left out; the library knows the defaults
(`Case.namelist()` shows them) and refuses what it does not know. See the user guide for advice.
Written by tools/write_keys.py from the declarations in the library.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypedDict

from numpy.typing import ArrayLike

__all__ = ["UNITS", "Base", "Body", "Bounds", "Campbell", "CaseGroup", "Contact", "Control",
           "Cyclic", "Damper", "Groups", "Harmonics", "Load", "Mission", "Mistuning", "Mode",
           "Output", "Polynomial", "Population", "PseudoTime", "Resonance", "Ringdown",
           "Sensitivity", "Solver", "Spring", "Stress", "Structure", "Sweep", "Time", "User",
           "Wear"]

#: Units of the keys that have one: length L, mass M, time s and force F of the model,
#: or `unit` where another key says it.
UNITS: dict[str, str] = {
    "case%max_seconds": "s",
    "model%mass": "M",
    "model%stiffness": "F/L",
    "model%damping": "F s/L",
    "model%structural_damping": "F/L",
    "model%circulatory": "F s/L",
    "model%stiffness_unsymmetric": "F/L",
    "model%damping_unsymmetric": "F s/L",
    "model%rayleigh_mass": "1/s",
    "model%rayleigh_stiffness": "s",
    "model%modal_damping_up_to": "Hz",
    "model%rotation_speed": "rad/s",
    "body%mass": "M",
    "mistuning%rows": "M^0.5",
    "mistuning%row_omega": "rad/s",
    "mistuning%blade_stiffness": "F/L",
    "mistuning%blade_mass": "M",
    "contact%overclosure": "L",
    "contact%force": "F",
    "contact%gap": "L",
    "contact%area": "L^2",
    "contact%normal_load": "F",
    "contact%gap_rotation": "L s^2",
    "contact%normal_load_rotation": "F s^2",
    "contact%speed_1": "L/s",
    "contact%speed_2": "L/s",
    "contact%tangential_stiffness": "F/L",
    "contact%normal_stiffness": "F/L",
    "contact%normal_coefficient": "F/L^e",
    "contact%reference_force": "F",
    "contact%decay_length": "L",
    "contact%slip_speed": "L/s",
    "contact%weakening_speed": "L/s",
    "contact%mu_viscous": "s/L",
    "contact%slider_1": "L",
    "contact%slider_2": "L",
    "contact%gap_amplitude": "L",
    "contact%gap_phase": "degrees",
    "spring%coefficient": "F/L^power",
    "load%static": "F",
    "load%cosine": "F",
    "load%sine": "F",
    "load%term_amplitude": "F",
    "load%term_phase": "degrees",
    "load%table_frequency": "rad/s",
    "base%amplitude": "L",
    "base%phase": "degrees",
    "sweep%start": "unit",
    "sweep%end": "unit",
    "sweep%frequency": "unit",
    "solver%max_seconds": "s",
    "wear%coefficient": "L^2/F",
    "wear%max_depth_step": "L",
    "wear%mu_scale": "L or F L",
    "mode%near": "unit",
    "mode%amplitudes": "L",
    "mode%start": "L",
    "mode%end": "L",
    "campbell%start": "rad/s",
    "campbell%end": "rad/s",
    "ringdown%amplitude": "L",
    "stress%endurance": "F/L^2",
    "stress%ultimate": "F/L^2",
    "control%amplitude": "L",
}


class CaseGroup(TypedDict, total=False):
    """Group &case: title, kind of analysis, threads."""

    #: stands in the result file (default: title of the model file, or name of the namelist)
    title: str
    #: sweep, one frequency, wear, integration in time, linear modes, nonlinear mode, resonance,
    #: Campbell diagram, mistuned disks, range, free decay (default: 'frf')
    analysis: Literal["frf", "point", "wear", "time", "modes", "mode", "resonance", "campbell",
                      "population", "bounds", "ringdown"]
    #: OpenMP threads; 0: as OpenMP gives (default: 0)
    threads: int
    #: [s] of the run, which ends with the points done; 0: no limit (default: 0)
    max_seconds: float


class Sensitivity(TypedDict, total=False):
    """Group &sensitivity: derivatives of the response by parameters of the case."""

    #: what the response is differentiated by; only: analysis = 'frf', 'point', 'resonance', 'mode'
    #: (default: none: no derivatives)
    parameters: str | int | Sequence[str | int]
    #: first_harmonic, largest, dissipation, wear_volume; only: parameters (default: all that the
    #: case has)
    quantities: str | int | Sequence[str | int]
    #: standard deviation of each parameter over its value; only: parameters (default: none)
    deviation: ArrayLike


_Resonance = TypedDict("_Resonance", {
    #: values, or factors of those of the case (all pairs or springs together) (default: 'value')
    "as": Literal["value", "factor"],
}, total=False)


class Resonance(_Resonance, total=False):
    """Group &resonance: a resonance over a parameter of the case."""

    #: what changes from point to point; only: analysis = 'resonance' (required, else
    #: 'load%harmonic_scale')
    parameter: Literal["load%harmonic_scale", "load%static_scale", "contact%mu",
                       "contact%normal_load", "contact%gap", "contact%tangential_stiffness",
                       "contact%normal_stiffness", "spring%coefficient", "model%modal_damping",
                       "model%rotation_speed", "model%rayleigh_mass", "model%rayleigh_stiffness",
                       "contact%normal_coefficient", "contact%reference_force",
                       "polynomial%coefficient", "damper%coefficient", "model%loss_factor",
                       "contact%slip_speed", "contact%mu_dynamic", "mistuning%frequency",
                       "mistuning%damping_ratio", "mistuning%stiffness", "mistuning%mass",
                       "mistuning%scale", "body%mass", "contact%residual", "contact%slider_1",
                       "contact%slider_2"]
    #: first value, or factor; only: analysis = 'resonance' (required, else 0)
    start: float
    #: last value, or factor; only: analysis = 'resonance' (required, else 0)
    end: float
    #: values; of a branch: its longest step (default: 20)
    n_points: int
    #: even steps, or in the logarithm (default: 'linear')
    spacing: Literal["linear", "log"]
    #: the response is largest, or the load does no reactive work (default: 'amplitude')
    condition: Literal["amplitude", "phase"]
    #: of the first observed quantity, what is largest (default: 'first_harmonic')
    quantity: Literal["first_harmonic", "largest"]
    #: given values, or a branch through folds (condition = 'phase') (default: 'natural')
    continuation: Literal["natural", "arclength"]
    #: of a branch; only: continuation = 'arclength' (default: 1000)
    max_points: int


class Structure(TypedDict, total=False):
    """Group &model: mass, stiffness and damping, inline or from a file."""

    #: where the matrices are; 'memory': in the calling program (default: 'inline')
    source: Literal["inline", "hdf5", "matrix_market"]
    #: model file, relative to the namelist (required unless inline)
    file: str
    #: length, mass, time, force, as 'mm-tonne-s-N': of values with units, and results (default: of
    #: the file)
    unit_system: str
    #: order of the matrices (required inline)
    n_dof: int
    #: [M] symmetric, no negative diagonal; may be singular (required inline)
    mass: ArrayLike
    #: [F/L] symmetric; may be singular where contact holds (required inline)
    stiffness: ArrayLike
    #: [F s/L] symmetric (default: 0)
    damping: ArrayLike
    #: [F/L] hysteretic, symmetric: i times it in harmonics above 0 (default: 0)
    structural_damping: ArrayLike
    #: [F s/L] stiffness for each rad/s of rotation_speed: (i, j) is the force on dof i by dof j
    #: (default: 0)
    circulatory: ArrayLike
    #: [F/L] added to the stiffness, as of bearings (default: 0)
    stiffness_unsymmetric: ArrayLike
    #: [F s/L] added to the damping (default: 0)
    damping_unsymmetric: ArrayLike
    #: displacements that combine dofs, named n_dof + 1, .. in sides, term_dof, observe (default: of
    #: the file, else 0)
    n_rows: int
    #: weights of the dofs in each, row after row (default: of the file, else required with n_rows)
    row: ArrayLike
    #: [1/s] adds this times M to the damping (default: 0)
    rayleigh_mass: float
    #: [s] adds this times K, with rotation, to the damping (default: 0)
    rayleigh_stiffness: float
    #: fraction of critical damping of all modes with open contact (default: 0)
    modal_damping: float
    #: [Hz] of modes up to this frequency alone, which is faster; 0: of all; only: modal_damping
    #: (default: 0)
    modal_damping_up_to: float
    #: [rad/s] its square times stiffness_rotation and load/static_rotation of the file, itself
    #: times coriolis and circulatory (default: 0)
    rotation_speed: float
    #: i times this part of the stiffness, with rotation, in harmonics above 0 (default: 0)
    loss_factor: float


class Body(TypedDict, total=False):
    """Group &body: bodies of the model that no spring holds."""

    #: [M] of each body (default: of the file)
    mass: ArrayLike


class Cyclic(TypedDict, total=False):
    """Group &cyclic: sectors around an axis and the wave that runs around it."""

    #: equal sectors, of which the model is one (default: of the file, else not cyclic)
    n_sectors: int
    #: each sector is this part of n_sectors periods behind the one before; negative: ahead; only:
    #: cyclic, all but analysis = 'modes' (required with sectors)
    engine_order: int
    #: solve all sectors; &contact takes n_pairs values, or n_sectors times as many (default:
    #: .false.)
    mistuned: bool
    #: frequencies of each nodal diameter; only: analysis = 'modes' (default: 10)
    n_modes: int
    #: dofs of an interface; 0: contact alone joins the sectors (default: of the file, else 0)
    n_interface: int
    #: dofs of the left interface (default: of the file)
    left: ArrayLike
    #: of the right one, which moves as the left one of the next sector; negative: turned (default:
    #: of the file)
    right: ArrayLike


class Population(TypedDict, total=False):
    """Group &population: the largest amplitude of disks whose blade frequencies differ."""

    #: disks, the first patterns; 0: all (default: 0)
    n_patterns: int
    #: look for maxima between the rows (default: .true.)
    peaks: bool
    #: of the first harmonic, or the largest deflection (default: 'first_harmonic')
    quantity: Literal["first_harmonic", "largest"]
    #: pattern after pattern, each as mistuning%frequency; only: analysis = 'population' (default:
    #: /mistuning/patterns of the file)
    patterns: ArrayLike


class Mistuning(TypedDict, total=False):
    """Group &mistuning: how sectors differ from the tuned one."""

    #: blade modes whose frequencies differ (default: of the file, else 0)
    n_rows: int
    #: [M^0.5] one after another: W of the guide (default: of the file, else none)
    rows: ArrayLike
    #: [rad/s] their frequencies, blade alone (default: of the file, else none)
    row_omega: ArrayLike
    #: part by which frequencies of each blade are above the tuned ones: n_sectors values, or all
    #: rows of each sector; only: cyclic%mistuned = .true. (default: of the file, else none)
    frequency: ArrayLike
    #: what the damping ratios are above the tuned ones, likewise; only: cyclic%mistuned = .true.
    #: (default: of the file, else none)
    damping_ratio: ArrayLike
    #: part by which the stiffness of each blade is above the tuned one: n_sectors values; only:
    #: cyclic%mistuned = .true. (default: of the file, else none)
    stiffness: ArrayLike
    #: the same of its mass; only: cyclic%mistuned = .true. (default: of the file, else none)
    mass: ArrayLike
    #: [F/L] of the blade alone, symmetric (default: of the file, else none)
    blade_stiffness: ArrayLike
    #: [M] of the blade alone, symmetric (default: of the file, else none)
    blade_mass: ArrayLike
    #: multiplies all deviations; only: cyclic%mistuned = .true. (default: 1)
    scale: float


class Contact(TypedDict, total=False):
    """Group &contact: contact pairs, friction, gap, contact law."""

    #: 0 switches the contact of a file off (default: of the file, else 0)
    n_pairs: int
    #: rigid, rigid at velocity level, elastic, rigid of high order (friction on mass), smooth in
    #: the velocity, joints of Iwan, of Bouc-Wen (default: 'rigid' where it goes, else 'dlft')
    law: Literal["dlft", "dlft_velocity", "penalty", "rigid", "regularised", "iwan",
                 "bouc_wen"] | Sequence[str]
    #: a spring, normal_coefficient d**normal_exponent, reference_force exp(d/decay_length), a
    #: table; only: law = 'penalty', 'regularised' (default: 'unilateral')
    normal_law: Literal["unilateral", "power", "exponential", "table"] | Sequence[str]
    #: points of the table; only: normal_law = 'table' (default: of the file, else 0)
    n_table: int
    #: [L] of the points, ascending; only: normal_law = 'table' (default: of the file, else
    #: required)
    overclosure: ArrayLike
    #: [F] of the points, from 0 up; linear between and beyond; only: normal_law = 'table' (default:
    #: of the file, else required)
    force: ArrayLike
    #: constants of the normal law are pressures, times area; only: normal_law other than
    #: 'unilateral' (default: .false.)
    normal_per_area: bool
    #: dofs of t1, t2, n on one side; 0: none, negative: turned (default: of the file, else
    #: required)
    side_1: ArrayLike
    #: of the other side, 0: ground; the normal points from side 2 to side 1 (default: of the file,
    #: else 0)
    side_2: ArrayLike
    #: of side 2: 1 is the next, -1 the one before; only: &cyclic (default: of the file, else 0)
    sector_2: ArrayLike
    #: friction coefficient (default: of the file, else required with tangential dofs)
    mu: ArrayLike
    #: [L] initial; negative: interference (default: of the file, else 0)
    gap: ArrayLike
    #: [L^2] of a pair; only: analysis = 'wear', normal_per_area (default: of the file, else
    #: required for wear, per area)
    area: ArrayLike
    #: [F] constant, compressive; only: pairs without a normal dof (default: of the file, else
    #: required with friction)
    normal_load: ArrayLike
    #: [L s^2] added to gap for each (rad/s)^2 of the speed; only: rotation_speed, speed_order,
    #: campbell (default: of the file, else none)
    gap_rotation: ArrayLike
    #: [F s^2] the same of normal_load; only: rotation_speed, speed_order, campbell (default: of the
    #: file, else none)
    normal_load_rotation: ArrayLike
    #: [L/s] velocity of side 2 along t1: a belt, disk, casing; only: law = 'dlft', 'dlft_velocity',
    #: 'penalty', 'rigid', 'regularised' (default: of the file, else 0)
    speed_1: ArrayLike
    #: [L/s] the same along t2; only: law = 'dlft', 'dlft_velocity', 'penalty', 'rigid',
    #: 'regularised' (default: of the file, else 0)
    speed_2: ArrayLike
    #: [F/L] 0 beside a parallel pair that has one; only: law = 'penalty', 'iwan', 'bouc_wen'
    #: (default: of the file, else required with tangential dofs)
    tangential_stiffness: ArrayLike
    #: [F/L] 0 without a normal dof; only: law = 'penalty', 'regularised' (default: of the file,
    #: else required with normal dofs)
    normal_stiffness: ArrayLike
    #: [F/L^e] c of the pressure c d**e, d the overclosure; 0 for pairs of other laws; only: law =
    #: 'penalty', 'regularised' (default: of the file, else required with 'power')
    normal_coefficient: ArrayLike
    #: e of it; 1.5: Hertz; only: law = 'penalty', 'regularised' (default: of the file, else 1.5)
    normal_exponent: ArrayLike
    #: [F] p_0 of the pressure p_0 exp(d/h); 0 for pairs of other laws; only: law = 'penalty',
    #: 'regularised' (default: of the file, else required with 'exponential')
    reference_force: ArrayLike
    #: [L] h of it; 0 for pairs of other laws; only: law = 'penalty', 'regularised' (default: of the
    #: file, else required with 'exponential')
    decay_length: ArrayLike
    #: [L/s] sliding velocity at which tanh(1) = 76 % of the friction acts; only: law =
    #: 'regularised' (default: of the file, else required with tangential dofs)
    slip_speed: ArrayLike
    #: mu of fast sliding; only: law = 'regularised' (default: of the file, else mu)
    mu_dynamic: ArrayLike
    #: [L/s] over which mu falls to mu_dynamic; only: law = 'regularised' (default: of the file,
    #: else required with mu_dynamic)
    weakening_speed: ArrayLike
    #: e of exp(-(v/weakening_speed)**e); only: law = 'regularised' (default: of the file, else 1)
    weakening_exponent: ArrayLike
    #: [s/L] gain of mu with the sliding speed; only: law = 'regularised' (default: of the file,
    #: else 0)
    mu_viscous: ArrayLike
    #: work of a small cycle grows with amplitude**(chi + 3); only: law = 'iwan' (default: of the
    #: file, else required with tangential dofs)
    iwan_chi: ArrayLike
    #: stiffness lost where the last elements slip, over that lost before; only: law = 'iwan'
    #: (default: of the file, else 0)
    iwan_beta: ArrayLike
    #: n of abs(z)**n: how sharp the turn to the limit is; only: law = 'bouc_wen' (default: of the
    #: file, else 1)
    bouc_wen_exponent: ArrayLike
    #: 0.5 unloads with the tangential stiffness, 1 from the limit with twice of it; only: law =
    #: 'bouc_wen' (default: of the file, else 0.5)
    bouc_wen_beta: ArrayLike
    #: multiplies eps of rigid laws; only: law = 'dlft', 'dlft_velocity', 'rigid' (default: 1)
    penalty_scale: float
    #: pairs that never slip start unstrained, as the last point ended, or with residual (default:
    #: 'assembly')
    memory: Literal["assembly", "carried", "residual"]
    #: [L] displacement along t1 where a pair that never slips is unstrained (default: of the file,
    #: else 0)
    slider_1: ArrayLike
    #: [L] the same along t2 (default: of the file, else 0)
    slider_2: ArrayLike
    #: traction of pairs that never slip: -1 and 1 are the ends of what balances, 0 is between;
    #: only: memory = 'residual' (default: of the file, else 0)
    residual: ArrayLike
    #: terms added to gap: obstacles that move or are uneven (default: 0)
    n_gap_terms: int
    #: from 1; 0: all (default: 0)
    gap_pair: ArrayLike
    #: harmonic, 0 to n_harmonics (default: 1, or by gap_order)
    gap_harmonic: ArrayLike
    #: in place of harmonics: the frequency is their greatest common divisor times the speed
    #: (default: gap_harmonic)
    gap_order: ArrayLike
    #: [L] widest at n tau = -gap_phase (required with n_gap_terms)
    gap_amplitude: ArrayLike
    #: [degrees] of cos(n tau + phase) (default: 0)
    gap_phase: ArrayLike
    #: friction along the path of speed and vibration, or against the speed alone (default: 'path')
    sliding: Literal["path", "steady"]
    #: result of a wear run: start from its last depths, on top of gap (default: none)
    worn: str
    #: row of its /wear/depth, from 1; 0: the last; only: worn (default: 0)
    worn_step: int


class Spring(TypedDict, total=False):
    """Group &spring: nonlinear springs."""

    #: 0 switches the springs of a file off (default: of the file, else 0)
    n_springs: int
    #: dof on one side (default: of the file, else required)
    side_1: ArrayLike
    #: dof on the other side, 0: ground (default: of the file, else 0)
    side_2: ArrayLike
    #: of side 2, counted from that of side 1; only: &cyclic (default: of the file, else 0)
    sector_2: ArrayLike
    #: [F/L^power] force = coefficient * elongation**power (default: of the file, else required)
    coefficient: ArrayLike
    #: odd powers keep the symmetry of odd harmonics (default: of the file, else 3)
    power: ArrayLike


class Polynomial(TypedDict, total=False):
    """Group &polynomial: forces that are polynomials of several dofs."""

    #: 0 switches the terms of a file off (default: of the file, else 0)
    n_terms: int
    #: terms are a potential, or a force on one dof each (default: of the file, else 'energy')
    of: Literal["energy", "force"]
    #: dofs of the product, repeated for powers; 0: none (default: of the file, else required)
    factors: ArrayLike
    #: of each product (default: of the file, else required)
    coefficient: ArrayLike
    #: that the force acts on, on the side of the stiffness; only: of = 'force' (default: of the
    #: file, else required)
    dof: ArrayLike


class Damper(TypedDict, total=False):
    """Group &damper: nonlinear dampers."""

    #: 0 switches the dampers of a file off (default: of the file, else 0)
    n_dampers: int
    #: dof on one side (default: of the file, else required)
    side_1: ArrayLike
    #: dof on the other side, 0: ground (default: of the file, else 0)
    side_2: ArrayLike
    #: of side 2, counted from that of side 1; only: &cyclic (default: of the file, else 0)
    sector_2: ArrayLike
    #: c of c u**position_power abs(v)**(power - 1) v, v = du/dt (default: of the file, else
    #: required)
    coefficient: ArrayLike
    #: of the velocity: 1 viscous, 2 drag (default: of the file, else 1)
    power: ArrayLike
    #: of the displacement; odd ones have even harmonics (default: of the file, else 0)
    position_power: ArrayLike


class User(TypedDict, total=False):
    """Group &user: elements with laws of your own."""

    #: number of elements (default: 0)
    n_elements: int
    #: with the functions, relative to the namelist (required with n_elements)
    library: str
    #: function of all elements, or of each (required with n_elements)
    symbol: str | int | Sequence[str | int]
    #: displacements of each element (default: 1)
    n_in: int
    #: dofs of its inputs (required with n_elements)
    side_1: ArrayLike
    #: dofs on the other side, 0: ground (default: 0)
    side_2: ArrayLike
    #: constants of each function (default: 0)
    n_parameters: int
    #: n_par = n_parameters of each element (required with n_parameters)
    parameters: ArrayLike
    #: functions give slopes, or differences stand for them (default: 'given')
    derivative: Literal["given", "difference"]
    #: you promise that opposite motions have opposite forces (default: .false.)
    odd: bool
    #: functions may be called from several threads (default: .false.)
    thread_safe: bool
    #: try functions before the run: slopes, symmetry, memory (default: .true.)
    check: bool
    #: of slopes and odd forces, relative; only: check (default: 1e-5)
    check_tolerance: float


class Load(TypedDict, total=False):
    """Group &load: static and harmonic loads."""

    #: [F] constant load (default: of the file, else 0)
    static: ArrayLike
    #: [F] cosine part of harmonic 1 (default: of the file, else 0)
    cosine: ArrayLike
    #: [F] sine part of harmonic 1 (default: of the file, else 0)
    sine: ArrayLike
    #: further loads on single dofs, in any harmonic (default: 0)
    n_terms: int
    #: dof, or n_dof and a row; negative: turned (required with n_terms)
    term_dof: ArrayLike
    #: harmonic, 0 to n_harmonics (default: 1, or by term_order)
    term_harmonic: ArrayLike
    #: in place of harmonics: the frequency is their greatest common divisor times the speed
    #: (default: term_harmonic)
    term_order: ArrayLike
    #: [F] over the frequency to term_power (required with n_terms)
    term_amplitude: ArrayLike
    #: [degrees] of cos(n omega t + phase) (default: 0)
    term_phase: ArrayLike
    #: of the frequency of the term [rad/s]; 2: unbalance (default: 0)
    term_power: ArrayLike
    #: points that multiply all vibratory loads; 0 switches those of a file off (default: of the
    #: file, else 0)
    n_table: int
    #: [rad/s] of the points, rising; linear between, refused beyond (default: of the file, else
    #: required with n_table)
    table_frequency: ArrayLike
    #: factor of the loads (default: of the file, else required with n_table)
    table_scale: ArrayLike
    #: of the static load and that of rotation (default: 1)
    static_scale: float
    #: of all vibratory loads (default: 1)
    harmonic_scale: float


class Base(TypedDict, total=False):
    """Group &base: motion of the supports, or of the ground."""

    #: harmonic motions that add up (default: 0)
    n_terms: int
    #: supports that move alike; negative: the other way (default: of the file, else direction)
    dof: ArrayLike
    #: motion of all dofs with the ground (default: of the file)
    direction: ArrayLike
    #: what the amplitudes are of (default: 'displacement')
    motion: Literal["displacement", "velocity", "acceleration"]
    #: 0 to n_harmonics (default: 1)
    harmonic: ArrayLike
    #: [L] over the time to the first or second power for a velocity or an acceleration (required
    #: with n_terms)
    amplitude: ArrayLike
    #: [degrees] of cos(n omega t + phase) (default: 0)
    phase: ArrayLike
    #: motion beside the base, or with it (supports alone) (default: 'relative')
    frame: Literal["relative", "absolute"]


class Harmonics(TypedDict, total=False):
    """Group &harmonics: method, number of harmonics, instants per period."""

    #: Galerkin, collocation, least squares, or unknowns at the instants (default: 'hbm')
    method: Literal["hbm", "tcm", "tcm_least_squares", "hdhb"]
    #: H, the highest; with accuracy the most that may be used (default: 53 with accuracy, 7 with
    #: 'mode', 'resonance', &control, else 1)
    n_harmonics: int
    #: instants of a period, at least 2H+1; 0: chosen (default: 0)
    n_time: int
    #: instants of the equations; 0: twice the coefficients; only: method = 'tcm_least_squares'
    #: (default: 0)
    n_collocation: int
    #: those above do not reach springs; 0: no filter; only: method = 'hdhb' (default: 0)
    filter_harmonics: int
    #: stick, slip and separation at instants, or located on the series (default: 'auto')
    sampling: Literal["uniform", "events", "auto"]
    #: 'auto' leaves even harmonics out where that is exact (default: 'auto')
    parity: Literal["auto", "all", "odd"]
    #: relative error for which harmonics and instants are chosen; 0: as given; only: method =
    #: 'hbm', natural sweeps and points (default: 0)
    accuracy: float


_Sweep = TypedDict("_Sweep", {
    #: values, or factors of those of the case; only: parameter other than 'frequency' (default:
    #: 'value')
    "as": Literal["value", "factor"],
}, total=False)


class Sweep(_Sweep, total=False):
    """Group &sweep: frequencies, or values of a parameter."""

    #: what start, end and values are of; only: analysis = 'frf' (default: 'frequency')
    parameter: Literal["frequency", "load%harmonic_scale", "load%static_scale", "contact%mu",
                       "contact%normal_load", "contact%gap", "contact%tangential_stiffness",
                       "contact%normal_stiffness", "spring%coefficient", "model%modal_damping",
                       "model%rotation_speed", "model%rayleigh_mass", "model%rayleigh_stiffness",
                       "contact%normal_coefficient", "contact%reference_force",
                       "polynomial%coefficient", "damper%coefficient", "model%loss_factor",
                       "contact%slip_speed", "contact%mu_dynamic", "mistuning%frequency",
                       "mistuning%damping_ratio", "mistuning%stiffness", "mistuning%mass",
                       "mistuning%scale", "body%mass", "contact%residual", "contact%slider_1",
                       "contact%slider_2"]
    #: the first, or the only one (required)
    start: float
    #: the last; below start the sweep goes down (required for frf, else 0)
    end: float
    #: of frequencies given; results are in rad/s (default: 'rad/s')
    unit: Literal["rad/s", "Hz"]
    #: given frequencies, or a branch through folds (default: 'natural')
    continuation: Literal["natural", "arclength"]
    #: evenly spaced, with both ends; of a branch: its first step (required for a natural frf, else
    #: 1)
    n_points: int
    #: of a branch; only: continuation = 'arclength' (default: 1000)
    max_points: int
    #: Floquet multipliers of every point; only: springs, law = 'penalty', 'regularised' (default:
    #: .false.)
    stability: bool
    #: rotation speed is the frequency over this: 1 for unbalance, an engine order; 0: it does not
    #: follow; only: analysis = 'frf', 'point', 'population', 'resonance' (default: 0)
    speed_order: float
    #: points solved to find maxima become rows; only: analysis = 'frf', continuation = 'natural'
    #: (default: .false.)
    refine: bool
    #: in any order, in place of start, end, n_points; only: analysis = 'frf', 'time', continuation
    #: = 'natural' (default: none)
    values: ArrayLike
    #: of a sweep over another parameter (required with another parameter)
    frequency: float


class Solver(TypedDict, total=False):
    """Group &solver: nonlinear solver, tolerance."""

    #: Newton with line search, MINPACK's hybrid method, KINSOL, pseudo-time (default: 'newton')
    kind: Literal["newton", "powell", "kinsol", "pseudo_time"]
    #: of Newton steps; 'auto': by the size; only: kind = 'newton', 'pseudo_time' (default: 'auto')
    linear: Literal["auto", "lu", "krylov"]
    #: norm of the residual over that of the vibratory load (default: 1e-8)
    tolerance: float
    #: from each guess (default: 60)
    max_iterations: int
    #: [s] of a point, which then is not converged; 0: no limit; of a branch: of its first point
    #: (default: 0)
    max_seconds: float
    #: try other ways where the first guess fails (default: .true.)
    fallback: bool
    #: leave out stuck pairs and what nothing moves (default: .true.)
    skips: bool
    #: at most, rows by rising amplitude; above 1 searched for by deflation; only: analysis =
    #: 'point' (default: 1)
    n_solutions: int
    #: of the distance by which known solutions repel; only: n_solutions > 1 (default: 2)
    deflation_power: float
    #: of the factor that repels, far away; only: n_solutions > 1 (default: 1)
    deflation_shift: float


class PseudoTime(TypedDict, total=False):
    """Group &pseudo_time: pseudo-time integration."""

    #: P of P dU/dt* = -R(U): 2 i n omega M, identity, the linear joint with closed pairs (default:
    #: 'rotated')
    flow: Literal["rotated", "identity", "preconditioned"]
    #: by Newton, CVODE (wear: IDA), linearly implicit, explicit (default: 'implicit_euler')
    scheme: Literal["implicit_euler", "bdf", "rosenbrock", "runge_kutta"]
    #: the first; 0: chosen (default: 0)
    step: float
    #: Courant number; only: scheme = 'runge_kutta' (default: 0.8)
    cfl: float
    #: steps taken and refused (default: 500)
    max_steps: int


class Wear(TypedDict, total=False):
    """Group &wear: fretting wear."""

    #: rate at the start of a step, vibration and depth together, linearly implicit (default:
    #: 'implicit')
    scheme: Literal["explicit", "implicit", "pseudo_time"]
    #: pressure times slip, or friction energy (default: 'archard')
    law: Literal["archard", "energy"]
    #: implicit 1 to 4, explicit 1 or 2; 0: chosen; only: scheme = 'implicit', 'explicit' (default:
    #: 0)
    order: int
    #: [L^2/F] depth over contact force times slip over area (required for wear)
    coefficient: ArrayLike
    #: to be covered (default: none)
    n_cycles: float
    #: [L] growth of the depth in a step; 0: by the error alone (default: 0)
    max_depth_step: float
    #: of a step over the largest depth; 0: by max_depth_step, else 1e-3 (default: 0)
    error_tolerance: float
    #: steady where the largest rate has fallen to this part of its maximum (default: 1e-6)
    steady_tolerance: float
    #: steps at most (default: 1000)
    max_steps: int
    #: run again with halved steps (default: .false.)
    check_steps: bool
    #: friction changes with the depth, or the friction energy of its pair (default: 'none')
    mu_by: Literal["none", "depth", "energy"]
    #: that wear leads to; only: mu_by (required with mu_by)
    mu_final: ArrayLike
    #: [L or F L] after which 1/e of the change is left; only: mu_by (required with mu_by)
    mu_scale: ArrayLike
    #: stay at the peak of the first observed quantity (default: .false.)
    follow_resonance: bool


class Mission(TypedDict, total=False):
    """Group &mission: wear over blocks of cycles in other conditions."""

    #: of a flight; 0: no mission; only: analysis = 'wear' (default: 0)
    n_blocks: int
    #: of each block in a flight (required with n_blocks)
    cycles: ArrayLike
    #: how often all blocks are flown (default: 1)
    n_flights: int
    #: settings of each block as of --set, parted by semicolons (default: nothing)
    change: ArrayLike
    #: of each block (default: block 1, block 2, ..)
    name: ArrayLike
    #: taken together; 1: all in their order, 0: by wear%error_tolerance (default: 0)
    flights_per_jump: int


class Time(TypedDict, total=False):
    """Group &time: time integration."""

    #: at most (default: 500)
    n_periods: int
    #: at least max(16, 4H); also the instants of histories (default: 1000)
    steps_per_period: int


class Mode(TypedDict, total=False):
    """Group &mode: a nonlinear mode over its amplitude."""

    #: of the elastic modes with closed pairs stuck (default: 1)
    number: int
    #: mode nearest to this stuck frequency; 0: by number (default: 0)
    near: float
    #: of near; results are in rad/s (default: 'rad/s')
    unit: Literal["rad/s", "Hz"]
    #: [L] rising, in place of start, end, n_points; only: analysis = 'mode', natural steps
    #: (default: none)
    amplitudes: ArrayLike
    #: [L] lowest amplitude; only: analysis = 'mode' (required)
    start: float
    #: [L] highest amplitude; only: analysis = 'mode' (required)
    end: float
    #: amplitude of the first harmonic of the first observed quantity, or modal, sqrt(U^H M U)
    #: (default: 'observed')
    control: Literal["observed", "modal"]
    #: even in the logarithm; of a branch: its longest step (default: 40)
    n_points: int
    #: given amplitudes, or a branch through folds (default: 'arclength')
    continuation: Literal["natural", "arclength"]
    #: of a branch; only: continuation = 'arclength' (default: 1000)
    max_points: int
    #: load factors for which the response near the resonance is put together (default: none)
    synthesis: ArrayLike


class Campbell(TypedDict, total=False):
    """Group &campbell: frequencies over the rotation speed, and where engine orders meet them."""

    #: [rad/s] lowest rotation speed; only: analysis = 'campbell' (required)
    start: float
    #: [rad/s] highest rotation speed; only: analysis = 'campbell' (required)
    end: float
    #: from start to end (default: 15)
    n_speeds: int
    #: engine orders, signed as cyclic%engine_order; not 0; only: analysis = 'campbell' (required)
    orders: ArrayLike
    #: factor of the vibratory load, of all orders or each (default: 1)
    order_scale: ArrayLike
    #: look for the maximum near each crossing, with friction (default: .true.)
    peaks: bool
    #: frequencies across each of them (default: 41)
    n_points: int


class Bounds(TypedDict, total=False):
    """Group &bounds: lowest and highest response over all residual tractions."""

    #: of the first observed quantity, or of all pairs (default: 'first_harmonic')
    quantity: Literal["first_harmonic", "largest", "dissipation", "wear_volume"]
    #: tractions to start from: centre, ends of the gradient, drawn corners (default: 4)
    n_starts: int


class Ringdown(TypedDict, total=False):
    """Group &ringdown: free decay from the shape of a mode."""

    #: of the elastic modes with closed pairs stuck (default: 1)
    number: int
    #: [L] of the first observed quantity, from its rest; only: analysis = 'ringdown' (required)
    amplitude: float
    #: periods of the stuck mode (default: 20)
    n_cycles: int
    #: changes of stick and slip are located within (default: 2000)
    steps_per_period: int


class Stress(TypedDict, total=False):
    """Group &stress: stress and endurance of a cycle, of models with /stress."""

    #: by the largest von Mises stress between two instants, or with the sign of its trace (default:
    #: 'range')
    method: Literal["range", "signed"]
    #: how amplitude and mean count together (default: 'goodman')
    diagram: Literal["goodman", "gerber"]
    #: [F/L^2] alternating stress endured (default: of the file, else no utilisation)
    endurance: ArrayLike
    #: [F/L^2] static strength (default: of the file, else no utilisation)
    ultimate: ArrayLike
    #: amplitude, mean, utilisation; Fourier coefficients too; nothing (default: 'points')
    output: Literal["points", "tensor", "none"]


class Output(TypedDict, total=False):
    """Group &output: result file, observed quantities."""

    #: result file, relative to the namelist (default: name of the namelist with .h5)
    file: str
    #: one period of every quantity at every point; large (default: .false.)
    histories: bool
    #: forces, states and dissipation (default: .true.)
    contact: bool
    #: highest harmonic of the answer above those of the balance; 0: theirs; only: law = 'rigid'
    #: (default: 0)
    tail: int
    #: dof number k is called uk, n_dof + k rowk (default: all that the model file names, else every
    #: dof)
    observe: str | int | Sequence[str | int]


class Control(TypedDict, total=False):
    """Group &control: responses of given amplitudes."""

    #: [L] for which the load factor is found, one after the other; only: analysis = 'frf', 'point'
    #: (default: none: the load is given)
    amplitude: ArrayLike
    #: of the first harmonic, or the largest of the period (default: 'first_harmonic')
    of: Literal["first_harmonic", "largest"]
    #: the quantity that has it, by its name in output%observe; only: amplitude (default: the first
    #: one)
    observed: str | int | Sequence[str | int]


class Groups(TypedDict, total=False):
    """All groups; `model` is the one that `structure` stands for where a model is an argument."""

    case: CaseGroup
    sensitivity: Sensitivity
    resonance: Resonance
    structure: Structure
    body: Body
    cyclic: Cyclic
    population: Population
    mistuning: Mistuning
    contact: Contact
    spring: Spring
    polynomial: Polynomial
    damper: Damper
    user: User
    load: Load
    base: Base
    harmonics: Harmonics
    sweep: Sweep
    solver: Solver
    pseudo_time: PseudoTime
    wear: Wear
    mission: Mission
    time: Time
    mode: Mode
    campbell: Campbell
    bounds: Bounds
    ringdown: Ringdown
    stress: Stress
    output: Output
    control: Control
