"""A wear run that was interrupted and continued gives the numbers of one that was not."""
import shutil
import signal

import h5py
import numpy as np
import pytest
from cases import merged, read, run, signal_at, write_namelist
from project import PROGRAM, ROOT
from wear_cases import assert_same, oscillator, prescribed_slip, result, shared_load


def elastic_mass(**wear):
    """A mass on an elastic pair, whose vibration lags behind its depth on the way."""
    return {
        "case": {"analysis": "wear", "threads": 1},
        "model": {"n_dof": 2, "mass": np.diag([0.98, 0.84]), "damping": np.diag([0.05, 0.04]),
                  "stiffness": [1.7, -0.58, -0.58, 1.35]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": 0.54, "gap": -0.1,
                    "tangential_stiffness": 1.41, "normal_stiffness": 1.45, "area": 0.38},
        "load": {"static": [0.0, -0.39], "cosine": [-0.25, 0.02], "sine": [0.02, 0.0]},
        "harmonics": {"n_harmonics": 7}, "sweep": {"start": 0.894},
        "wear": {"coefficient": 4.5e-6, "scheme": "pseudo_time", **wear}}


CASES = {
    "implicit": shared_load(scheme="implicit", error_tolerance=1e-4, n_cycles=300.0),
    "explicit": shared_load(scheme="explicit", error_tolerance=1e-4, n_cycles=100.0),
    "fixed depth steps": shared_load(scheme="implicit", max_depth_step=0.004),
    "pseudo-time": shared_load(scheme="pseudo_time", max_depth_step=0.004),
    "pseudo-time, Rosenbrock": merged(shared_load(scheme="pseudo_time", error_tolerance=1e-5),
                                      {"pseudo_time": {"scheme": "rosenbrock"}}),
    "pseudo-time, BDF": merged(shared_load(scheme="pseudo_time", error_tolerance=1e-4),
                               {"pseudo_time": {"scheme": "bdf"}}),
    "pseudo-time, lagging": elastic_mass(),
    "pseudo-time, lagging, following": elastic_mass(follow_resonance=True),
    "following": oscillator(7, error_tolerance=1e-3, n_cycles=100.0, follow_resonance=True),
    "oscillator law": merged(oscillator(7, "rigid", error_tolerance=1e-3, n_cycles=100.0),
                             {"harmonics": {"n_time": None}}),
    "carried memory": merged(shared_load(error_tolerance=1e-4, n_cycles=300.0),
                             {"contact": {"memory": "carried"}}),
    "histories": merged(prescribed_slip(error_tolerance=1e-4, n_cycles=300.0),
                        {"output": {"histories": True}}),
}


@pytest.mark.parametrize("name", CASES)
def test_same_numbers(tmp_path, name):
    groups = CASES[name]
    whole = result(tmp_path, groups, name="whole")
    steps = len(whole["omega"]) - 1
    assert steps > 8
    for stop in (1, 7):
        part = merged(groups, {"case": {"max_seconds": 900.0}, "wear": {"max_steps": stop},
                               "output": {}})
        run(tmp_path, part, name="part", status=4)
        again = result(tmp_path, groups, "--restart", "part.h5", name="again")
        assert_same(again, whole)


@pytest.mark.parametrize("scheme", ["explicit", "implicit", "pseudo_time"])
def test_same_numbers_with_many_pairs(tmp_path, scheme):
    """48 pairs take GMRES, whose preconditioners may be older than the step."""
    model = {"source": "hdf5", "file": str(ROOT / "example" / "blade_sector" / "sector_48.h5"),
             "rotation_speed": 460.8, "modal_damping": 1e-3}
    groups = {"case": {"analysis": "wear", "threads": 1}, "model": model,
              "load": {"harmonic_scale": 0.5}, "harmonics": {"n_harmonics": 3, "n_time": 64},
              "sweep": {"start": 1022.0, "unit": "Hz"},
              "wear": {"scheme": scheme, "coefficient": 1e-6, "n_cycles": 1e9,
                       "max_depth_step": 2e-5, "max_steps": 8}}
    whole = result(tmp_path, groups, name="whole", status=4)
    for stop in range(1, 8):
        run(tmp_path, merged(groups, {"wear": {"max_steps": stop}}), name="part", status=4)
        again = result(tmp_path, groups, "--restart", "part.h5", name="again", status=4)
        assert_same(again, whole)


def cut_behind(path, n_rows):
    """Shorten every dataset that grows, as a kill between two steps leaves them."""
    with h5py.File(path, "r+") as file:
        def shorten(_, item):
            if isinstance(item, h5py.Dataset) and item.maxshape[:1] == (None,):
                item.resize(n_rows, axis=0)
        file.visititems(shorten)


def test_killed_run(tmp_path):
    """kill -9 while steps are being taken; the rest starts from what is left of the file."""
    groups = oscillator(25, error_tolerance=1e-5, n_cycles=50.0)
    whole = result(tmp_path, groups, name="whole")
    write_namelist(tmp_path / "case.nml", groups)
    signal_at([PROGRAM, "-v", "case.nml"], "point 8", signal.SIGKILL, tmp_path,
              caught=-signal.SIGKILL)
    assert not (tmp_path / "case.h5").exists()
    left = read(tmp_path / "case.h5.part")
    assert left["attributes"]["status"] == "incomplete"
    assert 1 <= len(left["omega"]) < len(whole["omega"])
    assert_same(result(tmp_path, groups, "--restart", "case.h5.part"), whole)
    assert not (tmp_path / "case.h5.part").exists(), "all that the killed run left is in the result"


def test_restart_may_be_the_result(tmp_path):
    groups = CASES["implicit"]
    whole = result(tmp_path, groups, name="whole")
    run(tmp_path, merged(groups, {"wear": {"max_steps": 5}}), status=4)
    assert_same(result(tmp_path, groups, "--restart", "case.h5"), whole)
    # What has come to its end stays as it is.
    assert_same(result(tmp_path, groups, "--restart", "case.h5"), whole)


def test_more_cycles(tmp_path):
    """A run that is complete goes on to more cycles; its rows stay."""
    groups = prescribed_slip(error_tolerance=1e-5, n_cycles=50.0)
    first = result(tmp_path, groups)
    more = result(tmp_path, merged(groups, {"wear": {"n_cycles": 100.0}}), "--restart", "case.h5",
                  name="more")
    n = len(first["omega"])
    assert more["wear/depth"][:n].tobytes() == first["wear/depth"].tobytes()
    assert more["wear/cycles"][-1] == 100.0
    assert more["wear/depth"][-1, 0] == pytest.approx(0.07080764345495623, rel=1e-5)


def test_check_steps_after_a_restart(tmp_path):
    groups = merged(CASES["implicit"], {"wear": {"check_steps": True}})
    whole = result(tmp_path, groups, name="whole")
    run(tmp_path, merged(groups, {"wear": {"max_steps": 5}}), status=4)
    again = result(tmp_path, groups, "--restart", "case.h5")
    assert again["wear"]["profile_change"] == whole["wear"]["profile_change"] > 0.0
    assert_same(again, whole)


@pytest.fixture
def stopped(tmp_path):
    groups = CASES["implicit"]
    run(tmp_path, merged(groups, {"wear": {"max_steps": 3}}), name="old", status=4)

    def refused(changes, *arguments, file="old.h5", status=3):
        message = run(tmp_path, merged(groups, changes), "--restart", file, *arguments,
                      status=status).stderr
        assert not list(tmp_path.glob("case.h5*"))
        return message
    refused.folder = tmp_path
    return refused


@pytest.mark.parametrize(("changes", "words"), [
    ({"wear": {"scheme": "explicit"}}, ["wear%scheme = 'implicit'", "'explicit'"]),
    ({"wear": {"error_tolerance": 1e-3}}, ["wear%error_tolerance = 1e-4", "0.001"]),
    ({"contact": {"mu": 0.4}}, ["contact%mu", "0.4"]),
    ({"sweep": {"start": 1.5}}, ["sweep%start", "1.5"]),
    ({"harmonics": {"n_harmonics": 2}}, ["harmonics%n_harmonics"]),
    ({"solver": {"tolerance": 1e-9}}, ["solver%tolerance"]),
    ({"load": {"static": [0.0, 0.0, 0.0, 0.0, -3.0]}}, ["load%static"]),
])
def test_other_case_is_refused(stopped, changes, words):
    message = stopped(changes)
    assert "old.h5" in message
    for word in words:
        assert word in message


def test_check_refuses_too(stopped):
    assert "wear%scheme" in stopped({"wear": {"scheme": "explicit"}}, "--check")
    assert stopped({}, "--check", status=0) == ""


def test_other_analysis_is_refused(stopped):
    assert "analysis = 'point'" in stopped({"case": {"analysis": "point"}}, status=2)


def test_files_that_are_no_restart(stopped):
    folder = stopped.folder
    assert "none.h5: no such file" in stopped({}, file="none.h5", status=5)
    (folder / "text.h5").write_text("no result")
    assert "text.h5" in stopped({}, file="text.h5")
    with h5py.File(folder / "model.h5", "w") as file:
        file.attrs["format"] = "fretwear-model"
    assert "is no result file" in stopped({}, file="model.h5")
    point = {**CASES["implicit"], "case": {"analysis": "point"}}
    run(folder, point, name="point")
    assert "is not the result of analysis = 'wear'" in stopped({}, file="point.h5")
    shutil.copy(folder / "old.h5", folder / "bare.h5")
    with h5py.File(folder / "bare.h5", "r+") as file:
        del file["restart"]
    assert "holds no group /restart" in stopped({}, file="bare.h5")
    cut_behind(folder / "old.h5", 0)
    assert "no step was saved" in stopped({})


def test_changed_model_file_is_refused(tmp_path):
    """Matrices are not in the namelist: the first vibration tells."""
    groups = CASES["implicit"]

    def write_model(factor):
        with h5py.File(tmp_path / "model.h5", "w") as file:
            file.attrs.update(format="fretwear-model", format_version=1)
            n = groups["model"]["n_dof"]
            file["mass"] = np.zeros((n, n))
            file["stiffness"] = factor * np.reshape(groups["model"]["stiffness"], (n, n))

    from_file = {**groups, "model": {"source": "hdf5", "file": "model.h5"}}
    write_model(1.0)
    run(tmp_path, merged(from_file, {"wear": {"max_steps": 3}}), name="old", status=4)
    write_model(1.01)
    assert "&model have changed" in run(tmp_path, from_file, "--restart", "old.h5",
                                        status=3).stderr
    write_model(1.0)
    run(tmp_path, from_file, "--restart", "old.h5")
