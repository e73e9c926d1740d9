"""Cyclic cases as groups of a namelist: of the reference solutions, and of random sectors with the
whole annulus beside them, which the program runs as one structure."""
from __future__ import annotations

import json

import numpy as np
from cases import read, run
from project import ROOT

#: Tolerance of the iterations: far below what is compared.
TIGHT = 1e-12


def read_reference(name):
    """A reference solution: sector, contact, loads and the response of the annulus."""
    (path,) = (ROOT / "test" / "reference").glob(f"cyclic_{name}_*.json")
    return json.loads(path.read_text())


def term_keys(waves):
    """Loads of any harmonic, complex amplitudes of the dofs by harmonic, as keys of &load."""
    terms = [(dof + 1, n, force) for n, forces in waves.items()
             for dof, force in enumerate(np.asarray(forces)) if force != 0.0]
    return {"n_terms": len(terms), "term_dof": [t[0] for t in terms],
            "term_harmonic": [t[1] for t in terms],
            "term_amplitude": [float(abs(t[2])) for t in terms],
            "term_phase": [float(np.degrees(np.angle(t[2]))) for t in terms]}


def model_groups(case):
    """Groups of the structure, its contact, springs and loads, of a sector or not."""
    model, contact = case["model"], case.get("contact", {})
    n = len(model["mass"])
    groups = {
        "model": {"n_dof": n, "mass": model["mass"], "stiffness": model["stiffness"],
                  "damping": model["damping"],
                  "modal_damping": model.get("modal_damping", 0.0)},
        "load": case["load"] | (term_keys(case["waves"]) if "waves" in case else {})}
    if case.get("n_sectors"):
        groups["cyclic"] = {"n_sectors": case["n_sectors"], "engine_order": case["engine_order"]}
        if case.get("mistuned"):
            groups["cyclic"]["mistuned"] = True
        if model.get("left"):
            groups["cyclic"] |= {"n_interface": len(model["left"]), "left": model["left"],
                                 "right": model["right"]}
    if contact:
        groups["contact"] = {"n_pairs": len(contact["side_1"]), "law": case["law"], **contact}
    if case.get("spring"):
        springs = case["spring"]
        groups["spring"] = {"n_springs": len(springs)} | {
            key: [spring[key] for spring in springs] for key in springs[0]}
    return groups


def run_at(folder, case, omegas, *, n_harmonics=None, sampling="events", n_time=0, solver=None,
           analysis="frf", others=None, status=0):
    """Run a case at some frequencies; datasets of the result by name, attributes beside them.

    With status (0, 4) points may have failed; the caller looks at them.
    """
    groups = model_groups(case)
    groups["case"] = {"analysis": analysis}
    groups["harmonics"] = {"n_harmonics": n_harmonics or case["n_harmonics"],
                           "sampling": sampling, "n_time": n_time}
    if analysis == "frf":
        groups["sweep"] = {"values": list(omegas)}
    elif analysis != "modes":
        groups["sweep"] = {"start": omegas[0]}
    groups["solver"] = {"tolerance": TIGHT, **(solver or {})}
    for group, keys in (others or {}).items():
        groups[group] = {**groups.get(group, {}), **keys}
    run(folder, groups, status=status, seconds=120.0)
    return read(folder / "case.h5")


def difference(found, expected):
    """Largest difference over the largest coefficient."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape, (found.shape, expected.shape)
    return np.abs(found - expected).max() / np.abs(expected).max()
