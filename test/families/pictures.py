"""What pictures show, against what the files that they are of hold."""
import subprocess
from pathlib import Path

import h5py
import matplotlib
import numpy as np

import fretwear as fw
from fretwear.explore.sliders import read_slider
from fretwear.plot import plot_damping, plot_flanks, plot_hysteresis, plot_response

matplotlib.use("Agg")

TITLE = "Pictures"
TEXT = """
Sweeps of chains of one to four masses with one to three pairs that rub, of the rigid and of the
elastic law, over a part of the frequencies that may leave their peak outside. Some pairs are held
by a normal load that no force overcomes; some masses hang behind a held one, where nothing moves
them. In a third of the files a stretch of rows is marked as not converged, at the top or anywhere,
and the peaks within are taken out.

The judge reads the files by h5py and looks at the artists of the response, the damping curve, the
loops and the maps: a full dot and the word `peak` only where the highest point is a maximum with
converged rows beside it, a ring where not, no damping there, a cross for each row that failed;
loops of pairs at rest are lines of no width, the area of the others is the friction work of the
file; maps hold exact zeros for pairs that are held. It knows which pairs are at rest from how the
case was drawn. Of files as the program left them a wider sweep of four times as many points is run
too: what a picture calls a peak has to be a maximum there. The sliders of `fretwear explore` have
to start where the model file has its values.
"""
COUNT = 300
SMALL = range(6)
COLUMNS = {"peaks": "peaks", "ends": "ends of the sweep", "missing": "beside failed rows",
           "false_peak": "no peak, drawn as one", "lost_peak": "a peak, not drawn as one",
           "untrue": "no maximum in a wider sweep", "false_damping": "damping of no peak",
           "crosses": "rows that failed, drawn", "damping_curve": "damping curve differs",
           "loops": "loops", "rest": "pairs at rest", "false_loop": "at rest, drawn as a loop",
           "area": "area is not the work", "false_loss": "held, coloured as data",
           "slider": "slider starts elsewhere"}
ZERO = ("false_peak", "lost_peak", "untrue", "false_damping", "crosses", "damping_curve",
        "false_loop", "area", "false_loss", "slider")

#: Pictures are made by the package.
ALSO = list(Path(fw.__file__).parent.rglob("*.py"))

#: Heights that count as one; what is within the half-power width; of a wider sweep; of an area.
EQUAL, NEAR, TRUE, AREA = 1e-7, np.sqrt(0.5), 0.03, 0.02
#: Friction work below this part of the rectangle around a loop is not compared as its area.
SMALL_WORK = 1e-4
#: And below this part of that of another pair: solutions are known to 1e-8.
NO_WORK = 1e-8


def drawn(seed):
    """A model in memory, the settings of its case, pairs that are at rest, pairs that are held."""
    random = np.random.default_rng(7700 + seed)
    n = int(random.integers(1, 5))
    law = ("rigid", "penalty")[seed % 2]
    stiffness = np.zeros((n, n))
    for k, spring in enumerate(random.uniform(0.5, 2.0, n)):
        stiffness[k, k] += spring
        if k:
            stiffness[k - 1, k - 1] += spring
            stiffness[k, k - 1] -= spring
            stiffness[k - 1, k] -= spring
    mass = np.diag(random.uniform(0.5, 2.0, n))
    loaded = int(random.integers(n))
    # The loaded mass may rub, never be held.
    places = [loaded, *random.permutation([k for k in range(n) if k != loaded])]
    places = places[int(random.integers(2)) if n > 1 else 0:][:int(random.integers(1, 4))]
    held = np.array([place != loaded and random.random() < 0.5 for place in places])
    load = float(10.0 ** random.uniform(-3, 3))
    limit = load * np.where(held, 1e6, 10.0 ** random.uniform(-1.0, 0.0, len(places)))
    mu = float(random.uniform(0.1, 0.9))
    cosine = np.zeros(n)
    cosine[loaded] = load
    m = len(places)
    pairs = fw.ContactPairs(
        np.array([[place + 1, 0, 0] for place in places]), mu=np.full(m, mu),
        normal_load=limit / mu, area=random.uniform(0.5, 2.0, m),
        position=np.column_stack((np.arange(m, dtype=float), np.zeros(m), np.zeros(m))),
        **({"tangential_stiffness": np.full(m, float(random.uniform(0.5, 3.0)))}
           if law == "penalty" else {}))
    model = fw.Model(mass, None, stiffness, contact=pairs, cosine=cosine,
                     observe={"u": loaded + 1})
    fixed = [place for place, is_held in zip(places, held) if is_held and law == "rigid"]
    rest = np.array([place in fixed or any(min(place, loaded) < other < max(place, loaded)
                                           for other in fixed) for place in places])
    squares = np.linalg.eigvalsh(np.diag(np.diag(mass)**-0.5) @ stiffness
                                 @ np.diag(np.diag(mass)**-0.5))
    middle = float(np.sqrt(random.choice(squares))) * random.uniform(0.8, 1.3)
    wide = float(random.uniform(0.05, 0.5))
    ends = middle * (1.0 - wide), middle * (1.0 + wide)
    settings = {"structure": {"modal_damping": float(random.uniform(0.005, 0.05))},
                "contact": {"law": law}, "harmonics": {"n_harmonics": int(random.integers(1, 6))},
                "sweep": {"start": ends[0], "end": ends[1],
                          "n_points": int(random.integers(12, 80))}}
    doctored = (None, None, "top", None, None, "anywhere")[seed % 6]
    return model, settings, rest, held | rest, doctored, random


def run(program, folder, name, model, settings):
    path = folder / f"{name}.nml"
    model.to_hdf5(folder / f"{name}_model.h5")
    path.write_text(fw.Case(folder / f"{name}_model.h5", **settings).namelist())
    target = path.with_suffix(".h5")
    subprocess.run([program, "-q", "-o", target, path.name], cwd=folder, check=False,
                   capture_output=True, timeout=300)
    return target


def doctor(path, how, random):
    """Mark a stretch of rows as failed, and take out the peaks that are in it."""
    with h5py.File(path, "r+") as file:
        omega, amplitude = file["omega"][()], file["amplitude"][:, 0]
        n = len(omega)
        length = int(random.integers(1, max(2, n // 4)))
        middle = int(np.argmax(amplitude)) if how == "top" else int(random.integers(n))
        rows = slice(max(0, middle - length // 2), max(0, middle - length // 2) + length)
        file["converged"][rows] = 0
        inside = omega[rows]
        gone = (file["peak/omega"][()] >= inside.min()) & (file["peak/omega"][()] <= inside.max())
        kept = {name: file[f"peak/{name}"][()][~gone]
                for name in ("omega", "amplitude", "bandwidth", "found_by", "observed",
                             "coefficients")}
        for name, values in kept.items():
            attributes = dict(file[f"peak/{name}"].attrs)
            del file[f"peak/{name}"]
            file[f"peak/{name}"] = values
            for key, value in attributes.items():
                if not key.isupper():  # labels of dimensions belong to the old dataset
                    file[f"peak/{name}"].attrs[key] = value
        if "peak/cycle" in file:
            del file["peak/cycle"]


def verdict(path):
    """What the file says of its highest point: (word, frequency [Hz], height), rows that failed."""
    with h5py.File(path) as file:
        omega, amplitude = file["omega"][()], file["amplitude"][:, 0]
        good = file["converged"][()].astype(bool)
        names = [name.decode() if isinstance(name, bytes) else str(name)
                 for name in file["peak/found_by"].attrs["names"]]
        peaks = [(a, w, names[k]) for a, w, k in zip(*(
            file[f"peak/{name}"][()] for name in ("amplitude", "omega", "found_by")))]
    order = np.argsort(omega)
    omega, amplitude, good = omega[order], amplitude[order], good[order]
    if not good.any():
        return None, np.count_nonzero(~good)
    top = int(np.argmax(np.where(good, amplitude, -np.inf)))
    height, place = amplitude[top], omega[top]
    word = "end" if top in (0, len(omega) - 1) else "peak"
    if peaks and max(peaks)[0] >= (1.0 - EQUAL) * height:
        height, place, found_by = max(peaks)
        word = {"end of the sweep": "end", "not resolved": "open"}.get(found_by.strip(), "peak")
    for k in np.flatnonzero(~good):
        beside = [j for j in (k - 1, k + 1) if 0 <= j < len(omega) and good[j]]
        if word == "peak" and any(amplitude[j] >= NEAR * height for j in beside):
            word = "missing"
    return (word, place / (2.0 * np.pi), height), np.count_nonzero(~good)


def look_at_response(counts, path, found, n_failed):
    axes = plot_response(path).axes[0]
    text = " ".join(one.get_text() for one in axes.texts)
    crosses = sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() == "x")
    counts["crosses"] += crosses != n_failed
    dots = [line for line in axes.lines if line.get_marker() == "o" and len(line.get_xdata()) == 1]
    full = [line for line in dots if line.get_markerfacecolor() != "white"]
    word = None if found is None else found[0]
    counts["peaks"] += word == "peak"
    counts["ends"] += word == "end"
    counts["missing"] += word == "missing"
    counts["false_peak"] += word != "peak" and (bool(full) or text.startswith("peak"))
    counts["lost_peak"] += word == "peak" and not (full and text.startswith("peak"))
    counts["false_damping"] += word != "peak" and ("damping" in text or "width" in text)
    return word == "peak" and bool(full)


def look_at_damping(counts, paths):
    """The curve joins as many sweeps as have a peak of the first harmonic, judged by their rows."""
    expected = 0
    for path in paths:
        with h5py.File(path) as file:
            first = np.hypot(*file["coefficients"][:, 1:3, 0].T)
            good = file["converged"][()].astype(bool)
            rows = np.argsort(file["omega"][()])
            inside = [np.hypot(*c[1:3]) for c, k in zip(
                file["peak/coefficients"][()], file["peak/found_by"][()]) if k in (0, 1, 2)]
        first, good = first[rows], good[rows]
        if not good.any():
            return
        top = int(np.argmax(np.where(good, first, -np.inf)))
        level = max([first[top], *inside])
        at_end = top in (0, len(first) - 1) and first[top] > (1.0 + EQUAL) * max([0.0, *inside])
        beside = (~good[1:] & good[:-1] & (first[:-1] >= NEAR * level)) | (
            ~good[:-1] & good[1:] & (first[1:] >= NEAR * level))
        expected += not at_end and not beside.any()
    line = plot_damping(paths).axes[0].lines[0]
    counts["damping_curve"] += len(line.get_xdata()) != expected


def look_at_pairs(counts, path, rest, held):
    result = fw.Result(path)
    point = result.peak()
    loss, area = result.dissipation[point], result["contact/area"]
    for axes in plot_hysteresis(result, point).axes:
        if not axes.get_visible():
            continue
        pair = int(axes.get_title().split(",")[0].split()[1]) - 1
        (line,) = axes.lines
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        counts["rest" if rest[pair] else "loops"] += 1
        counts["false_loop"] += rest[pair] and np.ptp(x) > 0.0
        # A thin loop, of a pair that hardly slips, is a difference of large numbers.
        if not held[pair] and loss[pair] > max(SMALL_WORK * np.ptp(x) * np.ptp(y),
                                               NO_WORK * loss.max()):
            work = abs(np.trapezoid(y, x))
            counts["area"] += abs(work - loss[pair]) > AREA * loss[pair]
    maps = [np.asarray(axes.collections[0].get_array()) for axes in plot_flanks(result, point).axes
            if axes.get_title().startswith("dissipation")]
    # Others may stick all the period too, as the file says.
    held = held | (result.fraction[point, :, 0] == 1.0)
    counts["false_loss"] += bool(maps) and bool((maps[0][held] != 0.0).any())
    counts["false_loss"] += bool(maps) and not np.allclose(
        maps[0][~held], (loss / area)[~held], rtol=1e-12)


def look_at_sliders(counts, path, model, settings):
    case = fw.Case(path.with_name(f"{path.stem}_model.h5"), **settings)
    mu = float(np.unique(model.contact.mu)[0])
    slider = read_slider("contact%mu=0.05:0.95", case)
    counts["slider"] += slider.value != mu


def is_true(program, folder, model, settings, found):
    """Whether a wider and finer sweep has a maximum there."""
    low, high = settings["sweep"]["start"], settings["sweep"]["end"]
    n = 4 * settings["sweep"]["n_points"]
    wide = {**settings, "sweep": {"start": 0.8 * low, "end": 1.2 * high,
                                  "n_points": int(n * (1.2 * high - 0.8 * low) / (high - low))}}
    with h5py.File(run(program, folder, "wide", model, wide)) as file:
        omega, a = file["omega"][()], file["amplitude"][:, 0]
        inner = 1 + np.flatnonzero((a[1:-1] >= a[:-2]) & (a[1:-1] >= a[2:]))
        f = np.append(omega[inner], file["peak/omega"][()]) / (2.0 * np.pi)
        a = np.append(a[inner], file["peak/amplitude"][()])
    return (np.hypot(f / found[1] - 1.0, a / found[2] - 1.0) <= TRUE).any()


def trial(seed, program, folder):
    model, settings, rest, held, doctored, random = drawn(seed)
    counts = {"kind": settings["contact"]["law"], "notes": [], **dict.fromkeys(COLUMNS, 0)}
    path = run(program, folder, "sweep", model, settings)
    other = {**settings, "load": {"harmonic_scale": 1.7}}
    paths = [path, run(program, folder, "other", model, other)]
    if doctored:
        doctor(path, doctored, random)
    found, n_failed = verdict(path)
    if look_at_response(counts, path, found, n_failed) and not doctored and n_failed == 0:
        counts["untrue"] += not is_true(program, folder, model, settings, found)
    look_at_damping(counts, paths)
    if found is not None:
        look_at_pairs(counts, path, rest, held)
    look_at_sliders(counts, path, model, settings)
    counts = {key: count if key in ("kind", "notes") else int(count)
              for key, count in counts.items()}
    return {**counts, "notes": [f"{key}, {found}" for key in ZERO if counts[key]]}
