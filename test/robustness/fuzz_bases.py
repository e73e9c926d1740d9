"""Sound inputs that the mutations start from: small, and together with every group and format."""
import io
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[2]

JOINT = """&case title = 'joint' analysis = 'frf' threads = 1 /
&model
   n_dof = 2
   mass = 1 0
          0 1
   stiffness = 2 -1
              -1  2
   rayleigh_stiffness = 0.01 /
&contact
   n_pairs = 1
   side_1 = 2 0 0
   mu = 0.3
   normal_load = 1 /
&load cosine = 1 0 /
&harmonics n_harmonics = 3 n_time = 64 /
&sweep start = 0.5 end = 0.8 n_points = 3 /
"""

SPRINGS = """&case analysis = 'frf' /
&model n_dof = 2 mass = 1 0 0 1 stiffness = 2 -1 -1 2 damping = 0.1 0 0 0.1 /
&spring n_springs = 2 side_1 = 1 2 side_2 = 2 0 coefficient = 0.5 1 power = 3 /
&load cosine = 1 0 sine = 0 0.5 static_scale = 2 harmonic_scale = 0.5 /
&harmonics method = 'hbm' n_harmonics = 3 n_time = 0 filter_harmonics = 0 parity = 'auto' /
&sweep start = 0.5 end = 0.7 n_points = 3 unit = 'rad/s' continuation = 'arclength'
       max_points = 10 stability = .true. /
&solver kind = 'newton' linear = 'auto' tolerance = 1e-8 max_iterations = 20 fallback = .false.
        skips = .true. /
&pseudo_time flow = 'rotated' scheme = 'implicit_euler' step = 0 cfl = 0.8 max_steps = 20 /
&output file = 'out.h5' observe = 1 2 histories = .true. contact = .true. /
"""

TIME = """&case analysis = 'time' /
&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.2 /
&load cosine = 1 /
&harmonics n_harmonics = 1 /
&sweep start = 0.5 /
&time n_periods = 20 steps_per_period = 32 /
"""

WEAR = """&case analysis = 'wear' /
&model n_dof = 1 mass = 1 stiffness = 1 damping = 0.1 /
&contact law = 'penalty' n_pairs = 1 side_1 = 1 0 0 mu = 0.3 normal_load = 1 area = 1
         tangential_stiffness = 1 /
&load cosine = 1 /
&harmonics n_harmonics = 3 n_time = 64 /
&sweep start = 0.7 /
&wear scheme = 'implicit' coefficient = 1e-9 n_cycles = 1e6 max_steps = 3 /
"""

FROM_HDF5 = """&model source = 'hdf5' file = 'model.h5' modal_damping = 0.01 rotation_speed = 0.1 /
&contact law = 'dlft' penalty_scale = 1 normal_load = 1 /
&harmonics n_harmonics = 3 n_time = 64 /
&sweep start = 0.5 end = 0.6 n_points = 2 /
"""

FROM_MATRIX_MARKET = """&model source = 'matrix_market' file = 'plate' rayleigh_mass = 0.1 /
&load cosine = 1 0 0 /
&sweep start = 0.5 end = 0.6 n_points = 2 /
"""

MATRIX_MARKET = {
    "plate_mass.mtx": "%%MatrixMarket matrix coordinate real symmetric\n% masses\n3 3 3\n"
                      "1 1 1.0\n2 2 2.0\n3 3 1e0\n",
    "plate_stiffness.mtx": "%%MatrixMarket matrix coordinate real general\n3 3 7\n1 1 2\n2 2 3\n"
                           "3 3 2\n1 2 -1\n2 1 -1\n2 3 -1.0\n3 2 -1.0\n",
    "plate_damping.mtx": "%%MatrixMarket matrix array integer general\n3 3\n1\n0\n0\n0\n1\n0\n"
                         "0\n0\n1\n",
}


def namelists():
    """Texts of every base; those of the examples as well, but for the sector's large model."""
    texts = [JOINT, SPRINGS, TIME, WEAR]
    for path in sorted((ROOT / "example").glob("*/*.nml")):
        if path.parent.name != "blade_sector":
            texts.append(path.read_text())
    return texts


def model_datasets():
    """Every dataset of a model file, for three dofs and two pairs."""
    stiffness = np.array([[3.0, -1, 0], [-1, 3, -1], [0, -1, 2]])
    return {
        "mass": np.eye(3), "stiffness": stiffness, "damping": 0.01*stiffness,
        "stiffness_rotation": 0.1*np.eye(3),
        "contact/side_1": np.array([[1, 0, 2], [3, 0, 0]], dtype="i4"),
        "contact/side_2": np.zeros((2, 3), dtype="i4"),
        "contact/mu": np.array([0.3, 0.4]), "contact/gap": np.array([-0.1, 0.0]),
        "contact/area": np.array(1.0), "contact/position": np.arange(6.0).reshape(2, 3),
        "contact/patch": np.array([b"left", b"right"]),
        "load/static": np.array([0.0, 0.1, 0]), "load/cosine": np.array([1.0, 0, 0]),
        "load/sine": np.zeros(3), "load/static_rotation": np.zeros(3),
        "observe/name": np.array([b"tip", b"root"]), "observe/dof": np.array([1, -3], dtype="i4"),
    }


def model_file():
    """The bytes of a sound model file."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs["format"] = "fretwear-model"
        file.attrs["format_version"] = 1
        file.attrs["title"] = "small"
        file.attrs["unit_system"] = "m-kg-s-N"
        for name, values in model_datasets().items():
            file[name] = values
    return buffer.getvalue()
