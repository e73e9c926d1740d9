"""What holds for every solution, whatever the number of harmonics: energy, the contact law, and
answers that do not depend on how they were computed."""
from __future__ import annotations

import numpy as np
import oracle_cases as cases
import pytest
import slow_balance as slow
from oracle_runs import read_reference, run_case

DUFFING, COULOMB, JENKINS, TWO_DOF, GAP, PLANAR = map(read_reference, "abcdef")


def choose(builder, reference, names, n_harmonics, **keys):
    return [pytest.param(builder(reference[name]["params"], n_harmonics, **keys), id=name)
            for name in names]


ELASTIC = [
    pytest.param(cases.duffing(DUFFING["params"], 1.0, 7), id="duffing"),
    *choose(cases.jenkins, JENKINS, ["jenkins_F1.0_w1.0", "jenkins_F0.3_w1.4"], 7),
    *choose(cases.gap, GAP, ["gap_g0.5_F0.3_w0.9", "gap_g-0.2_F0.3_w0.9",
                               "gap_g0.0_F0.3_w0.7"], 7),
    *choose(cases.two_dof, TWO_DOF, ["A_stickslip", "D_separation", "G_separation"], 7),
    *choose(cases.planar, PLANAR, PLANAR, 7),
]
RIGID = [
    *choose(cases.coulomb, COULOMB, ["c0.1_N0.4_w0.9", "ss_c0.1_N1.2_w0.25",
                                     "var_N0.6_N11.0_psi1.0472_w0.6"], 7),
    *choose(cases.chain, TWO_DOF, ["chain_muN0.2_w0.62", "chain_muN0.3_w1.2"], 7),
    *choose(cases.two_dof_massless, TWO_DOF, ["A_stickslip", "D_separation", "H_separation"], 7),
]


def matrices(groups):
    """Mass, damping and stiffness of a case."""
    n = groups["model"]["n_dof"]
    return [np.reshape(np.array(groups["model"][key], float), (n, n))
            for key in ("mass", "damping", "stiffness")]


def loads(groups, n_harmonics):
    """Load coefficients (2H+1, n_dof)."""
    load = np.zeros((2 * n_harmonics + 1, groups["model"]["n_dof"]))
    for row, key in enumerate(("static", "cosine", "sine")):
        load[row] = groups["load"].get(key, 0.0)
    return load


def works(groups, result):
    """Work of the load and of the dampers per cycle."""
    u, omega = result.coefficients[0], result.omega[0]
    load, damping = loads(groups, len(u) // 2), matrices(groups)[1]
    work_in = np.pi * (load[1] @ u[2] - load[2] @ u[1])
    viscous = sum(np.pi * n**2 * omega * (u[2 * n - 1] @ damping @ u[2 * n - 1]
                                          + u[2 * n] @ damping @ u[2 * n])
                  for n in range(1, (len(u) + 1) // 2))
    return work_in, viscous


# Galerkin's projection keeps the balance of energy exactly, at any number of harmonics; what is
# left is the tolerance of the solver.
@pytest.mark.parametrize("groups", ELASTIC + RIGID)
def test_work_in_is_viscous_and_friction_work(tmp_path, groups):
    result = run_case(tmp_path, groups)
    work_in, viscous = works(groups, result)
    friction = 0.0 if result.dissipation is None else result.dissipation.sum()
    assert abs(work_in - viscous - friction) < 1e-8 * abs(work_in)


# The slip path is what the elastic deflection leaves of the displacement. It is summed over
# instants, the dissipation of the file comes from the coefficients: they differ by the sampling.
@pytest.mark.parametrize("groups", [
    *choose(cases.jenkins, JENKINS, JENKINS, 15), *choose(cases.planar, PLANAR, PLANAR, 15),
    *choose(cases.two_dof, TWO_DOF, [n for n in TWO_DOF if not n.startswith("chain")], 15)])
def test_friction_work_is_mu_times_normal_force_along_the_slip(tmp_path, groups):
    contact = groups["contact"]
    result = run_case(tmp_path, {**groups, "output": {"histories": True}})
    force, relative = result.history_force[0], result.history_relative[0]
    force = force.reshape(-1, 3)
    relative = relative.reshape(-1, 3)
    slip = relative[:, :2] - force[:, :2] / contact["tangential_stiffness"]
    path = np.linalg.norm(slip - np.roll(slip, 1, axis=0), axis=1)
    work = -contact["mu"] * 0.5 * (force[:, 2] + np.roll(force[:, 2], 1)) @ path
    # Measured: 1.7e-5 at most, and 1/16 of that with four times the instants.
    assert work == pytest.approx(result.dissipation[0, 0], rel=3e-5)


@pytest.mark.parametrize("groups", ELASTIC[1:] + RIGID)
def test_equilibrium_and_contact_law(tmp_path, groups):
    """The equations, formed anew from the result file."""
    result = run_case(tmp_path, groups)
    contact, u, force = groups["contact"], result.coefficients[0], result.force[0, :, 0]
    rows = slow.pair_rows(contact["side_1"], (0, 0, 0), groups["model"]["n_dof"])
    defect = slow.equilibrium(matrices(groups), result.omega[0], u, force @ rows,
                              loads(groups, len(u) // 2))
    assert defect < 1e-9
    rigid = contact["law"] == "dlft"
    if rigid:
        penalty = slow.automatic_penalty(matrices(groups)[2], rows)
    else:
        tangential = contact.get("tangential_stiffness", 0.0)
        penalty = np.array([tangential, tangential, contact.get("normal_stiffness", 0.0)])
    assert slow.law_defect(force, u @ rows.T, contact.get("gap", 0.0), contact.get("mu", 0.0),
                           penalty, cases.N_TIME, rigid, contact.get("normal_load", 0.0)) < 1e-8


# With as many instants as unknowns the formulations are the same equations in other variables.
@pytest.mark.parametrize("method", ["tcm", "hdhb"])
@pytest.mark.parametrize("n_harmonics", [3, 7])
def test_formulations_coincide(tmp_path, method, n_harmonics):
    parameters = TWO_DOF["A_stickslip"]["params"]
    groups = cases.two_dof(parameters, n_harmonics)
    solutions = []
    for name in ("hbm", method):
        groups["harmonics"] = {"method": name, "n_harmonics": n_harmonics,
                               "n_time": 2 * n_harmonics + 1}
        solutions.append(run_case(tmp_path, groups).coefficients)
    # Both are solved to 1e-11 of the load.
    assert np.abs(solutions[0] - solutions[1]).max() < 1e-10


# Half-wave symmetry is exact, so that leaving out the even harmonics changes nothing.
@pytest.mark.parametrize("builder, reference, name", [
    (cases.jenkins, JENKINS, "jenkins_F1.0_w1.0"), (cases.planar, PLANAR, "B"),
    (cases.coulomb, COULOMB, "c0.1_N0.4_w0.9")])
def test_parity_auto_is_all(tmp_path, builder, reference, name):
    results = []
    for parity in ("auto", "all"):
        groups = builder(reference[name]["params"], 7)
        groups["harmonics"]["parity"] = parity
        results.append(run_case(tmp_path, groups))
    difference = np.abs(results[0].coefficients - results[1].coefficients).max()
    assert difference < 1e-9 * np.abs(results[1].coefficients).max()
    assert np.abs(results[0].force - results[1].force).max() < 1e-9 * np.abs(results[1].force).max()


def friction_chain(lateral):
    """Two masses on elastic friction; each may move across the chain as well, where nothing acts,
    and `lateral` says whether the contact feels it."""
    stiffness = np.kron(np.eye(2), [[2.0, -1.0], [-1.0, 1.0]])
    return {"case": {"analysis": "frf"},
            "model": {"n_dof": 4, "mass": np.eye(4).ravel().tolist(),
                      "stiffness": stiffness.ravel().tolist(),
                      "damping": (0.05 * stiffness).ravel().tolist()},
            "load": {"cosine": [0.0, 0.5, 0.0, 0.0]},
            "contact": {"n_pairs": 2, "law": "penalty", "mu": [1.0, 1.0],
                        "normal_load": [0.6, 0.6], "tangential_stiffness": [0.3, 0.3],
                        "side_1": [1, 3 if lateral else 0, 0, 2, 4 if lateral else 0, 0]},
            "harmonics": {"n_harmonics": 5, "n_time": 128},
            "sweep": {"start": 0.9, "end": 0.6, "n_points": 16},
            # Skips would leave out a direction that nothing moves.
            "solver": {"tolerance": 1e-12, "skips": False}}


def test_second_direction_that_nothing_moves(tmp_path):
    """Marching one tangential direction is marching two of which one rests."""
    one, two = (run_case(tmp_path, friction_chain(lateral)) for lateral in (False, True))
    assert one.converged.all() and (one.fraction[:, :, 1] > 0.0).any()
    assert np.abs(one.coefficients - two.coefficients).max() < 1e-9 * np.abs(one.coefficients).max()


def test_stability_changes_no_answer(tmp_path):
    plain = friction_chain(False)
    asked = plain | {"sweep": plain["sweep"] | {"stability": True}}
    # Components that nothing moves are kept for the multipliers: other sums, the same solution.
    one, two = run_case(tmp_path, plain), run_case(tmp_path, asked)
    assert np.abs(one.coefficients - two.coefficients).max() < 1e-9 * np.abs(one.coefficients).max()
