"""The measured table of this example: a mode that is known, with noise.

    python make_data.py > measured.csv
"""
import tempfile
from pathlib import Path

import numpy as np

import fretwear as fw

#: What is to be found; deviations of frequency [Hz] and damping ratio.
TRUTH = {"normal_load": 0.6, "tangential_stiffness": 1.2}
FREQUENCY, DAMPING = 2e-4, 1e-3

case = fw.Case.from_file(Path(__file__).with_name("mode.nml"), contact=TRUTH)
rng = np.random.default_rng(2)
print("# Mode of a mass with a friction joint: normal load 0.6, stiffness 1.2, and noise")
print("amplitude, frequency, damping_ratio, frequency_deviation, damping_deviation")
with tempfile.TemporaryDirectory() as folder:
    for amplitude in np.round(np.geomspace(0.3, 4.0, 12), 4).tolist():
        mode = fw.run(case.replace(mode={"start": amplitude, "end": 1.01 * amplitude,
                                         "n_points": 2}), Path(folder, "mode.h5")).mode
        frequency = mode.frequency[0] + rng.normal(0.0, FREQUENCY)
        damping = mode.damping_ratio[0] + rng.normal(0.0, DAMPING)
        print(f"{amplitude:.4f}, {frequency:.5f}, {damping:.5f}, {FREQUENCY}, {DAMPING}")
