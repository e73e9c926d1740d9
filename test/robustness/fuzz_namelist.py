"""Mutations of namelists that know groups, keys and values, and some that know nothing."""
import re

from fuzz_bases import namelists

#: Keys of every group, as `fw_run --keys` has them (a test compares): an input depends on the seed
#: alone, not on the program. Names that belong nowhere come on top.
KEYS = {
    "case": ["title", "analysis", "threads", "max_seconds"],
    "sensitivity": ["parameters", "quantities", "deviation"],
    "resonance": ["parameter", "start", "end", "n_points", "spacing", "as", "condition",
                  "quantity", "continuation", "max_points"],
    "model": ["source", "file", "unit_system", "n_dof", "mass", "stiffness", "damping",
              "structural_damping", "circulatory", "stiffness_unsymmetric", "damping_unsymmetric",
              "n_rows", "row", "rayleigh_mass", "rayleigh_stiffness", "modal_damping",
              "modal_damping_of", "modal_damping_up_to", "rotation_speed", "loss_factor"],
    "body": ["mass"],
    "cyclic": ["n_sectors", "engine_order", "mistuned", "n_modes", "n_interface", "left", "right"],
    "mistuning": ["n_rows", "rows", "row_omega", "frequency", "damping_ratio", "stiffness", "mass",
                  "blade_stiffness", "blade_mass", "scale"],
    "contact": ["n_pairs", "law", "normal_law", "n_table", "overclosure", "force",
                "normal_per_area", "side_1", "side_2", "sector_2", "mu", "gap", "area",
                "normal_load", "gap_rotation", "normal_load_rotation", "speed_1", "speed_2",
                "tangential_stiffness", "normal_stiffness", "normal_coefficient",
                "normal_exponent", "reference_force", "decay_length", "slip_speed", "mu_dynamic",
                "weakening_speed", "weakening_exponent", "mu_viscous", "iwan_chi", "iwan_beta",
                "bouc_wen_exponent", "bouc_wen_beta", "penalty_scale", "memory", "slider_1",
                "slider_2", "residual", "n_gap_terms", "gap_pair", "gap_harmonic", "gap_order",
                "gap_amplitude", "gap_phase", "sliding", "worn", "worn_step"],
    "user": ["n_elements", "library", "symbol", "n_in", "side_1", "side_2", "n_parameters",
             "parameters", "derivative", "odd", "thread_safe", "check", "check_tolerance"],
    "spring": ["n_springs", "side_1", "side_2", "sector_2", "coefficient", "power"],
    "polynomial": ["n_terms", "of", "factors", "coefficient", "dof"],
    "damper": ["n_dampers", "side_1", "side_2", "sector_2", "coefficient", "power",
               "position_power"],
    "load": ["static", "cosine", "sine", "n_terms", "term_dof", "term_harmonic", "term_order",
             "term_amplitude", "term_phase", "term_power", "n_table", "table_frequency",
             "table_scale", "static_scale", "harmonic_scale"],
    "base": ["n_terms", "dof", "direction", "motion", "harmonic", "amplitude", "phase", "frame"],
    "harmonics": ["method", "n_harmonics", "n_time", "n_collocation", "filter_harmonics",
                  "sampling", "parity", "accuracy"],
    "sweep": ["parameter", "start", "end", "unit", "continuation", "n_points", "max_points",
              "stability", "speed_order", "refine", "values", "frequency", "as"],
    "solver": ["kind", "linear", "tolerance", "max_iterations", "max_seconds", "fallback", "skips",
               "n_solutions", "deflation_power", "deflation_shift"],
    "pseudo_time": ["flow", "scheme", "step", "cfl", "max_steps"],
    "wear": ["scheme", "law", "order", "coefficient", "n_cycles", "max_depth_step",
             "error_tolerance", "steady_tolerance", "max_steps", "check_steps", "mu_by",
             "mu_final", "mu_scale", "follow_resonance"],
    "mission": ["n_blocks", "cycles", "n_flights", "change", "name", "flights_per_jump"],
    "time": ["n_periods", "steps_per_period"],
    "mode": ["number", "near", "unit", "amplitudes", "start", "end", "control", "n_points",
             "continuation", "max_points", "synthesis"],
    "campbell": ["start", "end", "n_speeds", "orders", "order_scale", "peaks", "n_points"],
    "bounds": ["quantity", "n_starts"],
    "ringdown": ["number", "amplitude", "n_cycles", "steps_per_period"],
    "population": ["n_patterns", "peaks", "quantity", "patterns"],
    "stress": ["method", "diagram", "endurance", "ultimate", "output"],
    "output": ["file", "histories", "contact", "tail", "observe"],
    "control": ["amplitude", "of", "observed"],
}

NUMBERS = ["0", "-1", "1", "2", "3", "7", "1e-300", "1e300", "1e308", "4.9e-324", "1e400", "-1e400",
           "nan", "inf", "-inf", "NaN", "+Infinity", "2147483647", "2147483648", "-2147483648",
           "9223372036854775808", "100000", "1000000", "10000", "99999999999999999999", "1.5",
           "1d3", "1.e", ".", "-", "1e", "0x10", "1_8", "(1,2)", "1e-9999", "0.1 0.2", "1,,2",
           "3*1", "2*", "100000000*0", "2147483648*1", "0*1", "-1*1", "1*1*1", "1:3", "t", ".true."]
WORDS = ["''", "'", '"', "'x'", '"x"', "'a''b'", "x", "'frf'", "'point'", "'time'", "'wear'",
         "'hdf5'", "'matrix_market'", "'memory'", "'inline'", "'dlft'", "'dlft_velocity'",
         "'penalty'", "'tcm'", "'tcm_least_squares'", "'hdhb'", "'events'", "'odd'", "'all'",
         "'Hz'", "'arclength'", "'powell'", "'kinsol'", "'pseudo_time'", "'krylov'", "'lu'",
         "'bdf'", "'rosenbrock'", "'runge_kutta'", "'identity'", "'carried'",
         "'preconditioned'", "'explicit'", "'/'", "'&model'", "'..'", "'/'", "'/dev/null'",
         "'" + "x" * 5000 + "'", "'\xe9\u4e2d'", "'\x01'", ".true.", ".false.", ".t.", ".maybe."]
PIECES = ["'", '"', "/", "&", "=", "(", ")", ",", "*", "!", "\n", "\r\n", "9", "-", "%", ":", "x",
          "\t", "\0", "\x1a", "\x7f", "\xe9", "\u2028", "&end\n", "$", ";", "/\n/\n", "&model\n",
          "!" + "z" * 20000 + "\n", " " * 20000, "(1)", "(2:3)", "(0)", "(-1)", "(99999999999)",
          "(:)", "(1,1)", "%x"]

KEY = re.compile(r"\b\w{1,40}[ \t]{0,20}=") # linear: some inputs have very long words
BASES = namelists()


def value(rng):
    """A value of any kind, sometimes a list."""
    pool = NUMBERS if rng.random() < 0.6 else WORDS
    n = 1 if rng.random() < 0.8 else rng.choice([2, 3, 4, 9, 100])
    return rng.choice([" ", ", "]).join(rng.choice(pool) for _ in range(n))


def entries(text):
    """Start of every key, start and end of its value: to the next key, or the end of the line."""
    found = list(KEY.finditer(text))
    for match, following in zip(found, [*found[1:], None]):
        stop = len(text) if following is None else following.start()
        line = text.find("\n", match.end())
        yield match.start(), match.end(), min(stop, line) if line >= 0 else stop


def replace_value(rng, text):
    found = list(entries(text))
    if not found:
        return text
    _, first, last = rng.choice(found)
    ending = "/" if text[first:last].rstrip().endswith("/") else ""
    return f"{text[:first]} {value(rng)} {ending}{text[last:]}"


def swap_values(rng, text):
    found = list(entries(text))
    if len(found) < 2:
        return text
    (_, a, b), (_, c, d) = sorted(rng.sample(found, 2))
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


def add_key(rng, text):
    """A key in its own group, in a foreign one, twice, with an index, or misspelt."""
    group = rng.choice(list(KEYS))
    key = rng.choice(KEYS[group])
    if rng.random() < 0.2:
        key = rng.choice([key + "x", key[:-1], key.upper(), key + rng.choice(PIECES)])
    if rng.random() < 0.3:
        group = rng.choice([*KEYS, "nothing", ""])
    entry = f" {key} = {value(rng)} "
    at = re.search(rf"&{group}\b", text) if group else None
    if at:
        return text[:at.end()] + entry + text[at.end():]
    return text + f"&{group}{entry}/\n"


def remove_key(rng, text):
    found = list(entries(text))
    if not found:
        return text
    first, _, last = rng.choice(found)
    return text[:first] + text[last:]


def change_groups(rng, text):
    groups = re.findall(r"&\w+[^&]*", text)
    if not groups:
        return text
    kind = rng.randrange(4)
    if kind == 0:
        groups.pop(rng.randrange(len(groups)))
    elif kind == 1:
        groups.append(rng.choice(groups))
    elif kind == 2:
        rng.shuffle(groups)
    else:
        k = rng.randrange(len(groups))
        groups[k] = groups[k].rstrip().removesuffix("/") + "\n"
    return "".join(groups)


def noise(rng, text):
    characters = list(text)
    for _ in range(rng.choice([1, 1, 2, 4, 30])):
        k = rng.randrange(len(characters) + 1)
        if rng.random() < 0.5:
            characters.insert(k, rng.choice(PIECES))
        elif characters:
            del characters[k:k + rng.choice([1, 1, 5])]
    return "".join(characters)


def truncate(rng, text):
    return text[:rng.randrange(len(text) + 1)]


MUTATIONS = [replace_value, replace_value, replace_value, swap_values, add_key, add_key, remove_key,
             change_groups, noise, truncate]


def mutate(rng, text):
    for _ in range(rng.choice([1, 1, 1, 2, 3, 6])):
        text = rng.choice(MUTATIONS)(rng, text)
    return text


def create(rng, folder):
    """Write `case.nml`."""
    text = mutate(rng, rng.choice(BASES))
    (folder / "case.nml").write_bytes(text.encode(rng.choice(["utf-8", "utf-8", "latin-1",
                                                              "utf-16"]), errors="replace"))
    return ["case.nml"]
