"""What each contact law takes part in, found out by asking the program (`fw_run --check`).

A small case with one pair of the law is checked once for each column; what the program refuses is
a no, and anything but a refusal of that column's feature is an error of this table.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path
from typing import Any

__all__ = ["law_table"]

Keys = dict[str, dict[str, Any]]
Groups = dict[str, dict[str, Any]]

#: What is added to the case for each column, and a word that a refusal of it holds.
COLUMNS: dict[str, tuple[Groups, str]] = {
    "events located": ({"harmonics": {"sampling": "events"}}, "sampling"),
    "two directions": ({"contact": {"side_1": [1, 2, 0]}}, "t2"),
    "normal dof": ({"contact": {"side_1": [1, 0, 2], "normal_load": None}}, "normal"),
    "nonlinear mode": ({"case": {"analysis": "mode"}, "mode": {"number": 1, "start": 0.1,
                                                               "end": 1.0}}, "mode"),
    "stability": ({"sweep": {"stability": True}}, "stability"),
    "integration in time": ({"case": {"analysis": "time"}, "harmonics": {"sampling": None}},
                            "time"),
    "wear": ({"case": {"analysis": "wear"}, "contact": {"area": 1.0},
              "wear": {"coefficient": 1e-3, "n_cycles": 10.0}}, "wear"),
}
#: Numbers for the constants that a law requires; a further one is asked for by the program.
CONSTANTS = {"tangential_stiffness": 1.0, "normal_stiffness": 1.0, "slip_speed": 0.1,
             "iwan_chi": -0.5}


def law_table(program: str, groups: Keys) -> str:
    """A row for each column of the laws, as Markdown: those that take part."""
    keys = groups["contact"]["keys"]
    laws = keys["law"]["words"]
    taken: dict[str, list[str]] = {column: [] for column in COLUMNS}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "law.nml"
        for law in laws:
            own = {name: value for name, value in CONSTANTS.items()
                   if name in keys and f"'{law}'" in keys[name].get("only", "")}
            ask(program, path, case(law, own))
            for column, (more, word) in COLUMNS.items():
                if ask(program, path, case(law, own, more), word):
                    taken[column].append(law)
    rows = [f"| {column} | {listed(found, laws)}" for column, found in taken.items()]
    return "\n".join(["| what | laws", "|---|---", *rows])


def listed(found: list[str], laws: list[str]) -> str:
    """Laws by name, or those that are missing where they are fewer."""
    missing = [law for law in laws if law not in found]
    if not missing:
        return "all"
    fewer = len(missing) < len(found)
    names = ", ".join(f"`'{law}'`" for law in (missing if fewer else found))
    return f"all but {names}" if fewer else names


def case(law: str, constants: dict[str, float], more: Groups | None = None) -> Groups:
    """Two masses, the first of which rubs."""
    groups: Groups = {
        "case": {"analysis": "frf"},
        "model": {"n_dof": 2, "mass": [1, 0, 0, 1], "stiffness": [2, -1, -1, 2],
                  "damping": [0.1, 0, 0, 0.1]},
        "contact": {"n_pairs": 1, "law": law, "side_1": [1, 0, 0], "mu": 0.3, "normal_load": 1.0}
        | constants,
        "load": {"cosine": [1, 0]},
        "harmonics": {"n_harmonics": 3},
        "sweep": {"start": 0.5, "end": 1.5, "n_points": 3},
        # Of rigid pairs the first mass rests in a mode.
        "output": {"observe": 2},
    }
    for group, added in (more or {}).items():
        groups[group] = groups.get(group, {}) | added
    if groups["case"]["analysis"] == "mode":
        del groups["sweep"]
    if groups["contact"]["side_1"][2] == 0 and "normal_stiffness" in constants:
        groups["contact"]["normal_stiffness"] = 0.0
    return groups


def ask(program: str, path: Path, groups: Groups, word: str = "") -> bool:
    """Whether the program takes a case; a refusal has to speak of the word."""
    def literal(value: object) -> str:
        if isinstance(value, bool):
            return ".true." if value else ".false."
        if isinstance(value, list):
            return ", ".join(map(literal, value))
        return repr(value)

    path.write_text("\n".join(
        f"&{group}\n" + "".join(f"  {name} = {literal(value)}\n" for name, value in keys.items()
                               if value is not None) + "/" for group, keys in groups.items()))
    done = subprocess.run([program, "--check", str(path)], capture_output=True, text=True,
                          check=False)
    if done.returncode == 0:
        return True
    if not word or not re.search(rf"\b{word}", done.stderr):
        raise RuntimeError(f"{path.read_text()}\n{done.stderr}")
    return False
