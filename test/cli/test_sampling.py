"""What `sampling = 'auto'` chooses, and that results and the summary say so."""
import pytest
from cases import merged, run
from wear_cases import result

POINT = {"case": {"analysis": "point"},
         "model": {"n_dof": 3, "mass": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0],
                   "stiffness": [1.0, 0.1, 0, 0.1, 1.5, 0, 0, 0, 2.0],
                   "damping": [0.05, 0, 0, 0, 0.05, 0, 0, 0, 0.05]},
         "load": {"cosine": [1.0, 0.0, 0.1], "sine": [0.0, 0.4, 0.0], "static": [0.0, 0.0, -1.0]},
         "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 3], "mu": 0.3,
                     "tangential_stiffness": 2.0, "normal_stiffness": 3.0, "area": 1.0},
         "harmonics": {"n_harmonics": 3}, "sweep": {"start": 0.7}}
PLANE = {"contact": {"side_1": [1, 2, 3]}}
# The second direction is there, but nothing moves in it.
IDLE = {**PLANE, "model": {"stiffness": [1.0, 0, 0, 0, 1.5, 0, 0, 0, 2.0]},
        "load": {"sine": [0.1, 0.0, 0.0]}}
CHOICES = {
    "one direction": ({}, "events"),
    "instants given": ({"harmonics": {"n_time": 64}}, "uniform"),
    "two directions": (PLANE, "uniform"),
    "two directions, one idle": (IDLE, "events"),
    "two directions with an accuracy": (
        {**PLANE, "harmonics": {"n_harmonics": None, "accuracy": 1e-2}}, "events"),
    "asked for": ({**PLANE, "harmonics": {"sampling": "events"}}, "events"),
    "collocation": ({"harmonics": {"method": "tcm"}}, "uniform"),
    "histories": ({"output": {"histories": True}}, "uniform"),
    "stability": ({"sweep": {"stability": True}}, "uniform"),
    "wear": ({"case": {"analysis": "wear"}, "wear": {"coefficient": 1e-3, "n_cycles": 5.0}},
             "events"),
}


@pytest.mark.parametrize("name", CHOICES)
def test_choice(tmp_path, name):
    changes, expected = CHOICES[name]
    found = result(tmp_path, merged(POINT, changes))
    assert found["attributes"]["sampling"] == expected


def test_the_summary_says_so(tmp_path, fw_run):
    run(tmp_path, POINT)
    shown = fw_run("case.nml").stdout
    assert "events located" in shown
    run(tmp_path, merged(POINT, {"harmonics": {"sampling": "uniform"}}))
    assert "events located" not in fw_run("case.nml").stdout


@pytest.mark.parametrize(("power", "n_harmonics", "n_time"), [(2, 3, 12), (3, 1, 6), (3, 7, 30)])
@pytest.mark.parametrize("sampling", ["auto", "events"])
def test_springs_alone_have_no_events(tmp_path, fw_run, power, n_harmonics, n_time, sampling):
    """(power + 1) H + 2 instants, made even, sample their forces without any error."""
    run(tmp_path, {"case": {"analysis": "point"},
                   "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
                   "spring": {"n_springs": 1, "side_1": 1, "coefficient": 0.1, "power": power},
                   "load": {"cosine": 0.1}, "sweep": {"start": 0.7},
                   "harmonics": {"n_harmonics": n_harmonics, "sampling": sampling}})
    assert f" {n_time} instants)" in fw_run("case.nml").stdout
