"""The job of example/mistuned_disk, its first steps, and the picture of stress."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import fretwear as fw
from fretwear.plot import plot_haigh

EXAMPLE = Path(__file__).resolve().parents[2] / "example" / "mistuned_disk"


@pytest.fixture(scope="module", name="module")
def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mistuned_job", EXAMPLE / "job.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["mistuned_job"] = module
    spec.loader.exec_module(module)
    return module


def test_the_job(module: ModuleType, tmp_path: Path) -> None:
    """What the README promises, blades of the bench, and a blade above the tuned disk."""
    job = module.Job(tmp_path)
    assert job.bench.shape == (36, 3)
    assert job.bench.mean() == pytest.approx(0.004, abs=0.003)
    assert job.bench.std() == pytest.approx(0.0085, abs=0.003)
    omega = job.campbell()
    assert job.facts["speed"] == pytest.approx(651.46, abs=0.01)
    assert omega / (2.0 * np.pi) == pytest.approx(414.7, abs=0.1)
    assert (tmp_path / "campbell.png").stat().st_size > 10000
    groups = job.around(omega, 5)
    found = fw.run(job.case("frf", mistuning={"frequency": job.bench.ravel().tolist()}, **groups),
                   in_memory=True)
    assert found["blades/largest"].shape == (5, 2)


def pressed(strengths: dict[str, object], diagram: str = "goodman") -> fw.Result:
    """One mass with two points, one of them in pressure."""
    rows = np.zeros((2, 6, 1))
    rows[0, 0], rows[1, 0] = 1.0, 2.0
    model = fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0],
                     stress=fw.Stress(rows, static=[[-3.0] + [0.0] * 5, [1.0] + [0.0] * 5]))
    return fw.frf(model, 0.5, 1.5, 11, harmonics={"n_harmonics": 1},
                  stress=strengths | {"diagram": diagram})


@pytest.mark.parametrize("diagram", ["goodman", "gerber"])
@pytest.mark.parametrize("strengths", [{}, {"endurance": 20.0, "ultimate": 50.0},
                                       {"endurance": [20.0, 30.0], "ultimate": [50.0, 60.0]}])
def test_haigh(strengths: dict[str, object], diagram: str) -> None:
    result = pressed(strengths, diagram)
    axes = plot_haigh(result).axes[0]
    point = int(result["stress/amplitude"][:, 1].argmax())
    amplitude, mean = (result[f"stress/{name}"][point] for name in ("amplitude", "mean"))
    parts = isinstance(strengths.get("endurance"), list)
    shown = next(line for line in axes.lines if line.get_marker() == ".")
    assert np.allclose(shown.get_ydata(), amplitude / (np.array([20.0, 30.0]) if parts else 1.0))
    assert np.allclose(shown.get_xdata(), mean / (np.array([50.0, 60.0]) if parts else 1.0))
    limits = [line for line in axes.lines if line.get_label() in ("Goodman", "Gerber")]
    assert [line.get_label() for line in limits] == ([diagram.title()] if strengths else [])
    if limits:
        x, y = (np.asarray(values) for values in limits[0].get_data())
        assert y[0] == y[1] == (1.0 if parts else 20.0) and y[-1] == 0.0
        assert x[-1] == (1.0 if parts else 50.0)
    with pytest.raises(fw.InputError, match="must be 0 to"):
        plot_haigh(result, 99)


def test_without_stress() -> None:
    result = fw.frf(fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0]), 0.5, 1.5, 3,
                    harmonics={"n_harmonics": 1})
    with pytest.raises(fw.AbsentError, match="holds no stress"):
        plot_haigh(result)
