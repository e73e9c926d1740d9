"""The program of `make bench-limit` does what fw_run does, and finds a floor for every part."""
import csv
import io
import math
import os
import re
import subprocess

import pytest
from project import BUILD, PROGRAM, require_program

from bench.common.measure import write_namelist
from bench.common.sector import case

#: What no arithmetic stands for.
WITHOUT_FLOOR = {"rows solved at once", "guess", "first matrices"}


def rows_of(path):
    """Its lines by the name of the part."""
    done = subprocess.run([BUILD / "test" / "support" / "floor", path], capture_output=True,
                          text=True, check=False, env=os.environ | {"OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr
    return {row["part"]: row for row in csv.DictReader(io.StringIO(done.stdout))}


@pytest.mark.parametrize("pairs", [16, 48], ids=["a matrix a harmonic", "two for all"])
def test_every_part_has_a_floor_and_the_counts_are_those_of_the_program(tmp_path, pairs):
    require_program()
    path = tmp_path / "case.nml"
    write_namelist(path, case(pairs, 3, {"start": 1022.0, "end": 1021.75, "n_points": 2,
                                         "unit": "Hz"}))
    rows = rows_of(path)
    for name, row in rows.items():
        seconds, least = float(row["seconds"]), float(row["floor"])
        assert math.isfinite(seconds) and math.isfinite(least), name
        assert (least > 0.0) == (name not in WITHOUT_FLOOR), name
    done = subprocess.run([PROGRAM, path, "-o", tmp_path / "case.h5"], capture_output=True,
                          text=True, check=True)
    assert ("static stiffness" in done.stdout) == (pairs == 48)
    counts = re.search(r"iterations +(\d+)\n[^$]*?(\d+) Krylov iterations, (\d+) preconditioners",
                       done.stdout)
    steps, krylov, builds = map(int, counts.groups())
    assert int(rows["derivative of the forces"]["calls"]) == steps
    assert int(rows["preconditioner: build"]["calls"]) == builds
    # One product more in each solution: it checks what the iterations believe.
    assert int(rows["product with the derivative"]["calls"]) == krylov + steps
