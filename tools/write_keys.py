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


def rules(program: str) -> str:
    """What does not go together as Markdown: a row for each asker, what it needs and forbids.

    Remedies stand in the messages and in `fw_run --rules`.
    """
    shown = subprocess.run([program, "--rules"], check=True, capture_output=True, text=True)
    needs: dict[str, list[str]] = {}
    refuses: dict[str, list[str]] = {}
    askers = []
    for line in shown.stdout.splitlines():
        asks, rest = line.split(" does not go with ", 1)
        askers.append(asks)
        forbids = re.sub(r" \(contact%.*\)|, (?:which|whose) .*", "", rest.split(": ", 1)[0])
        if found := re.fullmatch(r"(\S+) other than (.*)", forbids):
            needs.setdefault(asks, []).append(f"{found[1]} = {found[2]}")
        elif found := re.fullmatch(r"a (?:case|law|pair) without (.*)", forbids):
            needs.setdefault(asks, []).append(found[1])
        else:
            refuses.setdefault(asks, []).append(forbids)
    rows = [f"| {quoted(asks)} | {cell(needs, asks)} | {cell(refuses, asks)}".rstrip()
            for asks in dict.fromkeys(askers)]
    return "\n".join(["| what | needs | does not go with", "|---|---|---", *rows])


def cell(found: dict[str, list[str]], asks: str) -> str:
    return quoted(", ".join(found.get(asks, [])))


#: Parts that have the name of a key and are something else.
OWN_PARTS = ("gap_harmonic",)


def home(name: str) -> str:
    """The group of a part as Markdown names it; an attribute has a home of its own."""
    path = name.split("`")[1]
    return f"{path}@" if " attribute " in name else path.rpartition("/")[0]


def parts(program: str, groups: Keys) -> str:
    """What a model file may hold, as Markdown; one row for parts that differ in their name alone.

    Kinds are said where they are not real, `[pair]` is one value each or one for all. Parts that a
    key of the same group and name explains stand together.
    """
    shown = subprocess.run([program, "--parts"], check=True, capture_output=True, text=True)
    code = re.compile(r"\w+%\w+|&\w+|(?<!\w)/\w+(?:/\w+)*|'[^']+'|coefficient \* \w+\*\*power")
    rows: list[tuple[str, str, str]] = []
    for line in shown.stdout.splitlines()[2:]:
        name, kind, shape, required, text = line.removeprefix("| ").removesuffix(" |").split(" | ")
        shape = re.sub(r"\((\w+)\) or scalar", r"[\1]", shape.strip()).replace(", ", ",")
        shape = shape if kind == "real" else f"{kind} {shape}".strip()
        text = code.sub(lambda found: f"`{found[0]}`", text)
        path = name.split("`")[1]
        group, _, last_name = path.removeprefix("/").rpartition("/")
        keys = groups.get(group or "model", {}).get("keys", {})
        attribute = name.split("`")[3] if " attribute " in name else ""
        keys = groups.get(path.strip("/") or "model", {}).get("keys", {}) if attribute else keys
        of_key = (attribute or last_name) in keys and last_name not in OWN_PARTS
        if of_key:
            text = "key"
        if required := required.strip():
            above = path if " attribute " in name else path.rsplit("/", 1)[0]
            own = required in ("required", "with its group", f"with {above}")
            text = f"{'required' if own else required}: {text}"
        text = re.sub(r"; law = `.*", "", text)
        last = rows[-1] if rows else ("", "", "")
        same = next((k for k, row in enumerate(rows) if of_key and row[1:] == (shape, text)
                     and home(row[0]) == home(name)), None)
        if same is not None:
            rows[same] = (f"{rows[same][0]}, `{attribute or last_name}`", shape, text)
        elif shape == last[1] and "attribute" not in name and text in ("likewise", last[2]):
            rows[-1] = (f"{last[0]}, `{last_name}`", shape, last[2])
        else:
            rows.append((name, shape, text))
    return "\n".join(["| name | shape | meaning", "|---|---|---",
                      *(f"| {name} | {shape} | {text}" for name, shape, text in rows)])


#: Words by which a message is known.
MESSAGE = 9


def said(program: str, option: str) -> str:
    """What a run may remark, in its first clause, and its messages, as Markdown."""
    shown = subprocess.run([program, option], check=True, capture_output=True, text=True)
    code = re.compile(r"(?:fw_run |fretwear run |(?<!\w))--\w+|&contact worn|&\w+ \w+ = '[^']+'|"
                      r"\w+%\w+(?: = '[^']+')?|&\w+|(?<![\w)])/\w+(?:/\w+)*|"
                      r"\w+ = (?:'[^']+'|[\d.]+(?:e[+-]?\d+)?)|'[^']+'|\b[a-z]+_[a-z][a-z_0-9]*\b")
    heads, *lines = shown.stdout.splitlines()
    rows = [heads.removesuffix(" |"), "|---|---"]
    for line in lines[1:]:
        name, text = line.removeprefix("| ").removesuffix(" |").split(" | ", 1)
        text = first_clause(text) if option == "--remarks" else text.split(". Exit status")[0]
        text = code.sub(lambda found: f"`{compact(found[0])}`", text)
        words = name.split(" ")
        if len(words) > MESSAGE + 1:
            name = " ".join([*words[:MESSAGE], "..."])
        rows.append(f"| `{name}` | {text}")
    return "\n".join(rows)


#: Where a remark is made, before it says what of.
WHERE = re.compile(r"(?:wear|campbell|bounds|population|&\w+|\w+ = '\w+'|fw_run --explain): ")

#: What follows a remark as its reason.
REASON = re.compile(r", (?:as|so that|even|however|which) ")
#: Words that hardly say what of.
FEW = 6


def first_clause(text: str) -> str:
    """Without parentheses and what follows a semicolon, a colon or the first sentence."""
    text = re.sub(r" \((?![xyz])[^()]*(?:\([^()]*\)[^()]*)*\)", "", text)
    start = found.end() if (found := WHERE.match(text)) else 0
    first, *rest = re.split(r"[;:] |\. (?=[A-Z])", text[start:])
    if rest and len(first.split()) < FEW:
        first = f"{first}: {rest[0]}"
    return text[:start] + REASON.split(first)[0].removesuffix(".")


def compact(setting: str) -> str:
    """A key and its value without blanks, and without .true. alone."""
    return setting.replace(" = .true.", "").replace(" = ", "=")


def quoted(feature: str) -> str:
    """A feature with its key as code, and what it says of it as text."""
    return re.sub(r"\b\w+%\w+(?: = (?:'[^']*'|\.true\.|\d+))?|&\w+|/\w+/\w+|'[^']+'|"
                  r"\b\w+_\w+\b", lambda found: f"`{compact(found[0])}`", feature)


def number(value: float) -> str:
    return f"{value:g}" if abs(value) >= 1e7 else f"{value}"


def range_text(key: dict[str, Any]) -> str:
    """Such as `>0, <1`; '' where every number will do, and for counts."""
    if "within" in key:
        return "dofs" if "n_rows" in str(key["within"]) else f"+-{key['within']}"
    least, most = key.get("least", -1e300), key.get("most", 1e300)
    counts = key["type"] == "integer" and least in (0, 1)
    if most >= 1000 and counts:
        return ""
    if least > -1e300 and most < 1000:
        return f"{number(least)} to {number(most)}"
    bounds = [("above", ">"), ("least", ">="), ("below", "<"), ("most", "<=")]
    return ", ".join(f"{sign}{number(key[name])}" for name, sign in bounds
                     if name in key and abs(key[name]) < 1000)


def accepts(key: dict[str, Any]) -> str:
    """What the default does not say: words, bounds and the shape."""
    kind = key["type"]
    shape = key.get("shape", ":").replace(" x ", "*")
    shape = "" if shape == ":" else f"[{shape}]" if key["repeats"] else f"({shape})"
    if kind == "word":
        words = [f"**`'{word}'`**" if f"'{word}'" == key.get("default") else f"`'{word}'`"
                 for word in key["words"]]
        return " ".join(filter(None, (", ".join(words), shape)))
    if kind in ("text", "logical"):
        return ""
    if kind == "list":
        return ""
    return " ".join(filter(None, (range_text(key), shape)))


def default(key: dict[str, Any]) -> str:
    """In words and, where the component has one, the value; a model file stands above both."""
    absent = re.sub("^of the file(, else )?", "", key.get("absent", ""))
    absent = re.sub(r"required with (?:n_\w+|coefficient)", "required", absent)
    if absent == "required":
        return absent
    parts = [coded(absent)] if absent not in ("", "none") else []
    if "default" in key and key["type"] != "word":
        parts.append(f"`{key['default']}`")
    elif "default" in key and absent:
        parts.append("the bold word")
    return ", else ".join(parts)


def coded(text: str) -> str:
    """Words in quotes, and names with an underscore or of a dataset, as code."""
    return re.sub(r"\w+ = '[^' ]+'|'[^' ]+'|/\w+/\w+|\w+/\w+_\w+|\b\w+_\w+\b",
                  lambda found: f"`{compact(found[0])}`", text)


#: Laws of pairs that may slide.
MOST_LAWS = "law = 'dlft', 'dlft_velocity', 'penalty', 'rigid', 'regularised'"


def condition(key: dict[str, Any], group: str) -> str:
    """Where a key acts, if that is not the whole group."""
    own = GROUP_ONLY.get(group, f"analysis = '{group}'")
    only = key.get("only", "").removeprefix(own).removeprefix(", ")
    return coded(only.replace(MOST_LAWS, "law not 'iwan', 'bouc_wen'"))


def meaning(key: dict[str, Any]) -> str:
    """Unit and help."""
    text = coded(key["help"])
    if "unit" in key:
        text = ("`unit`: " if key["unit"] == "unit" else f"[{key['unit']}] ") + text
    return text


#: So many keys that act under one condition have a table of their own.
TOGETHER = 3


def table(group: str, keys: dict[str, Any], parameters: list[str]) -> str:
    """The keys of a group as Markdown: those without condition, then those of each condition.

    The long list of parameters stands in `sweep%parameter` alone.
    """
    found: dict[str, list[str]] = {"": []}
    conditions = [condition(key, group) for key in keys.values()]
    for (name, key), only in zip(keys.items(), conditions):
        words = accepts(key)
        if group != "sweep" and key.get("words", [])[-len(parameters):] == parameters:
            words = "those of `sweep%parameter`"
        values = "; ".join(filter(None, (default(key), words)))
        text = meaning(key)
        apart = conditions.count(only) >= TOGETHER
        rows = found.setdefault(only if apart else "", [])
        same = re.match(r"(?:\[[^]]*\] )?(?:the same|likewise)(?: along t2)?$", text)
        if only and not apart:
            text += f"; only: {only}"
        if rows and same and rows[-1].split(" | ")[1] == values:
            rows[-1] = rows[-1].replace(" | ", f", `{name}` | ", 1)
        else:
            rows.append(f"| `{name}` | {values} | {text}")
    lines = []
    for only, rows in found.items():
        head = f"with {only}" if only else "key"
        lines += [*([""] if lines else []), f"| {head} | values | meaning", "|---|---|---", *rows]
    return "\n".join(lines)


def tables(groups: Keys, program: str) -> dict[str, tuple[str, str]]:
    """What stands between two marks: {first mark: (last mark, lines)}."""
    words = groups["sweep"]["keys"]["parameter"]["words"]
    parameters = [word for word in words if word != "frequency"]
    found = {f"keys of {group}": ("end of keys", table(group, content["keys"], parameters))
             for group, content in groups.items()}
    return found | {"parts of a model file": ("end of parts", parts(program, groups)),
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
