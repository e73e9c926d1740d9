"""Model files with something in them that nothing reads, against a list of their parts."""
import random
import re
import string
import subprocess

import h5py
import numpy as np

TITLE = "Strangers in model files"
TEXT = """
Model files of a sector (matrices, pairs, springs, loads of any harmonic, observed quantities,
interfaces, forces of the air, a mesh) and of matrices of nodal diameters, of which parts that may
be absent are left out at random. One object of each is made a stranger: a name one edit or a swap
of two letters away from that of a part (`slip`), the same name written in other letters or in
the plural (`spelling`), the name of a part in another group (`place`), another kind of
object under a name (`kind`: a group, a dataset, an attribute, a link that leads nowhere), or a word
of its own (`far`). It stands in the place of the part, or beside it. And whole files (`sound`).

The judge is a list of the parts written by hand, which knows nothing of that of the program. A
stranger has to be refused with its path, or, with a name of its own beside the groups that are
read, remarked; *silent* are those that are neither. What is a slip has to be refused with a name
that is as near as any; *not named* are those where it is not. Sound files have to run without a
remark of what is not read.
"""
COUNT = 2000
SMALL = tuple(range(60))
COLUMNS = {"refused": "refused", "named": "with the name meant", "remarked": "remarked",
           "unnamed": "not named", "silent": "silent", "blamed": "sound and blamed",
           "failed": "other failures"}
ZERO = ("unnamed", "silent", "blamed", "failed")

N, PAIRS, SECTORS = 6, 2, 5
PLAIN = {
    "": ["mass", "stiffness", "damping", "stiffness_rotation", "coriolis", "structural_damping",
         "circulatory", "stiffness_unsymmetric", "damping_unsymmetric"],
    "contact": ["side_1", "side_2", "sector_2", "mu", "gap", "area", "normal_load",
                "tangential_stiffness", "normal_stiffness", "slip_speed", "position", "patch"],
    "spring": ["side_1", "side_2", "sector_2", "coefficient", "power"],
    "load": ["static", "cosine", "sine", "static_rotation", "harmonic", "harmonic_cosine",
             "harmonic_sine"],
    "observe": ["name", "dof", "matrix"], "cyclic": ["left", "right"],
    "aero": ["modes"], "mesh": ["points", "cells", "body", "kind", "facets", "pair", "basis"]}
NODAL = {"": ["mass", "stiffness", "damping", "stiffness_rotation", "coriolis"],
         "load": ["static", "cosine", "sine", "static_rotation"], "observe": ["matrix"]}
ATTRIBUTES = {"": ["format", "format_version", "title", "unit_system", "parameters",
                   "disk_parameters"],
              "contact": ["law"], "cyclic": ["n_sectors", "n_physical", "phase"]}
GROUPS = {"": [*[name for name in PLAIN if name], "nodal_diameter"],
          "aero": ["sector", "nodal_diameter"]}
#: What a run cannot do without; of an attribute that is misspelled the file says something else.
NEEDED = {"mass", "stiffness", "contact/side_1", "contact/side_2", "spring/side_1",
          "spring/coefficient", "observe/name", "cyclic/left", "cyclic/right"}
FAR = ["notes", "origin", "pictures", "xyz", "q7", "experiment", "bolts", "thermal"]
CASE = """&model source = 'hdf5' file = 'm.h5' /
&cyclic engine_order = 1 /
&contact law = 'penalty' /
&harmonics n_harmonics = 2 /
&sweep start = 0.30 end = 0.31 n_points = 1 /
&output contact = .false. /
"""


def pairs_of(values):
    return np.stack([np.real(values), np.imag(values)], axis=-1)


def datasets(kind, draw):
    """Everything that a sound file of this kind may hold."""
    eye = np.eye(N)
    ring = 2.0 * eye - 0.5 * (np.eye(N, k=1) + np.eye(N, k=-1))
    side = np.array([[1, 2, 3], [4, 5, 6]])
    parts = {"contact/side_1": side, "contact/side_2": 0 * side, "contact/sector_2": [0, 0],
             "contact/mu": 0.3, "contact/gap": [0.0, 0.0], "contact/area": 1.0,
             "contact/tangential_stiffness": 1.0, "contact/normal_stiffness": [1.0, 2.0],
             "contact/position": np.zeros((PAIRS, 3)), "contact/patch": np.array([b"a", b"b"]),
             "spring/side_1": [1, 2], "spring/side_2": [3, 0], "spring/sector_2": 0,
             "spring/coefficient": 0.01, "spring/power": [3, 3],
             "load/harmonic": [2], "load/harmonic_cosine": np.full((1, N), 0.01),
             "load/harmonic_sine": np.zeros((1, N)), "observe/name": np.array([b"tip"])}
    if kind == "nodal":
        # Of sectors that nothing joins, the same in every nodal diameter.
        for k in range(SECTORS // 2 + 1):
            at = f"nodal_diameter/{k}"
            parts |= {f"{at}/mass": pairs_of(eye), f"{at}/stiffness": pairs_of(ring),
                      f"{at}/damping": pairs_of(0.1 * eye),
                      f"{at}/stiffness_rotation": pairs_of(0.1 * eye),
                      f"{at}/coriolis": pairs_of(np.zeros((N, N))),
                      f"{at}/observe/matrix": pairs_of(np.eye(1, N))}
            parts |= {f"{at}/load/{name}": pairs_of(np.ones(N)) for name in NODAL["load"]}
        return parts
    parts |= {"mass": eye, "stiffness": ring, "damping": 0.1 * eye,
              "stiffness_rotation": 0.1 * eye, "coriolis": np.zeros((N, N)),
              "structural_damping": 0.01 * eye, "circulatory": 0.01 * eye,
              "stiffness_unsymmetric": 0.1 * eye, "damping_unsymmetric": 0.01 * eye,
              "observe/matrix": np.eye(1, N), "cyclic/left": [1], "cyclic/right": [-4],
              "aero/modes": np.eye(2, N)}
    parts |= {f"load/{name}": 0.1 * np.ones(N) for name in NODAL["load"]}
    of_air = draw.choice(["sector", "nodal_diameter"])
    parts |= {f"aero/{of_air}/{m}": pairs_of(0.01 * np.eye(2)) for m in range(-2, 3)}
    parts |= {"mesh/points": np.zeros((8, 3)), "mesh/cells": np.arange(8)[None],
              "mesh/body": [0], "mesh/kind": [12], "mesh/facets": [[0, 1, 2, 3]],
              "mesh/pair": [0], "mesh/basis": np.zeros((24, N))}
    return parts


def attributes(kind):
    found = {("", "format"): "fretwear-model", ("", "format_version"): 1, ("", "title"): "drawn",
             ("", "unit_system"): "mm-tonne-s-N", ("", "parameters"): "{}",
             ("contact", "law"): "penalty", ("cyclic", "n_sectors"): SECTORS}
    if kind == "nodal":
        found |= {("cyclic", "n_physical"): N, ("cyclic", "phase"): "delay"}
    return found


def names(group, what="all"):
    """What may stand in a group: datasets and groups, or attributes."""
    if what == "attributes":
        return ATTRIBUTES.get(group, [])
    if re.fullmatch(r"nodal_diameter/\d+", group):
        return NODAL[""] + ["load", "observe"]
    if re.fullmatch(r"nodal_diameter/\d+/(load|observe)", group):
        return NODAL[group.split("/")[-1]]
    return PLAIN.get(group, []) + GROUPS.get(group, [])


def distance(a, b):
    """Letters to insert, remove or replace, or neighbours to swap."""
    table = np.zeros((len(a) + 1, len(b) + 1), dtype=int)
    table[:, 0], table[0] = np.arange(len(a) + 1), np.arange(len(b) + 1)
    for i in range(1, len(a) + 1):
        for j in range(1, len(b) + 1):
            table[i, j] = min(table[i - 1, j] + 1, table[i, j - 1] + 1,
                              table[i - 1, j - 1] + (a[i - 1] != b[j - 1]))
            if i > 1 and j > 1 and a[i - 1] == b[j - 2] and a[i - 2] == b[j - 1]:
                table[i, j] = min(table[i, j], table[i - 2, j - 2] + 1)
    return int(table[-1, -1])


def slip(draw, word):
    """One edit or a swap."""
    k = draw.randrange(len(word))
    letter = draw.choice(string.ascii_lowercase + "_0123456789")
    swap = word[:k] + word[k + 1:k + 2] + word[k] + word[k + 2:]
    return draw.choice([word[:k] + word[k + 1:], word[:k] + letter + word[k:],
                        word[:k] + letter + word[k + 1:], swap])


def spelling(draw, group, word):
    """The same word in other letters, or as one word with its group."""
    ways = [word.upper(), word.capitalize(), word + "s"]
    ways += [word.replace("_", way) for way in ("-", " ", "") if "_" in word]
    return draw.choice(ways)


def drawn(seed):
    """A file and what is strange in it."""
    draw = random.Random(seed)
    kind = draw.choice(["plain", "plain", "nodal"])
    parts, labels = datasets(kind, draw), attributes(kind)
    for name in list(parts):
        if name not in NEEDED and "mesh/" not in name and draw.random() < 0.3 \
                and not name.startswith(("observe/", "aero/", "load/harmonic")) \
                and not name.endswith(("/mass", "/stiffness", "observe/matrix")) \
                and not name.startswith("contact/"):
            del parts[name]
    strange = draw.choice(["slip", "slip", "slip", "spelling", "place", "kind", "far", "sound"])
    return draw, kind, parts, labels, strange


def make_strange(draw, file, strange):
    """Change the file: the path of the stranger, whether it is an attribute, the word that was
    meant, and the group."""
    objects = []
    file.visit(objects.append)
    groups = ["", *[name for name in objects if isinstance(file[name], h5py.Group)]]
    sets = [name for name in objects if isinstance(file[name], h5py.Dataset)]
    while True:
        if strange == "far":
            group, word = draw.choice(groups), draw.choice(FAR)
            if draw.random() < 0.3:
                file[group or "/"].attrs[word] = 1
                return group, word, True, None
            if draw.random() < 0.3:
                file[group or "/"].create_group(word)["a"] = 1
            else:
                file[f"{group}/{word}"] = 1.0
            return group, word, False, None
        if strange == "place":
            name = draw.choice([name for name in sets if "/" in name and "mesh/" not in name])
            word, group = name.split("/")[-1], draw.choice(groups)
            if word in names(group) or is_number(word) or word in names(group, "attributes"):
                continue
            file.copy(name, f"{group}/{word}")
            return group, word, False, None
        if strange == "kind":
            return wrong_kind(draw, file, groups, sets)
        attribute = draw.random() < 0.2
        group = draw.choice([g for g in groups
                             if (ATTRIBUTES.get(g) if attribute else names(g))])
        known = names(group, "attributes" if attribute else "all")
        meant = draw.choice(known)
        word = slip(draw, meant) if strange == "slip" else spelling(draw, group, meant)
        both = names(group) + names(group, "attributes")
        if word in both or word in ("", ".") or len(word) < 2:
            continue
        place = file[group or "/"]
        if attribute:
            place.attrs[word] = place.attrs.get(meant, 1)
            if draw.random() < 0.5 and meant in place.attrs and not meant.startswith("format"):
                del place.attrs[meant]
        elif meant in place and draw.random() < 0.6:
            place.move(meant, word)
        elif meant in place:
            place.copy(meant, word)
        elif meant in [*PLAIN, "nodal_diameter", "sector"]:
            place.create_group(word)["a"] = 1
        else:
            place[word] = np.ones((N, N))
        return group, word, attribute, meant


def wrong_kind(draw, file, groups, sets):
    """Another object under a name that is known."""
    way = draw.choice(["attribute", "dataset", "group", "flat", "link"])
    if way == "attribute": # of a dataset
        name = draw.choice([name for name in sets if not is_number(name.split("/")[-1])])
        group, _, word = name.rpartition("/")
        file[group or "/"].attrs[word] = 1.0
        return group, word, True, word
    if way == "dataset": # of an attribute
        group = draw.choice(["", "contact", "cyclic"])
        word = draw.choice([w for w in ATTRIBUTES[group] if "parameters" not in w])
        file[f"{group}/{word}"] = "penalty"
        return group, word, False, word
    if way == "group":
        name = draw.choice(sets)
        del file[name]
        file.create_group(name)
    elif way == "flat":
        name = draw.choice([g for g in groups if g])
        del file[name]
        file[name] = 1.0
    else:
        name = draw.choice(sets)
        del file[name]
        file[name] = h5py.SoftLink("/nowhere")
    group, _, word = name.rpartition("/")
    return group, word, False, None


def trial(seed, program, folder):
    draw, kind, parts, labels, strange = drawn(seed)
    told = None
    with h5py.File(folder / "m.h5", "w") as file:
        for name, values in parts.items():
            file[name] = values
        for (group, name), value in labels.items():
            file.require_group(group or "/").attrs[name] = value
        if strange != "sound":
            told = make_strange(draw, file, strange)
    (folder / "c.nml").write_text(CASE)
    done = subprocess.run([program, "c.nml"], cwd=folder, capture_output=True, text=True,
                          timeout=120)
    text = done.stderr if done.returncode == 3 else done.stdout
    remark = next((line for line in text.splitlines() if "which nothing reads" in line), "")
    found = {"kind": strange, "notes": []}
    if done.returncode not in (0, 3, 4):
        found["failed"] = 1
    elif strange == "sound":
        found["blamed"] = int(done.returncode == 3 or bool(remark))
    else:
        judge(found, told, done.returncode == 3, text, remark)
    if any(found.get(key) for key in ZERO):
        found["notes"] = [f"{kind} {told} {done.returncode} {text[-400:]}"]
    return found


def judge(found, told, refused, text, remark):
    """Refused with its place, and with the name that was meant; or remarked where that will do."""
    group, word, attribute, meant = told
    path = f"/{group}/{word}".replace("//", "/")
    place = f"attribute {word} of /{group}" if attribute else path
    if not refused:
        # Beside what is read anyone may keep data of his own.
        own = meant is None and group in ("", "mesh") and place in remark
        own = own or ("parameters" in word and place in remark)
        found["remarked" if own else "silent"] = 1
        return
    if place not in text:
        found["silent"] = 1
        return
    found["refused"] = 1
    if meant is None or is_number(meant):
        return
    both = names(group) + names(group, "attributes")
    least = min(distance(tidy(word), tidy(name)) for name in both)
    near = [name for name in both if distance(tidy(word), tidy(name)) == least]
    named = re.search(r"did you mean (?:attribute )?/?([\w/]+)", text)
    last = named[1].split("/")[-1] if named else ""
    if word in both and "has shape" in text:
        # An attribute as a dataset, where a dataset of that name is a part too: its shape is told.
        last = word
    found["named" if last in near else "unnamed"] = 1


def is_number(word):
    return word.lstrip("-").isdigit()


def tidy(word):
    return re.sub(r"[- ]", "_", word.lower())
