"""A second compiler, flang, on what needs no module that gfortran has compiled.

Sources are ordered by their `use` lines. Left out are those that use the Fortran modules of
SUNDIALS and HDF5, which Debian has for gfortran alone, and what uses these in turn.
"""
import re
import shutil
import sys
from collections import Counter

from assumed_rank import without_assumed_rank
from common import ROOT, report, run

NAMES = ("flang-new-19", "flang-new", "flang")
FLAGS = ("-O0", "-std=f2018", "-fopenmp", "-I/usr/include")
LIBRARIES = ("-lminpack", "-lfftw3", "-lopenblas")
#: Modules that come with every compiler.
INTRINSIC = {"iso_c_binding", "iso_fortran_env", "ieee_arithmetic", "ieee_exceptions",
             "ieee_features", "omp_lib"}
SUPPORT = ROOT / "test" / "support"
#: Tests that count what is allocated: another compiler has other temporaries.
ALLOCATIONS = re.compile(r"test_allocations\.|_allocates_nothing$")


class Source:
    """A file with the names of the modules that it makes and needs."""

    def __init__(self, path):
        text = path.read_text(encoding="utf-8").lower()
        self.path = path
        self.makes = {*re.findall(r"^module (?!procedure)(\w+)\s*$", text, re.MULTILINE)}
        self.needs = set(re.findall(r"^\s*use(?:, *non_intrinsic *::)? +(\w+)", text,
                                    re.MULTILINE))
        for parents, name in re.findall(r"^submodule *\(([\w:]+)\) *(\w+)", text, re.MULTILINE):
            self.needs.add(parents.split(":")[-1])
            self.makes.add(name)


def flang(setting):
    """Compile and run; the section, and whether nothing was refused or failed."""
    compiler = next(filter(None, map(shutil.which, NAMES)), None)
    if not compiler:
        raise SystemExit(f"none of {', '.join(NAMES)} is here: apt-get install flang-19")
    folder = setting.builds / "flang"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    sources = [Source(path) for path in sorted((ROOT / "src").rglob("*.[fF]90"))]
    chosen = ordered(sources)
    refused = [source for source in chosen if not compiles(compiler, folder, source)]
    tests, counts = run_units(compiler, folder, chosen)
    lines = ["| folder | files | compiled |", "|---|---|---|"]
    for name in sorted({source.path.parts[-2] for source in sources}):
        of_folder = [source for source in sources if source.path.parts[-2] == name]
        done = [source for source in of_folder if source in chosen and source not in refused]
        lines.append(f"| {name} | {len(of_folder)} | {len(done)} |")
    lines += ["", f"Refused: {len(refused)}. Unit tests of what it compiles: {tests} files, "
              f"{counts['passed']} passed, {counts['failed']} failed, "
              f"{counts['left_out']} left out."]
    return lines, not refused and counts["passed"] > 0 and counts["failed"] == 0


def ordered(sources, known=frozenset(INTRINSIC)):
    """Those whose needs can be met, each behind what it needs."""
    chosen, known, rest = [], set(known), list(sources)
    while ready := [source for source in rest if source.needs <= known | source.makes]:
        for source in ready:
            rest.remove(source)
            known |= source.makes
        chosen += ready
    return chosen


def compiles(compiler, folder, source, *flags):
    """Whether the compiler takes a file; the object goes into the folder."""
    done = run([compiler, "-c", *FLAGS, *flags, "-J", folder, "-I", folder, source.path,
                "-o", object_of(folder, source)], check=False)
    if done.returncode != 0:
        report("\n".join(re.findall(r"^.*error:.*$", done.stdout, re.MULTILINE)[:3]))
    return done.returncode == 0


def object_of(folder, source):
    """Several folders have files of the same name."""
    return folder / f"{source.path.parent.name}_{source.path.stem}.o"


def run_units(compiler, folder, chosen):
    """Files of unit tests whose modules are there, and what their cases say."""
    translate = SUPPORT / "pf_translate.py"
    modules = set().union(*(source.makes for source in chosen))
    assertions = folder / "funit.f90"
    assertions.write_text(without_assumed_rank(
        (SUPPORT / "standin" / "funit.f90").read_text(encoding="utf-8")), encoding="utf-8")
    stand_in = Source(assertions)
    helpers = [Source(path) for path in sorted((ROOT / "test" / "unit").glob("*.[fF]90"))]
    units = []
    for path in sorted((ROOT / "test" / "unit").glob("*.pf")):
        target = folder / f"{path.stem}.F90"
        run([sys.executable, translate, "translate", path, target])
        units.append(Source(target))
    wanted = [stand_in, *ordered([*helpers, *units], INTRINSIC | modules | stand_in.makes)]
    built = [source for source in wanted if compiles(compiler, folder, source)]
    tests = [source for source in built if source in units]
    names = [ROOT / "test" / "unit" / f"{source.path.stem}.pf" for source in tests]
    run([sys.executable, translate, "driver", folder / "main.f90", *names])
    run([compiler, *FLAGS, "-J", folder, "-I", folder, folder / "main.f90",
         *(object_of(folder, source) for source in [*chosen, *built]),
         "-o", folder / "unit_tests", *LIBRARIES])
    counts = Counter()
    for source in tests:
        done = run([folder / "unit_tests", source.path.stem], check=False)
        counts += judged(done.stdout)
    counts["failed"] += len(wanted) - len(built)
    return len(tests), counts


def judged(text):
    """Cases of a file of tests that passed, failed, or failed in the count of allocations."""
    found = re.search(r"(\d+) passed, (\d+) failed\s*\Z", text)
    names = set(re.findall(r"^FAILED \S+: (\S+):", text, re.MULTILINE))
    left_out = sum(1 for name in names if ALLOCATIONS.search(name))
    counts = Counter(passed=int(found[1]), failed=int(found[2]) - left_out, left_out=left_out) \
        if found else Counter(failed=1)
    if counts["failed"]:
        report(text)
    return counts
