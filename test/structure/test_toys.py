"""What a new law, quantity, rule, analysis, part of a model file, parameter, kind of vibration and
load cost: each is added to a copy of the tree, compiled, run, and the old files that it touched are
counted.

A file of its own is free; a limit may only fall.
"""
import os
import re
import shutil
import subprocess

import h5py
import numpy as np
import pytest
from project import ROOT

#: Calls between the command and Newton's method, the one of the run included.
CALLS = 6
#: Old files that each may touch.
LIMITS = {"law": 1, "quantity": 1, "rule": 1, "analysis": 2, "part": 2, "parameter": 1,
          "vibration": 2, "load": 2}


class Toy:
    """Changes of the copy, with the old files that they touch."""

    def __init__(self, tree):
        self.tree, self.touched = tree, set()

    def new(self, path, text):
        assert not (self.tree / path).exists()
        (self.tree / path).write_text(text)

    def change(self, path, *pairs):
        """Replace in an old file; every text must be there once."""
        text = (self.tree / path).read_text()
        for old, new in pairs:
            assert text.count(old) == 1, f"{path}: {old!r} stands there {text.count(old)} times"
            text = text.replace(old, new)
        (self.tree / path).write_text(text)
        self.touched.add(path)


def add_law(toy):
    """'toy': the regularised law under another name."""
    text = (toy.tree / "src/force/regularised.f90").read_text()
    for old, new in (("regularised_friction", "toy_friction"), ("regularised_law", "toy_law"),
                     ("fw_regularised", "fw_toy_law")):
        text = text.replace(old, new)
    toy.new("src/force/toy_law.f90", text)
    toy.change("src/force/laws.f90",
               ("'iwan', 'bouc_wen']", "'iwan', 'bouc_wen', 'toy']"),
               ("joints of Iwan, of Bouc-Wen'", "joints of Iwan, of Bouc-Wen, toy'"),
               ("   use fw_rigid_law,",
                "   use fw_toy_law, only: toy_friction\n   use fw_rigid_law,"),
               ("      case ('rigid');",
                "      case ('toy'); allocate (law, source=toy_friction())\n"
                "      case ('rigid');"))


def add_quantity(toy):
    """'toy/largest_force' of a point: from what the point holds already."""
    toy.change("src/io/point_quantities.f90",
               ("      call add_sensitivities()\n      list",
                "      call add('toy/largest_force', r, '<force>', 'point', "
                "'largest coefficient', &\n               shows_contact)\n"
                "      call add_sensitivities()\n      list"),
               ("      case ('omega')\n",
                "      case ('toy/largest_force')\n"
                "         if (allocated(point%force)) values = [maxval(abs(point%force))]\n"
                "      case ('omega')\n"))


def add_rule(toy):
    """Histories and a phase do not go together."""
    toy.change("src/case/rules.f90",
               ("   type(rule_type), parameter :: of_sweeps(*) = [ &\n",
                "   type(rule_type), parameter :: of_sweeps(*) = [ &\n"
                "      rule_type('output%histories', 'output%tail', 'toys refuse it'), &\n"))


def add_analysis(toy):
    """'toy': tells the number of pairs as a group of the result."""
    toy.new("src/driver/run_toy.f90", """\
!> Runs analysis 'toy'.
module fw_run_toy
   use fw_analysis, only: analysis, run_type
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_result_group, only: group_writer, result_group
   implicit none (type, external)
   private

   public :: toy_analysis

   type, extends(analysis) :: toy_analysis
   contains
      procedure :: start
   end type toy_analysis

   type, extends(result_group) :: toy_group
      integer :: n_pairs = 0
   contains
      procedure :: write => write_toy
   end type toy_group

contains

   subroutine start(self, case, run, error)
      class(toy_analysis), intent(inout), target :: self
      type(case_type), intent(in), target :: case
      type(run_type), intent(inout), target :: run
      type(error_type), allocatable, intent(out) :: error
      type(toy_group) :: group

      group%n_pairs = case%contact%n_pairs
      call run%writer%add(group, error)
   end subroutine start

   subroutine write_toy(self, to)
      class(toy_group), intent(in) :: self
      type(group_writer), intent(inout) :: to

      call to%put('/toy/pairs', [self%n_pairs], '', 'one', 'number of pairs')
   end subroutine write_toy

end module fw_run_toy
""")
    toy.change("src/case/case.f90",
               ("'ringdown']\n   type", "'ringdown', 'toy']\n   type"),
               ("analysis_ringdown\n\n", "analysis_ringdown, analysis_toy\n\n"),
               ("analysis_ringdown = 11\n", "analysis_ringdown = 11, analysis_toy = 12\n"),
               ("is_integrated=.true.)]",
                "is_integrated=.true.), &\n"
                "      analysis_facts(has_points=.false., is_balanced=.false.)]"))
    toy.change("src/driver/run.f90",
               ("   use fw_run_state,",
                "   use fw_run_toy, only: toy_analysis\n   use fw_run_state,"),
               ("analysis_ringdown, analysis_wear, case_type",
                "analysis_ringdown, analysis_wear, analysis_toy, case_type"),
               ("      case (analysis_mode);",
                "      case (analysis_toy); allocate (toy_analysis :: work)\n"
                "      case (analysis_mode);"))


def add_frames(tree):
    """Newton's method prints who called it, where the environment asks for that."""
    path = tree / "src/solve/newton.f90"
    text = path.read_text()
    start = text.index("   subroutine solve(self")
    call = text.index("\n\n", start)
    path.write_text(text[:call] + """
      character(1) :: asked
      integer :: length

      interface
         subroutine print_callers() bind(c, name='_gfortran_backtrace')
         end subroutine print_callers
      end interface

      call get_environment_variable('SHOW_CALLERS', asked, length)
      if (length > 0) call print_callers()""" + text[call:])


def add_part(toy):
    """'/load/toy' of a model file: a constant load on top of the others."""
    toy.change("src/case/raw_model.f90",
               ("      real(wp), allocatable :: load_static_rotation(:)\n",
                "      real(wp), allocatable :: load_static_rotation(:), load_toy(:)\n"),
               ("      call to%bind(part('load/sine',",
                "      call to%bind(part('load/toy', 'dof', 'on top of others'), self%load_toy)\n"
                "      call to%bind(part('load/sine',"))
    toy.change("src/io/read_waves.f90",
               ("      static = 0.0_wp\n",
                "      static = 0.0_wp\n"
                "      if (allocated(raw%load_toy)) static = raw%load_toy\n"))


def add_parameter(toy):
    """'contact%mu_viscous': a constant of a law that sweeps go over."""
    toy.change("src/model/parameters.f90",
               (")]\n\n   integer, parameter :: n_parameter_words",
                "), &\n"
                "      parameter_type('contact%mu_viscous', of_pairs, not_negative, of_sliding, &\n"
                "                     .false.)]\n\n   integer, parameter :: n_parameter_words"))


def add_vibration(toy):
    """&control share = 0.7: the response to a part of the load."""
    toy.new("src/driver/toy_vibration.f90", """\
!> The response to a share of the load.
module fw_toy_vibration
   use fw_case, only: case_type
   use fw_error, only: error_type
   use fw_kinds, only: wp
   use fw_response, only: response
   use fw_solution_history, only: position
   implicit none (type, external)
   private

   public :: toy_vibration

   type, extends(response) :: toy_vibration
      real(wp) :: share = 1.0_wp
   contains
      procedure :: build
      procedure :: stand
   end type toy_vibration

contains

   subroutine build(self, case, error)
      class(toy_vibration), intent(inout), target :: self
      type(case_type), intent(in) :: case
      type(error_type), allocatable, intent(out) :: error

      self%share = case%control%share
      call self%response%build(case, error)
   end subroutine build

   subroutine stand(self, at, error)
      class(toy_vibration), intent(inout) :: self
      type(position), intent(in) :: at
      type(error_type), allocatable, intent(out) :: error

      call self%response%stand(position(at%along, self%share*at%level), error)
   end subroutine stand

end module fw_toy_vibration
""")
    toy.change("src/balance/control_options.f90",
               ("      integer :: of = of_first_harmonic\n",
                "      integer :: of = of_first_harmonic\n      real(wp) :: share = 0.0_wp\n"),
               ("      call keys%bind_word(key('of',",
                "      call keys%bind(key('share', 'of the load', above(0.0_wp)), self%share)\n"
                "      call keys%bind_word(key('of',"))
    toy.change("src/driver/frequency_response.f90",
               ("   use fw_vibration_branch,",
                "   use fw_toy_vibration, only: toy_vibration\n   use fw_vibration_branch,"),
               ("      else if (case%control%is_wanted()) then\n         allocate (walked)\n",
                "      else if (case%control%share > 0.0_wp) then\n         allocate (walked)\n"
                "         allocate (toy_vibration :: walked%v)\n"
                "         call move_alloc(walked, strategy)\n"
                "      else if (case%control%is_wanted()) then\n         allocate (walked)\n"))


def add_load(toy):
    """'load%swing': the acceleration of a base that everything stands on, in harmonic 1."""
    toy.new("src/model/toy_load.f90", """\
!> Inertia of a structure whose base swings.
module fw_toy_load
   use fw_kinds, only: wp
   use fw_load_terms, only: add_wave
   use fw_load_waves, only: load_waves
   implicit none (type, external)
   private

   public :: add_swing

contains

   !> -M a in harmonic 1, for an acceleration a of all dofs.
   pure subroutine add_swing(a, mass, waves, columns)
      real(wp), intent(in) :: a, mass(:, :)
      type(load_waves), intent(inout) :: waves
      real(wp), allocatable, intent(inout) :: columns(:, :)
      integer :: w

      if (abs(a) <= 0.0_wp) return
      w = waves%place(1, 0)
      if (w == 0) then
         call add_wave(1, 0, size(mass, 1), waves, columns)
         w = waves%n_waves()
      end if
      columns(:, 2*w - 1) = columns(:, 2*w - 1) - a*sum(mass, dim=2)
   end subroutine add_swing

end module fw_toy_load
""")
    toy.change("src/model/load_terms.f90",
               ("      integer :: fundamental = 0\n   contains\n",
                "      integer :: fundamental = 0\n      real(wp) :: swing = 0.0_wp\n"
                "   contains\n"),
               ("      call keys%set_size('n_terms', self%n_terms)\n",
                "      call keys%set_size('n_terms', self%n_terms)\n"
                "      call keys%bind(key('swing', 'acceleration of the base'), self%swing)\n"))
    toy.change("src/io/read_waves.f90",
               ("   use fw_text, only: to_text\n",
                "   use fw_text, only: to_text\n   use fw_toy_load, only: add_swing\n"),
               ("      call terms%add_to(static, waves, columns, raw%rows)\n",
                "      call terms%add_to(static, waves, columns, raw%rows)\n"
                "      call add_swing(terms%swing, raw%mass, waves, columns)\n"))


TOYS = {"law": add_law, "quantity": add_quantity, "rule": add_rule, "analysis": add_analysis,
        "part": add_part, "parameter": add_parameter, "vibration": add_vibration,
        "load": add_load}


@pytest.fixture(scope="module", name="built")
def build_toys(tmp_path_factory):
    """(program, {toy: files touched}) of a copy of the tree with all toys."""
    tree = tmp_path_factory.mktemp("toys")
    for name in ("src", "app", "cmake", "include", "CMakeLists.txt"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tree / name)
    touched = {}
    for name, add in TOYS.items():
        toy = Toy(tree)
        add(toy)
        touched[name] = toy.touched
    add_frames(tree)
    options = ["-DCMAKE_Fortran_FLAGS_RELEASE=-O0 -g -fno-inline", "-DFRETWEAR_TESTS=OFF",
               "-DFRETWEAR_PYTHON=OFF", "-DFRETWEAR_SHARED=OFF"]
    for command in (["cmake", "-S", tree, "-B", tree / "build", "-G", "Ninja", *options],
                    ["cmake", "--build", tree / "build", "--target", "fw_run"]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    return tree / "build" / "fw_run", touched


def run(program, folder, name, text):
    (folder / f"{name}.nml").write_text(text)
    return subprocess.run([program, f"{name}.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)


RUBBING = """
&case analysis = 'frf' /
&model n_dof = 1, mass = 1.0, stiffness = 1.0, damping = 0.04 /
&contact n_pairs = 1, law = '{law}', side_1 = 1, 0, 0, mu = 1.0, normal_load = 0.5,
         slip_speed = 0.1 /
&load cosine = 1.0 /
&harmonics n_harmonics = 3, n_time = 256 /
&sweep start = 0.8, end = 1.2, n_points = 5 /
{more}
"""


@pytest.mark.parametrize("name", TOYS)
def test_files_touched(built, name):
    assert len(built[1][name]) <= LIMITS[name], sorted(built[1][name])


def test_law_runs(built, tmp_path):
    results = []
    for law in ("toy", "regularised"):
        done = run(built[0], tmp_path, law, RUBBING.format(law=law, more=""))
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / f"{law}.h5") as file:
            results.append(file["coefficients"][:])
    assert np.array_equal(*results)


SEVERAL = """
&case analysis = 'frf' /
&model n_dof = 3, mass = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0,
       stiffness = 2.0, -1.0, 0.0, -1.0, 2.0, -1.0, 0.0, -1.0, 2.0,
       damping = 0.08, -0.04, 0.0, -0.04, 0.08, -0.04, 0.0, -0.04, 0.08 /
&contact n_pairs = 3, law = {laws}, side_1 = 1, 0, 0, 2, 0, 0, 3, 0, 0, mu = 1.0,
         normal_load = 0.5, slip_speed = 0.1, tangential_stiffness = 2.0 /
&load cosine = 1.0, 0.5, 0.2 /
&harmonics n_harmonics = 3, n_time = 256 /
&sweep start = 0.6, end = 1.2, n_points = 5 /
"""


# Beside elastic and rigid pairs, in any order; with the law that it is a copy of, which then are
# two members in place of one.
@pytest.mark.parametrize(("laws", "exact"), [
    ("'{}', 'penalty', 'dlft'", True), ("'penalty', 'dlft', '{}'", True),
    ("'penalty', '{}', 'regularised'", False)])
def test_law_runs_beside_others(built, tmp_path, laws, exact):
    results = []
    for law in ("toy", "regularised"):
        done = run(built[0], tmp_path, law, SEVERAL.format(laws=laws.replace("{}", law)))
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / f"{law}.h5") as file:
            results.append((file["coefficients"][:], file["contact/force"][:]))
    for one, other in zip(*results, strict=True):
        # Solved to 1e-8 or better, from the same guesses.
        assert np.array_equal(one, other) if exact else np.allclose(one, other, rtol=0.0, atol=1e-7)


def test_quantity_is_written(built, tmp_path):
    done = run(built[0], tmp_path, "quantity", RUBBING.format(law="regularised", more=""))
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "quantity.h5") as file:
        force = file["contact/force"][:]
        assert np.array_equal(file["toy/largest_force"][:], abs(force).reshape(5, -1).max(axis=1))


def test_rule_refuses(built, tmp_path):
    more = "&output histories = .true., tail = 9 /"
    done = run(built[0], tmp_path, "rule", RUBBING.format(law="regularised", more=more))
    assert done.returncode == 3
    assert re.search(r"output%histories does not go with output%tail: toys refuse it", done.stderr)


def test_analysis_runs(built, tmp_path):
    text = RUBBING.format(law="regularised", more="").replace("'frf'", "'toy'")
    text = re.sub(r"&sweep.*?/\n", "", text)
    done = run(built[0], tmp_path, "analysis", text)
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "analysis.h5") as file:
        assert list(file["toy/pairs"]) == [1]


MODEL = """
&model source = 'hdf5', file = 'm.h5' /
&load cosine = 1.0, static_scale = 1.0 /
&harmonics n_harmonics = 1 /
&sweep start = 0.8, end = 1.2, n_points = 5 /
"""


def write_model(path, **loads):
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "fretwear-model", "format_version": 1})
        file.update({"mass": [[1.0]], "stiffness": [[1.0]], "damping": [[0.1]],
                     **{f"load/{name}": value for name, value in loads.items()}})


def test_part_is_read(built, tmp_path):
    results = []
    for loads in ({"static": [3.0]}, {"toy": [3.0]}):
        write_model(tmp_path / "m.h5", **loads)
        done = run(built[0], tmp_path, "part", MODEL)
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / "part.h5") as file:
            results.append(file["coefficients"][:])
    assert np.array_equal(*results) and results[0].any()


def test_part_is_checked(built, tmp_path):
    write_model(tmp_path / "m.h5", toy=[3.0, 4.0])
    assert "/load/toy has shape (2,), expected (1,)" in run(built[0], tmp_path, "a", MODEL).stderr
    write_model(tmp_path / "m.h5", toyy=[3.0])
    assert "did you mean /load/toy?" in run(built[0], tmp_path, "b", MODEL).stderr
    listed = subprocess.run([built[0], "--parts"], capture_output=True, text=True, check=True)
    assert "| `/load/toy` | real | (dof) |" in listed.stdout


def test_parameter_is_swept(built, tmp_path):
    text = RUBBING.format(law="regularised", more="").replace(
        "slip_speed = 0.1", "slip_speed = 0.1, mu_viscous = 0.1")
    sweep = "&sweep frequency = 0.9, parameter = 'contact%mu_viscous', as = 'value', values = {} /"
    found = []
    for values in ("0.1, 0.2", "0.2"):
        done = run(built[0], tmp_path, "parameter",
                   re.sub(r"&sweep.*?/\n", sweep.format(values) + "\n", text))
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / "parameter.h5") as file:
            found.append(file["amplitude"][-1])
    done = run(built[0], tmp_path, "alone", text.replace("mu_viscous = 0.1", "mu_viscous = 0.2")
               .replace("start = 0.8, end = 1.2, n_points = 5", "values = 0.9"))
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "alone.h5") as file:
        found.append(file["amplitude"][-1])
    # Solved to 1e-8 or better, from other guesses.
    assert np.allclose(found, found[-1], rtol=1e-7)


def test_parameter_has_no_slope(built, tmp_path):
    more = "&sensitivity parameters = 'contact%mu_viscous' /"
    text = RUBBING.format(law="regularised", more=more).replace(
        "slip_speed = 0.1", "slip_speed = 0.1, mu_viscous = 0.1")
    done = run(built[0], tmp_path, "slope", text)
    assert done.returncode == 3
    assert "contact%mu_viscous': its derivative is not known" in done.stderr


def vibrate(program, folder, name, load, more, sweep="n_points = 5"):
    """Frequencies and coefficients of a sweep with a load."""
    text = RUBBING.format(law="regularised", more=more).replace("cosine = 1.0", f"cosine = {load}")
    done = run(program, folder, name, text.replace("n_points = 5", sweep))
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / f"{name}.h5") as file:
        return file["omega"][:], file["coefficients"][:]


def test_vibration_is_swept(built, tmp_path):
    """Points, walked to from each other, and a branch by arc length: from the base types alone."""
    share = "&control share = 0.7 /"
    # Solved to 1e-8 or better, from the same guesses.
    same = {"rtol": 0, "atol": 1e-7}
    omega, toy = vibrate(built[0], tmp_path, "toy", 1.0, share)
    assert np.allclose(toy, vibrate(built[0], tmp_path, "plain", 0.7, "")[1], **same)
    omega, branch = vibrate(built[0], tmp_path, "branch", 1.0, share,
                            "n_points = 5, continuation = 'arclength'")
    assert len(omega) > 5 and omega[0] == 0.8 and abs(omega[-1] - 1.2) < 1e-12
    places = f"values = {', '.join(map(repr, omega.tolist()))} /"
    text = re.sub(r"start = .*?/\n", places + "\n", RUBBING.format(law="regularised", more=""))
    done = run(built[0], tmp_path, "there", text.replace("cosine = 1.0", "cosine = 0.7"))
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "there.h5") as file:
        assert np.allclose(branch, file["coefficients"][:], **same)


def test_load_acts(built, tmp_path):
    """A base that swings by -1 loads a mass of 1 as a force of 1 does, and is scaled as one."""
    text = RUBBING.format(law="regularised", more="")
    found = []
    for load in ("cosine = 2.0", "swing = -1.0, harmonic_scale = 2.0"):
        done = run(built[0], tmp_path, "load", text.replace("cosine = 1.0", load))
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / "load.h5") as file:
            found.append(file["coefficients"][:])
    # Sums of one and of two columns.
    assert np.allclose(*found, rtol=0.0, atol=1e-12 * np.abs(found[0]).max())
    resonance = re.sub(r"&sweep.*?/\n", "&sweep start = 0.5, end = 1.5, n_points = 21 /\n", text)
    resonance = resonance.replace("'frf'", "'resonance'")
    scale = "&resonance parameter = 'load%harmonic_scale', start = 1.0, end = 1.5, n_points = 3 /\n"
    peaks = []
    for load in ("cosine = 1.0", "swing = -1.0"):
        done = run(built[0], tmp_path, "track", resonance.replace("cosine = 1.0", load) + scale)
        assert done.returncode == 0, done.stderr
        with h5py.File(tmp_path / "track.h5") as file:
            peaks.append(file["omega"][:])
    assert np.allclose(*peaks, rtol=1e-9)


def test_calls_before_newton(built, tmp_path):
    """Who reads the sources from `run_case` on comes to Newton's method soon."""
    (tmp_path / "case.nml").write_text(RUBBING.format(law="regularised", more=""))
    done = subprocess.run([built[0], "case.nml"], cwd=tmp_path, capture_output=True, text=True,
                          check=True, env={**os.environ, "SHOW_CALLERS": "yes"})
    first = done.stderr[:done.stderr.index("run_case")]
    names = re.findall(r"^#\d+ .* in __fw_(\w+)", first + "run_case", re.MULTILINE)
    assert names[0].startswith("newton")
    assert len(names[1:]) <= CALLS, names
