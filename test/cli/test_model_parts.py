"""What stands in a model file and nothing reads, and input that has no effect: it is told."""
import pytest

h5py = pytest.importorskip("h5py")
np = pytest.importorskip("numpy")
from test_bad_input import FILE_CASE, write_model  # noqa: E402


@pytest.fixture
def case(fw_run):
    fw_run.write(FILE_CASE)
    write_model(fw_run.directory / "model.h5")
    return fw_run


def change(case, action):
    with h5py.File(case.directory / "model.h5", "r+") as file:
        action(file)


def remarks(case):
    done = case("-q", "case.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(case.directory / "case.h5") as file:
        if "remarks" not in file:
            return {}
        return {name.decode(): text.decode() for name, text in
                zip(file["remarks/name"][()], file["remarks/text"][()])}


@pytest.mark.parametrize(("old", "new", "meant"), [
    ("damping", "dampping", "/damping"), ("damping", "Damping", "/damping"),
    ("damping", "damping_matrix", "/damping"), ("contact", "contacts", "/contact"),
    ("load", "laod", "/load"), ("load/cosine", "load_cosine", "/load/cosine"),
    ("contact/gap", "contact/gaps", "/contact/gap"), ("contact/mu", "mu", "/contact/mu"),
    ("load/sine", "load/sin", "/load/sine"), ("load/static", "load/statics", "/load/static"),
    ("load/cosine", "cosine", "/load/cosine")])
def test_a_misspelled_part_is_refused_with_the_name_that_was_meant(case, old, new, meant):
    change(case, lambda file: file.move(old, new))
    told = case.refused()
    assert f"/{new} is nothing that is read (did you mean {meant}?); expected there: " in told


@pytest.mark.parametrize(("name", "expected"), [
    ("hysteretic_damping", "give the matrix as /structural_damping"), ("gyroscopic", "give the matrix"),
    ("polynomial", "is a dataset, expected a group"), ("springs", "did you mean /spring?"),
    ("unit_system", "did you mean attribute unit_system of /?"),
    ("contact/stick", "expected there: side_1, side_2, sector_2, mu, gap, gap_harmonic, gap_cosine, "
                      "gap_sine, area, slider_1, slider_2, residual, normal_load, "
                      "gap_rotation, normal_load_rotation, speed_1, speed_2, tangential_stiffness, normal_stiffness, normal_coefficient, normal_exponent, "
                      "reference_force, decay_length, slip_speed, mu_dynamic, weakening_speed, "
                      "weakening_exponent, mu_viscous, iwan_chi, iwan_beta, "
                      "bouc_wen_exponent, bouc_wen_beta, law, normal_law, table, position, patch"),
    ("load/harmonic_sine", "needs /load/harmonic"), ("mesh/point", "did you mean /mesh/points?"),
    ("nodal_diameter/0/mass", "/nodal_diameter needs attribute n_physical of /cyclic"),
    ("load/harmonic", "needs their loads")])
def test_what_would_be_left_out_is_refused(case, name, expected):
    change(case, lambda file: file.create_dataset(name, data=[2]))
    assert expected in case.refused()


@pytest.mark.parametrize(("where", "name", "expected"), [
    ("/", "units_system", "did you mean attribute unit_system of /?"),
    ("/", "damping", "did you mean /damping?"), ("contact", "mu", "did you mean /contact/mu?"),
    ("contact", "laws", "did you mean attribute law of /contact?"),
    ("contact", "author", "expected there: law"), ("load", "scale", "expected there: none"),
    ("contact/mu", "law", "did you mean attribute law of /contact?")])
def test_attributes_that_nothing_reads_are_refused(case, where, name, expected):
    change(case, lambda file: file[where].attrs.__setitem__(name, "penalty"))
    told = case.refused()
    assert f"attribute {name} of /{where.strip('/')} is nothing that is read" in told
    assert expected in told


def links_nowhere(file):
    del file["damping"]
    file["damping"] = h5py.SoftLink("/nowhere")


def is_a_group(file):
    del file["damping"]
    file.create_group("damping")


def is_a_dataset(file):
    del file["load"]
    file["load"] = [1.0, 0.0]


@pytest.mark.parametrize(("action", "expected"), [
    (links_nowhere, "/damping is a link to nothing, expected a dataset"),
    (is_a_group, "/damping is a group, expected a dataset"),
    (is_a_dataset, "/load is a dataset, expected a group")])
def test_the_wrong_kind_of_object_is_refused(case, action, expected):
    change(case, action)
    assert expected in case.refused()


def test_data_of_ones_own_are_remarked(case):
    assert "not read" not in remarks(case)

    def add(file):
        file["notes"] = "of today"
        file["mesh/colours"] = [1]
        file["pictures/first"] = [1]
        file.attrs["author"] = "me"
        file["mass"].attrs["source"] = "test bench"
        # Labels say nothing of a model.
        file["mass"].attrs["units"] = "kg"
        file["contact"].attrs["description"] = "two flanks"

    change(case, add)
    text = remarks(case)["not read"]
    listed = text[:text.index(", which nothing reads")].partition("holds ")[2]
    assert set(listed.split(", ")) == {
        "attribute author of /", "/notes", "/mesh/colours", "/pictures",
        "attribute source of /mass"}
    assert "which nothing reads" in case("case.nml", "--set", "case%analysis=modes").stdout


def test_a_file_with_many_strangers_is_remarked_in_short(case):
    change(case, lambda file: [file.create_dataset(f"own_{k}", data=1) for k in range(9)])
    assert "/own_4 and 4 more, which" in remarks(case)["not read"]


@pytest.mark.parametrize(("old", "new", "name"), [
    ("&contact\n   n_pairs = 1\n   side_1 = 2 0 0\n   mu = 0.3\n   normal_load = 1 /",
     "&contact /", "no pairs"),
    ("&load cosine", "&spring /\n&load cosine", "no springs"),
    ("normal_load = 1 /", "normal_load = 1 gap = 0.5 /", "gap not used")])
def test_input_without_an_effect_is_remarked(fw_run, old, new, name):
    assert name not in remarks(fw_run)
    fw_run.edit(old, new)
    assert name in remarks(fw_run)


def test_loads_of_no_harmonic_are_refused(case):
    def add(file):
        file["load/harmonic"] = np.zeros(0, dtype=int)
        file["load/harmonic_cosine"] = [[1.0, 0.0]]

    change(case, add)
    assert "has shape (1, 2), but /load/harmonic is empty" in case.refused()


def test_the_parts_are_listed(fw_run):
    lines = fw_run("--parts").stdout.splitlines()
    assert lines[:2] == ["| name | kind | shape | required | meaning |", "|---|---|---|---|---|"]
    rows = [line.split(" | ") for line in lines[2:]]
    assert all(len(row) == 5 and row[1] in ("real", "integer", "text", "complex") for row in rows)
    names = [row[0] for row in rows]
    assert len(set(names)) == len(names)
    # Constants of laws are those of the keys.
    assert "| `/contact/slip_speed`" in names
