"""A mode is the response to its own load: judged by forced responses of the same program, by a
balance written in NumPy, and by the work of all forces."""
import numpy as np
import pytest
from cases import merged, read, run
from mode_cases import (
    REFERENCES,
    amplitudes,
    at_amplitude,
    follow,
    matrices,
    mode_groups,
    pair_force,
    read_mode,
)

#: Residuals of the run times the condition of the bordered matrix.
SOLVED = 1e-9
SEVERAL = {
    "model": {"n_dof": 4, "mass": list(np.diag([1.0, 1.5, 2.0, 1.0]).ravel()),
              "stiffness": [3, -1, 0, 0, -1, 3, -1, 0, 0, -1, 3, -1, 0, 0, -1, 2],
              "damping": [.03, -.01, 0, 0, -.01, .03, -.01, 0, 0, -.01, .04, -.01, 0, 0, -.01,
                          .02]},
    "contact": {"n_pairs": 2, "law": "penalty", "side_1": [1, 0, 0, 3, 0, 4],
                "side_2": [0, 0, 0, 2, 0, 0], "mu": [0.4, 0.5], "normal_load": [1.0, 0.0],
                "tangential_stiffness": [1.5, 1.0], "normal_stiffness": [0.0, 2.0]},
    "load": {"static": [0, 0, 0, -1.0]}, "output": {"observe": [1, 2, 3, 4]}}
RIGID = merged(SEVERAL, {"contact": {"law": "dlft", "tangential_stiffness": None,
                                     "normal_stiffness": None}})
PLANAR = merged(SEVERAL, {"contact": {"side_1": [1, 2, 0, 3, 0, 4]}})
CASES = {"elastic": SEVERAL, "rigid": RIGID, "two directions": PLANAR,
         "normal": REFERENCES["normal"]["groups"], "chain": REFERENCES["chain"]["groups"]}


@pytest.mark.parametrize("name", CASES)
def test_response_to_its_own_load(tmp_path, name):
    """One harmonic: a forced response with the load i omega xi M U_1 is the mode."""
    groups = CASES[name]
    found = follow(tmp_path, groups, 0.2, 1.5, 1, n_points=6)
    assert found["converged"].all()
    # The last point is one of slip or separation.
    assert found["contact/fraction"][-1, :, 0].min() < 0.98
    mass = matrices(groups)[0]
    for k, omega in enumerate(found["omega"]):
        load = 1j * omega * found["mode/self_excitation"][k] * (
            mass @ amplitudes(found["coefficients"][k])[1])
        forced = merged(groups, {
            "case": {"analysis": "point"}, "sweep": {"start": omega},
            "harmonics": {"n_harmonics": 1, "sampling": "events", "parity": "all"},
            "load": {"cosine": list(load.real), "sine": list(-load.imag)},
            "solver": {"tolerance": 1e-13}})
        run(tmp_path, forced, name="forced")
        response = read(tmp_path / "forced.h5")["coefficients"][0]
        # The mode is next to the response in every direction of its resonance: what is compared is
        # the force that the difference takes.
        n = min(len(response), len(found["coefficients"][k]))
        scale = np.abs(found["coefficients"][k]).max()
        assert np.abs(response[:n] - found["coefficients"][k][:n]).max() < 1e-7 * scale


@pytest.mark.parametrize("n_harmonics", [1, 5])
@pytest.mark.parametrize("name", CASES)
def test_balance_and_work(tmp_path, name, n_harmonics):
    """(K - theta M + i n omega C) U_n + contact = static load, theta = (n omega)^2 + i n omega xi;
    contact and dampers take in a cycle what the self-excitation gives."""
    groups = CASES[name]
    found = follow(tmp_path, groups, 0.2, 1.5, n_harmonics, n_points=6)
    mass, stiffness, damping = matrices(groups)
    for k, omega in enumerate(found["omega"]):
        xi = found["mode/self_excitation"][k]
        u = amplitudes(found["coefficients"][k])
        force = pair_force(groups, found["contact/force"][k])
        largest = np.abs(stiffness @ u.T).max()
        work = 0.0
        for n in range(n_harmonics + 1):
            theta = (n * omega) ** 2 + 1j * n * omega * xi
            z = stiffness - theta * mass + 1j * n * omega * damping
            static = np.array(groups.get("load", {}).get("static", 0.0)) if n == 0 else 0.0
            left = z @ u[n] + force[n] - static
            assert np.abs(left).max() < SOLVED * largest, (k, n)
            given = xi * mass - damping
            work += np.pi * n**2 * omega * (u[n].conj() @ given @ u[n]).real
        taken = found["contact/dissipation"][k].sum()
        assert taken == pytest.approx(work, rel=1e-8, abs=1e-10 * largest**2)


def test_damping_takes_the_place_of_the_self_excitation(tmp_path):
    """The same motion with C - xi M has no self-excitation left: a limit cycle."""
    groups = REFERENCES["chain"]["groups"]
    omega, zeta = at_amplitude(tmp_path, groups, 1.5, 5)
    mass, _, damping = matrices(groups)
    other = merged(groups, {"model": {
        "damping": list((damping - 2 * zeta * omega * mass).T.ravel())}})
    again, rest = at_amplitude(tmp_path, other, 1.5, 5)
    assert again == pytest.approx(omega, rel=1e-9)
    assert abs(rest) < 1e-9


def test_units(tmp_path):
    """Lengths in mm, masses in tonnes: stiffnesses 1e-3 of N/m, numbers of the mode as before."""
    groups = REFERENCES["normal"]["groups"]
    scaled = merged(groups, {
        "model": {key: [1e-3 * x for x in groups["model"][key]]
                  for key in ("mass", "stiffness", "damping")},
        "contact": {key: 1e-3 * groups["contact"][key]
                    for key in ("tangential_stiffness", "normal_stiffness")}})
    first = follow(tmp_path, groups, 0.2, 2.0, 5, n_points=5, control="observed")
    second = follow(tmp_path, scaled, 200.0, 2000.0, 5, n_points=5, control="observed")
    assert second["omega"] == pytest.approx(first["omega"], rel=1e-9)
    assert second["mode/damping_ratio"] == pytest.approx(first["mode/damping_ratio"], rel=1e-8)


def test_first_quantity_has_a_positive_cosine(tmp_path):
    for control in ("observed", "modal"):
        found = follow(tmp_path, PLANAR, 0.2, 2.0, 5, n_points=6, control=control)
        assert (found["coefficients"][:, 1, 0] > 0.0).all()
        assert np.abs(found["coefficients"][:, 2, 0]).max() < 1e-12
        if control == "observed":
            assert found["mode/first_harmonic"][:, 0] == pytest.approx(
                np.geomspace(0.2, 2.0, 6), rel=1e-9)
        else:
            assert found["mode/modal_amplitude"] == pytest.approx(
                np.geomspace(0.2, 2.0, 6), rel=1e-9)


def test_controls_agree(tmp_path):
    modal = follow(tmp_path, SEVERAL, 0.5, 1.5, 5, n_points=3)
    for k in range(3):
        first = modal["mode/first_harmonic"][k, 0]
        other = follow(tmp_path, SEVERAL, first, 1.001 * first, 5, control="observed")
        assert other["omega"][0] == pytest.approx(modal["omega"][k], rel=1e-9)
        assert other["mode/modal_amplitude"][0] == pytest.approx(
            modal["mode/modal_amplitude"][k], rel=1e-9)


@pytest.mark.parametrize("changes", [
    {"case": {"threads": 2}}, {"harmonics": {"parity": "all"}}])
def test_ways_agree(tmp_path, changes):
    """Even harmonics that symmetry leaves out, and threads, do not change a mode."""
    first = follow(tmp_path, REFERENCES["chain"]["groups"], 0.2, 3.0, 5, n_points=5)
    other = follow(tmp_path, REFERENCES["chain"]["groups"], 0.2, 3.0, 5, n_points=5,
                   changes=changes)
    assert other["omega"] == pytest.approx(first["omega"], rel=1e-10)
    assert other["mode/damping_ratio"] == pytest.approx(first["mode/damping_ratio"], rel=1e-9)


def test_instants_come_near(tmp_path):
    """Events are located unless instants are asked for, which miss them by little."""
    events = follow(tmp_path, REFERENCES["chain"]["groups"], 0.2, 3.0, 5, n_points=5)
    instants = follow(tmp_path, REFERENCES["chain"]["groups"], 0.2, 3.0, 5, n_points=5,
                      changes={"harmonics": {"sampling": "uniform", "n_time": 1024}})
    assert instants["omega"] == pytest.approx(events["omega"], rel=1e-3)
    assert np.abs(instants["omega"] - events["omega"]).max() > 0.0


def test_branch_and_amplitudes_agree(tmp_path):
    branch = follow(tmp_path, PLANAR, 0.2, 2.0, 5, n_points=12, continuation="arclength")
    assert branch["converged"].all()
    for k in range(0, len(branch["omega"]), 4):
        omega, zeta = at_amplitude(tmp_path, PLANAR, branch["mode/modal_amplitude"][k], 5)
        assert omega == pytest.approx(branch["omega"][k], rel=1e-9)
        assert zeta == pytest.approx(branch["mode/damping_ratio"][k], rel=1e-8)


def test_a_file_in_between(tmp_path):
    """A result can be read like any other: no second format."""
    run(tmp_path, mode_groups(SEVERAL, 0.2, 1.4, 3, n_points=4))
    found = read_mode(tmp_path)
    assert found["mode/shape"].shape == (4, 4, 2)
    shape = found["coefficients"][:, 1:3].transpose(0, 2, 1)
    assert found["mode/shape"] == pytest.approx(
        shape / found["mode/modal_amplitude"][:, None, None], rel=1e-12)
    assert np.hypot(*found["coefficients"][:, 1:3].transpose(1, 0, 2)) == pytest.approx(
        found["mode/first_harmonic"])
    assert found["mode/damping_ratio"] == pytest.approx(
        found["mode/self_excitation"] / (2 * found["omega"]))


def test_amplitudes_of_a_list(tmp_path):
    """Rows at amplitudes of their own, however far apart; what disagrees is refused."""
    wanted = [0.21, 0.9, 1.3]
    groups = merged(mode_groups(SEVERAL, None, None, 3, n_points=None),
                    {"mode": {"amplitudes": wanted, "continuation": None}})
    run(tmp_path, groups)
    found = read_mode(tmp_path)
    assert found["mode/modal_amplitude"] == pytest.approx(wanted, rel=1e-9)
    for k, amplitude in enumerate(wanted):
        omega, zeta = at_amplitude(tmp_path, SEVERAL, amplitude, 3)
        assert found["omega"][k] == pytest.approx(omega, rel=1e-10)
        assert found["mode/damping_ratio"][k] == pytest.approx(zeta, rel=1e-8)
    for changes in ({"start": 0.3}, {"n_points": 4}, {"continuation": "arclength"},
                    {"amplitudes": [0.3, 0.2]}):
        assert "mode" in run(tmp_path, merged(groups, {"mode": changes}), status=3).stderr
