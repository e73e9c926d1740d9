"""Random sweeps over what changes matrices, judged by equations of a code of its own and by runs of
single values, into docs/robustness.md.

    python test/oracles/parameter_family.py [--count 112] [--seed 0] [-o docs/robustness.md]

Damping of modes, damping in proportion to mass and to stiffness, speed of rotation; all laws, one
and two tangential directions, preload and separation, springs, 1 to 6 pairs; values, factors, and
every fourth case by arc length. Some begin without damping or without rotation. Judged: equilibrium
of every harmonic with the matrices of each value, of laws whose instants are given (`penalty`,
`dlft`) the force that the law makes of the motion, and every row against a run of its own with the
value typed in. What has not converged is counted, and so is where that run has another solution.
"""
import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
sys.path.insert(0, str(Path(__file__).resolve().parent))
import h5py
import numpy as np
from cases import merged, run
from control_family import INSTANTS, TOLERANCE, modal_damping, point_errors
from sections import write_section
from sensitivity_family import random_case

NAMES = ("modal_damping", "rayleigh_mass", "rayleigh_stiffness", "rotation_speed")
#: Of a row and the run of its value: the same equations, each to residuals of 1e-13.
SAME = 1e-9


def parameter_case(seed):
    """A case, its parameter, its values, whether they are factors, and whether along a branch."""
    rng = np.random.default_rng(5000 + seed)
    groups, _ = random_case(seed)
    name = NAMES[seed % 4]
    n = groups["model"]["n_dof"]
    contact = groups["contact"]
    side = np.reshape(contact["side_1"], (-1, 3))
    used = int(np.abs(side).max())
    if contact["law"] in ("penalty", "dlft") and rng.random() < 0.4 and n > used:
        # A second direction on a dof that no pair has.
        side[0, 1] = used + 1
        contact["side_1"] = side.ravel().tolist()
    harmonics = {}
    if contact["law"] in ("penalty", "dlft"):
        harmonics = {"n_time": INSTANTS, "sampling": "uniform", "parity": "all"}
    groups = merged(groups, {"case": {"analysis": "frf"}, "harmonics": harmonics,
                             "output": {"observe": None},
                             "model": {"modal_damping": float(rng.uniform(0.01, 0.04))}})
    base = {"modal_damping": 0.02, "rayleigh_mass": 0.02, "rayleigh_stiffness": 0.02,
            "rotation_speed": 1.0}[name]
    by_factor = bool(rng.random() < 0.4)
    along = seed % 4 == (seed // 4) % 4
    values = base * np.sort(rng.uniform(0.3, 2.5, 4))
    if rng.random() < 0.3 and not (name == "modal_damping" and contact["law"] == "rigid"):
        values[0] = 0.0
    if not along:
        values = rng.permutation(values)
    groups = merged(groups, {"model": {name: base}})
    rotation = {}
    if name == "rotation_speed":
        a = rng.normal(size=(n, n))
        rotation = {"stiffness": 0.3 * a @ a.T / n, "static": np.zeros(n)}
        if side[:, 2].any():
            rotation["static"][side[:, 2].max() - 1] = -0.2
        elif rng.random() < 0.5:
            rotation["static"][:] = 0.1 * rng.normal(size=n)
    return groups, name, values, by_factor, along, rotation


def matrices_at(groups, name, value, rotation):
    """Mass, damping and stiffness with the value, and the static load that comes with it."""
    model = dict(groups["model"], **{name: value})
    n = model["n_dof"]
    mass, stiffness = (np.reshape(model[key], (n, n)) for key in ("mass", "stiffness"))
    static = np.array(groups["load"]["static"])
    if rotation:
        stiffness = stiffness + value**2 * rotation["stiffness"]
        static = static + value**2 * rotation["static"]
    damping = (modal_damping(mass, stiffness, model["modal_damping"])
               + model.get("rayleigh_mass", 0.0) * mass
               + model.get("rayleigh_stiffness", 0.0) * stiffness)
    return (mass, damping, stiffness), static


def as_run(folder, groups, rotation):
    """The groups that the program is given: the matrices of a rotating structure are in a file."""
    if not rotation:
        return groups
    n = groups["model"]["n_dof"]
    with h5py.File(folder / "model.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for key in ("mass", "stiffness"):
            file[key] = np.reshape(groups["model"][key], (n, n))
        file["stiffness_rotation"] = rotation["stiffness"]
        file["load/static_rotation"] = rotation["static"]
    return merged(groups, {"model": {"n_dof": None, "mass": None, "stiffness": None,
                                     "source": "hdf5", "file": "model.h5"}})


def judged(folder, seed):
    """What became of a case: counts by word, and the worst errors."""
    groups, name, values, by_factor, along, rotation = parameter_case(seed)
    base = groups["model"][name]
    omega = groups["sweep"]["start"]
    asked = (values / base if by_factor else values).tolist()
    sweep = {"parameter": f"model%{name}", "as": "factor" if by_factor else "value",
             "frequency": omega, "start": None, "values": asked}
    if along:
        sweep.update(values=None, start=asked[0], end=asked[-1], n_points=5,
                     continuation="arclength", max_points=60)
    given = as_run(folder, groups, rotation)
    found, worst = Counter(cases=1), Counter()
    done = run(folder, merged(given, {"sweep": sweep}), status=(0, 4), seconds=300)
    held_by = matrices_at(groups, name, values[0], rotation)[0][2] if along else None
    with h5py.File(folder / "case.h5") as file:
        for k in range(len(file["parameter"])):
            value = file["parameter"][k] * (base if by_factor else 1.0)
            alone = merged(given, {"model": {name: float(value)},
                                   "sweep": {"start": omega}, "case": {"analysis": "point"}})
            if not file["converged"][k]:
                found["not converged"] += 1
                # Missed, where a run of its own finds it.
                done_alone = run(folder, alone, name="own", status=(0, 4), seconds=300)
                found["missed"] += int(done_alone.returncode == 0)
                continue
            row = file["coefficients"][k]
            matrices, static = matrices_at(groups, name, value, rotation)
            point = merged(groups, {"load": {"static": static}})
            errors = point_errors(point, matrices, omega, row, file["contact/force"][k],
                                  groups["load"]["harmonic_scale"], held_by)
            found["judged"] += 1
            found["by its law"] += int(np.isfinite(errors[1]))
            worst["equations"] = max(worst["equations"], np.nanmax(errors))
            found["off"] += int(not np.nanmax(errors) <= TOLERANCE)
            if along:
                continue
            if run(folder, alone, name="own", status=(0, 4), seconds=300).returncode:
                found["alone not converged"] += 1
                continue
            with h5py.File(folder / "own.h5") as own:
                other = own["coefficients"][0]
            error = np.abs(row - other).max() / np.abs(other).max()
            if error > 1e-5:
                found["another solution"] += 1
                continue
            found["runs"] += 1
            worst["runs"] = max(worst["runs"], error)
            found["off"] += int(not error <= SAME)
    assert done.returncode == 0 or found["not converged"] or along
    found["incomplete"] += int(along and done.returncode != 0)
    return found, worst


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=112)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", dest="document", type=Path)
    options = parser.parse_args()
    totals, worst = {}, {}
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.seed, options.seed + options.count):
            case = parameter_case(seed)
            found, error = judged(Path(name), seed)
            totals.setdefault(case[1], Counter()).update(found)
            kept = worst.setdefault(case[1], Counter())
            for word in error:
                kept[word] = max(kept[word], error[word])
            if any(found[word] for word in ("off", "not converged", "another solution",
                                            "incomplete", "alone not converged")):
                print(f"seed {seed}: {case[1]}, {case[0]['contact']['law']}, {dict(found)}, "
                      f"{dict(error)}", flush=True)
    lines = [f"{options.count} cases (seeds {options.seed} to {options.seed + options.count - 1}).",
             "", "| parameter | cases | points judged | of these by the law | by runs of their own "
             "| off | worst error | of the runs | another solution | not converged | missed |",
             "|---|---|---|---|---|---|---|---|---|---|---|"]
    for word in NAMES:
        found, error = totals.get(word, Counter()), worst.get(word, Counter())
        lines.append(f"| `{word}` | {found['cases']} | {found['judged']} | {found['by its law']} | "
                     f"{found['runs']} | {found['off']} | {error['equations']:.1e} | "
                     f"{error['runs']:.1e} | {found['another solution']} | "
                     f"{found['not converged']} | {found['missed']} |")
    print("\n".join(lines))
    if options.document:
        write_section("sweeps over matrices", lines, options.document)
    return int(any(found["off"] for found in totals.values()))


if __name__ == "__main__":
    sys.exit(main())
