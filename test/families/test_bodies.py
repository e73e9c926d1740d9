"""Bodies that only rotation presses: what `fretwear.damper` makes, and what a run makes of it."""
import json
import subprocess
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from bodies import SPEED, complex_rows, drawn, judged, model_of, run_of
from cases import run, with_model
from project import PROGRAM, ROOT

import fretwear as fw
from bench.dampers import strip
from fretwear.cli import main
from fretwear.dampers import LAWS
from fretwear.errors import InputError
from fretwear.plot import fitting, plot_damper

#: Identities: residuals of 1e-12 times the condition of what slips (below 10), margin of ten.
SAME, TIGHT = 1e-10, {"tolerance": 1e-12}

M, K = np.eye(4), np.diag([9e3, 2e4, 1e4, 1.9e4])


def blades(**more):
    return fw.Model(M, 5e-4 * K, K, cosine=[8.0, 0.0, -5.6, 1.6], **more)


def wedge(model=None, angle=50.0, mu=0.3, **more):
    flanks = {"left": fw.Flank([[1, 2], [1, 2]], [[-0.01, 0.0], [-0.01, 0.004]]),
              "right": fw.Flank([[3, 4], [3, 4]], [[0.01, 0.0], [0.01, 0.004]])}
    settings = {"mass": 0.05, "inertia": 5e-6, "radius": 0.2, "angles": (angle, angle), "mu": mu,
                "tangential_stiffness": 2e4, "normal_stiffness": 3e4, "law": "penalty", **flanks}
    return fw.damper(blades() if model is None else model, "wedge", **settings | more)


def at(omega, speed=SPEED, **more):
    return {"case": {"analysis": "point"}, "model": {"rotation_speed": speed},
            "harmonics": {"n_harmonics": 5, "n_time": 128, "sampling": "uniform"},
            "sweep": {"start": omega}, "solver": {"tolerance": 1e-11}, **more}


def read_result(path):
    with h5py.File(path) as file:
        return SimpleNamespace(coefficients=file["coefficients"][()],
                               force=file["contact/force"][()],
                               fraction=file["contact/fraction"][()])


def solved(model, folder, omega=120.0, **more):
    model.to_hdf5(folder / "model.h5")
    run(folder, with_model(at(omega, **more)))
    return read_result(folder / "case.h5")


def test_rows_of_a_wedge():
    """side_1 = R [I, -[r]x], side_2 = R u of the platform, as the reference has them."""
    oracle = json.loads((ROOT / "test/reference/bodies/v1_wedge_rows.json").read_text())["groups"]
    given = np.reshape(oracle["model"]["row"], (-1, 7))
    sides = [np.reshape(oracle["contact"][key], (-1, 3)) for key in ("side_1", "side_2")]
    found = wedge()
    # The angle and the places of the reference.
    left, right = (np.degrees(np.arctan2(abs(row[0]), abs(row[1])))
                   for row in (given[sides[0][0, 0] - 8, 4:6], given[sides[0][2, 0] - 8, 4:6]))
    places = []
    for i in range(4):
        t, n = (given[sides[0][i, c] - 8, 4:] for c in (0, 2))
        places.append(np.linalg.solve([[-t[0], t[1]], [-n[0], n[1]]][::1], [t[2], n[2]])[::-1])
    found = wedge(angles=(left, right), left=fw.Flank([[1, 2]] * 2, places[:2]),
                  right=fw.Flank([[3, 4]] * 2, places[2:]))
    rows = np.asarray(found.rows)
    for i in range(4):
        for c in (0, 2):
            for side, wanted in zip((found.contact.side_1, found.contact.side_2), sides):
                assert np.abs(rows[side[i, c] - 8] - given[wanted[i, c] - 8]).max() < 1e-9


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_wrong_variants_are_noticed(seed, tmp_path):
    """The judge of the family (test/families/bodies.py) with one mistake each."""
    case = drawn(seed) | {"inertia": 1e-6, "compliance": None, "wave": True, "order": 1}
    assert run_of(case, PROGRAM, tmp_path).returncode == 0
    found = read_result(tmp_path / "case.h5")
    assert max(judged(case, found.coefficients[0], found.force[0])) < 1e-7
    for variant in ("normal", "turn", "sector"):
        if variant == "turn" and case["kind"] == "cylinder":
            continue
        assert max(judged(case, found.coefficients[0], found.force[0], variant)) > 1e-3, variant


def sliding(**more):
    """All pairs slip, so that nothing is left of where the march begins, and the wave is later from
    sector to sector by whole instants."""
    case = drawn(3) | {"wave": True, "kind": "wedge", "compliance": None, "inertia": None,
                       "angles": np.array([45.0, 45.0])} | more
    return case | {"mu": 0.3 * case["mu"], "cosine": 5.0 * case["cosine"]}


def annulus(case, wave, n, masses):
    """All sectors and bodies as one structure, blades of other masses."""
    phases = np.exp(-2j * np.pi * np.arange(n) / n)
    load = np.concatenate([phase * (case["cosine"] - 1j * case["sine"]) for phase in phases])
    M_all, K_all, C_all = (np.kron(np.eye(n), matrix[:4, :4]) for matrix in (wave.M, wave.K,
                                                                             wave.C))
    M_all = M_all * np.repeat(masses, 4)
    model = fw.Model(M_all, C_all, K_all, cosine=load.real, sine=-load.imag)
    for j in range(n):
        own, after = 4 * j, 4 * ((j + 1) % n)
        n_left, n_right = (len(p) for p in case["places"])
        model = fw.damper(
            model, "wedge", mass=wave.bodies.mass[0], inertia=case["inertia"], radius=0.2,
            angles=tuple(case["angles"]), mu=case["mu"], tangential_stiffness=case["kt"],
            normal_stiffness=case["kn"], law="penalty", name=f"body {j}",
            left=fw.Flank([[own + 3, own + 4]] * n_left, case["places"][0]),
            right=fw.Flank([[after + 1, after + 2]] * n_right, case["places"][1]))
    return model


def test_wave_against_annulus(tmp_path):
    """A wave with a body in each sector, and all sectors and bodies as one structure."""
    n = 4
    case = sliding(sectors=n, order=1)
    wave = model_of(case)
    (tmp_path / "wave").mkdir()
    one = solved(wave, tmp_path / "wave", case["omega"], cyclic={"engine_order": 1}, solver=TIGHT)
    m = wave.n_dof
    (tmp_path / "whole").mkdir()
    whole = solved(annulus(case, wave, n, np.ones(n)), tmp_path / "whole", case["omega"],
                   solver=TIGHT)
    U, W = complex_rows(one.coefficients[0]), complex_rows(whole.coefficients[0])
    size = np.abs(W).max()
    for j in range(n):
        turn = np.exp(-2j * np.pi * j * np.arange(len(U)) / n)[:, None]
        assert np.abs(turn * U[:, :4] - W[:, 4 * j:4 * j + 4]).max() < SAME * size
        body = 4 * n + (m - 4) * j
        assert np.abs(turn * U[:, 4:] - W[:, body:body + m - 4]).max() < SAME * size


@pytest.mark.parametrize("spread", [0.0, 0.02])
def test_bodies_between_mistuned_blades(spread, tmp_path):
    """Blades of a disk that differ, with a body in each sector, as one structure has them."""
    n = 4
    case = sliding(sectors=n, order=1)
    wave = model_of(case)
    m = wave.n_dof
    deviations = spread * np.array([1.0, -0.5, 0.3, -1.2])
    blade = np.zeros((m, m))
    blade[:4, :4] = wave.M[:4, :4]
    (tmp_path / "sectors").mkdir()
    disk = solved(wave, tmp_path / "sectors", case["omega"], solver=TIGHT,
                  cyclic={"engine_order": 1, "mistuned": True},
                  mistuning={"mass": deviations, "blade_mass": blade.ravel()})
    (tmp_path / "whole").mkdir()
    whole = solved(annulus(case, wave, n, 1.0 + deviations), tmp_path / "whole", case["omega"],
                   solver=TIGHT)
    U, W = (complex_rows(found.coefficients[0]) for found in (disk, whole))
    size = np.abs(W).max()
    assert U.shape == W.shape
    for j in range(n):
        body = 4 * n + (m - 4) * j
        wanted = np.hstack([W[:, 4 * j:4 * j + 4], W[:, body:body + m - 4]])
        assert np.abs(U[:, m * j:m * j + m] - wanted).max() < SAME * size


def test_body_of_the_next_sector(tmp_path):
    """The body seen from the other side: sectors of both flanks less one."""
    case = sliding(sectors=8, order=3)
    forward = model_of(case)
    pairs = forward.contact
    plain = fw.Model(*(forward_matrix[:4, :4] for forward_matrix in (forward.M, forward.C,
                                                                    forward.K)),
                     cosine=case["cosine"], sine=case["sine"], sectors=fw.Sectors(8))
    n_left, n_right = (len(p) for p in case["places"])
    behind = fw.damper(
        plain, "wedge", mass=forward.bodies.mass[0], inertia=case["inertia"], radius=0.2,
        angles=tuple(case["angles"]), mu=case["mu"], tangential_stiffness=case["kt"],
        normal_stiffness=case["kn"], law="penalty",
        left=fw.Flank([[3, 4]] * n_left, case["places"][0], sector=-1),
        right=fw.Flank([[1, 2]] * n_right, case["places"][1]))
    assert behind.contact.side_1.tolist() == pairs.side_1.tolist()
    found = []
    for name, model in (("forward", forward), ("behind", behind)):
        (tmp_path / name).mkdir()
        found.append(complex_rows(solved(model, tmp_path / name, case["omega"],
                                         cyclic={"engine_order": 3},
                                         solver=TIGHT).coefficients[0]))
    # The body of sector 1 is what was that of sector 0.
    turn = np.exp(-2j * np.pi * 3 * np.arange(len(found[0])) / 8)[:, None]
    size = np.abs(found[0]).max()
    assert np.abs(found[0][:, :4] - found[1][:, :4]).max() < SAME * size
    assert np.abs(found[1][:, 4:] - np.conj(turn) * found[0][:, 4:]).max() < SAME * size

def test_static_forces_of_symmetric_wedges(tmp_path):
    """Normal forces at rest lie between those of both ends of friction."""
    random = np.random.default_rng(5)
    for number in range(20):
        angle, mu = random.uniform(30.0, 65.0), random.uniform(0.1, 0.55)
        if np.tan(np.radians(angle)) <= 1.05 * mu:
            continue
        both = {"left": fw.Flank([[1, 2]], [[-0.01, 0.0]]), "inertia": None,
                "right": fw.Flank([[3, 4]], [[0.01, 0.0]])}
        model = wedge(blades(), angle, mu, **both)
        folder = tmp_path / str(number)
        folder.mkdir()
        found = solved(model, folder, random.uniform(60.0, 200.0),
                       load={"harmonic_scale": random.uniform(0.0, 1.0)})
        press = -found.force[0][0, :, 2].mean()
        pull, s, c = 0.05 * 0.2 * SPEED**2, *(f(np.radians(angle)) for f in (np.sin, np.cos))
        if found.fraction[0][:, 2].max() > 0.0:
            continue
        assert 0.999 * pull / 2 / (s + mu * c) <= press <= 1.001 * pull / 2 / (s - mu * c)


def test_what_cannot_stand_is_refused(tmp_path):
    """Load away from the flanks, friction too small for flanks on one side."""
    model = wedge(radius=-0.2)
    model.to_hdf5(tmp_path / "model.h5")
    message = run(tmp_path, with_model(at(120.0)), status=3).stderr
    assert "body damper: friction and angle cannot hold it" in message
    # A single flank holds what friction holds on it: tan of its slope up to mu.
    for slope, status in ((9.0, 0), (15.0, 3)):
        one = wedge(mu=0.2, angles=(90.0 - slope, 90.0), inertia=None, right=None,
                    left=fw.Flank([[1, 2]], [[0.0, 0.0]]))
        one.to_hdf5(tmp_path / "model.h5")
        run(tmp_path, with_model(at(120.0)), status=(status, 4) if status == 0 else status)
    # Without rotation nothing presses it.
    model.to_hdf5(tmp_path / "model.h5")
    message = run(tmp_path, with_model(at(120.0, speed=0.0)), status=(0, 4)).stderr
    assert "cannot hold" not in message


def remarks_of(model, folder, **more):
    model.to_hdf5(folder / "model.h5")
    run(folder, with_model(at(120.0, **more)), status=(0, 4))
    with h5py.File(folder / "case.h5") as file:
        return [] if "remarks" not in file else [name.decode() for name in file["remarks/name"][()]]


def test_remarks(tmp_path):
    """tan a <= mu jams; normals through one point leave a rotation; at rest nothing presses."""
    def names(model, **more):
        return set(remarks_of(model, tmp_path, **more))
    assert "body without load" in names(wedge(), speed=0.0)
    assert "self-locking" in names(wedge(angle=20.0, mu=0.5))
    assert not {"self-locking", "body turns", "body without load"} & names(wedge())
    single = {"left": fw.Flank([[1, 2]], [[-0.01, 0.0]]),
              "right": fw.Flank([[3, 4]], [[0.01, 0.0]])}
    assert "body turns" in names(wedge(**single))


def test_ripples_of_a_body_are_no_peaks(tmp_path):
    """A light body has motions of its own without damping, at which harmonics ripple."""
    wedge(mass=1e-4, inertia=1e-9).to_hdf5(tmp_path / "model.h5")
    sweep = {"start": 60.0, "end": 160.0, "n_points": 101}
    run(tmp_path, with_model(at(0.0) | {"case": {"analysis": "frf"}, "sweep": sweep}))
    with h5py.File(tmp_path / "case.h5") as file:
        observed, found = file["peak/observed"][()], file["peak/found_by"][()]
    # Those of the blades stand in front of those of the body.
    assert not np.any(found[observed > 3] == 4) and np.any(observed > 3)


def test_mass_of_the_case(tmp_path):
    """&body mass in place of that of the model, as a model of that mass."""
    light = solved(wedge(mass=0.03), tmp_path)
    other = solved(wedge(inertia=5e-6 * 5 / 3), tmp_path, body={"mass": [0.03]})
    assert np.abs(other.coefficients - light.coefficients).max() < 1e-12 * np.abs(
        light.coefficients).max()


def test_derivative_by_mass(tmp_path):
    """Against central differences of runs."""
    step, base = 1e-4 * 0.05, 0.05
    wanted = []
    model = wedge()
    model.to_hdf5(tmp_path / "model.h5")
    groups = at(120.0, sensitivity={"parameters": ["body%mass"]})
    run(tmp_path, with_model(groups))
    with h5py.File(tmp_path / "case.h5") as file:
        slope = file["sensitivity/first_harmonic/body_mass"][0]
    for sign in (-1, 1):
        # The matrices hold the mass by what it is for a unit of it: the inertia goes with it.
        run(tmp_path, with_model(at(120.0, body={"mass": [base + sign * step]})))
        first = read_result(tmp_path / "case.h5").coefficients[0][1:3]
        wanted.append(np.hypot(*first))
    difference = (wanted[1] - wanted[0]) / (2 * step)
    assert np.abs(np.squeeze(slope) - difference).max() < 1e-6 * np.abs(difference).max()


def test_best_mass_and_picture(tmp_path):
    """The smallest peak by the derivative, against a sweep over masses; and its picture."""
    model = wedge(blades(observe={"one": 1, "two": 3}), mass=0.02, inertia=2e-7)
    model.to_hdf5(tmp_path / "model.h5")
    sweep = {"start": 90.0, "end": 102.0, "n_points": 25}
    case = at(0.0) | {"case": {"analysis": "frf"}, "sweep": sweep}
    run(tmp_path, with_model(case))
    found = fw.optimise(fw.Case.from_file(tmp_path / "case.nml"), over="body%mass",
                        minimise="max_first_harmonic[one]", bounds=(0.008, 0.02))
    tops = []
    for mass in np.linspace(0.5, 1.5, 9) * found.values[0]:
        run(tmp_path, with_model(case | {"body": {"mass": [mass]},
                                         "sweep": sweep | {"n_points": 121}}))
        first = fw.Result(tmp_path / "case.h5").harmonic(1, "one")
        tops.append(np.abs(first).max())
    # Rows of the sweep miss a part of the peaks.
    assert found.value <= 1.001 * min(tops)
    figure = plot_damper(tmp_path / "case.h5")
    assert len(figure.axes) == 3 and "damper" in fitting(fw.Result(tmp_path / "case.h5"))


def test_file_and_command(tmp_path, capsys):
    """A model file keeps the body; the command makes what the function makes."""
    model = wedge()
    model.to_hdf5(tmp_path / "damped.h5")
    assert fw.Model.from_hdf5(tmp_path / "damped.h5").identity() == model.identity()
    blades().to_hdf5(tmp_path / "blades.h5")
    command = ["damper", str(tmp_path / "blades.h5"), "-o", str(tmp_path / "command.h5"),
               "--mass", "0.05", "--inertia", "5e-6", "--radius", "0.2", "--angles", "50", "50",
               "--left", "1,2", "1,2", "--left-at", "-0.01,0", "-0.01,0.004",
               "--right", "3,4", "3,4", "--right-at", "0.01,0", "0.01,0.004", "--mu", "0.3",
               "--stiffness", "2e4", "3e4", "--law", "penalty"]
    assert main(command) == 0
    assert "7 dofs, 4 pairs, 1 bodies" in capsys.readouterr().out
    assert fw.Model.from_hdf5(tmp_path / "command.h5").identity() == model.identity()


def test_rows_cost_nothing(tmp_path):
    """A strip by rows takes the steps of the same by dofs, and comes to the same. Round-off tells
    them apart where the start is hard to find."""
    found, counts = [], []
    for by_rows, speed in ((True, 100.0), (False, 0.0)):
        strip(0.003, by_rows).to_hdf5(tmp_path / "model.h5")
        case = at(0.0, speed) | {
            "case": {"analysis": "frf"}, "cyclic": {"engine_order": 2}, "solver": TIGHT,
            "harmonics": {"n_harmonics": 7}, "sweep": {"start": 95.0, "end": 105.0, "n_points": 21}}
        if not speed:
            del case["model"]
        run(tmp_path, with_model(case))
        with h5py.File(tmp_path / "case.h5") as file:
            counts.append(file["iterations"][()].sum())
            found.append(file["coefficients"][()][:, :, 0])
    assert counts[0] < 1.5 * counts[1]
    assert np.abs(found[0] - found[1]).max() < SAME * np.abs(found[1]).max()


def test_bodies_one_after_another(tmp_path):
    """Pairs, rows and bodies of the first stay where they were."""
    first = wedge()
    both = wedge(first, name="other", left=fw.Flank([[3, 4]], [[-0.01, 0.0]]), right=fw.Flank(
        [[0, 0], [8, 0]], [[0.01, 0.0], [0.01, 0.004]]))
    assert both.bodies.name == ("damper", "other") and both.bodies.pair.tolist() == list(range(7))
    assert np.array_equal(np.asarray(both.rows)[:len(first.rows), :7], first.rows)
    assert both.n_dof == 10 and both.n_pairs == 7
    both.to_hdf5(tmp_path / "model.h5")
    run(tmp_path, with_model(at(120.0)), "--check")


@pytest.mark.parametrize(("changes", "wanted"), [
    ({"angles": None}, "angles"), ({"angles": (0.0, 50.0)}, "angles"),
    ({"mass": 0.0}, "mass"), ({"inertia": -1.0}, "inertia"),
    ({"left": None, "right": None}, "left and right"),
    ({"left": fw.Flank([[1, 9]], [[0.0, 0.0]])}, "9"),
    ({"left": fw.Flank([[1, 2]])}, "left.points"),
    ({"left": fw.Flank([[1, 2, 3]], [[0.0, 0.0, 0.0]])}, "2 and 3 columns"),
    ({"mu": [0.1, 0.2]}, "shape"), ({"mu": -0.1}, "mu: has -0.1"),
    ({"mass": [0.1, 0.2]}, "mass"), ({"compliance": (1.0,)}, "compliance"),
    ({"compliance": (1.0, -2.0)}, "compliance: has -2.0"),
    ({"normal_stiffness": -1.0}, "normal_stiffness: has -1.0"), ({"law": "sticky"}, "bouc_wen"),
    ({"load": [1.0]}, "load: is given"), ({"matrices": (M, K, None)}, "matrices: is given"),
])
def test_bad_input(changes, wanted):
    with pytest.raises((InputError, ValueError), match=wanted):
        wedge(**changes)


def test_laws_are_those_of_the_key():
    shown = subprocess.run([PROGRAM, "--keys=json"], text=True, capture_output=True, check=True)
    assert sorted(LAWS) == sorted(json.loads(shown.stdout)["contact"]["keys"]["law"]["words"])


def test_derivative_by_a_mass_that_is_not_there(tmp_path):
    blades().to_hdf5(tmp_path / "model.h5")
    case = with_model(at(120.0, speed=0.0, sensitivity={"parameters": ["body%mass"]}))
    assert "the model has no bodies" in run(tmp_path, case, status=3).stderr


def test_bad_kind():
    with pytest.raises(InputError, match="wedge, cylinder"):
        fw.damper(blades(), "ball", mass=1.0, left=fw.Flank([[1, 2]], [[0.0, 0.0]]))


@pytest.mark.parametrize(("part", "value", "wanted"), [
    ("dof", [[5, 6, 0, 0, 0, 99]], "body/dof"), ("dof", [[5, 5, 0, 0, 0, 7]], "body/dof"),
    ("dof", [[0] * 6], "body/dof"), ("dof", [[5, 6, 0, 0, 7]], "dof"), ("mass", [-1.0], "mass"),
    ("mass", [np.nan], "mass"), ("unit_mass", [np.triu(np.ones((6, 6)))], "unit_mass"),
    ("unit_mass", [np.full((6, 6), np.inf)], "unit_mass"), ("radius", [np.nan], "radius"),
    ("direction", None, "direction"), ("name", None, "name"), ("unit_mass", None, "unit_mass"),
    ("dof", [[1, 2, 0, 0, 0, 3]], ""),
])
def test_bad_bodies_of_a_file(part, value, wanted, tmp_path):
    wedge().to_hdf5(tmp_path / "model.h5")
    with h5py.File(tmp_path / "model.h5", "r+") as file:
        del file[f"body/{part}"]
        if value is not None:
            file[f"body/{part}"] = value
    # Dofs of blades, which springs hold, are none of a loose body: a mass on them, and no fault.
    done = run(tmp_path, with_model(at(120.0)), status=3 if wanted else (0, 4))
    assert wanted in done.stderr


@pytest.mark.parametrize(("body", "wanted"), [
    ({"mass": [0.0]}, "above 0"), ({"mass": [0.01, 0.02]}, "mass"), ({"mass": ["x"]}, "mass")])
def test_bad_masses_of_a_case(body, wanted, tmp_path):
    wedge().to_hdf5(tmp_path / "model.h5")
    assert wanted in run(tmp_path, with_model(at(120.0, body=body)), status=3).stderr
    blades().to_hdf5(tmp_path / "model.h5")
    message = run(tmp_path, with_model(at(120.0, speed=0.0, body={"mass": [0.1]})), status=3).stderr
    assert "no bodies" in message


def test_slips_of_the_pen(tmp_path, capsys):
    """Radians, exchanged flanks, sectors of a plain model, names of other programs."""
    with pytest.warns(UserWarning, match="give degrees"):
        wedge(angle=0.9)
    left, right = (fw.Flank([[1, 2]], [[-0.01, 0.0]]), fw.Flank([[3, 4]], [[0.01, 0.0]]))
    with pytest.warns(UserWarning, match="left and right are exchanged"):
        wedge(left=fw.Flank([[1, 2]], right.points), right=fw.Flank([[3, 4]], left.points))
    with pytest.raises(InputError, match="the model has no sectors"):
        wedge(right=fw.Flank([[3, 4]], right.points, sector=1))
    blades().to_hdf5(tmp_path / "blades.h5")
    command = ["damper", str(tmp_path / "blades.h5"), "-o", str(tmp_path / "damped.h5"),
               "--mass", "0.05", "--mu", "0.3", "--stiffness", "2e4", "3e4",
               "--left", "1,2", "--left-at", "-0.01,0", "--right", "3,4", "--right-at", "0.01,0"]
    assert main([*command, "--angles", "50", "50", "--sector", "1"]) == 3
    assert "the model has no sectors" in capsys.readouterr().err
    assert main([*command, "--angles", "0.9", "0.9"]) == 0
    assert "remark: angles" in capsys.readouterr().err


def test_names_nearly_right(tmp_path):
    """A group /bodies is no other data, and what it lacks no speed too many; keys of /body are none
    of &body."""
    wedge().to_hdf5(tmp_path / "model.h5")
    with h5py.File(tmp_path / "model.h5", "r+") as file:
        file.move("body", "bodies")
    message = run(tmp_path, with_model(at(120.0)), status=3).stderr
    assert "/bodies is nothing that is read (did you mean /body?)" in message
    assert "rotation_speed" not in message
    wedge().to_hdf5(tmp_path / "model.h5")
    message = run(tmp_path, with_model(at(120.0, body={"name": ["damper"]})), status=3).stderr
    assert "&body has no key name" in message and "gives other masses alone" in message
