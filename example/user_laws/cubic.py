"""The same spring in Python, beside the one that is built in."""
import numpy as np

import fretwear as fw

C = 0.5


def cubic(u, v, t, omega):
    return C * u**3


def slopes(u, v, t, omega):
    du = 3.0 * C * u[..., None]**2      # (n_time, n_in, n_in)
    return du, np.zeros_like(du)


law = fw.Law(cubic, side_1=1, derivative=slopes, odd=True)
own = fw.Model([[1.0]], [[0.1]], [[1.0]], laws=[law], cosine=[0.3])
built_in = fw.Model([[1.0]], [[0.1]], [[1.0]], springs=[fw.Spring(1, 0, C)], cosine=[0.3])

amplitudes = []
for model in (own, built_in):
    case = fw.Case(model, case={"analysis": "point"}, harmonics={"n_harmonics": 9},
                   sweep={"start": 1.2}, solver={"tolerance": 1e-11})
    amplitudes.append(float(fw.run(case).amplitude[0, 0]))
print("amplitude: own law {:.10f}, built in {:.10f}".format(*amplitudes))
