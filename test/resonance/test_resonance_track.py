"""Resonances followed over every parameter, through folds, by both linear solvers, with two
tangential directions and in sectors."""
import sys

import h5py
import numpy as np
import pytest
from cases import merged, read, run
from project import ROOT
from resonance_cases import REFERENCES, slope, track, track_groups

sys.path.insert(0, str(ROOT / "test" / "cyclic"))
from cyclic_cases import model_groups, read_reference

#: The same case, moved in memory or read: solutions stop at 1e-12, which the resonance amplifies.
MOVED = 1e-9
#: Peaks of the program are parabolas through points that are solved around them.
PEAK = 1e-6
#: Closed forms to round-off times the condition.
EXACT = 1e-9
#: Derivatives against differences of fourth order of the track.
SLOPE = 1e-6

NORMAL = merged(REFERENCES["normal"]["groups"], {"load": {"harmonic_scale": 1.3}})
CHAIN = REFERENCES["chain"]["groups"]
SPRING = merged(CHAIN, {"spring": {"n_springs": 1, "side_1": [2], "coefficient": [0.3]},
                        "model": {"modal_damping": 0.01}})
DUFFING = {"model": {"n_dof": 1, "mass": [1.0], "stiffness": [1.0], "damping": [0.02]},
           "load": {"cosine": [1.0]}, "harmonics": {"n_harmonics": 1},
           "spring": {"n_springs": 1, "side_1": [1], "coefficient": [0.5]},
           "sweep": {"start": 0.8, "end": 1.4, "n_points": 120}}

PARAMETERS = [
    ("load%harmonic_scale", NORMAL), ("load%static_scale", NORMAL), ("contact%mu", NORMAL),
    ("contact%normal_load", CHAIN), ("contact%tangential_stiffness", CHAIN),
    ("contact%normal_stiffness", NORMAL), ("spring%coefficient", SPRING),
    ("model%modal_damping", SPRING)]


def changed(groups, parameter, value):
    """The same case read with another value."""
    group, key = parameter.split("%")
    old = groups[group].get(key, 1.0)
    return merged(groups, {group: {key: [value] * len(old) if isinstance(old, list) else value}})


@pytest.mark.parametrize(("parameter", "groups"), PARAMETERS)
@pytest.mark.parametrize("condition", ["amplitude", "phase"])
def test_moved_is_read(tmp_path, parameter, groups, condition):
    """The last of the values is the first of a case that was read with it."""
    group, key = parameter.split("%")
    value = float(np.ravel(groups[group].get(key, 1.0))[0])
    moved = track(tmp_path, groups, parameter, value, 1.1 * value, condition=condition)
    fresh = track(tmp_path, changed(groups, parameter, 1.1 * value), parameter, 1.1 * value,
                  1.11 * value, condition=condition)
    for name in ("omega", "resonance/value", "resonance/phase", "contact/dissipation"):
        assert moved[name][-1] == pytest.approx(fresh[name][0], rel=MOVED)


def test_gap_and_factor(tmp_path):
    groups = merged(NORMAL, {"contact": {"gap": [-0.1]}})
    by_value = track(tmp_path, groups, "contact%gap", -0.1, -0.2)
    by_factor = track(tmp_path, groups, "contact%gap", 1.0, 2.0, **{"as": "factor"})
    assert by_factor["omega"] == pytest.approx(by_value["omega"], rel=MOVED)
    assert by_factor["parameter"] == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize(("parameter", "groups"), PARAMETERS)
@pytest.mark.parametrize("condition", ["amplitude", "phase"])
def test_derivatives_along_the_resonance(tmp_path, parameter, groups, condition):
    """Amplitude, frequency and dissipation against differences of the track."""
    group, key = parameter.split("%")
    value = float(np.ravel(groups[group].get(key, 1.0))[0])
    step = 2e-3 * value
    found = track(tmp_path, groups, parameter, value - 2 * step, value + 2 * step, n_points=5,
                  condition=condition, slopes=[parameter])
    weights = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * step)
    for quantity, rows in (("first_harmonic", found["resonance/first_harmonic"]),
                           ("resonance_omega", found["omega"]),
                           ("largest", found["amplitude"][:, 0]),
                           ("dissipation", found["contact/dissipation"][:, 0])):
        size = abs(rows[2] / value)
        assert slope(found, quantity, parameter, 2) == pytest.approx(
            weights @ rows, rel=SLOPE, abs=SLOPE * size), quantity


def test_backbone_of_a_hardening_spring(tmp_path):
    """A phase resonance of one harmonic: omega^2 = k + 3/4 a A^2, c omega A = F."""
    found = track(tmp_path, DUFFING, "load%harmonic_scale", 0.002, 0.02, n_points=6,
                  spacing="log", condition="phase", continuation="arclength")
    omega, amplitude = found["omega"], found["resonance/value"]
    assert omega**2 == pytest.approx(1.0 + 0.375 * amplitude**2, rel=EXACT)
    assert 0.02 * omega * amplitude == pytest.approx(found["parameter"], rel=EXACT)
    assert found["parameter"][[0, -1]] == pytest.approx([0.002, 0.02])


def test_a_resonance_that_folds_over_its_parameter(tmp_path):
    """A softening spring holds no more than a largest load: F = c omega A turns there, and the
    branch comes back with higher amplitudes."""
    groups = merged(DUFFING, {"spring": {"coefficient": [-0.5]},
                              "sweep": {"start": 0.3, "end": 1.2, "n_points": 200}})
    found = track(tmp_path, groups, "load%harmonic_scale", 0.006, 0.02, n_points=20, status=4,
                  condition="phase", continuation="arclength")
    load, omega, amplitude = (found[name] for name in ("parameter", "omega", "resonance/value"))
    assert 0.02 * omega * amplitude == pytest.approx(load, rel=EXACT)
    assert omega**2 == pytest.approx(1.0 - 0.375 * amplitude**2, rel=EXACT)
    # The largest of c A sqrt(1 - 3/8 A^2).
    assert load.max() == pytest.approx(0.02 * 0.5 / np.sqrt(0.375), rel=1e-3)
    assert np.argmax(load) < len(load) - 3
    assert amplitude[-1] > amplitude[np.argmax(load)]


@pytest.mark.parametrize("condition", ["amplitude", "phase"])
def test_both_linear_solvers(tmp_path, condition):
    found = [track(tmp_path, CHAIN, "contact%mu", 0.4, 0.5, n_points=3, condition=condition,
                   slopes=["contact%mu"], changes={"solver": {"linear": linear}})
             for linear in ("lu", "krylov")]
    for name in ("omega", "resonance/value", "sensitivity/resonance_omega/contact_mu",
                 "sensitivity/first_harmonic/contact_mu"):
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-8)


def peaks(folder, groups, omega):
    """The highest peak of an ordinary sweep about a frequency."""
    case = merged(groups, {"case": {"analysis": "frf"}, "solver": {"tolerance": 1e-12},
                           "sweep": {"start": 0.9 * omega, "end": 1.1 * omega, "n_points": 81}})
    # Elsewhere in the range points may fail.
    run(folder, case, name="sweep", status=(0, 4))
    with h5py.File(folder / "sweep.h5") as file:
        mine = file["peak/observed"][()] == 0
        k = np.argmax(np.where(mine, file["peak/amplitude"][()], 0.0))
        return file["peak/amplitude"][k], file["peak/omega"][k]


def test_two_tangential_directions(tmp_path):
    rng = np.random.default_rng(3)
    a = rng.normal(size=(4, 4))
    stiffness = np.diag([3.0, 3.5, 4.0, 5.0]) + 0.3 * (a + a.T)
    groups = {"model": {"n_dof": 4, "mass": np.eye(4).ravel().tolist(),
                        "stiffness": stiffness.ravel().tolist(), "modal_damping": 0.02},
              "load": {"cosine": [0.0, 0.3, 0.5, 0.0], "sine": [0.2, 0.0, 0.0, 0.3]},
              "contact": {"n_pairs": 1, "side_1": [1, 2, 0], "law": "penalty", "mu": [0.4],
                          "tangential_stiffness": [2.0], "normal_load": [1.0]},
              "harmonics": {"n_harmonics": 3, "sampling": "events"}, "output": {"observe": [3]},
              "sweep": {"start": 1.0, "end": 3.0, "n_points": 120}}
    found = track(tmp_path, groups, "contact%normal_load", 1.0, 1.2, quantity="largest")
    amplitude, omega = peaks(tmp_path, merged(groups, {"contact": {"normal_load": [1.2]}}),
                             found["omega"][-1])
    assert found["resonance/value"][-1] == pytest.approx(amplitude, rel=PEAK)
    assert found["omega"][-1] == pytest.approx(omega, rel=1e-4)


@pytest.mark.parametrize(("name", "planar"), [
    ("v1", False), ("v2", False), ("v3", False), ("v4", False), ("v5", True)])
def test_sectors(tmp_path, name, planar):
    """A wave around sectors: the resonance is the peak of the sweep."""
    case = read_reference(name)
    middle = case["points"][0]["omega"]
    groups = merged(model_groups(case), {
        "harmonics": {"n_harmonics": 3}, "output": {"observe": [4]},
        "sweep": {"start": 0.7 * middle, "end": 1.5 * middle, "n_points": 150}})
    if planar:
        # With separation in few harmonics the quadrature over slip does not settle here.
        groups["harmonics"]["sampling"] = "uniform"
    found = track(tmp_path, groups, "load%harmonic_scale", 1.0, 1.3, quantity="largest")
    amplitude, omega = peaks(tmp_path, merged(groups, {"load": {"harmonic_scale": 1.3}}),
                             found["omega"][-1])
    assert found["resonance/value"][-1] == pytest.approx(amplitude, rel=PEAK)
    assert found["omega"][-1] == pytest.approx(omega, rel=1e-4)


def test_phase_in_sectors(tmp_path):
    """By natural steps and along the branch."""
    case = read_reference("v1")
    middle = case["points"][0]["omega"]
    groups = merged(model_groups(case), {
        "harmonics": {"n_harmonics": 3}, "output": {"observe": [4]},
        "sweep": {"start": 0.7 * middle, "end": 1.5 * middle, "n_points": 100}})
    found = [track(tmp_path, groups, "load%harmonic_scale", 1.0, 1.3, n_points=4,
                   condition="phase", continuation=way) for way in ("natural", "arclength")]
    assert found[1]["parameter"][-1] == pytest.approx(1.3)
    for key in ("omega", "resonance/value"):
        assert found[1][key][-1] == pytest.approx(found[0][key][-1], rel=MOVED)


def test_without_contact(tmp_path):
    """A linear structure: the closed form of its resonance, by both conditions."""
    groups = {"model": {"n_dof": 1, "mass": [1.0], "stiffness": [4.0], "modal_damping": 0.05},
              "load": {"cosine": [1.0]}, "sweep": {"start": 1.0, "end": 3.0, "n_points": 40},
              "harmonics": {"n_harmonics": 1}}
    zeta = np.linspace(0.05, 0.3, 6)
    found = track(tmp_path, groups, "model%modal_damping", zeta[0], zeta[-1], n_points=6)
    assert found["omega"] == pytest.approx(2.0 * np.sqrt(1.0 - 2.0 * zeta**2), rel=EXACT)
    assert found["resonance/value"] == pytest.approx(
        0.125 / (zeta * np.sqrt(1.0 - zeta**2)), rel=EXACT)
    found = track(tmp_path, groups, "model%modal_damping", zeta[0], zeta[-1], condition="phase")
    assert found["omega"] == pytest.approx([2.0, 2.0], rel=EXACT)


def test_rotation(tmp_path):
    """Stiffness and static load that grow with the square of the speed."""
    path = tmp_path / "model.h5"
    with h5py.File(path, "w") as file:
        file["mass"], file["stiffness"], file["damping"] = ([[1.0]], [[4.0]], [[0.2]])
        file["stiffness_rotation"] = [[0.5]]
        file["load/cosine"] = [1.0]
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
    speed = np.linspace(1.0, 2.0, 3)
    groups = {"model": {"source": "hdf5", "file": path.name, "rotation_speed": 1.0},
              "sweep": {"start": 1.0, "end": 3.5, "n_points": 60}, "harmonics": {"n_harmonics": 1}}
    found = track(tmp_path, groups, "model%rotation_speed", 1.0, 2.0, n_points=3,
                  slopes=["model%rotation_speed"])
    square = 4.0 + 0.5 * speed**2
    assert found["omega"]**2 == pytest.approx(square - 0.02, rel=EXACT)
    assert slope(found, "resonance_omega", "model%rotation_speed") == pytest.approx(
        0.5 / found["omega"][0], rel=1e-7)


def test_harmonics_left_out(tmp_path):
    """Seven harmonics where none are given."""
    groups = merged(track_groups(CHAIN, "contact%mu", 0.4, 0.5),
                    {"harmonics": {"n_harmonics": None}})
    run(tmp_path, groups)
    assert read(tmp_path / "case.h5")["coefficients"].shape[1] == 15
