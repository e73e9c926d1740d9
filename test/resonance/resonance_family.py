"""Resonances of random cases followed over a random parameter, into docs/robustness.md.

    python test/resonance/resonance_family.py [--count 200] [--seed 0] [-o docs/robustness.md]

Three judges: a fine sweep at the first value has no larger point than the first resonance; the
maximum of responses that are solved one by one around the middle resonance, by the polynomial
through them, is that resonance; and its derivative by the parameter is the slope of the track.
Where two slopes of the track disagree, it has a corner (a pair begins to slip there), and the
derivative is not judged.
"""
import argparse
import sys
import tempfile
from collections import Counter
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "oracles"))
import h5py
import numpy as np
from cases import merged, run
from sections import write_section
from sensitivity_family import random_case

#: Amplitudes, frequencies over the width of the peak, and derivatives of amplitude and frequency
#: relative to the amplitude and to the frequency.
SAME, PLACE, SLOPE = 1e-5, 1e-2, 1e-5
#: Relative steps of the parameter on either side of the middle value, and where the two slopes
#: that they give agree.
STEP, SMOOTH = 2e-3, 2e-6
#: Frequencies around the resonance, over the width of the peak, and the degree through them.
PLACES, DEGREE = np.linspace(-0.03, 0.03, 9), 5
#: Shares of that window, and how far responses with a fold between them are from the polynomial.
SCALES, ROUGH = (1.0, 0.1, 0.01), 1e-6
#: Points of the fine sweep, and on the ways to the resonance.
FINE, WAYS = 600, (60, 8)


def track_case(seed):
    """A random case with its sweep and the parameter that it is followed over."""
    groups, parameters = random_case(seed)
    rng = np.random.default_rng(10_000 + seed)
    model = groups["model"]
    size = model["n_dof"]
    mass, stiffness = (np.reshape(model[key], (size, size)) for key in ("mass", "stiffness"))
    first = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real.min())
    parameter = str(rng.choice(parameters))
    return merged(groups, {
        "case": {"analysis": "resonance"},
        "sweep": {"start": float(0.5 * first), "end": float(2.5 * first), "n_points": 120},
        "resonance": {"parameter": parameter, "as": "factor", "start": 1.0 - 2.0 * STEP,
                      "end": 1.0 + 2.0 * STEP, "n_points": 5},
        "sensitivity": {"parameters": [parameter], "quantities": ["first_harmonic"]}}), parameter


def respond(folder, groups, omegas):
    """First harmonics at some frequencies; NaN where there is no solution."""
    run(folder, merged(groups, {
        "case": {"analysis": "frf"}, "resonance": dict.fromkeys(groups["resonance"]),
        "sensitivity": dict.fromkeys(groups["sensitivity"]),
        "sweep": {"values": list(omegas), "start": None, "end": None, "n_points": None}}),
        name="responses", status=(0, 4), seconds=300)
    with h5py.File(folder / "responses.h5") as file:
        values = np.hypot(*file["coefficients"][:, 1:3, 0].T)
        return np.where(file["converged"][()], values, np.nan)


def top_near(folder, groups, value, omega, width):
    """Place [widths] and value of the maximum about omega, and whether a fold is beside it.

    Where the response has several branches at omega, the way to it decides which one is met, so
    both ends of the sweep lead there, in small steps and in large ones: the nearest to `value`
    counts. A branch that folds beside its maximum ends within the window, which then narrows;
    where it stays so, the largest response is compared. None where no response was found.
    """
    best = None
    for scale, side, way in product(SCALES, ("start", "end"), WAYS):
        places = scale * (PLACES if side == "start" else PLACES[::-1])
        path = np.linspace(groups["sweep"][side], omega + width * places[0], way)
        around = respond(folder, groups, np.append(path[:-1], omega + width * places))[way - 1:]
        if not np.isfinite(around).all():
            continue
        fit = np.polynomial.Polynomial.fit(places, around, DEGREE)
        folded = bool(np.abs(fit(places) - around).max() > ROUGH * value)
        if folded:
            place, top = places[around.argmax()], around.max()
        else:
            place = min(fit.deriv().roots(), key=abs).real
            top = fit(place)
        if best is None or abs(top - value) < abs(best[1] - value):
            best = place, top, folded
        if not folded and abs(top - value) <= SAME * value:
            break
    return best


def judge(folder, seed):
    """Counts of words, and the worst errors of amplitude and derivative."""
    groups, parameter = track_case(seed)
    found, law = Counter(cases=1), groups["contact"]["law"]
    if run(folder, groups, status=(0, 4), seconds=300).returncode:
        found["without"] += 1
        return law, found, (0.0, 0.0)
    with h5py.File(folder / "case.h5") as file:
        omega, value = file["omega"][()], file["resonance/first_harmonic"][()]
        curvature = file["resonance/curvature"][2]
        name = parameter.replace("%", "_")
        own = file[f"sensitivity/value/{name}"][2]
        slopes = np.array([np.sum(own * np.reshape(file[f"sensitivity/{of}/{name}"][2], own.shape))
                           for of in ("first_harmonic", "resonance_omega")])
    width = np.sqrt(-value[2] / curvature)
    sweep = respond(folder, shifted(groups, parameter, 1.0 - 2.0 * STEP), np.linspace(
        groups["sweep"]["start"], groups["sweep"]["end"], FINE))
    if np.nanmax(sweep) > value[0] * (1.0 + SAME):
        found["smaller"] += 1
    error = [0.0, 0.0]
    near = top_near(folder, groups, value[2], omega[2], width)
    if near:
        place, top, folded = near
        error[0] = abs(top / value[2] - 1.0)
        found["amplitudes"] += 1
        found["folded"] += int(folded)
        found["off"] += int(error[0] > SAME or abs(place) > PLACE)
    # Two slopes of the track, of second order with one and two steps, and of fourth order.
    rows = np.array([value, omega])
    near, far = (rows[:, 3] - rows[:, 1]) / (2 * STEP), (rows[:, 4] - rows[:, 0]) / (4 * STEP)
    best = (4.0 * near - far) / 3.0
    size = np.array([value[2], omega[2]])
    for k in range(2):
        # The difference of the two is four thirds of the error of the second order.
        if abs(near[k] - far[k]) > 30.0 * SMOOTH * size[k] + 3e-2 * STEP * abs(best[k]):
            found["corner"] += 1
            continue
        error[1] = max(error[1], abs(slopes[k] - best[k]) / size[k])
        found["slopes"] += 1
        found["slopes off"] += int(abs(slopes[k] - best[k]) > SLOPE * size[k])
    return law, found, tuple(error)


def shifted(groups, parameter, factor):
    """The case with all values of a parameter multiplied."""
    group, key = parameter.split("%")
    value = groups[group][key]
    value = [factor * v for v in value] if isinstance(value, list) else factor * value
    return merged(groups, {group: {key: value}})


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", dest="document", type=Path)
    options = parser.parse_args()
    laws, worst = {}, {}
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.seed, options.seed + options.count):
            law, found, error = judge(Path(name), seed)
            laws.setdefault(law, Counter()).update(found)
            worst[law] = np.maximum(worst.get(law, 0.0), error)
            if found["off"] or found["slopes off"] or found["smaller"]:
                print(f"seed {seed}: {law}, {dict(found)}, {error}", flush=True)
    lines = [f"{options.count} cases (seeds {options.seed} to {options.seed + options.count - 1}).",
             "", "| law | cases | amplitudes judged | off | worst error | not the largest | "
             "slopes judged | off | worst error | at a corner | without a resonance |",
             "|---|---|---|---|---|---|---|---|---|---|---|"]
    for law in sorted(laws):
        found = laws[law]
        lines.append(f"| `{law}` | {found['cases']} | {found['amplitudes']} | {found['off']} | "
                     f"{worst[law][0]:.1e} | {found['smaller']} | {found['slopes']} | "
                     f"{found['slopes off']} | {worst[law][1]:.1e} | {found['corner']} | "
                     f"{found['without']} |")
    print("\n".join(lines))
    if options.document:
        write_section("resonances", lines, options.document)
    return int(any(found["off"] + found["slopes off"] for found in laws.values()))


if __name__ == "__main__":
    sys.exit(main())
