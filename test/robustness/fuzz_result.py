"""Mutations of result files that a run starts from: bytes of a wear result that changed."""
import functools
import subprocess
import tempfile
from pathlib import Path

import h5py
from fuzz_bases import WEAR
from fuzz_model import cut
from project import PROGRAM

# PROGRAM makes the sound result, and the fuzzing puts its own in the place: a run goes on from one
# of the same program only.


@functools.cache
def sound():
    """The bytes of a sound result, restart data included, without what differs between runs."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "sound.h5"
        (path.parent / "case.nml").write_text(WEAR)
        subprocess.run([PROGRAM, "-q", "-o", path, "case.nml"], cwd=name, check=True)
        with h5py.File(path, "r+", locking=False) as file:
            file["seconds"][:] = 0.0
            file.attrs["elapsed"] = 0.0
            file.attrs["namelist"] = file.attrs["namelist"].replace(name, "/folder")
        return path.read_bytes()


@functools.cache
def written():
    """Places of structure and numbers; most of a chunk is empty, and nothing to hit."""
    return [k for k, byte in enumerate(sound()) if byte]


def flip(rng, content):
    content = bytearray(content)
    for _ in range(rng.choice([1, 2, 4, 16, 200])):
        k = rng.choice(written()) + rng.randrange(-1, 2)
        content[k] = rng.choice([content[k] ^ (1 << rng.randrange(8)), 0, 255, rng.randrange(256)])
    return bytes(content)


def create(rng, folder):
    """Write `damaged.h5`, and a namelist whose run goes on from it, or starts at its depths."""
    (folder / "damaged.h5").write_bytes(rng.choice([flip, flip, flip, cut])(rng, sound()))
    if rng.random() < 0.5:
        (folder / "case.nml").write_text(WEAR)
        return ["--restart", "damaged.h5", "case.nml"]
    (folder / "case.nml").write_text(WEAR.replace("area = 1", "area = 1 worn = 'damaged.h5'"))
    return ["case.nml"]
