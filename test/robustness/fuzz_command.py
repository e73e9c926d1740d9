"""Command lines: sound options with unsound values, and words that are no options."""
from fuzz_bases import JOINT
from fuzz_namelist import KEYS, PIECES, value

OPTIONS = ["--set", "--output", "-o", "--check", "-q", "--quiet", "-v", "--verbose", "-h", "--help",
           "--version", "--", "-", "-qv", "-vo", "--sett", "--chek", "--set=", "--output=", "-x",
           "--check=1", "--quiet=yes", "---", "--restart", "--restart="]
PATHS = ["case.nml", "nothing.nml", ".", "", " ", "/", "/dev/null", "/dev/full", "folder",
         "folder/case.nml", "case.nml/x", "x" * 300, "x" * 5000, "a/" * 2100, "case.nml ",
         "\xe9.nml", "-case.nml", "circle", "out.h5", "no/such/folder/x.h5", "\n", "*",
         "locked/x.h5", "empty.nml"]


def word(rng):
    kind = rng.randrange(5)
    if kind == 0:
        return rng.choice(PATHS)
    if kind == 1:
        return rng.choice(OPTIONS)
    group = rng.choice(list(KEYS))
    text = f"{group}%{rng.choice(KEYS[group])}={value(rng)}"
    if kind == 2:
        k = rng.randrange(len(text))
        text = text[:k] + rng.choice(PIECES) + text[k + rng.randrange(2):]
    return text


def create(rng, folder):
    """Write a sound case beside things that are none; return the arguments, some as bytes."""
    (folder / "case.nml").write_text(JOINT)
    (folder / "empty.nml").touch()
    (folder / "folder").mkdir(exist_ok=True)
    if not (folder / "circle").is_symlink():
        (folder / "circle").symlink_to("circle")
    arguments = []
    for _ in range(rng.choice([0, 1, 1, 2, 3, 3, 8, 60])):
        arguments.append(word(rng))
        if arguments[-1] in ("--set", "-o", "--output") and rng.random() < 0.7:
            arguments.append(word(rng))
    if rng.random() < 0.7:
        arguments.insert(rng.randrange(len(arguments) + 1), "case.nml")
    encoded = [text.replace("\0", "").encode(rng.choice(["utf-8", "latin-1"]), errors="replace")
               for text in arguments]
    if rng.random() < 0.03:
        encoded.append(rng.randbytes(rng.randrange(1, 200)).replace(b"\0", b""))
    return encoded
