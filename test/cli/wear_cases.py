"""Small worn joints as cases of fw_run, with the reference solutions where there are any."""
import json

import numpy as np
from cases import read, run
from project import ROOT

REFERENCE = json.loads((ROOT / "test" / "reference" / "oracle_g_wear.json").read_text())
# What depends on the clock or on the name of the run.
CLOCK = {"seconds", "attributes"}


def result(folder, groups, *arguments, name="case", status=0):
    """Run a case and read its result."""
    run(folder, groups, *arguments, name=name, status=status)
    return read(folder / f"{name}.h5")


def assert_same(found, expected):
    """Every dataset and the outcome of the wear run, bit by bit."""
    assert set(found) == set(expected)
    for name in set(expected) - CLOCK - {"wear"}:
        assert found[name].dtype == expected[name].dtype, name
        if expected[name].dtype == object:
            assert found[name].tolist() == expected[name].tolist(), name
        else:
            assert found[name].tobytes() == expected[name].tobytes(), name
    assert found["wear"] == expected["wear"]
    for name in ("status", "steady_state"):
        assert found["attributes"][name] == expected["attributes"][name]


def joint(model, contact, load, omega, coefficient, wear, **harmonics):
    """A case of analysis 'wear'."""
    return {"case": {"analysis": "wear", "threads": 1}, "model": model, "contact": contact,
            "load": load, "harmonics": {"n_harmonics": 1, **harmonics}, "sweep": {"start": omega},
            "solver": {"tolerance": 1e-11},
            "wear": {"coefficient": coefficient, "max_steps": 20000, **wear}}


def prescribed_slip(**wear):
    """W1: a rigid pair on massless dofs that a load drags to and fro behind a spring."""
    p = REFERENCE["W1"]["params"]
    model = {"n_dof": 2, "mass": [0.0] * 4, "stiffness": np.diag([p["kt"], p["kn"]])}
    contact = {"n_pairs": 1, "side_1": [1, 0, 2], "mu": p["mu"], "area": 1.0}
    load = {"cosine": [p["kt"] * p["a"], 0.0], "static": [0.0, -p["p0"]]}
    return joint(model, contact, load, 1.0, p["kwA"], wear)


def shared_load(**wear):
    """W2: two such pairs under one plate; the second, softly driven one takes over the load."""
    p = REFERENCE["W2"]["params"]
    # Dofs: t1, t2, n1, n2, plate.
    stiffness = np.diag([p["kt1"], p["kt2"], 0.0, 0.0, 0.0])
    for n in (2, 3):
        stiffness[np.ix_([n, 4], [n, 4])] += p["kn"] * np.array([[1.0, -1.0], [-1.0, 1.0]])
    model = {"n_dof": 5, "mass": [0.0] * 25, "stiffness": stiffness}
    contact = {"n_pairs": 2, "side_1": [1, 0, 3, 2, 0, 4], "mu": p["mu"], "area": 1.0}
    load = {"cosine": [p["kt1"] * p["a"], p["kt2"] * p["a"], 0.0, 0.0, 0.0],
            "static": [0.0, 0.0, 0.0, 0.0, -p["P"]]}
    return joint(model, contact, load, 1.0, p["kwA"], wear)


def oscillator(n_harmonics=25, law="dlft_velocity", **wear):
    """W3: a mass with friction whose pressure fades as it wears."""
    p = REFERENCE["W3"]["params"]
    model = {"n_dof": 2, "mass": np.diag([p["m"], 0.0]), "stiffness": np.diag([p["k"], p["kn"]]),
             "damping": np.diag([p["c"], 0.0])}
    contact = {"n_pairs": 1, "law": law, "side_1": [1, 0, 2], "mu": p["mu"], "area": 1.0}
    load = {"cosine": [p["F"], 0.0], "static": [0.0, -p["N0"]]}
    return joint(model, contact, load, p["omega"], p["kwA"], wear, n_harmonics=n_harmonics,
                 n_time=max(1024, 32 * n_harmonics))
