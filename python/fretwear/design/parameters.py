"""Numbers of a case that are to be found: where they stand, their bounds, the chain rule."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from .._native import namelist_values
from .._words import did_you_mean
from ..case import Case
from ..errors import InputError
from ..model import Model

__all__ = ["Bounds", "Unknowns", "bound_pairs", "case_values", "differentiated", "has_parts"]

Floats = NDArray[np.float64]
#: Lower and upper bound, of one parameter or of each.
Bounds = Union[tuple[float, float], Sequence[tuple[float, float]]]

#: What the library differentiates by; those with a name are arrays of a case that was read.
_KEYS = {
    "load%harmonic_scale": "", "load%static_scale": "",
    "contact%mu": "contact/mu", "contact%normal_load": "contact/normal_load",
    "contact%gap": "contact/gap", "contact%tangential_stiffness": "contact/tangential_stiffness",
    "contact%normal_stiffness": "contact/normal_stiffness",
    "contact%residual": "contact/residual",
    "contact%slider_1": "contact/slider_1", "contact%slider_2": "contact/slider_2",
    "spring%coefficient": "spring/coefficient", "model%modal_damping": "",
    "model%rayleigh_mass": "", "model%rayleigh_stiffness": "", "model%rotation_speed": "",
    "body%mass": "",
}
_FORM = re.compile(r"([\w%]+)\s*(?:\(\s*(\d+)\s*(?::\s*(\d+)\s*)?\))?$")


@dataclass(frozen=True)
class _Entry:
    """One parameter: key, its parts (pairs or springs) from 0, what a factor multiplies."""

    label: str
    key: str
    parts: NDArray[np.int_]
    base: Floats


class Unknowns:
    """Parameters of a case, each one number for all its pairs (springs) or for some.

    Parameters
    ----------
    case : Case
        The case.
    over : sequence of str
        "group%key" of `sensitivity%parameters`; "contact%mu(3)" and "contact%mu(1:8)" are of those
        pairs alone.
    bounds : sequence of (low, high)
        Of each.
    factors : bool
        Whether a parameter is a factor of the values of the case, not a value.
    """

    def __init__(self, case: Case, over: Sequence[str], bounds: Sequence[tuple[float, float]],
                 *, factors: bool = False) -> None:
        self._case, self._factors = case, factors
        self._values = case_values(case, [_parse(text)[0] for text in over])
        self._entries = [self._entry(text) for text in over]
        self._refuse_shared()
        self.low, self.high = _bounds(self.names, bounds)
        #: Positive ones are looked for by their logarithm.
        self.logarithmic = self.low > 0.0

    def _entry(self, text: str) -> _Entry:
        key, first, last = _parse(text)
        values = self._values[key]
        parts = np.arange(len(values))
        if first is not None:
            if not 1 <= first <= (last or first) <= len(values):
                raise InputError(f"{text}: there are {len(values)} of {key}, counted from 1")
            parts = parts[first - 1:last or first]
        base = values[parts]
        if self._factors and not (base != 0.0).any():
            raise InputError(f"{text}: is 0 in the case, which a factor does not change; look for "
                             "its value instead")
        if not self._factors and np.ptp(base) > 0.0:
            raise InputError(f"{text}: is not the same everywhere, {base.min():.6g} to "
                             f"{base.max():.6g}; look for a factor of these values (factors = "
                             "True, --as factor), or for parts of them, such as "
                             f"{key}(1:{max(1, len(values) // 2)})")
        return _Entry(text.replace(" ", ""), key, parts, base)

    def _refuse_shared(self) -> None:
        taken: dict[tuple[str, int], str] = {}
        for entry in self._entries:
            for part in entry.parts.tolist():
                other = taken.setdefault((entry.key, part), entry.label)
                if other != entry.label or len(entry.parts) != len(set(entry.parts.tolist())):
                    raise InputError(f"{entry.label} and {other} are of the same number")
        if len({entry.label for entry in self._entries}) < len(self._entries):
            raise InputError(f"{self.names[0]}: stands among the parameters twice")

    @property
    def names(self) -> list[str]:
        """What the parameters are called."""
        return [entry.label for entry in self._entries]

    @property
    def keys(self) -> list[str]:
        """What the library is to differentiate by."""
        return list(dict.fromkeys(entry.key for entry in self._entries))

    @property
    def present(self) -> Floats:
        """Values, or factors, of the case as it is."""
        if self._factors:
            return np.ones(len(self._entries))
        return np.array([entry.base[0] for entry in self._entries])

    def start(self, values: Sequence[float] | None = None) -> Floats:
        """Where to begin: `values`, or the case, in either case brought inside the bounds."""
        given = self.present if values is None else np.array(values, dtype=float)
        if given.shape != self.low.shape:
            raise InputError(f"start: has {given.size} values, must have {len(self.low)}")
        return np.clip(given, self.low, self.high)

    def case_at(self, values: Floats, case: Case | None = None) -> Case:
        """The case, or another one of the same model, with these values."""
        arrays = {key: self._values[key].copy() for key in self.keys}
        for entry, value in zip(self._entries, values):
            arrays[entry.key][entry.parts] = entry.base * value if self._factors else value
        groups: dict[str, dict[str, object]] = {}
        for key, array in arrays.items():
            group, _, name = key.partition("%")
            groups.setdefault("structure" if group == "model" else group, {})[name] = (
                array if _KEYS[key] else float(array[0]))
        settings: Any = groups
        return (case or self._case).replace(**settings)

    def chain(self, derivatives: Mapping[str, Floats]) -> Floats:
        """Derivatives by the parameters (..., n) from those by key (...[, n_parts])."""
        columns = []
        for entry in self._entries:
            by_part = np.asarray(derivatives[entry.key])
            if not has_parts(entry.key):
                by_part = by_part[..., None]
            weight = entry.base if self._factors else np.ones(len(entry.parts))
            columns.append(by_part[..., entry.parts] @ weight)
        return np.stack(columns, axis=-1)

    def to_scaled(self, values: Floats) -> Floats:
        """From values to what a method works with: logarithms of the positive ones, and the others
        over their ranges.
        """
        return np.where(self.logarithmic, np.log(np.where(self.logarithmic, values, 1.0)),
                        values / (self.high - self.low))

    def to_values(self, scaled: Floats) -> Floats:
        """Back again; never outside of the bounds by round-off."""
        values = np.where(self.logarithmic, np.exp(np.where(self.logarithmic, scaled, 0.0)),
                          scaled * (self.high - self.low))
        return np.clip(values, self.low, self.high)

    def slope(self, values: Floats) -> Floats:
        """d(value)/d(scaled) of each."""
        return np.where(self.logarithmic, values, self.high - self.low)

    def at_bound(self, values: Floats) -> NDArray[np.int_]:
        """-1 at the lower bound, 1 at the upper, 0 between."""
        near = 1e-9 * (self.high - self.low)
        return np.where(values <= self.low + near, -1, np.where(values >= self.high - near, 1, 0))


def has_parts(key: str) -> bool:
    """Whether a parameter is one of each pair or spring."""
    return bool(_KEYS[key])


def case_values(case: Case, keys: Sequence[str]) -> dict[str, Floats]:
    """Values by key as the library has read them, model file included.

    Raises
    ------
    InputError
        Nothing is differentiated by a key, or the case does not have it.
    """
    for key in keys:
        if key not in _KEYS:
            raise InputError(f"{key}: there are no derivatives by it; there are by "
                             + ", ".join(_KEYS) + did_you_mean(key, words=_KEYS))
    found: dict[str, Floats] = {}
    with case.open() as session:
        texts = namelist_values(session.text("namelist"))
        for key in keys:
            if key == "body%mass" and key not in texts:
                found[key] = _masses(case, texts)
            else:
                found[key] = (session.part(_KEYS[key]) if _KEYS[key]
                              else np.array([float(texts[key][0].lower().replace("d", "e"))]))
            if not len(found[key]):
                what = "springs" if key.startswith("spring") else "contact pairs"
                raise InputError(f"{key}: the case has no {what}")
    return found


def _masses(case: Case, texts: Mapping[str, Sequence[str]]) -> Floats:
    """The mass of the bodies of a model, which is that of all."""
    model = case.model
    if model is None and texts.get("model%source", [""])[0] == "hdf5":
        model = Model.from_hdf5(texts["model%file"][0])
    if model is None or model.bodies is None:
        raise InputError("body%mass: the model has no bodies (fretwear.damper)")
    masses = np.asarray(model.bodies.mass)
    if np.ptp(masses) > 0.0:
        raise InputError(f"body%mass: is not the same everywhere, {masses.min():.6g} to "
                         f"{masses.max():.6g}; give all bodies one mass (&body mass)")
    return masses[:1].copy()


def differentiated(case: Case, keys: Sequence[str], quantities: Sequence[str]) -> Case:
    """The case with derivatives of quantities by keys, and nothing else of &sensitivity."""
    settings: dict[str, Any] = {"parameters": list(keys)}
    if quantities:
        settings["quantities"] = list(quantities)
    if "sensitivity%deviation" in namelist_values(case.namelist()):
        settings["deviation"] = [0.0] * len(keys)  # of other parameters, it may be
    change: Any = {"sensitivity": settings}
    return case.replace(**change)


def bound_pairs(bounds: Bounds, n: int) -> list[tuple[float, float]]:
    """Bounds of each of n parameters, from those or from the one pair."""
    pairs = np.array(bounds, dtype=float)
    if n == 1 and pairs.shape == (2,):
        pairs = pairs[None]
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise InputError("bounds: must be a pair (low, high) for each parameter")
    return [(float(low), float(high)) for low, high in pairs]


def _parse(text: str) -> tuple[str, int | None, int | None]:
    match = _FORM.match(text.strip()) if isinstance(text, str) else None
    if not match:
        raise InputError(f"{text!r}: must be group%key, with the numbers of pairs in brackets "
                         "where not all are meant: contact%mu(3), contact%mu(1:8)")
    first, last = match[2], match[3]
    return match[1].lower(), int(first) if first else None, int(last) if last else None


def _bounds(names: Sequence[str], given: Sequence[tuple[float, float]]) -> tuple[Floats, Floats]:
    array = np.array(given, dtype=float)
    if array.shape != (len(names), 2):
        raise InputError(f"bounds: are {len(given)}, must be a pair (low, high) for each of "
                         + ", ".join(names))
    for name, (low, high) in zip(names, array):
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise InputError(f"bounds of {name}: are {low:g} and {high:g}, must be a lower and a "
                             "higher number")
    return array[:, 0].copy(), array[:, 1].copy()
