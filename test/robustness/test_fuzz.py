"""The short form of the fuzzing, and every crash that the long one has found."""
import gzip
import json
import os
import random
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]
import fuzz_bases  # noqa: E402
import fuzz_model  # noqa: E402
import fuzz_namelist  # noqa: E402
import fuzz_result  # noqa: E402
from project import PROGRAM  # noqa: E402


def check(folder, *options):
    return subprocess.run([PROGRAM, *options, "case.nml"], cwd=folder, text=True,
                          capture_output=True, timeout=60, check=False)


def test_every_key_of_the_program_is_among_the_inputs():
    shown = subprocess.run([PROGRAM, "--keys=json"], text=True, capture_output=True, check=True)
    declared = {group: list(content["keys"]) for group, content in json.loads(shown.stdout).items()}
    assert declared == fuzz_namelist.KEYS


def test_three_hundred_inputs():
    done = subprocess.run([sys.executable, HERE / "fuzz.py", "--build", PROGRAM.parent, "-n", "300",
                           "--seed", "7", "--jobs", "1"], text=True, capture_output=True,
                          timeout=900, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("300 inputs, 0 failures")


def test_five_hundred_calls_of_the_package():
    done = subprocess.run([sys.executable, HERE / "fuzz_python.py", "-n", "500", "--seed", "7"],
                          text=True, capture_output=True, timeout=900, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout == "500 inputs, 0 failures\n"


@pytest.mark.parametrize("name", ["JOINT", "SPRINGS", "TIME", "WEAR", "FROM_HDF5",
                                  "FROM_MATRIX_MARKET"])
def test_the_mutations_start_from_sound_cases(tmp_path, name):
    (tmp_path / "case.nml").write_text(getattr(fuzz_bases, name))
    (tmp_path / "model.h5").write_bytes(fuzz_bases.model_file())
    for file, text in fuzz_bases.MATRIX_MARKET.items():
        (tmp_path / file).write_text(text)
    done = check(tmp_path, "--check")
    assert done.returncode == 0, done.stderr


def test_inputs_depend_on_their_number_alone(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        fuzz_model.damage(random.Random("1-5"), tmp_path / folder)
    assert (tmp_path / "a/model.h5").read_bytes() == (tmp_path / "b/model.h5").read_bytes()


def test_blank_line_at_the_end_of_matrix_market(tmp_path):
    """The words of the blank line were allocated a second time."""
    (tmp_path / "case.nml").write_text(fuzz_bases.FROM_MATRIX_MARKET)
    for file, text in fuzz_bases.MATRIX_MARKET.items():
        (tmp_path / file).write_text(text + "\n  \n\n")
    assert check(tmp_path, "--check").returncode == 0
    (tmp_path / "plate_mass.mtx").write_text("\n\n")
    assert check(tmp_path, "--check").returncode == 3


def test_wear_without_pairs(tmp_path):
    """Results of no pairs were written from where nothing is."""
    text = fuzz_bases.WEAR
    (tmp_path / "case.nml").write_text(text[:text.index("&contact")] + text[text.index("&load"):])
    done = check(tmp_path)
    assert done.returncode == 3
    assert "without contact pairs" in done.stderr


@pytest.mark.parametrize("number", [289, 170])
def test_files_that_hdf5_does_not_survive(tmp_path, number):
    """A crash and a search without end inside HDF5 1.10; a process of their own takes them."""
    source = HERE / "inputs" / f"damaged_{number}.h5"
    (tmp_path / "case.nml").write_text(fuzz_bases.FROM_HDF5)
    (tmp_path / "model.h5").write_bytes(source.read_bytes())
    done = check(tmp_path, "--check")
    assert done.returncode == 3, done.stderr
    assert ": error: " in done.stderr and "Backtrace" not in done.stderr


def test_a_result_to_start_from_that_hdf5_does_not_survive(tmp_path):
    """A search without end in a damaged result, where a run was to start."""
    content = (HERE / "inputs/damaged_result.h5.gz").read_bytes()
    (tmp_path / "damaged.h5").write_bytes(gzip.decompress(content))
    (tmp_path / "case.nml").write_text(
        fuzz_bases.WEAR.replace("area = 1", "area = 1 worn = 'damaged.h5'"))
    done = check(tmp_path, "--check")
    assert done.returncode == 3, done.stderr
    assert "finds no end" in done.stderr


def test_a_sound_result_to_start_from(tmp_path):
    (tmp_path / "case.nml").write_text(fuzz_bases.WEAR)
    (tmp_path / "sound.h5").write_bytes(fuzz_result.sound())
    assert check(tmp_path, "--check", "--restart", "sound.h5").returncode == 0
    assert check(tmp_path, "--check", "--set", "contact%worn='sound.h5'").returncode == 0


def test_memory_of_the_machine_is_not_needed(tmp_path):
    """Sizes that nobody has the memory for are refused in words, with 2 GB to be had."""
    (tmp_path / "case.nml").write_text(fuzz_bases.FROM_HDF5)
    (tmp_path / "model.h5").write_bytes(fuzz_bases.model_file())
    with h5py.File(tmp_path / "model.h5", "r+") as file:
        del file["mass"]
        file.create_dataset("mass", (10**6, 10**6), dtype="f8", chunks=(1, 1))
    done = check_in_two_gigabytes(tmp_path)
    assert done.returncode == 3, done.stderr
    assert "/mass" in done.stderr


def check_in_two_gigabytes(folder):
    command = f"ulimit -v 2000000; exec '{PROGRAM}' --check case.nml"
    return subprocess.run(["/bin/sh", "-c", command], cwd=folder, text=True,
                          capture_output=True, timeout=60, check=False,
                          env=dict(os.environ, OMP_NUM_THREADS="1"))


@pytest.mark.parametrize(("change", "words"), [
    (("n_harmonics = 3 n_time = 64", "n_harmonics = 10000"), "GB of memory"),
    (("n_dof = 2", "n_dof = 10000"), "too many for a namelist")])
def test_sizes_of_a_namelist_that_no_memory_holds(tmp_path, change, words):
    """The transforms of 20001 coefficients, and 10000 x 10000 masses, ended in a failed
    allocation."""
    assert change[0] in fuzz_bases.JOINT
    (tmp_path / "case.nml").write_text(fuzz_bases.JOINT.replace(*change))
    done = check_in_two_gigabytes(tmp_path)
    assert done.returncode == 3, done.stderr
    assert words in done.stderr


def test_branch_of_a_linear_structure(tmp_path):
    """Without springs no unknowns are left, and the length of a step along them was 0/0."""
    text = fuzz_bases.SPRINGS
    (tmp_path / "case.nml").write_text(text[:text.index("&spring")] + text[text.index("&load"):])
    done = check(tmp_path, "-q")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "out.h5") as file:
        assert list(file["omega"]) == pytest.approx([0.5, 0.6, 0.7])
        assert file["floquet/stable"][:].all()
