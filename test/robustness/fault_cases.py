"""A run that takes its time, and the ways to end it."""
import subprocess

import h5py
import numpy as np

#: Long enough that no machine finishes it before it is stopped.
N_POINTS = 1000000
#: Points after which a run is at work.
SEEN = 300
#: Runs of different lengths take frequencies that differ by round-off.
SAME = 1e-11
#: Of a run that is to be complete.
SHORT = 40

CASE = """&case threads = 1 /
&model n_dof = 2 mass = 1 0 0 1 stiffness = 2 -1 -1 2 rayleigh_stiffness = 0.01 /
&contact n_pairs = 1 side_1 = 2 0 0 mu = 0.3 normal_load = 1 /
&load cosine = 1 0 /
&harmonics n_harmonics = 5 n_time = 256 /
&sweep start = 0.5 end = 0.5001 n_points = 40 /
"""


class Case:
    """A sweep in a folder of its own. The step is the same for every number of points."""

    def __init__(self, program, folder):
        self.program, self.folder = program, folder
        self.result = folder / "x.h5"
        (folder / "case.nml").write_text(CASE)
        self._reference = None

    def arguments(self, length, extra=()):
        end = 0.5 + 1e-6*(length - 1)
        return [self.program, "-v", "-o", self.result, "--set", f"sweep%n_points={length}", "--set",
                f"sweep%end={end!r}", *extra, "case.nml"]

    def start(self, length=N_POINTS, **options):
        return subprocess.Popen(self.arguments(length), cwd=self.folder, text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)

    def run(self, *extra, length=SHORT, **options):
        return subprocess.run(self.arguments(length, extra), cwd=self.folder, text=True,
                              capture_output=True, timeout=120, check=False, **options)

    def complete(self):
        done = self.run()
        assert done.returncode == 0, done.stderr

    def refused(self, *extra):
        assert self.run(*extra).returncode == 3

    def files(self):
        return sorted(path.name for path in self.folder.iterdir() if path.is_file())

    def part(self):
        """The part that was begun last."""
        parts = sorted(self.folder.glob("x.h5.part*"), key=lambda path: (len(path.name), path.name))
        return parts[-1] if parts else None

    def wait_for_points(self, process, point=SEEN):
        """Until it has told of so many points; then it waits for somebody to read on."""
        for line in process.stderr:
            if line.startswith(f"point {point} of"):
                return
        raise AssertionError(f"ended before point {point}: {process.wait()}")

    def wait_for_saved_points(self, process):
        """Until a flush has saved some: it waits for 20 times what the one before took, which is
        long on a busy machine."""
        self.wait_for_points(process)
        while saved(self.part(), locking=False) == 0:
            for _ in range(SEEN):
                process.stderr.readline()
            assert process.poll() is None

    def kill(self, **options):
        process = self.start(**options)
        self.wait_for_saved_points(process)
        process.kill()
        process.communicate()

    def stop(self, number):
        process = self.start()
        self.wait_for_points(process)
        process.send_signal(number)
        errors = process.communicate(timeout=60)[1]
        return process.returncode, errors

    def saved(self):
        """Points in the part that was begun last, or in the result."""
        return saved(self.part() or self.result)

    def check_parts(self):
        """A part can be read, or is one that its run did not come to flush."""
        for path in self.folder.glob("x.h5.part*"):
            saved(path)

    def reference(self):
        """Points of an undisturbed run, in another folder."""
        if self._reference is None:
            folder = self.folder / "reference"
            folder.mkdir()
            other = Case(self.program, folder)
            assert other.run(length=2000).returncode == 0
            with h5py.File(other.result) as file:
                self._reference = {name: file[name][:] for name in ("omega", "coefficients")}
        return self._reference

    def equals_reference(self, status="complete"):
        with h5py.File(self.result) as file:
            n = len(file["omega"])
            reference = self.reference()
            return (0 < n <= len(reference["omega"]) and np.all(file["converged"][:])
                    and file.attrs["status"] in (status.encode(), status)
                    and all(np.allclose(file[name][:], reference[name][:n], rtol=0, atol=SAME)
                            for name in reference))


def saved(path, locking=None):
    """Points of a file that nobody writes, or of one at work whose lock is passed over; 0 where
    its run did not come to flush it."""
    try:
        with h5py.File(path, locking=locking) as file:
            return len(file["omega"])
    except (OSError, KeyError):
        return 0
