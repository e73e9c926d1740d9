"""Steady states of random scars against a march of cycles: docs/robustness.md.

    python test/fretting/steady_states.py [--count 100] [--seed 0] [--before OTHER/fw_run]
                                          [-o docs/robustness.md]
"""
import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import h5py
import numpy as np
from cases import run
from project import PROGRAM
from scar_cases import Scar, groups, marched, write_model
from sections import write_section

#: A profile is right within this part of its largest depth, and of its volume: steps of a fiftieth
#: of the depth are good to 1 %, and the judge to half of that.
RIGHT = 0.03
#: Remarks that say that a steady state may be another one.
NAMES = {"too few harmonics", "slip begins", "steps too long", "steady state not confirmed"}
WORDS = ("right", "right, with a remark", "wrong, with a remark", "wrong without a word",
         "not reached")


def random_scar(seed):
    """A cylinder, and how it is computed: harmonics and keys of &wear, the step as a part of the
    largest depth (0: left out)."""
    rng = np.random.default_rng(seed)
    modulus, radius = 10.0 ** rng.uniform(4.7, 5.3), 10.0 ** rng.uniform(0.0, 1.3)
    load, mu = 10.0 ** rng.uniform(0.7, 1.7), float(rng.uniform(0.3, 1.0))
    share = float(rng.uniform(0.35, 0.8))
    width = np.sqrt(4.0 * load * radius / (np.pi * modulus))
    n = int(rng.integers(16, 49))
    # Beyond the rim of the scar, which spreads as the stick zone shrinks.
    cell = 2.0 * width * (1.05 + share) / n
    scar = Scar(n, float(cell), float(modulus), float(radius), float(load), mu,
                share * mu * float(load))
    scheme = str(rng.choice(["implicit", "implicit", "pseudo_time", "explicit"]))
    step = float(rng.choice([0.0, 1 / 6, 1 / 12, 1 / 25, 1 / 50]))
    return scar, int(rng.choice([1, 3, 5])), scheme, step


def verdict(folder, scar, n_harmonics, scheme, step, true, program):
    """One of WORDS."""
    wear = {"scheme": scheme}
    if step > 0.0:
        wear["max_depth_step"] = step * float(true.max())
    write_model(folder / "model.h5", scar)
    run(folder, groups(scar, n_harmonics, **wear), status=(0, 4), program=program, seconds=600)
    with h5py.File(folder / "case.h5") as file:
        depth = file["wear/depth"][-1]
        reached = file["wear"].attrs["steady_state"] in ("reached", b"reached")
        names = file["remarks/name"][:] if "remarks" in file else []
    known = {x.decode() if isinstance(x, bytes) else str(x) for x in names}
    remark = bool(known & NAMES)
    if not reached:
        return WORDS[4]
    right = (abs(depth - true).max() <= RIGHT * true.max()
             and abs(depth.sum() / true.sum() - 1.0) <= RIGHT)
    if right:
        return WORDS[1] if remark else WORDS[0]
    return WORDS[2] if remark else WORDS[3]


def count(seeds, programs):
    """Verdicts by scheme and program."""
    counts = Counter()
    with tempfile.TemporaryDirectory() as name:
        for seed in seeds:
            scar, n_harmonics, scheme, step = random_scar(seed)
            true = marched(scar)
            for label, program in programs.items():
                word = verdict(Path(name), scar, n_harmonics, scheme, step, true, program)
                counts[scheme, label, word] += 1
                if word == WORDS[3]:
                    print(f"seed {seed}, {label}: {word}", file=sys.stderr)
    return counts


def table(counts, programs):
    """Rows of the document."""
    lines = ["", "| scheme | program | " + " | ".join(WORDS) + " |",
             "|---|---|" + "---|" * len(WORDS)]
    for scheme in sorted({key[0] for key in counts}):
        for label in programs:
            cells = [counts[scheme, label, word] for word in WORDS]
            lines.append(f"| {scheme} | {label} | " + " | ".join(map(str, cells)) + " |")
    return [*lines, ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0, help="the first")
    parser.add_argument("--before", help="program to compare with")
    parser.add_argument("-o", "--output", type=Path, help="document with the section `scars`")
    options = parser.parse_args()
    programs = {"now": PROGRAM} | ({"before": options.before} if options.before else {})
    lines = table(count(range(options.seed, options.seed + options.count), programs), programs)
    print("\n".join(lines))
    if options.output:
        write_section("scars", lines, options.output)


if __name__ == "__main__":
    main()
