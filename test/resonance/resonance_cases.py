"""Cases of resonances over a parameter: reference values and runs."""
import json
from pathlib import Path

import numpy as np
from cases import merged, read, run

REFERENCES = json.loads(Path(__file__).with_name("resonance_references.json").read_text())


def track_groups(groups, parameter, start, end, *, n_points=2, changes=None, slopes=(), **keys):
    """Groups of a case of analysis 'resonance'."""
    options = {"parameter": parameter, "start": start, "end": end, "n_points": n_points} | keys
    case = merged(groups, {"case": {"analysis": "resonance"}, "resonance": options,
                           "solver": {"tolerance": 1e-12}})
    if slopes:
        case = merged(case, {"sensitivity": {"parameters": list(slopes)}})
    return merged(case, changes or {})


def track(folder, groups, parameter, start, end, *, status=0, **options):
    """Run a track and read it."""
    run(folder, track_groups(groups, parameter, start, end, **options), status=status)
    return read(folder / "case.h5")


def slope(found, quantity, parameter, point=0):
    """Derivative of the first observed quantity, or of the frequency, by a number or one pair's."""
    values = found[f"sensitivity/{quantity}/{parameter.replace('%', '_')}"][point]
    return float(np.ravel(values)[0])
