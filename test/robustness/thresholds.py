"""What the limits of heuristics are worth: each is halved and doubled, and random families look.

    python test/robustness/thresholds.py [RECORD ...] [--cases N] [-o]

The limits stand in records (RECORDS below). The tree is copied, and in the copy, which is built
once, they become variables that the environment sets: the program itself has no such switch. A
family of the record then runs with every limit times 0.5 and times 2 (parts above a half: with
what they leave of 1 halved and doubled), and with none. Counted are cases whose answer differs
(beyond what Newton's method leaves), those whose judge finds them wrong in more or in fewer cases
than with the limit as it is, and iterations. With -o the tables go into
docs/robustness/thresholds.md; what has been counted is kept in build/thresholds.
"""
from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / folder) for folder in ("support", "families", "branches")]
import accuracies  # noqa: E402
import branch_chains  # noqa: E402
import branch_joints  # noqa: E402
import peak_family  # noqa: E402
from cases import write_namelist  # noqa: E402
from project import EXAMPLE, PATIENT, ROOT  # noqa: E402
from revision import revision  # noqa: E402

STATE = ROOT / "build" / "thresholds"
PAGE = ROOT / "docs" / "robustness" / "thresholds.md"
FACTORS = (0.5, 2.0)
SWITCH = "FW_THRESHOLD"
#: Answers that differ by less, relative, are one: solutions are good to 1e-8 of the load.
SAME = 1e-5
SECONDS = 60
#: Cases that take longer, after which a change counts as endless.
MOST_ENDLESS = 3
#: Record: its source, the name of its constant, cases.
RECORDS = {"sizes": ("src/base/size_options.f90", "sizes", 10),
           "curve": ("src/solve/curve_options.f90", "limits", 60),
           "peak": ("src/driver/peak_options.f90", "limits", 60),
           "accuracy": ("src/driver/accuracy_options.f90", "limits", 66)}
TITLES = {"sizes": "Sizes", "curve": "Steps along a branch", "peak": "Maxima between rows",
          "accuracy": "Errors of a balance"}
#: Runs whose sizes lie about the limits: name, namelist, keys.
SIZED = (
    ("blade_sector/frf.nml", "sweep%n_points=9"),
    ("blade_sector/frf.nml", "sweep%n_points=9", "harmonics%n_harmonics=1", "harmonics%n_time=128"),
    ("blade_sector/frf_48.nml", "sweep%n_points=3"),
    ("blade_sector/frf.nml", "sweep%continuation='arclength'", "sweep%n_points=31"),
    ("blade_sector/frf.nml", "sweep%n_points=5", "contact%law='penalty'",
     "contact%tangential_stiffness=2e4", "contact%normal_stiffness=2e4"),
    ("duffing/duffing.nml", "sweep%n_points=9"),
    ("jenkins/jenkins.nml", "sweep%n_points=9"),
)


@dataclass(frozen=True)
class Limit:
    """A component of a record, and its value."""

    record: str
    name: str
    kind: str
    value: float

    def changed(self, factor):
        """The value times the factor; None where that is none."""
        if self.kind == "integer":
            new = int(self.value * factor)
            return None if new == self.value else new
        if 0.5 < self.value < 1.0 and not re.search("turn|chord", self.name):
            return 1.0 - factor * (1.0 - self.value) if factor * (1.0 - self.value) < 1.0 else None
        return self.value * factor


def limits(record, tree=ROOT):
    """Every component of a record."""
    text = re.sub(r"!.*", "", (tree / RECORDS[record][0]).read_text())
    body = text[text.index("type :: "):text.index("end type")]
    found = []
    for kind, names in re.findall(r"(real\(wp\)|integer) :: (.*)", body):
        for name, value in re.findall(r"(\w+) = ([^,]+)", names):
            number = eval(value.replace("_wp", "").strip(), {"__builtins__": {}})
            found.append(Limit(record, name, kind.removesuffix("(wp)"), number))
    return found


def build(tree):
    """A copy of the tree whose limits the environment sets; its program."""
    for name in ("src", "app", "cmake", "include", "CMakeLists.txt"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tree / name)
    make_variable(tree)
    for command in (["cmake", "-S", tree, "-B", tree / "build", "-G", "Ninja",
                     "-DFRETWEAR_TESTS=OFF", "-DFRETWEAR_PYTHON=OFF", "-DFRETWEAR_SHARED=OFF"],
                    ["cmake", "--build", tree / "build", "--target", "fw_run"]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    return tree / "build" / "fw_run"


def make_variable(tree):
    """Let the environment set one limit of the program of a tree."""
    uses, rows = [], []
    for record, (path, name, _) in RECORDS.items():
        text = (tree / path).read_text()
        fixed = re.search(r"   type\((\w+)\), parameter :: (\w+) = \1\(\)\n", text)
        (tree / path).write_text(text.replace(fixed[0], f"   type({fixed[1]}) :: {name} = "
                                                        f"{fixed[1]}()\n"))
        module = re.search(r"^module (\w+)", text, re.MULTILINE)[1]
        uses.append(f"   use {module}, only: {record}_limits => {name}")
        rows += [f"      case ('{limit.record}%{limit.name}')\n"
                 f"         read (value, *) {record}_limits%{limit.name}"
                 for limit in limits(record)]
    (tree / "app" / "thresholds.f90").write_text("\n".join([
        "module fw_thresholds", *uses, "   implicit none (type, external)", "   private",
        "   public :: take_threshold", "contains", "   subroutine take_threshold()",
        "      character(80) :: text, value", "      integer :: equal, length",
        f"      call get_environment_variable('{SWITCH}', text, length)",
        "      if (length == 0) return", "      equal = index(text, '=')",
        "      value = text(equal + 1:)", "      select case (text(:equal - 1))", *rows,
        "      case default", "         error stop 'no such limit'", "      end select",
        "   end subroutine take_threshold", "end module fw_thresholds", ""]))
    main = tree / "app" / "main.f90"
    text = main.read_text()
    text = text.replace("   use fw_version,", "   use fw_thresholds, only: take_threshold\n"
                                              "   use fw_version,", 1)
    main.write_text(text.replace("   call main(status)\n",
                                 "   call take_threshold()\n   call main(status)\n", 1))


def solve(program, setting, folder, *words):
    """Run a case: status, what the summary counts, and every real dataset."""
    result = folder / "case.h5"
    result.unlink(missing_ok=True)
    environment = {**PATIENT, "OMP_NUM_THREADS": "1", **({SWITCH: setting} if setting else {})}
    try:
        done = subprocess.run([program, "-o", result, *words], cwd=folder, env=environment,
                              capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return -1, {}, {}
    work = {name: int(number) for name, number in re.findall(
        r"^(iterations) +(\d+)", done.stdout, re.MULTILINE)}
    work.update((name, int(number)) for number, name in re.findall(
        r"(\d+) (LU factorizations|Krylov iterations|preconditioners)", done.stdout))
    data = {}
    if done.returncode in (0, 4):
        with h5py.File(result) as file:
            file.visititems(lambda name, item: data.update(
                {name: item[()]} if isinstance(item, h5py.Dataset) else {}))
    return done.returncode, work, data


def differ(one, other, names):
    """Whether an answer is another one: shapes, or numbers beyond what solutions leave."""
    for name in names:
        first, second = one.get(name), other.get(name)
        if first is None or second is None or first.shape != second.shape:
            if first is not second:
                return True
            continue
        first, second = (np.asarray(array, float) for array in (first, second))
        both = np.isfinite(first) & np.isfinite(second)
        size = np.abs(second[both]).max(initial=0.0)
        if (np.isfinite(first) != np.isfinite(second)).any() or (
                np.abs(first - second)[both].max(initial=0.0) > SAME * size):
            return True
    return False


class Peaks:
    """Sweeps of few points: the highest amplitude against modes, or against fine sweeps."""

    TEXT = ("Sweeps of few points of `make peaks` (linear chains, sliders, friction, stops, cubic "
            "springs), with their judges: wrong is a highest amplitude that is off by more than "
            "1e-3 without a remark.")
    NAMES = ("peak/omega", "peak/amplitude", "peak/found_by")

    def __init__(self, program):
        self.program, self.true = program, {}

    def case(self, seed, setting, folder):
        groups = (peak_family.linear if seed % 2 == 0 else peak_family.nonlinear)(seed)[0]
        write_namelist(folder / "case.nml", groups)
        return solve(self.program, setting, folder, "case.nml")

    def wrong(self, seed, found, folder):
        if seed not in self.true:
            if seed % 2 == 0:
                self.true[seed] = peak_family.linear(seed)[1]
            else:
                groups, _, ratio = peak_family.nonlinear(seed)
                self.true[seed] = peak_family.fine_peak(folder, groups, ratio)
        true = self.true[seed]
        if found[0] not in (0, 4):
            return 1
        if not true or (seed % 2 and peak_family.stands_elsewhere(folder / "case.h5", true)):
            return 0
        peak, remark = peak_family.reported(folder / "case.h5")
        return int(abs(peak / true - 1.0) > peak_family.RIGHT and not remark)


class Curves:
    """Branches by arc length: linear chains against their matrices, joints against sweeps."""

    TEXT = ("Branches of `test/branches`: linear chains against their matrices, and joints against "
            "fine sweeps. Wrong are branches that turn back, pass over a resonance, miss a fold, "
            "leave the curve, or end before its end.")
    NAMES = ("fold",)

    def __init__(self, program):
        self.program, self.sweeps = program, {}

    @staticmethod
    def drawn(seed):
        """A chain or a joint, and the points asked for."""
        if seed % 2 == 0:
            return branch_chains.random_chain(seed), (11, 41)[seed // 2 % 2]
        return branch_joints.random_joint(seed), 31

    def case(self, seed, setting, folder):
        item, points = self.drawn(seed)
        text = item.case(points) if seed % 2 == 0 else item.case(points, "arclength")
        (folder / "case.nml").write_text(text)
        return solve(self.program, setting, folder, "case.nml")

    def wrong(self, seed, found, folder):
        status, _, data = found
        if status not in (0, 4):
            return 1
        item, _ = self.drawn(seed)
        if seed % 2 == 0:
            verdict = branch_chains.judge(item, data["omega"], data["coefficients"], status)
            return int(verdict.turned or verdict.skipped > 0 or verdict.incomplete or verdict.off)
        if seed not in self.sweeps:
            self.sweeps[seed] = []
            for backwards in (False, True):
                (folder / "fine.nml").write_text(
                    item.case(branch_joints.FINE, "natural", backwards))
                self.sweeps[seed].append(self.rows(solve(self.program, "", folder, "fine.nml")[2]))
        verdict = branch_joints.judge(item, self.rows(data), self.sweeps[seed], status)
        return int(verdict.incomplete or verdict.off > 0 or verdict.missed > 0)

    @staticmethod
    def rows(data):
        omega = data["omega"]
        found = (omega, data["converged"].astype(bool), data["coefficients"],
                 data.get("fold", np.zeros(len(omega))).astype(bool))
        if "tangent/omega" in data:
            found += (np.column_stack([data["tangent/omega"], data["tangent/coefficients"].reshape(
                len(omega), -1)]),)
        return found


class Claims:
    """Points to an accuracy, against a march in time."""

    TEXT = ("Points of the family [accuracies](accuracies.md), against its march in time: wrong "
            "are claims that are not kept, and points without one.")
    NAMES = ("coefficients", "error_estimate", "harmonics", "instants")

    def __init__(self, program):
        self.program, self.known = program, {}

    def case(self, seed, setting, folder):
        write_namelist(folder / "case.nml", accuracies.drawn(seed)[1])
        status, work, data = solve(self.program, setting, folder, "case.nml")
        if "iterations" in data:
            work["iterations"] = int(data["iterations"][-1])
        return status, work, data

    def wrong(self, seed, found, _folder):
        _, groups, accuracy = accuracies.drawn(seed)
        status, _, data = found
        if status not in (0, 4) or not data["converged"][-1]:
            return 1
        if data["error_estimate"][-1] > accuracy:
            return 1
        answer = data["coefficients"][-1]
        key = seed, hashlib.sha256(answer.tobytes()).hexdigest()
        if key not in self.known:
            judge = accuracies.march.March(groups)
            told = judge.periodic(answer, accuracies.WANTED * accuracy)
            broken = 0
            if told is not None and told[1] <= accuracies.RESOLVES * accuracy:
                true = accuracies.march.error(accuracies.march.synthesis(answer), told[0])
                other = true > accuracies.OTHER or (judge.rests and true > accuracy)
                broken = int(not other and true > accuracy + told[1])
            self.known[key] = broken
        return self.known[key]


class Sizes:
    """Runs about the sizes: another way is noticed by its work, and must give the same answer."""

    TEXT = ("Examples of 1 to 48 pairs. Another way to the same answer is noticed by its work "
            "(iterations, LU factorizations, Krylov iterations, preconditioners); wrong are "
            "answers that differ by more than 1e-5, and points that do not converge.")
    NAMES = ()

    def __init__(self, program):
        self.program, self.base = program, {}

    def case(self, seed, setting, folder):
        namelist, *keys = SIZED[seed]
        words = [word for key in keys for word in ("--set", key)]
        found = solve(self.program, setting, folder, *words, EXAMPLE / namelist)
        if not setting:
            self.base[seed] = found
        return found

    def wrong(self, seed, found, _folder):
        names = () if "arclength" in str(SIZED[seed]) else ("coefficients",)
        return int(found[0] != 0 or differ(found[2], self.base[seed][2], names))


FAMILIES = {"sizes": Sizes, "curve": Curves, "peak": Peaks, "accuracy": Claims}


class Counter:
    """Runs a family with one limit changed after the other."""

    def __init__(self, record, program, cases, state):
        self.record, self.state = record, state
        self.seeds = range(min(cases, len(SIZED)) if record == "sizes" else cases)
        self.family = FAMILIES[record](program)
        self.base = {}

    def start(self, folder):
        """With every limit as it is."""
        for seed in self.seeds:
            found = self.family.case(seed, "", folder)
            self.base[seed] = found, self.family.wrong(seed, found, folder)

    def count(self, limit, factor, folder):
        """{noticed, more wrong, fewer wrong, cost} of a changed limit."""
        new = limit.changed(factor)
        if new is None:
            return None
        counts = {"noticed": 0, "more": 0, "fewer": 0, "work": 0, "usual": 0, "endless": 0}
        for seed in self.seeds:
            usual, was_wrong = self.base[seed]
            found = self.family.case(seed, f"{limit.record}%{limit.name}={new!r}", folder)
            counts["endless"] += int(found[0] == -1)
            if counts["endless"] == MOST_ENDLESS:
                return counts
            counts["work"] += found[1].get("iterations", 0)
            counts["usual"] += usual[1].get("iterations", 0)
            answers = found[0] != usual[0] or differ(found[2], usual[2], self.family.NAMES)
            if not (answers or found[1] != usual[1]):
                continue
            counts["noticed"] += 1
            is_wrong = self.family.wrong(seed, found, folder)
            counts["more"] += int(is_wrong > was_wrong)
            counts["fewer"] += int(is_wrong < was_wrong)
        return counts


def cell(counts):
    """Noticed; more and fewer wrong; iterations."""
    if counts is None:
        return "no other | |"
    if counts["endless"] == MOST_ENDLESS:
        return "endless | |"
    change = 100.0 * (counts["work"] / max(counts["usual"], 1) - 1.0)
    wrong = f"+{counts['more']} -{counts['fewer']}" if counts["more"] or counts["fewer"] else "0"
    return f"{counts['noticed']} | {wrong} | {change:+.1f} %"


def table(rows):
    """Rows of Markdown."""
    yield "| limit | value | " + " | ".join(
        f"{factor:g} times: noticed | wrong | iterations" for factor in FACTORS) + " |"
    yield "|---" * 8 + "|"
    for limit, counts in rows:
        cells = " | ".join(cell(each) for each in counts)
        yield f"| `{limit.name}` | {limit.value:g} | {cells} |"


def written(text, record, lines):
    """The page with the table of a record renewed."""
    begin, end = f"<!-- {record}: begin -->", f"<!-- {record}: end -->"
    if begin not in text:
        text += f"\n## {TITLES[record]}\n\n{begin}\n{end}\n"
    before, rest = text.split(begin)
    return "\n".join([before + begin, *lines, end]) + rest.split(end)[1]


HEAD = """# What limits are worth

Limits of heuristics stand in records, each with its reason. Here every one of them is halved and
doubled in turn (parts above a half: what they leave of 1 is), in a copy of the program, and random
families look what becomes of their cases. *Noticed*: cases whose answer or whose work is another
one. *Wrong*: cases that the judge counts as wrong only then (+), and only with the limit as it is
(-). *Iterations*: of all cases, against those with the limit as it is. A limit with few cases
noticed guards against what is rarer than these families are long.

Made by `make thresholds` (`python test/robustness/thresholds.py RECORD --cases N -o` for one of
them).
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("record", nargs="*", choices=[*RECORDS, []], help="records (all of them)")
    parser.add_argument("--cases", type=int, help="cases of a family")
    parser.add_argument("--program", type=Path, help="a program of such a copy")
    parser.add_argument("--only", help="limits whose names match this expression")
    parser.add_argument("-o", "--output", action="store_true", help="write the page")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        program = options.program.resolve() if options.program else build(Path(name))
        for record in options.record or RECORDS:
            cases = options.cases or RECORDS[record][2]
            state = STATE / f"{record}-{cases}-{digest(program)}.jsonl"
            counter = Counter(record, program, cases, state)
            rows = measured(counter, record, options.only)
            lines = ["", FAMILIES[record].TEXT, "",
                     f"{len(counter.seeds)} cases each, at commit {revision()}.", "", *table(rows)]
            print("\n".join(lines), flush=True)
            if options.output:
                text = PAGE.read_text() if PAGE.exists() else HEAD
                PAGE.write_text(written(text, record, [*lines, ""]))
    return 0


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]


def measured(counter, record, only):
    """(limit, counts of both factors) of a record; goes on where it was stopped."""
    known = {}
    if counter.state.exists():
        known = {tuple(key): counts for key, counts in map(json.loads, counter.state.open())}
    counter.state.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for limit in limits(record):
            if only and not re.search(only, limit.name):
                continue
            found = []
            for factor in FACTORS:
                key = limit.name, factor
                if key not in known:
                    if not counter.base:
                        counter.start(folder)
                    known[key] = counter.count(limit, factor, folder)
                    with counter.state.open("a") as file:
                        file.write(json.dumps([key, known[key]]) + "\n")
                found.append(known[key])
            rows.append((limit, found))
    return rows


if __name__ == "__main__":
    sys.exit(main())
