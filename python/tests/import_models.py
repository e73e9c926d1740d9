"""The model behind the files of import_files: two bodies of nodes with three components."""

from __future__ import annotations

import numpy as np

NODES = (11, 12, 13, 21, 22)
LABELS = [(node, component) for node in NODES for component in (1, 2, 3)]
# Springs between nodes (0: ground) with their stiffness in x, y and z.
SPRINGS = ((0, 11, (400.0, 500.0, 600.0)), (11, 12, (100.5, 120.0, 140.0)),
           (12, 13, (90.0, 80.25, 70.0)), (21, 22, (60.0, 50.0, 40.5)))
MASSES = {11: 1.0, 12: 1.5, 13: 2.0, 21: 0.75, 22: 1.25}
COUPLED_MASS = 0.125  # between the x components of nodes 21 and 22


def matrices() -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness (15, 15); the second body is free."""
    place = {label: i for i, label in enumerate(LABELS)}
    mass = np.diag([MASSES[node] for node, _ in LABELS])
    i, j = place[21, 1], place[22, 1]
    mass[i, j] = mass[j, i] = COUPLED_MASS
    stiffness = np.zeros_like(mass)
    for one, two, values in SPRINGS:
        for component, value in enumerate(values, 1):
            ends = [place[node, component] for node in (one, two) if node]
            sign = np.array([-1.0, 1.0])[-len(ends):]
            stiffness[np.ix_(ends, ends)] += value * np.outer(sign, sign)
    return mass, stiffness
