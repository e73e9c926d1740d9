"""Nonlinear modes of a joint of 16 pairs, by GMRES: the solutions of LU, with and without the stuck
pairs in the linear problems; and the peaks of forced sweeps."""
import numpy as np
import pytest
from cases import merged, read, run
from mode_cases import REFERENCES, follow
from project import EXAMPLE

SECTOR = {"model": {"source": "hdf5", "file": EXAMPLE / "blade_sector" / "sector_16.h5",
                    "modal_damping": 1e-3, "rotation_speed": 460.8},
          "contact": {"law": "dlft", "mu": 0.5}, "output": {"observe": "tip"}}
ELASTIC = merged(SECTOR, {"contact": {"law": "penalty", "mu": 0.3,
                                      "tangential_stiffness": 3e5,
                                      "normal_stiffness": 3e5}})
CHAIN = REFERENCES["normal"]["groups"]
#: The tolerance of 1e-12 times the condition of the bordered matrix.
SOLVED = 1e-7


@pytest.mark.parametrize("control", ["observed", "modal"])
@pytest.mark.parametrize("name", ["rigid", "elastic", "small"])
def test_gmres_and_skips_change_nothing(tmp_path, name, control):
    """Frequency and damping are those of a dense factorization of all unknowns."""
    groups = {"rigid": SECTOR, "elastic": ELASTIC, "small": CHAIN}[name]
    start, end = (0.3, 1.5) if name == "small" else (0.3, 0.8)
    if control == "modal" and name != "small":
        # Of a unit tip displacement, in tonne**(1/2) mm.
        start, end = 2.754e-3 * start, 2.754e-3 * end
    found = {}
    for linear in ("lu", "krylov"):
        for skips in (False, True):
            found[linear, skips] = follow(
                tmp_path, groups, start, end, 3, n_points=4, control=control,
                changes={"solver": {"linear": linear, "skips": skips}})
    first = found["lu", False]
    assert first["converged"].all()
    assert first["contact/fraction"][-1, :, 0].min() < 1.0
    for other in found.values():
        assert other["omega"] == pytest.approx(first["omega"], rel=SOLVED)
        assert other["mode/damping_ratio"] == pytest.approx(first["mode/damping_ratio"],
                                                            rel=100 * SOLVED)


def test_synthesis_of_forced_peaks_of_the_sector(tmp_path):
    """Five loads: peaks of sweeps within 3 % in amplitude, 1e-4 in frequency."""
    groups = merged(SECTOR, {"load": {"harmonic_scale": 1.0}})
    found = follow(tmp_path, groups, 0.1, 1.5, 3, n_points=61, control="observed",
                   changes={"solver": {"tolerance": 1e-9}})
    scale, amplitude = found["mode/resonant_scale"], found["mode/first_harmonic"][:, 0]
    assert (np.diff(scale) > 0.0).all()
    for load in (0.1, 0.2, 0.4, 0.6, 0.9):
        expected = np.interp(load, scale, amplitude)
        omega = np.interp(load, scale, found["omega"])
        forced = merged(SECTOR, {
            "case": {"analysis": "frf"}, "load": {"harmonic_scale": load},
            "harmonics": {"n_harmonics": 3},
            "sweep": {"start": omega - 10.0, "end": omega + 10.0, "n_points": 41}})
        run(tmp_path, forced, name="forced")
        response = read(tmp_path / "forced.h5")
        first = np.hypot(response["coefficients"][:, 1, 0], response["coefficients"][:, 2, 0])
        peak = first.argmax()
        assert expected == pytest.approx(first[peak], rel=0.03)
        assert omega == pytest.approx(response["omega"][peak], rel=1e-4)
