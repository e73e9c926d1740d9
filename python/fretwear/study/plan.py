"""Study files (TOML): which case, which keys, which values."""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Union

import numpy as np

from .._namelist import by_columns, literal
from .._words import did_you_mean
from ..errors import InputError, OutputError
from .quantities import check_quantity

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["DESIGNS", "Plan", "Setting", "override", "read_plan"]

#: Value of a namelist key.
Setting = Union[bool, int, float, str, tuple[Union[int, float], ...]]

DESIGNS = ("grid", "list", "latin_hypercube")
_KEY = re.compile(r"[A-Za-z]\w*%[A-Za-z]\w*(\([\d:, ]+\))?$")
_TOP = ("case", "results", "design", "values", "points", "fixed", "n_samples", "seed", "table",
        "run")
_TABLE, _RUN = ("file", "quantities"), ("workers", "scheduler", "timeout", "program")
_RANGE = ("min", "max", "scale", "integer")
_SCALES = ("linear", "log")
_QUANTITIES = ("max_amplitude", "omega_at_peak")
# Named in a message rather than found out after days.
_MOST_POINTS = 1_000_000


@dataclass(frozen=True)
class Plan:
    """A study as its file describes it.

    Attributes
    ----------
    path : Path
        The study file.
    case : Path
        Namelist that all runs share.
    results : Path
        Folder of the runs.
    points : list of dict
        Values by namelist key such as "contact%mu", one dict for each run.
    fixed : dict
        Values of every run.
    table : Path
        Results table to write, .parquet or .h5.
    quantities : list of str
        Columns of the table, see `fretwear.study.quantities`.
    workers : int
        Runs at once; 0: as many as there are cores.
    scheduler : str
        'threads': in this process; 'processes': a program for each run on this machine; 'dask': a
        Dask cluster on this machine; else the address of a Dask scheduler, such as
        "tcp://head:8786".
    timeout : float
        Longest time of a run [s]; 0: no limit.
    program : str
        `fw_run` to start for each run; '': none but with 'processes', which finds that of this
        installation.
    """

    path: Path
    case: Path
    results: Path
    points: list[dict[str, Setting]]
    table: Path
    fixed: dict[str, Setting] = field(default_factory=dict)
    quantities: list[str] = field(default_factory=lambda: list(_QUANTITIES))
    workers: int = 0
    scheduler: str = "threads"
    timeout: float = 0.0
    program: str = ""

    @property
    def keys(self) -> list[str]:
        """Keys that vary, in the order of the file."""
        return list(dict.fromkeys(key for point in self.points for key in point))


def read_plan(path: str | Path) -> Plan:
    """Read a study file.

    Raises
    ------
    InputError
        A key is unknown, missing or not acceptable; the message names it.
    OutputError
        The file cannot be read.
    """
    path = Path(path)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: is no valid TOML: {error}") from None
    reader = _Reader(path)
    reader.known(content, _TOP, "")
    table = reader.group(content, "table", _TABLE)
    run = reader.group(content, "run", _RUN)
    folder = path.parent
    results = folder / reader.take(content, "results", str, path.stem)
    case = folder / reader.take(content, "case", str)
    if not case.is_file():
        raise OutputError(f"{path}: case = '{case}': there is no such file")
    quantities = reader.take(table, "quantities", list, list(_QUANTITIES), "table.")
    for quantity in quantities:
        reader.wrong(check_quantity(quantity), "table.quantities")
    target = folder / reader.take(table, "file", str, f"{results.name}.h5", "table.")
    if target.suffix not in (".h5", ".parquet"):
        reader.wrong(f"'{target.name}' must end in .h5 or .parquet", "table.file")
    plan = Plan(
        path, case, results, _points(reader, content), target,
        reader.settings(content.get("fixed", {}), "fixed"), quantities,
        reader.take(run, "workers", int, 0, "run."),
        reader.take(run, "scheduler", str, "threads", "run."),
        float(reader.take(run, "timeout", (int, float), 0.0, "run.")),
        reader.take(run, "program", str, "", "run."))
    if plan.workers < 0 or plan.timeout < 0.0:
        reader.wrong("must not be negative", "run.workers, run.timeout")
    both = sorted(set(plan.fixed) & set(plan.keys))
    if both:
        reader.wrong(f"{both[0]} is varied too", "fixed")
    return plan


def override(key: str, value: Setting) -> str:
    """Option --set of `fw_run`: KEY=VALUE in namelist syntax, reals to the last bit."""
    return f"{key}={literal(by_columns(key, value), key)}"


class _Reader:
    """Checked access to the content of a study file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def wrong(self, problem: str | None, where: str) -> None:
        """Raise where there is a problem."""
        if problem:
            raise InputError(f"{self.path}: {where}: {problem}")

    def known(self, group: Mapping[str, Any], names: Sequence[str], where: str) -> None:
        for name in group:
            if name not in names:
                self.wrong("is not known; expected " + ", ".join(names)
                           + did_you_mean(name, words=names), f"{where}{name}")

    def group(self, content: Mapping[str, Any], name: str,
              names: Sequence[str]) -> Mapping[str, Any]:
        found = content.get(name, {})
        if not isinstance(found, dict):
            self.wrong(f"is a {type(found).__name__}; expected a table [{name}]", name)
        self.known(found, names, f"{name}.")
        return found

    def take(self, group: Mapping[str, Any], name: str, kind: Any, default: Any = None,
             where: str = "") -> Any:
        value = group.get(name, default)
        if value is None:
            self.wrong("is missing", where + name)
        if not isinstance(value, kind) or isinstance(value, bool):
            word = getattr(kind, "__name__", "number")
            self.wrong(f"{value!r} is a {type(value).__name__}; expected a {word}", where + name)
        return value

    def settings(self, group: Any, where: str) -> dict[str, Setting]:
        """Namelist keys with one value each."""
        if not isinstance(group, dict):
            self.wrong("expected a table of namelist keys", where)
        return {self.key(name, where): self.setting(value, f"{where}.{name}")
                for name, value in group.items()}

    def key(self, name: str, where: str) -> str:
        if not _KEY.match(name):
            self.wrong(f"'{name}' is no namelist key; expected \"group%key\" in quotes, such as "
                       "\"contact%mu\"", where)
        return name.lower()

    def setting(self, value: Any, where: str) -> Setting:
        if isinstance(value, list) and value and all(
                isinstance(part, (int, float)) and not isinstance(part, bool) for part in value):
            return tuple(value)
        if not isinstance(value, (bool, int, float, str)):
            self.wrong(f"{value!r} is no value of a namelist key; expected a truth value, number, "
                       "text or list of numbers", where)
        assert isinstance(value, (bool, int, float, str))
        return value


def _points(reader: _Reader, content: Mapping[str, Any]) -> list[dict[str, Setting]]:
    design = reader.take(content, "design", str, "grid")
    if design not in DESIGNS:
        reader.wrong(f"'{design}' is not known; expected one of {', '.join(DESIGNS)}", "design")
    needed, others = {"grid": ("values", ("points", "n_samples", "seed")),
                      "list": ("points", ("values", "n_samples", "seed")),
                      "latin_hypercube": ("values", ("points",))}[design]
    if not content.get(needed):
        reader.wrong(f"is missing or empty; design '{design}' needs it", needed)
    for name in others:
        if name in content:
            reader.wrong(f"has no meaning for the design '{design}'", name)
    if design == "list":
        lines = reader.take(content, "points", list)
        return [reader.settings(line, f"points[{k}]") for k, line in enumerate(lines)]
    values = reader.take(content, "values", dict)
    return _grid(reader, values) if design == "grid" else _hypercube(reader, content, values)


def _grid(reader: _Reader, values: Mapping[str, Any]) -> list[dict[str, Setting]]:
    axes: dict[str, list[Setting]] = {}
    for name, given in values.items():
        where = f"values.{name}"
        if not isinstance(given, list) or not given:
            reader.wrong("expected a list of values", where)
        axes[reader.key(name, "values")] = [reader.setting(value, where) for value in given]
    n_points = int(np.prod([float(len(axis)) for axis in axes.values()]))
    if n_points > _MOST_POINTS:
        reader.wrong(f"the grid has {n_points} points; expected at most {_MOST_POINTS}", "values")
    return [dict(zip(axes, point)) for point in itertools.product(*axes.values())]


def _hypercube(reader: _Reader, content: Mapping[str, Any],
               values: Mapping[str, Any]) -> list[dict[str, Setting]]:
    n_samples = reader.take(content, "n_samples", int)
    if not 1 <= n_samples <= _MOST_POINTS:
        reader.wrong(f"{n_samples} is not accepted; expected 1 to {_MOST_POINTS}", "n_samples")
    # Without a seed no restart could find its runs again.
    seed = reader.take(content, "seed", int)
    # Loading it takes longer than all else that a command loads.
    qmc = import_module("scipy.stats").qmc
    unit = qmc.LatinHypercube(len(values), seed=np.random.default_rng(seed)).random(n_samples)
    columns: dict[str, list[Setting]] = {}
    for k, (name, given) in enumerate(values.items()):
        columns[reader.key(name, "values")] = _spread(reader, f"values.{name}", given, unit[:, k])
    return [dict(zip(columns, point)) for point in zip(*columns.values())]


def _spread(reader: _Reader, where: str, given: Any, unit: Any) -> list[Setting]:
    """Samples of the unit interval on a range."""
    if not isinstance(given, dict):
        reader.wrong("expected a range such as {min = 0.1, max = 0.5}", where)
    reader.known(given, _RANGE, f"{where}.")
    low, high = (float(reader.take(given, name, (int, float), None, f"{where}."))
                 for name in ("min", "max"))
    scale = reader.take(given, "scale", str, "linear", f"{where}.")
    whole = bool(given.get("integer", False))
    if scale not in _SCALES:
        reader.wrong(f"'{scale}' is not known; expected one of {', '.join(_SCALES)}",
                     f"{where}.scale")
    if not low < high or (scale == "log" and low <= 0.0):
        reader.wrong(f"{low:g} to {high:g} is no range" +
                     (" of positive numbers" if scale == "log" else ""), where)
    if whole:
        return [int(value) for value in np.floor(low + unit * (high - low + 1.0))]
    if scale == "log":
        return [float(value) for value in low * (high / low) ** unit]
    return [float(value) for value in low + unit * (high - low)]
