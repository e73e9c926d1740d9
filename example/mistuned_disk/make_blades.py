"""Draw blades.csv, which stands for measurements on a bench: 36 blades, clamped at their roots.

    python make_blades.py
"""

from pathlib import Path

import numpy as np

#: Of the blade alone, as `python -m fretwear.disk --blade 3` prints them [Hz].
NOMINAL = np.array([402.8, 1314.8, 2391.0])
#: The set lies above the drawing; blades differ, and modes of one blade by less.
MEAN, BLADES, MODES = 0.004, 0.008, 0.003

rng = np.random.default_rng(36)
part = MEAN + BLADES * rng.standard_normal((36, 1)) + MODES * rng.standard_normal((36, 3))
lines = ["# natural frequencies of single blades, clamped at the root [Hz]; drawn, not measured",
         "blade,first,second,third"]
lines += [f"{blade}," + ",".join(f"{value:.2f}" for value in row)
          for blade, row in enumerate(NOMINAL * (1.0 + part))]
Path(__file__).with_name("blades.csv").write_text("\n".join(lines) + "\n")
