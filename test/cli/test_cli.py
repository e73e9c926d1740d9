"""Options, exit statuses and what goes to which stream."""
import json
import os
import re
import subprocess
from pathlib import Path

import pytest
from project import PROGRAM, ROOT


def test_version(fw_run):
    done = fw_run("--version")
    assert done.returncode == 0
    first, second = done.stdout.splitlines()
    assert first.startswith("fw_run ") and first.count(".") == 2
    # Which kernel runs decides on speed by three: whoever reports a time can see it.
    assert second.startswith("BLAS: ")


def test_idle_threads_soon_sleep(fw_run, monkeypatch):
    """Where OpenMP is linked in, threads that wait spin for less than a millisecond."""
    libraries = subprocess.run(["ldd", PROGRAM], capture_output=True, text=True, check=False)
    if libraries.returncode != 0 or "libgomp" in libraries.stdout:
        pytest.skip("OpenMP is a shared library, which has read the environment before")
    monkeypatch.setenv("OMP_DISPLAY_ENV", "verbose")
    for name in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY"):
        monkeypatch.delenv(name, raising=False)
    assert "GOMP_SPINCOUNT = '10000'" in fw_run("--version").stderr
    monkeypatch.setenv("OMP_WAIT_POLICY", "active")
    assert "GOMP_SPINCOUNT = '10000'" not in fw_run("--version").stderr


def test_the_blas_is_named(fw_run, monkeypatch):
    """With -v, and where its kernel lacks what the processor has, with the remedy."""
    assert "\nBLAS   " in fw_run("-v", "case.nml").stdout
    flags = Path("/proc/cpuinfo")
    if not flags.exists() or " avx2 " not in flags.read_text(encoding="utf-8"):
        pytest.skip("a processor without AVX2 has no kernel below what it can do")
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")
    done = fw_run("case.nml")
    if "kernel Prescott" not in done.stdout:
        pytest.skip("not an OpenBLAS with several kernels")
    assert "slow BLAS         kernel Prescott lacks vectors" in done.stdout
    assert "OPENBLAS_CORETYPE=" in done.stdout
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    assert "slow BLAS" not in fw_run("case.nml").stdout


@pytest.mark.parametrize("option", ["--help", "-h"])
def test_help_names_every_option_and_group(fw_run, option):
    done = fw_run(option)
    assert done.returncode == 0 and done.stderr == ""
    for word in ["--set", "-o", "--restart", "--keys", "--rules", "--remarks", "--messages",
                 "--check", "-q", "-v", "--version", "&contact",
                 "Exit status"]:
        assert word in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 88


def test_keys_of_all_groups_or_of_one(fw_run):
    everything = fw_run("--keys")
    assert everything.returncode == 0 and everything.stderr == ""
    one = fw_run("--keys", "solver").stdout
    assert one in everything.stdout and one.startswith("&solver ")
    assert "tolerance = a finite real above 0 and below 1 [1e-8]" in one
    assert "side_1 = an integer within +-(n_dof+n_rows), one for all or 3 x n_pairs of them" in \
        everything.stdout
    assert "did you mean solver?" in fw_run.refused("--keys", "solvr", status=2)
    assert "json" in fw_run.refused("--keys=xml", status=2)


def test_rules_name_two_features_and_a_remedy(fw_run):
    lines = fw_run("--rules").stdout.splitlines()
    assert len(lines) == len(set(lines)) > 50
    for line in lines:
        asks, rest = line.split(" does not go with ")
        forbids, remedy = rest.split(": ", 1)
        assert asks and forbids and remedy and asks != forbids


def test_every_remark_of_the_sources_is_a_row_of_the_table(fw_run):
    """And every row is made somewhere: by the library, or where pieces of a sweep are joined."""
    rows = [line.split(" | ") for line in fw_run("--remarks").stdout.splitlines()[2:]]
    names = [name.removeprefix("| ") for name, _ in rows]
    assert len(set(names)) == len(names) and all(0 < len(text) < 480 for _, text in rows)
    made = set()
    for path in (ROOT / "src").rglob("*.f90"):
        text = re.sub(r"&\s*\n\s*", "", path.read_text())
        made |= set(re.findall(r"%(?:remarks%add|tell)\('([^']+)'", text))
        if "remark_list" in text:
            made |= set(re.findall(r"\bremarks%add\('([^']+)'", text))
    joining = (ROOT / "python" / "fretwear" / "pieces" / "joining.py").read_text()
    made |= set(re.findall(r"\(\"([a-z -]+)\", text\)", joining))
    assert made == set(names)


def test_every_message_of_the_table_is_said(fw_run):
    """The words of a message between what differs stand in the sources."""
    said = ""
    for folder in ("src", "app"):
        for path in (ROOT / folder).rglob("*.f90"):
            if path.stem != "remark_table":
                said += re.sub(r"['\"] *// *&\s*\n\s*['\"]", "", path.read_text()).replace("''", "'")
    for line in fw_run("--messages").stdout.splitlines()[2:]:
        message, remedy = line.removeprefix("| ").removesuffix(" |").split(" | ")
        assert 0 < len(message) < 128 and 0 < len(remedy) < 320
        message = re.sub(r"^branch: |^the mode ended: ", "", message)
        words = re.split(r"\.\.\.|(?<![\w%])-?\d[\d.E+-]*(?:, t1)?|x\.h5|'[^']*'|\w+%\w+", message)
        assert max((part.strip() for part in words), key=len).rstrip(",:") in said, message


def test_keys_for_programs_are_those_that_a_case_has(fw_run):
    """Default, what is accepted, and the order of the effective input of a case with little."""
    fw_run.write("&case analysis = 'point' / &model n_dof = 1 mass = 1.0 stiffness = 1.0 /\n"
                 "&sweep start = 2.0 /\n")
    listed = json.loads(fw_run("--keys=json").stdout)
    group, shown = "", []
    for line in fw_run("--check", "case.nml").stdout.splitlines():
        if line.startswith("&"):
            group = line[1:]
        elif " = " in line:
            key, _, rest = line.strip().partition(" = ")
            value, _, accepts = rest.partition("!")
            known = listed[group]["keys"][key]
            shown.append((group, key))
            assert accepts.strip() in ("", known["accepts"]), key
            if known["type"] == "word":
                assert value.strip() in [f"'{word}'" for word in known["words"]]
            if "default" in known and key not in ("analysis", "n_dof"):
                assert value.strip() == known["default"], key
    assert len(shown) > 50
    order = [(group, key) for group, content in listed.items() for key in content["keys"]]
    assert shown == [place for place in order if place in set(shown)]


def test_no_argument(fw_run):
    assert "fw_run --help" in fw_run.refused("--", status=2)


def test_unknown_option_names_the_nearest(fw_run):
    message = fw_run.refused("--chek", "case.nml", status=2)
    assert "--chek" in message and "did you mean --check?" in message


@pytest.mark.parametrize("arguments", [
    ["-x", "case.nml"], ["case.nml", "other.nml"], ["case.nml", "-o"], ["case.nml", "--set"],
    ["-qv", "case.nml"], ["--check=yes", "case.nml"], [""],
])
def test_wrong_usage(fw_run, arguments):
    assert "fw_run --help" in fw_run.refused(*arguments, status=2)


@pytest.mark.parametrize("override", [
    "solver", "tolerance=1", "solver%tolerance", "solver%tolerance=", "=1", "%a=1"])
def test_malformed_set(fw_run, override):
    message = fw_run.refused("--set", override, "case.nml", status=2)
    assert override in message and "group%key=value" in message


def test_check_prints_what_reads_back(fw_run):
    first = fw_run("--check", "case.nml")
    assert first.returncode == 0 and first.stderr == ""
    fw_run.write(first.stdout, "again.nml")
    again = fw_run("--check", "again.nml")
    assert again.returncode == 0
    assert again.stdout == first.stdout
    assert not list(fw_run.directory.glob("*.h5")), "--check runs nothing"


def test_check_is_fortran(fw_run):
    """The effective input is a namelist to other readers too."""
    f90nml = pytest.importorskip("f90nml")
    groups = f90nml.reads(fw_run("--check", "case.nml").stdout)
    assert groups["harmonics"]["n_harmonics"] == 3
    assert groups["solver"]["tolerance"] == 1e-8


def test_set_changes_one_value_and_the_last_holds(fw_run):
    done = fw_run("--check", "--set", "harmonics%n_harmonics=5", "--set=sweep%unit=Hz",
                  "--set", "harmonics%n_harmonics=7", "--set", "case%title=a new title", "case.nml")
    assert done.returncode == 0, done.stderr
    assert "n_harmonics = 7 " in done.stdout
    assert "unit = 'Hz'" in done.stdout
    assert "title = 'a new title'" in done.stdout


@pytest.mark.parametrize("arguments", [["-o", "x.h5"], ["-ox.h5"], ["-vo", "x.h5"],
                                       ["--output=x.h5"]])
def test_output_starts_at_the_current_directory(fw_run, arguments):
    (fw_run.directory / "sub").mkdir()
    (fw_run.directory / "case.nml").rename(fw_run.directory / "sub" / "case.nml")
    done = fw_run("--check", *arguments, "sub/case.nml")
    assert f"file = '{fw_run.directory}/x.h5'" in done.stdout, done.stderr
    done = fw_run("--check", "sub/case.nml")
    assert f"file = '{fw_run.directory}/sub/case.h5'" in done.stdout


def test_double_dash_ends_the_options(fw_run):
    (fw_run.directory / "case.nml").rename(fw_run.directory / "-q")
    assert fw_run("--check", "--", "-q").returncode == 0


def test_run_writes_result_and_summary(fw_run):
    done = fw_run("case.nml")
    assert done.returncode == 0, done.stderr
    assert (fw_run.directory / "case.h5").exists()
    assert done.stdout.strip(), "the summary goes to the standard output"
    assert "point 3 of 3" in done.stderr and "\r" not in done.stderr


def test_quiet_and_verbose(fw_run):
    quiet = fw_run("-q", "case.nml")
    assert quiet.returncode == 0 and quiet.stdout == quiet.stderr == ""
    verbose = fw_run("-v", "case.nml")
    assert verbose.returncode == 0
    assert verbose.stderr.count("residual") == 3


def test_bar_on_a_terminal(fw_run):
    pty = pytest.importorskip("pty")
    import subprocess

    from project import PROGRAM
    master, slave = pty.openpty()
    done = subprocess.run([PROGRAM, "case.nml"], cwd=fw_run.directory, stdout=subprocess.PIPE,
                          stderr=slave, timeout=60, check=False)
    os.close(slave)
    shown = os.read(master, 10000).decode()
    os.close(master)
    assert done.returncode == 0
    assert "\r[" in shown and "3/3" in shown


def test_progress_over_a_parameter_shows_it(fw_run):
    fw_run.write("&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.1 /\n&load cosine = 1 /\n"
                 "&sweep parameter = 'load%harmonic_scale' start = 1 end = 2 n_points = 3 "
                 "frequency = 0.5 /\n")
    done = fw_run("case.nml")
    assert done.returncode == 0, done.stderr
    assert "point 2 of 3: load%harmonic_scale 1.5," in done.stderr


def test_a_file_without_its_source_is_one_fault(fw_run):
    fw_run.write("&model file = 'model.h5' /\n&sweep start = 1 end = 2 n_points = 3 /\n")
    done = fw_run("case.nml")
    assert done.returncode == 3
    assert done.stderr.count("error") == 1 and "give source = " in done.stderr, done.stderr


def test_status_of_a_run_that_does_not_converge(fw_run):
    done = fw_run("--set", "solver%max_iterations=1", "--set", "solver%tolerance=1e-300",
                  "--set", "solver%fallback=F", "case.nml")
    assert done.returncode == 4, done.stderr
    assert (fw_run.directory / "case.h5").exists(), "what was computed is saved"


def test_a_list_of_frequencies_is_a_sweep_through_them(fw_run):
    """Evenly spaced it is the sweep itself; an override may have another length."""
    h5py = pytest.importorskip("h5py")
    found = {}
    for name, sweep, more in (("sweep.h5", "start = 0.5 end = 0.8 n_points = 4", []),
                              ("list.h5", "values = 1, 2", [
                                  "--set", "sweep%values=0.5, 0.6, 0.7, 0.8"])):
        fw_run.write(f"&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.1 /\n"
                     f"&load cosine = 1 /\n&sweep {sweep} /\n")
        done = fw_run(*more, "-o", name, "case.nml")
        assert done.returncode == 0, done.stderr
        with h5py.File(fw_run.directory / name) as file:
            found[name] = file["omega"][()], file["amplitude"][()]
    for expected, given in zip(found["sweep.h5"], found["list.h5"]):
        # The sweep works its frequencies out; the list has them rounded from decimals.
        assert given == pytest.approx(expected, rel=1e-13)
