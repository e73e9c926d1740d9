"""Wear at 2500 rpm, where nearly every pair wears: the end depends on the path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.common.layout import table
from bench.common.measure import Bench, Floats, Groups
from bench.common.wear_runs import (
    FAST,
    N_PAIRS,
    SLOW,
    WearRun,
    difference,
    run_wear,
    steps_of,
)
from bench.paper.gallery_text import beside, percent, picture
from bench.paper.gallery_wear import draw_profiles

__all__ = ["Path2500", "measure_path", "write_path"]

#: Steps of the largest depth [mm].
STEP, SMALL_STEP, LARGE_STEP = 1e-4, 5e-5, 2e-4
#: Height of the roughness that a start may have [mm].
ROUGHNESS = 1e-4
STANDARD = "steps of 0.1 µm"


@dataclass(frozen=True)
class Path2500:
    """Runs by name, and the profile that each started from [mm]."""

    runs: dict[str, WearRun]
    starts: dict[str, Floats]

    def profile(self, name: str) -> Floats:
        """What is missing from the flanks at the end [mm], the start included."""
        return self.starts[name] + self.runs[name].depth

    def apart(self, name: str) -> float:
        """Largest difference from the standard run, as a part of its largest depth."""
        return difference(self.profile(name), self.profile(STANDARD))

    @property
    def fall(self) -> float:
        """Swing of the tip before wear over that after it, of the standard run."""
        swing = self.runs[STANDARD].swing
        return float(swing[0] / swing[-1])


def measure_path(bench: Bench) -> Path2500:
    """The same joint by several ways."""
    new = np.zeros(N_PAIRS)
    sorts = {STANDARD: (steps_of("implicit", STEP), new),
             "steps of 0.05 µm": (steps_of("implicit", SMALL_STEP), new)}
    if not bench.quick:
        rough = np.random.default_rng(1).uniform(0.0, ROUGHNESS, N_PAIRS)
        before = run_wear(bench, "path_before", steps_of("implicit", SMALL_STEP), FAST)
        sorts |= {
            "steps of 0.2 µm": (steps_of("implicit", LARGE_STEP), new),
            "from rough flanks": (steps_of("implicit", STEP), rough),
            "from flanks worn at 3600 rpm": (steps_of("implicit", STEP), before.depth),
            "pseudo-time": (steps_of("pseudo_time", STEP), new)}
    runs = {}
    for number, (name, (scheme, start)) in enumerate(sorts.items()):
        changes: Groups = {"contact": {"gap": [float(value) for value in start]}}
        if bench.quick:
            changes["harmonics"] = {"n_time": 64}
        runs[name] = run_wear(bench, f"path_{number}", scheme, SLOW, changes)
    return Path2500(runs, {name: start for name, (_, start) in sorts.items()})


def write_path(folder: Path, data: Path2500) -> str:
    """Draw the picture; the text of the part."""
    settled = {name: run for name, run in data.runs.items() if run.is_steady}
    draw_profiles(folder / "wear_2500.png", settled, data.starts)
    return "\n".join([
        "## Wear at 2500 rpm: the end depends on the path", "",
        f"As before, at the lower speed and at {SLOW.resonance:g} Hz, by the implicit scheme "
        f"with several steps, by pseudo-time and from other starts (a roughness of up to "
        f"{1e3 * ROUGHNESS:g} µm; what wear at 3600 rpm leaves). Differences are of what is "
        "missing from the flanks at the end, the start included, as a part of the largest depth "
        f"of the run with {STANDARD}.",
        *picture("wear_2500.png", "depth of every pair at the end of every run"),
        *runs_table(data), "", *beside(*rows_of(data, settled))])


def runs_table(data: Path2500) -> list[str]:
    """Lines of a table: every run."""
    rows = []
    for name, run in data.runs.items():
        before, after = run.swing[[0, -1]]
        end = (percent(data.apart(name)), run.n_worn, f"{1e3 * run.deepest:.3f}",
               f"{before:.3f} to {after:.3f}") if run.is_steady else ("-",) * 4
        rows.append((name, run.result.steady_state, run.n_steps, run.n_rejected, run.n_solves,
                     f"{run.cpu:.1f}", *end))
    return table(["run", "steady state", "steps", "rejected", "linear solutions",
                  "processor time [s]", "difference", "worn pairs", "largest depth [µm]",
                  "half swing of the tip [mm]"], rows)


def rows_of(data: Path2500, settled: dict[str, WearRun]) -> list[tuple[str, str, str]]:
    """What the runs say."""
    standard = data.runs[STANDARD]
    most = max((name for name in settled if name != STANDARD), key=data.apart)
    clean = [name for name, run in settled.items() if run.n_rejected == 0]
    lost = [name for name in data.runs if name not in settled]
    return [
        ("-", f"{standard.n_worn} of {N_PAIRS} pairs wear, the swing of the tip falls to a part "
         f"of {1.0 / data.fall:.3f} (one {data.fall:.1f}th), and the profiles of "
         f"{len(settled)} runs differ by up to {percent(data.apart(most))} ({most})",
         "no counterpart in the paper"),
        ("-", "without a rejected step: " + (", ".join(clean) or "none") + "; steps that were "
         f"rejected were halved, at most {max(run.n_rejected for run in settled.values())} of "
         "them in a run that reached the steady state"
         + (f". No steady state: {', '.join(lost)}" if lost else ""),
         "followed" if not lost else "followed by the implicit schemes, not by all"),
    ]
