"""The families of the stress suite: each takes one property of a case to its extremes."""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from stress_models import Joint, frequencies, interface, slider, stop

SOLVERS = {
    "newton": {"kind": "newton", "linear": "lu"},
    "newton, krylov": {"kind": "newton", "linear": "krylov"},
    "powell": {"kind": "powell"},
    "kinsol": {"kind": "kinsol"},
    "pseudo_time": {"kind": "pseudo_time"},
}


@dataclass
class Case:
    """One run: a joint, how it is solved, and where."""

    family: str
    name: str
    solver: str
    joint: Joint
    law: str
    omegas: tuple
    n_harmonics: int
    n_time: int
    penalty_scale: float
    groups: dict = field(default_factory=dict)

    @property
    def first_omega(self):
        return self.omegas[0]

    @property
    def title(self):
        return f"{self.family}: {self.name}, {self.law}, {self.solver}"


def make(family, name, joint, solver="newton", law="dlft", omegas=0.6, n_harmonics=3, n_time=128,
         penalty_scale=1.0, **groups):
    """A case; omegas is one frequency, or (start, end, number of points) [rad/s]."""
    omegas = tuple(np.linspace(*omegas)) if isinstance(omegas, tuple) else (float(omegas),)
    sweep = {"start": omegas[0]}
    if len(omegas) > 1:
        sweep |= {"end": omegas[-1], "n_points": len(omegas)}
    settings = {
        "case": {"analysis": "frf" if len(omegas) > 1 else "point", "threads": 1},
        "harmonics": {"n_harmonics": n_harmonics, "n_time": n_time, **groups.pop("harmonics", {})},
        "sweep": sweep,
        "solver": SOLVERS[solver], **groups}
    return Case(family, name, solver, joint, law, omegas, n_harmonics, n_time, penalty_scale,
                settings)


def every(family, name, joint, laws=("dlft", "penalty"), solvers=tuple(SOLVERS), **keys):
    """The case with every law and solver."""
    return [make(family, name, joint, solver, law, **keys) for law in laws for solver in solvers]


def friction():
    for mu in (0.0, 1e-6, 1e-3, 0.1, 0.4, 1.0, 3.0, 10.0):
        yield from every("friction", f"mu = {mu:g}", interface(2).with_(mu=mu))


def penalty():
    for scale in np.logspace(-3, 3, 7):
        yield from every("eps", f"scale {scale:g}", interface(2, seed=3), laws=("dlft",),
                         penalty_scale=float(scale))


def preload():
    for ratio in (-1.0, -0.1, 0.0, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6):
        yield from every("preload", f"{ratio:g} times the load", interface(2, preload=ratio))


def gap():
    for width in (-1e3, -1.0, -1e-3, 0.0, 1e-9, 0.1, 0.5, 0.9, 10.0):
        yield from every("gap", f"stop at {width:g}", stop(gap=width), omegas=0.8, n_harmonics=7,
                         n_time=256)
        yield from every("gap", f"interface at {width:g}", interface(2).with_(gap=width),
                         solvers=("newton", "kinsol"))


def separation():
    for pull in (0.2, 0.6, 1.0, 1.2, 1.4, 1.5):
        yield from every("separation", f"pulled off by {pull:g}",
                         stop(gap=0.0, preload=-pull), omegas=0.7, n_harmonics=9, n_time=512)
        yield from every("separation", f"interface pulled off by {pull:g}",
                         interface(2, preload=-0.3 * pull), solvers=("newton", "kinsol"))


def masses():
    for ratio in (0.0, 1e-12, 1e-6, 1e-3, 0.1, 1.0):
        yield from every("masses", f"contact nodes {ratio:g}", interface(1, massive=ratio),
                         laws=("dlft", "dlft_velocity", "penalty"))
    for ratio in (1e-9, 1e-4, 1e4, 1e9):
        joint = interface(2)
        mass = joint.mass.copy()
        mass[:3, :3] *= ratio
        yield from every("masses", f"first mass times {ratio:g}", joint.with_(mass=mass))


def contrast():
    for ratio in (1e3, 1e6, 1e9, 1e12):
        for which in ("chain", "nodes"):
            joint = interface(2)
            n = joint.n_dof
            scale = np.ones(n)
            part = slice(0, 3) if which == "chain" else slice(9, None)
            # Springs to the ground: those between dofs would only make rigid links.
            stiffness = joint.stiffness.copy()
            scale[part] = ratio
            stiffness[np.diag_indices(n)] *= scale
            yield from every("contrast", f"{which} {ratio:g} times stiffer",
                             joint.with_(stiffness=stiffness, damping=0.02 * joint.stiffness))
        stiff = interface(2).with_(contact_stiffness=ratio)
        yield from every("contrast", f"contact {ratio:g} times stiffer", stiff, laws=("penalty",))


def damping():
    for ratio in (0.0, 1e-9, 1e-6, 1e-3, 0.01, 0.1, 1.0):
        joint = interface(2, loss=0.0).with_(modal_damping=ratio)
        for k, near in ((0, 1.02), (4, 0.97)):
            yield from every("damping", f"ratio {ratio:g} near mode {k + 1}", joint,
                             omegas=near * frequencies(joint)[k])


def resonance():
    joint = interface(2, loss=0.0)
    for k, omega in enumerate(frequencies(joint)):
        yield from every("resonance", f"mode {k + 1} of the open structure", joint, omegas=omega)
        pulled = interface(2, loss=0.0, preload=-1e3)
        yield from every("resonance", f"mode {k + 1}, contact pulled open", pulled, omegas=omega)
        free = joint.with_(side_1=np.zeros((0, 3), int))
        yield from every("resonance", f"mode {k + 1}, no contact", free, omegas=omega)
        yield from every("resonance", f"a third of mode {k + 1}", joint, omegas=omega / 3,
                         solvers=("newton", "pseudo_time"))
    # Friction limits the resonance of an undamped slider only below 4/pi mu N.
    for load in (0.1, 1.0, 1.9, 2.0, 10.0):
        yield from every("resonance", f"slider with mu N = {0.4 * load:g}",
                         slider(load, damping=0.0), omegas=1.0, n_harmonics=5,
                         laws=("dlft", "dlft_velocity", "penalty"))


def frequency():
    last = frequencies(interface(2))[-1]
    for ratio in (1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6):
        yield from every("frequency", f"{ratio:g} times the last mode", interface(2),
                         omegas=ratio * last)


def harmonics():
    for h in (1, 2, 3, 7, 15, 31, 63, 101):
        n_time = max(64, 8 * h)
        small = tuple(SOLVERS) if h <= 31 else ("newton", "newton, krylov", "kinsol")
        yield from every("harmonics", f"H = {h}", interface(1), n_harmonics=h, n_time=n_time,
                         solvers=small)
        yield from every("harmonics", f"H = {h}, slider", slider(), n_harmonics=h, n_time=n_time,
                         laws=("dlft", "dlft_velocity"), solvers=small)
        if h > 31:
            continue
        lifting = interface(1, massive=0.5, preload=0.1)
        yield from every("harmonics", f"H = {h}, lift-off with mass", lifting, n_harmonics=h,
                         n_time=n_time, solvers=("newton", "kinsol", "pseudo_time"))


def instants():
    for h in (1, 5):
        for n_time in (2 * h + 1, 2 * h + 2, 6 * h + 3, 100, 1001, 8192):
            for method in ("hbm", "tcm", "tcm_least_squares", "hdhb"):
                if (method == "hdhb") != (n_time == 2 * h + 1) and method == "hdhb":
                    continue
                yield from every("instants", f"H = {h}, {n_time} instants, {method}", interface(2),
                                 n_harmonics=h, n_time=n_time, harmonics={"method": method},
                                 solvers=("newton", "powell", "kinsol"))


#: Units over those of the reference: length, mass, time.
UNITS = {"mm-tonne": (1e3, 1e-3, 1.0), "lengths 1e6": (1e6, 1.0, 1.0),
         "lengths 1e-6": (1e-6, 1.0, 1.0), "masses 1e6": (1.0, 1e6, 1.0),
         "masses 1e-6": (1.0, 1e-6, 1.0), "times 1e6": (1.0, 1.0, 1e6),
         "times 1e-6": (1.0, 1.0, 1e-6)}


def units_groups():
    """Groups of cases that have to give one and the same answer: (units, case)."""
    models = {"sliding": interface(2, preload=0.5), "lifting": interface(2, preload=0.05),
              "undamped": interface(2, loss=0.0, preload=0.5),
              "heavy": interface(2, massive=0.3), "gap": interface(2).with_(gap=0.3)}
    for name, joint in models.items():
        for law in ("dlft", "penalty"):
            for solver in SOLVERS:
                group = []
                for label, unit in {"SI": (1.0, 1.0, 1.0), **UNITS}.items():
                    case = make("units", f"{name}, {label}", joint.in_units(*unit), solver, law,
                                omegas=0.7 / unit[2])
                    group.append((unit, case))
                yield group


def random_models():
    for n_pairs in (1, 2, 5, 10, 20, 50, 100, 200):
        for seed in range(6 if n_pairs <= 20 else 2):
            rng = np.random.default_rng([n_pairs, seed])
            joint = interface(n_pairs, seed=[n_pairs, seed], directions=int(rng.integers(1, 3)),
                              preload=10.0 ** rng.uniform(-2, 1) / n_pairs,
                              loss=10.0 ** rng.uniform(-4, -1))
            joint = joint.with_(mu=float(rng.uniform(0.05, 1.5)))
            h = 3 if n_pairs <= 20 else 1
            start, end = 0.2, 0.2 + rng.uniform(0.5, 2.0)
            solvers = tuple(SOLVERS) if n_pairs <= 20 else ("newton, krylov", "kinsol")
            yield from every("random", f"{n_pairs} pairs, seed {seed}", joint, n_harmonics=h,
                             n_time=64, omegas=(start, end, 5 if n_pairs <= 20 else 2),
                             solvers=solvers, laws=("dlft", "penalty") if n_pairs <= 20 else
                             ("dlft",))


def wear():
    for scheme in ("explicit", "implicit", "pseudo_time"):
        for step in (1e-2, 1.0, 1e3, 1e9):
            for preload_ratio in (0.3, 3.0):
                case = make("wear", f"{scheme}, steps of {step:g} of the motion, preload "
                            f"{preload_ratio:g}", interface(2, preload=preload_ratio), "newton",
                            wear={"scheme": scheme, "coefficient": 1e-4, "max_depth_step": step,
                                  "max_steps": 100})
                case.groups["case"]["analysis"] = "wear"
                yield case


#: Every family but that of the units, which is compared and not only checked.
FAMILIES = {function.__name__: function for function in (
    friction, penalty, preload, gap, separation, masses, contrast, damping, resonance, frequency,
    harmonics, instants, random_models, wear)}
