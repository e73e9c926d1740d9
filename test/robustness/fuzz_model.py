"""Mutations of HDF5 model files: bytes that changed, and sound files with unsound content."""
import contextlib

import h5py
import numpy as np
from fuzz_bases import FROM_HDF5, model_datasets, model_file

SOUND = model_file()
HUGE = [2**31 - 1, 2**31, 2**33, 46341, 65536, 10**6, 2**20, 2**61]
NAMES = [b"", b" ", b"a/b", b"..", b"\xff\xfe", b"a\nb", b"\x1b[2J", b"x" * 70000, b"tip", b"u1",
         b"%s%n", b"'", b'"', b"!", b"1", b"-1", "\u4e2d\u6587".encode()]


def flip(rng, content):
    content = bytearray(content)
    for _ in range(rng.choice([1, 2, 4, 16, 200])):
        # Structure lies at the front: half of the hits go there.
        end = len(content) if rng.random() < 0.5 else min(len(content), 3000)
        k = rng.randrange(end)
        content[k] = rng.choice([content[k] ^ (1 << rng.randrange(8)), 0, 255, rng.randrange(256)])
    return bytes(content)


def cut(rng, content):
    kind = rng.randrange(4)
    k = rng.randrange(len(content))
    if kind == 0:
        return content[:k]
    if kind == 1:
        return content[:k] + bytes(len(content) - k)
    if kind == 2:
        return content[:k] + content[k + rng.randrange(1, 64):]
    return content[:k] + rng.randbytes(rng.randrange(1, 64)) + content[k:]


def wrong_values(rng, values):
    """The same dataset with another type, shape or content."""
    kind = rng.randrange(8)
    values = np.array(values)
    if kind == 0:
        other = rng.choice(["i1", "u8", "f4", "f2", ">f8", "c16", "?", "i8", ">i2", "S8"])
        return values.astype(other)
    if kind == 1:
        return values.reshape(rng.choice([(-1,), (1, -1), (-1, 1), (1, 1, -1)]))
    if kind == 2:
        return np.zeros(rng.choice([(), (0,), (0, 0), (3, 0), (1,), (2, 3), (4, 4), (1000,),
                                    (300, 300), (1,)*32]), dtype=rng.choice(["f8", "i4", "S3"]))
    if kind == 3 and values.dtype.kind == "f" and values.size:
        flat = values.astype(float).ravel()
        flat[rng.randrange(flat.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320,
                                                     0.0, -1.0, 1e200])
        return flat.reshape(values.shape)
    if kind == 4 and values.dtype.kind == "i" and values.size:
        flat = values.astype("i8").ravel()
        flat[rng.randrange(flat.size)] = rng.choice([0, 4, -4, 2**31, 2**31 - 1, -2**31, 2**40,
                                                     1000000, 1, -1])
        return flat.reshape(values.shape)
    if kind == 5:
        return np.array(rng.choices(NAMES, k=rng.choice([1, 2, 3])))
    if kind == 6:
        return h5py.Empty(rng.choice(["f8", "i4", "S4"]))
    return np.zeros(values.shape, dtype=[("a", "f8"), ("b", "i4")])


def replace(rng, file, name):
    """Put something else in the place of a dataset."""
    values = model_datasets().get(name, np.zeros(3))
    kind = rng.randrange(10)
    del file[name]
    if kind < 5:
        file[name] = wrong_values(rng, values)
    elif kind == 5:
        file.create_group(name)
    elif kind == 6: # the size that is announced is nowhere on disk
        rank = max(1, values.ndim)
        shape = tuple(rng.choice(HUGE) for _ in range(rank))
        file.create_dataset(name, shape, dtype=values.dtype, chunks=(1,)*rank)
    elif kind == 7:
        target = rng.choice(["/" + name, "/nothing", "/", "/mass", "/load"])
        file[name] = (h5py.SoftLink(target) if rng.random() < 0.5
                      else h5py.ExternalLink(rng.choice(["model.h5", "nothing.h5", "/dev/zero",
                                                         "case.nml"]), target))
    elif kind == 8:
        texts = [item.decode("latin-1") for item in rng.choices(NAMES, k=2)]
        file.create_dataset(name, data=[text.replace("\0", "") for text in texts],
                            dtype=h5py.string_dtype())
    elif values.ndim:
        file.create_dataset(name, data=values, chunks=True, compression=rng.choice(["gzip", "lzf"]),
                            shuffle=True)


def restructure(rng, path):
    # A process that another thread has just forked holds the locks of this one for a moment.
    with h5py.File(path, "r+", locking=False) as file:
        names = list(model_datasets())
        for _ in range(rng.choice([1, 1, 2, 4])):
            name = rng.choice(names)
            kind = rng.randrange(8)
            if name not in file:
                continue
            if kind < 5:
                replace(rng, file, name)
            elif kind == 5:
                del file[name]
            elif kind == 6:
                key = rng.choice(["format", "format_version", "title", "unit_system"])
                file.attrs[key] = rng.choice([1, 2, -1, 1.0, np.nan, "x", "",
                                              "fretwear-model", np.zeros(3),
                                              np.array([b"a", b"b"]), 2**40, b"\xff\xfe",
                                              "x" * 60000, h5py.Empty("f8"), True])
            else:
                group = rng.choice(["contact", "load", "observe"])
                if group in file:
                    del file[group]
                    if rng.random() < 0.5:
                        file[group] = np.zeros(2)


def damage(rng, folder):
    """Write `model.h5`, sound once, with bytes that changed, and a namelist that reads it."""
    (folder / "case.nml").write_text(FROM_HDF5)
    (folder / "model.h5").write_bytes(rng.choice([flip, flip, cut])(rng, SOUND))
    return ["case.nml"]


def create(rng, folder):
    """Write `model.h5`, sound HDF5 with unsound content, and a namelist that reads it."""
    (folder / "case.nml").write_text(FROM_HDF5)
    path = folder / "model.h5"
    path.write_bytes(SOUND)
    # What h5py itself refuses to write: the file as far as it came is an input too.
    with contextlib.suppress(ValueError, TypeError, OSError, RuntimeError, KeyError):
        restructure(rng, path)
    return ["case.nml"]
