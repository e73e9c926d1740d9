"""The library as codes in C, C++ and Fortran 77 see it: installed into a clean prefix, then built
against and run from there, with nothing of the sources in reach."""
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from project import BUILD, ROOT

HERE = Path(__file__).resolve().parent
EXAMPLE = ROOT / "example" / "legacy"
SECTOR = ROOT / "example" / "blade_sector"
N_POINTS, N_PAIRS, N_COEFFICIENTS = 25, 16, 7
#: A stop takes some hundredths of a second [s]; the rest is for machines that do other things.
STOPPED_WITHIN = 5.0

pytestmark = pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))),
                                reason="there is no C compiler")


def run(*command, cwd=None, status=0, text=None, **variables):
    """Run a command with one thread; its standard output."""
    done = subprocess.run([str(word) for word in command], cwd=cwd, text=True, input=text,
                          capture_output=True, timeout=600, check=False,
                          env=dict(os.environ, OMP_NUM_THREADS="1", **variables))
    assert done.returncode == status, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """Where the library is installed."""
    directory = tmp_path_factory.mktemp("prefix")
    run("cmake", "--install", BUILD, "--prefix", directory)
    return directory


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The examples away from the project."""
    directory = tmp_path_factory.mktemp("legacy") / "sources"
    shutil.copytree(EXAMPLE, directory)
    return directory


def pkg_config(prefix):
    return str(next(prefix.glob("**/pkgconfig")))


@pytest.fixture(scope="module", params=["cmake", "fretwear", "fretwear-static"])
def programs(request, prefix, sources, tmp_path_factory):
    """Directory of the three examples, built by find_package or with either pkg-config file."""
    directory = tmp_path_factory.mktemp("build")
    if request.param == "cmake":
        run("cmake", "-S", sources, "-B", directory, f"-DCMAKE_PREFIX_PATH={prefix}")
        run("cmake", "--build", directory)
    else:
        run("make", f"PKG_CONFIG_PATH={pkg_config(prefix)}", f"PACKAGE={request.param}",
            f"OUT={directory}", cwd=sources)
    return directory


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """What the examples take for the memory of their host."""
    path = tmp_path_factory.mktemp("model") / "sector.dat"
    run(sys.executable, EXAMPLE / "export_model.py", SECTOR / "sector_16.h5", path)
    return path


@pytest.fixture(scope="module")
def reference(prefix, tmp_path_factory):
    """The same sweep by the installed program, one row for each point."""
    path = tmp_path_factory.mktemp("reference") / "frf.h5"
    run(prefix / "bin" / "fw_run", "-q", "-o", path, "--set", f"sweep%n_points={N_POINTS}",
        SECTOR / "frf.nml")
    with h5py.File(path) as result:
        assert result["converged"][:].all()
        return np.column_stack([result[name][()].reshape(N_POINTS, -1) for name in (
            "omega", "converged", "amplitude", "coefficients", "contact/force",
            "contact/fraction", "contact/dissipation")])


def run_example(programs, language, model, output, stop_after=0, status=0):
    """Run one of the examples; its numbers, one row for each point."""
    if language == "f77":
        run(programs / "frf_f77", cwd=output.parent, status=status,
            text=f"{model}\n{output}\n{stop_after}\n")
    else:
        run(programs / f"frf_{language}", model, output, stop_after, status=status)
    n_values = 3 + N_COEFFICIENTS + (3*N_COEFFICIENTS + 3 + 1)*N_PAIRS
    return np.array(output.read_text().split(), float).reshape(-1, n_values)


@pytest.mark.parametrize("language", ["f77", "c", "cpp"])
def test_steps_give_the_numbers_of_the_program(programs, language, model, reference, tmp_path):
    found = run_example(programs, language, model, tmp_path / "out.txt")
    assert found.shape == reference.shape
    assert np.array_equal(found, reference)
    # The joint slips: these are no numbers of a linear structure.
    fraction = found[:, -4*N_PAIRS:-N_PAIRS].reshape(N_POINTS, N_PAIRS, 3)
    assert f"{found[:, 2].max():.4f} mm" in (EXAMPLE / "README.md").read_text()
    assert fraction[:, :, 1].max() > 0.1 and found[:, -N_PAIRS:].max() > 0.0


@pytest.mark.parametrize("language", ["f77", "c", "cpp"])
def test_abort_keeps_what_is_done(programs, language, model, reference, tmp_path):
    found = run_example(programs, language, model, tmp_path / "out.txt", stop_after=4, status=6)
    assert np.array_equal(found, reference[:4])


@pytest.fixture(scope="module")
def mode_and_response(prefix, tmp_path_factory):
    """The two tables that the programs write, from result files."""
    folder, tables = tmp_path_factory.mktemp("modes"), []
    for name, columns in (
            ("nonlinear_mode/mode", ("mode/first_harmonic", "omega", "mode/damping_ratio")),
            ("sensitivity/sensitivity", ("omega", "amplitude", "sensitivity/largest/contact_mu"))):
        path = folder / f"{Path(name).name}.h5"
        run(prefix / "bin" / "fw_run", "-q", "-o", path, ROOT / "example" / f"{name}.nml")
        with h5py.File(path) as result:
            tables.append(np.column_stack([result[column][()].ravel() for column in columns]))
    return np.concatenate(tables)


@pytest.mark.parametrize("language", ["f77", "c", "f90"])
def test_modes_and_derivatives(programs, language, mode_and_response, tmp_path):
    cases = [str(ROOT / "example" / name) for name in (
        "nonlinear_mode/mode.nml", "sensitivity/sensitivity.nml")]
    if language == "f77":
        # Names are short in old codes.
        for short, case in zip(("mode.nml", "response.nml"), cases, strict=True):
            shutil.copy(case, tmp_path / short)
        run(programs / "modes_f77", cwd=tmp_path, text="mode.nml\nresponse.nml\nout.txt\n")
    else:
        run(programs / f"modes_{language}", *cases, "out.txt", cwd=tmp_path)
    found = np.loadtxt(tmp_path / "out.txt")
    assert np.array_equal(found, mode_and_response)
    assert f"{found[:81, 2].max():.7f}" in (EXAMPLE / "README.md").read_text()


@pytest.mark.parametrize("package", ["fretwear", "fretwear-static"])
def test_fortran_facade(prefix, package, reference, tmp_path):
    flags = run("pkg-config", "--cflags", "--libs", package,
                PKG_CONFIG_PATH=pkg_config(prefix)).split()
    run("gfortran", "-std=f2018", "-Wall", HERE / "facade.f90", "-o", "facade", *flags,
        *os.environ.get("LDFLAGS", "").split(), f"-Wl,-rpath,{Path(pkg_config(prefix)).parent}",
        cwd=tmp_path)
    run("./facade", SECTOR / "frf.nml", "out.txt", cwd=tmp_path)
    found = np.loadtxt(tmp_path / "out.txt")
    assert np.array_equal(found[:, 0], reference[:, 0])
    assert np.array_equal(found[:, 1:], reference[:, 3:3 + N_COEFFICIENTS])


def test_the_floor_of_the_benchmarks(prefix, tmp_path):
    """The measuring programs extend the library from within, so that each change of it concerns
    them: all are built, and that which measures the most runs through a peak."""
    run("cmake", "-S", ROOT / "bench", "-B", tmp_path, f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", tmp_path)
    sweep = ("start=1024.7", "end=1020.7", "n_points=21")
    case = tmp_path / "frf.nml"
    case.write_text(run(prefix / "bin" / "fw_run", "--check", *(
        word for change in sweep for word in ("--set", f"sweep%{change}")), SECTOR / "frf.nml"))
    table = [line.split(",") for line in run(tmp_path / "floor", case).splitlines()]
    calls = {line[0]: int(line[1]) for line in table[1:]}
    assert table[0][:2] == ["part", "calls"]
    assert calls["condensation"] < calls["derivative of the forces"] < calls["residual"]
    assert 0 < calls["preconditioner: build"] < calls["derivative of the forces"]


def test_a_whole_run_from_fortran_77(prefix, tmp_path):
    libdir = Path(pkg_config(prefix)).parent
    flags = run("pkg-config", "--libs", "fretwear", PKG_CONFIG_PATH=pkg_config(prefix)).split()
    run("gfortran", "-std=legacy", "-Wall", HERE / "whole.f", "-o", "whole", *flags,
        f"-Wl,-rpath,{libdir}", cwd=tmp_path)
    output = run("./whole", cwd=tmp_path, text=f"{SECTOR / 'frf.nml'}\n")
    found = {label: (int(status), answer.strip()) for label, status, answer in
             (line.split("\t") for line in output.splitlines())}
    title = re.search(r"title\s*=\s*'(.*)'", (SECTOR / "frf.nml").read_text())[1]
    assert found["load"] == found["check"] == found["run"] == (OK, "")
    assert found["points"] == (OK, "3")
    assert found["title"] == (OK, title)
    assert found["no such text"] == (USAGE, "as it was")
    assert found["wrong"][0] == INPUT and "&contact mu(1) = -1: must be" in found["wrong"][1]
    assert found["no such file"][0] == IO and "/does/not/exist.nml" in found["no such file"][1]


def compile_c(source, prefix, directory):
    """A program of this directory against the shared library."""
    program = directory / source.stem
    flags = run("pkg-config", "--cflags", "--libs", "fretwear",
                PKG_CONFIG_PATH=pkg_config(prefix)).split()
    libdir = Path(pkg_config(prefix)).parent
    run("cc", "-O1", "-std=c99", "-Wall", "-Wextra", "-Werror", "-D_POSIX_C_SOURCE=200809L",
        source, "-o", program, *flags, f"-Wl,-rpath,{libdir}", "-lpthread", "-lm")
    return program


def test_a_stop_from_another_thread(prefix, tmp_path):
    program = compile_c(HERE / "stop.c", prefix, tmp_path)
    lines = run(program, SECTOR / "sector_48.h5", cwd=tmp_path).splitlines()
    found = {line.split()[0]: line.split()[1:] for line in lines}
    for way in ("whole", "step", "limit"):
        status, points, seconds = found[way]
        assert (status, points) == ("6", "0"), lines
        assert float(seconds) < STOPPED_WITHIN
    assert found["idle"] == ["2"]
    assert found["after"] == ["0", "1"]


def test_threads(prefix, tmp_path):
    program = compile_c(HERE / "threads.c", prefix, tmp_path)
    output = run(program, SECTOR / "sector_16.h5", tmp_path)
    assert output.endswith("0 differences\n")
    sizes = [int(n) for n in re.findall(r"status [04], (\d+) values", output)]
    assert len(sizes) == 11 and min(sizes) > 800
    assert "case 11: status 3, 0 values" in output
    with h5py.File(tmp_path / "result.h5") as result:
        assert result.attrs["status"] in (b"complete", "complete")


def test_threads_with_laws(prefix, tmp_path):
    program = compile_c(HERE / "law_threads.c", prefix, tmp_path)
    output = run(program)
    assert output.endswith("0 differences\n")
    found = re.findall(r"case (\d): status (\d), (\d+) values, (\d+) calls, (.*)", output)
    assert [int(status) for _, status, *_ in found[:6]] == [0] * 6
    assert min(int(n) for _, _, *counts, _ in found[:6] for n in counts) > 20
    # What has no force where the case goes, and what ends the run, in words.
    assert int(found[6][1]) == 4 and int(found[7][1]) == 1
    assert "returned 7" in found[7][4]


@pytest.fixture(scope="module")
def misuse(prefix, tmp_path_factory):
    """What misuse.c prints: label to (status, message); and where it ran."""
    directory = tmp_path_factory.mktemp("misuse")
    output = run(compile_c(HERE / "misuse.c", prefix, directory), cwd=directory)
    lines = [line.split("\t") for line in output.splitlines()]
    return {label: (int(status), message) for label, status, message in lines}, directory


OK, USAGE, INPUT, NOT_CONVERGED, IO, STOPPED = 0, 2, 3, 4, 5, 6


@pytest.mark.parametrize(("label", "status", "words"), [
    ("null handle", USAGE, "no such handle"),
    ("invented handle", USAGE, "no such handle"),
    ("pointer as handle", USAGE, "no such handle"),
    ("destroyed", OK, "no such handle"),
    ("destroyed twice", USAGE, "no such handle"),
    ("stale handle", USAGE, "no such handle"),
    ("no place for a handle", USAGE, "no such handle"),
    ("no key", USAGE, "group%key=value"),
    ("null key", USAGE, "null pointer"),
    ("unknown key", INPUT, "set solver%tolerence=1e-9: &solver has no key tolerence; "
                           "did you mean tolerance?"),
    ("out of range", INPUT, "set solver%tolerance=-1: &solver tolerance = -1: must be"),
    ("set again", OK, ""),
    ("good again", OK, ""),
    ("text is cut", OK, ""),
    ("cut text", 4, "ca"),
    ("unknown part", USAGE, "'masses' is no real part of a model: must be one of mass, stiff"),
    ("wrong size", INPUT, "mass has 4 values: must be 1"),
    ("null array", USAGE, "null pointer"),
    ("no dofs", INPUT, "n_dof = 0: must be from 1 to 100000"),
    ("too many dofs", INPUT, "n_dof = 2000000000: must be from 1 to 100000"),
    ("incomplete model", INPUT, "the model in memory lacks stiffness"),
    ("not symmetric", INPUT, "&model source = 'memory' holds a mass that is not symmetric: entry "),
    ("not a number", INPUT, "holds a stiffness that has entry (2,1) = "),
    ("put without a model", USAGE, "there is no model to put this in"),
    ("nothing given", INPUT, "group &model is missing"),
    ("memory asked for", INPUT, "&model source = 'memory': is for programs"),
    ("no such file", IO, "/does/not/exist.nml: cannot be read"),
    ("wrong namelist", INPUT, "mine.nml:2: &model n_dof = 'two': must be an integer"),
    ("solve before start", USAGE, "a step needs a start"),
    ("count before start", USAGE, "known once the case was checked"),
    ("get before solve", USAGE, "there are 0 points"),
    ("no such frequency", USAGE, "frequency 6 of the sweep: must be from 1 to 5"),
    ("omega = 0", USAGE, "omega = 0.00000 rad/s: must be above 0"),
    ("omega = nan", USAGE, "must be above 0 and finite"),
    ("solve", OK, ""),
    ("small buffer", USAGE, "has room for 2"),
    ("buffer", 1, ""),
    ("unknown result", USAGE, "there is no result 'forces': must be one of omega, parameter"),
    ("no histories", USAGE, "histories need output%histories = .true."),
    ("no such point", USAGE, "point 2: there are 1 points"),
    ("null buffer", USAGE, "null pointer"),
    ("change", OK, ""),
    ("solve after a change", USAGE, "a step needs a start"),
    ("steps along a branch", USAGE, "sweep%continuation 'natural'"),
    ("no such directory", IO, "/does/not/exist.h5: cannot be written: the directory"),
    ("not converged", NOT_CONVERGED, "not every point converged"),
    ("point not converged", NOT_CONVERGED, "rad/s did not converge: "),
    ("read in callback", OK, "1"),
    ("solve in callback", USAGE, ""),
    ("set in callback", USAGE, ""),
    ("destroy in callback", USAGE, ""),
    ("meddled with", OK, ""),
    ("stopped", STOPPED, "stopped by the callback after 3 points"),
    ("kept", 3, "3"),
    ("branch stopped", STOPPED, "stopped by the callback after 3 points"),
    ("kept of branch", 3, "3"),
    ("end", OK, ""),
])
def test_misuse_has_a_status_and_a_message(misuse, label, status, words):
    found = misuse[0][label]
    assert found[0] == status, found
    assert words in found[1] if words else found[1] == "", found


def test_every_line_of_misuse_is_checked(misuse):
    mark = next(m for m in test_misuse_has_a_status_and_a_message.pytestmark
                if m.name == "parametrize")
    assert {case[0] for case in mark.args[1]} == set(misuse[0])


@pytest.mark.parametrize("name", ["stopped.h5", "branch.h5"])
def test_result_file_of_a_stopped_run(misuse, name):
    with h5py.File(misuse[1] / name) as result:
        assert result.attrs["status"] in (b"stopped", "stopped")
        assert result["omega"].shape == (3,)


def test_symbols(prefix):
    """The shared library shows its interfaces and its modules, nothing else; every function of the
    header is there, and nothing that the header does not declare."""
    library = next(prefix.glob("**/libfretwear.so"))
    names = [line.split()[-1] for line in run("nm", "-D", "--defined-only", library).splitlines()]
    c_names = {name for name in names if re.fullmatch(r"fw_[a-z_]+", name)}
    f77_names = {name for name in names if re.fullmatch(r"fw[a-z]{2,4}_", name)}
    others = [name for name in names if name not in c_names | f77_names
              and not re.match(r"__(fw_|fretwear_)", name)]
    assert not others
    header = (prefix / "include" / "fretwear.h").read_text()
    header = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    assert c_names == set(re.findall(r"\b(fw_[a-z_]+)\(", header))
    layer = (ROOT / "src" / "capi" / "fortran77.f90").read_text()
    assert f77_names == {f"{name}_" for name in
                         re.findall(r"^subroutine (fw\w+)", layer, re.MULTILINE)}


def test_no_state_outside_of_what_is_locked():
    """Variables that outlive a call are shared by all threads. gfortran makes such variables of its
    own for the lengths of texts that functions return (slen), and `src/io` alone, which runs under
    a lock, may contain them."""
    objects = list((BUILD / "CMakeFiles" / "fretwear.dir" / "src").rglob("*.o"))
    assert len(objects) > 100
    allowed = {"powell.f90.o": {"__fw_powell_MOD_current"},        # threadprivate
               "threads.f90.o": {"__fw_threads_MOD_n_open", "__fw_threads_MOD_blas_before",
                                 "__fw_threads_MOD_team"},             # threadprivate
               "handles.f90.o": {"__fw_handles_MOD_slots", "__fw_handles_MOD_last_id"},
               "c_interface.f90.o": {"version_text.0", "__fw_c_interface_MOD_version_text"}}
    # Type descriptors, constant arrays, jump tables, the locks themselves.
    harmless = re.compile(r"__[\w.]+_MOD___(def_init|vtab)_.*|A\.\d+\.\d+|jumptable\..*|"
                          r"print_warning\.\d+\.\d+|"  # of debug builds
                          r"__gcov.*|"  # of builds that count lines
                          r"\.gomp_critical_user_fretwear_.*")
    found = []
    for line in run("nm", "-A", *objects).splitlines():
        place, words = Path(line.rpartition(":")[0]), line.rpartition(":")[2].split()
        if words[-2] not in "bBdDC" or harmless.fullmatch(words[-1]):
            continue
        if place.parent.name == "io" and words[-1].startswith("slen."):
            continue
        if words[-1] not in allowed.get(place.name, ()):
            found.append((place.name, words[-1]))
    assert not found


def test_version(prefix, tmp_path):
    """Header, library, program and packages name one version."""
    source = tmp_path / "version.c"
    source.write_text('#include <stdio.h>\n#include <fretwear.h>\nint main(void) { '
                      'printf("%s %d", fw_get_version(), '
                      'fw_get_interface_version() == FW_INTERFACE_VERSION); return 0; }\n')
    version = run(prefix / "bin" / "fw_run", "--version").split()[1]
    assert run(compile_c(source, prefix, tmp_path)) == f"{version} 1"
    for package in ("fretwear", "fretwear-static"):
        assert run("pkg-config", "--modversion", package,
                   PKG_CONFIG_PATH=pkg_config(prefix)).strip() == version
