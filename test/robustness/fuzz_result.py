"""Mutations of result files that a run starts from: bytes of a wear result that changed."""
import gzip
from pathlib import Path

from fuzz_bases import WEAR
from fuzz_model import cut

#: The result of the case WEAR, restart data included; mostly empty rows of its chunks.
SOUND = gzip.decompress((Path(__file__).resolve().parent / "inputs/wear.h5.gz").read_bytes())
#: What is written holds the structure and the numbers, what is empty nothing to hit.
WRITTEN = [k for k, byte in enumerate(SOUND) if byte]


def flip(rng, content):
    content = bytearray(content)
    for _ in range(rng.choice([1, 2, 4, 16, 200])):
        k = rng.choice(WRITTEN) + rng.randrange(-1, 2)
        content[k] = rng.choice([content[k] ^ (1 << rng.randrange(8)), 0, 255, rng.randrange(256)])
    return bytes(content)


def create(rng, folder):
    """Write `damaged.h5`, and a namelist whose run goes on from it, or starts at its depths."""
    (folder / "damaged.h5").write_bytes(rng.choice([flip, flip, flip, cut])(rng, SOUND))
    if rng.random() < 0.5:
        (folder / "case.nml").write_text(WEAR)
        return ["--restart", "damaged.h5", "case.nml"]
    (folder / "case.nml").write_text(WEAR.replace("area = 1", "area = 1 worn = 'damaged.h5'"))
    return ["case.nml"]
