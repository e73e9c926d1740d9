"""Every kind of wrong input: the exit status, and a message with the place and the remedy."""
import hashlib
import os
import re

import pytest

h5py = pytest.importorskip("h5py")
np = pytest.importorskip("numpy")


def write_model(path, **changes):
    """A small model file; a change of None leaves the dataset out."""
    data = {"mass": np.eye(2), "stiffness": np.array([[2.0, -1.0], [-1.0, 2.0]]),
            "damping": 0.02*np.eye(2),
            "contact/side_1": np.array([[2, 0, 0]]), "contact/side_2": np.array([[0, 0, 0]]),
            "contact/mu": np.array([0.3]), "contact/gap": np.array([0.0]),
            "load/static": np.zeros(2), "load/cosine": np.array([1.0, 0.0]),
            "load/sine": np.zeros(2)}
    data.update(changes)
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "fretwear-model"
        file.attrs["format_version"] = 1
        file.attrs["title"] = "small"
        file.attrs["unit_system"] = "SI"
        for name, values in data.items():
            if values is not None:
                file[name] = values


FILE_CASE = """&model
   source = 'hdf5'
   file = 'model.h5' /
&contact normal_load = 1 /
&sweep start = 0.5 end = 0.8 n_points = 3 /
"""


@pytest.fixture
def with_model(fw_run):
    fw_run.write(FILE_CASE)
    write_model(fw_run.directory / "model.h5")
    return fw_run


@pytest.mark.parametrize("old, new, expected", [
    ("n_harmonics = 3", "n_harmnics = 3",
     ["case.nml:16: &harmonics has no key n_harmnics", "did you mean n_harmonics?"]),
    ("&harmonics", "&harmonic", ["case.nml:15: there is no group &harmonic",
                                 "did you mean harmonics?"]),
    ("n_harmonics = 3", "n_harmonics = 3 n_harmonics = 5",
     ["case.nml:16: &harmonics n_harmonics is given twice", "line 16", "keep one"]),
    ("&load", "&sweep start = 2 /\n&load", ["group &sweep is given twice", "line 14", "join"]),
    ("mu = 0.3", "mu = -0.3", ["case.nml:12: &contact mu(1) = -0.3", "at least 0"]),
    ("mu = 0.3", "mu = NaN", ["case.nml:12: &contact mu(1) = NaN", "finite"]),
    ("n_time = 64", "n_time = 6",
     ["case.nml:17: &harmonics n_time = 6", "2*n_harmonics + 1 = 7"]),
    ("n_time = 64", "n_time = 64.5", ["case.nml:17: &harmonics n_time = 64.5", "an integer"]),
    ("side_1 = 2", "side_1 = 3", ["case.nml:11: &contact side_1(1,1) = 3", "from -2 to 2"]),
    ("side_1 = 2", "side_1 = 0", ["case.nml:11: &contact side_1", "pair 1 has no dof"]),
    ("-1  2", "1  2", ["case.nml:6: &model stiffness is not symmetric: entry (1,2) = 1, but "
                       "entry (2,1) = -1", "must be equal"]),
    ("-1  2", "-1  NaN", ["case.nml:7: &model stiffness(2,2) = NaN", "finite"]),
    ("0 1\n", "0 -1\n", ["&model mass has the negative diagonal entry (2,2) = -1"]),
    ("0 1\n", "0\n", ["case.nml:4: &model mass has 3 values", "must be 4 (2 x 2)"]),
    ("cosine = 1 0", "cosine = 1 0 0", ["&load cosine has 3 values", "must be 2"]),
    ("start = 0.5", "start = 0", ["case.nml:19: &sweep start = 0", "above 0"]),
    ("end = 0.8", "", ["&sweep end is missing"]),
    ("normal_load = 1", "", ["&contact normal_load is missing", "at least 0\n"]),
    ("'test'", "'test", ["case.nml:1: &case title", "not closed"]),
    ("n_points = 3 /", "n_points = 3", ["case.nml:18: &sweep is not closed", "/"]),
    ("mu = 0.3", "mu 0.3",
     ["case.nml:11: &contact side_1 has 5 values", "if mu is a key, it lacks its ="]),
    ("mu = 0.3", "mu = 0.3 law = 'dltf'",
     ["&contact law = 'dltf'", "'dlft'", "did you mean 'dlft'?"]),
    ("mu = 0.3", "mu = 0.3 law = 'penalty'", ["&contact tangential_stiffness is missing"]),
    ("mu = 0.3", "mu = 0.3 tangential_stiffness = 1",
     ["tangential_stiffness belongs to law = 'penalty'"]),
    ("mu = 0.3", "mu = 0.3 law = 'regularised'", ["&contact slip_speed is missing", "above 0"]),
    ("mu = 0.3", "mu = 0.3 slip_speed = 1", ["slip_speed belongs to law = 'regularised'"]),
    ("mu = 0.3", "mu = 0.3 law = 'regularised' slip_speed = 1 penalty_scale = 2",
     ["penalty_scale has no meaning with law = 'regularised'"]),
    ("mu = 0.3", "mu = 0.3 0.4 0.5", ["&contact mu has 3 values", "must be 1"]),
])
def test_wrong_namelist(fw_run, old, new, expected):
    fw_run.edit(old, new)
    message = fw_run.refused()
    for part in expected:
        assert part in message, message


@pytest.mark.parametrize(("setting", "expected"), [
    ("harmonics%sampling=events", "does not go with harmonics%sampling = 'events'"),
    ("case%analysis=wear", "does not go with case%analysis = 'wear'"),
])
def test_a_law_says_what_it_does_not_offer(fw_run, setting, expected):
    fw_run.edit("mu = 0.3", "mu = 0.3 area = 1 law = 'regularised' slip_speed = 1")
    message = fw_run.refused("--set", setting, "--set", "wear%coefficient=1e-9", "case.nml")
    assert expected in message, message


def test_all_problems_at_once(fw_run):
    fw_run.edit("n_time = 64", "n_time = x y = 1")
    message = fw_run.refused("--set", "sweep%start=-1", "case.nml")
    assert len(message.splitlines()) == 3, message


@pytest.mark.parametrize("group", ["&model", "&sweep"])
def test_missing_group(fw_run, group):
    groups = ["&case /", "&model n_dof=1 mass=1 stiffness=1 /", "&sweep start=1 end=2 n_points=2 /"]
    fw_run.write("\n".join(text for text in groups if not text.startswith(group)))
    assert f"case.nml: group {group} is missing" in fw_run.refused()


@pytest.mark.parametrize("override, expected", [
    # Of another group, and a part of longer names.
    ("harmonics%stability=true", ["has no key stability; it is a key of &sweep"]),
    ("load%scale=3", ["has no key scale; did you mean ", "static_scale", "harmonic_scale"]),
    ("solver%tolerence=1", ["has no key tolerence", "did you mean tolerance?"]),
    ("solvr%tolerance=1", ["there is no group &solvr", "did you mean solver?"]),
    ("solver%tolerance=-1", ["&solver tolerance = -1", "above 0"]),
    ("harmonics%method=hbd", ["&harmonics method = hbd", "'hbm'"]),
    ("output%observe=3", ["&output observe = 3", "from 1 to 2"]),
])
def test_wrong_override_names_the_option(fw_run, override, expected):
    message = fw_run.refused("--set", override, "case.nml")
    for part in ["--set " + override, *expected]:
        assert part in message, message


@pytest.mark.parametrize("override", [
    "sweep%start=0.7, end=3 garbage", "sweep%start=0.7 /", "sweep%start=0.7 / &load cosine=5",
    "contact%n_pairs=1,2", "contact%n_pairs=1,", "solver%fallback=T F", "harmonics%method=hbm x",
    "case%title='a' b", "solver%tolerance=1e-9 1e-9", "contact%mu=0.3, gap=1"])
def test_nothing_may_follow_the_value_of_an_override(fw_run, override):
    message = fw_run.refused("--set", override, "case.nml")
    assert "--set " + override in message and "must be" in message


@pytest.mark.parametrize("override", ["case%title=it's a, b / c", "case%title='a b'",
                                      "load%cosine=1, 0", "load%cosine=1 0", "contact%mu=1*0.3"])
def test_what_an_override_may_hold(fw_run, override):
    done = fw_run("--check", "--set", override, "case.nml")
    assert done.returncode == 0, done.stderr


def test_observing_more_than_there_is(fw_run):
    for count in ["100000", "2000000000"]:
        message = fw_run.refused("--set", f"output%observe={count}*1", "case.nml")
        assert f"has {count} values: must be at most 2" in message, message
    assert "twice" in fw_run.refused("--set", "output%observe=1,1", "case.nml")


@pytest.mark.parametrize("value, count", [("0*0.3", "0"), ("-1*0.3", "-1"), ("1.5*0.3", "1.5"),
                                          ("99999999999*0.3", "99999999999")])
def test_wrong_repeat_count(fw_run, value, count):
    fw_run.edit("mu = 0.3", "mu = " + value)
    assert f"case.nml:12: &contact mu: the repeat count {count} of" in fw_run.refused()
    fw_run.edit("mu = 0.3", "mu = 0.3")
    message = fw_run.refused("--set", "contact%mu=" + value, "case.nml")
    assert f"the repeat count {count} before" in message, message


@pytest.mark.parametrize("content, shown", [
    (b"\x7fELF\x02\x01\x00\x1b[31m\xff\xc2\x9b" + bytes(range(128, 256))*100,
     ["\\x7fELF\\x02\\x01\\x00\\x1b[31m\\xff\\xc2\\x9b"]),
    (b"&case title = \x1b[2J /", ["\\x1b[2J"]), (b"&case \x07 = 1 /", ["\\x07"]),
    ("&case größe = 1 /".encode(), ["case.nml:1"])])
def test_bytes_of_a_binary_namelist_are_escaped(fw_run, content, shown):
    (fw_run.directory / "case.nml").write_bytes(content)
    message = fw_run.refused()
    assert all(part in message for part in shown), message
    assert len(message) < 2000
    assert all(letter.isprintable() or letter == "\n" for letter in message), repr(message)


@pytest.mark.parametrize("override, expected", [
    ("solver%tolerance=1", "above 0 and below 1"), ("solver%tolerance=1e300", "below 1"),
    ("case%threads=1025", "from 0 to 1024"), ("case%threads=2000000000", "from 0 to 1024")])
def test_upper_limits(fw_run, override, expected):
    assert expected in fw_run.refused("--set", override, "case.nml")


def test_a_branch_needs_two_ends(fw_run):
    arguments = ["--set", "sweep%end=0.5", "case.nml"]
    message = fw_run.refused("--set", "sweep%continuation=arclength", *arguments)
    assert "&sweep end = 0.5: must differ from start" in message
    assert fw_run("--check", *arguments).returncode == 0


@pytest.mark.parametrize("override, instead", [
    ("sweep%stability=.true.", "'penalty'")])
def test_what_is_not_available_yet(fw_run, override, instead):
    message = fw_run.refused("--set", override, "case.nml")
    assert override.split("=")[0] in message and instead in message


@pytest.mark.parametrize("options, key, remedy", [
    (["harmonics%method=hdhb"], "&harmonics sampling = 'events'", "use 'hbm' or 'tcm'"),
    (["harmonics%n_harmonics=5", "harmonics%n_time=19"], "&harmonics n_time = 19",
     "at least 4*n_harmonics = 20")])
def test_what_events_need(fw_run, options, key, remedy):
    settings = [part for option in ["harmonics%sampling=events", *options]
                for part in ("--set", option)]
    message = fw_run.refused(*settings, "case.nml")
    assert key in message and remedy in message, message


def test_missing_namelist(fw_run):
    message = fw_run.refused("none.nml", status=5)
    assert "none.nml: cannot be read" in message


def test_missing_model_file(with_model):
    (with_model.directory / "model.h5").unlink()
    message = with_model.refused(status=5)
    assert "case.nml:3: &model file" in message and "model.h5" in message


def test_truncated_model_file(with_model):
    path = with_model.directory / "model.h5"
    path.write_bytes(path.read_bytes()[:1000])
    message = with_model.refused()
    assert "case.nml:3: &model file: model.h5" in message and "truncated" in message


@pytest.mark.parametrize("changes, expected", [
    ({"mass": np.eye(3)}, ["model.h5", "stiffness"]),
    ({"mass": np.ones(4)}, ["model.h5", "mass"]),
    ({"stiffness": None}, ["model.h5", "stiffness"]),
    ({"stiffness": np.array([[2.0, -1.0], [1.0, 2.0]])},
     ["stiffness", "not symmetric", "(1,2) = -1"]),
    ({"stiffness": np.full((2, 2), np.nan)}, ["/stiffness holds NaN at index (0, 0)", "finite"]),
    ({"contact/mu": np.array([-0.3])}, ["mu(1) = -0.3", "at least 0"]),
    ({"contact/mu": np.array([0.3, 0.3])}, ["holds 2 values of mu", "must be 1"]),
    ({"contact/side_1": np.array([[5, 0, 0]])}, ["side_1(1,1) = 5", "an integer from -2 to 2"]),
    ({"load/cosine": np.array([np.inf, 0.0])}, ["/load/cosine holds Inf", "finite"]),
])
def test_wrong_model_file(with_model, changes, expected):
    write_model(with_model.directory / "model.h5", **changes)
    message = with_model.refused()
    for part in ["case.nml:3: &model file", *expected]:
        assert part in message, message


def test_unwritable_output_is_refused_before_the_run(fw_run):
    message = fw_run.refused("-o", "nowhere/x.h5", "case.nml", status=5)
    assert "nowhere/x.h5" in message and "does not exist" in message and "-o" in message
    message = fw_run.refused("-o", ".", "case.nml", status=5)
    assert "is a directory" in message


@pytest.mark.parametrize("output", ["model.h5", "./sub/../model.h5", "link.h5", "case.nml"])
def test_a_run_never_replaces_what_it_reads(with_model, output):
    folder = with_model.directory
    (folder / "sub").mkdir()
    (folder / "link.h5").symlink_to("model.h5")
    before = {name: (folder / name).read_bytes() for name in ["model.h5", "case.nml"]}
    message = with_model.refused("-o", output, "case.nml")
    assert f"{folder}/{output}" in message and "which this run reads" in message
    assert "-o" in message
    with_model.refused("--set", f"output%file={output}", "case.nml")
    assert before == {name: (folder / name).read_bytes() for name in before}
    assert (folder / "link.h5").is_symlink()


def test_default_name_that_is_the_model_file(with_model):
    (with_model.directory / "case.nml").rename(with_model.directory / "model.nml")
    before = (with_model.directory / "model.h5").read_bytes()
    message = with_model.refused("model.nml")
    assert "model.h5" in message and "which this run reads" in message
    assert (with_model.directory / "model.h5").read_bytes() == before


def test_matrix_market_files_are_not_replaced(fw_run):
    text = "%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 1.0\n"
    fw_run.write(text, "k_mass.mtx")
    fw_run.write(text, "k_stiffness.mtx")
    fw_run.write("&model source = 'matrix_market' file = 'k' /\n"
                 "&sweep start = 0.5 end = 0.8 n_points = 2 /\n&load cosine = 1 /\n")
    for name in ["k_mass.mtx", "k_stiffness.mtx"]:
        assert "which this run reads" in fw_run.refused("-o", name, "case.nml")
        assert (fw_run.directory / name).read_text() == text


def test_only_an_earlier_result_is_replaced(fw_run):
    folder = fw_run.directory
    (folder / "notes.txt").write_text("mine")
    (folder / "empty.h5").touch()
    write_model(folder / "other.h5")
    os.mkfifo(folder / "pipe")
    (folder / "circle").symlink_to("circle")
    before = (folder / "other.h5").read_bytes()
    for name, part in [("notes.txt", "remove it"), ("other.h5", "remove it"), ("empty.h5", "empty"),
                       ("pipe", "no regular file"), ("/dev/null", "no regular file"),
                       ("circle", "circle"), ("blank ", "blank")]:
        message = fw_run.refused("-o", name, "case.nml", status=5)
        assert name in message and part in message and "-o" in message, message
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "other.h5").read_bytes() == before
    assert fw_run("-o", "x.h5", "case.nml").returncode == 0
    assert fw_run("-o", "x.h5", "case.nml").returncode == 0


@pytest.mark.parametrize("exists", [True, False])
def test_a_link_stays_and_its_target_is_written(fw_run, exists):
    folder = fw_run.directory
    (folder / "store").mkdir()
    (folder / "x.h5").symlink_to("store/real.h5")
    if exists:
        assert fw_run("-o", "store/real.h5", "case.nml").returncode == 0
    done = fw_run("-o", "x.h5", "case.nml")
    assert done.returncode == 0, done.stderr
    assert (folder / "x.h5").is_symlink()
    assert [path.name for path in (folder / "store").iterdir()] == ["real.h5"]
    with h5py.File(folder / "x.h5") as file:
        assert file.attrs["format"] in (b"fretwear-result", "fretwear-result")


def test_existing_result_survives_a_refused_run(fw_run):
    result = fw_run.directory / "case.h5"
    assert fw_run("case.nml").returncode == 0
    before = hashlib.sha256(result.read_bytes()).digest()
    fw_run.refused("--set", "contact%mu=-1", "case.nml")
    assert hashlib.sha256(result.read_bytes()).digest() == before
    assert sorted(path.name for path in fw_run.directory.iterdir()) == ["case.h5", "case.nml"]


@pytest.mark.parametrize("dataset, value, expected", [
    ("contact/mu", [-0.3], "holds mu(1) = -0.3: must be a finite real of at least 0"),
    ("contact/area", [0.0], "holds area(1) = 0: must be a finite real above 0"),
    ("contact/side_1", [[7, 0, 0]], "holds side_1(1,1) = 7: must be an integer from -2 to 2")])
def test_values_of_a_model_file_are_held_to_what_the_keys_accept(with_model, dataset, value,
                                                                 expected):
    write_model(with_model.directory / "model.h5", **{dataset: np.array(value)})
    assert f"case.nml:3: &model file {expected}" in with_model.refused()


def test_no_stiffness_is_no_slider(fw_run):
    """Zero without a tangential dof is taken; among parallel sliders it is as if there were none."""
    shown = {}
    for name, contact in (
            ("two.h5", "n_pairs=2 tangential_stiffness=0.5 0 normal_stiffness=1.5 0.5"),
            ("three.h5", "n_pairs=3 side_1(:,3)=1 0 0 normal_load=0 0 1 "
                         "tangential_stiffness=0.5 0 0 normal_stiffness=1.5 0.5 0")):
        fw_run.write(f"""&model n_dof=2 mass=1 0 0 1 stiffness=2 -1 -1 2 damping=0.05 0 0 0.05 /
&contact law='penalty' side_1(:,1) = 1 0 2 side_1(:,2) = 0 0 2 mu=0.3 {contact} /
&load cosine=1 0.1 static = 0 -1 /
&harmonics n_harmonics=5 /
&sweep start=1 end=2 n_points=5 /
""")
        done = fw_run("-o", name, "case.nml")
        assert done.returncode == 0, done.stderr
        with h5py.File(fw_run.directory / name) as file:
            shown[name] = file["amplitude"][()]
    # A force of zero more may change the order of sums, and so the round-off that the solution
    # to 1e-8 enlarges.
    assert np.allclose(shown["two.h5"], shown["three.h5"], rtol=1e-6, atol=0)


@pytest.mark.parametrize("key, remedy", [
    ("harmonics%adaptive=.true.", "use harmonics%accuracy"),
    ("harmonics%adaptive_tolerance=1e-3", "use harmonics%accuracy"),
    ("sweep%first_point=3", "use sweep%start, sweep%end and sweep%n_points"),
    ("sweep%last_point=3", "use sweep%start, sweep%end and sweep%n_points"),
    ("sweep%lead_points=3", "use sweep%start, sweep%end and sweep%n_points"),
    ("solver%jacobian='analytic'", "solver%linear")])
def test_a_former_key_names_the_one_to_use(fw_run, key, remedy):
    group, name = key.partition("=")[0].split("%")
    message = fw_run.refused("--set", key, "case.nml")
    assert f"&{group} has no key {name}; " in message and remedy in message
    # What the message names is a key.
    keys = fw_run("--keys").stdout
    for word in re.findall(r"\w+%(\w+)", message.partition("; ")[2]):
        assert f"   {word} = " in keys


def test_frequencies_are_read_as_values(fw_run):
    path = fw_run.directory / "case.nml"
    text = re.sub(r"&sweep[^/]*/", "&sweep {} /", path.read_text(), flags=re.DOTALL)
    shown = {}
    for key in "values", "frequencies":
        path.write_text(text.replace("{}", f"{key} = 0.5, 0.6"))
        done = fw_run("-o", f"{key}.h5", "case.nml")
        assert done.returncode == 0, done.stderr
        with h5py.File(fw_run.directory / f"{key}.h5") as file:
            shown[key] = file["amplitude"][()].tolist()
    assert shown["values"] == shown["frequencies"]
    path.write_text(text.replace("{}", "values = 0.5, 0.6 frequencies = 0.5"))
    assert "sweep%values: keep one" in fw_run.refused("case.nml")
