"""Parameter studies: grids, lists and Latin hypercubes over namelist keys, with one table.

Runs are those of `fw_run`. A run is known by its effective input: what is there is not repeated,
and Ctrl-C loses nothing. `fretwear study` is in `fretwear.study.command`.
"""

from .command import add_arguments, main
from .plan import Plan, read_plan
from .run import Record
from .study import run_study
from .table import read_dataset, read_table

__all__ = ["Plan", "Record", "add_arguments", "main", "read_dataset", "read_plan", "read_table",
           "run_study"]
