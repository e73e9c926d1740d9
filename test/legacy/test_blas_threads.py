"""Threads of OpenBLAS: one inside a run, beside the threads of the run; afterwards what was set."""
import ctypes

import pytest
from project import BUILD

LIBRARY = BUILD / "libfretwear.so"
OUTSIDE = 2
CASE = b"""
&case analysis = 'frf' threads = 2 /
&model n_dof = 2 mass = 1 0 0 1 stiffness = 2 -1 -1 2 damping = 0.1 0 0 0.1 /
&load cosine = 1 0 /
&harmonics n_harmonics = 1 /
&sweep start = 0.5 end = 1.5 n_points = 3 /
"""

pytestmark = pytest.mark.skipif(not LIBRARY.exists(), reason="this build has no shared library")


def test_blas_has_one_thread_inside_a_run(tmp_path):
    case = tmp_path / "case.nml"
    case.write_bytes(CASE)
    # What the library is linked with; NumPy has a BLAS of its own.
    library = ctypes.CDLL(str(LIBRARY))
    seen = []

    @ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    def on_progress(_user, _progress):
        seen.append(library.openblas_get_num_threads())
        return 0

    library.openblas_set_num_threads(OUTSIDE)
    if library.openblas_get_num_threads() != OUTSIDE:
        pytest.skip("this BLAS has one thread only")
    handle = ctypes.c_void_p()
    assert library.fw_create(ctypes.byref(handle)) == 0
    assert library.fw_load_file(handle, str(case).encode()) == 0
    assert library.fw_on_progress(handle, on_progress, None) == 0
    assert library.fw_run_case(handle) == 0
    assert library.fw_destroy(handle) == 0
    assert seen == [1, 1, 1]
    assert library.openblas_get_num_threads() == OUTSIDE
