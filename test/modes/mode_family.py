"""Nonlinear modes of random structures and travelling waves, into docs/robustness.md.

    python test/modes/mode_family.py [--count 200] [--seed 0] [-o docs/robustness.md]

1 to 6 pairs of every law that sticks, in one tangential direction or two, pressed together by
interferences and static loads; every other case is a wave around 5 to 12 sectors. Judges share no
code with the program: equilibrium of the whole annulus in every harmonic, (K - theta M + i n omega
C) U + contact = static load; the work of all forces over a cycle; the stuck motion below the onset
and another one above; and the same curve with twice as many points.
"""
import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / place) for place in ("support", "cyclic")]
import numpy as np  # noqa: E402
from annulus import Annulus, random_case  # noqa: E402
from cases import merged, run  # noqa: E402
from cyclic_cases import model_groups  # noqa: E402
from mode_cases import read_mode  # noqa: E402
from sections import write_section  # noqa: E402
from wave_balance import unbalanced, work_error  # noqa: E402

#: Forces over the largest elastic one; work over the largest term; frequencies of one curve.
FORCE, WORK, SAME = 1e-7, 1e-6, 1e-6
#: Points of a curve, and amplitudes over the onset where it has begun and where it has not.
N_POINTS, ABOVE, BELOW = 21, 1.05, 0.999
LAWS = ("penalty", "dlft", "dlft_velocity", "rigid")


def draw(seed):
    """A sector or, of one sector alone, a plain structure; its groups without a mode."""
    rng = np.random.default_rng(seed)
    law = LAWS[seed // 2 % len(LAWS)]
    planar = law != "rigid" and bool(rng.random() < 0.3)
    wave = seed % 2 == 1
    n_pairs = int(rng.integers(1, 3 if wave else 7))
    case = random_case(rng, law=law, planar=planar, n_pairs=n_pairs,
                       n_sectors=None if wave else 1, engine_order=None if wave else 0)
    for key in ("cosine", "sine"):
        case["load"][key] = [0.0] * len(case["load"][key])
    ring = Annulus(case)
    groups = model_groups(case) if wave else model_groups(ring.case)
    if not wave:
        case = case | {"model": case["model"]}
    size = len(case["model"]["mass"]) if wave else groups["model"]["n_dof"]
    return case, ring, merged(groups, {
        "case": {"analysis": "mode"}, "harmonics": {"n_harmonics": int(rng.choice([1, 3, 5]))},
        "mode": {"start": 0.02, "end": 1.0, "control": "modal", "continuation": "natural"},
        "output": {"observe": list(range(1, size + 1))}, "solver": {"tolerance": 1e-11}})


def follow(folder, groups, n_points):
    done = run(folder, merged(groups, {"mode": {"n_points": n_points}}), status=(0, 3, 4),
               seconds=300)
    return None if done.returncode == 3 else read_mode(folder)


def judge(folder, seed):
    """Counts of words."""
    case, ring, groups = draw(seed)
    found, law = Counter(cases=1), case["law"]
    curve = follow(folder, groups, N_POINTS)
    if curve is None:
        found["refused"] += 1
        return law, found
    rows = np.flatnonzero(curve["converged"])
    found["rows"] += len(rows)
    found["ended"] += int(curve["mode/modal_amplitude"][-1] < 0.999)
    for k in rows:
        found["unbalanced"] += int(unbalanced(ring, case, curve, k) > FORCE)
        found["work"] += int(work_error(ring, case, curve, k) > WORK)
    found["onset"] += wrong_onset(curve, rows)
    finer = follow(folder, groups, 2 * N_POINTS - 1)
    for k in rows:
        a = curve["mode/modal_amplitude"][k]
        same = np.flatnonzero((np.abs(finer["mode/modal_amplitude"] / a - 1) < 1e-9)
                              & finer["converged"].astype(bool))
        if len(same):
            found["compared"] += 1
            j = same[0]
            apart = max(abs(finer["omega"][j] / curve["omega"][k] - 1),
                        abs(finer["mode/damping_ratio"][j] - curve["mode/damping_ratio"][k]))
            found["jumps"] += int(apart > SAME)
    return law, found


def wrong_onset(curve, rows):
    """Rows below the onset that are not the stuck motion, and above that are."""
    attributes = curve["attributes of mode"]
    onset, wrong = attributes["onset_amplitude"], 0
    if not onset > 0.0 and not np.isnan(onset):
        return 0
    for k in rows:
        a = curve["mode/modal_amplitude"][k]
        is_stuck = (abs(curve["omega"][k] / attributes["stuck_omega"] - 1) < 1e-9 and abs(
            curve["mode/damping_ratio"][k] - attributes["stuck_damping_ratio"]) < 1e-9)
        if np.isnan(onset) or a < BELOW * onset:
            wrong += not is_stuck
        elif a > ABOVE * onset:
            wrong += is_stuck
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", dest="document", type=Path)
    options = parser.parse_args()
    laws = {}
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.seed, options.seed + options.count):
            law, found = judge(Path(name), seed)
            laws.setdefault(law, Counter()).update(found)
            if found["unbalanced"] + found["work"] + found["onset"] + found["jumps"]:
                print(f"seed {seed}: {law}, {dict(found)}", flush=True)
    lines = [f"{options.count} cases (seeds {options.seed} to {options.seed + options.count - 1}).",
             "", "| law | cases | refused | rows | out of balance | work off | wrong side of the "
             "onset | compared with finer steps | another curve | ended early, in words |",
             "|---|---|---|---|---|---|---|---|---|---|"]
    for law in sorted(laws):
        found = laws[law]
        lines.append("| " + " | ".join([f"`{law}`", *(str(found[key]) for key in (
            "cases", "refused", "rows", "unbalanced", "work", "onset", "compared", "jumps",
            "ended"))]) + " |")
    print("\n".join(lines))
    if options.document:
        write_section("modes", lines, options.document)
    return int(any(found["unbalanced"] + found["work"] for found in laws.values()))


if __name__ == "__main__":
    sys.exit(main())
