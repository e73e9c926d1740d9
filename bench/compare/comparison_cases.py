"""What two builds are compared on: a name, a namelist, and keys set on top of it."""
from __future__ import annotations

from dataclasses import dataclass, field

from bench.common.measure import ROOT

EXAMPLE = ROOT / "example"
SECTOR = EXAMPLE / "blade_sector" / "frf.nml"
SECTOR_48 = EXAMPLE / "blade_sector" / "frf_48.nml"
#: Of the paper's table of methods.
HARMONICS, INSTANTS = (1, 3, 7, 17), 105
BENDING = {"sweep%start": 1016, "sweep%end": 1029, "sweep%n_points": 50}
SLOW = {"model%rotation_speed": 261.8, "sweep%n_points": 41}
DOWN = {**SLOW, "sweep%start": 1015, "sweep%end": 1000}
UP = {**SLOW, "sweep%start": 1000, "sweep%end": 1015}
#: Wear of the joint with 48 pairs at 3600 rpm, at the resonance of the unworn one.
WEAR = {"case%analysis": "'wear'", "model%rotation_speed": 376.99, "sweep%start": 1012.5,
        "sweep%end": 1012.5, "sweep%n_points": 1, "wear%coefficient": 1e-8}


@dataclass(frozen=True)
class Case:
    """A run of the program."""

    name: str
    namelist: object
    settings: dict[str, object] = field(default_factory=dict)

    @property
    def arguments(self):
        """Words of the command line."""
        words = [word for key, value in self.settings.items()
                 for word in ("--set", f"{key}={value}")]
        return [*words, str(self.namelist)]


def example(name):
    return EXAMPLE / name / f"{name}.nml"


def examples():
    """Every namelist of example/."""
    return [Case(str(path.relative_to(EXAMPLE)), path) for path in sorted(EXAMPLE.glob("*/*.nml"))]


def methods():
    """The paper's table 1: 50 frequencies around the first bending mode with every method."""
    for h in HARMONICS:
        for method in ("hbm", "tcm", "tcm_least_squares", "hdhb"):
            for n_time in (INSTANTS, 2*h + 1):
                few = n_time != INSTANTS
                if (method == "hdhb" and not few) or (method == "tcm_least_squares" and few):
                    continue
                yield Case(f"{method}, H = {h}, {n_time} instants", SECTOR, {
                    **BENDING, "harmonics%method": f"'{method}'", "harmonics%n_harmonics": h,
                    "harmonics%n_time": n_time})


def solvers():
    """The paper's figure of iterations: H = 3, every solver without a fallback."""
    for kind, flow, scheme in (
            ("newton", "", ""), ("powell", "", ""), ("kinsol", "", ""),
            ("pseudo_time", "rotated", "implicit_euler"), ("pseudo_time", "rotated", "bdf"),
            ("pseudo_time", "preconditioned", "implicit_euler")):
        flows = {"pseudo_time%flow": f"'{flow}'", "pseudo_time%scheme": f"'{scheme}'"}
        yield Case(f"{kind} {flow} {scheme}".strip(), SECTOR, {
            **BENDING, "harmonics%n_time": INSTANTS, "solver%kind": f"'{kind}'",
            "solver%fallback": ".false.", **(flows if flow else {})})


def sweeps():
    """The sweeps that docs/benchmarks.md gives times of."""
    for h, pairs, namelist in ((3, 16, SECTOR), (7, 48, SECTOR_48)):
        for name, sweep in (("down", DOWN), ("up", UP)):
            yield Case(f"{pairs} pairs, H = {h}, {name}", namelist, {
                **sweep, "harmonics%n_harmonics": h, "harmonics%n_time": 128})
    yield Case("48 pairs, H = 17, near the peak", SECTOR_48, {
        "harmonics%n_harmonics": 17, "harmonics%n_time": 128, "sweep%start": 1015.8,
        "sweep%end": 1019.8, "sweep%n_points": 9})


def wear():
    """The paper's tables of wear: implicit and pseudo-time, 20 steps to the deepest."""
    for scheme in ("implicit", "pseudo_time"):
        yield Case(f"wear, {scheme}", SECTOR_48, {
            **WEAR, "wear%scheme": f"'{scheme}'", "wear%max_depth_step": 2e-5})
    yield Case("wear, Rosenbrock", SECTOR_48, {
        **WEAR, "wear%scheme": "'pseudo_time'", "pseudo_time%scheme": "'rosenbrock'",
        "wear%max_depth_step": 2e-5})


def features():
    """Laws, samplings, outputs and analyses that no case above has."""
    elastic = {"contact%law": "'penalty'", "contact%tangential_stiffness": 2e4,
               "contact%normal_stiffness": 2e4}
    yield Case("elastic flanks", SECTOR, elastic)
    yield Case("elastic flanks by events", SECTOR, {
        **elastic, "harmonics%sampling": "'events'", "harmonics%n_time": 0})
    yield Case("velocity law", SECTOR, {"contact%law": "'dlft_velocity'"})
    yield Case("velocity law, LU, no skips", SECTOR, {
        "contact%law": "'dlft_velocity'", "solver%linear": "'lu'", "solver%skips": ".false."})
    yield Case("rigid flanks by events", SECTOR, {
        "harmonics%sampling": "'events'", "harmonics%n_time": 0})
    yield Case("branch", SECTOR, {"sweep%continuation": "'arclength'", "sweep%n_points": 41})
    yield Case("harmonics of each point", SECTOR, {
        "harmonics%accuracy": 3e-2, "harmonics%n_harmonics": 9, "harmonics%n_time": 0})
    yield Case("histories", SECTOR, {"output%histories": ".true.", "sweep%n_points": 25})
    yield Case("accuracy", example("jenkins"), {
        "harmonics%n_time": 0, "harmonics%n_harmonics": 31, "harmonics%accuracy": 1e-3})
    yield Case("slider by events", example("jenkins"), {"harmonics%n_time": 0})
    yield Case("stability", example("duffing"), {"sweep%stability": ".true."})
    yield Case("slider, stability", example("jenkins"), {"sweep%stability": ".true."})
    for name in ("coulomb", "gap", "separation", "jenkins"):
        yield Case(f"{name} in time", example(name), {
            "case%analysis": "'time'", "sweep%n_points": 5})


GROUPS = {"examples": examples, "methods": methods, "solvers": solvers, "sweeps": sweeps,
          "wear": wear, "features": features}
