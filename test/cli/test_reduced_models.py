"""Models that say how far they were reduced, and modal damping of the lowest modes."""
import pytest

h5py = pytest.importorskip("h5py")
np = pytest.importorskip("numpy")
from test_bad_input import FILE_CASE, write_model  # noqa: E402

#: Damping of so many modes against that of all, by responses: round-off of both.
SAME = 1e-9


def remarks_of(case, *settings):
    done = case("-q", *(word for one in settings for word in ("--set", one)), "case.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(case.directory / "case.h5") as file:
        return dict(zip(file["remarks/name"].asstr()[()], file["remarks/text"].asstr()[()])) if (
            "remarks" in file) else {}


def test_beyond_the_range_of_a_reduction_it_is_said(fw_run):
    fw_run.write(FILE_CASE)
    write_model(fw_run.directory / "model.h5")
    with h5py.File(fw_run.directory / "model.h5", "r+") as file:
        file["reduction/frequency"], file["reduction/error"] = [0.2], [1e-4]
    sweep = ("sweep%start=0.9", "sweep%end=1.0")
    said = remarks_of(fw_run, *sweep, "harmonics%n_harmonics=3")
    assert "harmonic 3 reaches 0.477" in said["beyond reduction"]
    assert "up to 0.200000 Hz" in said["beyond reduction"]
    assert "beyond reduction" not in remarks_of(fw_run, *sweep, "harmonics%n_harmonics=1")
    with h5py.File(fw_run.directory / "model.h5", "r+") as file:
        del file["reduction/frequency"]
        file["reduction/frequency"] = [0.2, 0.3]
    assert "/reduction/frequency" in fw_run.refused()


def test_modes_up_to_a_frequency_are_damped_and_no_others(fw_run):
    """Of two oscillators the upper one rings without damping; above both all are damped."""
    text = ("&case analysis = 'frf' /\n&model n_dof = 2, mass = 1.0, 0.0, 0.0, 1.0, stiffness = 1.0, "
            "0.0, 0.0, 9.0, damping = 0.0, 0.0, 0.0, 0.0, modal_damping = 0.01{} /\n"
            "&load cosine = 1.0, 1.0 /\n&harmonics n_harmonics = 1 /\n"
            "&sweep start = 1.0, end = 3.03, n_points = 2 /\n")
    found = {}
    for up_to in ("", ", modal_damping_up_to = 0.3", ", modal_damping_up_to = 1.0"):
        fw_run.write(text.format(up_to))
        done = fw_run("-q", "case.nml")
        assert done.returncode == 0, done.stderr
        with h5py.File(fw_run.directory / "case.h5") as file:
            found[up_to] = file["amplitude"][()]
    all_damped, lowest, both = found.values()
    assert all_damped[0, 0] == pytest.approx(50.0, rel=SAME)
    assert lowest[0, 0] == pytest.approx(50.0, rel=SAME)
    assert lowest[1, 1] == pytest.approx(1.0 / abs(9.0 - 3.03**2), rel=SAME)
    damped = 1.0 / abs(9.0 - 3.03**2 + 2.0j * 0.01 * 3.0 * 3.03)
    assert all_damped[1, 1] == pytest.approx(damped, rel=SAME)
    assert np.allclose(both, all_damped, rtol=SAME)
