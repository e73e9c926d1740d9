"""Small worn joints as cases of fw_run, with the reference solutions where there are any."""
import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test" / "support"))
from limits import limit

PROGRAM = (ROOT / os.environ.get("FW_RUN", "build/release/fw_run")).resolve()
REFERENCE = json.loads((ROOT / "test" / "reference" / "oracle_g_wear.json").read_text())
# What depends on the clock or on the name of the run.
CLOCK = {"seconds", "attributes"}


def literal(value):
    """A value as a namelist takes it."""
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, (int, np.integer)):
        return str(value)
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return ", ".join(literal(item) for item in np.ravel(value).tolist())


def write_namelist(path, groups):
    """Write {group: {key: value}} as a namelist."""
    lines = []
    for group, keys in groups.items():
        lines += [f"&{group}", *(f"  {key} = {literal(value)}" for key, value in keys.items()), "/"]
    path.write_text("\n".join(lines) + "\n")


def merged(groups, changes):
    """Groups with changes to some keys; None takes a key out."""
    result = {name: dict(keys) for name, keys in groups.items()}
    for name, keys in changes.items():
        result.setdefault(name, {}).update(keys)
        result[name] = {key: value for key, value in result[name].items() if value is not None}
    return result


def run(folder, groups, *arguments, name="case", status=0):
    """Run a case given as groups; return what it printed."""
    path = folder / f"{name}.nml"
    write_namelist(path, groups)
    done = subprocess.run([PROGRAM, "-q", *map(str, arguments), str(path)], cwd=folder, text=True,
                          capture_output=True, timeout=limit(120), check=False,
                          env={**os.environ, "OMP_WAIT_POLICY": "passive"})
    assert done.returncode == status, (done.returncode, done.stderr)
    return done


def read(path):
    """Every dataset of a result, and the attributes of the file and of /wear."""
    found = {}
    with h5py.File(path, "r") as file:
        def take(name, item):
            if isinstance(item, h5py.Dataset):
                found[name] = item[()]
        file.visititems(take)
        found["attributes"] = dict(file.attrs)
        found["wear"] = dict(file["wear"].attrs) if "wear" in file else {}
    return found


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
