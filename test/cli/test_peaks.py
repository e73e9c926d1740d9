"""The peak that a sweep of few points reports is the true one, or it says that it may not be."""
import re
import subprocess

import h5py
import numpy as np
import peak_family
import pytest
from cases import merged, read, run, write_namelist
from limits import limit
from project import PROGRAM

#: Sliders, friction, a stop and a cubic spring, down and up.
FEW = range(12)


@pytest.mark.parametrize("seed", range(20))
def test_a_linear_chain_has_its_highest_resonance_found(tmp_path, seed):
    groups, true = peak_family.linear(seed)
    run(tmp_path, groups)
    peak, remark = peak_family.reported(tmp_path / "case.h5")
    assert peak == pytest.approx(true, rel=peak_family.RIGHT) and not remark


@pytest.mark.parametrize("seed", FEW)
def test_a_nonlinear_peak_is_that_of_a_fine_sweep_or_has_a_remark(tmp_path, seed):
    groups, _, ratio = peak_family.nonlinear(seed)
    run(tmp_path, groups, status=(0, 4))
    peak, remark = peak_family.reported(tmp_path / "case.h5")
    true = peak_family.fine_peak(tmp_path, groups, ratio)
    if true is None or peak_family.stands_elsewhere(tmp_path / "case.h5", true):
        return
    assert remark or peak == pytest.approx(true, rel=peak_family.RIGHT)


@pytest.mark.parametrize(("gap", "load", "n_points"), [(0.5, 0.1, 21), (1.0, 0.05, 21),
                                                       (1.0, 0.2, 11), (2.0, 0.4, 15)])
def test_the_peak_of_an_oscillator_before_a_stop_is_climbed(tmp_path, gap, load, n_points):
    """Contact moves the mean of the vibration, the response jumps behind its peak, and with a gap
    of 1 a row of the sweep stands on the lower branch below it."""
    case = {"model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.02},
            "contact": {"n_pairs": 1, "law": "penalty", "side_1": [0, 0, -1], "gap": gap,
                        "normal_stiffness": 1.0},
            "load": {"cosine": load}, "harmonics": {"n_harmonics": 5},
            "sweep": {"start": 0.5, "end": 2.0, "n_points": n_points}}
    run(tmp_path, case)
    peak, remark = peak_family.reported(tmp_path / "case.h5")
    # Its branch, whose corners and turns are followed.
    run(tmp_path, merged(case, {"sweep": {"continuation": "arclength", "n_points": 401}}))
    with h5py.File(tmp_path / "case.h5") as file:
        true = file["peak/amplitude"][:].max()
    assert not remark and peak == pytest.approx(true, rel=peak_family.RIGHT)


def test_a_peak_whose_contact_moves_the_mean_is_resolved_by_a_few_rows(tmp_path):
    """A row far below, at another mean, was taken for one that rests: the search halved the way to
    the other neighbour until nothing was left of its solutions."""
    case = {"model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 0.53],
                      "stiffness": [2.87, -1.63, -1.63, 3.27],
                      "rayleigh_mass": 0.0158, "rayleigh_stiffness": 0.0158},
            "contact": {"n_pairs": 2, "law": "penalty", "side_1": [0, 0, -2, 0, 0, -2],
                        "gap": [-0.222, 0.283], "normal_stiffness": [2.2, 0.62]},
            "load": {"cosine": [0.386, 0.0], "sine": [-0.13, 0.0], "static": [0.0, 0.753]},
            "harmonics": {"n_harmonics": 7}, "output": {"observe": [1]},
            "sweep": {"start": 0.62, "end": 9.96, "n_points": 8}}
    run(tmp_path, case)
    peak, remark = peak_family.reported(tmp_path / "case.h5")
    run(tmp_path, merged(case, {"sweep": {"end": 2.0, "n_points": 801}}))
    with h5py.File(tmp_path / "case.h5") as file:
        true = file["peak/amplitude"][:].max()
    assert not remark and peak == pytest.approx(true, rel=peak_family.RIGHT)


@pytest.mark.parametrize(("seed", "true"), [(297, 4.270588), (417, 0.597972)])
def test_two_peaks_side_by_side_are_not_taken_for_one(tmp_path, seed, true):
    """A resonance that goes on behind a dip, which falls from there all at once, and two humps that
    three rows show as one: `fine_peak` of these takes minutes."""
    groups = peak_family.nonlinear(seed)[0]
    run(tmp_path, groups)
    peak, remark = peak_family.reported(tmp_path / "case.h5")
    assert remark or peak == pytest.approx(true, rel=peak_family.RIGHT)


def test_the_mode_of_a_free_joint_is_looked_for_between_rows_that_half_slip(tmp_path):
    """The joint sticks at the row below the mode and slips for three quarters of the period at the
    one above; at its resonance it is as good as free. The other maximum shows in the rows."""
    case = {"model": {"n_dof": 3, "modal_damping": 0.0248,
                      "mass": [1.984, 0.3678, -0.1706, 0.3678, 1.15, -0.05411, -0.1706, -0.05411,
                               1.084],
                      "stiffness": [1.276, -0.3433, 0.5373, -0.3433, 2.177, -1.885, 0.5373,
                                    -1.885, 4.539]},
            "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "mu": 0.3,
                        "normal_load": 1.129, "tangential_stiffness": 1.276},
            "load": {"cosine": [-0.7676, 0.5611, -2.764]}, "harmonics": {"n_harmonics": 3},
            "sweep": {"start": 0.1, "end": 2.0, "n_points": 6}, "solver": {"tolerance": 1e-10}}
    highest = []
    for n_points in (6, 951):
        run(tmp_path, merged(case, {"sweep": {"n_points": n_points}}))
        with h5py.File(tmp_path / "case.h5") as file:
            peaks = file["peak"]
            highest.append(peaks["amplitude"][:][peaks["observed"][:] == 0].max())
    assert highest[0] == pytest.approx(highest[1], rel=peak_family.RIGHT)


#: Closed by interference, and opened and closed by its resonance, which lies at 0.741 between the
#: free frequency of 0.606 and the closed one of 1.30.
LIFTING = {"model": {"n_dof": 3, "mass": np.diag([0.5347588663713378, 1.075383875998595,
                                                 1.003718112899173]).ravel().tolist(),
                     "stiffness": [4.297789494168742, -2.337477129314179, 0.0, -2.337477129314179,
                                   3.2711742735280267, -0.9336971442138475, 0.0,
                                   -0.9336971442138475, 0.9336971442138475],
                     "damping": [0.010262351442032459, -0.0038737743831774897,
                                 -0.00041147216809840224, -0.0038737743831774897,
                                 0.011559201736420457, -0.0028926704202611965,
                                 -0.00041147216809840224, -0.0028926704202611965,
                                 0.006156013438880006]},
           "contact": {"n_pairs": 1, "law": "penalty", "side_1": [3, 0, 1],
                       "mu": 0.7639307080880463, "gap": -0.054173792978745555,
                       "tangential_stiffness": 2.559687975278523,
                       "normal_stiffness": 2.2412555070596882},
           "load": {"cosine": [1.1692588203710945, -2.1288837686011512, 0.0]},
           "harmonics": {"accuracy": 0.01}, "output": {"observe": [3]},
           "sweep": {"start": 0.571821083864488, "end": 2.8591054193224403, "n_points": 61}}


def test_a_resonance_between_free_and_closed_joint_is_found(tmp_path):
    """No mode of the joint stands there, and the rows beside it are ten times lower."""
    run(tmp_path, LIFTING)
    peak, remark = peak_family.reported(tmp_path / "case.h5")
    # Shooting in time and a march from near rest, whose motion has all harmonics.
    assert not remark and peak == pytest.approx(111.86, rel=2e-3)


@pytest.mark.parametrize("n_points", [21, 31])
def test_it_is_found_beside_a_lower_solution_where_few_points_are_asked_for(tmp_path, n_points):
    """Newton's method fails from the rows (21), or a row beside it stands on its flank (31)."""
    few = {"harmonics": {"accuracy": None, "n_harmonics": 3}, "sweep": {"n_points": n_points}}
    run(tmp_path, merged(LIFTING, few))
    peak, remark = peak_family.reported(tmp_path / "case.h5")
    # That of 81 and of 161 rows with the same harmonics.
    assert not remark and peak == pytest.approx(118.266, rel=2e-3)


def test_rows_too_far_apart_for_the_resonances_of_a_lifting_joint_are_said(tmp_path):
    few = merged(LIFTING, {"harmonics": {"accuracy": None, "n_harmonics": 3}})
    found = []
    for n_points in (6, 121):
        run(tmp_path, merged(few, {"sweep": {"n_points": n_points}}))
        found.append("another peak" in remarks(tmp_path / "case.h5"))
    assert found == [True, False]


def test_rows_stay_those_that_were_asked_for(tmp_path):
    groups, _ = peak_family.linear(1)
    sweep = groups["sweep"]
    run(tmp_path, groups)
    with h5py.File(tmp_path / "case.h5") as file:
        assert np.allclose(file["omega"][:], np.linspace(sweep["start"], sweep["end"],
                                                         sweep["n_points"]), rtol=1e-15)
        width, omega = file["peak/bandwidth"][:], file["peak/omega"][:]
        coefficients, amplitude = file["peak/coefficients"][:], file["peak/amplitude"][:]
        best = amplitude.argmax()
    # Half-power width of a mode of its damping: 2 zeta omega, but for the tails of the others.
    expected = 2.0 * groups["model"]["modal_damping"] * omega[best]
    assert width[best] == pytest.approx(expected, rel=0.02)
    assert np.hypot(*coefficients[best, 1:3]) == pytest.approx(amplitude[best], rel=1e-6)


@pytest.mark.parametrize("kind", ["powell", "kinsol", "pseudo_time"])
def test_peaks_are_solved_by_newton_whatever_solves_the_rows(tmp_path, kind):
    groups, _ = peak_family.linear(2)
    run(tmp_path, groups)
    with h5py.File(tmp_path / "case.h5") as file:
        expected = file["peak/amplitude"][:]
    write_namelist(tmp_path / "case.nml", groups | {"solver": {"kind": kind}})
    summary = subprocess.run([PROGRAM, "case.nml"], cwd=tmp_path, capture_output=True, text=True,
                             check=True).stdout
    with h5py.File(tmp_path / "case.h5") as file:
        assert file["peak/amplitude"][:] == pytest.approx(expected, rel=1e-6)
        served = {file["served_by"].attrs["names"][code] for code in file["served_by"][:]}
    assert kind.replace("_", "-") in served
    points, iterations = map(int, re.search(r"peaks +(\d+) more points, (\d+)",
                                            summary).groups())
    # A linear structure takes Newton's method one step.
    assert iterations <= points


@pytest.mark.parametrize("static", [0.0, 100.0])
def test_a_static_load_hides_no_peak_and_its_width_is_that_of_the_vibration(tmp_path, static):
    damping, force = 0.002, 0.01
    run(tmp_path, {
        "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": damping},
        "load": {"static": static, "cosine": force},
        "harmonics": {"n_harmonics": 1},
        "sweep": {"start": 0.5, "end": 2.0, "n_points": 11}})
    with h5py.File(tmp_path / "case.h5") as file:
        best = file["peak/amplitude"][:].argmax()
        amplitude, width = file["peak/amplitude"][best], file["peak/bandwidth"][best]
    # Of a mode of weak damping, to the first order in it.
    assert amplitude - static == pytest.approx(force / damping, rel=peak_family.RIGHT)
    assert width == pytest.approx(damping, rel=0.02)


@pytest.mark.parametrize("down", [False, True])
def test_refined_rows_hold_the_peak_in_the_order_of_the_sweep(tmp_path, down):
    groups, true = peak_family.linear(3)
    sweep = {**groups["sweep"], "refine": True}
    if down:
        sweep["start"], sweep["end"] = sweep["end"], sweep["start"]
    run(tmp_path, {**groups, "sweep": sweep})
    with h5py.File(tmp_path / "case.h5") as file:
        steps = np.diff(file["omega"][:])
        assert (steps < 0.0).all() if down else (steps > 0.0).all()
        assert len(steps) >= sweep["n_points"]
        amplitude, rows = file["amplitude"][:, 0], file["coefficients"][:, :, 0]
        assert np.allclose(np.hypot(rows[:, 1], rows[:, 2]), amplitude, rtol=1e-6)
        assert amplitude.max() == file["peak/amplitude"][:].max()
    assert amplitude.max() == pytest.approx(true, rel=peak_family.RIGHT)


def branched(groups, **extra):
    """The same along a branch: a spring of nothing makes unknowns of a linear structure."""
    return {**groups, "spring": {"n_springs": 1, "side_1": 1, "coefficient": 1e-30, "power": 3},
            "sweep": {**groups["sweep"], "continuation": "arclength", **extra}}


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("down", [False, True])
def test_a_branch_solves_for_its_maxima(tmp_path, seed, down):
    groups, true = peak_family.linear(seed)
    ends = (groups["sweep"]["start"], groups["sweep"]["end"])
    start, end = ends[::-1] if down else ends
    run(tmp_path, branched(groups, start=start, end=end))
    with h5py.File(tmp_path / "case.h5") as file:
        best = file["peak/amplitude"][:].argmax()
        omega, width = file["peak/omega"][best], file["peak/bandwidth"][best]
        assert file["peak/found_by"][best] in (0, 1)
        assert file["peak/amplitude"][best] >= file["amplitude"][:, 0].max()
        assert file["peak/amplitude"][best] == pytest.approx(true, rel=1e-5)
    # But for the tails of the other modes.
    assert width == pytest.approx(2.0 * groups["model"]["modal_damping"] * omega, rel=0.1)


def test_a_branch_that_ends_on_its_flank_says_so(tmp_path):
    groups, _ = peak_family.linear(0)
    start = groups["sweep"]["start"]
    run(tmp_path, branched(groups, start=start, end=1.05 * start))
    with h5py.File(tmp_path / "case.h5") as file:
        names = list(file["peak/found_by"].attrs["names"])
        found = [names[k] for k in file["peak/found_by"][:]]
        assert found == ["end of the sweep"]
        assert file["peak/amplitude"][0] == file["amplitude"][-1, 0]


def test_integration_in_time_has_the_peaks_of_its_rows(tmp_path):
    groups = merged(PLAIN, {"case": {"analysis": "time"}, "sweep": {"n_points": 9},
                            "contact": {"law": "penalty", "tangential_stiffness": 1.0}})
    run(tmp_path, groups)
    with h5py.File(tmp_path / "case.h5") as file:
        amplitude = file["amplitude"][:, 0]
        assert file["peak/amplitude"][:].max() == amplitude.max()


@pytest.mark.parametrize("change", [
    {"sweep": {"continuation": "arclength"}}, {"case": {"analysis": "point"}},
    {"case": {"analysis": "time"}}, {"sweep": {"n_points": 1}}, {"contact": {"memory": "carried"}}])
def test_refinement_is_refused_where_nothing_is_looked_for(tmp_path, change):
    groups = merged(merged(PLAIN, {"sweep": {"refine": True}}), change)
    write_namelist(tmp_path / "case.nml", groups)
    done = subprocess.run([PROGRAM, "-q", "case.nml"], cwd=tmp_path, capture_output=True, text=True,
                          check=False, timeout=limit(20))
    assert done.returncode == 3 and "sweep%refine" in done.stderr, done.stderr


def test_a_peak_at_the_end_of_the_sweep_is_said(tmp_path):
    groups, _ = peak_family.linear(0)
    groups["sweep"]["end"] = groups["sweep"]["start"] * 1.05
    run(tmp_path, groups)
    assert peak_family.reported(tmp_path / "case.h5")[1]


def test_a_frequency_named_twice_is_no_maximum(tmp_path):
    """Rows that repeat each other were neighbours of no width: maxima that are none, and none that
    could be resolved."""
    slider = merged(PLAIN, {"sweep": {"start": None, "end": None, "n_points": None}})
    found = []
    for name, values in (("once", [0.9, 1.0, 1.1, 0.8]),
                         ("again", [0.9, 1.0, 1.0, 1.1, 0.8, 0.8, 1.0])):
        run(tmp_path, merged(slider, {"sweep": {"values": values}}), name=name)
        found.append(read(tmp_path / f"{name}.h5"))
        assert len(found[-1]["omega"]) == len(values)
        assert remarks(tmp_path / f"{name}.h5") == []
    for name in ("peak/omega", "peak/amplitude"):
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-4)


#: A slider that nothing is wrong with, and a change to it with the remark that it draws.
PLAIN = {"case": {"analysis": "frf"},
         "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.05},
         "contact": {"n_pairs": 1, "law": "dlft", "side_1": [1, 0, 0], "mu": 0.3,
                     "normal_load": 1.0},
         "load": {"cosine": 1.0}, "harmonics": {"n_harmonics": 3},
         "sweep": {"start": 0.5, "end": 1.5, "n_points": 11}}
REMARKS = {"negative stiffness": {"model": {"stiffness": -1.0}},
           "negative mass": {"model": {"n_dof": 2, "mass": [1.0, 2.0, 2.0, 1.0],
                                       "stiffness": [2.0, -1.0, -1.0, 2.0],
                                       "damping": [0.05, 0.0, 0.0, 0.05]},
                             "load": {"cosine": [1.0, 0.0]}},
           "negative damping": {"model": {"damping": -0.05}},
           "high friction": {"contact": {"mu": 30.0}},
           "no load": {"load": {"cosine": 0.0}},
           "one harmonic": {"harmonics": {"n_harmonics": 1}},
           "accuracy chosen": {"harmonics": {"n_harmonics": None},
                               "contact": {"law": "penalty", "tangential_stiffness": 1.0}},
           "law chosen": {"contact": {"law": None}},
           "no mode": {"sweep": {"start": 3.0, "end": 4.0}},
           "peak at the end": {"sweep": {"start": 0.2, "end": 0.5}}}


def remarks(path):
    with h5py.File(path) as file:
        return [name.decode() for name in file["remarks/name"][:]] if "remarks" in file else []


@pytest.mark.parametrize("name", [None, *REMARKS])
def test_what_is_seldom_meant_is_said_and_ends_nothing(tmp_path, name):
    write_namelist(tmp_path / "case.nml", merged(PLAIN, REMARKS.get(name, {})))
    done = subprocess.run([PROGRAM, "case.nml"], cwd=tmp_path, text=True, capture_output=True,
                          check=False, timeout=limit(60))
    assert done.returncode == 0, done.stderr
    found = remarks(tmp_path / "case.h5")
    assert name in found if name else found == []
    assert done.stdout.count("\nremark ") == len(found)


@pytest.mark.parametrize("law", ["dlft", "dlft_velocity", "rigid", "penalty"])
@pytest.mark.parametrize("last_digit", [0.0, 4e-16])
@pytest.mark.parametrize("gap", [-0.05, 0.0, 0.05])
def test_a_load_that_moves_no_joint_converges(tmp_path, law, last_digit, gap):
    """Two bodies pressed together, or just touching, and driven alike: the load on the joint is
    round-off."""
    mass, omega = np.diag([1.0, 0.3]), 0.5965
    body = np.array([[3.0, -1.0], [-1.0, 1.7]])
    stiffness = np.kron(np.diag([1.0, 1.0 + last_digit]), body)
    case = {"case": {"analysis": "point"},
            "model": {"n_dof": 4, "mass": np.kron(np.eye(2), mass).ravel().tolist(),
                      "stiffness": stiffness.ravel().tolist(), "rayleigh_stiffness": 0.01},
            "contact": {"n_pairs": 1, "side_1": [1, 0, 2], "side_2": [3, 0, 4], "mu": 0.3,
                        "gap": gap, "law": law},
            "load": {"cosine": [0.3, 1.0, 0.3, 1.0]}, "harmonics": {"n_harmonics": 5},
            "sweep": {"start": omega}, "output": {"observe": [1, 2, 3, 4]}}
    if law == "penalty":
        case["contact"] |= {"tangential_stiffness": 3.0, "normal_stiffness": 3.0}
    if law != "rigid":
        case["harmonics"] |= {"n_time": 192, "sampling": "uniform"}
    run(tmp_path, case)
    u = np.linalg.solve(body * (1.0 + 0.01j * omega) - omega**2 * mass, [0.3, 1.0])
    with h5py.File(tmp_path / "case.h5") as file:
        found = file["coefficients"][0]
    # What is left of the joint's round-off is less than the tolerance of the solver.
    assert np.abs(found[1] - 1j * found[2] - np.tile(u, 2)).max() < 1e-8 * np.abs(u).max()
    assert np.abs(found[3:]).max() < 1e-8 * np.abs(u).max()
