"""Joints of the sector, and a disk as one structure, by harmonic balance and integrated in time:
response, friction energy and wear rate, off the resonance, worn, elastic and to an accuracy."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from bench.common.layout import table
from bench.common.measure import ROOT, Bench, Floats, Groups
from bench.common.sector import case
from bench.speed.sectors import Ring
from fretwear.model_file import write_model_file

__all__ = ["Joint", "measure_joints", "write_joints"]

HARMONICS = (3, 7, 15)
ACCURACY = 1e-3
INSTANTS, STEPS = 256, 1000
FAST, SLOW = 460.8, 377.0
#: The way to a frequency: so many points, from so far off [Hz], towards the resonance.
N_POINTS, WAY = 21, 6.0
#: Off the resonance, in widths of the peak at half of its power.
WIDTHS = 5.0
#: Of the sector, tip force [N]; and how much more of both where an integration would not settle.
DAMPING, LOAD, MORE = 1e-3, 0.5, 3.0
#: Friction energy over the load times the swing, below which nothing slips.
STUCK = 1e-4
#: [mm^2/N], see bench/common/wear_runs.py.
WEAR = 1e-8
#: Stiffness of the elastic law, either direction [N/mm^3].
LAYER = 1e4
N_SECTORS, ORDER, BLADE = 6, 5, 6


@dataclass
class Joint:
    """One case by both.

    Attributes
    ----------
    name : str
    hertz : float
        Frequency; of the disk [rad/s].
    amplitude, energy, rate, seconds : dict
        By way ("time", a number of harmonics, "accuracy", ...): amplitude, friction energy of a
        period, largest wear rate, processor time [s]. A way that missed is not there.
    notes : list of str
    is_stuck : bool
        Friction takes no energy that is worth a comparison.
    """

    name: str
    hertz: float
    amplitude: dict[object, float] = field(default_factory=dict)
    energy: dict[object, float] = field(default_factory=dict)
    rate: dict[object, float] = field(default_factory=dict)
    seconds: dict[object, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    is_stuck: bool = False


def measure_joints(bench: Bench, step: Callable[[str], None]) -> list[Joint]:
    """Every case."""
    step("peaks")
    hertz, width = peak(bench, FAST, 1026.0, 1016.0)
    found = [compare(bench, step, "at the peak, 4400 rpm", FAST, hertz, wears=True)]
    found.append(compare(bench, step, f"{WIDTHS:g} widths above it", FAST, hertz + WIDTHS * width))
    found[-1].notes.append(f"width at half power {width:.2f} Hz")
    elastic = {"law": "penalty", "factor": MORE}
    hertz, _ = peak(bench, FAST, 1024.0, 1012.0, **elastic)
    found.append(compare(bench, step, f"at the peak, `penalty`, {MORE:g} times load and damping",
                         FAST, hertz, **elastic))
    if bench.quick:
        return found[:1]
    step("wear to the steady state")
    hertz, _ = peak(bench, SLOW, 1022.0, 1012.0)
    groups = sector(SLOW, hertz, hertz, 1, 3)
    groups["case"] = {"analysis": "wear"}
    groups["wear"] = {"coefficient": WEAR, "n_cycles": 1e15}
    worn = bench.folder / "worn.h5"
    bench.execute(groups, worn)
    with h5py.File(worn) as file:
        depth = float(file["wear/depth"][-1].max())
    found.append(compare(bench, step, "worn joint there, 3600 rpm", SLOW, hertz, worn=worn))
    found[-1].notes.append(f"worn {1e3 * depth:.2f} µm deep")
    hertz, _ = peak(bench, SLOW, hertz + 4.0, hertz - 8.0, worn=worn)
    found.append(compare(bench, step, "worn joint at its own peak", SLOW, hertz, worn=worn,
                         wears=True))
    step("disk of six sectors")
    return [*found, disk(bench)]


def sector(speed: float, start: float, end: float, n_points: int, n_harmonics: int,
           law: str = "dlft", worn: Path | None = None, factor: float = 1.0) -> Groups:
    """A sweep of the sector with 16 pairs between two frequencies [Hz]; load and damping may be
    `factor` times the usual ones."""
    sweep = {"start": start, "end": end, "n_points": n_points, "unit": "Hz"}
    groups = case(16, n_harmonics, sweep, speed=speed)
    groups["harmonics"] = {"n_harmonics": n_harmonics, "n_time": INSTANTS}
    groups["model"]["modal_damping"] = DAMPING * factor
    groups["load"] = {"harmonic_scale": LOAD * factor}
    groups["contact"] = {"law": law}
    if law == "penalty":
        stiffness = [LAYER * float(area) for area in pairs_of(16)[1]]
        groups["contact"] |= {"tangential_stiffness": stiffness, "normal_stiffness": stiffness}
    if worn is not None:
        groups["contact"]["worn"] = worn
    groups["output"] = {"observe": "tip"}
    return groups


def pairs_of(pairs: int) -> tuple[Floats, Floats]:
    """Friction coefficients and areas."""
    with h5py.File(ROOT / "example" / "blade_sector" / f"sector_{pairs}.h5") as file:
        return file["contact/mu"][()], file["contact/area"][()]


def peak(bench: Bench, speed: float, start: float, end: float,
         **how: Any) -> tuple[float, float]:
    """Frequency of the largest amplitude, and the width of the peak at half of its power [Hz]."""
    run = bench.run(sector(speed, start, end, 81, 7, **how))
    with h5py.File(bench.folder / "case.h5") as file:
        swing = swings(file["coefficients"][:, :, 0])
    order = np.argsort(run.omega)
    hertz, swing = run.omega[order] / (2.0 * np.pi), swing[order]
    top = int(np.argmax(swing))
    half = swing[top] / math.sqrt(2.0)
    right = float(np.interp(-half, -swing[top:], hertz[top:]))
    left = float(np.interp(half, swing[:top + 1], hertz[:top + 1]))
    return float(hertz[top]), right - left


def swings(coefficients: Floats) -> Floats:
    """Half the difference of the extremes of series (n, 2H+1), without their static part."""
    turn = 2.0 * np.pi * np.arange(4096) / 4096
    orders = np.arange(1, (coefficients.shape[1] + 1) // 2)
    values = (coefficients[:, 1::2] @ np.cos(np.outer(orders, turn))
              + coefficients[:, 2::2] @ np.sin(np.outer(orders, turn)))
    return 0.5 * np.ptp(values, axis=1)


def compare(bench: Bench, step: Callable[[str], None], name: str, speed: float, hertz: float, *,
            wears: bool = False, **how: Any) -> Joint:
    """One frequency of the sector in every way."""
    step(name)
    joint = Joint(name, hertz)
    mu, area = pairs_of(16)
    ways: dict[object, Groups] = {}
    for n_harmonics in HARMONICS[:1] if bench.quick else HARMONICS:
        ways[n_harmonics] = sector(speed, hertz + WAY, hertz, N_POINTS, n_harmonics, **how)
    ways["accuracy"] = sector(speed, hertz + WAY, hertz, N_POINTS, 31, **how)
    ways["accuracy"]["harmonics"] = {"n_harmonics": 31, "accuracy": ACCURACY}
    ways["time"] = sector(speed, hertz, hertz, 1, 15, **how)
    ways["time"] |= {"case": {"analysis": "time"},
                     "time": {"steps_per_period": 64 if bench.quick else STEPS, "n_periods": 1000}}
    for way, groups in ways.items():
        result = bench.folder / "case.h5"
        _, joint.seconds[way] = bench.execute(groups, result)
        with h5py.File(result) as file:
            if not file["converged"][-1]:
                joint.notes.append(f"{way}: not converged, change of the last period "
                                   f"{file['residual'][-1]:.0e}")
            energy = file["contact/dissipation"][-1]
            joint.amplitude[way] = float(swings(file["coefficients"][-1:, :, 0])[0])
            joint.energy[way] = float(energy.sum())
            # Archard's law: force times path over the area, and friction is mu times the force.
            joint.rate[way] = float((WEAR * energy / (mu * area)).max())
            if way == "time":
                joint.notes.append(f"{file['iterations'][-1]} periods integrated")
            if way == "accuracy":
                joint.notes.append(claim(file))
    joint.is_stuck = joint.energy["time"] < STUCK * LOAD * joint.amplitude["time"]
    if joint.is_stuck:
        joint.notes.append("nothing slips that takes energy")
    if wears:
        groups = sector(speed, hertz, hertz, 1, 7, **how)
        groups |= {"case": {"analysis": "wear"}, "wear": {"coefficient": WEAR, "n_cycles": 1.0}}
        _, joint.seconds["wear"] = bench.execute(groups, bench.folder / "case.h5")
        with h5py.File(bench.folder / "case.h5") as file:
            joint.rate["wear"] = float(file["wear/rate"][0].max())
    return joint


def claim(file: h5py.File) -> str:
    """What a point with an accuracy says of itself."""
    error = float(file["error_estimate"][-1])
    said = f"claims {error:.0e}" if error <= ACCURACY else "claims nothing"
    return f"`accuracy` takes {file['harmonics'][-1]} harmonics and {said}"


def disk(bench: Bench) -> Joint:
    """Six sectors: one of them with the wave, and all as one structure, by the balance and in
    time."""
    text = (ROOT / "example" / "bladed_disk" / "disk.nml").read_text(encoding="utf-8")

    def numbers(key: str) -> Floats:
        found = re.search(rf"^ +{key} =((?:\s+[-\d.,e]+)+)", text, re.MULTILINE)
        if found is None:
            raise RuntimeError(f"example/bladed_disk/disk.nml has no {key}")
        return np.array([float(word.strip(",")) for word in found[1].split()])

    parts = {name: numbers(name).reshape(10, 10) for name in ("mass", "stiffness")}
    parts |= {"cyclic/left": np.array([1, 2]), "cyclic/right": np.array([3, 4]),
              "contact/side_1": np.array([[9, 0, -10]]), "contact/side_2": np.array([[7, 0, -8]]),
              "contact/sector_2": np.array([1]), "load/cosine": numbers("cosine")}
    common: Groups = {
        "contact": {"law": "penalty", "mu": 0.3, "gap": -0.08, "tangential_stiffness": 3.0,
                    "normal_stiffness": 4.0},
        "harmonics": {"n_harmonics": 7}, "output": {"observe": [BLADE]}}
    damping = {"rayleigh_mass": 0.006, "rayleigh_stiffness": 0.01}
    one = bench.folder / "sector.h5"
    loads = {name: numbers(name) for name in ("static", "cosine", "sine")}
    inner = {name: value for name, value in parts.items() if not name.startswith("load")}
    groups_of = {"cyclic": {"n_sectors": N_SECTORS}}
    write_model_file(one, inner | {f"load/{name}": value for name, value in loads.items()},
                     title="", groups=groups_of)
    ring = Ring(parts | {"damping": 0.0 * parts["mass"]}, N_SECTORS)
    whole = bench.folder / "ring.h5"
    rows = {name: value for name, value in ring.datasets(ORDER).items()
            if name != "damping" and not name.startswith("load")}
    size = len(rows["mass"])
    static, wave = np.zeros(size), np.zeros(size, complex)
    for j in range(N_SECTORS):
        at = ring.dofs(j)
        np.add.at(static, at, ring.sign * loads["static"])
        np.add.at(wave, at, ring.sign * (loads["cosine"] - 1j * loads["sine"])
                  * np.exp(-2j * np.pi * j * ORDER / N_SECTORS))
    write_model_file(whole, rows | {"load/static": static, "load/cosine": wave.real,
                                    "load/sine": -wave.imag}, title="")
    # Through the resonance at which the shrouds slip in part, of several that there are.
    sweep = {"start": 2.6, "end": 2.38, "n_points": 111}
    result = bench.folder / "case.h5"
    wave_case: Groups = {**common, "model": {"source": "hdf5", "file": one, **damping},
                         "cyclic": {"engine_order": ORDER}}
    bench.execute(wave_case | {"sweep": sweep}, result)
    with h5py.File(result) as file:
        swing = swings(file["coefficients"][:, :, 0])
        omega = float(file["omega"][int(np.argmax(swing))])
    joint = Joint(f"disk of {N_SECTORS} sectors, `penalty`", omega)
    observed = [abs(ring.signed(j, BLADE)) for j in range(N_SECTORS)]
    down = {"start": 2.6, "end": omega, "n_points": N_POINTS}
    ways: dict[object, Groups] = {}
    for n_harmonics in HARMONICS:
        ways[n_harmonics] = wave_case | {"sweep": down, "harmonics": {"n_harmonics": n_harmonics}}
    ways["accuracy"] = wave_case | {"sweep": down,
                                    "harmonics": {"n_harmonics": 31, "accuracy": ACCURACY}}
    all_of_them: Groups = {**common, "model": {"source": "hdf5", "file": whole, **damping},
                           "output": {"observe": observed}}
    ways["whole"] = all_of_them | {"sweep": down}
    ways["time"] = all_of_them | {"case": {"analysis": "time"}, "sweep": {"start": omega},
                                  "harmonics": {"n_harmonics": 15},
                                  "time": {"steps_per_period": STEPS}}
    for way, groups in ways.items():
        _, joint.seconds[way] = bench.execute(groups, result)
        with h5py.File(result) as file:
            moves = swings(file["coefficients"][-1].T)
            sectors = N_SECTORS if way in ("whole", "time") else 1
            joint.amplitude[way] = float(moves[0])
            joint.energy[way] = float(file["contact/dissipation"][-1].sum()) / sectors
            if way in ("whole", "time"):
                joint.notes.append(f"{'balance of all sectors' if way == 'whole' else 'in time'}: "
                                   f"blades differ by {np.ptp(moves) / moves.mean():.0e}")
            if not file["converged"][-1]:
                joint.notes.append(f"{way}: not converged")
            if way == "time":
                joint.notes.append(f"{file['iterations'][-1]} periods integrated")
            if way == "accuracy":
                joint.notes.append(claim(file))
    return joint


def write_joints(found: list[Joint]) -> str:
    """The text of the part."""
    ways: list[object] = [*HARMONICS, "accuracy"]
    rows, times = [], []
    for joint in found:
        unit = "rad/s" if joint.name.startswith("disk") else "Hz"
        for title, values in (("swing", joint.amplitude), ("friction energy", joint.energy),
                              ("largest wear rate", joint.rate)):
            if "time" in values and not (title != "swing" and joint.is_stuck):
                rows.append([joint.name if title == "swing" else "", f"{joint.hertz:.6g} {unit}"
                             if title == "swing" else "", title, f"{values['time']:.5g}",
                             *(off(values, way) for way in ways),
                             off(values, "wear" if title == "largest wear rate" else "whole")])
        times.append([joint.name, *(f"{joint.seconds[way]:.2f}" if way in joint.seconds else "-"
                                    for way in [*ways, "whole", "time"]),
                      f"{joint.seconds['time'] / joint.seconds.get(7, math.nan):.0f}"])
    return "\n".join([
        "## Joints against integration in time", "",
        f"Harmonic balance beside `analysis = 'time'` with {STEPS} steps per period, which shares "
        "no formulation with it. The sector has 16 pairs, a tip force of 0.5 N and `dlft` unless "
        "it is said otherwise; swing is half the way of the tip [mm] (of a blade) without its "
        "static part, friction energy that of all pairs in a period (of one sector) [N mm], the "
        "largest wear rate k times the friction energy of a pair over mu times its area "
        f"[mm per cycle], k = {WEAR:g} mm^2/N. Differences are those of the balance; in the last "
        "column those of `analysis = 'wear'` (H = 7, its first row, from no sweep), and of the "
        "balance of all six sectors as one structure.", "",
        *table(["case", "at", "", "integration", *(f"H = {h}" for h in HARMONICS),
                f"`accuracy = {ACCURACY:g}`", "other way"], rows), "",
        *[f"- {joint.name}: {'; '.join(joint.notes)}." for joint in found if joint.notes], "",
        f"Processor times [s] of whole programs: of the balance a sweep of {N_POINTS} points that "
        "ends there.", "",
        *table(["case", *(f"H = {h}" for h in HARMONICS), "`accuracy`", "all sectors",
                "integration", "integration over H = 7"], times)])


def off(values: dict[object, float], way: object) -> str:
    """Difference from the integration, with its sign."""
    if way not in values or values["time"] == 0.0:
        return ""
    return f"{100.0 * (values[way] / values['time'] - 1.0):+.3f} %"
