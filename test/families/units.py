"""The same case in other units: exact powers of two move last bits alone."""
import re
import subprocess

import h5py
import numpy as np
from unit_cases import drawn

import fretwear as fw
from fretwear.errors import FretwearError

TITLE = "Units"
TEXT = """
Chains of one to four masses with a pair of every law, in one or two tangential directions, with and
without a normal dof, gap and static load, or with a cubic spring: responses, given amplitudes
(natural and by arc length), modes, resonances over a parameter, wear, derivatives, optima
(`fretwear.optimise`), residual tractions, their ranges, sliders, several solutions, obstacles that
move and free decay. Each case is run as it is, and with force, length and time in other units,
one after the other and all together: factors that are even powers of two, which change no digit of
the input.

The judge is the case itself: every number of the result file times its own factor, to 1e-9 of the
largest of its dataset, the status, and the words of all messages and remarks, without their
numbers. To 1e-5 only a resonance over a parameter, whose frequency at a corner is good to a
millionth, and to 1e-2 branches, where the places of points are what round-off makes of the steps.
*Other words* are runs that end or remark otherwise, *other numbers* those whose rows are as many
and differ, *other rows* those that are not as many. Optima are those of the Python package of
today, whatever program is counted beside it.
"""
COUNT = 192
SMALL = (0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 96, 97, 98, 99, 100, 101)
COLUMNS = {"runs": "runs in other units", "same": "the same", "in_words": "of these in words",
           "words": "other words", "rows": "other rows", "numbers": "other numbers"}
ZERO = ("words", "rows", "numbers")

#: Powers of two of force, length and time.
UNITS = ((-40, 0, 0), (50, 0, 0), (0, -20, 0), (0, 24, 0), (0, 0, -16), (0, 0, 20), (18, -10, 12),
         (-30, 20, -10))
#: Directions of branches and curvatures are had by differences over 1e-7 of the frequency; where
#: points lie along a branch, round-off of their steps grows from one to the next.
SAME, SAME_DIRECTION, SAME_BRANCH = 1e-9, 3e-6, 1e-2
#: The frequency of a resonance that is a corner is good to a millionth.
SAME_CORNER = 1e-5
#: Of a case as it is drawn, where all is of the order of one, what is less is none.
ROUND_OFF = 1e-6
#: The same of derivatives, which are sums of many parts that may cancel.
NO_SLOPE = 1e-3
#: Exponents of force, length and time of the keys that are drawn.
NONE, FORCE, LENGTH, STIFFNESS, FREQUENCY = (0, 0, 0), (1, 0, 0), (0, 1, 0), (1, -1, 0), (0, 0, -1)
KEYS = {"mass": (1, -1, 2), "stiffness": STIFFNESS, "damping": (1, -1, 1), "cosine": FORCE,
        "static": FORCE, "normal_load": FORCE, "tangential_stiffness": STIFFNESS,
        "normal_stiffness": STIFFNESS, "gap": LENGTH, "slip_speed": (0, 1, -1),
        "area": (0, 2, 0), "sweep.start": FREQUENCY, "sweep.end": FREQUENCY,
        "sweep.frequency": FREQUENCY, "values": FREQUENCY, "amplitude": LENGTH,
        "mode.start": LENGTH, "mode.end": LENGTH, "wear.coefficient": (-1, 2, 0),
        "spring.coefficient": (1, -3, 0), "slider_1": LENGTH, "gap_amplitude": LENGTH,
        "speed_1": (0, 1, -1)}
#: Those of the datasets; the first that matches. `None`: not compared.
MODAL = (0.5, 0.5, 1.0)
DATASETS = (
    (r"bounds/(lowest|highest|centre)", LENGTH), (r"bounds/", NONE), (r"obstacle_work", (1, 1, 0)),
    (r"ringdown/(extreme/)?time", (0, 0, 1)), (r"ringdown/(observed|extreme/value)", LENGTH),
    (r"seconds|iterations|residual|_by$|/error|observed|restart/|/kind|/pair$", None),
    (r"(^|_|/)omega$|self_excitation|bandwidth", FREQUENCY), (r"^wear/rate", LENGTH),
    (r"(^|/)contact/area", (0, 2, 0)), (r"volume", (0, 3, 0)), (r"curvature", (0, 1, 2)),
    (r"resonance/value", LENGTH),
    (r"mode/modal_amplitude|modal$", MODAL), (r"mode/shape", (-0.5, 0.5, -1.0)),
    (r"amplitude|coefficients|first_harmonic|largest|depth|gap|relative_displacement", LENGTH),
    (r"dissipation|energy", (1, 1, 0)), (r"force$", FORCE),
    (r"^parameter$|phase|is_|converged|fraction|damping_ratio|scale|cycles|share|state|stable|fold|"
     r"multiplier|tolerance", NONE))


def dims_of(name):
    for pattern, dims in DATASETS:
        if re.search(pattern, name):
            return dims
    raise LookupError(name)


def factor(dims, units):
    """2 to the sum: exact."""
    return 2.0**float(np.dot(dims, units))


def written(value, scale):
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(float(value * scale))
    return ", ".join(written(part.item() if hasattr(part, "item") else part, scale)
                     for part in value)


def scale_of(group, key, groups, units):
    if group == "mode" and key in ("start", "end") and groups["mode"]["control"] == "modal":
        return factor(MODAL, units)
    return factor(KEYS.get(f"{group}.{key}", KEYS.get(key, NONE) if group not in
                           ("resonance",) else NONE), units)


def text(groups, units=(0, 0, 0)):
    """The namelist in other units."""
    lines = []
    for group, keys in groups.items():
        lines.append(f"&{group}")
        lines += [f"   {key} = {written(value, scale_of(group, key, groups, units))}"
                  for key, value in keys.items()]
        lines.append("/")
    return "\n".join(lines) + "\n"


def wordy(lines):
    """Messages without their numbers, and without what counts work."""
    number = r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|NaN"
    kept = [line for line in lines if not re.match(
        r"point |iterations|linear solver|skipped|time |converged|peaks|derivatives|stability|"
        r"branch |\s*$", line)]
    return sorted({re.sub(r"\s+", " ", re.sub(number, "#", line)) for line in kept})


def run(program, folder, name, groups, units):
    """Status, words and datasets of a case."""
    path = folder / "case.nml"
    path.write_text(text(groups, units))
    target = folder / f"{name}.h5"
    done = subprocess.run([program, "-o", target, path.name], cwd=folder, check=False,
                          capture_output=True, text=True, timeout=300)
    data = {}
    if target.exists():
        with h5py.File(target, "r") as file:
            file.visititems(lambda key, item: data.update({key: item[()]}) if isinstance(
                item, h5py.Dataset) and item.dtype.kind in "fbiu" else None)
        target.unlink()
    return done.returncode, wordy((done.stdout + done.stderr).splitlines()), data


def parameter_dims(name):
    group, key = name.split("_", 1)
    return KEYS.get(f"{group}.{key}", KEYS.get(key, NONE)) if group != "load" else NONE


def all_dims(name):
    """Of derivatives those of the quantity over those of the parameter."""
    parts = name.split("/")
    if parts[0] == "sensitivity":
        if parts[1] == "value":
            return (parameter_dims(parts[2]) if "_" in parts[2] and parts[2].split("_")[0] in
                    ("contact", "load", "spring", "model") else dims_of(parts[2]))
        if len(parts) == 3:
            return tuple(np.subtract(dims_of(parts[1].removeprefix("mode_")),
                                     parameter_dims(parts[2])))
    return dims_of(name)


def difference(now, before, scale, none):
    """Largest difference of two datasets over the largest number of the one before, or `none`."""
    now, before = (np.atleast_1d(np.asarray(data, float)) for data in (now, before))
    if (np.isfinite(now) != np.isfinite(before)).any():
        return np.inf
    good = np.isfinite(before)
    if not good.any():
        return 0.0  # also where nothing converged
    largest = max(np.abs(before[good]).max(), none)
    # NumPy must not underflow what the program has not.
    return float(np.abs(now[good] / scale - before[good]).max() / largest)


def compared(one, other, units, same=SAME):
    """What differs, a word of COLUMNS, and where."""
    if one[:2] != other[:2]:
        words = sorted(set(other[1]) ^ set(one[1]))
        return "words", f"{one[0]}/{other[0]} {words}"
    if one[2].keys() != other[2].keys():
        return "rows", str(sorted(one[2].keys() ^ other[2].keys()))
    worst, at = 0.0, ""
    good = np.atleast_1d(one[2].get("converged", True)).astype(bool)
    for name, before in one[2].items():
        dims = all_dims(name)
        if dims is None:
            continue
        now = other[2][name]
        if np.shape(now) != np.shape(before):
            return "rows", f"{name}: {np.shape(before)}, {np.shape(now)}"
        if len(np.atleast_1d(before)) == len(good):
            now, before = np.atleast_1d(now)[good], np.atleast_1d(before)[good]
        error = difference(now, before, factor(dims, units),
                           NO_SLOPE if name.startswith("sensitivity/") else ROUND_OFF)
        if name.startswith("tangent") or "curvature" in name:
            error *= min(1.0, same / SAME_DIRECTION)
        if error > worst:
            worst, at = error, name
    return ("numbers" if worst > same else "same"), f"{at}: {worst:.1e}"


def optimum(folder, groups, units):
    key = "normal_load" if "normal_load" in groups["contact"] else "gap"
    path = folder / "case.nml"
    path.write_text(text(groups, units))
    scale = factor(KEYS[key], units)
    start = groups["contact"][key]
    bounds = (0.1 * abs(start) * scale, 10.0 * abs(start) * scale)
    try:
        found = fw.optimise(path, minimise="max_amplitude", over=f"contact%{key}", bounds=bounds,
                            start=abs(start) * scale, scan=False, max_evaluations=20)
    except FretwearError as error:
        return 1, wordy(str(error).splitlines()), {}
    words = wordy([found.word, found.doubt])
    return 0, words, {"gap" if key == "gap" else "contact/force": np.array(found.values),
                      "amplitude": np.array(found.value)}


def trial(seed, program, folder):
    kind, groups = drawn(seed)

    def found(name, units):
        if kind == "optimum":
            return optimum(folder, groups, units)
        return run(program, folder, name, groups, units)

    one = found("one", (0, 0, 0))
    counts = {"kind": kind, "runs": 0, "notes": []}
    is_branch = any(group.get("continuation") == "arclength" for group in groups.values())
    same = SAME_BRANCH if is_branch else SAME_CORNER if kind == "resonance" else SAME
    every = UNITS[::3] if kind == "optimum" else UNITS
    for units in every:
        word, note = compared(one, found("other", units), units, same)
        counts["runs"] += 1
        counts[word] = counts.get(word, 0) + 1
        if word == "same":
            counts["in_words"] = counts.get("in_words", 0) + int(one[0] != 0)
        else:
            law = groups.get("contact", {}).get("law", "spring")
            counts["notes"].append(f"{kind}, {law}, {units}: {word}, {note}"[:300])
    return counts
