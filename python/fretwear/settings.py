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
    #: a sweep, a frequency, wear, integration in time, frequencies, a nonlinear mode, a resonance,
    #: a Campbell diagram, mistuned disks, a range, free decay (default: 'frf')
    analysis: Literal["frf", "point", "wear", "time", "modes", "mode", "resonance", "campbell",
                      "population", "bounds", "ringdown"]
    #: OpenMP threads; 0: as many as OpenMP gives (default: 0)
    threads: int
    #: [s] time after which the run ends with the points that are done; 0: none (default: 0)
    max_seconds: float


class Sensitivity(TypedDict, total=False):
    """Group &sensitivity: derivatives of the response by parameters of the case."""

    #: what the response is differentiated by: 'contact%mu', 'load%harmonic_scale', ...; only:
    #: analysis = 'frf', 'point', 'resonance', 'mode' (default: none: no derivatives)
    parameters: str | int | Sequence[str | int]
    #: what is differentiated: first_harmonic, largest, dissipation, wear_volume; only: parameters
    #: (default: all that the case has)
    quantities: str | int | Sequence[str | int]
    #: standard deviation of each parameter over its value, for that of the quantities; only:
    #: parameters (default: none)
    deviation: ArrayLike


_Resonance = TypedDict("_Resonance", {
    #: what start and end are: values, or factors of those of the case (all pairs or springs
    #: together) (default: 'value')
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
    #: values; of a branch: sets its longest step (default: 20)
    n_points: int
    #: even steps, or even in the logarithm (default: 'linear')
    spacing: Literal["linear", "log"]
    #: the response is largest, or the load does no reactive work (default: 'amplitude')
    condition: Literal["amplitude", "phase"]
    #: of the first observed quantity, what is largest: the amplitude of its first harmonic, or its
    #: largest value (default: 'first_harmonic')
    quantity: Literal["first_harmonic", "largest"]
    #: points at given values, or a branch through folds (condition = 'phase') (default: 'natural')
    continuation: Literal["natural", "arclength"]
    #: points of a branch at most; only: continuation = 'arclength' (default: 1000)
    max_points: int


class Structure(TypedDict, total=False):
    """Group &model: mass, stiffness and damping, inline or from a file."""

    #: where the matrices are; 'memory': in the program that calls the library (default: 'inline')
    source: Literal["inline", "hdf5", "matrix_market"]
    #: model file, relative to the namelist (required unless inline)
    file: str
    #: units of length, mass, time and force, such as 'mm-tonne-s-N': for values with units, and in
    #: results (default: of the file)
    unit_system: str
    #: order of the matrices; with a file it may be left out (required inline)
    n_dof: int
    #: [M] symmetric, no negative diagonal; may be singular (required inline)
    mass: ArrayLike
    #: [F/L] symmetric; may be singular where contact holds the structure (required inline)
    stiffness: ArrayLike
    #: [F s/L] symmetric; the next three add to it (default: 0)
    damping: ArrayLike
    #: [F/L] hysteretic, symmetric: i times it is added to the stiffness in harmonics above 0
    #: (default: 0)
    structural_damping: ArrayLike
    #: [F s/L] stiffness for each rad/s of rotation_speed, of any shape: (i, j) is the force on dof
    #: i by dof j, column after column (default: 0)
    circulatory: ArrayLike
    #: [F/L] added to the stiffness as it is, of bearings for one (default: 0)
    stiffness_unsymmetric: ArrayLike
    #: [F s/L] added to the damping as it is (default: 0)
    damping_unsymmetric: ArrayLike
    #: displacements that are combinations of dofs: sides, term_dof and observe name them by n_dof +
    #: 1, .. (default: of the file, else 0)
    n_rows: int
    #: weight of each dof in each of them, row after row (default: of the file, else required with
    #: n_rows)
    row: ArrayLike
    #: [1/s] adds this times M to the damping (default: 0)
    rayleigh_mass: float
    #: [s] adds this times K, with rotation, to the damping (default: 0)
    rayleigh_stiffness: float
    #: fraction of critical damping of every mode (default: 0)
    modal_damping: float
    #: modes with open contact, or with all pairs stuck: `closed` of analysis 'modes'; only:
    #: modal_damping (default: 'open')
    modal_damping_of: Literal["open", "stuck"]
    #: [Hz] of modes up to this frequency alone, which takes less time; 0: of all; only:
    #: modal_damping (default: 0)
    modal_damping_up_to: float
    #: [rad/s] adds its square times stiffness_rotation and load/static_rotation of the model file,
    #: and its multiple of coriolis and circulatory (default: 0)
    rotation_speed: float
    #: adds i times this part of the stiffness, with rotation, in harmonics above 0: hysteretic
    #: damping (default: 0)
    loss_factor: float


class Body(TypedDict, total=False):
    """Group &body: bodies of the model that no spring holds."""

    #: [M] of each body of the model, in place of its own (default: of the file)
    mass: ArrayLike


class Cyclic(TypedDict, total=False):
    """Group &cyclic: sectors around an axis and the wave that runs around it."""

    #: equal sectors, of which the model is one (default: of the file, else not cyclic)
    n_sectors: int
    #: each sector moves as the one before it, this part of n_sectors periods later; negative: the
    #: other way; only: cyclic, all but analysis = 'modes' (required with sectors)
    engine_order: int
    #: solve for all sectors, whose pairs may differ: &contact takes values of n_pairs, all sectors
    #: alike, or of n_sectors times as many (default: .false.)
    mistuned: bool
    #: natural frequencies of each nodal diameter; only: analysis = 'modes' (default: 10)
    n_modes: int
    #: dofs of an interface; 0: only contact joins the sectors (default: of the file, else 0)
    n_interface: int
    #: dofs of the left interface (default: of the file)
    left: ArrayLike
    #: the same of the right one, which moves as the left one of the next sector; negative: with its
    #: sign turned (default: of the file)
    right: ArrayLike


class Population(TypedDict, total=False):
    """Group &population: the largest amplitude of disks whose blade frequencies differ."""

    #: disks: the first patterns; 0: all that there are (default: 0)
    n_patterns: int
    #: look for maxima between the rows of the sweep (default: .true.)
    peaks: bool
    #: which amplitude: of the first harmonic, or the largest deflection (default: 'first_harmonic')
    quantity: Literal["first_harmonic", "largest"]
    #: by which part the blade frequencies are above the tuned ones, pattern after pattern, each as
    #: mistuning%frequency; only: analysis = 'population' (default: /mistuning/patterns of the file)
    patterns: ArrayLike


class Mistuning(TypedDict, total=False):
    """Group &mistuning: how sectors differ from the tuned one."""

    #: blade modes whose frequencies differ (default: of the file, else 0)
    n_rows: int
    #: [M^0.5] their rows, one after another: W of the guide (default: of the file, else none)
    rows: ArrayLike
    #: [rad/s] their frequencies, blade alone (default: of the file, else none)
    row_omega: ArrayLike
    #: by which part the frequencies of each blade are above the tuned ones: n_sectors values, or
    #: all rows of each sector; only: cyclic%mistuned = .true. (default: of the file, else none)
    frequency: ArrayLike
    #: damping ratios of each blade above the tuned ones, likewise; only: cyclic%mistuned = .true.
    #: (default: of the file, else none)
    damping_ratio: ArrayLike
    #: by which part the stiffness of each blade is above the tuned one: n_sectors values; only:
    #: cyclic%mistuned = .true. (default: of the file, else none)
    stiffness: ArrayLike
    #: the same of its mass; only: cyclic%mistuned = .true. (default: of the file, else none)
    mass: ArrayLike
    #: [F/L] stiffness of the blade alone, symmetric (default: of the file, else none)
    blade_stiffness: ArrayLike
    #: [M] mass of the blade alone, symmetric (default: of the file, else none)
    blade_mass: ArrayLike
    #: multiplies all deviations; only: cyclic%mistuned = .true. (default: 1)
    scale: float


class Contact(TypedDict, total=False):
    """Group &contact: contact pairs, friction, gap, contact law."""

    #: required with side_1; 0 switches the contact of a file off (default: of the file, else 0)
    n_pairs: int
    #: rigid, rigid at velocity level, elastic, rigid of high order (friction on dofs with mass),
    #: smooth in the velocity, joints of Iwan, of Bouc-Wen (default: 'rigid' where it goes, else
    #: 'dlft')
    law: Literal["dlft", "dlft_velocity", "penalty", "rigid", "regularised", "iwan",
                 "bouc_wen"] | Sequence[str]
    #: how pairs with a normal dof press: a spring, normal_coefficient d**normal_exponent,
    #: reference_force exp(d/decay_length), a table; only: law = 'penalty', 'regularised' (default:
    #: 'unilateral')
    normal_law: Literal["unilateral", "power", "exponential", "table"] | Sequence[str]
    #: points of the table; only: normal_law = 'table' (default: of the file, else 0)
    n_table: int
    #: [L] of the points, in ascending order; only: normal_law = 'table' (default: of the file, else
    #: required)
    overclosure: ArrayLike
    #: [F] of the points, from 0 up: linear between them, beyond the last with its slope; only:
    #: normal_law = 'table' (default: of the file, else required)
    force: ArrayLike
    #: normal_coefficient, reference_force and force are pressures: times area; only: normal_law
    #: other than 'unilateral' (default: .false.)
    normal_per_area: bool
    #: dofs of t1, t2, n on one side; 0: none, negative: with its sign turned (default: of the file,
    #: else required)
    side_1: ArrayLike
    #: the same of the other side, 0: ground; the normal points from side 2 to side 1 (default: of
    #: the file, else 0)
    side_2: ArrayLike
    #: sector of side 2, counted from that of side 1: 1 is the next, -1 the one before; only:
    #: &cyclic (default: of the file, else 0)
    sector_2: ArrayLike
    #: friction coefficient (default: of the file, else required with tangential dofs)
    mu: ArrayLike
    #: [L] initial gap; negative: interference, which preloads (default: of the file, else 0)
    gap: ArrayLike
    #: [L^2] of a pair: from contact forces to pressure; only: analysis = 'wear', normal_per_area
    #: (default: of the file, else required for wear, per area)
    area: ArrayLike
    #: [F] constant compressive force; only: pairs without a normal dof (default: of the file, else
    #: required with friction)
    normal_load: ArrayLike
    #: [L s^2] added to gap, for each (rad/s)^2 of the rotation speed; only: rotation_speed,
    #: speed_order, campbell (default: of the file, else none)
    gap_rotation: ArrayLike
    #: [F s^2] added to normal_load, for each (rad/s)^2 of the rotation speed; only: rotation_speed,
    #: speed_order, campbell (default: of the file, else none)
    normal_load_rotation: ArrayLike
    #: [L/s] velocity of side 2 along t1: a belt, a disk or a casing; only: law = 'dlft',
    #: 'dlft_velocity', 'penalty', 'rigid', 'regularised' (default: of the file, else 0)
    speed_1: ArrayLike
    #: [L/s] the same along t2; only: law = 'dlft', 'dlft_velocity', 'penalty', 'rigid',
    #: 'regularised' (default: of the file, else 0)
    speed_2: ArrayLike
    #: [F/L] contact stiffness; 0 with a parallel pair that has one, or without a tangential dof;
    #: only: law = 'penalty', 'iwan', 'bouc_wen' (default: of the file, else required with
    #: tangential dofs)
    tangential_stiffness: ArrayLike
    #: [F/L] contact stiffness; 0 without a normal dof; only: law = 'penalty', 'regularised'
    #: (default: of the file, else required with normal dofs)
    normal_stiffness: ArrayLike
    #: [F/L^e] c of normal_law = 'power', pressure c d**e of the overclosure d; 0 for pairs of
    #: others; only: law = 'penalty', 'regularised' (default: of the file, else required with
    #: 'power')
    normal_coefficient: ArrayLike
    #: e of normal_law = 'power': 1.5 Hertz; only: law = 'penalty', 'regularised' (default: of the
    #: file, else 1.5)
    normal_exponent: ArrayLike
    #: [F] p_0 of normal_law = 'exponential', pressure p_0 exp(d/h); 0 for pairs of others; only:
    #: law = 'penalty', 'regularised' (default: of the file, else required with 'exponential')
    reference_force: ArrayLike
    #: [L] h of normal_law = 'exponential'; 0 for pairs of others; only: law = 'penalty',
    #: 'regularised' (default: of the file, else required with 'exponential')
    decay_length: ArrayLike
    #: [L/s] sliding velocity du/dt at which tanh(1) = 76 % of the friction acts; only: law =
    #: 'regularised' (default: of the file, else required with tangential dofs)
    slip_speed: ArrayLike
    #: friction coefficient of fast sliding, to which mu falls; only: law = 'regularised' (default:
    #: of the file, else mu)
    mu_dynamic: ArrayLike
    #: [L/s] over which friction falls from mu to mu_dynamic; only: law = 'regularised' (default: of
    #: the file, else required with mu_dynamic)
    weakening_speed: ArrayLike
    #: of the speed in exp(-(v/weakening_speed)**e); only: law = 'regularised' (default: of the
    #: file, else 1)
    weakening_exponent: ArrayLike
    #: [s/L] what mu gains with the sliding speed; only: law = 'regularised' (default: of the file,
    #: else 0)
    mu_viscous: ArrayLike
    #: exponent of the sliding limits: the work of a small cycle grows with amplitude**(chi + 3);
    #: only: law = 'iwan' (default: of the file, else required with tangential dofs)
    iwan_chi: ArrayLike
    #: stiffness that is lost at once where the last elements slip, over that lost before; only: law
    #: = 'iwan' (default: of the file, else 0)
    iwan_beta: ArrayLike
    #: n of abs(z)**n, 1 or 2: how sharply the force turns to its limit; only: law = 'bouc_wen'
    #: (default: of the file, else 1)
    bouc_wen_exponent: ArrayLike
    #: shape of the loops: 0.5 unloads with the tangential stiffness, 1 with twice of it from the
    #: limit; only: law = 'bouc_wen' (default: of the file, else 0.5)
    bouc_wen_beta: ArrayLike
    #: multiplies the automatic eps of the rigid laws; only: law = 'dlft', 'dlft_velocity', 'rigid'
    #: (default: 1)
    penalty_scale: float
    #: where pairs that never slip start: unstrained, as the last point ended, or with the traction
    #: that residual says (default: 'assembly')
    memory: Literal["assembly", "carried", "residual"]
    #: [L] displacement along t1 where an assembled pair is unstrained; of those that never slip
    #: (default: of the file, else 0)
    slider_1: ArrayLike
    #: [L] the same along t2 (default: of the file, else 0)
    slider_2: ArrayLike
    #: residual traction of pairs that never slip: -1 and 1 are the ends of what balances, 0 is
    #: between them; only: memory = 'residual' (default: of the file, else 0)
    residual: ArrayLike
    #: what moves the obstacle, or makes it uneven: terms added to gap (default: 0)
    n_gap_terms: int
    #: pair, from 1; 0: all (default: 0)
    gap_pair: ArrayLike
    #: harmonic, 0 to n_harmonics (default: 1, or by gap_order)
    gap_harmonic: ArrayLike
    #: orders in place of harmonics: the frequency of the sweep is their greatest common divisor
    #: times the speed (default: gap_harmonic)
    gap_order: ArrayLike
    #: [L] amplitude; where it is positive the gap is widest at n tau = -gap_phase (required with
    #: n_gap_terms)
    gap_amplitude: ArrayLike
    #: [degrees] of cos(n tau + phase) (default: 0)
    gap_phase: ArrayLike
    #: how friction follows speed_1, speed_2: along the path that they add to the vibration, or
    #: against them whatever it is (default: 'path')
    sliding: Literal["path", "steady"]
    #: result file of a wear run: start from the depths that it ends with, on top of gap (default:
    #: none)
    worn: str
    #: row of its /wear/depth, counted from 1; 0: the last; only: worn (default: 0)
    worn_step: int


class Spring(TypedDict, total=False):
    """Group &spring: nonlinear springs."""

    #: required with coefficient; 0 switches the springs of a file off (default: of the file, else
    #: 0)
    n_springs: int
    #: dof on one side (default: of the file, else required)
    side_1: ArrayLike
    #: dof on the other side, 0: ground (default: of the file, else 0)
    side_2: ArrayLike
    #: sector of side 2, counted from that of side 1; only: &cyclic (default: of the file, else 0)
    sector_2: ArrayLike
    #: [F/L^power] force = coefficient * elongation**power (default: of the file, else required)
    coefficient: ArrayLike
    #: odd powers keep the symmetry of odd harmonics (default: of the file, else 3)
    power: ArrayLike


class Polynomial(TypedDict, total=False):
    """Group &polynomial: forces that are polynomials of several dofs."""

    #: required with factors; 0 switches the terms of a file off (default: of the file, else 0)
    n_terms: int
    #: what the terms are: a potential, whose gradient the forces are, or a force on one dof each
    #: (default: of the file, else 'energy')
    of: Literal["energy", "force"]
    #: signed dofs that a term is the product of, repeated for powers; 0: none (default: of the
    #: file, else required)
    factors: ArrayLike
    #: of the terms; force = coefficient * product of the factors, or that is a potential (default:
    #: of the file, else required)
    coefficient: ArrayLike
    #: dof that the force of a term acts on, on the side of the stiffness; only: of = 'force'
    #: (default: of the file, else required)
    dof: ArrayLike


class Damper(TypedDict, total=False):
    """Group &damper: nonlinear dampers."""

    #: required with coefficient; 0 switches the dampers of a file off (default: of the file, else
    #: 0)
    n_dampers: int
    #: dof on one side (default: of the file, else required)
    side_1: ArrayLike
    #: dof on the other side, 0: ground (default: of the file, else 0)
    side_2: ArrayLike
    #: sector of side 2, counted from that of side 1; only: &cyclic (default: of the file, else 0)
    sector_2: ArrayLike
    #: c of the force c u**position_power abs(v)**(power - 1) v, v = du/dt (default: of the file,
    #: else required)
    coefficient: ArrayLike
    #: of the velocity: 1 viscous, 2 drag (default: of the file, else 1)
    power: ArrayLike
    #: of the displacement; odd ones have even harmonics (default: of the file, else 0)
    position_power: ArrayLike


class User(TypedDict, total=False):
    """Group &user: elements with laws of your own."""

    #: number of elements (default: 0)
    n_elements: int
    #: shared library with the functions, relative to the namelist (required with n_elements)
    library: str
    #: name of the function, one for all or one for each element (required with n_elements)
    symbol: str | int | Sequence[str | int]
    #: displacements that each element takes (default: 1)
    n_in: int
    #: dofs of its inputs (required with n_elements)
    side_1: ArrayLike
    #: dofs on the other side, 0: ground (default: 0)
    side_2: ArrayLike
    #: constants that each function gets (default: 0)
    n_parameters: int
    #: the constants, n_par = n_parameters of each element (required with n_parameters)
    parameters: ArrayLike
    #: whether functions give slopes, or differences stand for them (default: 'given')
    derivative: Literal["given", "difference"]
    #: opposite motions have opposite forces: you promise it (default: .false.)
    odd: bool
    #: functions may be called from several threads (default: .false.)
    thread_safe: bool
    #: functions are tried before the run: slopes, symmetry, memory (default: .true.)
    check: bool
    #: what slopes and odd forces may be off, relative; only: check (default: 1e-5)
    check_tolerance: float


class Load(TypedDict, total=False):
    """Group &load: static and harmonic loads."""

    #: [F] constant load (default: of the file, else 0)
    static: ArrayLike
    #: [F] cosine part of the first harmonic (default: of the file, else 0)
    cosine: ArrayLike
    #: [F] sine part of the first harmonic (default: of the file, else 0)
    sine: ArrayLike
    #: loads on single dofs in any harmonic, added to the others (default: 0)
    n_terms: int
    #: dof, or n_dof and a row; negative: with its sign turned (required with n_terms)
    term_dof: ArrayLike
    #: harmonic, 0 to n_harmonics (default: 1, or by term_order)
    term_harmonic: ArrayLike
    #: engine orders in place of harmonics: the frequency of the sweep is their greatest common
    #: divisor times the speed (default: term_harmonic)
    term_order: ArrayLike
    #: [F] amplitude, over the frequency to term_power (required with n_terms)
    term_amplitude: ArrayLike
    #: [degrees] of cos(n omega t + phase) (default: 0)
    term_phase: ArrayLike
    #: times the frequency of the term [rad/s] to this power; 2: an unbalance (default: 0)
    term_power: ArrayLike
    #: points of a table by which all vibratory loads are multiplied; 0 switches that of a file off
    #: (default: of the file, else 0)
    n_table: int
    #: [rad/s] where the table has points, whatever sweep%unit, rising; linear between them, refused
    #: beyond (default: of the file, else required with n_table)
    table_frequency: ArrayLike
    #: factor of the loads there (default: of the file, else required with n_table)
    table_scale: ArrayLike
    #: multiplies the static load, that of rotation included (default: 1)
    static_scale: float
    #: multiplies all vibratory loads (default: 1)
    harmonic_scale: float


class Base(TypedDict, total=False):
    """Group &base: motion of the supports, or of the ground."""

    #: harmonic motions that add up (default: 0)
    n_terms: int
    #: supports, dofs that move alike; negative: the other way (default: of the file, else
    #: direction)
    dof: ArrayLike
    #: motion of all dofs with the ground, in place of dof (default: of the file)
    direction: ArrayLike
    #: what the amplitudes are of (default: 'displacement')
    motion: Literal["displacement", "velocity", "acceleration"]
    #: 0 to n_harmonics (default: 1)
    harmonic: ArrayLike
    #: [L] of each term, over the units of time to the first or second power for a velocity or an
    #: acceleration (required with n_terms)
    amplitude: ArrayLike
    #: [degrees] of cos(n omega t + phase) (default: 0)
    phase: ArrayLike
    #: what is observed: motion beside the base, or with it (supports alone) (default: 'relative')
    frame: Literal["relative", "absolute"]


class Harmonics(TypedDict, total=False):
    """Group &harmonics: method, number of harmonics, instants per period."""

    #: how the equations are weighted: Galerkin, collocation, least squares, or unknowns at the
    #: instants (default: 'hbm')
    method: Literal["hbm", "tcm", "tcm_least_squares", "hdhb"]
    #: H, the highest harmonic; with accuracy the most that may be used (default: 53 with accuracy,
    #: 7 with 'mode', 'resonance', &control, else 1)
    n_harmonics: int
    #: instants of a period, at least 2H+1; 0: chosen (default: 0)
    n_time: int
    #: instants of the equations; 0: twice the coefficients; only: method = 'tcm_least_squares'
    #: (default: 0)
    n_collocation: int
    #: harmonics above this one do not reach nonlinear springs; 0: no filter; only: method = 'hdhb'
    #: (default: 0)
    filter_harmonics: int
    #: decide stick, slip and separation at the instants, or locate them on the series (default:
    #: 'auto')
    sampling: Literal["uniform", "events", "auto"]
    #: which harmonics are kept; auto leaves even ones out where that is exact (default: 'auto')
    parity: Literal["auto", "all", "odd"]
    #: relative error of the response for which harmonics and instants are chosen; 0: as given;
    #: only: method = 'hbm', natural sweeps and points (default: 0)
    accuracy: float


_Sweep = TypedDict("_Sweep", {
    #: values of the parameter, or factors of those of the case; only: parameter other than
    #: 'frequency' (default: 'value')
    "as": Literal["value", "factor"],
}, total=False)


class Sweep(_Sweep, total=False):
    """Group &sweep: frequencies, or values of a parameter."""

    #: what the sweep goes over: start, end and values are of it; only: analysis = 'frf' (default:
    #: 'frequency')
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
    #: first frequency, or the only one (required)
    start: float
    #: last frequency; below start the sweep goes down (required for frf, else 0)
    end: float
    #: of frequencies, start and end; results are in rad/s (default: 'rad/s')
    unit: Literal["rad/s", "Hz"]
    #: points at given frequencies, or a branch through folds (default: 'natural')
    continuation: Literal["natural", "arclength"]
    #: points, evenly spaced, both ends included; of a branch: sets the first step (required for a
    #: natural frf, else 1)
    n_points: int
    #: points of a branch at most; only: continuation = 'arclength' (default: 1000)
    max_points: int
    #: compute the Floquet multipliers of every point; only: springs, law = 'penalty', 'regularised'
    #: (default: .false.)
    stability: bool
    #: the rotation speed is the frequency over this: 1 for unbalance, an engine order of the loads;
    #: 0: it does not follow; only: analysis = 'frf', 'point', 'population', 'resonance' (default:
    #: 0)
    speed_order: float
    #: points that are solved to find maxima become rows, in order; only: analysis = 'frf',
    #: continuation = 'natural' (default: .false.)
    refine: bool
    #: a list of values in any order, in place of start, end and n_points; only: analysis = 'frf',
    #: 'time', continuation = 'natural' (default: none)
    values: ArrayLike
    #: the one frequency of a sweep over another parameter (required with another parameter)
    frequency: float


class Solver(TypedDict, total=False):
    """Group &solver: nonlinear solver, tolerance."""

    #: Newton's method with a line search, MINPACK's hybrid method, KINSOL of SUNDIALS, or
    #: pseudo-time (default: 'newton')
    kind: Literal["newton", "powell", "kinsol", "pseudo_time"]
    #: how linear problems are solved; auto: by their size; only: kind = 'newton', 'pseudo_time'
    #: (default: 'auto')
    linear: Literal["auto", "lu", "krylov"]
    #: on the norm of the residual over that of the vibratory load (default: 1e-8)
    tolerance: float
    #: steps from each guess (default: 60)
    max_iterations: int
    #: [s] time after which a point counts as not converged; 0: none; along a branch that of the
    #: first point (default: 0)
    max_seconds: float
    #: try other ways where the first guess fails (default: .true.)
    fallback: bool
    #: leave out stuck pairs and components that nothing moves (default: .true.)
    skips: bool
    #: solutions of the point at most, which become rows by rising amplitude; above 1 further ones
    #: are searched for by deflation; only: analysis = 'point' (default: 1)
    n_solutions: int
    #: power of the distance by which known solutions repel; only: n_solutions > 1 (default: 2)
    deflation_power: float
    #: of the factor that repels, far from all known solutions; only: n_solutions > 1 (default: 1)
    deflation_shift: float


class PseudoTime(TypedDict, total=False):
    """Group &pseudo_time: pseudo-time integration."""

    #: P of P dU/dt* = -R(U): 2 i n omega M, the identity, or the linear joint with every pair
    #: closed (default: 'rotated')
    flow: Literal["rotated", "identity", "preconditioned"]
    #: steps by Newton's method, CVODE (wear: IDA), linearly implicit, or explicit (default:
    #: 'implicit_euler')
    scheme: Literal["implicit_euler", "bdf", "rosenbrock", "runge_kutta"]
    #: first step; 0: chosen by the scheme (default: 0)
    step: float
    #: Courant number; only: scheme = 'runge_kutta' (default: 0.8)
    cfl: float
    #: steps taken and refused (default: 500)
    max_steps: int


class Wear(TypedDict, total=False):
    """Group &wear: fretting wear."""

    #: depth by the rate at the start of a step, vibration and depth together, or linearly implicit
    #: (default: 'implicit')
    scheme: Literal["explicit", "implicit", "pseudo_time"]
    #: depth by pressure times slip, or by friction energy (default: 'archard')
    law: Literal["archard", "energy"]
    #: of the implicit scheme 1 to 4, of the explicit one 1 or 2; 0: chosen; only: scheme =
    #: 'implicit', 'explicit' (default: 0)
    order: int
    #: [L^2/F] k_w: depth is k_w times contact force times slip over area (required for wear)
    coefficient: ArrayLike
    #: cycles to be covered (default: none)
    n_cycles: float
    #: [L] largest growth of the depth in a step; 0: by the error alone (default: 0)
    max_depth_step: float
    #: largest estimated error of a step over the largest depth; 0: by max_depth_step, else 1e-3
    #: (default: 0)
    error_tolerance: float
    #: a joint is steady when its largest rate has fallen to this part of the largest so far
    #: (default: 1e-6)
    steady_tolerance: float
    #: steps at most (default: 1000)
    max_steps: int
    #: run once more with halved steps, to see how far the profile moves (default: .false.)
    check_steps: bool
    #: whether friction changes with the depth, or with the friction energy of its pair (default:
    #: 'none')
    mu_by: Literal["none", "depth", "energy"]
    #: friction coefficient that wear leads to; only: mu_by (required with mu_by)
    mu_final: ArrayLike
    #: [L or F L] depth or energy after which 1/e of the change is left; only: mu_by (required with
    #: mu_by)
    mu_scale: ArrayLike
    #: keep the frequency at the peak of the first observed quantity (default: .false.)
    follow_resonance: bool


class Mission(TypedDict, total=False):
    """Group &mission: wear over blocks of cycles in other conditions."""

    #: blocks of a flight; 0: no mission; only: analysis = 'wear' (default: 0)
    n_blocks: int
    #: cycles of each block in a flight (required with n_blocks)
    cycles: ArrayLike
    #: how often all blocks are flown (default: 1)
    n_flights: int
    #: what each block changes in the case, as --set takes it; several parted by semicolons
    #: (default: nothing)
    change: ArrayLike
    #: of each block (default: block 1, block 2, ..)
    name: ArrayLike
    #: flights that are taken together; 1: all in their order, 0: as many as wear%error_tolerance
    #: allows (default: 0)
    flights_per_jump: int


class Time(TypedDict, total=False):
    """Group &time: time integration."""

    #: periods integrated at most (default: 500)
    n_periods: int
    #: steps, at least max(16, 4H); also the instants of histories (default: 1000)
    steps_per_period: int


class Mode(TypedDict, total=False):
    """Group &mode: a nonlinear mode over its amplitude."""

    #: of the elastic modes of the structure with its closed pairs stuck (default: 1)
    number: int
    #: the mode whose frequency with stuck pairs is nearest, in place of number; 0: by number
    #: (default: 0)
    near: float
    #: of near; results are in rad/s (default: 'rad/s')
    unit: Literal["rad/s", "Hz"]
    #: [L] a rising list of amplitudes, in place of start, end and n_points; only: analysis =
    #: 'mode', natural steps (default: none)
    amplitudes: ArrayLike
    #: [L] lowest amplitude; only: analysis = 'mode' (required)
    start: float
    #: [L] highest amplitude; only: analysis = 'mode' (required)
    end: float
    #: what the amplitude is: of the first harmonic of the first observed quantity, or modal,
    #: sqrt(U^H M U) of it (default: 'observed')
    control: Literal["observed", "modal"]
    #: points, even in the logarithm; of a branch: sets its longest step (default: 40)
    n_points: int
    #: points at given amplitudes, or a branch through folds (default: 'arclength')
    continuation: Literal["natural", "arclength"]
    #: points of a branch at most; only: continuation = 'arclength' (default: 1000)
    max_points: int
    #: factors of the vibratory load for which the response near the resonance is put together
    #: (default: none)
    synthesis: ArrayLike


class Campbell(TypedDict, total=False):
    """Group &campbell: frequencies over the rotation speed, and where engine orders meet them."""

    #: [rad/s] lowest rotation speed; only: analysis = 'campbell' (required)
    start: float
    #: [rad/s] highest rotation speed; only: analysis = 'campbell' (required)
    end: float
    #: speeds, from start to end (default: 15)
    n_speeds: int
    #: engine orders, with the sign of cyclic%engine_order; none is 0; only: analysis = 'campbell'
    #: (required)
    orders: ArrayLike
    #: factor of the vibratory load, of all orders or of each (default: 1)
    order_scale: ArrayLike
    #: look for the maximum near each crossing, with friction (default: .true.)
    peaks: bool
    #: frequencies across each of them (default: 41)
    n_points: int


class Bounds(TypedDict, total=False):
    """Group &bounds: lowest and highest response over all residual tractions."""

    #: of which the range is looked for: of the first observed quantity, or of the pairs (default:
    #: 'first_harmonic')
    quantity: Literal["first_harmonic", "largest", "dissipation", "wear_volume"]
    #: residual tractions to start from: the centre, both ends of the gradient, and corners that are
    #: drawn (default: 4)
    n_starts: int


class Ringdown(TypedDict, total=False):
    """Group &ringdown: free decay from the shape of a mode."""

    #: of the elastic modes of the structure with its closed pairs stuck (default: 1)
    number: int
    #: [L] of the first observed quantity, from where it rests without vibration; only: analysis =
    #: 'ringdown' (required)
    amplitude: float
    #: periods of the stuck mode that are followed (default: 20)
    n_cycles: int
    #: steps of such a period; changes of stick and slip are located within (default: 2000)
    steps_per_period: int


class Stress(TypedDict, total=False):
    """Group &stress: stress and endurance of a cycle, of models with /stress."""

    #: amplitude and mean by the largest von Mises stress between two instants, or of that stress
    #: with the sign of its trace (default: 'range')
    method: Literal["range", "signed"]
    #: how amplitude and mean count together (default: 'goodman')
    diagram: Literal["goodman", "gerber"]
    #: [F/L^2] alternating stress that is endured (default: of the file, else no utilisation)
    endurance: ArrayLike
    #: [F/L^2] static strength (default: of the file, else no utilisation)
    ultimate: ArrayLike
    #: amplitude, mean and utilisation, Fourier coefficients of the components too, or nothing
    #: (default: 'points')
    output: Literal["points", "tensor", "none"]


class Output(TypedDict, total=False):
    """Group &output: result file, observed quantities."""

    #: result file, relative to the namelist (default: name of the namelist with .h5)
    file: str
    #: write one period of every quantity at every point; large (default: .false.)
    histories: bool
    #: write contact forces, states and dissipation (default: .true.)
    contact: bool
    #: highest harmonic of the answer that is given back, above those of the balance; 0: theirs;
    #: only: law = 'rigid' (default: 0)
    tail: int
    #: which displacements are written; a dof number k is called uk, n_dof + k rowk (default: all
    #: that the model file names, else every dof)
    observe: str | int | Sequence[str | int]


class Control(TypedDict, total=False):
    """Group &control: responses of given amplitudes."""

    #: [L] of the response: the factor of the vibratory load is found, at each frequency, for one
    #: after the other; only: analysis = 'frf', 'point' (default: none: the load is given)
    amplitude: ArrayLike
    #: what the amplitude is: of the first harmonic, or the largest of the period (default:
    #: 'first_harmonic')
    of: Literal["first_harmonic", "largest"]
    #: the quantity that has it, by the name that output%observe gives it; only: amplitude (default:
    #: the first one)
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
