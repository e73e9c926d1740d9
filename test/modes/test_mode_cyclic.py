"""Nonlinear modes of travelling waves: a sector against the whole annulus, written out, and against
the program's own response of the annulus to the load of the mode."""
import sys

import numpy as np
import pytest
from cases import merged, read, run
from mode_cases import REFERENCES, amplitudes, follow, read_mode
from project import EXAMPLE, ROOT

sys.path.insert(0, str(ROOT / "test" / "cyclic"))
from annulus import Annulus, random_case
from cyclic_cases import model_groups
from wave_balance import unbalanced, whole_motion, work_error

#: Residuals of the run times the condition of the bordered matrix.
SOLVED = 1e-9
#: Sectors, engine order, law; waves both ways, in phase, in antiphase, aliased.
WAVES = [(6, 1, "penalty"), (7, -2, "penalty"), (6, 3, "penalty"), (5, 0, "penalty"),
         (5, 4, "dlft"), (12, 5, "dlft"), (7, 9, "dlft_velocity")]


def wave_groups(case, start, end, n_harmonics, **mode):
    groups = model_groups(case)
    return merged(groups, {
        "case": {"analysis": "mode"},
        "mode": {"start": start, "end": end, "n_points": 3, "control": "modal",
                 "continuation": "natural", **mode},
        "harmonics": {"n_harmonics": n_harmonics},
        "output": {"observe": list(range(1, len(case["model"]["mass"]) + 1))},
        "solver": {"tolerance": 1e-12}})


def wave_mode(folder, case, start, end, n_harmonics, status=(0, 4), **mode):
    run(folder, wave_groups(case, start, end, n_harmonics, **mode), status=status)
    found = read_mode(folder)
    keep = found["converged"].astype(bool)
    assert keep.sum() >= 2
    return found


def random_wave(n_sectors, order, law, seed=3):
    rng = np.random.default_rng(seed + 10 * n_sectors + order)
    case = random_case(rng, law=law, n_sectors=n_sectors, engine_order=order)
    case["load"]["cosine"] = [0.0] * len(case["load"]["cosine"])
    case["load"]["sine"] = [0.0] * len(case["load"]["sine"])
    return case


@pytest.mark.parametrize(("n_sectors", "order", "law"), WAVES)
def test_balance_of_the_annulus(tmp_path, n_sectors, order, law):
    """All sectors written out: (K - theta M + i n omega C) U_n + contact = static load."""
    case = random_wave(n_sectors, order, law)
    found = wave_mode(tmp_path, case, 0.02, 2.0 if order == 0 else 0.4, 3)
    ring = Annulus(case)
    slipped = 0
    for k in np.flatnonzero(found["converged"]):
        assert unbalanced(ring, case, found, k) < SOLVED
        assert work_error(ring, case, found, k) < 1e-7
        slipped += found["contact/fraction"][k, :, 0].min() < 0.99
    assert slipped


def test_response_of_the_annulus_to_its_own_load(tmp_path):
    """One harmonic: the annulus under the load i omega xi M U_1 of all sectors."""
    case = random_wave(7, -2, "penalty")
    found = wave_mode(tmp_path, case, 0.06, 0.12, 1)
    assert found["contact/fraction"][-1, :, 0].min() < 0.8
    ring = Annulus(case)
    groups = model_groups(ring.case)
    size = groups["model"]["n_dof"]
    mass = np.reshape(groups["model"]["mass"], (size, size))
    for k, omega in enumerate(found["omega"]):
        u = amplitudes(found["coefficients"][k])
        motion = whole_motion(ring, case, u[1], 1)
        load = 1j * omega * found["mode/self_excitation"][k] * (mass @ motion)
        forced = merged(groups, {
            "case": {"analysis": "point"}, "sweep": {"start": omega},
            "harmonics": {"n_harmonics": 1, "sampling": "events", "parity": "all"},
            "load": {"cosine": list(load.real), "sine": list(-load.imag)},
            "output": {"observe": list(range(1, size + 1))}, "solver": {"tolerance": 1e-13}})
        run(tmp_path, forced, name="forced")
        response = amplitudes(read(tmp_path / "forced.h5")["coefficients"][0])[1]
        assert np.abs(response - motion).max() < 1e-7 * np.abs(motion).max()


def test_orders_that_are_the_same_wave(tmp_path):
    case = random_wave(6, 1, "penalty")
    first = wave_mode(tmp_path, case, 0.05, 0.4, 3)
    again = wave_mode(tmp_path, case | {"engine_order": 7}, 0.05, 0.4, 3)
    assert again["omega"] == pytest.approx(first["omega"], rel=1e-10)
    assert again["mode/damping_ratio"] == pytest.approx(first["mode/damping_ratio"], rel=1e-9)
    other = wave_mode(tmp_path, case | {"engine_order": 2}, 0.05, 0.4, 3)
    assert abs(other["omega"][0] / first["omega"][0] - 1) > 1e-3


@pytest.mark.parametrize("order", [0, 3])
def test_standing_waves_are_modes_of_the_annulus(tmp_path, order):
    """In phase and in antiphase a mode is single: the annulus has it as one of its own."""
    case = random_wave(6, order, "penalty")
    found = wave_mode(tmp_path, case, 0.02, 0.3, 3)
    stuck = found["attributes of mode"]["stuck_omega"]
    ring = Annulus(case)
    groups = merged(model_groups(ring.case), {
        "case": {"analysis": "mode"},
        # Six sectors move where one did.
        "mode": {"start": 0.02 * np.sqrt(6), "end": 0.3 * np.sqrt(6), "n_points": 3,
                 "control": "modal", "continuation": "natural", "near": stuck},
        "harmonics": {"n_harmonics": 3}, "solver": {"tolerance": 1e-12}})
    run(tmp_path, groups, status=(0, 4))
    whole = read_mode(tmp_path)
    n = min(len(whole["omega"]), len(found["omega"]))
    assert whole["attributes of mode"]["stuck_omega"] == pytest.approx(stuck, rel=1e-9)
    assert whole["omega"][:n] == pytest.approx(found["omega"][:n], rel=1e-8)
    assert whole["mode/damping_ratio"][:n] == pytest.approx(found["mode/damping_ratio"][:n],
                                                            rel=1e-7)


@pytest.mark.parametrize("control", ["observed", "modal"])
@pytest.mark.parametrize("name", ["chain", "normal", "preload"])
def test_one_sector_is_a_plain_structure(tmp_path, name, control):
    groups = REFERENCES[name]["groups"]
    plain = follow(tmp_path, groups, 0.2, 1.5, 5, n_points=4, control=control)
    ring = merged(groups, {"cyclic": {"n_sectors": 1, "engine_order": 0}})
    found = follow(tmp_path, ring, 0.2, 1.5, 5, n_points=4, control=control)
    assert found["omega"] == pytest.approx(plain["omega"], rel=1e-10)
    assert found["mode/damping_ratio"] == pytest.approx(plain["mode/damping_ratio"], rel=1e-8)
    assert found["attributes of mode"]["onset_amplitude"] == pytest.approx(
        plain["attributes of mode"]["onset_amplitude"], rel=1e-9)


def test_stuck_waves_of_the_disk(tmp_path):
    """Each nodal diameter has its own stuck modes, and its own onset: 36 sectors."""
    groups = {"model": {"source": "hdf5", "file": EXAMPLE / "shrouded_disk" / "disk.h5"},
              "contact": {"law": "penalty", "mu": 0.3, "gap": -0.04, "tangential_stiffness": 5e4,
                          "normal_stiffness": 5e4}}
    run(tmp_path, merged(groups, {"case": {"analysis": "modes"}}), name="modes")
    closed = read(tmp_path / "modes.h5")["modes/closed"]
    onsets = []
    for order in (3, 4, -4):
        run(tmp_path, merged(groups, {
            "case": {"analysis": "mode"}, "cyclic": {"n_sectors": 36, "engine_order": order},
            "mode": {"start": 1e-3, "end": 3e-3, "n_points": 3, "continuation": "natural"},
            "harmonics": {"n_harmonics": 1}, "output": {"contact": False}}))
        found = read_mode(tmp_path)
        assert found["converged"].all()
        assert found["attributes of mode"]["stuck_omega"] == pytest.approx(
            closed[abs(order), 0], rel=1e-9)
        onset = found["attributes of mode"]["onset_amplitude"]
        stuck = found["mode/first_harmonic"][:, 0] < onset
        assert (np.abs(found["mode/damping_ratio"][stuck]) < 1e-9).all()
        assert (found["mode/damping_ratio"][~stuck] > 1e-5).all()
        onsets.append(onset)
    # Waves both ways differ where pairs slip on the way to the cycle: by little here.
    assert onsets[1] == pytest.approx(onsets[2], rel=2e-3)
    # With three nodal diameters slip begins later.
    assert onsets[0] > 1.2 * onsets[1]
