"""Modal damping of the stuck joint (model%modal_damping_of = 'stuck').

The damping is written anew by NumPy: modes from the eigenvectors of M over K with its springs, in
the null space of the rows that rigid pairs hold. Waves are held against the whole annulus, whose
damping is given as a matrix.
"""
import copy
import re
import sys

import numpy as np
import pytest
from cases import merged, namelist_text, read, run, write_parts
from project import ROOT
from scipy.linalg import eigh, null_space

import fretwear as fw

sys.path.insert(0, str(ROOT / "test" / "cyclic"))
from annulus import Annulus, random_case  # noqa: E402
from cyclic_cases import difference, run_at  # noqa: E402
from nodal_file import tied, write_nodal_file  # noqa: E402

RATIO = 0.03
STUCK = {"model": {"modal_damping": RATIO, "modal_damping_of": "stuck"}}
#: Of the largest entry: two routes to the same matrix.
SAME = 1e-10
#: Responses, which the resonances amplify.
RESPONSE = 1e-8
ELASTIC = ("penalty", "iwan", "bouc_wen")


def damped(mass, stiffness, springs, held, up_to=np.inf):
    """C over the ratio: springs are rows with a stiffness, held rows do not move."""
    for row, k in springs:
        stiffness = stiffness + k * np.outer(row, row)
    basis = null_space(np.array(held)) if len(held) else np.eye(len(mass))
    theta, x = eigh(basis.T @ mass @ basis, basis.T @ stiffness @ basis)
    # Massless directions have no mode.
    kept = theta > 1e-11 * theta.max()
    omega = 1.0 / np.sqrt(theta[kept])
    sides = mass @ basis @ x[:, kept] / np.sqrt(theta[kept])
    return (sides * np.where(omega <= up_to, 2.0 * omega, 0.0)) @ sides.T


def structure(seed, laws, massless=False):
    """Masses in a row with a pair for each law, a linear and a cubic spring; groups, and the rows
    of the closed joint."""
    random = np.random.default_rng([33, seed])
    n = 3 * len(laws) + 1
    k = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    order = random.permutation(n)
    springs = [(np.eye(n)[order[0]], 0.7)]
    held, side_1, side_2 = [], [], []
    contact = {"mu": 0.4, "gap": random.choice([-0.1, 0.0, 0.2], len(laws)).tolist()}
    k_t, k_n = random.uniform(1.0, 3.0, (2, len(laws)))
    for i, law in enumerate(laws):
        a, b, c = order[3 * i + 1:3 * i + 4]
        if massless:
            mass[a, a] = mass[c, c] = 0.0
        joint = law in ("iwan", "bouc_wen")
        side_1.append([int(a) + 1, 0, 0 if joint else int(c) + 1])
        side_2.append([int(b) + 1, 0, 0])
        slides, presses = np.eye(n)[a] - np.eye(n)[b], np.eye(n)[c]
        if law in ELASTIC:
            springs.append((slides, k_t[i]))
        else:
            held.append(slides)
        if joint:
            contact |= {"gap": 0.0, "normal_load": 1.0}
        elif law in ("dlft", "dlft_velocity", "rigid"):
            held.append(presses)
        else:
            springs.append((presses, k_n[i]))
    if any(law in ELASTIC for law in laws):
        contact["tangential_stiffness"] = k_t.tolist()
    if any(law in (*ELASTIC, "regularised") for law in laws):
        if any(side[2] for side in side_1):
            contact["normal_stiffness"] = k_n.tolist()
    if "regularised" in laws:
        contact["slip_speed"] = 0.1
    if "iwan" in laws:
        contact |= {"iwan_chi": -0.5, "iwan_beta": 0.5}
    groups = {"case": {"analysis": "point"},
              "model": {"n_dof": n, "mass": mass, "stiffness": stiffness},
              "contact": {"n_pairs": len(laws), "law": list(laws), "side_1": side_1,
                          "side_2": side_2, **contact},
              "spring": {"n_springs": 2, "side_1": [int(order[0]) + 1, int(order[1]) + 1],
                         "coefficient": [0.7, 5.0], "power": [1, 3]},
              "load": {"cosine": random.normal(size=n)},
              "harmonics": {"n_harmonics": 1}, "sweep": {"start": 0.9}}
    return groups, (mass, stiffness, springs, held)


def damping_of(groups):
    with fw.Case.from_text(namelist_text(groups)).open() as session:
        n = len(session.part("load/cosine"))
        return session.part("damping").reshape(n, n)


@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("laws", [
    ("penalty",), ("dlft",), ("rigid",), ("regularised",), ("penalty", "penalty"),
    ("penalty", "dlft"), ("regularised", "dlft", "penalty"), ("iwan",), ("bouc_wen",)])
def test_matrix(laws, massless):
    """Springs of elastic pairs, held rows of others, at a gap or not; dofs without mass."""
    for seed in range(3):
        groups, parts = structure(seed, laws, massless)
        found, wanted = damping_of(merged(groups, STUCK)), RATIO * damped(*parts)
        assert np.abs(found - wanted).max() < SAME * np.abs(wanted).max()


def test_lowest_modes():
    """modal_damping_up_to bounds the stuck frequencies."""
    groups, parts = structure(1, ("penalty", "dlft"))
    found = damping_of(merged(groups, {"model": STUCK["model"] | {
        "modal_damping_up_to": 1.5 / (2.0 * np.pi)}}))
    wanted = RATIO * damped(*parts, up_to=1.5)
    assert np.abs(found - wanted).max() < SAME * np.abs(wanted).max()
    assert np.abs(wanted - RATIO * damped(*parts)).max() > 0.1 * np.abs(wanted).max()


def test_all_is_held():
    """A structure that the joint holds everywhere has no mode to damp."""
    groups = {"model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0},
              "contact": {"n_pairs": 1, "law": "dlft", "side_1": [1, 0, 0], "mu": 0.3,
                          "normal_load": 1.0},
              "case": {"analysis": "point"}, "load": {"cosine": 1.0}, "sweep": {"start": 0.9}}
    assert damping_of(merged(groups, STUCK)) == 0.0


def test_default_is_open():
    """Bit for bit, and without the joint."""
    groups, (mass, stiffness, _, _) = structure(0, ("penalty", "dlft"))
    plain = damping_of(merged(groups, {"model": {"modal_damping": RATIO}}))
    assert np.array_equal(plain, damping_of(merged(groups, {"model": {
        "modal_damping": RATIO, "modal_damping_of": "open"}})))
    wanted = RATIO * damped(mass, stiffness, [], [])
    assert np.abs(plain - wanted).max() < SAME * np.abs(wanted).max()


@pytest.mark.parametrize("law", ["penalty", "dlft", "rigid"])
def test_wave_of_the_annulus(tmp_path, law):
    """A sector against the whole annulus with its own damping as a matrix."""
    rng = np.random.default_rng([34, len(law)])
    case = random_case(rng, law=law, n_sectors=6, engine_order=2)
    annulus = Annulus(case)
    whole = annulus.case
    mass, stiffness = (np.array(whole["model"][key]) for key in ("mass", "stiffness"))
    springs, held, unit = [], [], np.eye(len(mass))
    contact = whole["contact"]

    def row(signed):
        return np.sign(signed) * unit[abs(signed) - 1]

    for i, (one, two) in enumerate(zip(contact["side_1"], contact["side_2"])):
        for c in (0, 2):
            relative = row(one[c]) - row(two[c])
            if law == "penalty":
                name = "tangential_stiffness" if c == 0 else "normal_stiffness"
                springs.append((relative, contact[name][i]))
            else:
                held.append(relative)
    matrix = RATIO * damped(mass, stiffness, springs, held)
    whole["model"]["damping"] = (np.array(whole["model"]["damping"]) + matrix).tolist()
    folders = [tmp_path / name for name in ("sector", "annulus")]
    for folder in folders:
        folder.mkdir()
    # The frequencies at which friction slips and stops.
    sector = run_at(folders[0], case, [0.9, 1.6], others=STUCK, sampling="auto")
    both = run_at(folders[1], whole, [0.9, 1.6], sampling="auto")
    assert difference(sector["coefficients"], annulus.sector(both["coefficients"])) < RESPONSE
    unlike = run_at(folders[0], case, [0.9, 1.6], sampling="auto",
                    others={"model": {"modal_damping": RATIO}})
    assert difference(unlike["coefficients"], annulus.sector(both["coefficients"])) > 1e-3


@pytest.mark.parametrize("law", ["penalty", "dlft"])
def test_matrices_of_nodal_diameters(tmp_path, law):
    """All nodal diameters of a sector, given by themselves; all sectors at once."""
    case = random_case(np.random.default_rng(35), law=law, n_sectors=5, engine_order=-1)
    diameters = {}
    for k in range(case["n_sectors"] // 2 + 1):
        diameters[k], kept = tied(case, k)
    n = len(case["model"]["mass"])
    place = {i + 1: p + 1 for p, i in enumerate(kept)}
    contact = copy.deepcopy(case["contact"])
    for name in ("side_1", "side_2"):
        contact[name] = [[int(np.sign(d)) * place[abs(d)] if d else 0 for d in side]
                         for side in contact[name]]
    write_nodal_file(tmp_path / "model.h5", case["n_sectors"], len(kept), diameters,
                     contact=contact, observe=[f"u{i + 1}" for i in range(n)])
    (tmp_path / "sector").mkdir()
    sector = run_at(tmp_path / "sector", case, [1.1], others=STUCK)
    run(tmp_path, {"case": {"analysis": "frf"},
                   "model": {"source": "hdf5", "file": "model.h5", **STUCK["model"]},
                   "cyclic": {"engine_order": case["engine_order"]}, "contact": {"law": law},
                   "harmonics": {"n_harmonics": case["n_harmonics"], "sampling": "events"},
                   "sweep": {"values": [1.1]}, "solver": {"tolerance": 1e-12}})
    found = read(tmp_path / "case.h5")
    assert difference(found["coefficients"], sector["coefficients"]) < RESPONSE
    ring = run_at(tmp_path / "sector", case, [1.1], others=merged(STUCK, {
        "cyclic": {"n_sectors": 5, "engine_order": -1, "n_interface": len(case["model"]["left"]),
                   "left": case["model"]["left"], "right": case["model"]["right"],
                   "mistuned": True}}))
    assert difference(ring["coefficients"][:, :, :n], sector["coefficients"]) < RESPONSE


@pytest.mark.parametrize("law", ["penalty", "dlft"])
@pytest.mark.parametrize("number", [1, 2])
def test_free_decay(tmp_path, law, number):
    """Swings of the stuck structure have the ratio that was asked for, in each of its modes."""
    stiffness = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    groups = {"case": {"analysis": "ringdown"},
              "model": {"n_dof": 3, "mass": np.eye(3), "stiffness": stiffness,
                        "modal_damping": 0.15, "modal_damping_of": "stuck"},
              "contact": {"n_pairs": 1, "law": law, "side_1": [2, 0, 0], "side_2": [3, 0, 0],
                          "mu": 0.5, "normal_load": 1e6},
              "ringdown": {"number": number, "amplitude": 1.0, "n_cycles": 4,
                           "steps_per_period": 2000}, "output": {"observe": [1]}}
    if law == "penalty":
        groups["contact"]["tangential_stiffness"] = 3.0
    run(tmp_path, groups)
    result = read(tmp_path / "case.h5")
    # The integration is of second order in a step.
    assert result["ringdown/damping_ratio"] == pytest.approx(0.15, rel=1e-4)
    groups["model"]["modal_damping_of"] = "open"
    run(tmp_path, groups)
    unlike = read(tmp_path / "case.h5")["ringdown/damping_ratio"][0]
    assert abs(unlike - 0.15) > 3e-4


def test_derivatives_follow_the_speed(tmp_path):
    """By the ratio, and by a rotation speed with which the stuck modes turn: differences."""
    groups, (mass, stiffness, _, _) = structure(2, ("penalty", "penalty"))
    groups = merged(merged(groups, STUCK), {"contact": {"gap": -0.2}, "spring": {"power": 1},
                                            "load": {"harmonic_scale": 0.01}})
    write_parts(tmp_path / "model.h5", {
        "mass": mass, "stiffness": stiffness,
        "stiffness_rotation": 0.2 * stiffness + np.diag(np.linspace(0.1, 0.5, len(mass)))})
    groups["model"] = {"source": "hdf5", "file": "model.h5", "rotation_speed": 0.8,
                       **STUCK["model"]}
    groups["solver"] = {"tolerance": 1e-12}
    groups["sensitivity"] = {"parameters": ["model%modal_damping", "model%rotation_speed"]}
    run(tmp_path, groups)
    result = read(tmp_path / "case.h5")
    del groups["sensitivity"]
    for key, value in (("modal_damping", RATIO), ("rotation_speed", 0.8)):
        step, ends = 1e-4 * value, []
        for sign in (-1.0, 1.0):
            groups["model"][key] = value + sign * step
            run(tmp_path, groups, name="other")
            u = read(tmp_path / "other.h5")["coefficients"][0]
            ends.append(np.hypot(u[1], u[2]))
        groups["model"][key] = value
        wanted = (ends[1] - ends[0]) / (2.0 * step)
        found = result[f"sensitivity/first_harmonic/model_{key}"][0]
        assert np.abs(found - wanted).max() < 1e-6 * np.abs(wanted).max()


SMALL, _ = structure(0, ("penalty",))
REFUSED = {
    "word": ({"model": {"modal_damping_of": "closed"}}, "must be 'open' or 'stuck'"),
    "curve": ({"contact": {"normal_law": "power", "normal_coefficient": 1.0,
                           "normal_exponent": 1.5, "normal_stiffness": None}}, "normal_law"),
    "steady": ({"contact": {"sliding": "steady", "speed_1": 0.1}}, "sliding = 'steady'"),
    "derivative": ({"sensitivity": {"parameters": ["contact%tangential_stiffness"]}},
                   "contact%tangential_stiffness"),
    "sweep": ({"case": {"analysis": "frf"},
               "sweep": {"parameter": "spring%coefficient", "frequency": 0.9, "start": 1.0,
                         "end": 2.0, "n_points": 3}}, "spring%coefficient"),
    "resonance": ({"case": {"analysis": "resonance"},
                   "resonance": {"parameter": "contact%normal_stiffness", "start": 1.0,
                                 "end": 2.0},
                   "sweep": {"start": 0.5, "end": 1.5, "n_points": 11}}, "contact%normal_stiffness")}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(tmp_path, name):
    changes, word = REFUSED[name]
    done = run(tmp_path, merged(merged(SMALL, STUCK), changes), status=3)
    assert "modal_damping_of" in done.stderr and word in done.stderr


def test_the_summary_says_so(tmp_path):
    done = run(tmp_path, merged(SMALL, STUCK), quiet=False)
    assert re.search(r"modal damping +of modes with stuck contact", done.stdout)
    done = run(tmp_path, merged(SMALL, {"model": {"modal_damping": RATIO}}), quiet=False)
    assert "stuck contact" not in done.stdout
