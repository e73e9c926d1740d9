#!/usr/bin/env python3
"""The keys of the namelist as the program declares them, put into the documents and the package.

    write_keys.py [--check] [PROGRAM]

Writes the tables of the user guide, between their marks, and python/fretwear/settings.py from
`fw_run --keys=json`, the table of keys that do not go together from `fw_run --rules`, the parts of
a model file from `fw_run --parts`, remarks and messages from `fw_run --remarks` and `--messages`,
what contact laws take part in from `fw_run --check`. With --check nothing is written; the status
is 1 where a file differs.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from keyword import iskeyword
from pathlib import Path
from typing import Any

from law_table import law_table

ROOT = Path(__file__).resolve().parents[1]
#: Pages of the user guide that have tables.
PAGES = [ROOT / "docs" / f"{name}.md" for name in ("keys", "files", "messages")]
SETTINGS = ROOT / "python" / "fretwear" / "settings.py"
WIDTH = 100

Keys = dict[str, dict[str, Any]]

SETTINGS_HEAD = '''"""Settings of a case: the groups of the namelist, by the same names.

Each is a dictionary of which every key may be left out; the library knows the defaults
(`Case.namelist()` shows them) and refuses what it does not know. See the user guide for advice.
Written by tools/write_keys.py from the declarations in the library.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypedDict

from numpy.typing import ArrayLike
'''
#: Classes that are not called as their groups are.
CLASSES = {"case": "CaseGroup", "model": "Structure"}
#: What the package gives by itself.
OWN_WORDS = {"source": ["memory"]}
#: What a whole group is for, as its heading says and rows do not repeat.
GROUP_ONLY = {"mistuning": "cyclic%mistuned = .true.", "mission": "analysis = 'wear'"}


def declared(program: str) -> Keys:
    """Every group with its purpose and its keys."""
    shown = subprocess.run([program, "--keys=json"], check=True, capture_output=True, text=True)
    return json.loads(shown.stdout)


#: What to do instead of a feature wherever nothing else is said; said once, above the table.
REMEDIES = {"harmonics%accuracy": "give n_harmonics", "output%tail": "take more n_harmonics",
            "contact%memory = 'carried'": "use 'assembly'",
            "sweep%continuation = 'arclength'": "use 'natural'",
            "solver%kind = 'pseudo_time'": "use 'newton'",
            "case%analysis = 'time' or 'ringdown'": "use 'frf' or 'point'",
            "a case without a vibratory load": "set load%cosine or load%sine",
            "a case without a load in harmonic 1": "set load%cosine or load%sine"}


def rules(program: str) -> str:
    """What does not go together as Markdown: a row for each asker, what it needs and forbids."""
    shown = subprocess.run([program, "--rules"], check=True, capture_output=True, text=True)
    needs: dict[str, list[str]] = {}
    refuses: dict[str, dict[str, list[str]]] = {}
    for line in shown.stdout.splitlines():
        asks, rest = line.split(" does not go with ", 1)
        forbids, remedy = rest.split(": ", 1)
        needs.setdefault(asks, [])
        others = refuses.setdefault(asks, {})
        known = remedy == REMEDIES.get(forbids)
        remedy = action(remedy)
        known = known or not remedy
        if found := re.fullmatch(r"(\S+) other than (.*)", forbids):
            # "use" of what is needed says nothing more.
            plain = known or remedy in (f"use {found[2]}", f"set memory = {found[2]}")
            said = quoted(f"{found[1]} = {found[2]}")
            needs[asks].append(said if plain else f"{said}: {quoted(remedy)}")
        elif found := re.fullmatch(r"a (?:case|law|pair) without (.*)", forbids):
            said = quoted(found[1])
            needs[asks].append(said if known else f"{said}: {quoted(remedy)}")
        else:
            others.setdefault("" if known else remedy, []).append(forbids)
    common = [f"* {quoted(name)}: {quoted(remedy)}" for name, remedy in REMEDIES.items()]
    lines = ["A remedy stands behind a colon. Without one, leave one of the two out; of these:",
             "", *common, "", "| what | needs | does not go with |", "|---|---|---|"]
    for asks, remedies in refuses.items():
        cells = [", ".join(map(quoted, forbids)) + (f": {quoted(remedy)}" if remedy else "")
                 for remedy, forbids in remedies.items()]
        lines.append(f"| {quoted(asks)} | {'; '.join(needs[asks])} | {'; '.join(cells)} |")
    return "\n".join(lines)


def action(remedy: str) -> str:
    """What to do, without the reason that the program gives; empty where it is to leave out."""
    last = re.split("[;:] ", remedy)[-1]
    if re.fullmatch("leave (it|them|stability|the speeds) out", last):
        return ""
    told = re.match("(use|give|leave|take|set|sweep|run|follow) ", last) and "this" not in last
    return last if told else remedy


def parts(program: str) -> str:
    """What a model file may hold, as Markdown; one row for parts that differ in their name alone.

    Kinds are said where they are not real, `[pair]` is one value each or one for all.
    """
    shown = subprocess.run([program, "--parts"], check=True, capture_output=True, text=True)
    code = re.compile(r"\w+%\w+|&\w+|(?<!\w)/\w+(?:/\w+)*|'[^']+'|coefficient \* \w+\*\*power")
    rows: list[tuple[str, str, str]] = []
    for line in shown.stdout.splitlines()[2:]:
        name, kind, shape, required, text = line.removeprefix("| ").removesuffix(" |").split(" | ")
        shape = re.sub(r"\((\w+)\) or scalar", r"[\1]", shape.strip())
        shape = shape if kind == "real" else f"{kind} {shape}".strip()
        text = code.sub(lambda found: f"`{found[0]}`", text)
        if required := required.strip():
            path = name.split("`")[1]
            group = path if " attribute " in name else path.rsplit("/", 1)[0]
            own = required in ("required", "with its group", f"with {group}")
            text = f"{'required' if own else required}: {text}"
        last = rows[-1] if rows else ("", "", "")
        if shape == last[1] and text in ("likewise", "the same along t2"):
            text = last[2] if text == "likewise" else last[2].replace("along t1", "along t1, t2")
            rows[-1] = (f"{last[0]}, `{name.strip('`').rsplit('/', 1)[1]}`", shape, text)
        else:
            rows.append((name, shape, text))
    return "\n".join(["| name | shape | meaning |", "|---|---|---|",
                      *(f"| {name} | {shape} | {text} |" for name, shape, text in rows)])


def said(program: str, option: str) -> str:
    """What a run may remark, and its messages, as Markdown."""
    shown = subprocess.run([program, option], check=True, capture_output=True, text=True)
    code = re.compile(r"(?:fw_run |fretwear run |(?<!\w))--\w+|&contact worn|&\w+ \w+ = '[^']+'|"
                      r"\w+%\w+(?: = '[^']+')?|&\w+|(?<![\w)])/\w+(?:/\w+)*|"
                      r"\w+ = (?:'[^']+'|[\d.]+(?:e[+-]?\d+)?)|'[^']+'|\b[a-z]+_[a-z][a-z_0-9]*\b")
    lines = shown.stdout.splitlines()
    for k, line in enumerate(lines[2:], 2):
        name, text = line.removeprefix("| ").removesuffix(" |").split(" | ", 1)
        lines[k] = f"| `{name}` | {code.sub(lambda found: f'`{found[0]}`', text)} |"
    return "\n".join(lines)


def quoted(feature: str) -> str:
    """A feature with its key as code, and what it says of it as text."""
    return re.sub(r"\b\w+%\w+(?: = (?:'[^']*'|\.true\.|\d+))?|&\w+|/\w+/\w+|'[^']+'|"
                  r"\b\w+_\w+\b", r"`\g<0>`", feature)


def number(value: float) -> str:
    return f"{value:g}" if abs(value) >= 1e7 else f"{value}"


def range_text(key: dict[str, Any]) -> str:
    """Such as `> 0, < 1`; '' where every number will do."""
    if "within" in key:
        return f"within +-{key['within']}"
    if "least" in key and "most" in key:
        return f"{number(key['least'])} to {number(key['most'])}"
    bounds = [("above", ">"), ("least", ">="), ("below", "<"), ("most", "<=")]
    return ", ".join(f"{sign} {number(key[name])}" for name, sign in bounds
                     if name in key and abs(key[name]) < 1e300)


def accepts(key: dict[str, Any]) -> str:
    kind = key["type"]
    if kind == "word":
        words = ", ".join(f"`'{word}'`" for word in key["words"])
        return f"{words}; [{key['shape']}]" if "shape" in key else words
    if kind in ("text", "list"):
        return "text" if kind == "text" else coded(key["accepts"])
    if kind == "logical":
        return "logical"
    if key.get("whole"):
        kind = "whole number"
    text = f"{kind}s" if "shape" in key else kind
    if bounds := range_text(key):
        text = bounds if "shape" not in key else f"{text} {bounds}"
    if "shape" in key and key["shape"] != ":":
        text += f" [{key['shape']}]" if key["repeats"] else f" ({key['shape']})"
    return text


def default(key: dict[str, Any]) -> str:
    """In words and, where the component has one, the value."""
    parts = [coded(key["absent"])] if "absent" in key else []
    if "default" in key:
        parts.append(f"`{key['default']}`")
    return re.sub("^of the file", "file", ", else ".join(parts))


def coded(text: str) -> str:
    """Words in quotes, and names with an underscore or of a dataset, as code."""
    return re.sub(r"\w+ = '[^' ]+'|'[^' ]+'|/\w+/\w+|\w+/\w+_\w+|\b\w+_\w+\b", r"`\g<0>`", text)


def meaning(key: dict[str, Any], group: str) -> str:
    """Unit, help and where the key acts, where that is not the whole group."""
    text = coded(key["help"])
    if "unit" in key:
        text = ("`unit`: " if key["unit"] == "unit" else f"[{key['unit']}] ") + text
    own = GROUP_ONLY.get(group, f"analysis = '{group}'")
    only = key.get("only", "").removeprefix(own).removeprefix(", ")
    return f"{text}; only: {coded(only)}" if only else text


def table(group: str, keys: dict[str, Any], parameters: str) -> str:
    """The keys of a group as Markdown; the long list of parameters stands in one of them."""
    lines = ["| key | default | accepts | meaning |", "|---|---|---|---|"]
    for name, key in keys.items():
        words = accepts(key)
        if group != "sweep":
            words = words.replace(parameters, "those of `sweep%parameter` but `'frequency'`")
        lines.append(f"| `{name}` | {default(key)} | {words} | {meaning(key, group)} |")
    return "\n".join(lines)


def tables(groups: Keys, program: str) -> dict[str, tuple[str, str]]:
    """What stands between two marks: {first mark: (last mark, lines)}."""
    words = groups["sweep"]["keys"]["parameter"]["words"]
    parameters = ", ".join(f"`'{word}'`" for word in words if word != "frequency")
    found = {f"keys of {group}": ("end of keys", table(group, content["keys"], parameters))
             for group, content in groups.items()}
    return found | {"parts of a model file": ("end of parts", parts(program)),
                    "remarks": ("end of remarks", said(program, "--remarks")),
                    "messages": ("end of messages", said(program, "--messages")),
                    "laws": ("end of laws", law_table(program, groups)),
                    "rules": ("end of rules", rules(program))}


def renewed(found: dict[str, tuple[str, str]]) -> dict[Path, str]:
    """The pages with their tables; each table has its place in one of them."""
    pages = {page: page.read_text() for page in PAGES}
    for name, (last, lines) in found.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- {last} -->"
        pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
        homes = [page for page, text in pages.items() if pattern.search(text)]
        if len(homes) != 1:
            sys.exit(f"docs: {len(homes)} pages have a table of {name}, must be one: put "
                     f"{begin.strip()} and {end} there")
        new = begin + lines + "\n" + end
        pages[homes[0]] = pattern.sub(lambda _, new=new: new, pages[homes[0]])
    return pages


def annotation(name: str, key: dict[str, Any]) -> str:
    if "shape" in key and key["type"] != "word":
        return "ArrayLike"
    if key["type"] == "word":
        words = [word for word in key["words"] if word not in OWN_WORDS.get(name, [])]
        one = "Literal[" + ", ".join(f'"{word}"' for word in words) + "]"
        return f"{one} | Sequence[str]" if "shape" in key else one
    return {"real": "float", "integer": "int", "logical": "bool", "text": "str",
            "list": "str | int | Sequence[str | int]"}[key["type"]]


def wrapped(start: str, words: str, end: str = "") -> list[str]:
    """A declaration in lines that are not too long."""
    lines, line, indent = [], start, " " * (start.rindex(" ") + 1 + len("Literal["))
    for k, word in enumerate(parts := words.split(", ")):
        last = k == len(parts) - 1
        text = word + (end if last else ",")
        if k and len(line) + len(text) + 1 > WIDTH:
            lines.append(line.rstrip())
            line = indent
        line += text if line in (start, indent) else f" {text}"
    return [*lines, line]


def comment(key: dict[str, Any]) -> list[str]:
    """Unit, default and help, as lines that the reference takes up."""
    text = f"[{key['unit']}] " if key.get("unit", "unit") != "unit" else ""
    text += key["help"]
    if "only" in key:
        text += f"; only: {key['only']}"
    parts = [key["absent"]] if "absent" in key else []
    parts += [key["default"]] if "default" in key else []
    said = ", else ".join(parts)
    text += f" ({said})" if said.startswith("required") else f" (default: {said})"
    lines, line = [], "    #:"
    for word in text.split():
        if len(line) + len(word) + 1 > WIDTH:
            lines.append(line)
            line = "    #:"
        line += f" {word}"
    return [*lines, line]


def settings(groups: Keys) -> str:
    """The module of the package."""
    names = {group: CLASSES.get(group, "".join(part.title() for part in group.split("_")))
             for group in groups}
    public = ["UNITS", *sorted([*names.values(), "Groups"])]
    lines, line = [], '__all__ = ["' + public[0] + '"'
    for name in public[1:]:
        if len(line) + len(name) + 5 > WIDTH:
            lines.append(line + ",")
            line = '           "' + name + '"'
        else:
            line += f', "{name}"'
    text = [SETTINGS_HEAD, *lines, line + "]"]
    text += ["",
             "#: Units of the keys that have one: length L, mass M, time s and force F of the "
             "model,",
             "#: or `unit` where another key says it.", "UNITS: dict[str, str] = {"]
    text += [f'    "{group}%{name}": "{key["unit"]}",' for group, content in groups.items()
             for name, key in content["keys"].items() if key.get("unit")]
    text += ["}"]
    for group, content in groups.items():
        # Keys that are words of Python need the other form of declaration.
        reserved = {name: key for name, key in content["keys"].items() if iskeyword(name)}
        base = "TypedDict"
        if reserved:
            base = f"_{names[group]}"
            text += ["", "", f'{base} = TypedDict("{base}", {{']
            for name, key in reserved.items():
                text += [*comment(key), *wrapped(f'    "{name}": ', annotation(name, key), ",")]
            text += ["}, total=False)"]
        text += ["", "", f"class {names[group]}({base}, total=False):",
                 f'    """Group &{group}: {content["help"]}."""', ""]
        for name, key in content["keys"].items():
            if name not in reserved:
                text += [*comment(key), *wrapped(f"    {name}: ", annotation(name, key))]
    text += ["", "", "class Groups(TypedDict, total=False):",
             '    """All groups; `model` is the one that `structure` stands for where a model is '
             'an argument."""', ""]
    text += [f"    {'structure' if group == 'model' else group}: {name}"
             for group, name in names.items()]
    return "\n".join(text) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", nargs="?", default=str(ROOT / "build" / "release" / "fw_run"))
    parser.add_argument("--check", action="store_true", help="write nothing, compare")
    arguments = parser.parse_args()
    groups = declared(arguments.program)
    stale = 0
    written = renewed(tables(groups, arguments.program)) | {SETTINGS: settings(groups)}
    for path, text in written.items():
        if path.read_text() == text:
            continue
        if arguments.check:
            print(f"{path.relative_to(ROOT)}: is not what the program declares: run make keys")
            stale = 1
        else:
            path.write_text(text)
    return stale


if __name__ == "__main__":
    sys.exit(main())
