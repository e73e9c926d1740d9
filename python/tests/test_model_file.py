"""Layout of the model file, the committed models and the command line."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from fretwear._native import unread_parts
from fretwear.sector import ReducedModel, generate, read_parameters, write_model
from fretwear.sector.cli import main

# Another order of summation changes the last digits; K_rr magnifies them by its cancellation.
REGENERATED = 1e-7
COARSE_OPTIONS = ["--axial-patches", "2", "--slope-patches", "1", "--min-axial", "2",
                  "--min-slope", "2", "--blade-columns", "2", "--airfoil-rows", "2",
                  "--post-columns", "1", "--slot-columns", "1", "--disk-rows", "1",
                  "--n-modes", "6"]


@pytest.fixture(params=["sector_16.h5", "sector_48.h5"])
def committed(request: pytest.FixtureRequest, examples: Path) -> Path:
    return examples / request.param


def _check_layout(file: h5py.File, n_pairs: int) -> None:
    n = file["mass"].shape[0]
    shapes = {
        "mass": (n, n), "stiffness": (n, n), "stiffness_rotation": (n, n),
        "contact/side_1": (n_pairs, 3), "contact/side_2": (n_pairs, 3),
        "contact/mu": (n_pairs,), "contact/gap": (n_pairs,), "contact/area": (n_pairs,),
        "contact/position": (n_pairs, 3), "contact/patch": (n_pairs,),
        "load/static": (n,), "load/cosine": (n,), "load/sine": (n,), "load/static_rotation": (n,),
        "observe/name": (4,), "observe/matrix": (4, n),
    }
    for name, shape in shapes.items():
        assert file[name].shape == shape, name
        if file[name].dtype.kind == "f":
            assert np.isfinite(file[name][()]).all(), name
    assert "damping" not in file
    assert bytes(file.attrs["format"]) == b"fretwear-model"
    assert file.attrs["format_version"] == 1
    assert bytes(file.attrs["unit_system"]) == b"mm-tonne-s-N"
    assert len(file.attrs["title"]) > 0


def test_layout(reduced: ReducedModel, tmp_path: Path) -> None:
    path = tmp_path / "model.h5"
    write_model(reduced, path)
    with h5py.File(path) as file:
        _check_layout(file, reduced.n_pairs)
        assert np.array_equal(file["contact/side_1"][()].ravel(), np.arange(1, 25))
        assert not file["contact/side_2"][()].any()
        assert file["contact/patch"][()].tolist() == [b"intrados"] * 4 + [b"extrados"] * 4
        assert np.array_equal(file["stiffness"][()], reduced.stiffness)
        # Force and observed displacement are conjugate.
        assert file["observe/matrix"][0] == pytest.approx(file["load/cosine"][()], rel=1e-12)
    assert unread_parts(str(path)) == []
    assert not list(tmp_path.glob("*.part"))


def test_parameters_survive_the_file(reduced: ReducedModel, tmp_path: Path) -> None:
    write_model(reduced, tmp_path / "model.h5")
    assert read_parameters(tmp_path / "model.h5") == reduced.parameters


def test_committed_models_are_small_and_complete(committed: Path) -> None:
    assert committed.stat().st_size < 1_600_000
    with h5py.File(committed) as file:
        n_pairs = int(committed.stem.split("_")[1])
        _check_layout(file, n_pairs)
        # Two flanks of 8 mm by 40 mm in equal patches, of one or of several elements each.
        assert file["contact/area"][()] == pytest.approx(np.full(n_pairs, 640.0 / n_pairs))


def test_committed_models_equal_regenerated_ones(committed: Path) -> None:
    model = generate(read_parameters(committed))
    pairs = {"mass": model.mass, "stiffness": model.stiffness,
             "stiffness_rotation": model.stiffness_rotation}
    with h5py.File(committed) as file:
        for name, matrix in pairs.items():
            size = np.sqrt(np.outer(np.diag(model.mass), np.diag(model.mass)))
            if name != "mass":
                size = np.sqrt(np.outer(np.diag(model.stiffness), np.diag(model.stiffness)))
            assert np.abs((file[name][()] - matrix) / size).max() < REGENERATED, name
        for name, vector in (("load/cosine", model.cosine),
                             ("load/static_rotation", model.static_rotation),
                             ("contact/area", model.area), ("contact/position", model.position)):
            scale = REGENERATED * np.abs(vector).max()
            assert file[name][()] == pytest.approx(vector, abs=scale), name
        assert file["observe/matrix"][()] == pytest.approx(
            model.observe_matrix, abs=REGENERATED * np.abs(model.observe_matrix).max())


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, picture = tmp_path / "model.h5", tmp_path / "mesh.png"
    assert main(["-o", str(path), "--picture", str(picture), "--span", "70", *COARSE_OPTIONS]) == 0
    assert "stuck frequencies" in capsys.readouterr().out
    assert read_parameters(path).geometry.span == 70.0
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("options", "status", "message"), [
    (["--pairs", "7"], 3, "even number"),
    (["--pairs", "16", "--axial-patches", "4"], 3, "cannot be combined"),
    (["--flank-length", "-1"], 3, "flank_length = -1.0"),
    ([*COARSE_OPTIONS[:-1], "4000"], 3, "n_modes = 4000"),
])
def test_command_line_refuses(options: list[str], status: int, message: str, tmp_path: Path,
                              capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-o", str(tmp_path / "model.h5"), *options]) == status
    assert message in capsys.readouterr().err


def test_command_line_names_the_nearest_option(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["-o", "model.h5", "--flank-lenght", "8"])
    assert stop.value.code == 2
    assert "did you mean --flank-length?" in capsys.readouterr().err


def test_missing_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-o", str(tmp_path / "none" / "model.h5"), *COARSE_OPTIONS]) == 5
    assert "no folder" in capsys.readouterr().err
