"""The structure: matrices, contact pairs, springs, loads and what is observed."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array, dofs, text, whole
from ._identity import digest
from ._namelist import literal
from ._native import Session, unread_parts
from .elements import Elements, checked_elements, read_elements
from .errors import InputError, NotBuiltError, OutputError
from .loose_bodies import OF_PICTURES as PICTURES_OF_BODIES
from .loose_bodies import Bodies, read_bodies
from .mistuning import Mistuning, read_mistuning
from .model_file import FORMAT, strings, write_model_file
from .sectors import Sectors, read_sectors
from .speeds import read_speeds, speed_datasets
from .stress import OF_PICTURES, Stress, read_stress
from .user_law import Law

__all__ = ["ContactPairs", "Model", "Spring"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ContactPairs:
    """Points that face each other.

    A pair moves by ``u(side_1) - u(side_2)`` in its directions (t1, t2, n), n from side 2 to
    side 1: positive opens. Numbers are per pair, or one for all.

    Parameters
    ----------
    side_1, side_2 : (n_pairs, 3) int
        Signed dof numbers, counted from 1: a negative one takes the dof with its sign turned, 0
        is the ground or a direction that the pair does not have. side_2 is the ground by default.
    sector_2 : int or (n_pairs,), optional
        Of cyclic structures: sector of side 2, counted from that of side 1 (0 by default).
    mu : float or (n_pairs,), optional
        Friction coefficient [-].
    gap : float or (n_pairs,), optional
        Initial gap [length], 0 by default; negative for an interference.
    area : float or (n_pairs,), optional
        Area of a pair [length^2]; wear needs it.
    normal_load : float or (n_pairs,), optional
        Constant compressive force of pairs without a normal dof [force].
    gap_rotation, normal_load_rotation : float or (n_pairs,), optional
        What each square of the rotation speed adds to them [length s^2], [force s^2].
    slider_1, slider_2 : float or (n_pairs,), optional
        Displacement along t1 and t2 where an assembled pair is unstrained [length], 0 by default.
    residual : float or (n_pairs,), optional
        Residual traction of pairs that never slip, from -1 to 1: the lower and the upper end of
        what balances; of cases with `memory = 'residual'`.
    tangential_stiffness, normal_stiffness : float or (n_pairs,), optional
        Stiffness of the elastic law ('penalty') [force/length]; the tangential one also that of
        the laws of hysteresis ('iwan', 'bouc_wen') for the smallest motion.
    slip_speed : float or (n_pairs,), optional
        Sliding velocity of smooth friction ('regularised') [length/s].
    mu_dynamic, weakening_speed, weakening_exponent : float or (n_pairs,), optional
        Friction of fast sliding [-], the speed over which it is reached [length/s], and the
        exponent of the speed, 1 to 2 ('regularised').
    mu_viscous : float or (n_pairs,), optional
        What friction gains with the sliding speed [s/length] ('regularised').
    speed_1, speed_2 : float or (n_pairs,), optional
        Velocity of side 2 along t1 and t2 [length/s].
    sliding : str, optional
        How friction follows these: 'path' (default) or 'steady'.
    gap_harmonic : mapping, optional
        What an obstacle adds to the gap: harmonics 0, 1, .., with their cosine and sine parts, a
        pair of float or (n_pairs,) [length].
    iwan_chi, iwan_beta : float or (n_pairs,), optional
        Exponent of the sliding limits, above -1, and the stiffness that is lost at once where the
        last elements slip over that lost before ('iwan').
    bouc_wen_exponent, bouc_wen_beta : float or (n_pairs,), optional
        n, 1 or 2, and the shape of the loops, 0.5 to 1 ('bouc_wen').
    normal_law : str or sequence of str, optional
        How pairs with a normal dof press, one word or one each: 'unilateral', 'power',
        'exponential', 'table'.
    normal_coefficient, normal_exponent : float or (n_pairs,), optional
        Of 'power': pressure c d**e of the overclosure d [force/length^e], [-].
    reference_force, decay_length : float or (n_pairs,), optional
        Of 'exponential': pressure p_0 exp(d/h) [force], [length].
    table : (n_table, 2), optional
        Of 'table': overclosures in ascending order [length] and forces from 0 up [force].
    law : str or sequence of str, optional
        The law of the pairs where a case does not name one: 'penalty', 'rigid', ..., or that of
        each (n_pairs).
    position : (n_pairs, 3), optional
        Coordinates, for pictures [length].
    patch : sequence of str, optional
        The surface that each pair belongs to (n_pairs).
    """

    side_1: ArrayLike
    side_2: ArrayLike | None = None
    mu: ArrayLike | None = None
    gap: ArrayLike | None = None
    area: ArrayLike | None = None
    normal_load: ArrayLike | None = None
    tangential_stiffness: ArrayLike | None = None
    normal_stiffness: ArrayLike | None = None
    position: ArrayLike | None = None
    patch: Sequence[str] | None = None
    sector_2: ArrayLike | None = None
    slip_speed: ArrayLike | None = None
    mu_dynamic: ArrayLike | None = None
    weakening_speed: ArrayLike | None = None
    weakening_exponent: ArrayLike | None = None
    mu_viscous: ArrayLike | None = None
    speed_1: ArrayLike | None = None
    speed_2: ArrayLike | None = None
    iwan_chi: ArrayLike | None = None
    iwan_beta: ArrayLike | None = None
    bouc_wen_exponent: ArrayLike | None = None
    bouc_wen_beta: ArrayLike | None = None
    law: str | Sequence[str] | None = None
    normal_law: str | Sequence[str] | None = None
    normal_coefficient: ArrayLike | None = None
    normal_exponent: ArrayLike | None = None
    reference_force: ArrayLike | None = None
    decay_length: ArrayLike | None = None
    table: ArrayLike | None = None
    gap_rotation: ArrayLike | None = None
    normal_load_rotation: ArrayLike | None = None
    sliding: str | None = None
    gap_harmonic: Mapping[int, tuple[ArrayLike, ArrayLike]] | None = None
    slider_1: ArrayLike | None = None
    slider_2: ArrayLike | None = None
    residual: ArrayLike | None = None

    def checked(self, n_dof: int) -> ContactPairs:
        """The same with arrays that fit each other; raises InputError where they do not."""
        side_1 = dofs("contact.side_1", self.side_1, (None, 3), n_dof)
        n_pairs = len(side_1)
        side_2 = np.zeros_like(side_1) if self.side_2 is None else self.side_2
        values: dict[str, Any] = {
            name: None if getattr(self, name) is None else
            array(f"contact.{name}", getattr(self, name), (n_pairs,))
            for name in ("mu", "gap", "area", *_IN_NAMELIST)}
        values["law"] = _words("contact.law", self.law, n_pairs)
        values["normal_law"] = _words("contact.normal_law", self.normal_law, n_pairs)
        if self.sliding is not None:
            if self.sliding not in _SLIDES:
                raise InputError(f"contact.sliding: is {self.sliding!r}, must be 'path' or "
                                 "'steady'")
            values["sliding"] = self.sliding
        if self.gap_harmonic is not None:
            values["gap_harmonic"] = _gaps(self.gap_harmonic, n_pairs)
        if self.table is not None:
            values["table"] = array("contact.table", self.table, (None, 2))
        if self.sector_2 is not None:
            values["sector_2"] = _whole_numbers("contact.sector_2", self.sector_2, n_pairs)
        if self.position is not None:
            values["position"] = array("contact.position", self.position, (n_pairs, 3))
        if self.patch is not None:
            if isinstance(self.patch, str) or len(self.patch) != n_pairs:
                raise InputError(f"contact.patch: must be {n_pairs} names, one per pair")
            values["patch"] = tuple(str(name) for name in self.patch)
        return ContactPairs(side_1, dofs("contact.side_2", side_2, (n_pairs, 3), n_dof), **values)


@dataclass(frozen=True)
class Spring:
    """A nonlinear spring: force ``coefficient * u_r**power``, u_r = u(side_1) - u(side_2).

    Parameters
    ----------
    side_1, side_2 : int
        Signed dof numbers, counted from 1; 0 is the ground.
    coefficient : float
        [force/length^power]
    power : int
        1 is a linear spring, 3 a cubic one.
    sector_2 : int
        Of cyclic structures: sector of side 2, counted from that of side 1.
    """

    side_1: int
    side_2: int = 0
    coefficient: float = 0.0
    power: int = 3
    sector_2: int = 0


#: A number of a dof or a row, counted from 1, or a row of factors, one per dof.
Observation = Union[int, ArrayLike]


class Model:
    """A linear structure with contact pairs and nonlinear springs.

    ``M u'' + C u' + K u + B^T lambda = f_0 + f_c cos(omega t) + f_s sin(omega t)``. Any
    consistent units will do. Arrays are kept without a copy where they are float64 and
    Fortran-ordered, and not written to; the properties give read-only views.

    Parameters
    ----------
    M, K : (n_dof, n_dof)
        Mass and stiffness, symmetric; both may be singular. Here and in every other matrix, sparse
        ones of SciPy are taken and become dense; `fretwear.reduction` makes large ones small.
    C : (n_dof, n_dof), optional
        Viscous damping, symmetric; None for none here (a case may add modal or Rayleigh damping).
    contact : ContactPairs, optional
        Pairs in contact.
    springs : iterable of Spring, optional
        Nonlinear springs.
    elements : iterable of Elements, optional
        Other elements, such as a `Polynomial`: one of each kind.
    laws : iterable of Law, optional
        Elements whose forces are functions of your own.
    static, cosine, sine : (n_dof,), optional
        Loads [force].
    stiffness_rotation : (n_dof, n_dof), optional
        Stiffness per square of the rotation speed [force/length/(rad/s)^2].
    coriolis : (n_dof, n_dof), optional
        Coriolis matrix for each rad/s of the rotation speed, skew [force/length/(rad/s)^2].
    structural_damping : (n_dof, n_dof), optional
        Hysteretic damping, symmetric: i times it is added to the stiffness in harmonics above 0
        [force/length].
    circulatory : (n_dof, n_dof), optional
        Stiffness for each rad/s of the rotation speed, of any shape [force/length/(rad/s)].
    stiffness_unsymmetric, damping_unsymmetric : (n_dof, n_dof), optional
        Matrices of any shape that are added to stiffness and damping, as of bearings.
    static_rotation : (n_dof,), optional
        Static load per square of the rotation speed [force/(rad/s)^2].
    harmonic : mapping, optional
        Harmonic of further loads, 0, 1, .., with the parts in phase with its cosine and its sine,
        a pair of (n_dof,) [force].
    base_dof : sequence of int, optional
        Supports that the group &base of a case moves, signed dof numbers.
    base_direction : (n_dof,), optional
        In their place the motion of all dofs with the ground.
    load_table : (n_table, 2), optional
        Frequencies [rad/s], and what multiplies all vibratory loads there.
    stress : Stress, optional
        Rows that give the stress at points, and what these endure.
    mistuning : Mistuning, optional
        How sectors differ, for cases with ``cyclic%mistuned``.
    sectors : Sectors, optional
        Makes the model one of equal sectors around an axis. With matrices of nodal diameters M, C
        and K are None.
    speeds : mapping, optional
        2 to 4 rotation speeds [rad/s], each with the stiffness (n_dof, n_dof) there, or with a
        pair of it and of a static load (n_dof,); polynomials in the square of the speed go through
        them. In place of stiffness_rotation and static_rotation; K may be None then.
    rows : (n_rows, n_dof), optional
        Displacements that are combinations of dofs: sides, `observe` and elements name them by the
        numbers n_dof + 1, n_dof + 2, ..
    bodies : Bodies, optional
        Bodies that no spring holds; `fretwear.damper` makes them.
    reduction : pair of floats, optional
        Up to which frequency [Hz] the model was reduced to an accuracy, and the estimated error of
        the stiffness of the joint there; runs beyond it are remarked on.
    observe : mapping, optional
        Name of every observed quantity, with a dof number, counted from 1, or with a row of
        factors (n_dof,). Every dof without it.
    title, unit_system : str, optional
        Texts for people.

    Raises
    ------
    InputError
        An argument has the wrong shape or type, or holds what is not finite. Symmetry and
        definiteness are checked when a case is read.
    """

    def __init__(self, M: ArrayLike | None, C: ArrayLike | None, K: ArrayLike | None, *,
                 contact: ContactPairs | None = None, springs: Iterable[Spring] = (),
                 elements: Iterable[Elements] = (), laws: Iterable[Law] = (),
                 static: ArrayLike | None = None, cosine: ArrayLike | None = None,
                 sine: ArrayLike | None = None, stiffness_rotation: ArrayLike | None = None,
                 static_rotation: ArrayLike | None = None, sectors: Sectors | None = None,
                 observe: Mapping[str, Observation] | None = None,
                 harmonic: Mapping[int, tuple[ArrayLike, ArrayLike]] | None = None,
                 coriolis: ArrayLike | None = None,
                 structural_damping: ArrayLike | None = None,
                 circulatory: ArrayLike | None = None,
                 stiffness_unsymmetric: ArrayLike | None = None,
                 damping_unsymmetric: ArrayLike | None = None,
                 base_dof: ArrayLike | None = None, base_direction: ArrayLike | None = None,
                 load_table: ArrayLike | None = None, stress: Stress | None = None,
                 mistuning: Mistuning | None = None,
                 speeds: Mapping[float, Any] | None = None,
                 reduction: tuple[float, float] | None = None,
                 rows: ArrayLike | None = None, bodies: Bodies | None = None,
                 title: str = "", unit_system: str = "") -> None:
        if sectors is not None and not isinstance(sectors, Sectors):
            raise InputError(f"sectors: is a {type(sectors).__name__}, must be Sectors")
        n = self.n_dof = _order(M, C, M if K is None and speeds is not None else K, sectors)
        if n == 0:
            raise InputError("K: is empty, must have at least one degree of freedom")
        self._matrices = {
            name: array(argument, value, (n, n)) for name, argument, value in (
                ("stiffness", "K", K), ("mass", "M", M), ("damping", "C", C),
                ("stiffness_rotation", "stiffness_rotation", stiffness_rotation),
                ("coriolis", "coriolis", coriolis),
                ("structural_damping", "structural_damping", structural_damping),
                ("circulatory", "circulatory", circulatory),
                ("stiffness_unsymmetric", "stiffness_unsymmetric", stiffness_unsymmetric),
                ("damping_unsymmetric", "damping_unsymmetric", damping_unsymmetric))
            if value is not None}
        self._loads = {
            name: array(name, value, (n,)) for name, value in (
                ("static", static), ("cosine", cosine), ("sine", sine),
                ("static_rotation", static_rotation)) if value is not None}
        self._harmonic = _waves({} if harmonic is None else harmonic, n)
        if base_dof is not None and base_direction is not None:
            raise InputError("base_direction: is given beside base_dof, must be one of both")
        #: What the group &base moves, and the table of the load, by their names in a model file.
        self._moved: dict[str, NDArray[Any]] = {}
        if base_dof is not None:
            self._moved["base/dof"] = dofs("base_dof", base_dof, (None,), n)
        if base_direction is not None:
            self._moved["base/direction"] = array("base_direction", base_direction, (n,))
        if load_table is not None:
            self._moved["load/table"] = np.ascontiguousarray(
                array("load_table", load_table, (None, 2)))
        if rows is not None:
            self._moved["row/matrix"] = np.ascontiguousarray(array("rows", rows, (None, n)))
        #: Numbers that sides may have: dofs, and the rows behind them.
        sides = n + len(self._moved.get("row/matrix", ()))
        if contact is not None and not isinstance(contact, ContactPairs):
            raise InputError(f"contact: is a {type(contact).__name__}, must be ContactPairs")
        self.contact = None if contact is None else contact.checked(sides)
        self.springs = tuple(springs)
        for number, spring in enumerate(self.springs):
            if not isinstance(spring, Spring):
                raise InputError(f"springs[{number}]: is a {type(spring).__name__}, must be a "
                                 "Spring")
            dofs(f"springs[{number}]", [spring.side_1, spring.side_2], (2,), sides)
            array(f"springs[{number}].coefficient", spring.coefficient, ())
        self.elements = checked_elements(elements, sides)
        laws = tuple(laws)
        for number, law in enumerate(laws):
            if not isinstance(law, Law):
                raise InputError(f"laws[{number}]: is a {type(law).__name__}, must be a Law")
        self.laws = tuple(law.checked(number, sides) for number, law in enumerate(laws))
        if bodies is not None and not isinstance(bodies, Bodies):
            raise InputError(f"bodies: is a {type(bodies).__name__}, must be Bodies")
        self.bodies = None if bodies is None else bodies.checked(n)
        self.sectors = None if sectors is None else sectors.checked(n)
        if stress is not None and not isinstance(stress, Stress):
            raise InputError(f"stress: is a {type(stress).__name__}, must be Stress")
        self.stress = None if stress is None else stress.checked(n)
        if mistuning is not None and not isinstance(mistuning, Mistuning):
            raise InputError(f"mistuning: is a {type(mistuning).__name__}, must be Mistuning")
        if mistuning is not None and self.sectors is None:
            raise InputError("mistuning: is given without sectors, must have Sectors beside it")
        self.mistuning = (None if mistuning is None or self.sectors is None
                          else mistuning.checked(n, self.sectors.n_sectors))
        if reduction is not None:
            self._moved.update(zip(_REDUCTION, array("reduction", reduction, (2,)).reshape(2, 1)))
        #: Datasets of matrices at several speeds.
        self._speeds = {} if speeds is None else speed_datasets(speeds, n)
        self._observe = None if observe is None else _rows(observe, self.rows, n)
        if observe is not None and self._diameter_names() is not None:
            raise InputError("observe: is given beside rows of nodal diameters, must be one of "
                             "both")
        self.title, self.unit_system = text("title", title), text("unit_system", unit_system)

    def __repr__(self) -> str:
        title = f" {self.title!r}" if self.title else ""
        return (f"<Model{title}: {self.n_dof} dofs, {self.n_pairs} pairs, "
                f"{len(self.springs)} springs>")

    # ------------------------------------------------------------------ what it consists of

    @property
    def M(self) -> Floats:
        """Mass (n_dof, n_dof), read-only."""
        return self._matrix("mass")

    @property
    def C(self) -> Floats | None:
        """Viscous damping (n_dof, n_dof), read-only; None for none."""
        found = self._matrices.get("damping")
        return None if found is None else _read_only(found)

    @property
    def K(self) -> Floats:
        """Stiffness (n_dof, n_dof), read-only."""
        return self._matrix("stiffness")

    def _matrix(self, name: str) -> Floats:
        if name not in self._matrices:
            raise InputError(f"{name}: is that of nodal diameters, see sectors.diameters")
        return _read_only(self._matrices[name])

    @property
    def stiffness_rotation(self) -> Floats | None:
        """Stiffness per square of the rotation speed (n_dof, n_dof), read-only; None for none."""
        found = self._matrices.get("stiffness_rotation")
        return None if found is None else _read_only(found)

    @property
    def coriolis(self) -> Floats | None:
        """Coriolis matrix per rotation speed (n_dof, n_dof), read-only; None for none."""
        return self._any("coriolis")

    @property
    def structural_damping(self) -> Floats | None:
        """Hysteretic damping (n_dof, n_dof), read-only; None for none."""
        return self._any("structural_damping")

    @property
    def circulatory(self) -> Floats | None:
        """Stiffness per rotation speed (n_dof, n_dof), read-only; None for none."""
        return self._any("circulatory")

    @property
    def stiffness_unsymmetric(self) -> Floats | None:
        """What is added to the stiffness (n_dof, n_dof), read-only; None for none."""
        return self._any("stiffness_unsymmetric")

    @property
    def damping_unsymmetric(self) -> Floats | None:
        """What is added to the damping (n_dof, n_dof), read-only; None for none."""
        return self._any("damping_unsymmetric")

    def _any(self, name: str) -> Floats | None:
        found = self._matrices.get(name)
        return None if found is None else _read_only(found)

    @property
    def static(self) -> Floats:
        """Static load (n_dof,), read-only [force]."""
        return self._load("static")

    @property
    def cosine(self) -> Floats:
        """Load in phase with cos(omega t) (n_dof,), read-only [force]."""
        return self._load("cosine")

    @property
    def sine(self) -> Floats:
        """Load in phase with sin(omega t) (n_dof,), read-only [force]."""
        return self._load("sine")

    @property
    def harmonic(self) -> dict[int, tuple[Floats, Floats]]:
        """Cosine and sine parts (n_dof,) of further loads by their harmonic, read-only [force]."""
        return {n: (_read_only(cosine), _read_only(sine))
                for n, (cosine, sine) in self._harmonic.items()}

    @property
    def static_rotation(self) -> Floats:
        """Static load per square of the rotation speed (n_dof,), read-only."""
        return self._load("static_rotation")

    def _load(self, name: str) -> Floats:
        return _read_only(self._loads.get(name, np.zeros(self.n_dof)))

    @property
    def n_pairs(self) -> int:
        """Contact pairs."""
        return 0 if self.contact is None else len(np.asarray(self.contact.side_1))

    @property
    def rows(self) -> Floats:
        """Displacements that are combinations of dofs (n_rows, n_dof), read-only."""
        return _read_only(self._moved.get("row/matrix", np.zeros((0, self.n_dof))))

    @property
    def observe(self) -> dict[str, Floats] | None:
        """Row of factors (n_dof,) of every observed quantity; None for every dof."""
        if self._observe is None:
            return None
        names, rows = self._observe
        return {name: _read_only(row) for name, row in zip(names, rows)}

    # ------------------------------------------------------------------ model files

    @classmethod
    def from_hdf5(cls, path: str | Path) -> Model:
        """Read a model file (format "fretwear-model").

        Parameters
        ----------
        path : str or Path
            Model file.

        Raises
        ------
        OutputError
            The file cannot be read.
        InputError
            It is no model file, or what it holds does not fit, or is nothing that is read.

        Warns
        -----
        UserWarning
            The file holds data beside the model, which are left out.
        """
        try:
            file = h5py.File(path, "r")
        except OSError as error:
            reason = str(error) if Path(path).exists() else "there is no such file"
            raise OutputError(f"{path}: cannot be read: {reason}") from None
        with file:
            kind = _text(file.attrs.get("format", ""))
            if kind != FORMAT:
                raise InputError(f"{path}: format is '{kind}', expected '{FORMAT}'")
            _warn_of_strangers(path)
            for name in ("mass", "stiffness"):
                if name == "stiffness" and "speed" in file:
                    continue
                if name not in file and "nodal_diameter" not in file:
                    raise InputError(f"{path}: dataset /{name} is missing")
            found = {name: file[name][()] for name in (
                "mass", "stiffness", "damping", "stiffness_rotation", *_MATRICES,
                *_CONTACT, *_LOADS, "contact/law", "contact/normal_law", "contact/table", *_GAPS,
                "base/dof", "base/direction", "load/table", "row/matrix",
                *(f"contact/{name}" for name in _IN_NAMELIST)) if name in file}
            loads: dict[str, Any] = {argument: found.get(name) for name, argument in _LOADS.items()}
            loads.update((name, found.get(name)) for name in _MATRICES)
            try:
                return cls(
                    found.get("mass"), found.get("damping"), found.get("stiffness"),
                    contact=_contact_of(found, file), observe=_observed_of(file), **loads,
                    springs=_springs_of(file), elements=read_elements(file),
                    sectors=read_sectors(file), harmonic=_waves_of(file),
                    stiffness_rotation=found.get("stiffness_rotation"),
                    base_dof=found.get("base/dof"), base_direction=found.get("base/direction"),
                    load_table=found.get("load/table"), stress=read_stress(file),
                    mistuning=read_mistuning(file), speeds=read_speeds(file),
                    reduction=_reduction_of(file), rows=found.get("row/matrix"),
                    bodies=read_bodies(file),
                    title=_text(file.attrs.get("title", "")),
                    unit_system=_text(file.attrs.get("unit_system", "")))
            except InputError as error:
                raise InputError(f"{path}: {error}") from None

    def to_hdf5(self, path: str | Path) -> None:
        """Write a model file (format "fretwear-model").

        Parameters
        ----------
        path : str or Path
            Target; an older file of that name is replaced once the new one is complete.

        Raises
        ------
        InputError
            A name has letters that are not ASCII.
        OutputError
            The file cannot be written.
        """
        if self.laws:
            raise InputError("laws: are functions, which no model file holds; make a library of "
                             "them (group &user), or leave them out")
        pairs = {f"contact/{name}": values for name in _IN_NAMELIST
                 if (values := getattr(self.contact, name, None)) is not None}
        try:
            groups: dict[str, dict[str, int | str]] = {}
            if self.sectors is not None:
                groups["cyclic"] = dict(self.sectors.attributes())
            for name in ("law", "normal_law"):
                words = getattr(self.contact, name, None)
                if isinstance(words, str):
                    groups.setdefault("contact", {})[name] = words
                elif words is not None:
                    pairs[f"contact/{name}"] = strings(words)
            if (word := getattr(self.contact, "sliding", None)) is not None:
                groups.setdefault("contact", {})["sliding"] = word
            if (table := getattr(self.contact, "table", None)) is not None:
                pairs["contact/table"] = table
            if self.mistuning is not None:
                groups.update((group, {"kind": kind}) for group, kind in
                              self.mistuning.attributes().items())
            groups.update((one.group, dict(words)) for one in self.elements
                          if (words := one.attributes()))
            write_model_file(path, {**self._datasets(), **pairs, **self._spring_datasets()},
                             title=self.title, unit_system=self.unit_system, groups=groups)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written: {error}") from None

    #: The same, as results have it.
    save = to_hdf5

    def identity(self) -> str:
        """Hash of all that the model consists of."""
        found: list[str | bytes] = []
        for name, value in sorted({**self._datasets(), **self._spring_datasets()}.items()):
            values = np.asarray(value)
            found += [name, repr(values.shape), repr(values.tolist())
                      if values.dtype.kind == "O" else np.ascontiguousarray(values).tobytes()]
        return digest(found)

    def _spring_datasets(self) -> dict[str, NDArray[Any]]:
        """The springs as a model file has them."""
        if not self.springs:
            return {}
        return {f"spring/{name}": np.array([getattr(spring, name) for spring in self.springs])
                for name in _SPRING}

    def _datasets(self) -> dict[str, NDArray[Any]]:
        """What a session takes as parts of a model, by the names in a model file."""
        found: dict[str, NDArray[Any]] = {**self._matrices, **self._speeds, **self._moved}
        found.update((name, self._loads[argument]) for name, argument in _LOADS.items()
                     if argument in self._loads)
        if self._harmonic:
            found["load/harmonic"] = np.array(list(self._harmonic), dtype=np.int64)
            for i, name in enumerate(("cosine", "sine")):
                found[f"load/harmonic_{name}"] = np.array(
                    [parts[i] for parts in self._harmonic.values()])
        if self.contact is not None:
            for name in _CONTACT:
                value = getattr(self.contact, name.split("/")[1])
                if value is not None:
                    found[name] = strings(value) if name == "contact/patch" else value
            if self.contact.gap_harmonic:
                found["contact/gap_harmonic"] = np.array(list(self.contact.gap_harmonic),
                                                         dtype=np.int64)
                for i, part in enumerate(("cosine", "sine")):
                    found[f"contact/gap_{part}"] = np.array(
                        [parts[i] for parts in self.contact.gap_harmonic.values()])
        for one in self.elements:
            found.update(one.datasets())
        if self.sectors is not None:
            found.update(self.sectors.datasets())
        if self.stress is not None:
            found.update(self.stress.datasets())
        if self.mistuning is not None:
            found.update(self.mistuning.datasets())
        if self.bodies is not None:
            found.update(self.bodies.datasets())
        if self._observe is not None:
            found["observe/name"] = strings(self._observe[0])
            found["observe/matrix"] = self._observe[1]
        elif (names := self._diameter_names()) is not None:
            found["observe/name"] = strings(names)
        return found

    def _diameter_names(self) -> tuple[str, ...] | None:
        return None if self.sectors is None else self.sectors.names()

    # ------------------------------------------------------------------ to the library

    def give_to(self, session: Session) -> tuple[tuple[str, str], ...]:
        """Hand the model to a session; returns the keys that say the rest of it."""
        session.new_model(self.n_dof, self.n_pairs)
        if self.sectors is not None:
            session.put("cyclic/n_sectors", np.array([self.sectors.n_sectors], dtype=np.int32))
        for name, values in self._datasets().items():
            if name.removeprefix("stress/") in OF_PICTURES or name in PICTURES_OF_BODIES:
                continue
            if not name.startswith("observe/") and values.dtype.kind in "if":
                session.put(name, values)
        for one in self.elements:
            for name, word in one.attributes().items():
                session.put_texts(f"{one.group}/{name}", [word])
        if self.mistuning is not None:
            for group, kind in self.mistuning.attributes().items():
                session.put_texts(f"{group}/kind", [kind])
        for law in self.laws:
            session.add_law(law)
        if self.bodies is not None:
            session.put_texts("body/name", list(self.bodies.name))
        for name in ("title", "unit_system"):
            if getattr(self, name):
                session.put_texts(name, [getattr(self, name)])
        if self._observe is not None:
            session.observe(self._observe[0], self._observe[1].T)
        elif (names := self._diameter_names()) is not None:
            session.observe(names, np.zeros((0, len(names)), order="F"))
        settings = self._spring_settings()
        if self.contact is not None:
            if self.contact.patch is not None:
                session.put_texts("contact/patch", self.contact.patch)
            settings += [(f"contact%{name}", literal(getattr(self.contact, name)))
                         for name in ("law", "normal_law", "sliding", *_IN_NAMELIST)
                         if getattr(self.contact, name) is not None]
            if self.contact.table is not None:
                table = np.asarray(self.contact.table)
                settings += [("contact%n_table", literal(len(table))),
                             ("contact%overclosure", literal(table[:, 0])),
                             ("contact%force", literal(table[:, 1]))]
        return tuple(settings)

    def _spring_settings(self) -> list[tuple[str, str]]:
        if not self.springs:
            return []
        return [("spring%n_springs", literal(len(self.springs)))] + [
            (f"spring%{name}", literal([getattr(spring, name) for spring in self.springs]))
            for name in _SPRING]


#: Matrices that are arguments of their own names.
_MATRICES = ("coriolis", "structural_damping", "circulatory", "stiffness_unsymmetric",
             "damping_unsymmetric")
_REDUCTION = ("reduction/frequency", "reduction/error")
_SPRING = ("side_1", "side_2", "sector_2", "coefficient", "power")
_CONTACT = tuple(f"contact/{name}" for name in (
    "side_1", "side_2", "sector_2", "mu", "gap", "area", "position", "patch"))
#: Constants that a session takes as keys, so that one of another law is refused.
_SLIDING = ("slip_speed", "mu_dynamic", "weakening_speed", "weakening_exponent", "mu_viscous",
            "speed_1", "speed_2")
_GAPS = ("contact/gap_harmonic", "contact/gap_cosine", "contact/gap_sine")
_SLIDES = ("path", "steady")
_HYSTERESIS = ("iwan_chi", "iwan_beta", "bouc_wen_exponent", "bouc_wen_beta")
_PRESSING = ("normal_coefficient", "normal_exponent", "reference_force", "decay_length")
_IN_NAMELIST = ("normal_load", "gap_rotation", "normal_load_rotation", "slider_1", "slider_2",
                "residual",
                "tangential_stiffness", "normal_stiffness", *_PRESSING, *_SLIDING, *_HYSTERESIS)
_LOADS = {"load/static": "static", "load/cosine": "cosine", "load/sine": "sine",
          "load/static_rotation": "static_rotation"}


def _order(M: ArrayLike | None, C: ArrayLike | None, K: ArrayLike | None,
           sectors: Sectors | None) -> int:
    """Number of dofs: that of two of the three matrices, so that the third is refused."""
    if sectors is not None and sectors.diameters is not None:
        if not (M is None and C is None and K is None):
            raise InputError("M, C and K: are given beside sectors.diameters, must be None")
        if sectors.n_physical is None:
            raise InputError("sectors.n_physical: is missing, must be the number of displacements "
                             "in front of the coordinates of all nodal diameters")
        return whole("sectors.n_physical", sectors.n_physical, 1)
    if M is None or K is None:
        raise InputError("M and K: are None, must be matrices, or sectors must have diameters")
    mass, stiffness = len(array("M", M, (None, None))), len(array("K", K, (None, None)))
    if C is None and mass != stiffness:
        raise InputError(f"M and K: are of order {mass} and {stiffness}, must be the same")
    return stiffness if C is not None and np.shape(C) == (stiffness, stiffness) else mass


def _gaps(harmonic: Mapping[int, tuple[ArrayLike, ArrayLike]],
          n_pairs: int) -> dict[int, tuple[Floats, Floats]]:
    """Cosine and sine parts of gaps by their harmonics."""
    if not isinstance(harmonic, Mapping):
        raise InputError(f"contact.gap_harmonic: is a {type(harmonic).__name__}, must be a "
                         "dictionary of harmonics")
    found = {}
    for n, parts in harmonic.items():
        if not isinstance(n, (int, np.integer)) or n < 0:
            raise InputError(f"contact.gap_harmonic, a key: is {n!r}, must be 0, 1, 2, ..")
        if not isinstance(parts, (tuple, list, np.ndarray)) or len(parts) != 2:
            raise InputError(f"contact.gap_harmonic[{n}]: must be a pair of gaps, cosine and sine")
        cosine, sine = (array(f"contact.gap_harmonic[{n}]", part, (n_pairs,)) for part in parts)
        found[int(n)] = cosine, sine
    return found


def _waves(harmonic: Mapping[int, tuple[ArrayLike, ArrayLike]],
           n_dof: int) -> dict[int, tuple[Floats, Floats]]:
    if not isinstance(harmonic, Mapping):
        raise InputError(f"harmonic: is a {type(harmonic).__name__}, must be a dictionary of "
                         "harmonics")
    found = {}
    for n, parts in harmonic.items():
        if not isinstance(n, (int, np.integer)) or n < 0:
            raise InputError(f"harmonic, a key: is {n!r}, must be 0, 1, 2, ..")
        if not isinstance(parts, (tuple, list, np.ndarray)) or len(parts) != 2:
            raise InputError(f"harmonic[{n}]: must be a pair of loads, cosine and sine")
        cosine, sine = parts
        found[int(n)] = (array(f"harmonic[{n}], cosine", cosine, (n_dof,)),
                         array(f"harmonic[{n}], sine", sine, (n_dof,)))
    return found


def _reduction_of(file: h5py.File) -> tuple[float, float] | None:
    if not all(name in file for name in _REDUCTION):
        return None
    frequency, error = (float(np.ravel(file[name][()])[0]) for name in _REDUCTION)
    return frequency, error


def _waves_of(file: h5py.File) -> dict[int, tuple[ArrayLike, ArrayLike]] | None:
    if "load/harmonic" not in file:
        return None
    harmonics = file["load/harmonic"][()]
    shapes = [file[name].shape for part in ("cosine", "sine")
              if (name := f"load/harmonic_{part}") in file]
    zero = np.zeros(shapes[0] if shapes else (len(harmonics), 0))
    cosine, sine = (file[name][()] if (name := f"load/harmonic_{part}") in file else zero
                    for part in ("cosine", "sine"))
    found: dict[int, tuple[ArrayLike, ArrayLike]] = {}
    for n, *parts in zip(harmonics, cosine, sine):
        # The same harmonic may stand in the file more than once.
        before = found.get(int(n), (0.0, 0.0))
        found[int(n)] = (np.asarray(before[0]) + parts[0], np.asarray(before[1]) + parts[1])
    return found


def _rows(observe: Mapping[str, Observation], of_model: Floats,
          n_dof: int) -> tuple[tuple[str, ...], Floats]:
    if not isinstance(observe, Mapping):
        raise InputError(f"observe: is a {type(observe).__name__}, must be a dictionary of names")
    rows = np.zeros((len(observe), n_dof), order="F")
    for i, (name, wanted) in enumerate(observe.items()):
        text("observe, a name", name)
        argument = f"observe['{name}']"
        if isinstance(wanted, (int, np.integer)):
            if not 1 <= wanted <= n_dof + len(of_model):
                raise InputError(f"{argument} = {wanted}: must be a dof from 1 to {n_dof}, or a "
                                 f"row behind them, up to {n_dof + len(of_model)}")
            if wanted > n_dof:
                rows[i] = of_model[wanted - n_dof - 1]
            else:
                rows[i, wanted - 1] = 1.0
        else:
            rows[i] = array(argument, wanted, (n_dof,))
    return tuple(observe), rows


def _springs_of(file: h5py.File) -> list[Spring]:
    if "spring" not in file:
        return []
    group = file["spring"]
    for name in ("side_1", "coefficient"):
        if name not in group:
            raise InputError(f"dataset /spring/{name} is missing")
    n = group["side_1"].shape
    values = {}
    for name in (name for name in _SPRING if name in group):
        if group[name].shape not in ((), n):
            raise InputError(f"dataset /spring/{name}: has shape {group[name].shape}, expected {n}")
        values[name] = np.broadcast_to(group[name][()], n).tolist()
    return [Spring(**dict(zip(values, row))) for row in zip(*values.values())]


def _contact_of(found: Mapping[str, Any], file: h5py.File) -> ContactPairs | None:
    if "contact/side_1" not in found:
        return None
    parts = {name: found.get(f"contact/{name}") for name in (
        "side_2", "sector_2", "mu", "gap", "area", "position", *_IN_NAMELIST)}
    patch = found.get("contact/patch")
    names = None if patch is None else [_text(name) for name in patch]
    words: dict[str, Any] = {}
    for name in ("law", "normal_law"):
        if name in file["contact"].attrs:
            words[name] = _text(file["contact"].attrs[name])
        elif f"contact/{name}" in found:
            words[name] = [_text(word) for word in found[f"contact/{name}"]]
    if "sliding" in file["contact"].attrs:
        words["sliding"] = _text(file["contact"].attrs["sliding"])
    return ContactPairs(found["contact/side_1"], **parts, patch=names,
                        gap_harmonic=_gaps_of(found), table=found.get("contact/table"), **words)


def _gaps_of(found: Mapping[str, Any]) -> dict[int, tuple[Floats, Floats]] | None:
    harmonics, cosine, sine = (found.get(name) for name in _GAPS)
    if harmonics is None:
        return None
    some = cosine if sine is None else sine
    if some is None:
        raise InputError("dataset /contact/gap_harmonic: needs /contact/gap_cosine or gap_sine")
    none = np.zeros_like(some)
    return {int(n): (none[i] if cosine is None else cosine[i], none[i] if sine is None else sine[i])
            for i, n in enumerate(harmonics)}


def _words(name: str, words: str | Sequence[str] | None,
           n_pairs: int) -> str | tuple[str, ...] | None:
    """One word for all pairs, or one for each."""
    if words is None or isinstance(words, str):
        return None if words is None else text(name, words)
    if len(words) != n_pairs:
        raise InputError(f"{name}: must be one word, or {n_pairs}, one per pair")
    return tuple(text(name, word) for word in words)


def _whole_numbers(name: str, values: ArrayLike, n: int) -> NDArray[np.int64]:
    """One for each of n, or one for all."""
    found = np.asarray(values)
    if found.dtype.kind not in "iu" or found.shape not in ((), (n,)):
        raise InputError(f"{name}: must be a whole number, or {n} of them")
    return np.array(np.broadcast_to(found, (n,)), dtype=np.int64)


def _observed_of(file: h5py.File) -> dict[str, Observation] | None:
    if "observe/matrix" not in file and "observe/dof" not in file:
        return None
    names = [_text(name) for name in file["observe/name"][()]]
    if "observe/matrix" in file:
        return dict(zip(names, file["observe/matrix"][()]))
    return {name: int(dof) for name, dof in zip(names, file["observe/dof"][()])}


def _read_only(values: Floats) -> Floats:
    view = values.view()
    view.flags.writeable = False
    return view


def _warn_of_strangers(path: str | Path) -> None:
    """What nothing reads, as a run tells it."""
    try:
        names = unread_parts(str(path))
    except NotBuiltError:
        return   # nothing can be run with the model either
    if names:
        warnings.warn(f"{path}: holds {', '.join(names)}, which nothing reads", stacklevel=3)


def _text(value: object) -> str:
    return (value.decode() if isinstance(value, bytes) else str(value)).strip()
