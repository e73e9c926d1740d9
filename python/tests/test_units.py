"""Values with units: the same case as with the numbers that they stand for."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from project import EXAMPLE, PROGRAM, ROOT

import fretwear as fw
from fretwear.cli import main

pint = pytest.importorskip("pint")

SECTOR = EXAMPLE / "blade_sector" / "sector_16.h5"  # mm-tonne-s-N
OSCILLATOR = """&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.04 /
&load cosine = 1 /
&sweep start = '0.1 Hz' end = "6 rpm" n_points = 3 /
"""


def effective(**groups: Any) -> dict[str, list[str]]:
    """What the library makes of a sweep of the sector, by key."""
    from fretwear._native import namelist_values

    case = fw.Case(SECTOR, sweep={"start": 1017, "end": 1029, "n_points": 3, "unit": "Hz"})
    return namelist_values(case.replace(**groups).namelist())


@pytest.mark.parametrize(("groups", "key", "number"), [
    ({"sweep": {"start": "1.02 kHz"}}, "sweep%start", 1020.0),
    ({"sweep": {"start": "6283.185307179586 rad/s"}}, "sweep%start", 1000.0),
    ({"structure": {"rotation_speed": "4400 rpm"}}, "model%rotation_speed",
     4400.0 * np.pi / 30.0),
    ({"contact": {"gap": "5 um", "law": "penalty", "normal_stiffness": "1e3 N/mm",
                  "tangential_stiffness": 1.0}}, "contact%gap", 0.005),
    ({"contact": {"law": "penalty", "tangential_stiffness": "2 kN/um", "normal_stiffness": 1.0}},
     "contact%tangential_stiffness", 2e6),
    ({"contact": {"area": "1 cm^2"}}, "contact%area", 100.0),
    ({"case": {"max_seconds": "2 min"}}, "case%max_seconds", 120.0),
    ({"structure": {"rotation_speed": "1e3 rad/s"}, "contact": {"gap": 1e-09}}, "contact%gap",
     1e-9),
    ({"structure": {"rotation_speed": pint.Quantity(10.0, "rad/s")}}, "model%rotation_speed", 10.0),
])
def test_the_numbers_are_those_of_the_model(groups: dict[str, Any], key: str,
                                            number: float) -> None:
    values = effective(**groups)
    assert float(values[key][0]) == pytest.approx(number, rel=1e-14)


def test_a_namelist_with_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Frequencies that were typed in hertz stay so, and the program reads the effective case."""
    path = tmp_path / "case.nml"
    path.write_text(OSCILLATOR)
    case = fw.Case.from_file(path)
    result = fw.run(case, in_memory=True)
    assert result.omega == pytest.approx(2.0 * np.pi * np.array([0.1, 0.1, 0.1]))
    assert "unit = 'Hz'" in result.namelist
    assert main(["run", "-q", str(path), "--set", "sweep%end=300 mHz"]) == 0
    assert fw.Result(path.with_suffix(".h5")).frequency == pytest.approx([0.1, 0.2, 0.3])
    (tmp_path / "effective.nml").write_text(result.namelist)
    assert fw.Case.from_file(tmp_path / "effective.nml").namelist()


def test_a_number_replaces_a_value_with_a_unit(tmp_path: Path) -> None:
    """What is set last holds, whether it has a unit or not."""
    from fretwear._native import namelist_values

    path = tmp_path / "case.nml"
    path.write_text(OSCILLATOR)
    case = fw.Case.from_file(path, sweep={"start": "0.2 Hz"}).replace(sweep={"start": 0.05})
    for changed in (case, fw.Case.from_file(path).overridden(["sweep%start=0.05"])):
        values = namelist_values(changed.namelist())
        assert float(values["sweep%start"][0]) == 0.05
        assert float(values["sweep%end"][0]) == pytest.approx(0.1)


def test_a_list_takes_a_unit_for_each() -> None:
    case = fw.Case(SECTOR, sweep={"values": ["1.01 kHz", "61500 rpm", "6500 rad/s"]})
    with fw.Steps(case.replace(harmonics={"n_harmonics": 1})) as steps:
        assert steps.frequencies / (2.0 * np.pi) == pytest.approx(
            [1010.0, 1025.0, 6500.0 / (2.0 * np.pi)])


def test_a_sweep_over_a_parameter_has_its_unit() -> None:
    values = effective(sweep={"parameter": "contact%gap", "frequency": "1.02 kHz",
                              "start": "1 um", "end": "0.01 mm"})
    assert [float(values[f"sweep%{key}"][0]) for key in ("start", "end")] == [0.001, 0.01]
    assert float(values["sweep%frequency"][0]) == 1020.0


@pytest.mark.parametrize(("groups", "told"), [
    ({"contact": {"gap": "5 N"}}, r"&contact gap = '5 N': is in N, must be in a unit of L"),
    ({"contact": {"gap": "5 mmm"}}, "'5 mmm': mmm is no unit that is known here: must be one of L"),
    ({"contact": {"gap": "1e400 m"}}, "1e400 is no number, or too large in L"),
    ({"contact": {"gap": "1e307 m"}}, "1e307 is no number, or too large in L"),
    ({"sweep": {"start": "1 Hz^999/Hz^998"}}, "is no unit that is known here"),
    ({"sweep": {"start": "3 mm"}}, r"'3 mm': is in mm, must be in a unit of Hz"),
    ({"solver": {"tolerance": "1 mm"}}, "&solver tolerance = '1 mm': the key has no unit"),
    ({"structure": {"unit_system": "m-kg-s-N"}, "contact": {"gap": "5 um"}},
     "&model unit_system = 'm-kg-s-N': the model says 'mm-tonne-s-N'"),
    ({"spring": {"n_springs": 2, "side_1": [1, 2], "power": [2, 3], "coefficient": "1 N/mm^3"}},
     "powers of the springs differ"),
    ({"resonance": {"parameter": "contact%gap", "as": "factor", "start": "1 um"}}, "has no unit"),
])
def test_what_is_no_such_quantity_is_refused(groups: dict[str, Any], told: str) -> None:
    with pytest.raises(fw.InputError, match=told):
        effective(**groups)


def test_a_model_without_units_takes_numbers() -> None:
    model = fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0])
    case = fw.Case(model, sweep={"start": 0.5, "end": 1.0, "n_points": 2}, load={"cosine": "1 N"})
    with pytest.raises(fw.InputError, match="give &model unit_system, such as 'mm-tonne-s-N'"):
        case.check()
    assert "cosine = 1 " in case.replace(structure={"unit_system": "m-kg-s-N"}).namelist()
    with pytest.raises(fw.InputError, match=r"is no consistent system of units.*0\.001 forces"):
        case.replace(structure={"unit_system": "mm-kg-s-N"}).check()
    with pytest.raises(fw.InputError, match="'furlongs', are not known here"):
        case.replace(structure={"unit_system": "furlongs"}).check()


def test_the_program_reads_units_itself(tmp_path: Path) -> None:
    """A namelist that states its units; options need no quotes, and springs have their power."""
    (tmp_path / "case.nml").write_text("""
&model n_dof = 1 mass = '1 kg' stiffness = '1 kN/m' damping = '0.5 N s/m'
       unit_system = 'mm-tonne-s-N' /
&load cosine = '2000 mN' /
&spring n_springs = 2 side_1 = 2*1 coefficient = 2*'1 N/mm^3' /
&sweep start = '30 rad/s' end = '300 rpm' n_points = 3 / &output observe = 1 /
""")
    said = subprocess.run([PROGRAM, "--check", "--set", "load%sine=3 N", "case.nml"],
                          cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    for line in ("mass = 0.001 ", "stiffness = 1 ", "damping = 5e-4 ", "cosine = 2 ", "sine = 3 ",
                 "coefficient = 1 ", "start = 30 ", "end = 31.415926535897"):
        assert f"   {line}" in said
    wrong = subprocess.run([PROGRAM, "--check", "--set", "load%sine=3 mm", "case.nml"],
                           cwd=tmp_path, capture_output=True, text=True, check=False)
    assert wrong.returncode == 3
    assert "--set load%sine=3 mm: &load sine = 3 mm: is in mm, must be in a unit of F" \
        in wrong.stderr


def test_the_table_of_units_is_that_of_pint() -> None:
    """Every unit with every prefix: the number is that of pint, or pint knows no such unit."""
    source = (ROOT / "src" / "io" / "unit_table.f90").read_text()
    names = re.findall(r"named_unit\('(\w+)'.*?(, yes|, no, yes)?\)", source)
    prefixes = [("", ""), *re.findall(r"prefix_type\('(\w+)', *'(\w+)'", source)]
    assert len(names) > 45
    assert len(prefixes) > 9
    units = [f"{symbol if marks != ', no, yes' else word}{name}" for name, marks in names
             for symbol, word in (prefixes if marks else prefixes[:1]) if name != "1"]
    units += ["newtons", "kilonewtons", "N/mm^2*m^2", "kg m/s**2", "1/s^2*kg*m", "N*s^-1*min",
              "kN * turn", "meter ** 2 * pascal", "MPa mm^2"]
    registry = pint.UnitRegistry(on_redefinition="ignore")
    # Elsewhere hertz are bare per second, and 1 Hz were 1 rad/s.
    registry.define("hertz = 2 * π * radian / second = Hz")
    registry.define("revolutions_per_minute = 2 * π * radian / minute = rpm")
    whole, expected = [], []
    for unit in units:
        # To a force, by powers of metres, kilograms and seconds.
        powers = registry.Quantity(1.0, unit.replace("^", "**")).dimensionality
        missing = {"m": 1 - powers["[length]"], "kg": 1 - powers["[mass]"],
                   "s": -2 - powers["[time]"]}
        text = unit + "".join(f"*{base}^{power:g}" for base, power in missing.items() if power)
        whole.append(f"2.5 {text}")
        expected.append(registry.Quantity(2.5, text.replace("^", "**")).to("N").magnitude)
    n = len(units)
    model = fw.Model(np.eye(n), None, np.eye(n), unit_system="mm-tonne-s-N")
    from fretwear._native import namelist_values

    case = fw.Case(model, load={"cosine": whole}, sweep={"start": 2.0, "end": 3.0, "n_points": 2})
    found = np.array(namelist_values(case.namelist())["load%cosine"], dtype=float)
    assert found == pytest.approx(expected, rel=1e-14)
