"""Polynomial forces of several dofs (group &polynomial).

Against an exact solution (`test/reference/laws`: two dofs with a potential of degree 4, integrated
in time and closed by Newton's method), against the same forces as springs along u1, u2, u1 +- u2,
and as a potential, as forces term by term and from a model file, which are one problem.
"""
import itertools
import json

import h5py
import numpy as np
import pytest
from cases import run
from oracle_runs import run_case
from project import ROOT

import fretwear as fw

EXACT = json.loads((ROOT / "test/reference/laws/law_polynomial.json").read_text())["cases"]
#: Residuals of 1e-11 of the load times the condition of the structures, below 100, and a margin of
#: ten: what two runs of one problem may differ by.
TOLERANCE, WITHIN = 1e-11, 1e-8


def factors(powers):
    """Dofs, repeated for powers, filled up to 8."""
    dofs = [dof + 1 for dof, power in enumerate(powers) for _ in range(power)]
    return dofs + [0] * (8 - len(dofs))


def energy(terms):
    """Group &polynomial of [[coefficient, powers], ...]."""
    return {"n_terms": len(terms), "coefficient": [c for c, _ in terms],
            "factors": list(itertools.chain.from_iterable(factors(p) for _, p in terms))}


def forces(terms):
    """The gradient of the same, term by term."""
    rows = []
    for coefficient, powers in terms:
        for dof, power in enumerate(powers):
            if power == 0:
                continue
            less = [p - (d == dof) for d, p in enumerate(powers)]
            rows.append((coefficient * power, factors(less), dof + 1))
    return {"n_terms": len(rows), "of": "force", "coefficient": [r[0] for r in rows],
            "factors": list(itertools.chain.from_iterable(r[1] for r in rows)),
            "dof": [r[2] for r in rows]}


def groups(params, polynomial, n_harmonics):
    found = {
        "case": {"analysis": "point"},
        "model": {"n_dof": len(params["M"]), "mass": params["M"], "damping": params["C"],
                  "stiffness": params["K"]},
        "load": {"static": params["F0"], "cosine": params["F"]},
        "harmonics": {"n_harmonics": n_harmonics}, "sweep": {"start": params["omega"]},
        "solver": {"tolerance": TOLERANCE},
    }
    if polynomial:
        found["polynomial"] = polynomial
    return found


def exact(case, n_harmonics):
    """(2H+1, dof)"""
    known = min(n_harmonics, 7)
    found = np.zeros((2 * n_harmonics + 1, 2))
    for j, name in enumerate(("u1", "u2")):
        found[0, j] = case[name]["x0"]
        found[1:2 * known:2, j] = case[name]["xc"][:known]
        found[2:2 * known + 1:2, j] = case[name]["xs"][:known]
    return found


# The truncation, about three times what is measured: 9e-3, 3e-5 and, of the coefficients 0 to 7,
# 2e-9 (H = 15) of both cases.
@pytest.mark.parametrize("name", ["coupled", "static"])
@pytest.mark.parametrize(("n_harmonics", "error"), [(3, 3e-2), (7, 1e-4), (15, 1e-8)])
def test_motion_is_that_of_integration_in_time(tmp_path, name, n_harmonics, error):
    case = EXACT[name]
    result = run_case(tmp_path, groups(case["params"], energy(case["params"]["potential"]),
                                       n_harmonics))
    wanted = exact(case, n_harmonics)
    n = 2 * min(n_harmonics, 7) + 1
    found = result.coefficients[0][:n]
    assert np.linalg.norm(found - wanted[:n]) < error * np.linalg.norm(wanted)


def test_potential_and_forces_are_one_problem(tmp_path):
    params = EXACT["static"]["params"]
    ways = {"energy": energy(params["potential"]), "force": forces(params["potential"])}
    found = {}
    for name, polynomial in ways.items():
        (tmp_path / name).mkdir()
        found[name] = run_case(tmp_path / name, groups(params, polynomial, 9)).coefficients
    scale = np.abs(found["energy"]).max()
    assert np.abs(found["energy"] - found["force"]).max() < WITHIN * scale


def test_terms_are_springs(tmp_path):
    """(u1 - u2)^4/4 and u2^2/2 + u1^6/6: a cubic, a linear and a quintic spring."""
    params = EXACT["coupled"]["params"]
    terms = [[0.3 * c / 4.0, p] for c, p in
             ((1, [4, 0]), (-4, [3, 1]), (6, [2, 2]), (-4, [1, 3]), (1, [0, 4]))]
    terms += [[0.35, [0, 2]], [0.2 / 6.0, [6, 0]]]
    springs = {"n_springs": 3, "side_1": [1, 2, 1], "side_2": [2, 0, 0],
               "coefficient": [0.3, 0.7, 0.2], "power": [3, 1, 5]}
    (tmp_path / "terms").mkdir()
    (tmp_path / "springs").mkdir()
    one = run_case(tmp_path / "terms", groups(params, energy(terms), 9))
    other = run_case(tmp_path / "springs", groups(params, {}, 9) | {"spring": springs})
    scale = np.abs(other.coefficients).max()
    assert np.abs(one.coefficients - other.coefficients).max() < WITHIN * scale


def test_model_file_gives_the_same(tmp_path):
    params = EXACT["coupled"]["params"]
    polynomial = energy(params["potential"])
    direct = run_case(tmp_path, groups(params, polynomial, 5))
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name, key in (("mass", "M"), ("stiffness", "K"), ("damping", "C")):
            file[name] = np.array(params[key])
        file["load/cosine"] = np.array(params["F"])
        file["polynomial/factors"] = np.reshape(polynomial["factors"], (-1, 8)).astype("i4")
        file["polynomial/coefficient"] = np.array(polynomial["coefficient"])
        file["polynomial"].attrs["of"] = "energy"
    case = groups(params, {}, 5)
    case["model"] = {"source": "hdf5", "file": "model.h5"}
    del case["load"]
    (tmp_path / "file").mkdir()
    (tmp_path / "model.h5").rename(tmp_path / "file" / "model.h5")
    assert np.array_equal(run_case(tmp_path / "file", case).coefficients, direct.coefficients)
    # Another coefficient in the case replaces those of the file; 0 terms leave them out.
    case["polynomial"] = {"coefficient": [2.0 * c for c in polynomial["coefficient"]]}
    other = run_case(tmp_path / "file", case).coefficients
    twice = polynomial | {"coefficient": case["polynomial"]["coefficient"]}
    assert np.array_equal(other, run_case(tmp_path, groups(params, twice, 5)).coefficients)
    case["polynomial"] = {"n_terms": 0}
    assert np.array_equal(run_case(tmp_path / "file", case).coefficients,
                          run_case(tmp_path, groups(params, {}, 5)).coefficients)


def test_derivatives_are_those_of_differences(tmp_path):
    """By each coefficient, of a motion about a static position."""
    params = EXACT["static"]["params"]
    polynomial = energy(params["potential"])
    case = groups(params, polynomial, 7)
    case["sensitivity"] = {"parameters": ["polynomial%coefficient"],
                           "quantities": ["first_harmonic"]}
    run(tmp_path, case)
    with h5py.File(tmp_path / "case.h5") as file:
        found = file["sensitivity/first_harmonic/polynomial_coefficient"][0]
    del case["sensitivity"]
    step = 1e-4
    for i, coefficient in enumerate(polynomial["coefficient"]):
        sides = []
        for sign in (1, -1):
            moved = list(polynomial["coefficient"])
            moved[i] = coefficient + sign * step
            case["polynomial"] = polynomial | {"coefficient": moved}
            u = run_case(tmp_path, case).coefficients[0]
            sides.append(np.hypot(u[1], u[2]))
        wanted = (sides[0] - sides[1]) / (2.0 * step)
        # step**2 of the third derivative, and round-off of 1e-11/step.
        assert np.abs(np.ravel(found)[i::len(polynomial["coefficient"])] - wanted).max() < 1e-6 or \
            np.abs(found[..., i] - wanted).max() < 1e-6


def test_full_tensors_hold_the_balance(tmp_path):
    """Tensors without any symmetry on signed dofs: the balance of the result with their forces,
    written anew at 64 instants, which are exact for degree 3 of 5 harmonics."""
    random = np.random.default_rng(11)
    dofs = [1, -3]
    quadratic, cubic = 0.05 * random.normal(size=(2,) * 3), 0.1 * random.normal(size=(2,) * 4)
    k = np.array([[2.6, -1.0, 0.2], [-1.0, 2.6, -1.1], [0.2, -1.1, 2.6]])
    mass, damping, omega, h = np.diag([1.0, 0.8, 1.2]), 0.05 * k, 0.9, 5
    load = np.array([0.4, 0.1, 0.3])
    model = fw.Model(mass, damping, k, cosine=load,
                     elements=[fw.Polynomial.from_tensors(dofs, quadratic, cubic)])
    model.to_hdf5(tmp_path / "model.h5")
    found = run_case(tmp_path, {
        "case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
        "harmonics": {"n_harmonics": h}, "sweep": {"start": omega},
        "solver": {"tolerance": TOLERANCE}})
    u = found.coefficients[0]
    tau = 2.0 * np.pi * np.arange(64) / 64
    waves = np.array([np.ones(64), *(f(n * tau) for n in range(1, h + 1) for f in (np.cos, np.sin))])
    x = (waves.T @ u)[:, [0, 2]] * [1.0, -1.0]
    acts = (np.einsum("ijk,tj,tk->ti", quadratic, x, x)
            + np.einsum("ijkl,tj,tk,tl->ti", cubic, x, x, x)) * [1.0, -1.0]
    force = np.zeros((64, 3))
    force[:, [0, 2]] = acts
    inner = waves @ force / 32.0
    inner[0] /= 2.0
    for n in range(h + 1):
        c = [0] if n == 0 else [2 * n - 1, 2 * n]
        turn = np.array([1.0]) if n == 0 else np.array([1.0, -1.0j])
        z = k - (n * omega)**2 * mass + 1j * n * omega * damping
        rest = z @ (turn @ u[c]) + turn @ inner[c] - (load if n == 1 else 0.0)
        assert np.abs(rest).max() < 1e-9
    assert np.abs(acts).max() > 0.01
    with pytest.raises(fw.InputError, match="polynomial.cubic"):
        fw.Polynomial.from_tensors(dofs, cubic=np.zeros((3,) * 4))


@pytest.mark.parametrize(("change", "message"), [
    ({"factors": [0] * 8}, "factors of term 1 are all 0"),
    ({"factors": [1] + [0] * 7}, "give it as load%static"),
    ({"factors": [1, 3] + [0] * 6}, "factors"),
    ({"dof": [1]}, "leave it out, or take of = 'force'"),
    ({"of": "force"}, "dof is missing"),
    ({"of": "force", "dof": [0]}, "the ground: must be a dof"),
    ({"n_terms": None}, "n_terms is missing"),
    ({"of": "power"}, "of = 'power'"),
])
def test_wrong_input_ends_in_words(tmp_path, change, message):
    polynomial = {"n_terms": 1, "coefficient": [1.0], "factors": [1, 1, 2] + [0] * 5} | change
    polynomial = {key: value for key, value in polynomial.items() if value is not None}
    done = run(tmp_path, groups(EXACT["coupled"]["params"], polynomial, 3), status=3)
    assert message in done.stderr


def test_even_terms_keep_even_harmonics(tmp_path):
    case = groups(EXACT["coupled"]["params"], {"n_terms": 1, "coefficient": [0.1],
                                               "factors": [1, 1, 2] + [0] * 5}, 3)
    case["harmonics"]["parity"] = "odd"
    assert "even" in run(tmp_path, case, status=3).stderr
    case["polynomial"]["factors"] = [1, 1, 2, 2] + [0] * 4
    run(tmp_path, case)


