"""Sound calls of the Python package, small, with every argument there is, for `fuzz_python`."""
import fretwear as fw
from fretwear import operators as op

STIFFNESS = [[2.0, -1.0], [-1.0, 2.0]]
IDENTITY = [[1.0, 0.0], [0.0, 1.0]]
DAMPING = [[0.2, -0.1], [-0.1, 0.2]]
CONTACT = {"side_1": [[2, 0, 0]], "side_2": [[0, 0, 0]], "mu": [0.3], "gap": [0.0], "area": [1.0],
           "normal_load": [1.0], "tangential_stiffness": [1.0], "position": [[0.0, 0.0, 0.0]],
           "patch": ["left"]}
SPRING = {"side_1": 1, "side_2": 0, "coefficient": 0.1, "power": 3}
MODEL = {"M": IDENTITY, "C": DAMPING, "K": STIFFNESS, "static": [0.0, 0.1], "cosine": [1.0, 0.0],
         "sine": [0.0, 0.5], "stiffness_rotation": IDENTITY, "static_rotation": [0.0, 0.0],
         "observe": {"tip": 1, "sum": [1.0, 1.0]}, "title": "small", "unit_system": "m-kg-s-N"}
#: These are checked and not run: a run that is told to take long is no fault.
GROUPS = {"sweep": {"start": 0.5, "end": 0.8, "n_points": 3},
          "structure": {"rotation_speed": 0.1}, "contact": {"mu": 0.4, "law": "penalty"},
          "load": {"harmonic_scale": 0.5}, "harmonics": {"n_harmonics": 3, "n_time": 64},
          "solver": {"kind": "newton", "tolerance": 1e-9, "max_iterations": 20, "fallback": False},
          "output": {"histories": True, "contact": True}}
N_POINTS = 3
FRF = {"start": 0.5, "end": 0.8, "unit": "rad/s", "file": None, "check": True,
       "progress": None}
WEAR = {"frequency": 0.6, "coefficient": 1e-9, "n_cycles": 1e6, "scheme": "implicit",
        "unit": "rad/s", "file": None, "check": True, "progress": None, "wear": {"max_steps": 3}}

COEFFICIENTS = [[0.0, 1.0, 0.0, 0.2, 0.1], [0.3, 0.0, 1.0, 0.0, 0.0]]
STRUCTURE = {"M": IDENTITY, "C": DAMPING, "K": STIFFNESS}
SIDES = {"side_1": [2], "side_2": [0]}
FORCING = {"static": [0.0, 0.1], "cosine": [1.0, 0.0], "sine": [0.0, 0.5]}
OPERATORS = {
    "coefficient_count": {"n_harmonics": 3, "odd_only": False},
    "harmonic_operators": {"n_harmonics": 3, "n_time": 16, "odd_only": False},
    "to_time": {"coefficients": COEFFICIENTS, "n_time": 16, "odd_only": False},
    "to_coefficients": {"values": [[0.0, 1, 2, 3, 2, 1]], "n_harmonics": 2, "odd_only": False},
    "differentiate": {"coefficients": COEFFICIENTS, "odd_only": False},
    "amplitude": {"coefficients": COEFFICIENTS},
    "dynamic_stiffness": {**STRUCTURE, "omega": 0.7},
    "condense": {**STRUCTURE, **SIDES, "omega": 0.7, "harmonics": [0, 1, 3], **FORCING},
    "recover": {**STRUCTURE, **SIDES, "omega": 0.7, "q": [[0.1], [0.2]], "harmonics": [0, 1],
                **FORCING},
    "contact_forces": {"prediction": [[[0.1, 1, 0, 0, 0], [0, 0, 1, 0, 0], [-2, 0, 0, 1, 0]]],
                       "mu": [0.3], "n_time": 32, "offset": [0.0], "start": [[0.0, 0.0]],
                       "present": [[True, True, True]], "remembers": True, "odd_only": False,
                       "jacobian": True},
}
READINGS = {"index": {"observe": "tip"}, "amplitude_of": {"observe": "tip"},
            "harmonic": {"n": 1, "observe": "tip"}, "peak": {"observe": 0},
            "units": {"name": "omega"}, "__getitem__": {"name": "omega"}}


def model(arguments):
    """A model of flat arguments; those of its pairs and springs have prefixes."""
    parts = {"contact": {}, "spring": {}, "": {}}
    for name, value in arguments.items():
        part, _, key = name.rpartition(".")
        parts[part][key] = value
    return fw.Model(**parts[""], contact=fw.ContactPairs(**parts["contact"]),
                    springs=[fw.Spring(**parts["spring"])])


def model_arguments():
    return {**MODEL, **{f"contact.{key}": value for key, value in CONTACT.items()},
            **{f"spring.{key}": value for key, value in SPRING.items()}}


def sound_model():
    return fw.Model(**MODEL, contact=fw.ContactPairs(**CONTACT))


def check_model(arguments):
    fw.Case(model(arguments), contact={"law": "penalty"}, sweep={"start": 0.5}).check()


def settings():
    """Keys of the settings, flat: group.key."""
    return {f"{group}.{key}": value for group, keys in GROUPS.items()
            for key, value in keys.items()}


def check_settings(arguments):
    groups = {}
    for name, value in arguments.items():
        group, _, key = name.partition(".")
        groups.setdefault(group, {})[key] = value
    fw.Case(sound_model(), **groups).check()


def frf(arguments):
    return fw.frf(sound_model(), n_points=N_POINTS, **arguments, contact={"law": "penalty"},
                  harmonics=GROUPS["harmonics"])


def wear(arguments):
    return fw.wear(sound_model(), **arguments, contact={"law": "penalty"},
                   harmonics=GROUPS["harmonics"])


def operator(name):
    return lambda arguments: getattr(op, name)(**arguments)


def reading(name):
    """A method of a result that is sound; the first input makes the file."""
    def call(arguments):
        result = fw.Result("sound.h5")
        if len(result.omega) != N_POINTS:
            raise AssertionError("the result of the sound run is another")
        return getattr(result, name)(**arguments)
    return call


def open_result(arguments):
    return list(fw.Result(**arguments))


def prepare():
    """The result that the readings start from, in the present folder."""
    frf({**FRF, "file": "sound.h5"})


#: Name: sound arguments and what is called with them, the more important ones more often.
CALLS = {"Model": (model_arguments(), check_model), "Case": (settings(), check_settings),
         "frf": (FRF, frf), "wear": (WEAR, wear), "Result": ({"path": "sound.h5"}, open_result)}
CALLS |= {f"operators.{name}": (arguments, operator(name)) for name, arguments in OPERATORS.items()}
CALLS |= {f"Result.{name}": (arguments, reading(name)) for name, arguments in READINGS.items()}
SHARES = (["Model"]*8 + ["Case"]*4 + ["frf"]*2 + ["wear"]*2 + ["Result"] + sorted(CALLS))
