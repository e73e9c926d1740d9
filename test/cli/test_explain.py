"""fw_run --explain: why points were not found, judged by motions whose fate is known."""
import re

import pytest

h5py = pytest.importorskip("h5py")
np = pytest.importorskip("numpy")

#: One iteration and no other way: every point fails, whatever its motion is.
NO_WAY = "&solver max_iterations = 1, fallback = .false. /\n"
#: Amplitudes of the balance against those of an integration of second order, in as many steps.
SAME = 2e-3

JENKINS = ("&case analysis = 'frf' /\n"
           "&model n_dof = 1, mass = 1.0, stiffness = 1.0, damping = 0.02 /\n"
           "&contact n_pairs = 1, law = 'penalty', tangential_stiffness = 1.0, side_1 = 1, 0, 0, "
           "normal_load = 1.0, mu = 1.0 /\n"
           "&load cosine = 2.0 /\n&harmonics n_harmonics = {} /\n"
           "&sweep start = 1.1, end = 1.2, n_points = 2 /\n")
#: x'' + 0.3 x' - x + x^3 = F cos(1.2 t), whose motions go from period to period to none with F.
TWO_WELLS = ("&case analysis = 'point' /\n"
             "&model n_dof = 1, mass = 1.0, stiffness = -1.0, damping = 0.3 /\n"
             "&spring n_springs = 1, side_1 = 1, coefficient = 1.0, power = 3 /\n"
             "&load cosine = {} /\n&harmonics n_harmonics = 9 /\n&sweep start = 1.2 /\n")
#: A mass that friction alone holds, and less than its static load.
SLIDES = ("&case analysis = 'point' /\n"
          "&model n_dof = 1, mass = 1.0, stiffness = 0.0, damping = {} /\n"
          "&contact n_pairs = 1, law = 'dlft', side_1 = 1, 0, 0, normal_load = 1.0, mu = 0.5 /\n"
          "&load static = 2.0, cosine = 0.1 /\n&harmonics n_harmonics = 3 /\n"
          "&sweep start = 1.0 /\n")


def explained(fw_run, text, status=4):
    fw_run.write(text)
    done = fw_run("-q", "--explain", "case.nml")
    assert done.returncode == status, done.stderr
    with h5py.File(fw_run.directory / "case.h5") as file:
        names = file["remarks/name"].asstr()[()]
        texts = file["remarks/text"].asstr()[()]
    return [text for name, text in zip(names, texts) if name == "explained"]


def test_a_periodic_motion_is_found_with_its_amplitude(fw_run):
    text = JENKINS.format(15)
    fw_run.write(text)
    assert fw_run("-q", "case.nml").returncode == 0
    with h5py.File(fw_run.directory / "case.h5") as file:
        amplitude = file["amplitude"][0, 0]
    said = explained(fw_run, text + NO_WAY)
    assert len(said) == 1
    assert "no solution at 1.10000E+00 rad/s and at the point behind it" in said[0]
    assert "tried were every pair stuck" in said[0] and "ended at a residual of" in said[0]
    found = re.search(r"comes to a periodic motion \(amplitude (\S+)\) after \d+ periods", said[0])
    assert found and float(found[1]) == pytest.approx(amplitude, rel=SAME)
    assert "the harmonics of the balance can hold" in said[0]


def test_a_fold_is_named(fw_run):
    """Upwards over the resonance of a hardening spring, behind which no solution is near."""
    said = explained(fw_run, "&case analysis = 'frf' /\n"
                     "&model n_dof = 1, mass = 1.0, stiffness = 1.0, damping = 0.1 /\n"
                     "&spring n_springs = 1, side_1 = 1, coefficient = 0.05, power = 3 /\n"
                     "&load cosine = 1.0 /\n&harmonics n_harmonics = 5 /\n"
                     "&sweep start = 0.5, end = 3.0, n_points = 251 /\n"
                     "&solver max_iterations = 4, fallback = .false. /\n")
    assert len(said) == 1 and "tried were the last solutions, every pair stuck" in said[0]
    assert "as before a fold" in said[0] and "comes to a periodic motion" in said[0]


def test_too_few_harmonics_are_named(fw_run):
    """Slow slip, whose displacement has corners."""
    slow = JENKINS.format(1).replace("cosine = 2.0", "cosine = 4.0").replace(
        "start = 1.1, end = 1.2", "start = 0.05, end = 0.06")
    said = explained(fw_run, slow + NO_WAY)
    assert re.search(r"of which \d+\.\d % is above harmonic 1: more n_harmonics", said[0]), said


@pytest.mark.parametrize(("force", "words"), [
    (0.20, r"comes to a periodic motion"),
    (0.28, r"repeats after 2 periods"),
    (0.29, r"repeats after 4 periods"),
    (0.50, r"no periodic motion: it does not repeat")])
def test_motions_of_two_wells(force, words, fw_run):
    said = explained(fw_run, TWO_WELLS.format(force) + NO_WAY)
    assert re.search(words, said[0]), said


def motions(force, damping, rng):
    """Period over that of the load (0: none up to 12) and amplitude of motions from many starts, by
    Runge's rule of fourth order."""
    n, before, steps = 24, 150, 100
    x, v = rng.uniform(-1.5, 1.5, (2, n))
    h = 2.0 * np.pi / 1.2 / steps

    def rate(t, x, v):
        return v, force * np.cos(1.2 * t) - damping * v + x - x**3

    sections, largest = [], np.zeros((before + 36, n))
    for period in range(before + 36):
        for step in range(steps):
            t = h * step
            k1 = rate(t, x, v)
            k2 = rate(t + h / 2, x + h / 2 * k1[0], v + h / 2 * k1[1])
            k3 = rate(t + h / 2, x + h / 2 * k2[0], v + h / 2 * k2[1])
            k4 = rate(t + h, x + h * k3[0], v + h * k3[1])
            x = x + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
            v = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
            largest[period] = np.maximum(largest[period], abs(x))
        sections.append(np.array([x, v]))
    last = np.array(sections[-36:])
    repeats = [next((m for m in range(1, 13) if abs(last[m:, :, k] - last[:-m, :, k]).max() < 1e-3),
                    0) for k in range(n)]
    return list(zip(repeats, largest[-12:].max(axis=0)))


@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5])   # at 3 one iteration is enough
def test_random_motions_of_two_wells(seed, fw_run):
    """What is said is what an integration of another kind comes to from one of many starts."""
    rng = np.random.default_rng(seed)
    force, damping = rng.uniform(0.1, 0.8), rng.uniform(0.15, 0.5)
    said = explained(fw_run, TWO_WELLS.replace("damping = 0.3", f"damping = {damping}").format(
        force) + NO_WAY)[0]
    known = motions(force, damping, rng)
    periodic = re.search(r"periodic motion \(amplitude (\S+)\) after", said)
    several = re.search(r"repeats after (\d+) periods", said)
    if periodic:
        assert any(m == 1 and float(periodic[1]) == pytest.approx(a, rel=1e-2) for m, a in known)
    elif several:
        assert any(m == int(several[1]) for m, _ in known), (said, known)
    else:
        assert "does not repeat" in said and any(m == 0 for m, _ in known), (said, known)


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_what_friction_does_not_hold_leaves(damping, fw_run):
    said = explained(fw_run, SLIDES.format(damping))
    assert "moves away for good" in said[0], said


def test_what_cannot_be_integrated_is_said(fw_run):
    text = JENKINS.format(3).replace("damping = 0.02", "damping = 0.02, loss_factor = 0.01")
    said = explained(fw_run, text + NO_WAY)
    assert "is not offered: " in said[0] and "time domain" in said[0]


def test_points_that_are_found_need_no_words(fw_run):
    fw_run.write(JENKINS.format(3))
    done = fw_run("-q", "--explain", "case.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "case.h5") as file:
        assert "remarks" not in file or "explained" not in file["remarks/name"].asstr()[()]


def test_other_analyses_are_refused(fw_run):
    fw_run.write(JENKINS.format(3).replace("'frf'", "'modes'"))
    done = fw_run("-q", "--explain", "case.nml")
    assert done.returncode == 2
    assert "--explain" in done.stderr and "'modes'" in done.stderr
