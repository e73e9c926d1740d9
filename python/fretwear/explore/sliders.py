"""Which keys of a case get a slider, and how far it goes."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._native import namelist_values
from ..case import Case
from ..errors import InputError
from ..settings import UNITS

__all__ = ["Slider", "read_slider", "settings_of", "unit_of", "usual_sliders"]

#: Keys that get a slider unasked where the case has them, and what the page calls them.
_USUAL = {
    "load%harmonic_scale": "factor of the vibratory load",
    "contact%mu": "friction coefficient",
    "contact%normal_load": "normal load",
    "contact%gap": "gap",
    "model%rotation_speed": "rotation speed",
    "harmonics%n_harmonics": "harmonics",
}
#: Keys whose values may stand in the model file, by their names as parts of a case.
_PARTS = {f"contact%{name}": f"contact/{name}" for name in (
    "mu", "normal_load", "gap", "tangential_stiffness", "normal_stiffness")}
_PARTS["spring%coefficient"] = "spring/coefficient"
#: How far a slider goes on both sides of the value of the case, as a factor.
_REACH = 4.0
_MOST_HARMONICS = 15


@dataclass(frozen=True)
class Slider:
    """A key of the namelist with a range.

    Attributes
    ----------
    key : str
        ``group%key``.
    title : str
        What the page calls it.
    low, high, step, value : float
        In the units of the key.
    is_whole : bool
        Whole numbers only.
    """

    key: str
    title: str
    low: float
    high: float
    step: float
    value: float
    is_whole: bool = False

    @property
    def decimals(self) -> int:
        """Decimals of its values, two more than its step has."""
        return 0 if self.is_whole else max(1, 2 - math.floor(math.log10(self.step) + 1e-9))


def usual_sliders(case: Case) -> list[Slider]:
    """Sliders of what most people turn, as far as the case, model file included, has one value
    for all pairs."""
    values = _values(case)
    found = []
    for key, title in _USUAL.items():
        value = _single(values, key)
        if value is None or (value == 0.0 and key != "contact%gap"):
            continue
        if key == "harmonics%n_harmonics":
            found.append(Slider(key, title, 1, max(_MOST_HARMONICS, int(value)), 1, value, True))
        elif value != 0.0:
            low, high = sorted((value / _REACH, value * _REACH))
            found.append(_even(key, title, low, high, value))
    return found


def read_slider(text: str, case: Case) -> Slider:
    """A slider as the command line has it: ``group%key=low:high``.

    Raises
    ------
    InputError
        It cannot be read, the case has no single number there, or one outside of the range.
    """
    key, _, limits = text.partition("=")
    low_text, _, high_text = limits.partition(":")
    try:
        low, high = float(low_text), float(high_text)
    except ValueError:
        raise InputError(f"slider '{text}': must be group%key=low:high, such as "
                         "contact%mu=0.1:0.8") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"slider '{text}': its ends must be finite, the lower one first")
    values = _values(case)
    if not values.get(key):
        raise InputError(f"slider '{text}': {key} has no value in the case, from which the page "
                         "could start; give it one there")
    value = _single(values, key)
    if value is None:
        raise InputError(f"slider '{text}': {key} is {', '.join(values[key][:3])} in the case; "
                         "a slider needs one number")
    if not low <= value <= high:
        raise InputError(f"slider '{text}': {key} is {value:.6g} in the case, from which the page "
                         "starts; the range must enclose it")
    title = _USUAL.get(key, key)
    if _is_whole(values[key][0]) and low == int(low) and high == int(high):
        return _whole(key, title, int(low), int(high), int(value))
    return _even(key, title, low, high, value)


def settings_of(sliders: list[Slider], values: list[float]) -> dict[str, Any]:
    """Groups of a case with the values of its sliders; nothing of those that stand where the case
    has them."""
    groups: dict[str, Any] = {}
    for slider, value in zip(sliders, values):
        if abs(value - slider.value) <= 0.5 * 10.0**-slider.decimals:
            continue
        group, _, key = slider.key.partition("%")
        # The group &model is called `structure` in Python, where `model` is the first argument.
        place = groups.setdefault("structure" if group == "model" else group, {})
        place[key] = round(value) if slider.is_whole else round(value, slider.decimals)
    return groups


def _values(case: Case) -> dict[str, list[str]]:
    """Texts by key: those of the namelist, and what the case has read from its model."""
    found = namelist_values(case.namelist())
    with case.open() as session:
        for key, part in _PARTS.items():
            # As typed where the namelist has it: whole numbers look so.
            if key not in found and len(numbers := np.unique(session.part(part))):
                found[key] = [repr(float(number)) for number in numbers]
    return found


def _single(values: dict[str, list[str]], key: str) -> float | None:
    """The value of a key that is one number, or the same for all pairs."""
    texts = values.get(key, [])
    if len(set(texts)) != 1:
        return None
    try:
        return float(texts[0])
    except ValueError:
        return None


def _is_whole(text: str) -> bool:
    return text.lstrip("+-").isdigit()


def unit_of(key: str, length: str, force: str) -> str:
    """Unit of a key in those of a model; "" where it has none, or where the model names none."""
    letters = UNITS.get(key, "")
    known = {"L": length, "F": force, "rad": "rad", "s": "s", "degrees": "degrees"}
    parts = re.split(r"([ /^0-9]+)", letters)
    names = [part for part in parts if re.match(r"[A-Za-z]", part)]
    if not letters or not all(known.get(name) for name in names):
        return ""
    return "".join(known.get(part, part) for part in parts)


def _whole(key: str, title: str, low: int, high: int, value: int) -> Slider:
    """Whole numbers in about a hundred steps, on which the value of the case lies."""
    step = max(1, round((high - low) / 100))
    return Slider(key, title, value - step * ((value - low) // step),
                  value + step * ((high - value) // step), step, value, True)


def _even(key: str, title: str, low: float, high: float, value: float) -> Slider:
    """About a hundred steps of a round size, between ends that are multiples of it."""
    raw = (high - low) / 100.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(digit - raw / power))
    first = step * math.floor(low / step + 1e-9)
    if first <= 0.0 < low:
        first = low
    last = first + step * math.ceil((high - first) / step - 1e-9)
    return Slider(key, title, first, last, step, min(max(value, first), last))
