"""An integration in time of the shrouded disk, which takes nothing of the program but its model.

    python -m bench.disk.march [--build build/release] [-o docs/shrouded_disk.md]

The wave of engine order 4 around 36 sectors comes back after nine: nine sectors, closed on
themselves, march from rest until their motion repeats. The linear part moves by its exact
solution for forces that are linear within a step; contact forces come from the displacements.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
from scipy.linalg import eigh, expm, solve

from bench.disk.__main__ import EXAMPLE, ROOT, runner, write_section

#: Load [N] and frequency [Hz], beside the peaks with one harmonic.
POINTS = ((5.0, 1256.0), (10.0, 1238.0), (30.0, 1172.0))
HARMONICS = (1, 5, 15)
N = 9
STIFFNESS, MASS_DAMPING, STIFFNESS_DAMPING = 73263.0, 4.0489, 6.1745e-8


class Annulus:
    """Nine sectors by their nodal diameters 0 to 4, and what their pairs did so far."""

    def __init__(self, step: float) -> None:
        with h5py.File(EXAMPLE / "disk.h5") as file:
            part = {name: file[name][()] for name in (
                "mass", "stiffness", "load/static", "load/cosine", "load/sine", "observe/matrix",
                "cyclic/left", "cyclic/right", "contact/side_1", "contact/side_2", "contact/mu",
                "contact/gap")}
        left, right = part["cyclic/left"] - 1, np.abs(part["cyclic/right"]) - 1
        sign = np.sign(part["cyclic/right"])
        size = len(part["mass"])
        kept = np.setdiff1d(np.arange(size), right)
        eye = np.eye(size)
        self.mu, self.gap = part["contact/mu"], part["contact/gap"]
        rows, seen, loads, self.squares, propagators = [], [], [], [], []
        for k in range(N // 2 + 1):
            turn = np.exp(2j * np.pi * k / N)
            tie = eye[:, kept].astype(complex)
            tie[right] = turn * sign[:, None] * tie[left]
            mass, stiffness = (tie.conj().T @ part[name] @ tie for name in ("mass", "stiffness"))
            squares, modes = eigh(stiffness, mass)
            shape = tie @ modes
            row = sum(factor * np.sign(side)[:, :, None] * shape[np.abs(side) - 1]
                      for factor, side in ((1.0, part["contact/side_1"]),
                                           (-turn, part["contact/side_2"])))
            rows.append(row.reshape(-1, len(squares)))
            seen.append(part["observe/matrix"] @ shape)
            # Transforms over the sectors: a sum over nine for what is alike, half for a wave.
            loads.append((N * (k == 0) * shape.conj().T @ part["load/static"],
                          N / 2 * (k == 1) * shape.conj().T
                          @ (part["load/cosine"] - 1j * part["load/sine"])))
            propagators.append([self.propagator(s, step) for s in squares])
            self.squares.append(squares)
        self.rows, self.seen = np.array(rows), np.array(seen)
        self.back = self.rows.conj().transpose(0, 2, 1)
        self.steady, self.wave = (np.array(part) for part in zip(*loads))
        self.propagate = np.array(propagators)
        self.q = np.zeros((2, *self.steady.shape), dtype=complex)
        self.slip = np.zeros((N, 4, 2))
        self.preload(np.array(self.squares))

    @staticmethod
    def propagator(square: float, step: float) -> np.ndarray:
        """Of displacement, velocity, force and its change over a step."""
        generator = np.zeros((4, 4))
        generator[0, 1] = 1.0
        generator[1] = -square, -MASS_DAMPING - STIFFNESS_DAMPING * square, 1.0, 0.0
        generator[2, 3] = 1.0 / step
        return expm(generator * step)[:2]

    def preload(self, squares: np.ndarray) -> None:
        """Start at rest, pressed by the interference, without friction."""
        row = self.rows[0, 2::3]
        matrix = np.diag(squares[0]) + STIFFNESS * row.conj().T @ row
        self.q[0, 0] = solve(matrix, self.steady[0] - N * STIFFNESS * row.conj().T @ self.gap)
        self.slip[:] = (self.rows[0] @ self.q[0, 0]).real.reshape(4, 3)[:, :2] / N

    def contact(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the pairs (nine, four, three), and where their springs would stand then."""
        relative = np.fft.irfft((self.rows @ q[..., None])[..., 0], N, axis=0).reshape(N, 4, 3)
        force = STIFFNESS * relative
        normal = np.minimum(force[..., 2] + STIFFNESS * self.gap, 0.0)
        trial = force[..., :2] - STIFFNESS * self.slip
        size = np.hypot(trial[..., 0], trial[..., 1])
        limit = -self.mu * normal
        trial *= np.where(size > limit, limit / np.maximum(size, 1e-300), 1.0)[..., None]
        return np.concatenate((trial, normal[..., None]), axis=2), relative[..., :2] - (
            trial / STIFFNESS)

    def march(self, load: float, omega: float, times: np.ndarray) -> np.ndarray:
        """Tip and load point of sector 0 at the ends of steps."""
        free, push, ramp = self.propagate[..., :2], self.propagate[..., 2], self.propagate[..., 3]
        free, push, ramp = (np.moveaxis(part, (0, 1), (-2, -1)) for part in (free, push, ramp))
        seen = np.empty((len(times) - 1, 2))
        outer = self.steady + load * np.exp(1j * omega * times)[:, None, None] * self.wave
        now, self.slip = self.contact(self.q[0])
        for i in range(len(times) - 1):
            force = outer[i] - self.modal(now)
            moved = free[:, 0] * self.q[0] + free[:, 1] * self.q[1] + push * force
            change = outer[i + 1] - outer[i]
            # Forces at the end from a step with those of its beginning, then a step with both.
            guess, _ = self.contact(moved[0] + ramp[0] * change)
            self.q = moved + ramp * (change - self.modal(guess - now))
            now, self.slip = self.contact(self.q[0])
            spread = (self.seen @ self.q[0][..., None])[..., 0]
            seen[i] = (spread[0].real + 2.0 * spread[1:].real.sum(axis=0)) / N
        return seen

    def modal(self, force: np.ndarray) -> np.ndarray:
        """Modal forces of the nodal diameters."""
        waves = np.fft.rfft(force.reshape(N, 12), axis=0)
        return (self.back @ waves[..., None])[..., 0]


def integrated(load: float, frequency: float, steps: int, periods: int) -> np.ndarray:
    """Harmonic 1 of tip and load point over each period."""
    omega = 2.0 * np.pi * frequency
    annulus = Annulus(2.0 * np.pi / omega / steps)
    found = []
    for period in range(periods):
        times = (period * steps + np.arange(steps + 1)) * (2.0 * np.pi / omega / steps)
        seen = annulus.march(load, omega, times)
        found.append(2.0 / steps * np.exp(-1j * omega * times[1:]) @ seen)
    return np.array(found)


def main() -> int:
    """March, run the program, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "shrouded_disk.md")
    options = parser.parse_args()
    lines = ["", "| load [N] | at [Hz] | what | tip/load [mm/N] | work of the load [mJ] |",
             "|---" * 5 + "|"]
    with tempfile.TemporaryDirectory() as name:
        run = runner(options.build.absolute() / "fw_run", Path(name))
        for load, frequency in POINTS:
            rows = []
            for n in HARMONICS:
                found = run("point", "wave.nml", "sweep%start=1400", f"sweep%end={frequency}",
                            "sweep%n_points=41", "sweep%refine=.false.",
                            f"harmonics%n_harmonics={n}", f"load%harmonic_scale={load}")
                at = int(found.omega.argmin())
                rows.append((f"H = {n}" + ("" if found.converged[at] else ", not converged"),
                             found.harmonic(1, "tip")[at], found.harmonic(1, "load_point")[at]))
            rows.append(("in time", *integrated(load, frequency, 400, 160)[-1]))
            for what, tip, driven in rows:
                lines.append(f"| {load:g} | {frequency:g} | {what} | {abs(tip) / load:.2e} "
                             f"| {-np.pi * load * driven.imag:.2g} |")
                print(lines[-1], flush=True)
    write_section("march", [*lines, ""], options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
