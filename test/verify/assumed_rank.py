"""Assertions of the stand-in for pFUnit without assumed rank, which flang 19 has not.

Each procedure with arguments `(..)` becomes one for each rank, or for each two ranks that an
expected and a found value may have, under the generic name that it had before.
"""
import re

DIMENSIONS = ("", "(:)", "(:, :)", "(:, :, :)")
#: Of the expected value and of the found one: the same, or a scalar for all.
PAIRS = ((0, 0), (1, 1), (2, 2), (3, 3), (0, 1), (0, 2), (0, 3))
PROCEDURE = re.compile(r"^   (subroutine|function) (\w+)\(.*?^   end \1 \2\n",
                       re.MULTILINE | re.DOTALL)
SELECTION = re.compile(r"^ *select rank \(x\)\n.*?^ *end select\n", re.MULTILINE | re.DOTALL)


def without_assumed_rank(text):
    """The same module with a procedure for every rank."""
    names = [found[2] for found in PROCEDURE.finditer(text) if "(..)" in found[0]]
    text = PROCEDURE.sub(lambda found: copies(found[0], names) if found[2] in names else found[0],
                         text)
    for name in names:
        specific = sorted(set(re.findall(rf"^   (?:subroutine|function) ({name}_\d+)\(", text,
                                         re.MULTILINE)))
        text = text.replace(f"      module procedure {name}\n", "".join(
            f"      module procedure {one}\n" for one in specific))
    return text


def copies(procedure, names):
    """A procedure for each rank; calls among those of `names` keep to their ranks."""
    ranks = PAIRS if "expected(..)" in procedure else tuple((rank,) for rank in range(4))
    procedure = SELECTION.sub("      list = [x]\n", procedure)
    result = []
    for chosen in ranks:
        suffix = "_" + "".join(map(str, chosen))
        one = re.sub(rf"\b({'|'.join(names)})\b", rf"\1{suffix}", procedure)
        for argument, rank in zip(("expected", "found") if len(chosen) > 1 else ("x",), chosen):
            one = one.replace(f"{argument}(..)", argument + DIMENSIONS[rank])
        result.append(one)
    return "\n".join(result)
