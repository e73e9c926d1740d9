"""Joints of Iwan and of Bouc and Wen against solutions known from elsewhere.

test/reference/laws/law_iwan.json, law_bouc_wen.json: one mass, integrated in time from turning
point to turning point. And against other laws: one Jenkins element, many of them in parallel.
"""
import json

import h5py
import numpy as np
import pytest
from cases import merged, run
from oracle_runs import run_case
from project import ROOT
from test_several_laws import coefficients_of, difference

import fretwear as fw
from fretwear.laws import iwan_pairs, iwan_sliders

IWAN, BOUC_WEN = (json.loads((ROOT / f"test/reference/laws/law_{name}.json").read_text())
                  for name in ("iwan", "bouc_wen"))
#: Solver tolerance of all runs; what two runs of one problem may differ by: the tolerance times the
#: condition of the structures (below 100), and a margin of ten.
TOLERANCE, WITHIN = 1e-11, 1e-8


def oscillator(p, contact, n_harmonics, **more):
    """One mass with a joint to the ground."""
    load = {"cosine": p["F"]} | ({"static": p["F0"]} if "F0" in p else {})
    return {
        "case": {"title": "a joint", "analysis": "point"},
        "model": {"n_dof": 1, "mass": p["m"], "damping": p["c"], "stiffness": p["k"]},
        "contact": {"n_pairs": 1, "side_1": [1, 0, 0], **contact}, "load": load,
        "harmonics": {"n_harmonics": n_harmonics, **more},
        "sweep": {"start": p["omega"]}, "solver": {"tolerance": TOLERANCE},
    }


def iwan(p):
    return {"law": "iwan", "mu": 0.5, "normal_load": 2.0 * p["F_S"],
            "tangential_stiffness": p["K_T"], "iwan_chi": p["chi"], "iwan_beta": p["beta"]}


def bouc_wen(p):
    return {"law": "bouc_wen", "mu": p["mu"], "normal_load": p["normal_load"],
            "tangential_stiffness": p["kt"], "bouc_wen_exponent": p["n"],
            "bouc_wen_beta": p["beta"]}


def check(tmp_path, case, contact, n_harmonics, bound):
    found = run_case(tmp_path, oscillator(case["params"], contact, n_harmonics))
    kept = 2 * min(n_harmonics, len(case["u1"]["xc"])) + 1
    u = coefficients_of(case["u1"], n_harmonics)[:kept]
    f = coefficients_of(case["force_1"], n_harmonics)[:kept]
    assert difference(found.coefficients[0][:kept, 0], u) < bound
    assert difference(found.force[0][:kept, 0, 0], f) < 10.0 * bound
    assert abs(found.dissipation[0, 0] / case["work_per_cycle"][0] - 1.0) < 2.0 * bound


# Relative errors of the motion at H = 1, 3, 7 and 15, about twice what is measured: what truncation
# leaves of a force that depends on the path. Those of the force and of the work are larger.
@pytest.mark.parametrize(("name", "bounds"), [
    ("micro", (2e-3, 8e-5, 3e-6, 1e-7)), ("partial", (1e-2, 4e-4, 1.2e-5, 4e-7)),
    ("macro", (3e-2, 2.5e-3, 3e-5, 6e-6))])
def test_iwan_is_as_integrated(tmp_path, name, bounds):
    for n_harmonics, bound in zip((1, 3, 7, 15), bounds, strict=True):
        case = IWAN["cases"][name]
        check(tmp_path, case, iwan(case["params"]), n_harmonics, bound)


@pytest.mark.parametrize(("name", "bounds"), [
    ("n1", (1e-3, 1e-4, 3e-6)), ("n2_static", (3e-3, 1e-4, 4e-6))])
def test_bouc_wen_is_as_integrated(tmp_path, name, bounds):
    for n_harmonics, bound in zip((3, 7, 15), bounds, strict=True):
        case = BOUC_WEN["cases"][name]
        check(tmp_path, case, bouc_wen(case["params"]), n_harmonics, bound)


def test_a_static_load_is_borne_from_the_assembly_or_not_at_all(tmp_path):
    """Iwan's joint holds a constant load as its load curve says, Bouc and Wen's does not."""
    p = {"m": 1.0, "c": 0.05, "k": 1.0, "F": 1e-4, "F0": 0.9, "omega": 2.5}
    case = oscillator(p, {"law": "iwan", "mu": 1.0, "normal_load": 1.0,
                          "tangential_stiffness": 2.0, "iwan_chi": 0.0}, 3)
    found = run_case(tmp_path, case)
    # chi = beta = 0: f = s - s**2/4, s = 2 u, and k u + f = 0.9.
    u = (3.0 - np.sqrt(9.0 - 3.6)) / 2.0
    assert abs(found.coefficients[0, 0, 0] - u) < 2e-4
    case["contact"] = {"n_pairs": 1, "side_1": [1, 0, 0], "law": "bouc_wen", "mu": 1.0,
                       "normal_load": 1.0, "tangential_stiffness": 2.0}
    found = run_case(tmp_path, case)
    assert abs(found.coefficients[0, 0, 0] - 0.9) < 1e-6


def chain(n_harmonics=7, **contact):
    """Two masses with a joint between them and one to the ground."""
    return {
        "case": {"title": "two joints", "analysis": "point"},
        "model": {"n_dof": 2, "mass": np.diag([1.0, 0.8]), "damping": np.diag([0.05, 0.04]),
                  "stiffness": [[2.0, -0.9], [-0.9, 1.6]]},
        "contact": {"n_pairs": 2, "side_1": [1, 0, 0, 2, 0, 0], "side_2": [2, 0, 0, 0, 0, 0],
                    "mu": [0.4, 0.5], "normal_load": [1.0, 1.2],
                    "tangential_stiffness": [0.8, 1.1], **contact},
        "load": {"cosine": [0.8, 0.3], "sine": [0.0, 0.4]},
        "harmonics": {"n_harmonics": n_harmonics},
        "sweep": {"start": 1.1}, "solver": {"tolerance": TOLERANCE},
    }


def test_large_beta_is_one_jenkins_element(tmp_path):
    jenkins = run_case(tmp_path, chain(law="penalty"))
    joint = run_case(tmp_path, chain(law="iwan", iwan_chi=-0.4, iwan_beta=1e10))
    assert difference(joint.coefficients, jenkins.coefficients) < WITHIN


def test_parallel_pairs_come_to_iwan(tmp_path):
    """Four times as near with twice as many, with a static load too."""
    case = merged(chain(law="iwan", iwan_chi=-0.4, iwan_beta=0.3), {"load": {"static": [0.3, 0.0]}})
    joint = run_case(tmp_path, case)
    errors = []
    for n in (20, 40, 80):
        c = case["contact"]
        pairs = iwan_pairs(np.reshape(c["side_1"], (2, 3)), np.reshape(c["side_2"], (2, 3)),
                           tangential_stiffness=c["tangential_stiffness"], chi=-0.4, beta=0.3,
                           mu=c["mu"], normal_load=c["normal_load"], n=n)
        model = fw.Model(*(case["model"][name] for name in ("mass", "damping", "stiffness")),
                         contact=pairs)
        many = fw.run(fw.Case(model, **{name: keys for name, keys in case.items()
                                        if name not in ("model", "contact")}))
        errors.append(difference(many.coefficients, joint.coefficients))
    assert errors[2] < 1e-3
    assert errors[1] < errors[0] / 2.5 and errors[2] < errors[1] / 2.5


@pytest.mark.parametrize("chi", [-0.9, -0.99, -0.999])
@pytest.mark.parametrize("beta", [0.0, 0.3])
def test_chi_near_its_end(tmp_path, chi, beta):
    """Work and force of the loop between the ends of the motion, in closed form (Segalman 2005)."""
    k, limit = 2.0, 0.6
    p = {"m": 1.0, "c": 0.05, "k": 1.0, "F": 0.8, "omega": 1.1, "F_S": limit, "K_T": k,
         "chi": chi, "beta": beta}
    found = run_case(tmp_path, oscillator(p, iwan(p), 7))
    tau = 2.0 * np.pi * np.arange(20001) / 20000
    u = sum(found.coefficients[0, 2 * n - 1, 0] * np.cos(n * tau)
            + found.coefficients[0, 2 * n, 0] * np.sin(n * tau) for n in range(1, 8))
    # One swing there and one back: D of the amplitude alone.
    assert np.count_nonzero(np.diff(np.sign(np.diff(u)))) == 2
    a = u.max()
    share = beta + (chi + 1.0) / (chi + 2.0)
    most = limit * (1.0 + beta) / (k * share)
    r = limit * (chi + 1.0) / (most**(chi + 2.0) * share)
    if a < most:
        work = 4.0 * r * a**(chi + 3.0) / ((chi + 2.0) * (chi + 3.0))
    else:
        work = 4.0 * (limit * a - r * most**(chi + 3.0) / (chi + 3.0)
                      - limit / most * beta / share * most**2)
    # The largest displacement of a grid, and 20,000 instants of one swing: of second order.
    assert found.dissipation[0, 0] == pytest.approx(work, rel=1e-6)
    assert work > 1e-3


@pytest.mark.parametrize("beta", [0.0, 0.7])
def test_sliders_have_the_stiffness_and_the_limit_of_the_joint(beta):
    for chi in (-0.9, -0.5, 0.4):
        stiffness, limit = iwan_sliders(chi, beta, 30)
        assert len(stiffness) == len(limit) == 30
        assert abs(stiffness.sum() - 1.0) < 1e-12
        assert abs(limit.sum() - 1.0) < 1e-12


def test_pairs_with_a_normal_dof_share_its_stiffness():
    pairs = iwan_pairs([[1, 2, 3]], tangential_stiffness=2.0, chi=0.0, mu=0.3,
                       normal_stiffness=5.0, gap=-0.1, n=10)
    assert np.allclose(pairs.normal_stiffness, 0.5) and np.allclose(pairs.gap, -0.1)
    assert abs(pairs.tangential_stiffness.sum() - 2.0) < 1e-12
    assert abs(np.mean(pairs.mu) - 0.3) < 1e-12
    with pytest.raises(fw.InputError, match="chi: is -1"):
        iwan_pairs([[1, 0, 0]], tangential_stiffness=1.0, chi=-1.0)


LAWS = {"iwan": {"iwan_chi": [-0.5, 0.2], "iwan_beta": [0.3, 0.0]},
        "bouc_wen": {"bouc_wen_exponent": [1, 2], "bouc_wen_beta": [0.5, 0.8]}}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("other", ["penalty", "dlft", "regularised", "rigid"])
def test_beside_another_law_as_by_itself(tmp_path, law, other):
    """Two structures that are not joined, with one balance."""
    one = chain(law=law, **LAWS[law])
    own = {"penalty": {"tangential_stiffness": [0.8, 1.1]}, "regularised": {"slip_speed": 0.3}}
    two = merged(chain(), {"contact": {"law": other, "tangential_stiffness": None,
                                       **own.get(other, {})},
                           "load": {"static": [0.1, 0.2]}})
    if other != "rigid":
        two["harmonics"]["n_time"] = 512
    for name in ("one", "two", "both"):
        (tmp_path / name).mkdir()
    alone = [run_case(tmp_path / "one", one), run_case(tmp_path / "two", two)]
    zeros = np.zeros((2, 2))
    both = {
        **two,
        "model": {"n_dof": 4, **{name: np.block([[np.asarray(one["model"][name]), zeros],
                                                 [zeros, np.asarray(two["model"][name])]])
                                 for name in ("mass", "damping", "stiffness")}},
        "contact": {
            "n_pairs": 4, "law": [law, other, law, other],
            "side_1": [1, 0, 0, 3, 0, 0, 2, 0, 0, 4, 0, 0],
            "side_2": [2, 0, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0],
            "mu": [0.4, 0.4, 0.5, 0.5], "normal_load": [1.0, 1.0, 1.2, 1.2],
            "tangential_stiffness": [0.8, 0.8, 1.1, 1.1],
            **{name: [values[0], values[0], values[1], values[1]]
               for name, values in LAWS[law].items()},
            **({"slip_speed": 0.3} if other == "regularised" else {})},
        "load": {"cosine": [0.8, 0.3] * 2, "sine": [0.0, 0.4] * 2, "static": [0.0, 0.0, 0.1, 0.2]},
    }
    if other == "regularised":
        both["contact"]["tangential_stiffness"] = [0.8, 0.0, 1.1, 0.0]
    together = run_case(tmp_path / "both", both)
    # Half-wave symmetry of the first, of which the other knows nothing.
    first = alone[0].coefficients[0]
    assert difference(together.coefficients[0][:, :2], first) < WITHIN
    assert difference(together.coefficients[0][:, 2:], alone[1].coefficients[0]) < WITHIN
    assert difference(together.force[0][:, [0, 2]], alone[0].force[0]) < WITHIN


@pytest.mark.parametrize("law", LAWS)
def test_derivatives_are_differences(tmp_path, law):
    case = merged(chain(law=law, **LAWS[law]), {"load": {"static": [0.1, 0.0]}})
    keys = ("mu", "normal_load", "tangential_stiffness")
    run_case(tmp_path, {**case, "sensitivity": {"parameters": [f"contact%{k}" for k in keys]}})
    with h5py.File(tmp_path / "case.h5") as file:
        found = {k: file[f"sensitivity/largest/contact_{k}"][0] for k in keys}
    for key in keys:
        for pair in range(2):
            ends = []
            for step in (1e-4, -1e-4):
                values = list(case["contact"][key])
                values[pair] *= 1.0 + step
                moved = merged(case, {"contact": {key: values}})
                ends.append(run_case(tmp_path, moved).amplitude[0])
            wanted = (ends[0] - ends[1]) / (2e-4 * case["contact"][key][pair])
            # Differences of the second order, of solutions known to 1e-9; measured 1e-6.
            assert np.allclose(np.ravel(found[key][:, pair]), wanted, rtol=1e-4,
                               atol=1e-5 * np.abs(wanted).max())


@pytest.mark.parametrize("law", LAWS)
def test_work_in_is_work_out(tmp_path, law):
    case = chain(law=law, **LAWS[law])
    found = run_case(tmp_path, case)
    u = found.coefficients[0]
    omega = case["sweep"]["start"]
    cosine, sine = (np.asarray(case["load"][name]) for name in ("cosine", "sine"))
    # pi (F_c u_s - F_s u_c), and pi n**2 omega U_n^H C U_n of each harmonic.
    work = np.pi * (cosine @ u[2] - sine @ u[1])
    damping = np.asarray(case["model"]["damping"])
    viscous = sum(np.pi * n**2 * omega * (u[2 * n - 1] @ damping @ u[2 * n - 1]
                                       + u[2 * n] @ damping @ u[2 * n]) for n in range(1, 8))
    assert abs(work - viscous - found.dissipation[0].sum()) < 1e-9 * work
    assert (found.dissipation[0] > 0.0).all()


@pytest.mark.parametrize("law", LAWS)
def test_lu_is_gmres_and_a_sweep_is_its_points(tmp_path, law):
    case = chain(law=law, **LAWS[law])
    one = run_case(tmp_path, merged(case, {"solver": {"linear": "lu"}}))
    two = run_case(tmp_path, merged(case, {"solver": {"linear": "krylov"}}))
    assert difference(two.coefficients, one.coefficients) < WITHIN
    swept = run_case(tmp_path, merged(case, {
        "case": {"analysis": "frf"}, "sweep": {"start": 0.7, "end": 1.9, "n_points": 13}}))
    assert swept.converged.all()
    assert difference(swept.coefficients[4], one.coefficients[0]) < WITHIN
    branch = run_case(tmp_path, merged(case, {
        "case": {"analysis": "frf"},
        "sweep": {"start": 0.7, "end": 1.9, "n_points": 30, "continuation": "arclength"}}))
    assert branch.converged.all()


def test_a_mode_slips_at_every_amplitude(tmp_path):
    """One mass in one harmonic: m omega**2 = k + F_c(A)/A of the loop, and no onset."""
    case = {
        "case": {"analysis": "mode"},
        "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.0},
        "contact": {"n_pairs": 1, "side_1": [1, 0, 0], "law": "iwan", "mu": 1.0,
                    "normal_load": 1.0, "tangential_stiffness": 2.0, "iwan_chi": 0.0},
        "load": {"cosine": 1.0},
        "harmonics": {"n_harmonics": 1},
        "mode": {"start": 1e-3, "end": 0.9},
    }
    run(tmp_path, case)
    with h5py.File(tmp_path / "case.h5") as file:
        omega, u = file["omega"][:], file["coefficients"][:]
        assert file["mode"].attrs["onset_amplitude"] == 0.0
    amplitude = np.hypot(u[:, 1, 0], u[:, 2, 0])
    # chi = beta = 0, s = 2 A below s_max = 2: on the way from -A to A the force is
    # -F0(A) + 2 F0((x + A)/2), F0 = 2 u - u**2; its first cosine over A is 2 - A.
    small = amplitude < 1.0
    assert small.sum() > 5
    assert np.allclose(omega[small]**2, 1.0 + 2.0 - amplitude[small], rtol=1e-6)


REFUSED = [
    ({"contact": {"side_1": [1, 0, 2, 2, 0, 0], "side_2": 0}}, "of one tangential direction"),
    ({"contact": {"side_1": [1, 2, 0, 2, 0, 0], "side_2": 0}}, "fretwear.laws.iwan_pairs"),
    ({"contact": {"iwan_chi": -1.0}}, "iwan_chi"),
    ({"contact": {"iwan_chi": None}}, "iwan_chi is missing"),
    ({"contact": {"iwan_beta": -0.1}}, "iwan_beta"),
    ({"contact": {"tangential_stiffness": [0.0, 1.0]}}, "must be above 0"),
    ({"contact": {"law": "bouc_wen", "iwan_chi": None, "bouc_wen_exponent": 1.5}},
     "must be a whole number from 1 to 2"),
    ({"contact": {"law": "bouc_wen", "iwan_chi": None, "bouc_wen_beta": 0.4}}, "bouc_wen_beta"),
    ({"contact": {"law": "bouc_wen"}}, "belongs to law = 'iwan'"),
    ({"contact": {"memory": "carried"}, "case": {"analysis": "frf"},
      "sweep": {"end": 1.5, "n_points": 3}}, "use 'assembly'"),
    ({"case": {"analysis": "time"}}, "is not integrated in time"),
    ({"case": {"analysis": "frf"}, "sweep": {"end": 1.5, "n_points": 5, "stability": True}},
     "without Floquet multipliers"),
    ({"harmonics": {"sampling": "uniform"}}, "harmonics%sampling"),
    ({"harmonics": {"method": "hdhb"}}, "harmonics%method"),
    ({"output": {"tail": 20}}, "output%tail"),
    ({"contact": {"area": 1.0}, "case": {"analysis": "wear"},
      "wear": {"coefficient": 1e-6, "n_cycles": 10}}, "does not measure slip"),
]


@pytest.mark.parametrize(("change", "told"), REFUSED)
def test_what_does_not_go_is_refused(tmp_path, change, told):
    case = merged(chain(law="iwan", iwan_chi=-0.5), change)
    assert told in run(tmp_path, case, status=3).stderr
