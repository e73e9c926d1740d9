"""Mutations of Matrix Market files."""
from fuzz_bases import FROM_MATRIX_MARKET, MATRIX_MARKET

TOKENS = ["0", "-1", "4", "1", "2147483647", "2147483648", "9223372036854775808", "1e400", "-1e400",
          "nan", "inf", "x", "", "1.5", "1e308", "1e-400", "1d0", "%", "1,2", "\0", "+", "1 1",
          "100000", "65536", "46341", "\xe9"]
HEADS = ["%%MatrixMarket matrix coordinate real general",
         "%%MatrixMarket matrix array real general",
         "%%MatrixMarket matrix coordinate pattern symmetric", "%%MatrixMarket", "%%matrixmarket",
         "%%MatrixMarket matrix coordinate complex hermitian", "%%MatrixMarket vector array real",
         "%%MatrixMarket matrix coordinate integer skew-symmetric", "%%MATRIXMARKET MATRIX ARRAY",
         "%%MatrixMarket matrix array integer symmetric", "%%MatrixMarket tensor x y z", "",
         "%%MatrixMarket matrix coordinate real general extra"]


def mutate(rng, text):
    lines = text.split("\n")
    for _ in range(rng.choice([1, 1, 2, 5])):
        k = rng.randrange(len(lines))
        kind = rng.randrange(9)
        if kind <= 2:
            words = lines[k].split(" ")
            words[rng.randrange(len(words))] = rng.choice(TOKENS)
            lines[k] = " ".join(words)
        elif kind == 3:
            lines[0] = rng.choice(HEADS)
        elif kind == 4 and len(lines) > 1:
            del lines[k]
        elif kind == 5:
            lines.insert(k, rng.choice(["", "% comment", lines[k], "1 1 1", " " * 30000,
                                        "9" * 30000, "1 2 3 4 5"]))
        elif kind == 6:
            lines[k] = lines[k] + rng.choice([" 1", "\r", "\t", "\0", "%", "\x1a"])
        elif kind == 7:
            lines = lines[:k + 1]
        else:
            rng.shuffle(lines)
    text = "\n".join(lines)
    if rng.random() < 0.2:
        k = rng.randrange(len(text) + 1)
        text = text[:k] + rng.choice(TOKENS) + text[k:]
    if rng.random() < 0.1:
        text = text[:rng.randrange(len(text) + 1)]
    return text


def create(rng, folder):
    """Write the three matrices and a namelist that reads them."""
    (folder / "case.nml").write_text(FROM_MATRIX_MARKET)
    hit = rng.choice(list(MATRIX_MARKET))
    for name, text in MATRIX_MARKET.items():
        if name == hit or rng.random() < 0.1:
            text = mutate(rng, text)
        (folder / name).write_bytes(text.encode("utf-8", errors="replace"))
    return ["case.nml"]
