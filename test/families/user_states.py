"""Laws of a user that remember, in C, against the same steps in Python."""
import shutil
import subprocess
from pathlib import Path

import h5py
import joints
import numpy as np
from project import ROOT

TITLE = "Laws of a user with states: the same steps"
TEXT = """
Chains of one to six masses with one to four elements whose laws are steps in C, between masses or
to the ground: sliders on springs, elements that relax (a tenth to ten periods), and sliders whose
limit follows a second state; slopes given or by differences. Loads over four decades, a static load
in a third; 1 to 15 harmonics, 256 instants, one frequency from half to 2.5 times the lowest one
without the elements.

The judge takes the displacements of the result and marches each law anew at these instants, from
the unstrained element, turn after turn until it repeats. The forces of the result have to be those
within 1e-6 of the largest, the balance of every harmonic with the forces of the judge has to hold
to 1e-6 of the load, and so has the work per cycle.
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 5)
COLUMNS = {"solved": "solved", "failed": "ended in words", "static": "with a static load",
           "balance": "balance off", "force": "forces off", "work": "work off"}
ZERO = ("balance", "force", "work")
ALSO = [Path(joints.__file__)]
INSTANTS, TURNS, WITHIN = 256, 4000, 1e-6

SOURCE = r"""
#include <math.h>
#include "fretwear.h"
const int fw_law_interface = 1;
#define LAW(NAME) int NAME(void *user, const fw_law_call *call, const double *z, double *w, \
   double *force, double *dstate, double *dforce)

static void slide(double k, double limit, double u, double z, double *w, double *force, int *sticks)
{
   const double trial = k * (u - z);
   *sticks = fabs(trial) <= limit;
   *w = *sticks ? z : u - copysign(limit / k, trial);
   *force = k * (u - *w);
}
const int slider_states = 1;
LAW(slider)
{
   const double *p = call->parameters;
   int sticks;
   slide(p[0], p[1], call->u[1], z[0], w, force, &sticks);
   if (!call->wants_derivative) return 0;
   dstate[0] = sticks; dstate[3] = !sticks;
   dforce[0] = -p[0]; dforce[1] = p[0];
   return 0;
}
const int relaxing_states = 1;
LAW(relaxing)
{
   const double *p = call->parameters;
   const double a = exp(-(call->tau[1] - call->tau[0]) / call->omega / p[1]);
   w[0] = a * z[0] + 0.5 * (1.0 - a) * (call->u[0] + call->u[1]);
   force[0] = p[0] * (call->u[1] - w[0]);
   if (!call->wants_derivative) return 0;
   dstate[0] = a; dstate[1] = dstate[3] = 0.5 * (1.0 - a);
   dforce[0] = -p[0]; dforce[1] = p[0];
   return 0;
}
const int both_states = 2;
LAW(both)
{
   const double *p = call->parameters;
   int sticks;
   w[1] = 0.9 * z[1] + 0.1 * call->u[1];
   slide(p[0], p[1] * (1.0 + 0.3 * tanh(w[1])), call->u[1], z[0], w, force, &sticks);
   return 0;
}
"""


def march(element, u, omega):
    """Forces over the period that repeats (n_time,), or none where it does not."""
    k, other = element["parameters"]
    z, w = 0.0, 0.0
    n = len(u)
    a = np.exp(-2.0 * np.pi / n / omega / other)
    force = np.zeros(n)

    def step(before, now):
        nonlocal z, w
        if element["symbol"] == "relaxing":
            z = a * z + 0.5 * (1.0 - a) * (before + now)
        else:
            limit = other
            if element["symbol"] == "both":
                w = 0.9 * w + 0.1 * now
                limit *= 1.0 + 0.3 * np.tanh(w)
            if abs(k * (now - z)) > limit:
                z = now - np.copysign(limit / k, k * (now - z))
        return k * (now - z)

    step(0.0, u[-1])
    for _ in range(TURNS):
        start = np.array([z, w])
        for i in range(n):
            force[i] = step(u[i - 1], u[i])
        if np.abs([z, w] - start).max() <= 1e-11 * np.abs(u).max():
            return force
    return None


def drawn(seed):
    case = joints.drawn(seed, lambda random: {})
    random = np.random.default_rng([seed, 1])
    for joint in case["joints"]:
        joint["symbol"] = str(random.choice(["slider", "relaxing", "both"]))
        period = 2.0 * np.pi / case["omega"]
        joint["parameters"] = [joint["stiffness"], joint["limit"]]
        if joint["symbol"] == "relaxing":
            joint["parameters"][1] = period * 10.0**random.uniform(-1.0, 1.0)
    case["given"] = bool(random.random() < 0.5) and all(
        joint["symbol"] != "both" for joint in case["joints"])
    return case


def text(case):
    lines = joints.text(case, "penalty", ()).splitlines()
    first = lines.index("&contact")
    last = lines.index("/", first)
    own = case["joints"]
    lines[first:last] = [
        "&user", f"n_elements = {len(own)}", "library = 'laws.so'",
        "symbol = " + ", ".join(f"'{j['symbol']}'" for j in own),
        "side_1 = " + ", ".join(str(j["dof"]) for j in own),
        "side_2 = " + ", ".join(str(j["other"]) for j in own), "n_parameters = 2",
        "parameters = " + ", ".join(repr(float(p)) for j in own for p in j["parameters"]),
        f"derivative = '{'given' if case['given'] else 'difference'}'"]
    at = lines.index("parity = 'all'")
    lines.insert(at, f"n_time = {INSTANTS}")
    return "\n".join(lines) + "\n"


def trial(seed, program, folder):
    case = drawn(seed)
    (folder / "laws.c").write_text(SOURCE)
    subprocess.run([shutil.which("cc") or "cc", "-O1", "-shared", "-fPIC", "-I",
                    str(ROOT / "include"), "-o", "laws.so", "laws.c", "-lm"], cwd=folder,
                   check=True)
    (folder / "case.nml").write_text(text(case))
    done = subprocess.run([program, "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    found = dict.fromkeys(COLUMNS, 0) | {"kind": "slopes given" if case["given"] else "differences"}
    if done.returncode == 4:
        assert done.stderr.strip()
        return {**found, "failed": 1}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u, force = file["coefficients"][0], file["user/force"][0]
        work = file["user/work"][0]
    base, slopes = joints.waves(case["harmonics"], 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS)
    own = np.zeros_like(force)
    for i, joint in enumerate(case["joints"]):
        e = joints.elongation(joint, u)
        values = march(joint, e @ base, case["omega"])
        if values is None:
            found["force"] = 1
            continue
        own[:, i, 0] = joints.projected(values, base)
        largest = np.abs(values).max()
        found["force"] |= int(np.abs(own[:, i] - force[:, i]).max() > WITHIN * largest)
        done_work = 2.0 * np.pi * np.mean(values * (e @ slopes))
        found["work"] |= int(abs(done_work - work[i]) > WITHIN * largest * np.ptp(e @ base) * 4.0)
    load = np.linalg.norm([case["cosine"], case["sine"], case["static"]])
    return {**found, "solved": 1, "static": int(np.any(case["static"])),
            "balance": int(joints.balance_of(case, u, own) > WITHIN * load)}
