"""Values that no argument of the Python package expects, made from the sound one."""
import decimal
import fractions

import numpy as np

#: Of no use as a number or an array, and a few that are, and should not surprise.
STRANGE = [None, "", "x", "1", "1.0 /", "' /\n&case", "\0", "\xe9\u4e2d", "/dev/null",
           "nothing.h5", b"1", (), [], {}, set(), {"a": 1}, object(), lambda *_: None,
           range(3), ..., NotImplemented, True, False, np.True_, 1j, fractions.Fraction(1, 3),
           decimal.Decimal("0.1"), np.datetime64("2020-01-01"), np.str_("x"), np.void(b"ab"),
           [[1], [1, 2]], [None], ["a"], np.array(None), np.array([]), np.empty((0, 0)),
           np.empty((0, 3)), np.float16(1),
           slice(2), memoryview(b"ab"), int, np.ma.masked, np.ma.array([1.0, 2.0], mask=[0, 1])]
NUMBERS = [0, -1, 1, 2, 3, 1.5, -0.0, 0.1, np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, 1e200,
           2**31 - 1, 2**31, -2**31, 2**63, 2**64, 10**400, np.int8(1), np.uint64(2**63),
           np.float32(0.1), np.longdouble(1), np.array(1.0), np.array(1), np.array([1.0])]
DTYPES = ["f4", "f2", ">f8", "i1", "u8", "i8", "c16", "c8", "?", "O", "S8", "U8", "M8[s]", "g",
          [("a", "f8"), ("b", "i4")]]
CONTENT = [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, -1.0, 0.0, 1e200, 2.0**31, 5.0, -7.0]


class Strange:
    """An array to NumPy, of a kind of its own."""

    def __init__(self, error):
        self.error = error

    def __array__(self, dtype=None, copy=None):
        if self.error:
            raise self.error("asked for an array")
        return np.ones((2, 2))

    def __len__(self):
        return 2**40

    def __float__(self):
        return float("nan")


def reshaped(rng, values):
    kind = rng.randrange(8)
    if kind == 0:
        return values.ravel()
    if kind == 1:
        return values[None]
    if kind == 2:
        return values[..., None]
    if kind == 3:
        return np.atleast_1d(values)[:0]
    if kind == 4:
        return np.concatenate([np.atleast_1d(values)]*rng.choice([2, 3, 50]))
    if kind == 5:
        return values.T[..., :1] if values.ndim else values.reshape(1)
    if kind == 6:
        return np.broadcast_to(values.ravel()[:1], (1,)*rng.choice([0, 5, 30]) or ())
    return np.broadcast_to(values.ravel()[0], rng.choice([(3, 3), (1000,), (2, 2, 2), (10**6,)]))


def laid_out(rng, values):
    """The same numbers, elsewhere: strided, backwards, transposed, read-only, unaligned."""
    kind = rng.randrange(7)
    if kind == 0:
        wide = np.zeros(tuple(2*n for n in values.shape), values.dtype)
        view = wide[tuple(slice(None, None, 2) for _ in values.shape)]
        view[...] = values
        return view
    if kind == 1:
        return values[::-1].copy()[::-1] if values.ndim else values
    if kind == 2:
        return np.ascontiguousarray(values.T).T
    if kind == 3:
        values = np.array(values)
        values.flags.writeable = False
        return values
    if kind == 4 and values.size:
        room = np.zeros(values.nbytes + 1, np.uint8)[1:]
        room[:] = np.frombuffer(values.tobytes(), np.uint8)
        return room.view(values.dtype).reshape(values.shape)
    if kind == 5:
        return values.tolist()
    return memoryview(np.ascontiguousarray(values))


def changed(rng, values):
    kind = rng.randrange(4)
    if kind == 0:
        with np.errstate(all="ignore"):
            return values.astype(rng.choice(DTYPES))
    if kind == 1:
        return reshaped(rng, values)
    if kind == 2:
        return laid_out(rng, values)
    dtype = float if values.dtype.kind in "iuf" else values.dtype
    values = np.array(values, dtype=dtype)
    if values.size:
        values.ravel()[rng.randrange(values.size)] = rng.choice(CONTENT)
        if rng.random() < 0.3:
            values *= rng.choice([1e300, 1e-300, -1.0, 0.0])
    return values


def hostile(rng, sound):
    """Something in the place of a sound value."""
    kind = rng.randrange(6)
    if kind == 0:
        return rng.choice(STRANGE)
    if kind == 1:
        return rng.choice(NUMBERS)
    if kind == 2 and rng.random() < 0.2:
        return Strange(rng.choice([None, ValueError, TypeError]))
    if sound is None or isinstance(sound, (str, dict, bool)) or callable(sound):
        return rng.choice(STRANGE + NUMBERS)
    values = np.asarray(sound)
    if values.dtype.kind not in "iufcb":
        return rng.choice([*STRANGE, list(sound)*2, list(sound)[:0]])
    with np.errstate(all="ignore"):
        try:
            return changed(rng, values)
        except (ValueError, TypeError):
            return rng.choice(NUMBERS) # what NumPy itself refuses to make
