"""Natural frequencies free and stuck: the table, and the command beside a sweep."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from project import ROOT

import fretwear as fw
from fretwear.cli import main
from fretwear.modes_command import find_modes

TURN = 2.0 * np.pi
JENKINS = ROOT / "example" / "jenkins" / "jenkins.nml"


def test_free_and_stuck_of_an_oscillator() -> None:
    """Closed form: sqrt(k/m), and sqrt((k + k_t)/m) with the slider stuck."""
    found = find_modes(fw.Case.from_file(JENKINS))
    assert found.free == pytest.approx(np.array([[1.0]]), rel=1e-12)
    assert found.stuck == pytest.approx(np.array([[np.sqrt(2.0)]]), rel=1e-12)
    assert found.within(0.9, 1.5) == 2
    assert "0.225079" in repr(found)
    assert "<td>0.225079</td>" in found._repr_html_()


def test_command_marks_the_sweep(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["modes", str(JENKINS)]) == 0
    assert "sweep from 0.095493 to 0.254648 Hz: 2 of them *" in capsys.readouterr().out
    assert main(["modes", str(JENKINS), "--sweep", "1", "2"]) == 0
    assert "none of them" in capsys.readouterr().out


def test_one_frequency_is_no_sweep(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    point = tmp_path / "point.nml"
    point.write_text("&model n_dof = 1, mass = 1, stiffness = 1 / &sweep start = 1 /\n")
    assert main(["modes", str(point)]) == 0
    assert "sweep" not in capsys.readouterr().out


def test_every_nodal_diameter_of_a_disk(capsys: pytest.CaptureFixture[str]) -> None:
    disk = ROOT / "example" / "shrouded_disk" / "wave.nml"
    assert main(["modes", str(disk), "-n", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["nodal", "diameter", "mode", "free", "[Hz]", "stuck", "[Hz]"]
    assert sum(line.split()[0] == "18" for line in lines[1:]) == 2


def test_result_of_the_analysis(tmp_path: Path) -> None:
    case = fw.Case.from_file(JENKINS, case={"analysis": "modes"})
    found = fw.run(case, tmp_path / "modes.h5").modes
    np.testing.assert_array_equal(found.stuck, find_modes(case).stuck)


def test_wrong_ends_of_a_sweep(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["modes", str(JENKINS), "--sweep", "2", "1"]) == 3
    assert "the lower one first" in capsys.readouterr().err
