"""What misleads a nonlinear mode: poles of a condensation, the free phase, the kink at the onset,
folds of internal resonances, the end of the curve, double modes; and what is refused."""
import subprocess

import h5py
import numpy as np
import pytest
from cases import merged, read, run, write_namelist
from limits import limit
from mode_cases import REFERENCES, follow, mode_groups
from project import PATIENT, PROGRAM

#: An oscillator with friction, mode 1; a second mass whose frequency is about three times as high.
CHAIN = REFERENCES["chain"]["groups"]
JENKINS = REFERENCES["jenkins"]["groups"]
DUFFING = {
    "model": {"n_dof": 2, "mass": [1, 0, 0, 1], "stiffness": [1.1, -0.3, -0.3, 11.0],
              "damping": [0.0, 0.0, 0.0, 0.0]},
    "spring": {"n_springs": 1, "side_1": 1, "side_2": 0, "coefficient": 0.5, "power": 3},
    "output": {"observe": [1, 2]}}


def test_pole_of_the_condensation(tmp_path):
    """With a rigid pair the stuck mode is a mode of the structure with its contact held, which the
    self-excitation frees of damping: linear there, to round-off, at every amplitude."""
    groups = merged(CHAIN, {"contact": {"law": "dlft", "tangential_stiffness": None},
                            "output": {"observe": [2, 1]}})
    found = follow(tmp_path, groups, 1e-4, 0.2004, 5, n_points=12, control="observed",
                   status=(0, 4))
    onset = found["attributes of mode"]["onset_amplitude"]
    # Dof 1 is held: mass 2, stiffness 5, damping 0.05.
    omega, zeta = np.sqrt(2.5), 0.05 / (2 * 2 * np.sqrt(2.5))
    stuck = found["mode/first_harmonic"][:, 0] < onset
    assert stuck.sum() > 5
    assert found["omega"][stuck] == pytest.approx(omega, rel=1e-12)
    assert found["mode/damping_ratio"][stuck] == pytest.approx(zeta, rel=1e-10)
    # The pair carries 2 u_2 and the damper's share; it slips at mu N = 0.4.
    force = abs(-2.0 - 0.01j * omega)
    assert onset == pytest.approx(0.4 / force, rel=1e-9)
    assert not found["iterations"][stuck][1:].any()


def test_a_pair_that_parts_at_every_amplitude_has_its_onset_at_zero(tmp_path):
    """One degree of freedom that rests on an elastic stop: half of every period is in the air."""
    groups = {"model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0},
              "contact": {"n_pairs": 1, "law": "penalty", "side_1": [0, 0, 1], "gap": 0.0,
                          "normal_stiffness": 0.3}, "output": {"observe": [1]}}
    found = follow(tmp_path, groups, 0.1, 1.0, 7, n_points=3)
    assert found["attributes of mode"]["onset_amplitude"] == 0.0
    # Two half periods, of either spring.
    assert found["omega"] == pytest.approx(2.0 / (1.0 + 1.0 / np.sqrt(1.3)), rel=1e-3)


def test_a_friction_joint_that_is_not_pressed_has_a_mode(tmp_path):
    """Gap 0 and no load: pairs part at every amplitude, and nothing has a size of its own. The
    linear motion was no start for it, and what had not converged was told as damping."""
    groups = {"model": {"n_dof": 2, "mass": [1.0, 0, 0, 1], "stiffness": [2.0, -1, -1, 2],
                        "damping": [0.04, 0, 0, 0.04]},
              "contact": {"n_pairs": 1, "law": "penalty", "side_1": [2, 0, 1], "mu": 1.0,
                          "gap": 0.0, "tangential_stiffness": 1.0, "normal_stiffness": 3.0},
              "output": {"observe": [1, 2]}}
    found = follow(tmp_path, groups, 0.05, 20.0, 5, n_points=4)
    assert found["attributes of mode"]["onset_amplitude"] == 0.0
    for name in ("omega", "mode/damping_ratio"):
        assert found[name] == pytest.approx(found[name][0], rel=1e-7)
    # A gap far below the amplitude is none.
    apart = follow(tmp_path, merged(groups, {"contact": {"gap": 1e-6}}), 10.0, 20.0, 5, n_points=2)
    assert found["omega"][-1] == pytest.approx(apart["omega"][-1], rel=1e-6)
    # One so stiff that no mode is found says so, and nothing else.
    write_namelist(tmp_path / "stiff.nml", merged(groups, {
        "case": {"analysis": "mode"}, "mode": {"start": 0.05, "end": 20.0},
        "harmonics": {"n_harmonics": 5}, "contact": {"normal_stiffness": 30.0}}))
    done = subprocess.run([PROGRAM, "stiff.nml"], cwd=tmp_path, text=True, capture_output=True,
                          timeout=limit(60.0), check=False, env=PATIENT)
    assert done.returncode == 0 or "the first point did not converge" in done.stderr
    assert done.returncode == 0 or "damping  " not in done.stdout


def test_onset_has_a_kink_in_damping_alone(tmp_path):
    """Damping grows at once beyond the onset, the frequency with the power 3/2 of the excess; the
    curve goes on in order, and no step fails for it."""
    found = follow(tmp_path, JENKINS, 0.45, 0.55, 7, n_points=101)
    a, omega, zeta = (found[name] for name in ("mode/modal_amplitude", "omega",
                                               "mode/damping_ratio"))
    assert found["attributes of mode"]["onset_amplitude"] == pytest.approx(0.5, rel=1e-12)
    assert (np.diff(a) > 0).all()
    assert found["converged"].all()
    stuck = a < 0.5
    assert np.ptp(omega[stuck]) < 1e-12
    excess = a[~stuck] - 0.5
    growth = (zeta[~stuck] - zeta[0]) / excess
    assert growth[2] == pytest.approx(growth[8], rel=0.1)
    power = np.polyfit(np.log(excess[3:20]), np.log(omega[0] - omega[~stuck][3:20]), 1)[0]
    assert power == pytest.approx(1.5, abs=0.1)


def test_low_start_and_four_decades(tmp_path):
    """No step is lost to decades, nor residuals to a static load a million times the vibration."""
    found = follow(tmp_path, REFERENCES["preload"]["groups"], 1e-4, 1.0, 3, n_points=9)
    assert found["converged"].all()
    stuck = found["mode/modal_amplitude"] < 0.4
    assert found["omega"][stuck] == pytest.approx(np.sqrt(2.0), rel=1e-10)


def test_full_slip_tends_to_the_free_mode(tmp_path):
    """zeta falls like 1/A, omega goes to the mode without the pair."""
    found = follow(tmp_path, CHAIN, 50.0, 5000.0, 3, n_points=5)
    values, vectors = np.linalg.eigh([[3.0, -np.sqrt(2.0)], [-np.sqrt(2.0), 2.5]])
    free = np.sqrt(values[0])
    excess = np.abs(found["omega"] / free - 1.0)
    # From the damping of the chain, not of the pair, a part stays.
    phi = vectors[:, 0] / np.sqrt([1.0, 2.0])
    linear = phi @ np.array([[0.03, -0.01], [-0.01, 0.05]]) @ phi / (2 * free)
    rest = found["mode/damping_ratio"] - linear
    assert excess[-1] < 1e-4
    assert rest[:-1] * found["mode/modal_amplitude"][:-1] == pytest.approx(
        rest[1] * found["mode/modal_amplitude"][1], rel=0.05)


@pytest.mark.parametrize("continuation", ["natural", "arclength"])
def test_nothing_holds_the_structure(tmp_path, continuation):
    """A mass on its slider alone: the frequency vanishes, the curve ends with status 4."""
    groups = merged(JENKINS, {"model": {"stiffness": 0.0, "damping": 0.01}})
    found = follow(tmp_path, groups, 0.1, 1e7, 5, n_points=30, continuation=continuation, status=4)
    assert len(found["omega"]) > 3
    assert found["converged"].all()
    assert (np.diff(found["omega"]) < 1e-12).all()
    assert found["attributes"]["status"] == "not converged"


def test_internal_resonance_folds(tmp_path):
    """Three times the frequency of mode 1 meets mode 2: the branch turns back in its amplitude and
    goes on; natural steps end there and say so."""
    branch = follow(tmp_path, DUFFING, 0.05, 2.0, 5, n_points=30, control="observed",
                    continuation="arclength", status=(0, 4))
    amplitude = branch["mode/first_harmonic"][:, 0]
    # It comes back to the lowest amplitude; a point on a bound may not converge.
    assert branch["converged"][:-1].all()
    assert (np.diff(amplitude) < 0).any()
    # Which is said, whichever way the curve is followed.
    steps = follow(tmp_path, DUFFING, 0.05, 2.0, 5, n_points=30, control="observed",
                   status=(0, 4))
    for found in (branch, steps):
        assert "3 omega meets mode 2 (3.3" in remark_of(found, "internal resonance")
    # On the way the second mass takes over.
    third = np.hypot(branch["coefficients"][:, 5, 1], branch["coefficients"][:, 6, 1])
    assert (third / amplitude).max() > 1.0


def start(folder, *arguments):
    """What a successful run says."""
    done = subprocess.run([PROGRAM, *arguments], cwd=folder, text=True, capture_output=True,
                          timeout=limit(120.0), check=False, env=PATIENT)
    assert done.returncode == 0, done.stderr
    return done.stdout


def remark_of(found, name):
    """Text of a remark of a result; empty where it has none of this name."""
    names = found.get("remarks/name", [])
    texts = [text.decode() for at, text in zip(names, found.get("remarks/text", []), strict=True)
             if at.decode() == name]
    return texts[0] if texts else ""


def test_no_internal_resonance(tmp_path):
    """Nothing is said where no harmonic meets a mode, and of harmonics that the balance lacks."""
    for groups, n_harmonics in ((JENKINS, 7), (CHAIN, 7), (DUFFING, 1)):
        found = follow(tmp_path, groups, 0.1, 1.0, n_harmonics, status=(0, 4))
        assert remark_of(found, "internal resonance") == ""


def test_internal_resonance_of_sliding_pairs(tmp_path):
    """Three times the frequency falls through that of mode 2 without friction."""
    free = np.sqrt(np.linalg.eigvalsh([[1.1, -0.3], [-0.3, 11.0]]))
    groups = merged(DUFFING, {
        "model": {"damping": [0.02, 0, 0, 0.02]},
        "spring": {"n_springs": None, "side_1": None, "side_2": None, "coefficient": None,
                   "power": None},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "side_2": [0, 0, 0],
                    "mu": 1.0, "normal_load": 0.5, "tangential_stiffness": 1.0}})
    found = follow(tmp_path, groups, 0.1, 20.0, 5, n_points=40, status=(0, 4))
    low, high = 3 * found["omega"].min(), 3 * found["omega"].max()
    assert low < free[1] < high
    said = remark_of(found, "internal resonance")
    assert f"3 omega meets mode 2 with stuck pairs ({free[1]:.1E}"[:-4] in said
    assert "near the amplitude" in said


def test_double_modes_are_refused(tmp_path):
    groups = {
        "model": {"n_dof": 2, "mass": [1, 0, 0, 1], "stiffness": [1, 0, 0, 1],
                  "damping": [0.02, 0, 0, 0.02]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 2, 0], "side_2": [0, 0, 0],
                    "mu": 1.0, "normal_load": 0.5, "tangential_stiffness": 1.0},
        "output": {"observe": [1, 2]}}
    done = run(tmp_path, mode_groups(groups, 0.1, 1.0, 3), status=3)
    assert "have one frequency" in done.stderr
    detuned = merged(groups, {"model": {"stiffness": [1, 0, 0, 1.01]}})
    found = follow(tmp_path, detuned, 0.1, 2.0, 3, n_points=6)
    assert found["converged"].all()


REFUSALS = [
    ({"mode": {"start": 2.0}}, "must be above start"),
    ({"mode": {"start": None}}, "start"),
    ({"mode": {"start": -1.0}}, "must be"),
    ({"mode": {"number": 3}}, "has 2 elastic modes"),
    ({"mode": {"near": 1.3, "number": 1}}, "keep one of the two"),
    ({"sweep": {"start": 1.0}}, "leave &sweep out"),
    ({"harmonics": {"method": "tcm"}}, "use 'hbm'"),
    ({"harmonics": {"accuracy": 1e-3}}, "give n_harmonics"),
    ({"solver": {"kind": "powell"}}, "use 'newton'"),
    ({"sweep": {"end": 1.0}}, "leave &sweep out"),
    ({"sweep": {"n_points": 5}}, "leave &sweep out"),
    ({"sweep": {"values": [1.0, 2.0]}}, "leave &sweep out"),
    ({"sweep": {"stability": True}}, "leave &sweep out"),
    ({"sweep": {"continuation": "arclength"}}, "leave &sweep out"),
    ({"contact": {"memory": "carried"}}, "use 'assembly'"),
    ({"contact": {"law": "regularised", "tangential_stiffness": None, "slip_speed": 0.01}},
     "regularised"),
    ({"output": {"histories": True}}, "histories"),
    ({"mode": {"synthesis": [1.0] * 101}}, "at most 100"),
    ({"mode": {"synthesis": [1.0]}}, "without a load in harmonic 1"),
]


@pytest.mark.parametrize(("changes", "words"), REFUSALS)
def test_refusals(tmp_path, changes, words):
    done = run(tmp_path, mode_groups(CHAIN, 0.1, 1.0, 3, changes=changes), status=3)
    assert words in done.stderr
    assert not (tmp_path / "case.h5").exists()
    run(tmp_path, mode_groups(CHAIN, 0.1, 1.0, 3, changes=changes), "--check", status=3)


@pytest.mark.parametrize("named_by", [{"number": 1}, {"near": 1.3}])
def test_effective_input_runs_again(tmp_path, named_by):
    """The input that a result holds has no keys that the analysis refuses."""
    expected = follow(tmp_path, CHAIN, 0.1, 1.0, 3, **named_by)
    with h5py.File(tmp_path / "case.h5") as file:
        text = file.attrs["namelist"]
    (tmp_path / "again.nml").write_text(text)
    subprocess.run([PROGRAM, "-q", "-o", "again.h5", "again.nml"], cwd=tmp_path, check=True)
    found = read(tmp_path / "again.h5")
    assert np.array_equal(found["omega"], expected["omega"])


def test_too_many_unknowns(tmp_path):
    """LU factors one matrix of all dofs and coefficients: what would take hours is refused."""
    changes = {"harmonics": {"parity": "all"}, "solver": {"linear": "lu"}}
    done = run(tmp_path, mode_groups(CHAIN, 0.1, 1.0, 1500, changes=changes), status=3)
    assert "6002 here, 6000 at most" in done.stderr
    assert "'auto'" in done.stderr


#: Two equal masses in a row: in mode 1 they move alike, in mode 2 against each other.
TWINS = {
    "model": {"n_dof": 2, "mass": [1, 0, 0, 1], "stiffness": [2, -1, -1, 2],
              "damping": [0.02, -0.01, -0.01, 0.02]},
    "spring": {"n_springs": 1, "side_1": 1, "side_2": 2, "coefficient": 0.5, "power": 3}}
#: A third mass between them, which rests in the mode in which the others swing apart.
TRIPLETS = {
    "model": {"n_dof": 3, "mass": [1, 0, 0, 0, 1, 0, 0, 0, 1],
              "stiffness": [2, -1, 0, -1, 2, -1, 0, -1, 2],
              "damping": [0.02, -0.01, 0, -0.01, 0.02, -0.01, 0, -0.01, 0.02]},
    "spring": {"n_springs": 1, "side_1": 1, "side_2": 3, "coefficient": 0.5, "power": 3}}


def test_second_mode_of_twins(tmp_path):
    groups = merged(TWINS, {"output": {"observe": 1}})
    options = {"number": 2, "control": "observed"}
    assert follow(tmp_path, groups, 0.1, 1.0, 3, **options)["converged"].all()


def test_first_observed_at_a_node(tmp_path):
    """Its amplitude cannot be that of the curve: refused by name, unless the control is modal."""
    groups = merged(TRIPLETS, {"output": {"observe": [2, 1]}})
    observed = mode_groups(groups, 0.1, 1.0, 3, number=2, control="observed")
    done = run(tmp_path, observed, status=3)
    assert "at a node of mode 2" in done.stderr
    assert "'modal'" in done.stderr
    found = follow(tmp_path, groups, 0.1, 1.0, 3, number=2)
    assert found["converged"].all()
    assert np.abs(found["mode/first_harmonic"][:, 0]).max() < 1e-6
    other = merged(groups, {"output": {"observe": [1, 2]}})
    assert follow(tmp_path, other, 0.1, 1.0, 3, number=2, control="observed")["converged"].all()


def test_near_is_a_frequency(tmp_path):
    second = follow(tmp_path, CHAIN, 0.1, 1.0, 3, number=2)
    near = follow(tmp_path, CHAIN, 0.1, 1.0, 3, near=2.4)
    hertz = follow(tmp_path, CHAIN, 0.1, 1.0, 3, near=2.4 / (2 * np.pi), unit="Hz")
    assert near["attributes of mode"]["number"] == 2
    assert np.array_equal(near["omega"], second["omega"])
    assert hertz["omega"] == pytest.approx(second["omega"], rel=1e-14)


def test_words_of_limit_cycles(tmp_path):
    """The summary names each cycle with its stability, and says where there is none."""
    groups, numbers = REFERENCES["limit_cycle"]["groups"], []
    write_namelist(tmp_path / "case.nml", mode_groups(groups, 0.1, 10.0, 7, n_points=41))
    said = start(tmp_path, "case.nml").splitlines()
    line = next(line for line in said if line.startswith("limit cycles"))
    found = read(tmp_path / "case.h5")
    for k, amplitude in enumerate(found["mode/limit_cycle/amplitude"]):
        word = "stable" if found["mode/limit_cycle/stable"][k] else "unstable"
        numbers.append(f"a = {amplitude:.2E} ({word})")
    assert len(numbers) == 2
    assert line.split(None, 2)[2] == "2: " + ", ".join(numbers)


def test_no_limit_cycle(tmp_path):
    """No cycle where damping stays negative: the summary says so."""
    groups = merged(JENKINS, {"model": {"damping": -2.0}})
    write_namelist(tmp_path / "case.nml", mode_groups(groups, 0.1, 1.0, 3))
    said = start(tmp_path, "case.nml")
    assert "none up to a = 1.00E+00: the mode gains energy at every amplitude" in said
    assert "mode/limit_cycle/amplitude" not in read(tmp_path / "case.h5")


def test_synthesis_of_a_linear_mode_is_its_response(tmp_path):
    """Below the onset the response of one oscillator is exactly that of the formula."""
    groups = merged(JENKINS, {"load": {"cosine": 0.004}})
    found = follow(tmp_path, groups, 0.05, 0.45, 3, n_points=9, control="observed",
                   synthesis=[1.0, 2.0])
    omega = found["synthesis/omega"]
    assert omega.shape == (2, 9, 2)
    for j, scale in enumerate((1.0, 2.0)):
        for k, a in enumerate(found["synthesis/first_harmonic"]):
            for w in omega[j, k]:
                if np.isfinite(w):
                    response = scale * 0.004 / abs(2.0 - w**2 + 0.02j * w)
                    assert response == pytest.approx(a, rel=1e-9)
    assert np.isfinite(omega).any()
    scale = found["mode/resonant_scale"]
    assert scale == pytest.approx(found["mode/first_harmonic"][:, 0] * np.sqrt(2) * 0.02 / 0.004)


def test_synthesis_of_forced_peaks(tmp_path):
    """Peaks of forced sweeps: amplitude within 3 %, frequency within 1 %."""
    groups = merged(CHAIN, {"load": {"cosine": [0.0, 0.15]}, "output": {"observe": [2, 1]}})
    mode = follow(tmp_path, groups, 0.05, 10.0, 7, n_points=200, control="observed")
    scale, amplitude = mode["mode/resonant_scale"], mode["mode/first_harmonic"][:, 0]
    for factor in (0.5, 2.0, 5.0):
        k = np.flatnonzero((scale[1:] >= factor) & (scale[:-1] < factor))[-1]
        forced = merged(groups, {
            "case": {"analysis": "frf"}, "load": {"cosine": [0.0, 0.15 * factor]},
            "harmonics": {"n_harmonics": 7},
            "sweep": {"start": 1.0, "end": 1.5, "n_points": 101}})
        run(tmp_path, forced, name="forced")
        response = read(tmp_path / "forced.h5")
        first = np.hypot(response["coefficients"][:, 1, 0], response["coefficients"][:, 2, 0])
        peak = first.argmax()
        assert amplitude[k] == pytest.approx(first[peak], rel=0.03)
        assert mode["omega"][k] == pytest.approx(response["omega"][peak], rel=0.01)
