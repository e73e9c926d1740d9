"""Separate handles in threads of their own under race detectors."""
import os
import re
import tempfile
from pathlib import Path

from common import ROOT, build, report, run
from optimisation import plain_build

HERE = Path(__file__).resolve().parent
MODEL = ROOT / "example" / "blade_sector" / "sector_16.h5"
#: Programs of handles, with what they are told.
PROGRAMS = {"threads": (MODEL, "{folder}", "1"), "law_threads": ("1",)}
LEAST_CASES = 19


def races(setting):
    """Twelve handles at the same time, and eight with laws, under the thread sanitizer.

    Without optimisation: accesses are the same, and a build takes half as long.
    """
    directory, _ = build(setting, "races", "-DFRETWEAR_SANITIZE=thread",
                         "-DCMAKE_Fortran_FLAGS=-O0 -g", "-DFRETWEAR_PYTHON=OFF",
                         "-DFRETWEAR_SHARED=OFF", "-DFRETWEAR_TESTS=OFF")
    return judge(directory, thread_sanitizer)


def helgrind(setting):
    """The same with the libraries below, which the sanitizer does not see; far slower."""
    return judge(plain_build(setting)[0], under_helgrind)


def judge(directory, detector):
    """Handles as they are, and without what guards them.

    The sections that OpenMP guards are locks of libgomp, which no detector sees: critical.c puts
    mutexes in their place, or leaves them out for the proof that a race is found.
    """
    lines = ["| critical sections | handles | reports | differences |", "|---|---|---|---|"]
    clean = True
    for guarded in (True, False):
        cases, reports, differences, text = watch(directory, guarded, detector)
        good = (cases >= LEAST_CASES and (reports, differences) == (0, "0")) if guarded \
            else reports > 0
        if not good:
            report(text)
        clean = clean and good
        lines.append(f"| {'as they are' if guarded else 'left out'} | {cases} | {reports} | "
                     f"{differences} |")
    return lines, clean


def watch(directory, guarded, detector):
    """Handles that ran, reports, differences from a run alone, and all that was said."""
    with tempfile.TemporaryDirectory(prefix="fw_races_") as name:
        folder = Path(name)
        run(["cmake", "--install", directory, "--prefix", folder])
        flags = run(["pkg-config", "--cflags", "--libs", "fretwear-static"], env=dict(
            os.environ, PKG_CONFIG_PATH=str(next(folder.glob("**/pkgconfig"))))).stdout.split()
        text, reports = "", 0
        for name, told in PROGRAMS.items():
            sources = [HERE / "critical.c", ROOT / "test" / "legacy" / f"{name}.c"]
            said, seen = detector(
                ["cc", "-g", "-std=c99", "-D_POSIX_C_SOURCE=200809L",
                 *([] if guarded else ["-DUNGUARDED"]), *sources, "-o", folder / name, *flags,
                 "-lpthread", "-lm"],
                [folder / name, *(str(word).format(folder=folder) for word in told)])
            text, reports = text + said, reports + seen
    ended = re.findall(r"^(\d+) differences$", text, re.MULTILINE)
    differences = str(sum(map(int, ended))) if len(ended) == len(PROGRAMS) else "ended early"
    return (len(re.findall(r"^case \d+: status", text, re.MULTILINE)), reports,
            differences, text)


def thread_sanitizer(compile_command, command):
    """What the program says, and the number of reports."""
    run([*compile_command, "-fsanitize=thread"])
    text = run(command, check=False, env=dict(os.environ, TSAN_OPTIONS="exitcode=0")).stdout
    return text, len(re.findall(r"^WARNING: ThreadSanitizer", text, re.MULTILINE))


def under_helgrind(compile_command, command):
    """The same under valgrind, which knows the instructions of these kernels of OpenBLAS.

    An approximate history finds the same races and says less about the access before, sooner.
    """
    run(compile_command)
    text = run(["valgrind", "--tool=helgrind", "--history-level=approx",
                f"--suppressions={HERE / 'helgrind.supp'}", *command], check=False,
               env=dict(os.environ, OPENBLAS_CORETYPE="Nehalem")).stdout
    found = re.search(r"ERROR SUMMARY: \d+ errors from (\d+) contexts", text)
    return text, int(found[1]) if found else -1
