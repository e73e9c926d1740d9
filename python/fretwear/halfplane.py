"""A cylinder on a flat, by the compliance of half-planes: the fretting test in two dimensions.

    python -m fretwear.halfplane --tangential-load 7.4 -o partial_slip.h5
    python -m fretwear.halfplane --displacement 0.0125 -o gross_slip.h5

Cylinder and flat are of one material, so that pressures move the surfaces along the normal alone,
and tractions along the tangent alone. The surfaces are cells of equal width with uniform tractions;
a cell is a contact pair, its relative displacements along both directions are the dofs, and the
stiffness is the inverse of the compliance of the half-planes. The cylinder is rigid beyond that: it
has an approach, under the load that presses it, and moves to and fro, under a tangential load or by
a given amplitude. All loads are those of a unit of length.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array, whole
from ._words import near_options
from .errors import FretwearError, InputError
from .model import ContactPairs, Model

__all__ = ["Cells", "Cylinder", "PartialSlip", "gross_slip", "main", "partial_slip"]

Floats = NDArray[np.float64]

#: The grid of gross slip, in half widths of the unworn contact.
_REACH = 8.0
#: The grid of partial slip, over the half width of the scar that is left in the end.
_BEYOND_THE_SCAR = 1.5
_USAGE, _NOT_WRITTEN = 2, 5


@dataclass(frozen=True)
class Cylinder:
    """A cylinder that is pressed on a flat of the same material.

    Parameters
    ----------
    radius : float
        [length]
    young, poisson : float
        Modulus [force/length^2] and Poisson's ratio of both bodies.
    load : float
        That presses them together [force/length].
    mu : float
        Friction coefficient [-].
    """

    radius: float = 6.0
    young: float = 200e3
    poisson: float = 0.3
    load: float = 18.5
    mu: float = 0.8

    def __post_init__(self) -> None:
        for name in ("radius", "young", "load", "mu"):
            _positive(name, getattr(self, name))
        if not -1.0 < self.poisson <= 0.5:
            raise InputError(f"poisson: is {self.poisson:g}, must be above -1 and at most 0.5")

    @property
    def contact_modulus(self) -> float:
        """E* [force/length^2], of two bodies alike."""
        return self.young / (2.0 * (1.0 - self.poisson**2))

    @property
    def half_width(self) -> float:
        """Of the unworn contact, by Hertz [length]."""
        return math.sqrt(4.0 * self.load * self.radius / (math.pi * self.contact_modulus))

    @property
    def largest_pressure(self) -> float:
        """In the middle of the unworn contact [force/length^2]."""
        return 2.0 * self.load / (math.pi * self.half_width)

    def gap(self, x: ArrayLike) -> Floats:
        """Between the unworn surfaces where they touch in one point [length]."""
        return np.asarray(x, dtype=float)**2 / (2.0 * self.radius)


@dataclass(frozen=True)
class Cells:
    """Equal cells on both sides of the middle of the contact.

    Parameters
    ----------
    n : int
    width : float
        Of a cell [length].
    """

    n: int
    width: float

    def __post_init__(self) -> None:
        whole("n", self.n, 2)
        _positive("width", self.width)

    @property
    def place(self) -> Floats:
        """Middles of the cells [length] (n,)."""
        return np.asarray(np.arange(self.n) - 0.5 * (self.n - 1), dtype=np.float64) * self.width

    def compliance(self, contact_modulus: float, datum: float) -> Floats:
        """Displacement of the middle of a cell by the force on another, of both bodies together.

        Half-planes have no displacement at infinity to be measured against: it is 0 at the
        distance `datum` of a line load, which decides on the motion of the bodies as a whole, and
        on nothing between the cells.

        Returns
        -------
        array (n, n)
            Symmetric [length^2/force].
        """
        apart = np.abs(self.place[:, None] - self.place[None, :])

        def primitive(s: Floats) -> Floats:
            """Of the logarithm of datum / s."""
            return s * (np.log(datum / np.abs(s)) + 1.0)

        over_cell = primitive(apart + 0.5 * self.width) - primitive(apart - 0.5 * self.width)
        return 2.0 / (math.pi * contact_modulus * self.width) * over_cell


@dataclass(frozen=True)
class PartialSlip:
    """A cylinder under an oscillating tangential load that never moves it as a whole, and what it
    comes to: the unworn middle, which sticks, carries all load in the end.

    Parameters
    ----------
    cylinder : Cylinder
    tangential_load : float
        Amplitude [force/length], below `mu` times the load.
    """

    cylinder: Cylinder
    tangential_load: float

    def __post_init__(self) -> None:
        _positive("tangential_load", self.tangential_load)
        limit = self.cylinder.mu * self.cylinder.load
        if self.tangential_load >= limit:
            raise InputError(f"tangential_load: is {self.tangential_load:g}, must be below mu "
                             f"times the load, {limit:g}; gross slip needs a displacement")

    @property
    def stick_half_width(self) -> float:
        """Of the zone that sticks, from the first cycle to the last [length]."""
        cylinder = self.cylinder
        share = self.tangential_load / (cylinder.mu * cylinder.load)
        return cylinder.half_width * math.sqrt(1.0 - share)

    @property
    def scar_half_width(self) -> float:
        """Of the scar in the end: the outer root of the depth [length]."""
        # Depth over radius rises to its maximum and falls for good behind it.
        low, high = self.deepest_at, 2.0 * self.deepest_at
        while self._unclipped(np.array(high)) > 0.0:
            high *= 2.0
        while True:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                return middle
            low, high = ((middle, high) if self._unclipped(np.array(middle)) > 0.0
                         else (low, middle))

    @property
    def deepest_at(self) -> float:
        """Where the scar is deepest in the end [length]."""
        return math.sqrt(0.5 * (self.cylinder.half_width**2 + self.stick_half_width**2))

    @property
    def largest_depth(self) -> float:
        """In the end [length]."""
        return float(self._unclipped(np.array(self.deepest_at)))

    @property
    def volume(self) -> float:
        """Worn in the end [length^2], of both sides of the middle."""
        a, b, c = self.cylinder.half_width, self.scar_half_width, self.stick_half_width
        outer = math.sqrt(b**2 - c**2)
        return (a**2 * (b * math.acosh(b / c) - outer) - outer**3 / 3.0) / self.cylinder.radius

    def depth(self, x: ArrayLike) -> Floats:
        """Worn in the end at places [length]."""
        return np.maximum(self._unclipped(np.abs(np.asarray(x, dtype=float))), 0.0)

    def pressure(self, x: ArrayLike) -> Floats:
        """In the end at places [force/length^2]; infinite at the rims of the zone that sticks."""
        c, mu = self.stick_half_width, self.cylinder.mu
        held = self.cylinder.load - self.tangential_load / mu
        inside = np.abs(np.asarray(x, dtype=float)) < c
        root = np.sqrt(np.where(inside, c**2 - np.asarray(x, dtype=float)**2, 1.0))
        found: Floats = (self.tangential_load / mu / root
                         + 2.0 * held / c**2 * root) / math.pi
        return np.where(inside, found, 0.0)

    def _unclipped(self, x: Floats) -> Floats:
        """Depth by its formula outside of the zone that sticks, 0 inside."""
        a, c = self.cylinder.half_width, self.stick_half_width
        outside = np.maximum(x, c)
        return (a**2 * np.arccosh(outside / c)
                - outside * np.sqrt(outside**2 - c**2)) / (2.0 * self.cylinder.radius)


def gross_slip(cylinder: Cylinder, displacement: float, *, n: int = 60,
               half_width: float | None = None, datum: float | None = None,
               unit_system: str = "mm-tonne-s-N") -> Model:
    """The model of a cylinder that is moved to and fro by a given amplitude.

    Parameters
    ----------
    cylinder : Cylinder
    displacement : float
        Amplitude [length].
    n : int
        Cells.
    half_width : float, optional
        Of the grid, within which the scar has to stay [length]; 8 times that of the unworn contact.
    datum : float, optional
        Where a line load moves nothing [length], see `Cells.compliance`; the radius.
    unit_system : str
        That of all these numbers.

    Returns
    -------
    Model
        Dofs: n displacements along the normal, n along the tangent, the approach.

    Raises
    ------
    InputError
        A number is out of range, or the grid is no wider than the unworn contact.
    """
    _positive("displacement", displacement)
    reach = _REACH * cylinder.half_width if half_width is None else half_width
    if reach <= cylinder.half_width:
        raise InputError(f"half_width: is {reach:g}, must be above that of the unworn contact, "
                         f"{cylinder.half_width:g}")
    cells = Cells(whole("n", n, 2), 2.0 * reach / n)
    held, size = _stiffness(cylinder, cells, datum), 2 * n + 1
    cosine = np.zeros(size)
    # The cylinder stands and the flat moves, its cells with it: forces on the cells balance
    # K (x - motion), and K times the motion is a load.
    cosine[n:2 * n] = -displacement * held.sum(axis=1)
    return _model(cylinder, cells, held, size, cosine=cosine, side_1=(0, 0, 2 * n + 1),
                  title=f"Cylinder on flat, amplitude {displacement:g}", unit_system=unit_system,
                  observe={"approach": 2 * n + 1, "surface": n + 1 + n // 2})


def partial_slip(case: PartialSlip, *, n: int = 60, datum: float | None = None,
                 unit_system: str = "mm-tonne-s-N") -> Model:
    """The model of a cylinder under an oscillating tangential load.

    The rim of the zone that sticks is one of cells: the profile has a root there, and cells that
    straddle it wear for good.

    Parameters
    ----------
    case : PartialSlip
    n : int
        Cells, a multiple of twice the half width of the grid over that of the zone that sticks.
    datum : float, optional
        Where a line load moves nothing [length], see `Cells.compliance`; the radius.
    unit_system : str
        That of all these numbers.

    Returns
    -------
    Model
        Dofs: n displacements along the normal, n along the tangent, the approach, the motion.

    Raises
    ------
    InputError
        n is no multiple of what ends the cells at the rim of the zone that sticks.
    """
    reach = math.ceil(_BEYOND_THE_SCAR * case.scar_half_width / case.stick_half_width)
    if whole("n", n, 2) % (2 * reach):
        raise InputError(f"n: is {n}, must be a multiple of {2 * reach}, such as "
                         f"{2 * reach * math.ceil(n / (2 * reach))}, so that cells end where the "
                         f"zone that sticks does: the grid is {reach} times as wide")
    cells = Cells(n, 2.0 * reach * case.stick_half_width / n)
    held, size = _stiffness(case.cylinder, cells, datum), 2 * n + 2
    cosine = np.zeros(size)
    cosine[-1] = case.tangential_load
    return _model(case.cylinder, cells, held, size, cosine=cosine,
                  side_1=(2 * n + 2, 0, 2 * n + 1),
                  title=f"Cylinder on flat, tangential load {case.tangential_load:g}",
                  unit_system=unit_system,
                  observe={"approach": 2 * n + 1, "motion": 2 * n + 2})


def main(arguments: list[str] | None = None) -> int:
    """Write a model file as told by the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        cylinder = Cylinder(**{field.name: getattr(options, field.name)
                               for field in fields(Cylinder)})
        lines = [f"half width {cylinder.half_width:.6g}, largest pressure "
                 f"{cylinder.largest_pressure:.6g} (Hertz)"]
        if options.displacement is not None:
            model = gross_slip(cylinder, options.displacement, n=options.cells,
                               half_width=options.half_width, datum=options.datum,
                               unit_system=options.unit_system)
        else:
            if options.half_width is not None:
                raise InputError("half_width: goes with --displacement; the grid of a tangential "
                                 "load follows from the zone that sticks")
            case = PartialSlip(cylinder, options.tangential_load)
            model = partial_slip(case, n=options.cells, datum=options.datum,
                                 unit_system=options.unit_system)
            lines.append(f"sticks within {case.stick_half_width:.6g}; in the end worn up to "
                         f"{case.scar_half_width:.6g}, {case.largest_depth:.6g} deep, volume "
                         f"{case.volume:.6g}")
        model.to_hdf5(options.output)
    except FretwearError as error:
        print(f"fretwear.halfplane: {error}", file=sys.stderr)
        return error.exit_status
    except OSError as error:
        print(f"fretwear.halfplane: cannot write: {error}", file=sys.stderr)
        return _NOT_WRITTEN
    print(f"{options.output}: {options.cells} cells, {model.n_dof} dofs")
    print("\n".join(lines))
    return 0


class _Parser(argparse.ArgumentParser):
    """Parser that names the nearest option instead of printing all of them."""

    def error(self, message: str) -> NoReturn:
        hint = near_options(self, message)
        self.exit(_USAGE, f"fretwear.halfplane: {message}{hint} (--help lists all options)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="python -m fretwear.halfplane", allow_abbrev=False,
                     description="A model file of a cylinder on a flat, for wear in gross or in "
                                 "partial slip.")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.h5",
                        help="model file to write")
    motion = parser.add_mutually_exclusive_group(required=True)
    motion.add_argument("--displacement", type=float, metavar="U",
                        help="amplitude of the motion (gross slip)")
    motion.add_argument("--tangential-load", type=float, metavar="Q",
                        help="amplitude of a tangential load per unit of length (partial slip)")
    helps = {"radius": "of the cylinder", "young": "modulus of both bodies",
             "poisson": "ratio of both bodies", "load": "that presses them, per unit of length",
             "mu": "friction coefficient"}
    for field in fields(Cylinder):
        parser.add_argument(f"--{field.name}", type=float, default=field.default,
                            help=f"{helps[field.name]} (default: %(default)s)")
    parser.add_argument("--cells", type=int, default=60, help="contact pairs (default: "
                        "%(default)s)")
    parser.add_argument("--half-width", type=float, metavar="W",
                        help="of the grid, with --displacement (default: 8 times that of the "
                             "unworn contact)")
    parser.add_argument("--datum", type=float, metavar="D",
                        help="distance at which a line load moves nothing (default: the radius)")
    parser.add_argument("--unit-system", default="mm-tonne-s-N",
                        help="that of all these numbers (default: %(default)s)")
    return parser


def _stiffness(cylinder: Cylinder, cells: Cells, datum: float | None) -> Floats:
    """Of the surfaces along either direction."""
    depth = cylinder.radius if datum is None else datum
    if depth <= cells.n * cells.width:
        # Cells would move others against their own force, and the compliance may be indefinite.
        raise InputError(f"datum: is {depth:g}, must be above the width of the grid, "
                         f"{cells.n * cells.width:g}")
    held = np.linalg.inv(cells.compliance(cylinder.contact_modulus, depth))
    return 0.5 * (held + held.T)


def _model(cylinder: Cylinder, cells: Cells, held: Floats, size: int, *, cosine: Floats,
           side_1: tuple[int, int, int], title: str, unit_system: str,
           observe: dict[str, int]) -> Model:
    """Normal and tangential displacements of the cells stand first; side 1 is the cylinder, the
    same dofs for all pairs."""
    n = cells.n
    stiffness = np.zeros((size, size))
    stiffness[:n, :n] = stiffness[n:2 * n, n:2 * n] = held
    static = np.zeros(size)
    static[2 * n] = -cylinder.load
    side_2 = np.zeros((n, 3), dtype=int)
    side_2[:, 0], side_2[:, 2] = n + 1 + np.arange(n), 1 + np.arange(n)
    position = np.zeros((n, 3))
    position[:, 0] = cells.place
    pairs = ContactPairs(np.tile(np.array(side_1), (n, 1)), side_2, mu=cylinder.mu,
                         gap=cylinder.gap(cells.place), area=cells.width, law="dlft",
                         position=position, patch=["flat"] * n)
    return Model(np.zeros_like(stiffness), None, stiffness, contact=pairs, static=static,
                 cosine=cosine, observe=observe, title=title, unit_system=unit_system)


def _positive(name: str, value: float) -> None:
    if not float(array(name, [value], (1,))[0]) > 0.0:
        raise InputError(f"{name}: is {value:g}, must be above 0")


if __name__ == "__main__":
    sys.exit(main())
