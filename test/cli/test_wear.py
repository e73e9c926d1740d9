"""Analysis 'wear' through the command line: exact solutions, orders, ends, files.

References are those of oracle_g_wear.json: W1 prescribed slip, W2 two pairs that share a load, W3
an oscillator whose friction wears away.
"""
import numpy as np
import pytest
from cases import merged, read, run
from limits import limit
from wear_cases import REFERENCE, joint, oscillator, prescribed_slip, result, shared_load

# Asked for; with this tolerance of a step the depths are off by 3e-6 at most.
REQUIRED = 1e-4
ERROR_TOLERANCE = 1e-5


def table(name):
    return [row for row in REFERENCE[name]["table"] if row["n"] > 0]


def reference_depth(name, n):
    column = "W1" if name == "W2" else "W"
    return next(row[column] for row in REFERENCE[name]["table"] if row["n"] == n)


@pytest.mark.parametrize("scheme", ["implicit", "explicit"])
@pytest.mark.parametrize(("name", "case"), [("W1", prescribed_slip), ("W2", shared_load)])
def test_depths_at_the_tabled_cycles(tmp_path, name, case, scheme):
    for row in table(name):
        n = row["n"]
        found = result(tmp_path, case(scheme=scheme, error_tolerance=ERROR_TOLERANCE, n_cycles=n))
        assert found["wear/depth"][-1, 0] == pytest.approx(reference_depth(name, n), rel=REQUIRED)
        # A joint may come to rest before its cycles are over.
        if found["wear"]["steady_state"] == "not reached":
            assert found["wear/cycles"][-1] == n
        assert found["converged"].all()


def test_load_moves_to_the_pair_that_sticks(tmp_path):
    p = REFERENCE["W2"]["params"]
    found = result(tmp_path, shared_load(error_tolerance=ERROR_TOLERANCE))
    assert found["wear"]["steady_state"] == "reached"
    assert found["attributes"]["steady_state"] == "reached"
    assert np.abs(found["wear/depth"][:, 1]).max() == 0.0
    assert found["wear/depth"][-1, 0] == pytest.approx(REFERENCE["W2"]["W1_inf"], rel=REQUIRED)
    assert -found["contact/force"][-1, 0, :, 2] == pytest.approx([0.0, p["P"]], abs=1e-5)


def test_stability_of_worn_rows(tmp_path):
    """The multipliers of a row are those of a point with a gap of its depth."""
    groups = {
        "case": {"analysis": "wear"}, "model": {
            "n_dof": 2, "mass": [1.0, 0.0, 0.0, 0.0], "stiffness": [1.0, 0.0, 0.0, 2.0],
            "damping": [0.1, 0.0, 0.0, 0.0]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": 0.5, "area": 1.0,
                    "tangential_stiffness": 1.0, "normal_stiffness": 10.0},
        "load": {"static": [0.0, -1.0], "cosine": [1.0, 0.0]},
        "harmonics": {"n_harmonics": 5, "n_time": 512}, "sweep": {"start": 0.9, "stability": True},
        "wear": {"coefficient": 1e-3, "n_cycles": 10, "max_depth_step": 0.02}}
    run(tmp_path, groups)
    worn = read(tmp_path / "case.h5")
    assert (worn["floquet/stable"] == 1).all()
    for row in (0, -1):
        point = merged(groups, {"case": {"analysis": "point"}, "contact": {
            "gap": worn["wear/depth"][row, 0]}})
        del point["wear"]
        run(tmp_path, point, name="own")
        own = read(tmp_path / "own.h5")
        # Tolerances of 1e-8 of the balances.
        assert worn["floquet/multipliers"][row] == pytest.approx(
            own["floquet/multipliers"][0], abs=1e-6)


# Depth steps that give 8, 15 and 29 steps to 100 cycles; the 4th order is at round-off then.
DEPTH_STEPS = [0.01, 0.005, 0.0025]
COARSE = [0.02, 0.01]


@pytest.mark.parametrize(("scheme", "order", "depth_steps"), [
    ("explicit", 1, DEPTH_STEPS), ("explicit", 2, DEPTH_STEPS), ("implicit", 1, DEPTH_STEPS),
    ("implicit", 2, DEPTH_STEPS), ("implicit", 3, DEPTH_STEPS), ("implicit", 4, COARSE)])
def test_order_of_convergence(tmp_path, scheme, order, depth_steps):
    exact = reference_depth("W1", 100)
    steps, errors = [], []
    for depth_step in depth_steps:
        found = result(tmp_path, prescribed_slip(scheme=scheme, order=order, n_cycles=100.0,
                                                 max_depth_step=depth_step))
        steps.append(len(found["omega"]) - 1)
        errors.append(abs(found["wear/depth"][-1, 0] - exact))
    slopes = np.diff(np.log(errors)) / -np.diff(np.log(steps))
    # One percent of a slope is what the unevenness of the steps leaves at order 1.
    assert slopes == pytest.approx(order, rel=0.2)


def test_halved_steps_tell_the_error(tmp_path):
    """check_steps: at order 1 the change is half of the error, at the price of a second run."""
    exact = reference_depth("W1", 100)
    found = result(tmp_path, prescribed_slip(max_depth_step=0.005, n_cycles=100.0,
                                             check_steps=True))
    depth, halved = found["wear/depth"][-1, 0], found["wear/depth_halved"][0]
    assert found["wear"]["profile_change"] == pytest.approx(abs(halved - depth) / depth, rel=1e-12)
    assert abs(halved - exact) / abs(depth - exact) == pytest.approx(0.5, rel=0.1)
    own = result(tmp_path, prescribed_slip(max_depth_step=0.0025, n_cycles=100.0))
    assert halved == own["wear/depth"][-1, 0]
    plain = result(tmp_path, prescribed_slip(max_depth_step=0.005, n_cycles=100.0))
    assert "profile_change" not in plain["wear"] and "wear/depth_halved" not in plain


def test_halved_steps_under_error_control(tmp_path):
    case = prescribed_slip(error_tolerance=1e-3, n_cycles=100.0)
    found = result(tmp_path, merged(case, {"wear": {"check_steps": True}}))
    exact = reference_depth("W1", 100)
    error = abs(found["wear/depth"][-1, 0] - exact) / exact
    assert found["wear"]["profile_change"] == pytest.approx(error, rel=0.3)


def test_no_comparison_without_an_end(tmp_path):
    done = run(tmp_path, prescribed_slip(max_depth_step=0.005, check_steps=True, max_steps=3),
               status=4)
    assert done.stdout == ""
    assert "profile_change" not in read(tmp_path / "case.h5")["wear"]


def test_truncation_of_the_velocity_law(tmp_path):
    """W3 with the velocity law: the wear rate converges from below, slower than 1/H.

    Friction on a dof with mass is a square wave: its series is what costs here, not the wear.
    """
    p = REFERENCE["W3"]["params"]
    exact = p["kwA"] * p["N0"] * 4.0 * REFERENCE["W3"]["table"][0]["xmax"]
    errors = []
    for n_harmonics in (7, 15, 31):
        found = result(tmp_path, oscillator(n_harmonics, n_cycles=1e-6))
        errors.append(found["wear/rate"][0, 0] / exact - 1.0)
    assert np.all(np.array(errors) < 0.0)
    assert abs(errors[-1]) < 6e-3
    slopes = -np.diff(np.log(np.abs(errors))) / np.log(2.0)
    assert np.all((slopes > 0.6) & (slopes < 1.2)), (errors, slopes)


@pytest.mark.parametrize("n_harmonics", [1, 15])
def test_a_mass_wears_exactly(tmp_path, n_harmonics):
    """W3 with the rigid law: the first rate to round-off, whatever H, and the depths at all cycles.

    10 times the iteration's tolerance for the rate; for the depths the error asked for.
    """
    p = REFERENCE["W3"]["params"]
    exact = p["kwA"] * p["N0"] * 4.0 * REFERENCE["W3"]["table"][0]["xmax"]
    for row in REFERENCE["W3"]["table"][1:]:
        case = oscillator(n_harmonics, "rigid", error_tolerance=ERROR_TOLERANCE,
                          n_cycles=float(row["n"]))
        del case["harmonics"]["n_time"]
        found = result(tmp_path, case)
        assert found["wear/rate"][0, 0] == pytest.approx(exact, rel=1e-9)
        n = np.searchsorted(found["wear/cycles"], row["n"] - 1e-9)
        assert found["wear/depth"][n, 0] == pytest.approx(row["W"], rel=ERROR_TOLERANCE)


def test_oscillator_wears_free(tmp_path):
    """W3: most of its error is that of the first rates; the end is exact."""
    found = result(tmp_path, oscillator(25, error_tolerance=ERROR_TOLERANCE, n_cycles=200.0))
    n = np.searchsorted(found["wear/cycles"], 200.0)
    assert found["wear/depth"][n, 0] == pytest.approx(reference_depth("W3", 200), rel=REQUIRED)
    amplitude = REFERENCE["W3"]["table"][-1]["xmax"]
    assert found["amplitude"][n, 0] == pytest.approx(amplitude, rel=1e-3)


def test_stuck_joint_wears_nothing(tmp_path):
    """Exactly nothing, said after the first solution."""
    p = REFERENCE["W1"]["params"]
    load = 0.9 * p["mu"] * p["p0"]
    found = result(tmp_path, merged(prescribed_slip(), {"load": {"cosine": [load, 0.0]}}))
    assert found["wear"]["steady_state"] == "reached"
    assert len(found["wear/depth"]) == 1
    assert found["wear/depth"][0, 0] == 0.0 and found["wear/rate"][0, 0] == 0.0
    assert "nothing wears" in found["wear"]["ending"]


def sliding_block(**wear):
    """A pair under a constant load: nothing that it loses lightens it."""
    return joint({"n_dof": 1, "mass": 0.0, "stiffness": 5.0},
                 {"n_pairs": 1, "side_1": [1, 0, 0], "mu": 0.5, "area": 2.0, "normal_load": 1.0},
                 {"cosine": 1.5}, 1.0, 1e-3, wear)


def test_gross_slip_is_no_steady_state(tmp_path):
    found = result(tmp_path, sliding_block())
    assert found["wear"]["steady_state"] == "none: gross slip"
    assert len(found["omega"]) < 10, "it is seen early"
    # Area times rate: coefficient times load times the way 4 (a - mu N/k).
    assert found["wear/rate"][-1, 0] == pytest.approx(1e-3 * 4.0 * (0.3 - 0.1) / 2.0, rel=1e-9)


def test_energy_law_is_archard_with_the_coefficient_times_mu(tmp_path):
    p = REFERENCE["W1"]["params"]
    wear = {"error_tolerance": 1e-4, "n_cycles": 100.0}
    energy = result(tmp_path, prescribed_slip(law="energy", coefficient=p["kwA"] / p["mu"], **wear))
    archard = result(tmp_path, prescribed_slip(**wear))
    assert energy["wear/depth"] == pytest.approx(archard["wear/depth"], rel=1e-12)
    assert energy["wear/energy"] == pytest.approx(archard["wear/energy"], rel=1e-12)


def test_energy_is_that_of_the_hysteresis(tmp_path):
    """Friction energy grows by the dissipation of every cycle."""
    found = result(tmp_path, prescribed_slip(error_tolerance=1e-6, n_cycles=200.0))
    work = np.trapezoid if hasattr(np, "trapezoid") else np.trapz
    cycles, dissipation = found["wear/cycles"], found["contact/dissipation"][:, 0]
    # The trapezoidal rule over the steps of the run is what limits this.
    assert found["wear/energy"][-1, 0] == pytest.approx(work(dissipation, cycles), rel=1e-3)


def test_volume_per_patch(tmp_path):
    """Patches come with a model file; without them all pairs are one."""
    found = result(tmp_path, merged(shared_load(error_tolerance=1e-4, n_cycles=100.0),
                                    {"contact": {"area": [2.0, 3.0]}}))
    assert found["wear/patch"].tolist() == [b"all"]
    volume = found["wear/depth"] @ np.array([2.0, 3.0])
    assert found["wear/volume"][:, 0] == pytest.approx(volume, rel=1e-14)


@pytest.mark.parametrize("scheme", ["implicit", "pseudo_time"])
def test_both_ways_to_the_steady_profile(tmp_path, scheme):
    found = result(tmp_path, shared_load(scheme=scheme, max_depth_step=0.01))
    assert found["wear"]["steady_state"] == "reached"
    assert found["wear/depth"][-1] == pytest.approx([REFERENCE["W2"]["W1_inf"], 0.0], abs=1e-5)


# -------------------------------------------------------------------------------- follow_resonance

def test_frequency_is_that_of_the_peak(tmp_path):
    """Before any wear: against a sweep across the peak."""
    case = oscillator(7, n_cycles=1e-6, follow_resonance=True)
    found = result(tmp_path, case)
    omega = found["omega"][0]
    span = 0.02
    sweep = {**case, "case": {"analysis": "frf", "threads": 1},
             "sweep": {"start": omega - span, "end": omega + span, "n_points": 41}}
    curve = result(tmp_path, sweep, name="sweep")
    assert found["amplitude"][0, 0] >= curve["amplitude"][:, 0].max() * (1.0 - 1e-7)
    parabola = np.polyfit(curve["omega"] - omega, curve["amplitude"][:, 0], 4)
    roots = np.roots(np.polyder(parabola))
    peak = roots[np.abs(roots).argmin()].real
    half_width = 0.05
    assert abs(peak) < 5e-3 * half_width


def test_following_is_of_second_order(tmp_path):
    """The frequency is held during a step, but at a peak the amplitude is stationary in it."""
    depths = []
    for depth_step in (0.05, 0.025, 0.0125, 0.00625):
        found = result(tmp_path, oscillator(7, order=3, n_cycles=20.0, follow_resonance=True,
                                            max_depth_step=depth_step))
        depths.append(found["wear/depth"][-1, 0])
        assert np.all(np.diff(found["omega"]) > 0.0), "friction fades: the peak moves up"
    ratios = np.diff(depths)[:-1] / np.diff(depths)[1:]
    assert np.all((ratios > 3.0) & (ratios < 5.0)), (depths, ratios)
    # Six steps to a depth of 0.29.
    assert abs(depths[0] / depths[-1] - 1.0) < 1e-4


def test_following_wears_more_than_standing_still(tmp_path):
    wear = {"error_tolerance": 1e-3, "n_cycles": 20.0}
    moving = result(tmp_path, oscillator(7, follow_resonance=True, **wear))
    still = result(tmp_path, oscillator(7, **wear))
    assert np.all(still["omega"] == still["omega"][0])
    assert moving["omega"][-1] != moving["omega"][0]
    assert moving["wear/depth"][-1, 0] > 1.05 * still["wear/depth"][-1, 0]


# ------------------------------------------------------------------------------------- contact worn

@pytest.fixture
def worn(tmp_path):
    """Folder with the result of 100 cycles of W2 as worn.h5."""
    case = shared_load(error_tolerance=ERROR_TOLERANCE, n_cycles=100.0)
    return tmp_path, case, result(tmp_path, case, name="worn")


def test_response_of_the_worn_joint(worn):
    """A point at the depths of a result is the last point of that result."""
    folder, case, old = worn
    point = merged({**case, "case": {"analysis": "point", "threads": 1}},
                   {"contact": {"worn": "worn.h5"}})
    new = result(folder, point)
    assert new["coefficients"][0] == pytest.approx(old["coefficients"][-1], abs=1e-9)
    assert new["contact/force"][0] == pytest.approx(old["contact/force"][-1], abs=1e-9)
    k = 4
    step = result(folder, merged(point, {"contact": {"worn_step": k}}))
    assert step["contact/force"][0] == pytest.approx(old["contact/force"][k - 1], abs=1e-9)


def test_gap_or_depth_is_the_same(worn):
    folder, case, old = worn
    point = {**case, "case": {"analysis": "point", "threads": 1}}
    by_depth = result(folder, merged(point, {"contact": {"worn": "worn.h5"}}))
    by_gap = result(folder, merged(point, {"contact": {"gap": old["wear/depth"][-1]}}))
    assert by_depth["coefficients"] == pytest.approx(by_gap["coefficients"], abs=1e-9)


def test_integration_in_time_starts_worn(tmp_path):
    """Depths reach the reference as well: a stop that is met later."""
    groups = {"case": {"analysis": "wear", "threads": 1},
              "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0], "damping": [0.2, 0.0, 0.0, 0.2],
                        "stiffness": [4.0, 0.0, 0.0, 1.0]},
              "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": 0.5,
                          "area": 1.0, "tangential_stiffness": 20.0, "normal_stiffness": 20.0},
              "load": {"cosine": [3.0, 0.5], "static": [0.0, -1.0]},
              "harmonics": {"n_harmonics": 21}, "sweep": {"start": 0.7},
              "wear": {"coefficient": 1e-3, "n_cycles": 20.0}, "time": {"steps_per_period": 2000}}
    old = result(tmp_path, groups, name="worn")
    assert old["wear/depth"][-1, 0] > 1e-2
    groups = merged(groups, {"contact": {"worn": "worn.h5"}})
    balance = result(tmp_path, merged(groups, {"case": {"analysis": "point"}}), name="point")
    time = result(tmp_path, merged(groups, {"case": {"analysis": "time"}}), name="time")
    assert time["amplitude"][0] == pytest.approx(balance["amplitude"][0], rel=2e-3)
    assert abs(old["amplitude"][0, 1] / time["amplitude"][0, 1] - 1.0) > 5e-3


def test_wear_goes_on_from_a_worn_joint(worn):
    """100 and another 100 cycles are 200; the depth is the whole, the energy that of this run."""
    folder, case, old = worn
    more = result(folder, merged(case, {"contact": {"worn": "worn.h5"}}))
    assert more["wear/cycles"][0] == 0.0
    assert more["wear/depth"][0].tolist() == old["wear/depth"][-1].tolist()
    assert more["wear/depth"][-1, 0] == pytest.approx(reference_depth("W2", 200), rel=REQUIRED)
    gained = more["wear/depth"][-1, 0] - old["wear/depth"][-1, 0]
    p = REFERENCE["W2"]["params"]
    assert more["wear/energy"][-1, 0] == pytest.approx(p["mu"] * gained / p["kwA"], rel=1e-9)
    assert more["wear/energy"][0].tolist() == [0.0, 0.0]


def test_effective_input_with_worn_reads_back(worn):
    folder, case, _ = worn
    point = merged({**case, "case": {"analysis": "point", "threads": 1}},
                   {"contact": {"worn": "worn.h5"}})
    text = run(folder, point, "--check").stdout
    (folder / "again.nml").write_text(text)
    assert f"worn = '{folder}/worn.h5'" in text
    first = result(folder, point)
    import subprocess

    from project import PROGRAM
    subprocess.run([PROGRAM, "-q", "again.nml"], cwd=folder, check=True, timeout=limit(60))
    # The name of the result is part of the effective input.
    again = read(folder / "case.h5")
    assert again["coefficients"].tobytes() == first["coefficients"].tobytes()


@pytest.mark.parametrize(("contact", "status", "words"), [
    ({"worn": "none.h5"}, 5, ["&contact worn", "none.h5: no such file"]),
    ({"worn": "model.h5"}, 3, ["&contact worn", "is no result file"]),
    ({"worn": "point.h5"}, 3, ["&contact worn", "without wear"]),
    ({"worn": "text.h5"}, 3, ["&contact worn", "text.h5: is not an HDF5 file"]),
    ({"worn": "worn.h5", "worn_step": 999}, 3, ["worn_step = 999", "steps"]),
    ({"worn_step": 2}, 3, ["worn_step = 2", "give worn"]),
    ({"worn": "worn.h5", "n_pairs": 1, "side_1": [1, 0, 3]}, 3, ["2 pairs", "this case has 1"])])
def test_wrong_worn(worn, contact, status, words):
    import h5py
    folder, case, _ = worn
    point = {**case, "case": {"analysis": "point", "threads": 1}}
    run(folder, point, name="point")
    (folder / "text.h5").write_text("no result")
    with h5py.File(folder / "model.h5", "w") as file:
        file.attrs["format"] = "fretwear-model"
    message = run(folder, merged(point, {"contact": contact}), status=status).stderr
    for word in words:
        assert word in message
    assert not (folder / "case.h5").exists()


def test_worn_file_is_never_overwritten(worn):
    folder, case, old = worn
    point = merged({**case, "case": {"analysis": "point", "threads": 1}},
                   {"contact": {"worn": "worn.h5"}})
    message = run(folder, point, "-o", "worn.h5", status=3).stderr
    assert "which this run reads" in message
    assert read(folder / "worn.h5")["wear/depth"].tobytes() == old["wear/depth"].tobytes()


@pytest.mark.parametrize("method", ["hbm", "hdhb"])
def test_few_instants_that_are_given_serve_more_harmonics_too(tmp_path, method):
    """A run looks at its states with twice the harmonics as well: the instants that are given were
    too few for these, and transforms wrote behind their room."""
    case = {"case": {"analysis": "wear"},
            "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.04},
            "contact": {"n_pairs": 1, "law": "penalty", "tangential_stiffness": 1.0,
                        "side_1": [1, 0, 0], "mu": 1.0, "normal_load": 0.5, "area": 1.0},
            "load": {"cosine": 1.0},
            "harmonics": {"method": method, "n_harmonics": 20, "n_time": 41},
            "sweep": {"start": 1.0}, "wear": {"coefficient": 1e-6, "n_cycles": 100}}
    coarse = result(tmp_path, case)["wear/depth"][-1, 0]
    instants = {"method": "hbm", "n_time": 1024}
    fine = result(tmp_path, merged(case, {"harmonics": instants}))["wear/depth"][-1, 0]
    # An instant more or less of slip.
    assert coarse == pytest.approx(fine, rel=0.1)
