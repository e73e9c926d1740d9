"""Wrong rows, bodies, ranges of answers, moving obstacles: refused in words, or right."""
import contextlib
import copy
import io
import json
import re
import subprocess
import sys
import warnings

import h5py
import numpy as np
from project import ROOT

import fretwear as fw
from fretwear._namelist import write_namelist as namelist_text
from fretwear.cli import main
from fretwear.errors import InputError

TITLE = "Wrong rows, bodies and obstacles"
TEXT = """
Sound cases with one thing in them that is wrong: rows (`&model n_rows`, `row`), bodies (`&body`,
`/body` of a model file, `fretwear.damper`, `fretwear damper`), ranges of answers (`&bounds`,
`contact%residual`, sliders), several solutions, gaps in harmonics, speeds and sliding. What is put
in is NaN, an infinity, a number beyond the range, too few or too many values, a word that is none,
keys that contradict one another, and for files parts that are missing, of another shape or type,
files cut anywhere, and files of another kind.

The judge knows what each draw has to come to. What is wrong has to end with status 3 (in Python an
`InputError`, of a command any status but 0), with a message that names the key, part or argument
and says what to do or what is missing. A file that was cut may be refused or not, but what is
solved then has to be the answer of the whole file (1e-9 of the largest displacement). Nothing may
end by a signal, with words of the runtime of Fortran or HDF5, or with a traceback.
"""
COUNT = 300
#: Some of every kind.
SMALL = tuple(range(60))
COLUMNS = {"refused": "refused in words", "right": "taken, and right", "crash": "crash",
           "taken": "taken though wrong", "unnamed": "not named", "remedy": "no remedy",
           "wrong": "answer off"}
ZERO = ("crash", "taken", "unnamed", "remedy", "wrong")

SAME = 1e-9
RUNTIME = ("Fortran runtime", "SIGSEGV", "Backtrace", "HDF5-DIAG", "Traceback", "Error allocating",
           "malloc", "free()", "terminate called", "ERROR STOP", "AddressSanitizer")
REMEDY = re.compile(
    r"\b(must|give|gives|use|take|leave|needs?|run|make|made|add|set|write|choose|switch|at least|"
    r"at most|has to|is missing|is given without|have to|is one of|expected|did you mean|required|"
    r"invalid choice|unrecognized|invalid (?:float|int) value)\b")
NAN, INF = float("nan"), float("inf")


def reference(name, omega, **more):
    """Groups of a case of another origin, at one frequency."""
    groups = json.loads((ROOT / f"test/reference/bodies/{name}.json").read_text())["groups"]
    return merged(merged(groups, {"sweep": {"start": omega}}), more)


def merged(groups, changes):
    found = copy.deepcopy(groups)
    for group, keys in changes.items():
        found.setdefault(group, {}).update(keys)
        found[group] = {key: value for key, value in found[group].items() if value is not None}
    return found


MODE = {"case": {"analysis": "mode"}, "mode": {"number": 1, "start": 1e-4, "end": 1e-3,
                                               "n_points": 3},
        "sweep": {"start": None, "end": None}, "load": {"cosine": None, "sine": None}}
#: Of four pairs, or of two that have gaps in two terms.
NUMBERS_OF_FOUR = ([0.0] * 5, [0.1, NAN, 0.1, 0.1], [0.1, 0.1, INF, 0.1], [0.1, 0.2, 0.3])
NUMBERS_OF_TWO = ([0.1] * 3, [NAN, 0.1], [0.1, INF], ["x", 0.1])


def wrong_rows(random):
    groups = reference("v1_wedge_rows", 100.0)
    if random.random() < 0.4:
        groups = reference("v2_wedge_wave", 100.0)
    row, number = list(groups["model"]["row"]), int(random.integers(0, 10))
    zero = list(row)
    zero[7 * number:7 * number + 7] = [0.0] * 7
    spoilt = [[*row[:7 * number], value, *row[7 * number + 1:]] for value in (NAN, INF, -INF)]
    far = int(random.integers(18, 10**6))
    side = list(groups["contact"]["side_1"])
    side[3 * (number % 4)] = int(random.choice([far, -far, -2**31]))
    return groups, [
        ({"model": {"n_rows": -1}}, "n_rows"), ({"model": {"n_rows": 100001}}, "n_rows"),
        ({"model": {"n_rows": 1.5}}, "n_rows"),
        ({"model": {"n_rows": 11}}, "row"), ({"model": {"n_rows": 9}}, "row"),
        ({"model": {"row": row[:-1]}}, "row"), ({"model": {"row": [*row, 1.0]}}, "row"),
        ({"model": {"row": zero}}, "row"), *[({"model": {"row": one}}, "row") for one in spoilt],
        ({"model": {"n_rows": 0}}, "row|side"), ({"model": {"n_rows": None}}, "row|side"),
        ({"contact": {"side_1": side}}, "side_1"), ({"output": {"observe": [1, far]}}, "observe"),
        ({"load": {"n_terms": 1, "term_dof": [far], "term_amplitude": [1.0]}}, "term_dof"),
        ({"contact": {"law": "rigid", "tangential_stiffness": None, "normal_stiffness": None}},
         "pair|compliance|contact"),
        ({"body": {"mass": [1.0]}}, "body"),
        ({"sensitivity": {"parameters": ["body%mass"]}}, "body|cyclic")]


def wrong_ranges(random):
    groups = reference("v8_bounds", 100.0, sweep={"end": 100.0, "n_points": 1})
    one = merged(groups, {"case": {"analysis": "point"}, "bounds": {},
                          "contact": {"memory": "residual"},
                          "sweep": {"end": None, "n_points": None}})
    one.pop("bounds")
    number = int(random.integers(0, 4))
    share = [0.5] * 4
    share[number] = float(random.choice([-1.0001, 1.5, 2.0, -1e300, NAN, INF]))
    # A second direction that no other is.
    two = list(groups["contact"]["side_1"])
    two[1::3] = [1, 1, 2, 2]
    kind = int(random.integers(0, 2))
    if kind == 0:
        return groups, [
            ({"bounds": {"quantity": "lowest"}}, "quantity"), ({"bounds": {"n_starts": 2}},
                                                               "n_starts"),
            ({"bounds": {"n_starts": -3}}, "n_starts"), ({"bounds": {"n_starts": 3.5}}, "n_starts"),
            ({"bounds": {"n_start": 4}}, "n_start"),
            ({"bounds": {"quantity": "wear_volume"}}, "wear|area"),
            ({"contact": {"memory": "carried"}}, "memory"),
            ({"contact": {"side_1": two}}, "bounds|residual|tangential"),
            ({"solver": {"kind": "powell"}}, "kind"),
            ({"harmonics": {"method": "tcm"}}, "method"),
            ({"sweep": {"continuation": "arclength", "end": 110.0}}, "continuation"),
            ({"contact": {"n_pairs": 0, "side_1": None, "side_2": None, "mu": None,
                          "tangential_stiffness": None, "normal_stiffness": None}}, "contact"),
            ({"sweep": {"parameter": "contact%mu", "end": 1.0, "frequency": 100.0}},
             "parameter|sweep")]
    return one, [
        ({"contact": {"residual": share}}, "residual"), ({"contact": {"residual": share}},
                                                         "residual"),
        *[({"contact": {"residual": values}}, "residual") for values in NUMBERS_OF_FOUR],
        ({"contact": {"memory": "assembly", "residual": [0.5] * 4}}, "residual"),
        ({"contact": {"memory": "carried", "residual": [0.5] * 4}}, "residual"),
        ({"contact": {"memory": "residuals"}}, "memory"),
        ({"contact": {"side_1": two}}, "residual"),
        *[({"contact": {"memory": "assembly", "slider_1": values}}, "slider_1")
          for values in NUMBERS_OF_FOUR],
        ({"contact": {"memory": "carried", "slider_1": [0.1] * 4}}, "slider_1"),
        ({"contact": {"memory": "assembly"},
          "sensitivity": {"parameters": ["contact%slider_1"]}}, "slider_1"),
        ({"contact": {"memory": "assembly"},
          "sensitivity": {"parameters": ["contact%residual"]}}, "residual"),
        ({"contact": {"law": "regularised", "slip_speed": 0.1, "tangential_stiffness": None}},
         "memory"),
        (MODE, "memory")]


def wrong_solutions(random):
    groups = reference("v10_several", 1.2)
    far = float(random.choice([NAN, INF, -1.0, 1e300]))
    return groups, [
        ({"solver": {"n_solutions": int(random.choice([0, -1, 1001, -2**31]))}}, "n_solutions"),
        ({"solver": {"n_solutions": 2.5}}, "n_solutions"),
        ({"solver": {"deflation_power": 0.5}}, "deflation_power"),
        ({"solver": {"deflation_power": far}}, "deflation_power"),
        ({"solver": {"deflation_shift": far}}, "deflation_shift"),
        ({"case": {"analysis": "frf"}, "sweep": {"end": 1.4, "n_points": 3}}, "n_solutions"),
        ({"solver": {"kind": "powell"}}, "n_solutions"),
        ({"harmonics": {"n_harmonics": None, "n_time": None, "accuracy": 1e-3}},
         "n_solutions"),
        ({"contact": {"memory": "carried"}}, "n_solutions"),
        ({"control": {"amplitude": 0.1, "of": "displacement"}}, "n_solutions|control")]


def wrong_obstacles(random):
    groups = reference("v4_rub_path", 100.0)
    far = int(random.choice([10, 100000]))
    found = [
        ({"contact": {"n_gap_terms": int(random.choice([-1, 1000001]))}}, "n_gap_terms"),
        ({"contact": {"n_gap_terms": 3}}, "gap_"), ({"contact": {"n_gap_terms": 1}}, "gap_"),
        ({"contact": {"n_gap_terms": None}}, "gap_"),
        ({"contact": {"gap_pair": [0, int(random.choice([3, -1, 1000001]))]}}, "gap_pair"),
        ({"contact": {"gap_harmonic": [1, far]}}, "gap_harmonic|harmonic"),
        ({"contact": {"gap_harmonic": [1, -1]}}, "gap_harmonic"),
        ({"contact": {"gap_harmonic": [1, 1.5]}}, "gap_harmonic"),
        ({"contact": {"gap_order": [1, 2]}}, "gap_order|gap_harmonic"),
        ({"contact": {"gap_amplitude": None}}, "gap_amplitude"),
        ({"harmonics": {"parity": "odd"}}, "parity"),
        ({"contact": {"sliding": "slow"}}, "sliding"),
        ({"contact": {"sliding": "steady", "speed_1": None}}, "sliding"),
        ({"contact": {"memory": "carried"}}, "memory"),
        ({"sweep": {"stability": True}}, "stability"),
        ({"contact": {"law": "iwan"}}, "law|iwan|speed|tangential"),
        ({"contact": {"speed_3": [0.1, 0.1]}}, "speed_3"),
        (MODE, "gap|speed")]
    for key in ("gap_amplitude", "gap_phase", "speed_1", "speed_2", "gap"):
        found += [({"contact": {key: values}}, key) for values in NUMBERS_OF_TWO]
    return groups, found


def blades(**more):
    stiffness = np.diag([9e3, 2e4, 1e4, 1.9e4])
    return fw.Model(np.eye(4), 5e-4 * stiffness, stiffness, cosine=[8.0, 0.0, -5.6, 1.6], **more)


def sound_damper():
    return {"kind": "wedge", "mass": 0.05, "inertia": 5e-6, "radius": 0.2, "angles": (50.0, 50.0),
            "mu": 0.3, "tangential_stiffness": 2e4, "normal_stiffness": 3e4, "law": "penalty",
            "left": fw.Flank([[1, 2], [1, 2]], [[-0.01, 0.0], [-0.01, 0.004]]),
            "right": fw.Flank([[3, 4], [3, 4]], [[0.01, 0.0], [0.01, 0.004]])}


def made(arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return fw.damper(blades(), **arguments)


FILE = {"case": {"analysis": "point"},
        "model": {"source": "hdf5", "file": "model.h5", "rotation_speed": 100.0},
        "harmonics": {"n_harmonics": 5, "n_time": 128, "sampling": "uniform"},
        "sweep": {"start": 120.0}, "solver": {"tolerance": 1e-11}}


def wrong_masses(random):
    far = float(random.choice([-1.0, 0.0, NAN, INF, -INF]))
    return FILE, [
        ({"body": {"mass": [far]}}, "mass"), ({"body": {"mass": [0.1, 0.2]}}, "mass"),
        ({"body": {"mass": ["x"]}}, "mass"), ({"body": {"masses": [0.1]}}, "masses"),
        ({"body": {"mass(2)": 0.1}}, "mass"),
        ({"model": {"rotation_speed": far if far < 0.0 or far != far else -5.0}},
         "rotation_speed"),
        ({"sensitivity": {"parameters": ["body%masses"]}}, "parameters"),
        ({"sweep": {"parameter": "body%mass", "start": -0.1, "end": 0.1, "n_points": 3,
                    "frequency": 100.0}, "case": {"analysis": "frf"}}, "body%mass|sweep"),
        ({"model": {"file": "case.nml"}}, "case.nml")]


#: What a part of a file is replaced by; nothing takes it out.
def spoilt(random, values):
    kind = int(random.integers(0, 6))
    if values.dtype.kind not in "if":
        # Any name is one.
        return None
    if kind == 5:
        return (np.array([b"x"]), None)[int(random.integers(0, 2))]
    if kind == 0:
        return np.concatenate([np.atleast_1d(values)] * 2)
    if kind == 1:
        return values[..., None]
    if kind == 2:
        return np.atleast_1d(values)[:0]
    changed = np.array(values, dtype=float)
    changed.ravel()[int(random.integers(0, changed.size))] = (NAN, INF, -INF)[kind % 3]
    return changed


#: /body/radius, direction may be left out; name gives the number of all.
NEEDED = ("body/name", "body/mass", "body/dof", "body/unit_mass", "row/matrix", "contact/side_1",
          "contact/mu")


def wrong_file(random, folder):
    """The name of what is wrong in a model file, or nothing where it may be right."""
    path = folder / "model.h5"
    kind = int(random.integers(0, 5))
    if kind == 0:
        content = path.read_bytes()
        path.write_bytes(content[:int(random.integers(0, len(content)))])
        return None
    if kind == 1:
        path.write_bytes((b"", b"mass = 1\n", b"\x89PNG\r\n\x1a\n" + bytes(99), random.bytes(4000),
                          b"\x89HDF\r\n\x1a\n" + random.bytes(4000))[int(random.integers(0, 5))])
        return "model.h5"
    with h5py.File(path, "r+") as file:
        if kind == 2:
            name = str(random.choice(["body/masses", "body/Mass", "body/stiffness", "row/row",
                                      "contact/slider", "contact/residuals", "contact/speeds"]))
            file[name] = np.zeros(3)
            return name.rsplit("/", 1)[1]
        if kind == 3:
            parts = {"body/mass": [-1.0], "body/dof": [[5, 6, 99, 0, 0, 0]],
                     "body/radius": [NAN], "body/direction": [[0.0, NAN, 0.0]],
                     "contact/residual": [1.5] * 4, "contact/slider_1": [0.1] * 3,
                     "contact/speed_1": [NAN] * 4, "contact/gap_harmonic": [-1],
                     "contact/slider_2": [INF] * 4}
            name = str(random.choice(sorted(parts)))
            file.pop(name, None)
            file[name] = np.array(parts[name])
            return name.rsplit("/", 1)[1]
        name = str(random.choice([one for one in NEEDED if one in file]))
        values = spoilt(random, file[name][()])
        del file[name]
        if values is not None:
            file[name] = values
        if name == "contact/side_1":
            # Both have to have the same shape.
            return "side_"
        if name == "row/matrix":
            # Without rows sides have numbers that are none.
            return "matrix|side_"
        # Who cannot count bodies says so of one of their parts.
        return name.rsplit("/", 1)[1] if not name.startswith("body") else "body"


def wrong_arguments(random):
    far = (NAN, INF, -1.0, "x", None)[int(random.integers(0, 5))]
    bad = [
        ({"kind": "wedgy"}, "kind"), ({"mass": far}, "mass"), ({"mass": [0.1, 0.2]}, "mass"),
        ({"inertia": (NAN, INF, -1.0)[int(random.integers(0, 3))]}, "inertia"),
        ({"inertia": [1.0, 2.0]}, "inertia"), ({"radius": (NAN, "x")[int(random.integers(0, 2))]},
                                               "radius"),
        ({"angles": (50.0,)}, "angles"), ({"angles": (NAN, 50.0)}, "angles"),
        ({"angles": None}, "angles"), ({"left": None, "right": None}, "left|right|flank"),
        ({"left": fw.Flank([[1, 99]], [[0.0, 0.0]])}, "left"),
        ({"left": fw.Flank([[1, 2]], [[NAN, 0.0]])}, "left"),
        ({"left": fw.Flank([[1, 2]], [[0.0, 0.0]] * 2)}, "left"),
        ({"left": fw.Flank([], [])}, "left"), ({"right": fw.Flank([[3, 4, 5, 6]], [[0.0]])},
                                               "right"),
        ({"mu": (NAN, -0.1, "x", [0.3] * 3)[int(random.integers(0, 4))]}, "mu"),
        ({"tangential_stiffness": far if far is not None else -2.0}, "tangential_stiffness"),
        ({"normal_stiffness": far if far is not None else [1.0] * 3}, "normal_stiffness"),
        ({"compliance": (1.0,)}, "compliance"), ({"compliance": (NAN, 1.0)}, "compliance"),
        ({"compliance": (0.0, -1.0)}, "compliance"), ({"law": "sticky"}, "law"),
        ({"kind": "mesh"}, "matrices|rows"), ({"kind": "cylinder"}, "size"),
        ({"matrices": (np.eye(2), np.eye(3), None)}, "matrices"), ({"load": [1.0]}, "load")]
    return bad[int(random.integers(0, len(bad)))]


def wrong_options(random):
    sound = {"--kind": ["wedge"], "--mass": ["0.05"], "--radius": ["0.2"], "--angles": ["50", "50"],
             "--left": ["1,2", "1,2"], "--left-at": ["-0.01,0", "-0.01,0.004"],
             "--right": ["3,4"], "--right-at": ["0.01,0"], "--mu": ["0.3"],
             "--stiffness": ["2e4", "3e4"], "--law": ["penalty"]}
    bad = [("--kind", ["wedgy"]), ("--mass", ["nan"]), ("--mass", ["-1"]), ("--mass", ["x"]),
           ("--mass", None), ("--angles", ["50"]), ("--angles", ["nan", "50"]),
           ("--left", ["1,x"]), ("--left", ["1,99"]), ("--left", ["1"]), ("--left", None),
           ("--left-at", ["0,0"]), ("--left-at", ["nan,0", "0,0"]), ("--left-at", ["a,b", "0,0"]),
           ("--mu", ["-0.3"]), ("--mu", ["inf"]), ("--mu", None), ("--stiffness", ["2e4"]),
           ("--stiffness", ["nan", "3e4"]), ("--stiffness", ["-1", "3e4"]),
           ("--compliance", ["1"]), ("--compliance", ["nan", "1"]), ("--law", ["sticky"]),
           ("--sector", ["x"]), ("--radius", ["nan"]), ("--inertia", ["-1"]),
           ("--depth", ["1"])]
    name, values = bad[int(random.integers(0, len(bad)))]
    changed = {**sound, name: values}
    words = [word for key, given in changed.items() if given is not None for word in (key, *given)]
    return words, name.lstrip("-").split("-")[0]


def run_of(groups, program, folder):
    (folder / "case.nml").write_text(namelist_text(groups))
    return subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          errors="replace", check=False)


def ended(status, message, name, found):
    """Judge an end that had to be a refusal."""
    if status < 0 or any(word in message for word in RUNTIME):
        found["crash"] = 1
    elif status != 3:
        found["taken"] = 1
    else:
        found["refused"] = 1
        if not re.search(name, message):
            found["unnamed"] = 1
        if not REMEDY.search(message):
            found["remedy"] = 1


def by_namelist(random, program, folder, found):
    kinds = {"rows": wrong_rows, "ranges": wrong_ranges, "several solutions": wrong_solutions,
             "obstacles": wrong_obstacles, "masses": wrong_masses}
    found["kind"] = str(random.choice(sorted(kinds)))
    groups, wrong = kinds[found["kind"]](random)
    changes, name = wrong[int(random.integers(0, len(wrong)))]
    if groups is FILE:
        made(sound_damper()).to_hdf5(folder / "model.h5")
    done = run_of(merged(groups, changes), program, folder)
    ended(done.returncode, done.stderr, name, found)
    return f"{changes}: {done.returncode} {done.stderr.strip()[:300]}"


def by_file(random, program, folder, found):
    found["kind"] = "model file"
    made(sound_damper()).to_hdf5(folder / "model.h5")
    assert run_of(FILE, program, folder).returncode == 0
    with h5py.File(folder / "case.h5") as file:
        wanted = file["coefficients"][()]
    (folder / "case.h5").unlink()
    name = wrong_file(random, folder)
    done = run_of(FILE, program, folder)
    if name is None and done.returncode == 0:
        with h5py.File(folder / "case.h5") as file:
            off = np.abs(file["coefficients"][()] - wanted).max() / np.abs(wanted).max()
        found["right" if off < SAME else "wrong"] = 1
    else:
        ended(done.returncode, done.stderr, name or "model.h5", found)
    return f"{name}: {done.returncode} {done.stderr.strip()[:300]}"


def by_call(random, found):
    found["kind"] = "fretwear.damper"
    changes, name = wrong_arguments(random)
    try:
        made(sound_damper() | changes)
    except InputError as error:
        status, message = 3, str(error)
    except Exception as error: # whatever else it is, it is a fault
        status, message = -1, f"{type(error).__name__}: {error}"
    else:
        status, message = 0, ""
    ended(status, message, name, found)
    return f"{changes}: {status} {message[:300]}"


def by_command(random, folder, found):
    found["kind"] = "fretwear damper"
    blades().to_hdf5(folder / "plain.h5")
    words, name = wrong_options(random)
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        try:
            status = main(["damper", str(folder / "plain.h5"), "-o", str(folder / "out.h5"),
                           *words])
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        except Exception as error: # whatever else it is, it is a fault
            status = -1
            print(f"{type(error).__name__}: {error}", file=sys.stderr)
    # Wrong words of a command are a 2, as everywhere.
    ended(3 if status in (1, 2, 3) else status, errors.getvalue(), name, found)
    if (folder / "out.h5").exists():
        found["taken"] = 1
    return f"{words}: {status} {errors.getvalue().strip()[-300:]}"


def trial(seed, program, folder):
    random = np.random.default_rng(seed)
    found = dict.fromkeys(COLUMNS, 0)
    if seed % 10 < 6:
        note = by_namelist(random, program, folder, found)
    elif seed % 10 < 8:
        note = by_file(random, program, folder, found)
    elif seed % 10 == 8:
        note = by_call(random, found)
    else:
        note = by_command(random, folder, found)
    return {**found, "notes": [note] if any(found[key] for key in ZERO) else []}
