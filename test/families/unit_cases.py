"""Random cases of every analysis and law, whose numbers are of the order of one."""
import numpy as np
import scipy.linalg

KINDS = ("frf", "control", "mode", "resonance", "sensitivity", "control branch", "wear", "optimum")
#: Those of seeds from FIRST_LATER on.
LATER, FIRST_LATER = ("residual", "slider", "bounds", "several", "rub", "ringdown"), 96
LAWS = ("penalty", "dlft", "rigid", "regularised", "dlft_velocity")


def drawn_model(random, n):
    springs = random.uniform(0.5, 2.0, n)
    stiffness = np.zeros((n, n))
    for k, spring in enumerate(springs):
        stiffness[k, k] += spring
        if k:
            stiffness[k - 1, k - 1] += spring
            stiffness[k, k - 1] -= spring
            stiffness[k - 1, k] -= spring
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = random.uniform(0.004, 0.03) * stiffness + random.uniform(0.0, 0.02) * mass
    return {"n_dof": n, "mass": mass.ravel(), "stiffness": stiffness.ravel(),
            "damping": damping.ravel()}


def drawn_contact(random, n, law, normal):
    """Pairs on different dofs: one or two tangential directions, pressed or with normal dofs."""
    dofs = [int(dof) for dof in random.permutation(n) + 1]
    rubs = not normal or random.random() < 0.8
    two = rubs and len(dofs) > 1 + normal and random.random() < 0.4
    side = [dofs.pop() if rubs else 0, dofs.pop() if two else 0, dofs.pop() if normal else 0]
    contact = {"n_pairs": 1, "law": law, "side_1": side}
    if rubs:
        contact["mu"] = float(random.uniform(0.2, 1.0))
    if normal:
        contact["gap"] = float(random.uniform(-0.5, 0.3))
    else:
        contact["normal_load"] = float(np.exp(random.uniform(np.log(0.1), np.log(3.0))))
    if law == "penalty" and rubs:
        contact["tangential_stiffness"] = float(random.uniform(0.3, 3.0))
    if law in ("penalty", "regularised") and normal:
        contact["normal_stiffness"] = float(random.uniform(0.3, 3.0))
    if law == "regularised" and rubs:
        contact["slip_speed"] = float(random.uniform(0.01, 0.2))
    return contact


def rub_along_one(contact, random, n):
    """One tangential direction, on a dof that is not the normal one."""
    along = int(random.choice([dof + 1 for dof in range(n) if dof + 1 != contact["side_1"][2]]))
    contact["side_1"] = [along, 0, contact["side_1"][2]]
    contact["mu"] = float(random.uniform(0.2, 1.0))
    if contact["law"] == "penalty":
        contact["tangential_stiffness"] = float(random.uniform(0.3, 3.0))


def asks(random, kind, groups, modes):
    """What is computed of a case."""
    n, static = len(modes), groups["load"]["static"]
    low, high = float(0.7 * modes[0]), float(1.3 * modes[min(n, 2) - 1])
    sweep = {"start": low, "end": high, "n_points": 11}
    size = float(np.exp(random.uniform(np.log(0.1), np.log(5.0))))
    if kind == "frf":
        sweep["continuation"] = str(random.choice(["natural", "arclength"]))
    elif kind == "control":
        sweep["n_points"] = 3
        groups["control"] = {"amplitude": [0.3 * size, size],
                             "of": str(random.choice(["first_harmonic", "largest"]))}
    elif kind == "control branch":
        sweep.update(n_points=9, max_points=60, continuation="arclength")
        groups["control"] = {"amplitude": size}
    elif kind == "sensitivity":
        sweep["n_points"] = 3
        names = [f"{group}%{key}" for group, key in (
            ("load", "harmonic_scale"), ("contact", "mu"), ("contact", "normal_load"),
            ("contact", "gap"), ("contact", "tangential_stiffness"), ("spring", "coefficient"))
            if group == "load" or key in groups.get(group, {})]
        groups["sensitivity"] = {"parameters": names}
    elif kind == "mode":
        groups["case"]["analysis"] = "mode"
        groups["mode"] = {"start": 0.02 * size, "end": 2.0 * size, "n_points": 8,
                          "number": int(random.integers(1, n + 1)),
                          "control": str(random.choice(["observed", "modal"])),
                          "continuation": str(random.choice(["natural", "arclength"]))}
        del groups["load"]["cosine"]
        sweep = None
    elif kind == "resonance":
        groups["case"]["analysis"] = "resonance"
        groups["resonance"] = {"parameter": "load%harmonic_scale", "start": 0.3 * size,
                               "end": 3.0 * size, "n_points": 4,
                               "condition": str(random.choice(["amplitude", "phase"]))}
        sweep.update(end=float(1.3 * modes[0]), n_points=15)
    elif kind == "wear":
        groups["case"]["analysis"] = "wear"
        groups["contact"]["area"] = float(random.uniform(0.2, 2.0))
        groups["wear"] = {"coefficient": 1e-4, "n_cycles": 2000.0, "max_steps": 60}
        static[groups["contact"]["side_1"][2] - 1] = -float(random.uniform(0.2, 1.0))
        sweep = {"start": float(random.uniform(low, high))}
    elif kind == "optimum":
        sweep["n_points"] = 21
    if sweep is not None:
        groups["sweep"] = sweep


def asks_later(random, kind, groups, modes):
    """The same of the later kinds."""
    low, high = float(0.7 * modes[0]), float(1.3 * modes[min(len(modes), 2) - 1])
    contact = groups["contact"]
    groups["sweep"] = {"start": low, "end": high, "n_points": 5}
    if kind in ("residual", "bounds"):
        contact["memory"] = "residual"
    if kind == "residual":
        contact["residual"] = float(random.uniform(-1.0, 1.0))
    elif kind == "slider":
        contact["slider_1"] = float(random.uniform(-0.5, 0.5))
        groups["sensitivity"] = {"parameters": ["contact%slider_1", "contact%mu"]}
    elif kind == "bounds":
        groups["case"]["analysis"] = "bounds"
        groups["bounds"] = {"quantity": str(random.choice(["first_harmonic", "largest"]))}
    elif kind == "several":
        groups["case"]["analysis"] = "point"
        groups["solver"]["n_solutions"] = 3
        groups["sweep"] = {"start": float(random.uniform(low, high))}
    elif kind == "rub":
        contact["speed_1"] = float(random.choice([-1.0, 1.0]) * random.uniform(0.1, 3.0))
        contact["sliding"] = str(random.choice(["path", "steady"]))
        if contact["side_1"][2]:
            contact |= {"n_gap_terms": 1, "gap_harmonic": int(random.integers(1, 4)),
                        "gap_amplitude": float(random.uniform(-0.3, 0.3)), "gap_phase": 40.0}
    elif kind == "ringdown":
        groups["case"]["analysis"] = "ringdown"
        groups["ringdown"] = {"amplitude": float(random.uniform(0.1, 2.0)), "n_cycles": 4,
                              "steps_per_period": 200}
        del groups["load"]["cosine"], groups["sweep"]


def drawn(seed):
    """Kind and groups of a case."""
    random = np.random.default_rng(seed)
    kind = (KINDS[seed % len(KINDS)] if seed < FIRST_LATER
            else LATER[(seed - FIRST_LATER) % len(LATER)])
    law = str(random.choice(LAWS if seed < FIRST_LATER else ("penalty", "dlft")))
    if kind == "mode" and law == "regularised":
        law = "dlft"
    if kind in ("wear", "resonance", "optimum", "sensitivity") and law == "regularised":
        law = "penalty"
    normal = ((bool(random.random() < 0.4) and law != "dlft_velocity")
              or kind in ("wear", "residual", "bounds", "several"))
    n = int(random.integers(1 + normal, 5))
    model = drawn_model(random, n)
    modes = np.sqrt(scipy.linalg.eigvalsh(model["stiffness"].reshape(n, n),
                                          model["mass"].reshape(n, n)))
    cosine, static = np.zeros(n), np.zeros(n)
    cosine[random.integers(n)] = 1.0
    groups = {"case": {"analysis": "frf"}, "model": model,
              "harmonics": {"n_harmonics": int(random.choice([3, 5])), "parity": "auto"},
              "solver": {"tolerance": 1e-10},
              "output": {"observe": int(random.integers(1, n + 1))}}
    if random.random() < 0.8 or kind in ("wear", "optimum", *LATER):
        groups["contact"] = drawn_contact(random, n, law, normal)
        if kind in ("residual", "bounds", "slider", "rub"):
            rub_along_one(groups["contact"], random, n)
        if normal and random.random() < 0.5:
            static[groups["contact"]["side_1"][2] - 1] = -float(random.uniform(0.2, 1.0))
    else:
        groups["spring"] = {"n_springs": 1, "side_1": int(random.integers(1, n + 1)),
                            "coefficient": float(random.uniform(-0.1, 1.0))}
    groups["load"] = {"cosine": cosine, "static": static}
    (asks if seed < FIRST_LATER else asks_later)(random, kind, groups, modes)
    return kind, groups
