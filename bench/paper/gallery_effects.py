"""What the wear profile owes to the discretisation: harmonics, instants, penalty."""

from __future__ import annotations

from dataclasses import dataclass

from bench.common.layout import table
from bench.common.measure import Bench, Groups
from bench.common.wear_runs import WearRun, difference, run_wear, stage_order, steps_of
from bench.paper.gallery_text import percent

__all__ = ["Effects", "measure_effects", "write_effects"]

STEPS = 20
#: Values of each key, the standard one last.
VALUES: dict[tuple[str, str], tuple[float, ...]] = {
    ("harmonics", "n_harmonics"): (1, 5, 3),
    ("harmonics", "n_time"): (64, 256, 128),
    ("contact", "penalty_scale"): (0.5, 2.0, 1.0)}
QUICK: dict[tuple[str, str], tuple[float, ...]] = {("harmonics", "n_time"): (64, 128)}


@dataclass(frozen=True)
class Effects:
    """The run with standard values, and others by group, key and value."""

    standard: WearRun
    others: dict[tuple[str, str, float], WearRun]

    def change(self, sort: tuple[str, str, float]) -> float:
        """Largest change of the profile, as a part of the largest depth."""
        return difference(self.others[sort].depth, self.standard.depth)


def measure_effects(bench: Bench) -> Effects:
    """One key at a time, at 3600 rpm."""
    depth = run_wear(bench, "effects_depth", stage_order(2, 1e-2)).deepest
    scheme = steps_of("implicit", depth / STEPS)
    standard = run_wear(bench, "effects_standard", scheme)
    others = {}
    for (group, key), values in (QUICK if bench.quick else VALUES).items():
        for value in values[:-1]:
            changes: Groups = {group: {key: value}}
            others[group, key, value] = run_wear(bench, f"effects_{len(others)}", scheme,
                                                 changes=changes)
    return Effects(standard, others)


def write_effects(data: Effects) -> str:
    """The text of the part."""
    rows = []
    for group, key in VALUES:
        for sort, run in data.others.items():
            if sort[:2] == (group, key):
                rows.append((f"`{group}%{key}`", f"{VALUES[group, key][-1]:g} to {sort[2]:g}",
                             percent(data.change(sort)), f"{1e3 * run.deepest:.4f}",
                             f"{run.swing[-1]:.4f}"))
    return "\n".join([
        "## What the profile owes to the discretisation", "",
        f"Wear at 3600 rpm by the implicit scheme with steps of 1/{STEPS}, one key changed at a "
        "time: largest change of the final profile as a part of its largest depth (of "
        f"{1e3 * data.standard.deepest:.4f} µm, half swing of the tip "
        f"{data.standard.swing[-1]:.4f} mm). The paper takes H = 3 for its study of wear.", "",
        *table(["key", "value", "change of the profile", "largest depth [µm]",
                "half swing of the tip [mm]"], rows)])
