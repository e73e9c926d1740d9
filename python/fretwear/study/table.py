"""Results tables: one row for each run, in Parquet (pyarrow) or HDF5 (h5py)."""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import FretwearError, InputError, OutputError
from ..result import Result
from .plan import Plan, Setting
from .quantities import Value, evaluate
from .run import Record

if TYPE_CHECKING:
    import xarray

__all__ = ["build_table", "is_table", "need_writer", "read_dataset", "read_table",
           "table_parts", "write_table"]

#: A column per name; texts, integers or reals.
Table = dict[str, NDArray[Any]]


def build_table(plan: Plan, records: Sequence[Record | None]) -> Table:
    """The results table.

    Parameters
    ----------
    plan : Plan
        The study.
    records : sequence of Record or None
        One for each point of the plan; None where it has not been run.

    Returns
    -------
    dict of str to array
        `run`, the keys that vary, `exit_status`, `status`, `message`, `seconds`, `result` and the
        quantities; NaN, '' or exit status -1 with status 'not run' where there is nothing.
    """
    rows: list[list[Value]] = []
    for point, record in zip(plan.points, records):
        quantities, problem = _quantities(plan, record)
        keys = [_cell(point.get(key)) for key in plan.keys]
        if record is None:
            rows.append(["", *keys, -1, "not run", "", math.nan, "", *quantities])
        else:
            message = "; ".join(text for text in (record.message, problem) if text)
            rows.append([record.name, *keys, record.exit_status, record.status, message,
                         record.seconds, record.result, *quantities])
    names = ["run", *plan.keys, "exit_status", "status", "message", "seconds", "result",
             *plan.quantities]
    return {name: _column([row[k] for row in rows]) for k, name in enumerate(names)}


def _quantities(plan: Plan, record: Record | None) -> tuple[list[Value], str]:
    """Quantities of one run, and why some are missing."""
    result, problems = None, []
    if record is not None and record.result:
        try:
            result = Result(record.result)
        except FretwearError as error:
            problems.append(str(error))
    values: list[Value] = []
    with nullcontext() if result is None else result.kept_open():
        for text in plan.quantities:
            try:
                values.append(evaluate(text, result))
            except FretwearError as error:
                problems.append(f"{text}: {error}")
                values.append(evaluate(text.partition("[")[0], None))
    return values, "; ".join(problems)


def _cell(value: Setting | None) -> Value:
    if isinstance(value, tuple):
        return ", ".join(map(repr, value))
    return "" if value is None else value


def _column(values: list[Value]) -> NDArray[Any]:
    """Texts where any value is one; '' beside numbers is NaN."""
    if any(isinstance(value, str) and value for value in values) or all(
            isinstance(value, str) for value in values):
        return np.array([str(value) for value in values], dtype=np.str_)
    return np.array([math.nan if value == "" else value for value in values])


def need_writer(path: Path) -> None:
    """Say before the runs, not after them, that a table cannot be written."""
    if path.suffix == ".parquet":
        try:
            importlib.import_module("pyarrow.parquet")
        except ImportError:
            raise InputError(f"{path.name}: Parquet needs the package pyarrow; install it with pip "
                             "install pyarrow, or let table.file end in .h5") from None
    if not path.absolute().parent.is_dir():
        raise OutputError(f"no folder to write {path} into")


def write_table(table: Table, path: Path, title: str) -> None:
    """Write a table; an older one is replaced once the new one is complete."""
    need_writer(path)
    partial = path.with_name(path.name + ".part")
    try:
        if path.suffix == ".parquet":
            arrow: Any = importlib.import_module("pyarrow")
            parquet: Any = importlib.import_module("pyarrow.parquet")
            columns = {name: column.tolist() for name, column in table.items()}
            parquet.write_table(arrow.table(columns).replace_schema_metadata({"title": title}),
                                partial)
        else:
            with h5py.File(partial, "w") as file:
                file.attrs["title"] = title
                file.attrs["columns"] = list(table)
                for name, column in table.items():
                    text = column.dtype.kind == "U"
                    file.create_dataset(name, data=column.astype(object) if text else column,
                                        dtype=h5py.string_dtype() if text else column.dtype)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def is_table(path: str | Path) -> bool:
    """Whether a file is the table of a study, not a result."""
    path = Path(path)
    if path.suffix == ".parquet":
        return True
    try:
        with h5py.File(path, "r") as file:
            return "columns" in file.attrs and "format" not in file.attrs
    except OSError:
        return False


def table_parts(table: Table) -> tuple[list[str], list[str]]:
    """Names of the columns of the keys that vary, and of those of the quantities."""
    names = list(table)
    return (names[names.index("run") + 1:names.index("exit_status")],
            names[names.index("result") + 1:])


def read_dataset(path: str | Path) -> xarray.Dataset:
    """A results table as an xarray.Dataset.

    A grid of numbers has a dimension for each key that varies; other studies have one, `run`, with
    the keys as coordinates along it.

    Raises
    ------
    InputError
        xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise InputError("datasets need xarray: pip install 'fretwear[xarray]'") from None
    table = read_table(path)
    keys, _ = table_parts(table)
    varied = {key: np.unique(table[key], return_inverse=True) for key in keys
              if len(set(table[key].tolist())) > 1}
    n = len(table["run"])
    shape = tuple(len(values) for values, _ in varied.values())
    place = (np.ravel_multi_index(tuple(where.ravel() for _, where in varied.values()), shape)
             if varied else np.zeros(n, dtype=int))
    if not varied or math.prod(shape) != n or len(np.unique(place)) < n:
        columns = {name: ("run", column) for name, column in table.items() if name != "run"}
        data = xarray.Dataset(columns, {"run": table["run"]})
        return data.set_coords(keys)
    order = np.argsort(place)
    gridded = {name: (tuple(varied), column[order].reshape(shape))
               for name, column in table.items() if name not in varied}
    fixed = [key for key in keys if key not in varied]
    data = xarray.Dataset(gridded, {key: values for key, (values, _) in varied.items()})
    return data.drop_vars(fixed).assign_attrs({key: table[key][0] for key in fixed})


def read_table(path: str | Path) -> Table:
    """Read a results table of either format, in the order of its columns."""
    path = Path(path)
    if path.suffix == ".parquet":
        need_writer(path)
        parquet: Any = importlib.import_module("pyarrow.parquet")
        found = parquet.read_table(path)
        return {name: _column(found.column(name).to_pylist()) for name in found.column_names}
    try:
        with h5py.File(path, "r") as file:
            return {str(name): file[name].asstr()[()] if file[name].dtype.kind == "O"
                    else file[name][()] for name in file.attrs["columns"]}
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error}") from None
