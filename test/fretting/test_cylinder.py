"""A cylinder on a flat as `fretwear.halfplane` makes it, against what is known of its wear: closed
forms, and judges that share no code with generator or program."""
import subprocess
import sys

import h5py
import numpy as np
import pytest
from cases import read, run
from limits import limit
from project import EXAMPLE, PATIENT
from scar_cases import Scar, groups, led, left_in_the_end

from fretwear.errors import InputError
from fretwear.halfplane import Cells, Cylinder, PartialSlip, gross_slip, main, partial_slip

CYLINDER = Cylinder()
HALF = PartialSlip(CYLINDER, 0.5 * CYLINDER.mu * CYLINDER.load)
FOLDER = EXAMPLE / "cylinder_on_flat"
AMPLITUDE, REACH, WEAR = 0.0125, 0.3, 1e-7
#: Sums of a few thousand terms of one sign, and inverses of matrices of condition 1e3.
ROUND_OFF = 1e-11
#: Quadratures of smooth functions.
QUADRATURE = 1e-12
#: Of the largest depth, by the steps that the program chooses; reached 2e-5.
SAME_PROFILE = 1e-3
#: Square waves of H = 15 slide 0.3 % too far; the judge is good to 1e-6.
SAME_SCAR = 1e-2


def scar_of(case, n, reach=3):
    """The judge's picture of a cylinder in partial slip."""
    one = case.cylinder
    return Scar(n, 2.0 * reach * case.stick_half_width / n, one.contact_modulus, one.radius,
                one.load, one.mu, case.tangential_load)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.75])
def test_closed_form_of_partial_slip_is_one(share):
    """The pressure carries the load, and it leaves no gap all over the scar."""
    case = PartialSlip(CYLINDER, share * CYLINDER.mu * CYLINDER.load)
    a, b, c = CYLINDER.half_width, case.scar_half_width, case.stick_half_width
    assert c < a < b and abs(case.depth([b])[0]) < QUADRATURE * case.largest_depth
    # Nodes of Gauss and Chebyshev: the root at the rims goes with ds.
    angle = (np.arange(400) + 0.5) * np.pi / 400
    s = c * np.cos(angle)
    force = case.pressure(s) * c * np.sin(angle) * np.pi / 400
    assert force.sum() == pytest.approx(CYLINDER.load, rel=QUADRATURE)
    x = np.linspace(1.05 * c, 0.99 * b, 20)
    tilt = 2.0 / (np.pi * CYLINDER.contact_modulus) * (force / (x[:, None] - s)).sum(axis=1)
    step = 1e-5 * c
    slope = (case.depth(x + step) - case.depth(x - step)) / (2.0 * step)
    # Differences of second order.
    assert x / CYLINDER.radius + slope == pytest.approx(tilt, rel=1e-7)
    assert case.depth([case.deepest_at])[0] == case.largest_depth
    nodes, weights = np.polynomial.legendre.leggauss(60)
    # The depth begins with a root: x = c + (b - c) t^2.
    t = 0.5 * (nodes + 1.0)
    volume = (weights * case.depth(c + (b - c) * t**2) * 2.0 * t).sum() * (b - c)
    assert case.volume == pytest.approx(volume, rel=QUADRATURE)


def test_grid_and_compliance_are_those_of_the_judge():
    """Also of a force that a cell has on itself; and the inverse is one."""
    cells = Cells(60, 0.01)
    other = Scar(60, 0.01, CYLINDER.contact_modulus, 6.0, 18.5, 0.8, 0.0, datum=6.0)
    compliance = cells.compliance(CYLINDER.contact_modulus, 6.0)
    assert cells.place == pytest.approx(other.place, rel=1e-15)
    assert abs(compliance - other.compliance()).max() < 1e-14 * compliance.max()
    model = gross_slip(CYLINDER, AMPLITUDE, half_width=REACH)
    product = model.K[:60, :60] @ other.compliance()
    assert abs(product - np.eye(60)).max() < ROUND_OFF
    assert np.linalg.cond(compliance) < 1e3
    # A flat that moves as a whole moves every cell with it.
    assert np.linalg.solve(model.K[60:120, 60:120], model.cosine[60:120]) == pytest.approx(
        -AMPLITUDE, rel=ROUND_OFF)


def test_command_makes_the_examples(tmp_path):
    """To the last digits that another library of linear algebra has."""
    commands = {"moved": ["--displacement", "0.0125", "--half-width", "0.3"],
                "loaded": ["--tangential-load", "7.4"]}
    for name, words in commands.items():
        assert main([*words, "-o", str(tmp_path / f"{name}.h5")]) == 0
        text = (FOLDER / "README.md").read_text(encoding="utf-8")
        assert f"python -m fretwear.halfplane {' '.join(words)} -o {name}.h5" in text
        with h5py.File(tmp_path / f"{name}.h5") as made, h5py.File(FOLDER / f"{name}.h5") as kept:
            names = set()
            kept.visit(names.add)
            for part in sorted(names):
                if isinstance(kept[part], h5py.Dataset) and kept[part].dtype.kind == "f":
                    values = kept[part][()]
                    assert abs(made[part][()] - values).max() <= ROUND_OFF * abs(values).max()


@pytest.mark.parametrize(("words", "status", "message"), [
    (["--tangential-load", "14.8"], 3, "tangential_load: is 14.8, must be below mu times"),
    (["--tangential-load", "7.4", "--cells", "64"], 3,
     "n: is 64, must be a multiple of 6, such as 66"),
    (["--tangential-load", "7.4", "--half-width", "1"], 3, "half_width: goes with --displacement"),
    (["--displacement", "0.01", "--half-width", "0.03"], 3, "half_width: is 0.03, must be above"),
    (["--displacement", "0.01", "--datum", "0.1"], 3, "datum: is 0.1, must be above the width"),
    (["--displacement", "-1"], 3, "displacement: is -1, must be above 0"),
    (["--displacement", "nan"], 3, "must be finite"),
    (["--displacement", "0.01", "--poisson", "0.6"], 3, "poisson: is 0.6"),
    (["--displacement", "0.01", "--radius", "0"], 3, "radius: is 0, must be above 0"),
    (["--displacement", "0.01", "--tangential-load", "1"], 2, "not allowed with"),
    (["--displacment", "0.01"], 2, "--displacement"),
    ([], 2, "--displacement")])
def test_what_is_refused(tmp_path, capsys, words, status, message):
    target = tmp_path / "none.h5"
    try:
        found = main([*words, "-o", str(target)])
    except SystemExit as end:
        found = end.code
    assert found == status and message in capsys.readouterr().err
    assert not target.exists()


def test_module_is_a_command(tmp_path):
    """What it says of the case."""
    done = subprocess.run([sys.executable, "-m", "fretwear.halfplane", "--tangential-load", "7.4",
                           "-o", "model.h5"], capture_output=True, text=True, check=False,
                          cwd=tmp_path, timeout=limit(60), env=PATIENT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "model.h5: 60 cells, 122 dofs"
    assert "sticks within 0.0253584; in the end worn up to 0.0419296" in done.stdout


def test_unit_of_modulus_and_loads_does_not_matter():
    """Lengths of the closed form know of the ratio of load and modulus only."""
    other = PartialSlip(Cylinder(young=200e9, load=18.5e6), 7.4e6)
    assert other.scar_half_width == pytest.approx(HALF.scar_half_width, rel=1e-14)
    assert other.volume == pytest.approx(HALF.volume, rel=1e-12)
    with pytest.raises(InputError, match="load"):
        Cylinder(load=0.0)


def worn(folder, case, n, **wear):
    """The result of a run with H = 7 and all else as it comes."""
    partial_slip(case, n=n).to_hdf5(folder / "model.h5")
    keys = groups(scar_of(case, n), 7, **wear)
    run(folder, keys)
    return read(folder / "case.h5")


def test_partial_slip_ends_at_the_closed_form(tmp_path):
    """The profile that is left on the cells; their error goes with their width, so that two grids
    tell the volume of none."""
    volume = {}
    for n in (60, 120):
        found = worn(tmp_path, HALF, n)
        scar = scar_of(HALF, n)
        true, stuck = left_in_the_end(scar)
        depth = found["wear/depth"][-1]
        assert found["wear"]["steady_state"] == "reached" and "remarks/name" not in found
        assert abs(depth - true).max() < SAME_PROFILE * true.max()
        assert len(stuck) == n // 3 and not depth[stuck].any()
        assert abs(depth - depth[::-1]).max() < SAME_PROFILE * true.max()
        energy = depth * scar.cell * scar.mu / scar.wear
        assert abs(found["wear/energy"][-1] - energy).max() < 1e-8 * energy.max()
        assert len(found["wear/cycles"]) < 60 and found["iterations"][1:].mean() < 9.0
        volume[n] = depth.sum() * scar.cell
    assert 2.0 * volume[120] - volume[60] == pytest.approx(HALF.volume, rel=1e-2)


def test_gross_slip_follows_the_judge(tmp_path):
    """A march of cycles of the same cells, and closed forms; the scar of a thousand cycles."""
    cycles = 1000.0
    gross_slip(CYLINDER, AMPLITUDE, half_width=REACH).to_hdf5(tmp_path / "model.h5")
    scar = Scar(60, 0.01, CYLINDER.contact_modulus, CYLINDER.radius, CYLINDER.load, CYLINDER.mu,
                0.0, WEAR, datum=6.0)
    keys = groups(scar, 15, n_cycles=cycles)
    keys["output"]["observe"] = ["approach"]
    run(tmp_path, keys)
    found = read(tmp_path / "case.h5")
    depth, true = found["wear/depth"][-1], led(scar, AMPLITUDE, cycles)
    assert found["wear/cycles"][-1] == cycles and found["converged"].all()
    assert depth.max() == pytest.approx(true.max(), rel=SAME_SCAR)
    assert depth.sum() == pytest.approx(true.sum(), rel=SAME_SCAR)
    # Archard's wear and the work of friction are two measures of one slip, in every row.
    rate = found["wear/rate"].sum(axis=1) * scar.cell * scar.mu
    assert rate == pytest.approx(WEAR * found["contact/dissipation"].sum(axis=1), rel=1e-5)
    assert found["iterations"][1:].mean() < 9.0 and len(found["wear/cycles"]) < 100
    # The load that presses, by the pressures at all instants of the series: constant.
    assert -found["contact/force"][-1, 0, :, 2].sum() == pytest.approx(CYLINDER.load, rel=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_random_cylinders(tmp_path, seed):
    """The first of the family that docs/cylinder_on_flat.md counts."""
    from cylinder_family import WORDS, verdict

    assert verdict(tmp_path, seed)[0] in WORDS[:3]
