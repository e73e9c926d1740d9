"""Cases as groups of keys, written as namelists by the package, run, and read as arrays."""
import subprocess

import h5py
import numpy as np
from limits import limit
from project import PATIENT, PROGRAM

from fretwear._namelist import literal
from fretwear._namelist import write_namelist as namelist_text

__all__ = ["literal", "merged", "namelist_text", "read", "run", "run_reference", "signal_at",
           "with_model", "write_namelist", "write_parts"]


def write_namelist(path, groups):
    """Write {group: {key: value}} as a namelist."""
    path.write_text(namelist_text(groups))


def write_parts(path, datasets):
    """Write a model file of {dataset: values}; `group@name` is an attribute."""
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name, values in datasets.items():
            group, _, attribute = name.partition("@")
            if attribute:
                file.require_group(group or "/").attrs[attribute] = values
            else:
                file[name] = np.array(values)


def with_model(groups):
    """The same with model.h5 beside it."""
    return {group: dict(keys) for group, keys in groups.items()} | {
        "model": {"source": "hdf5", "file": "model.h5"} | groups.get("model", {})}


def run_reference(folder, reference, number):
    """Run one case of a reference of another program, and want what it found within its limits,
    relative to the largest; the result's path."""
    write_parts(folder / "model.h5", reference["file"])
    wanted = reference["runs"][number]
    run(folder, with_model(wanted["case"]))
    with h5py.File(folder / "case.h5") as file:
        for row in wanted["expect"]:
            values = np.array(row["value"])
            error = np.abs(file[row["dataset"]][()] - values).max() / np.abs(values).max()
            assert error <= row["limit"], row["dataset"]
    return folder / "case.h5"


def merged(groups, changes):
    """Groups with changes to some keys; None takes a key out."""
    result = {name: dict(keys) for name, keys in groups.items()}
    for name, keys in changes.items():
        result.setdefault(name, {}).update(keys)
        result[name] = {key: value for key, value in result[name].items() if value is not None}
    return result


def run(folder, groups, *arguments, name="case", status=0, program=PROGRAM, seconds=120.0,
        quiet=True):
    """Run a case in a folder and want a status, or one of several; the process."""
    path = folder / f"{name}.nml"
    write_namelist(path, groups)
    arguments = ["-q"] * quiet + list(map(str, arguments))
    done = subprocess.run([program, *arguments, path.name], cwd=folder, text=True,
                          capture_output=True, timeout=limit(seconds), check=False, env=PATIENT)
    wanted = (status,) if isinstance(status, int) else status
    assert done.returncode in wanted, (
        f"fw_run ended with status {done.returncode}: {done.stderr}\n{path.read_text()}")
    return done


def read(path):
    """Every dataset of a result, and the attributes of the file and of /wear."""
    found = {}
    with h5py.File(path, "r") as file:
        def take(name, item):
            if isinstance(item, h5py.Dataset):
                found[name] = item[()]
        file.visititems(take)
        found["attributes"] = dict(file.attrs)
        found["wear"] = dict(file["wear"].attrs) if "wear" in file else {}
    return found


def signal_at(command, line, number, folder, caught, tries=10):
    """Send a signal to a run that has told a line; `caught` is the status that it then ends with.

    On a busy machine a run may be complete before the signal comes: then it is run again.
    """
    for _ in range(tries):
        with subprocess.Popen(command, cwd=folder, text=True, stderr=subprocess.PIPE,
                              stdout=subprocess.DEVNULL, env=PATIENT) as process:
            for told in process.stderr:
                if told.startswith(line):
                    process.send_signal(number)
                    break
            process.communicate()
        if process.returncode != 0:
            break
        for path in folder.glob("*.h5*"):
            if path.name.split(".")[0] == command[-1].split(".")[0]:
                path.unlink()
    assert process.returncode == caught
