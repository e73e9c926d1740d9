"""Pictures of bladed disks show the numbers of their results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from program import run

from fretwear import AbsentError, InputError, Result
from fretwear.cli import main
from fretwear.plot import (
    KINDS,
    Choices,
    fitting,
    plot_blades,
    plot_campbell,
    plot_content,
    plot_damping,
    plot_envelope,
    plot_force,
    plot_nodal_diameters,
    plot_safe,
    plot_wave,
    read_damping,
)
from fretwear.plot.disks import folded

EXAMPLE = Path(__file__).resolve().parents[2] / "example"
DISK = EXAMPLE / "bladed_disk" / "disk.nml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("disks")


@pytest.fixture(scope="module")
def modes(folder: Path) -> Result:
    return run(EXAMPLE / "shrouded_disk" / "wave.nml", folder / "modes.h5", "case%analysis=modes",
               "model%rotation_speed=250")


@pytest.fixture(scope="module")
def wave(folder: Path) -> Result:
    return run(DISK, folder / "wave.h5", "sweep%n_points=3")


def test_engine_orders_fold_at_half_of_the_sectors() -> None:
    assert folded(np.arange(-9, 15), 7).tolist() == [
        2, 1, 0, 1, 2, 3, 3, 2, 1, 0, 1, 2, 3, 3, 2, 1, 0, 1, 2, 3, 3, 2, 1, 0]
    assert folded(np.array([18, 19, 36, 40]), 36).tolist() == [18, 17, 0, 4]


def test_kinds_that_fit(modes: Result, wave: Result, folder: Path) -> None:
    assert fitting(modes) == ["nodal_diameters", "safe"]
    assert "wave" in fitting(wave) and "safe" not in fitting(wave)
    still = run(DISK, folder / "still.h5", "case%analysis=modes")
    assert fitting(still) == ["nodal_diameters"]
    plain = run(EXAMPLE / "duffing" / "duffing.nml", folder / "plain.h5", "sweep%n_points=2")
    assert not {"wave", "nodal_diameters", "safe"} & set(fitting(plain))
    for result in (modes, wave, still):
        for name in fitting(result):
            figure = KINDS[name].draw(result, Choices())
            assert any(axes.has_data() for axes in figure.axes), name


def test_frequencies_over_the_nodal_diameter(modes: Result) -> None:
    (axes,) = plot_nodal_diameters(modes).axes
    first = axes.lines[0]
    assert first.get_xdata() == pytest.approx(np.arange(19))
    assert first.get_ydata() == pytest.approx(modes["modes/open"][:, 0] / (2.0 * np.pi))
    assert axes.get_xlabel() == "nodal diameter" and axes.get_ylabel() == "frequency [Hz]"


def test_line_of_the_speed(modes: Result) -> None:
    """Squares are engine orders: at their frequency, and at the nodal diameter that they excite."""
    (axes,) = plot_safe(modes).axes
    squares = next(line for line in axes.lines if line.get_marker() == "s")
    order = np.asarray(squares.get_ydata()) / (250.0 / (2.0 * np.pi))
    assert order == pytest.approx(np.arange(len(order)))
    assert np.asarray(squares.get_xdata())[[4, 18, 32, 40]].tolist() == [4, 18, 4, 4]
    fast = next(line for line in plot_safe(modes, 500.0).axes[0].lines
                if line.get_marker() == "s")
    assert np.asarray(fast.get_ydata())[1] == pytest.approx(500.0 / (2.0 * np.pi))


def test_wave_over_the_sectors(wave: Result) -> None:
    (axes,) = plot_wave(wave, 1, "u6").axes
    first = axes.lines[0]
    column = wave.index("u6")
    expected = [wave.sector(j)[1, :, column] for j in range(8)]
    # At phase 0 the cosines add up, about the mean, which is said below the picture.
    assert first.get_ydata() == pytest.approx([c[1::2].sum() for c in expected])
    assert axes.get_ylabel().startswith("u6 about its mean")
    assert any("mean, left out" in text.get_text() for text in axes.texts)
    assert np.asarray(first.get_ydata())[7] == pytest.approx(np.asarray(first.get_ydata())[0])
    assert "towards lower sectors" in axes.get_title()  # engine order 5 of 7 sectors


def test_campbell_diagram(modes: Result, folder: Path) -> None:
    slow = run(EXAMPLE / "shrouded_disk" / "wave.nml", folder / "slow.h5", "case%analysis=modes")
    (axes,) = plot_campbell([modes, slow], 4).axes
    first = axes.lines[0]
    assert first.get_xdata() == pytest.approx([0.0, 250.0 * 30.0 / np.pi])
    assert first.get_ydata() == pytest.approx(
        [r["modes/open"][4, 0] / (2.0 * np.pi) for r in (slow, modes)])
    # The blades stiffen as they are pulled.
    assert first.get_ydata()[1] > 1.003 * first.get_ydata()[0]
    rings = next(line for line in axes.lines if line.get_label() == "crossing")
    # Where an engine order that excites 4 nodal diameters of 36 sectors meets a frequency.
    speed, hertz = np.asarray(rings.get_xdata()) / 60.0, np.asarray(rings.get_ydata())
    assert len(speed) and all(round(float(f / s)) in (4, 32) for s, f in zip(speed, hertz))
    assert hertz / speed == pytest.approx(np.round(hertz / speed))
    assert {text.get_text() for text in axes.texts} >= {"EO 1", "EO 2", "EO 4"}
    with pytest.raises(InputError, match="one rotation speed"):
        plot_campbell([slow, slow])
    with pytest.raises(InputError, match="among 0 to 18"):
        plot_campbell([modes, slow], 19)


def test_damping_curve(wave: Result, folder: Path) -> None:
    """The curve joins peaks; a sweep that is highest at its end is a ring beside it."""
    wide = "sweep%end=1.5", "sweep%n_points=21"  # the peak lies below the end of the example
    once = run(DISK, folder / "once.h5", *wide)
    double = run(DISK, folder / "double.h5", *wide, "load%harmonic_scale=2")
    found = read_damping([double, wave, once], "u6")
    load = 0.5 * np.hypot(1.0, 0.2)  # cosine 0.5 and sine -0.1, at dof 5
    assert found[:, 0] == pytest.approx([load, load, 2.0 * load])
    assert found[:, 1] == pytest.approx(0.08)
    assert found[:, 4].tolist() == [0.0, 1.0, 1.0]
    largest = np.abs(wave.harmonic(1, "u6")).max()
    assert found[0, 2] == pytest.approx(largest / load)
    (located,) = [one for one in once.peaks
                  if one.observed == "u6" and one.found_by != "end of the sweep"]
    assert found[1, 2] * load == pytest.approx(np.hypot(*located.coefficients[1:3]))
    for axes, column in zip(plot_damping([double, wave, once], "u6").axes, (2, 3)):
        peaks, ring = axes.lines
        assert peaks.get_xdata() == pytest.approx(found[1:, 0] / 0.08)
        assert peaks.get_ydata() == pytest.approx(found[1:, column])
        assert ring.get_ydata() == pytest.approx(found[:1, column])
        assert ring.get_markerfacecolor() == "white"
    in_proportion, peaks, _ = plot_force([double, wave, once], "u6").axes[0].lines
    assert peaks.get_xdata() == pytest.approx([1.0, 2.0])     # two dofs: by the factor
    assert peaks.get_ydata() == pytest.approx(found[1:, 2] * found[1:, 0])
    assert in_proportion.get_ydata()[1] == pytest.approx(2.0 * load * found[1, 2])


def test_envelope_of_sweeps(wave: Result, folder: Path) -> None:
    """Between the points of one sweep the other one has some; outside of both is nothing."""
    finer = run(DISK, folder / "finer.h5", "sweep%n_points=5", "load%harmonic_scale=2")
    axes = plot_envelope([wave, finer], "u6").axes[0]
    largest = axes.lines[-1]
    frequency = np.unique(np.concatenate([wave.frequency, finer.frequency]))
    assert largest.get_xdata() == pytest.approx(frequency)
    order = [np.argsort(result.frequency) for result in (wave, finer)]
    both = [np.interp(frequency, r.frequency[k], r.amplitude_of("u6")[k])
            for r, k in zip((wave, finer), order)]
    assert largest.get_ydata() == pytest.approx(np.max(both, axis=0))


def test_blades_and_their_waves(wave: Result, folder: Path) -> None:
    """Every sector, the largest of all, and what the sectors are made of."""
    disk = run(DISK, folder / "all.h5", "sweep%n_points=3", "cyclic%mistuned=.true.",
               "contact%mu(1)=0.8", "harmonics%n_harmonics=3")
    assert {"wave", "blades", "content"} <= set(fitting(disk))
    assert not {"blades", "content"} & set(fitting(wave))
    n = int(disk.attributes["n_sectors"])
    (axes,) = plot_blades(disk, "u6@2").axes
    assert len(axes.lines) == n + 1
    column = disk.index("u6@0")
    assert axes.lines[-1].get_ydata() == pytest.approx(
        disk.sector_amplitude[:, :, column].max(axis=1))
    best = int(disk["blades/largest"][:, column].argmax())
    title = plot_content(disk, observe="u6@0").axes[0].get_title()
    assert f"{disk.frequency[best]:.6g} Hz" in title
    bars = plot_content(disk, 1, "u6@0").axes[0].patches
    u = np.array([disk.sector(j)[1, 1, column] - 1j * disk.sector(j)[1, 2, column]
                  for j in range(n)])
    k = disk["blades/nodal_diameter"]
    size = np.abs(np.exp(2j * np.pi * np.outer(k, np.arange(n)) / n) @ u) / n
    assert [bar.get_height() for bar in bars] == pytest.approx(size)
    single = run(DISK, folder / "one.h5", "case%analysis=point", "cyclic%mistuned=.true.",
                 "harmonics%n_harmonics=3")
    assert len(plot_blades(single).axes[0].patches) == n
    with pytest.raises(AbsentError, match="mistuned"):
        plot_content(wave)


def test_what_cannot_be_drawn(modes: Result, wave: Result, folder: Path) -> None:
    with pytest.raises(AbsentError, match="analysis = 'modes'"):
        plot_nodal_diameters(wave)
    with pytest.raises(AbsentError, match="cyclic"):
        plot_wave(run(EXAMPLE / "duffing" / "duffing.nml", folder / "a.h5", "sweep%n_points=2"))
    with pytest.raises(AbsentError, match="rotation_speed"):
        plot_safe(run(DISK, folder / "b.h5", "case%analysis=modes"))
    with pytest.raises(AbsentError, match="no sweep"):
        plot_damping([modes, modes])


def test_command_line(modes: Result, wave: Result, folder: Path, monkeypatch: pytest.MonkeyPatch,
                      capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(folder)
    paths = [str(modes.path), str(folder / "slow2.h5")]
    run(EXAMPLE / "shrouded_disk" / "wave.nml", Path(paths[1]), "case%analysis=modes")
    assert main(["plot", paths[0]]) == 0
    assert {"modes_nodal_diameters.png", "modes_safe.png"} <= {p.name for p in folder.iterdir()}
    assert main(["plot", *paths, "--kind", "campbell", "--nodal-diameter", "4"]) == 0
    assert (folder / "modes_campbell.png").exists()
    assert main(["plot", *paths, "--kind", "safe"]) == 3
    assert "response, backbone, campbell, damping" in capsys.readouterr().err
    assert main(["plot", paths[0], "--kind", "campbell"]) == 3
    assert "case%analysis = 'campbell'" in capsys.readouterr().err
    assert main(["plot", *paths, "--kind", "campbell", "--observe", "tip"]) == 3
    assert main(["plot", paths[0], "--nodal-diameter", "4"]) == 3
