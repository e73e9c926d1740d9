"""Joints that are large enough for threads: the same bits with 1, 2 and 4 of them, and no more
waits than they are worth."""
import os
import subprocess

import h5py
import numpy as np
import pytest
from cases import read, write_namelist
from project import PROGRAM
from wear_cases import result

resource = pytest.importorskip("resource")

N_PAIRS = 72
#: Of 48 points: some 20,000 where all regions are shared, some 1,000 in the looks at whether that
#: would help, on a machine at rest; fewer beside others.
MOST_WAITS = 4000


@pytest.fixture
def chain(tmp_path):
    """A chain of masses on frictional ground, pressed less and less towards its loaded end."""
    n = 3 * N_PAIRS
    link = 2.0 * np.eye(N_PAIRS) - np.eye(N_PAIRS, k=1) - np.eye(N_PAIRS, k=-1)
    stiffness = np.kron(link, np.diag([40.0, 25.0, 10.0])) + np.eye(n)
    load = np.zeros((3, n))
    load[0, 2::3] = -np.linspace(1.5, 0.2, N_PAIRS)
    load[1, -3], load[1, -1], load[2, -2] = 6.0, 0.5, 3.0
    with h5py.File(tmp_path / "chain.h5", "w") as file:
        file.attrs.update(format="fretwear-model", format_version=1)
        file["mass"], file["stiffness"] = 0.5 * np.eye(n), stiffness
        file["damping"] = 0.02 * stiffness
        file["contact/side_1"] = np.arange(1, n + 1).reshape(N_PAIRS, 3)
        file["contact/side_2"] = np.zeros((N_PAIRS, 3), dtype=int)
        for name, row in zip(("static", "cosine", "sine"), load):
            file[f"load/{name}"] = row
    return tmp_path


def run(folder, threads, harmonics):
    groups = {"case": {"analysis": "frf", "threads": threads},
              "model": {"source": "hdf5", "file": "chain.h5"},
              "contact": {"mu": 0.4, "gap": 0.0, "area": 1.0},
              "harmonics": {"n_harmonics": 5, **harmonics},
              "sweep": {"start": 1.2, "end": 1.8, "n_points": 4}}
    return result(folder, groups, name=f"threads_{threads}")


@pytest.mark.parametrize("harmonics", [{"n_time": 64}, {"sampling": "events"}],
                         ids=["uniform", "events"])
def test_same_bits(chain, harmonics):
    one = run(chain, 1, harmonics)
    share = one["contact/fraction"]
    assert (share[-1, :, 0] == 1.0).any() and (share[-1, :, 1] > 0.0).any()
    for threads in (2, 4):
        found = run(chain, threads, harmonics)
        for name in ("coefficients", "contact/force", "iterations", "residual"):
            assert found[name].tobytes() == one[name].tobytes(), (threads, name)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs Linux")
def test_threads_without_processors_do_not_wait_for_each_other(chain):
    """Two threads that have one processor: one of them does the work soon. Each region that both
    share ends in a wait, which the system counts."""
    chosen = min(os.sched_getaffinity(0))
    waits, shared = [], []
    for threads in (1, 2):
        groups = {"case": {"analysis": "frf", "threads": threads},
                  "model": {"source": "hdf5", "file": "chain.h5"},
                  # Carried: no maxima are looked for, so that the work is that of the rows.
                  "contact": {"mu": 0.4, "gap": 0.0, "area": 1.0, "memory": "carried"},
                  "harmonics": {"n_harmonics": 5, "n_time": 64},
                  "sweep": {"start": 1.2, "end": 1.8, "n_points": 48}}
        write_namelist(chain / "busy.nml", groups)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_nvcsw
        subprocess.run(["taskset", "-c", str(chosen), PROGRAM, "-q", "busy.nml"], cwd=chain,
                       check=True)
        waits.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_nvcsw - before)
        shared.append(read(chain / "busy.h5")["coefficients"].tobytes())
    assert shared[0] == shared[1]
    assert waits[1] < waits[0] + MOST_WAITS, waits
