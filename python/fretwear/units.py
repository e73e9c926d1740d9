"""Values with units, such as '1017 Hz' or '5 um', in the units of a case.

The table of units is that of pint, with frequencies as they are meant: 1 Hz is 2 pi rad/s.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from .errors import InputError
from .settings import UNITS

__all__ = ["converted", "has_units"]

#: A number and a unit, in quotes or not.
_WITH_UNIT = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[ed][-+]?\d+|(?![ed][-+]?\d)))\s*"
    r"([a-zµμ°%][^,'\"]*?)\s*$", re.IGNORECASE)
#: What may be one, in the text of a namelist.
_LIKELY = re.compile(r"""=[^!\n]*['"]\s*[-+.\d][^'"\n]*[a-zµμ°][^'"\n]*['"]""", re.IGNORECASE)
#: Keys whose unit is that of the parameter that a sweep, or a track, goes over.
_OF_PARAMETER = {"sweep": ("start", "end", "values"), "resonance": ("start", "end")}


def has_units(text: str, settings: Iterable[tuple[str, str]]) -> bool:
    """Whether some value may carry a unit; seldom, so that most cases need no table of units."""
    return bool(_LIKELY.search(text)) or any(
        _WITH_UNIT.match(word) for key, value in settings if _base(key) in UNITS
        or key.partition("%")[0] in _OF_PARAMETER for word in _words(value))


def converted(values: Mapping[str, list[str]], settings: Iterable[tuple[str, str]],
              system: str) -> list[tuple[str, str]]:
    """Settings that replace values with units by plain numbers.

    Parameters
    ----------
    values : mapping of str to list of str
        Of the namelist, by "group%key".
    settings : iterable of (str, str)
        What is set on top, in order.
    system : str
        Unit system of the model, such as "mm-tonne-s-N"; "" where it does not say.

    Raises
    ------
    InputError
        A unit is not known, or not of the quantity; or the model does not say its units.
    """
    given = [*((key, list(words)) for key, words in values.items()),
             *((key, _words(value)) for key, value in settings)]
    last = {_base(key): words for key, words in given}
    last["sweep%unit"], by_hertz = _frequency_unit(last, given)
    found = [("sweep%unit", f"'{last['sweep%unit'][0]}'")] if by_hertz else []
    for key, words in given:
        unit = _unit_of(_base(key), last)
        if unit is None:
            continue
        if not any(_WITH_UNIT.match(word) for word in words):
            if any(_base(name) == _base(key) for name, _ in found):  # set over a value with a unit
                found.append((key, ", ".join(words)))
            continue
        numbers = [_convert(key, word, unit, system) for word in words]
        found.append((key, ", ".join(numbers)))
    return found


def _base(key: str) -> str:
    return key.partition("(")[0].strip().lower()


def _words(value: str) -> list[str]:
    return [word.strip().strip("'\"") for word in value.split(",")]


def _frequency_unit(last: Mapping[str, list[str]],
                    given: Iterable[tuple[str, list[str]]]) -> tuple[list[str], bool]:
    """The unit of the frequencies of the sweep; hertz, where they were typed and it was not said.
    """
    said = last.get("sweep%unit", [""])[0]
    if said:
        return [said], False
    keys = {f"sweep%{key}" for key in ("start", "end", "frequencies", "frequency")}
    typed = any("hz" in word.lower() for key, words in given if _base(key) in keys
                for word in words)
    return (["Hz"], True) if typed else (["rad/s"], False)


def _unit_of(key: str, last: Mapping[str, list[str]]) -> str | None:
    """The unit that a key is declared with; None where it has none."""
    group, _, name = key.partition("%")
    over = last.get(f"{group}%parameter", ["frequency"])[0].lower()
    if name in _OF_PARAMETER.get(group, ()) and (over != "frequency" or name == "values"):
        if over != "frequency":
            return UNITS.get(over)
        key = "sweep%start"
    unit = UNITS.get(key)
    if unit == "unit":
        unit = last.get(f"{group}%unit", ["rad/s"])[0]
    if unit is not None and "power" in unit:
        powers = set(last.get("spring%power", ["1"]))
        unit = unit.replace("power", powers.pop()) if len(powers) == 1 else None
    return unit


def _convert(key: str, word: str, unit: str, system: str) -> str:
    """One value in its unit; numbers without one are in it already."""
    found = _WITH_UNIT.match(word)
    if not found:
        return word
    registry, pint = _registry()
    target = unit
    if re.search(r"\b[LMF]\b", unit):
        names = dict(zip("LMsF", system.split("-")))
        if len(names) != 4:
            raise InputError(f"{key} = '{word}': the model does not say its units: give it a "
                             "unit_system, such as 'mm-tonne-s-N', or the value without a unit")
        target = re.sub(r"\b([LMsF])\b", lambda name: f"({names[name[1]]})", unit)
    target = re.sub(r"\) \(", ")*(", target.replace("^", "**"))
    try:
        value = registry.Quantity(float(found[1].lower().replace("d", "e")), found[2]).to(target)
    except pint.errors.DimensionalityError:
        raise InputError(f"{key} = '{word}': is in {found[2]}, must be in a unit of "
                         f"{_meaning(unit, system)}") from None
    except (pint.errors.UndefinedUnitError, pint.errors.DefinitionSyntaxError, AttributeError,
            ValueError, TypeError) as error:
        raise InputError(f"{key} = '{word}': {error}") from None
    return repr(float(value.magnitude))


def _meaning(unit: str, system: str) -> str:
    return f"{unit}, such as those of {system}" if re.search(r"\b[LMF]\b", unit) else unit


@cache
def _registry() -> tuple[Any, Any]:
    """The table of units."""
    try:
        import pint
    except ImportError:
        raise InputError("values with units need the package pint: pip install 'fretwear[units]', "
                         "or give the numbers in the units of the model") from None
    registry: Any = pint.UnitRegistry(on_redefinition="ignore")
    # Elsewhere hertz are bare per second, and 1 Hz were 1 rad/s.
    registry.define("hertz = 2 * π * radian / second = Hz")
    registry.define("revolutions_per_minute = 2 * π * radian / minute = rpm")
    return registry, pint
