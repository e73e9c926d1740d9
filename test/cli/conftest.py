"""What the tests of the command line share: the program, a small valid case, a model file."""
import subprocess

import pytest
from limits import limit
from project import PROGRAM, require_program

CASE = """&case title = 'test' /
&model
   n_dof = 2
   mass = 1 0
          0 1
   stiffness = 2 -1
              -1  2
   rayleigh_stiffness = 0.01 /
&contact
   n_pairs = 1
   side_1 = 2 0 0
   mu = 0.3
   normal_load = 1 /
&load cosine = 1 0 /
&harmonics
   n_harmonics = 3
   n_time = 64 /
&sweep
   start = 0.5
   end = 0.8
   n_points = 3 /
"""


class Runner:
    """The program in a directory of its own, with a namelist `case.nml` in it."""

    def __init__(self, directory):
        self.directory = directory
        self.write(CASE)

    def write(self, text, name="case.nml"):
        (self.directory / name).write_text(text)

    def edit(self, old, new):
        """Replace a part of the valid case; the line numbers stay where `new` has no more lines."""
        assert old in CASE
        self.write(CASE.replace(old, new))

    def __call__(self, *arguments):
        return subprocess.run([PROGRAM, *map(str, arguments)], cwd=self.directory, text=True,
                              capture_output=True, timeout=limit(60), check=False)

    def refused(self, *arguments, status=3):
        """Run what must be refused; return the message."""
        done = self(*(arguments or ["case.nml"]))
        assert done.returncode == status, done.stderr
        assert done.stdout == ""
        lines = done.stderr.splitlines()
        assert lines and all(line.startswith("fw_run: error: ") for line in lines), done.stderr
        return done.stderr


@pytest.fixture
def fw_run(tmp_path):
    require_program()
    return Runner(tmp_path)
