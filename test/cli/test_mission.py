"""Missions: blocks of cycles in other conditions wear a joint in turn, flight after flight."""
import json
import signal

import h5py
import numpy as np
import pytest
from cases import merged, read, run, signal_at, write_namelist
from project import PROGRAM, ROOT
from scipy.integrate import solve_ivp
from wear_cases import CLOCK, joint, oscillator, result, shared_load

LAWS = ROOT / "test" / "reference" / "laws"
SLIDING = json.loads((LAWS / "wear_mission.json").read_text())["cases"]
VIBRATING = json.loads((LAWS / "wear_mission_vibration.json").read_text())["cases"]["vibrating"]
# Marches of order 3 with steps of this error, over some hundred of them.
STEP, MARCHED = 1e-9, 1e-10
# Rates that change with friction: tolerances of 1e-8 to 1e-11 leave what they say, over all steps
# together; a margin of ten.
RUBBED = 10.0 * STEP


def mission(groups, blocks, n_flights, per_jump=1, **changes):
    """A case with blocks [(cycles, change)]."""
    given = {"n_blocks": len(blocks), "cycles": [float(cycles) for cycles, _ in blocks],
             "change": [change for _, change in blocks], "n_flights": n_flights,
             "flights_per_jump": per_jump}
    return merged(groups, {"mission": given, "wear": {"n_cycles": None}, **changes})


def scaled(**scales):
    return "; ".join(f"load%{name}_scale = {value!r}" for name, value in scales.items())


def sliding(name, n_flights=None, per_jump=1, slower=1.0, tolerance=STEP):
    """A rigid pair on massless dofs, dragged to and fro by the amplitudes of the blocks."""
    p = SLIDING[name]["params"]
    model = {"n_dof": 2, "mass": [0.0] * 4, "stiffness": np.diag([p["kt"], p["kn"]])}
    contact = {"n_pairs": 1, "side_1": [1, 0, 2], "mu": p["mu"], "area": 1.0}
    load = {"cosine": [p["kt"], 0.0], "static": [0.0, -p["p0"]]}
    blocks = [(block["cycles"], scaled(harmonic=block["a"],
                                       static=block.get("static_scale", 1.0)))
              for block in p["blocks"]]
    groups = joint(model, contact, load, 1.0, p["k_w_over_A"] * slower,
                   {"error_tolerance": tolerance})
    return mission(groups, blocks, n_flights or p["flights"], per_jump)


@pytest.mark.parametrize("name", ["plain", "speed"])
def test_sliding_pair(tmp_path, name):
    """Depth, energy and cycles after each block, as DOP853 has them."""
    found = result(tmp_path, sliding(name))
    rows = SLIDING[name]["after_each_block"]
    for key in ("flight", "block"):
        assert found[f"wear/{key}"].tolist() == [row[key] for row in rows]
    np.testing.assert_allclose(found["wear/depth"][:, 0], [row["W"] for row in rows],
                               rtol=MARCHED, atol=0)
    np.testing.assert_allclose(found["wear/energy"][:, 0], [row["energy"] for row in rows],
                               rtol=MARCHED, atol=0)
    n_blocks = len(SLIDING[name]["params"]["blocks"])
    cycles = [block["cycles"] for block in SLIDING[name]["params"]["blocks"]] * 3
    np.testing.assert_allclose(found["wear/cycles"], np.cumsum([0, *cycles]), rtol=1e-14)
    depth = found["wear/depth"][:, 0]
    assert found["mission/depth"][:, 0].tolist() == depth[::n_blocks].tolist()
    worn = np.diff(depth).reshape(-1, n_blocks).sum(axis=0)
    np.testing.assert_allclose(found["mission/share"][:, 0], worn / depth[-1], rtol=1e-12)


def rubbing(slide, mu, by_energy, cycles):
    """Depth of a pair whose normal force falls with it, in the units of `plain`."""
    p = SLIDING["plain"]["params"]

    def rate(_, depth):
        normal = p["p0"] - p["kn"] * depth[0]
        return p["k_w_over_A"] * normal * 4.0 * (slide - mu(depth[0]) * normal / p["kt"]) * (
            mu(depth[0]) if by_energy else 1.0)

    return solve_ivp(rate, (0.0, cycles), [0.0], method="DOP853", rtol=1e-12,
                     atol=1e-14).y[0, -1]


@pytest.mark.parametrize("law", ["archard", "energy"])
@pytest.mark.parametrize("pairs", ["dlft", "rigid"])
def test_friction_by_depth(tmp_path, pairs, law):
    """Against the scalar equation of a pair that slides by a given amount."""
    p, start, final, scale = SLIDING["plain"]["params"], 0.5, 0.2, 0.01
    groups = merged(sliding("plain"), {
        "contact": {"law": pairs}, "load": {"cosine": [p["kt"] * 0.3, 0.0]},
        "wear": {"n_cycles": 40.0, "law": law, "mu_by": "depth", "mu_final": final,
                 "mu_scale": scale}})
    del groups["mission"]
    found = result(tmp_path, groups)
    expected = rubbing(0.3, lambda w: final + (start - final) * np.exp(-w / scale),
                       law == "energy", 40.0)
    np.testing.assert_allclose(found["wear/depth"][-1, 0], expected, rtol=RUBBED)
    np.testing.assert_allclose(found["wear/mu"][:, 0], final + (start - final) * np.exp(
        -found["wear/depth"][:, 0] / scale), rtol=1e-12)


@pytest.mark.parametrize("by", ["depth", "energy"])
def test_friction_of_elastic_pairs(tmp_path, by):
    """The implicit schemes, which take derivatives, as the explicit one, which takes none."""
    groups = merged(oscillator(7, "penalty", n_cycles=40.0, error_tolerance=1e-6), {
        "contact": {"tangential_stiffness": 3.0, "normal_stiffness": 9.0},
        "harmonics": {"n_time": None},
        "wear": {"mu_by": by, "mu_final": 0.25, "mu_scale": {"depth": 0.05, "energy": 20.0}[by]}})
    depth = {}
    for scheme in ("implicit", "explicit", "pseudo_time"):
        changed = {"wear": {"scheme": scheme}, "pseudo_time": {"scheme": "rosenbrock"}}
        found = result(tmp_path, merged(groups, changed))
        assert found["wear/mu"][-1, 0] < 0.9 * found["wear/mu"][0, 0]
        depth[scheme] = found["wear/depth"][-1, 0]
    # Each leaves about its tolerance; a margin of ten.
    assert abs(depth["explicit"] / depth["implicit"] - 1.0) < 1e-5
    assert abs(depth["pseudo_time"] / depth["implicit"] - 1.0) < 1e-5


def test_friction_by_energy(tmp_path):
    """Blocks with friction that follows the energy: depths, energies, coefficients."""
    p = SLIDING["mu_energy"]["params"]
    changed = {"mu_by": "energy", "mu_final": p["mu_final"], "mu_scale": p["mu_energy"]}
    found = result(tmp_path, merged(sliding("mu_energy"), {"wear": changed}))
    rows = SLIDING["mu_energy"]["after_each_block"]
    np.testing.assert_allclose(found["wear/depth"][:, 0], [row["W"] for row in rows],
                               rtol=RUBBED, atol=0)
    energy = np.array([row["energy"] for row in rows])
    np.testing.assert_allclose(found["wear/mu"][:, 0], p["mu_final"] + (p["mu"] - p["mu_final"])
                               * np.exp(-energy / p["mu_energy"]), rtol=RUBBED)
    np.testing.assert_allclose(found["wear/energy"][:, 0], energy, rtol=RUBBED)


@pytest.mark.parametrize(("change", "words"), [
    ("wear%coefficient = 2e-3", "wear%coefficient"), ("contact%mu = 0.3", "other friction"),
    ("wear%mu_final = 0.1", "other friction"), ("wear%mu_scale = 3.0", "other friction")])
def test_depth_that_would_not_tell_the_energy(tmp_path, change, words):
    groups = merged(sliding("mu_energy"), {"wear": {"mu_by": "energy", "mu_final": 0.2,
                                                    "mu_scale": 2.0}})
    groups["mission"]["change"][1] += "; " + change
    done = run(tmp_path, groups, status=3)
    assert words in done.stderr
    assert "use 'depth'" in done.stderr


def test_friction_that_cannot_grow(tmp_path):
    groups = merged(sliding("plain"), {"contact": {"mu": 0.0}, "wear": {
        "mu_by": "depth", "mu_final": 0.2, "mu_scale": 0.01}})
    done = run(tmp_path, groups, status=3)
    assert "contact%mu = 0 of pair 1 cannot grow to wear%mu_final" in done.stderr


def test_friction_on_its_way_is_no_gross_slip(tmp_path):
    """Rates that hardly change although friction has yet to: the mission goes on."""
    def ending(**changes):
        groups = merged(shared_load(error_tolerance=1e-4), {
            "load": {"cosine": [3.0, 3.0, 0.0, 0.0, 0.0]}, "wear": changes})
        blocks = [(20.0, ""), (20.0, "load%harmonic_scale = 0.9")]
        return result(tmp_path, mission(groups, blocks, 40))["attributes"]["steady_state"]

    assert ending() == "none: gross slip"
    assert ending(mu_by="depth", mu_final=0.1, mu_scale=100.0) == "not reached"


@pytest.mark.parametrize(("order", "error"), [(3, 1e-3), (7, 1e-4), (15, 2e-5)])
def test_vibrating_mass(tmp_path, order, error):
    """A mass with an elastic pair: two blocks at a frequency, one at its resonance."""
    p = VIBRATING["params"]
    model = {"n_dof": 2, "mass": np.diag([p["m"], 0.0]), "damping": np.diag([p["c"], 0.0]),
             "stiffness": np.diag([p["k"], p["k_s"]])}
    contact = {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": p["mu"], "area": 1.0,
               "tangential_stiffness": p["kt"], "normal_stiffness": p["kn"]}
    load = {"cosine": [1.0, 0.0], "static": [0.0, -p["N0"]]}
    groups = joint(model, contact, load, 1.2, p["k_w_over_A"], {"error_tolerance": 1e-8},
                   n_harmonics=order)
    blocks = []
    for block in p["blocks"]:
        change = scaled(harmonic=block["F"], static=block.get("static_scale", 1.0))
        change += f"; sweep%start = {block.get('omega', 1.19)}"
        if block["at"] == "resonance":
            change += "; wear%follow_resonance = .true."
        blocks.append((block["cycles"], change))
    found = result(tmp_path, mission(groups, blocks, p["flights"], output={"observe": [1]}))
    rows = VIBRATING["after_each_block"]
    np.testing.assert_allclose(found["wear/depth"][1:, 0], [row["W"] for row in rows], rtol=error)
    # The peak is flat: its frequency is known to a part in some thousand of its width.
    np.testing.assert_allclose(found["omega"][1:], [row["omega_at_end"] for row in rows],
                               rtol=3e-4)


ONE_BLOCK = {
    "implicit": shared_load(error_tolerance=1e-4, n_cycles=300.0),
    "explicit": shared_load(scheme="explicit", error_tolerance=1e-4, n_cycles=100.0),
    "pseudo-time": shared_load(scheme="pseudo_time", max_depth_step=0.004, n_cycles=300.0),
    "following": oscillator(7, error_tolerance=1e-3, n_cycles=100.0, follow_resonance=True),
}


@pytest.mark.parametrize("name", ONE_BLOCK)
def test_one_block_is_a_run_by_itself(tmp_path, name):
    groups = ONE_BLOCK[name]
    alone = result(tmp_path, groups, name="alone")
    found = result(tmp_path, mission(groups, [(groups["wear"]["n_cycles"], "")], 1))
    for key in ("omega", "coefficients", "wear/depth", "wear/rate", "wear/energy", "wear/cycles",
                "contact/force"):
        assert found[key][0].tobytes() == alone[key][0].tobytes(), key
        assert found[key][-1].tobytes() == alone[key][-1].tobytes(), key


SECTOR = {"case": {"analysis": "wear", "threads": 1},
          "model": {"source": "hdf5", "rotation_speed": 460.8, "modal_damping": 1e-3,
                    "file": str(ROOT / "example" / "blade_sector" / "sector_48.h5")},
          "load": {"harmonic_scale": 0.5}, "harmonics": {"n_harmonics": 3, "n_time": 64},
          "sweep": {"start": 1022.0, "unit": "Hz"},
          "wear": {"coefficient": 1e-6}}
BLOCKS = [(2e5, "load%harmonic_scale = 0.5"), (1e5, "sweep%start = 1010"),
          (5e4, "load%harmonic_scale = 0.25; load%static_scale = 0.9")]


def one_by_one(folder, groups, blocks, n_flights):
    """Depth after each flight of the blocks as runs of their own, each from the depths before."""
    depth = []
    last = None
    for flight in range(n_flights):
        for number, (cycles, change) in enumerate(blocks):
            name = f"single_{flight}_{number}"
            case = merged(groups, {"wear": {"n_cycles": cycles}})
            if last:
                case = merged(case, {"contact": {"worn": f"{last}.h5"}})
            options = [word for item in change.split(";") if item.strip()
                       for word in ("--set", item.strip().replace(" ", ""))]
            last_depth = result(folder, case, *options, name=name)["wear/depth"][-1]
            last = name
        depth.append(last_depth)
    return np.array(depth)


def test_many_pairs_as_blocks_one_by_one(tmp_path):
    found = result(tmp_path, mission(SECTOR, BLOCKS, 2))
    single = one_by_one(tmp_path, SECTOR, BLOCKS, 2)
    # Vibrations of other guesses, each converged to 1e-8.
    np.testing.assert_allclose(found["mission/depth"][1:], single, rtol=0,
                               atol=1e-7 * single.max())


#: Two masses that press along curves and rub, with a damper between them.
CURVED = {
    "case": {"analysis": "wear", "threads": 1},
    "model": {"n_dof": 3, "mass": np.diag([1.0, 0.8, 1.2]), "damping": 0.05 * np.eye(3),
              "stiffness": np.array([[2.6, -1.0, 0.0], [-1.0, 2.6, -1.1], [0.0, -1.1, 2.6]])},
    "contact": {"n_pairs": 1, "law": "penalty", "side_1": [2, 0, 1], "mu": 0.3, "gap": -0.3,
                "area": 1.0, "tangential_stiffness": 0.8, "normal_law": "power",
                "normal_coefficient": 3.0},
    "damper": {"n_dampers": 1, "side_1": 2, "side_2": 3, "coefficient": 0.1, "power": 2.0},
    "load": {"cosine": [0.4, 0.5, 0.6], "static": [-0.5, 0.0, 0.0]},
    "harmonics": {"n_harmonics": 3, "n_time": 512}, "sweep": {"start": 0.9},
    "solver": {"tolerance": 1e-11}, "wear": {"coefficient": 1e-4, "error_tolerance": 1e-9}}


def test_blocks_change_laws_dampers_and_matrices(tmp_path):
    blocks = [(200.0, "damper%coefficient = 0.3; damper%power = 1.5"),
              (100.0, "contact%normal_coefficient = 2.0; contact%normal_exponent = 1.2"),
              (100.0, "model%loss_factor = 0.05; contact%mu = 0.2")]
    found = result(tmp_path, mission(CURVED, blocks, 2))["mission/depth"]
    single = one_by_one(tmp_path, CURVED, blocks, 2)
    np.testing.assert_allclose(found[1:], single, rtol=0, atol=1e-7 * single.max())
    # And each of them matters.
    for k in range(len(blocks)):
        other = [(cycles, "" if k == j else change) for j, (cycles, change) in enumerate(blocks)]
        depth = result(tmp_path, mission(CURVED, other, 2))["mission/depth"]
        assert np.abs(depth[-1] - found[-1]).max() > 1e-4 * single.max()


def slow(per_jump, tolerance=STEP, n_flights=64):
    return sliding("speed", n_flights=n_flights, per_jump=per_jump, slower=0.02,
                   tolerance=tolerance)


def test_jumps(tmp_path):
    """Of second order in their length, order of the blocks included; by the error within what the
    file says."""
    exact = result(tmp_path, slow(1))["mission/depth"][:, 0]
    error = []
    for per_jump in (8, 16, 32):
        found = result(tmp_path, slow(per_jump))["mission/depth"][:, 0]
        flown = np.isfinite(found)
        assert flown.nonzero()[0].tolist() == list(range(0, 65, per_jump))
        error.append(found[-1] - exact[-1])
    assert 3.8 < (error[2] - error[1]) / (error[1] - error[0]) < 4.2
    # A flight by itself has none.
    assert 3.5 < error[2] / error[1] < 4.5
    assert abs(error[0]) < 0.1 * np.diff(exact).max()
    for tolerance in (1e-2, 1e-3, 1e-4):
        write_namelist(tmp_path / "case.nml", slow(0, tolerance))
        run(tmp_path, slow(0, tolerance))
        with h5py.File(tmp_path / "case.h5") as file:
            depth = file["mission/depth"][:, 0]
            stated = file["mission"].attrs["jump_error"]
        flown = np.isfinite(depth)
        assert flown[-1]
        assert np.abs(depth - exact)[flown].max() <= stated


def same(found, expected, round_off=0.0):
    """All datasets, and the attributes but for the clock's."""
    assert set(found) == set(expected)
    for name in set(expected) - CLOCK - {"wear"}:
        if expected[name].dtype == object:
            assert found[name].tolist() == expected[name].tolist(), name
        elif round_off > 0.0 and expected[name].dtype.kind == "f":
            size = np.abs(expected[name]).max(initial=0.0)
            assert np.allclose(found[name], expected[name], 0.0, round_off * size, True), name
        else:
            assert found[name].tobytes() == expected[name].tobytes(), name
    assert found["wear"] == expected["wear"]


@pytest.mark.parametrize("per_jump", [1, 0, 3])
def test_more_flights(tmp_path, per_jump):
    """A mission that is continued with more flights is one that never ended."""
    def case(n_flights):
        return slow(per_jump, 1e-3, n_flights)

    whole = result(tmp_path, case(20), name="whole")
    for n_flights in (1, 2, 5, 11):
        run(tmp_path, case(n_flights), name="part")
        again = result(tmp_path, case(20), "--restart", "part.h5", name="again")
        same(again, whole)


def test_killed_within_a_flight(tmp_path):
    groups = mission(SECTOR, BLOCKS, 4)
    whole = result(tmp_path, groups, name="whole")
    write_namelist(tmp_path / "part.nml", groups)
    signal_at([PROGRAM, "part.nml"], "point 6 ", signal.SIGINT, tmp_path, caught=6)
    part = read(tmp_path / "part.h5")
    assert 6 <= len(part["omega"]) < len(whole["omega"])
    again = result(tmp_path, groups, "--restart", "part.h5", name="again")
    # Some kernels of OpenBLAS round by where memory lies, which a continued run lays out anew.
    same(again, whole, round_off=1e-12)


def test_fewer_flights_than_were_flown(tmp_path):
    run(tmp_path, slow(1, 1e-3, 4), name="part")
    done = run(tmp_path, slow(1, 1e-3, 3), "--restart", "part.h5", status=3)
    assert "mission%n_flights = 3: give at least as many" in done.stderr


def test_another_model_in_a_block(tmp_path):
    """What the file of a block holds is looked at before a run goes on."""
    groups = shared_load(error_tolerance=1e-4)
    blocks = [(50.0, ""), (50.0, "load%harmonic_scale = 0.8")]
    run(tmp_path, mission(groups, blocks, 2), name="part")
    # The same keys, and another stiffness by the model: as a changed file would be.
    done = run(tmp_path, mission(groups, [*blocks[:1], (50.0, "load%harmonic_scale = 0.7")], 3),
               "--restart", "part.h5", status=3)
    assert "mission change" in done.stderr.replace("&", "").replace("%", " ")


def test_stuck_blocks_are_passed(tmp_path):
    found = result(tmp_path, sliding("plain"))
    third = found["wear/block"] == 3
    assert np.all(found["wear/rate"][third] == 0.0)
    assert found["mission/share"][2, 0] == 0.0
    # All of them stuck: nothing wears, which is no failure.
    still = mission(shared_load(error_tolerance=1e-4), [(10.0, "load%harmonic_scale = 1e-3")], 5)
    found = result(tmp_path, still)
    assert found["attributes"]["steady_state"] == "reached"
    assert np.all(found["wear/depth"] == 0.0)


def test_a_block_that_fails(tmp_path):
    """Status 4, and the flight and the block are named."""
    groups = shared_load(error_tolerance=1e-4)
    # Pulled apart, the plate is held by nothing.
    blocks = [(50.0, ""), (50.0, "load%static_scale = -1")]
    for per_jump in (1, 0, 4):
        case = mission(groups, blocks, 4, per_jump)
        case["mission"]["name"] = ["take-off", "cruise"]
        run(tmp_path, case, status=4)
        with h5py.File(tmp_path / "case.h5") as file:
            assert "flight 1, block 2 'cruise': " in file["wear"].attrs["ending"]


BAD = {
    "n_cycles": ({"wear": {"n_cycles": 10.0}}, "does not go with wear%n_cycles"),
    "analysis": ({"case": {"analysis": "point"}}, "group &mission does not go with case%analysis"),
    "bdf": ({"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "bdf"}},
            "does not go with wear by pseudo_time%scheme = 'bdf'"),
    "check_steps": ({"wear": {"check_steps": True}}, "does not go with wear%check_steps"),
    "number of changes": ({"mission": {"change": ["", "", ""]}}, "has 3 texts: must be one"),
    "cycles": ({"mission": {"cycles": [1.0, 2.0, 3.0]}}, "&mission cycles"),
    "cycles left out": ({"mission": {"cycles": None}}, "&mission cycles is missing"),
    "n_blocks left out": ({"mission": {"n_blocks": None}}, "n_blocks is missing"),
    "key of the case": ({"mission": {"change": ["", "case%threads = 2"]}},
                        "of block 2: case%threads holds for all blocks"),
    "scheme": ({"mission": {"change": ["", "wear%scheme = explicit"]}},
               "of block 2: wear%scheme holds for all blocks"),
    "pairs": ({"mission": {"change": ["", "contact%law = dlft"]}},
              "of block 2: contact%law holds for all blocks"),
    "no key": ({"mission": {"change": ["", "nonsense"]}},
               "of block 2: 'nonsense' must have the form group%key=value"),
    "unknown key": ({"mission": {"change": ["", "load%harmonic_scal = 2"]}}, "harmonic_scale"),
    "harmonics": ({"mission": {"change": ["", "harmonics%n_harmonics = 9"]}},
                  "block 2 'b' has more harmonics than the case"),
    "friction without its end": ({"wear": {"mu_by": "depth", "mu_scale": 1.0}},
                                 "&wear mu_final is missing"),
    "jumps": ({"mission": {"flights_per_jump": -1}}, "flights_per_jump"),
}


@pytest.mark.parametrize("name", BAD)
def test_refused(tmp_path, name):
    changes, words = BAD[name]
    groups = mission(shared_load(error_tolerance=1e-4), [(10.0, ""), (20.0, "")], 2)
    groups["mission"]["name"] = ["a", "b"]
    done = run(tmp_path, merged(groups, changes), status=3)
    assert words in done.stderr
    assert not (tmp_path / "case.h5").exists()
    checked = run(tmp_path, merged(groups, changes), "--check", status=3)
    assert words in checked.stderr


def test_coefficient_of_each_pair(tmp_path):
    """One for all, or one for each; a pair wears in proportion to its own at first."""
    groups = merged(shared_load(error_tolerance=1e-4, n_cycles=50.0),
                    {"load": {"cosine": [3.0, 1.5, 0.0, 0.0, 0.0]}})
    one = result(tmp_path, groups, name="one")
    each = result(tmp_path, merged(groups, {"wear": {"coefficient": [
        groups["wear"]["coefficient"]] * 2}}), name="each")
    assert each["wear/depth"].tobytes() == one["wear/depth"].tobytes()
    other = result(tmp_path, merged(groups, {"wear": {"coefficient": [
        groups["wear"]["coefficient"], 2 * groups["wear"]["coefficient"]]}}), name="other")
    np.testing.assert_allclose(other["wear/rate"][0] / one["wear/rate"][0], [1.0, 2.0], rtol=1e-12)
    # Friction energy follows from depth over coefficient: mu A w/k_w of each pair.
    k_w = groups["wear"]["coefficient"] * np.array([1.0, 2.0])
    np.testing.assert_allclose(other["wear/energy"][-1],
                               groups["contact"]["mu"] * other["wear/depth"][-1] / k_w, rtol=1e-6)
