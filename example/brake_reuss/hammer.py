"""The hammer record beside what was predicted of it.

    python hammer.py HammerImpact.mat [--document docs/brake_reuss.md]

Peaks of the decay after the blow, of three accelerometers together; frequency and damping of each
by its own band, where the motion is large and where it has fallen.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

from fretwear.beam import BeamParameters, generate

__all__ = ["Peak", "main", "peaks"]

ROOT = Path(__file__).resolve().parents[2]
CHANNELS = ("acc1", "acc2", "acc3")
#: Peaks are looked for below [Hz], 15 dB above what is around, so far from each other [Hz].
HIGHEST, PROMINENCE, APART = 2000.0, 15.0, 10.0
#: Half width of the band of a peak, relative.
BAND = 0.03
#: Decades of the envelope between which large and small motion are told.
LARGE, SMALL = (0.8, 0.3), (0.1, 0.03)


@dataclass(frozen=True)
class Peak:
    """A resonance of the decay: frequencies [Hz] and damping ratios at large and small motion, and
    its largest acceleration [m/s^2] on any channel."""

    frequency: tuple[float, float]
    damping: tuple[float, float]
    acceleration: float


def peaks(time: np.ndarray, channels: np.ndarray) -> list[Peak]:
    """Of channels (n, n_instants)."""
    signal = import_module("scipy.signal")
    step = float(time[1] - time[0])
    start = int(np.abs(channels[0]).argmax())
    decay = channels[:, start:start + int(1.0 / step)]
    n = decay.shape[1]
    window = np.exp(-3.0 * np.arange(n) / n)
    spectrum = np.sqrt((np.abs(np.fft.rfft(decay * window, 8 * n))**2).sum(axis=0))
    frequency = np.fft.rfftfreq(8 * n, step)
    spacing = int(APART / (frequency[1] - frequency[0]))
    found, _ = signal.find_peaks(20.0 * np.log10(spectrum), prominence=PROMINENCE,
                                 distance=spacing)
    return [_decay(time, channels, start, float(frequency[k])) for k in found
            if 20.0 < frequency[k] < HIGHEST]


def _decay(time: np.ndarray, channels: np.ndarray, start: int, frequency: float) -> Peak:
    """By the envelope and the phase of the band around a peak, on its largest channel."""
    signal = import_module("scipy.signal")
    step = float(time[1] - time[0])
    section = signal.butter(2, [(1.0 - BAND) * frequency, (1.0 + BAND) * frequency], "bandpass",
                            fs=1.0 / step, output="sos")
    bands = signal.hilbert(signal.sosfiltfilt(section, channels, axis=1), axis=1)
    own = bands[int(np.abs(bands).max(axis=1).argmax())]
    # The filter rings before the blow too; behind it the motion decays.
    top = int(np.abs(own).argmax())
    size = np.log(np.abs(own[top:]) / np.abs(own[top]))
    phase = np.unwrap(np.angle(own[top:]))
    values = []
    for high, low in (LARGE, SMALL):
        first = int(np.flatnonzero(size < np.log(high))[0])
        last = int(np.flatnonzero(size < np.log(low))[0])
        at = time[top:][first:last] - time[top]
        rate = -np.polyfit(at, size[first:last], 1)[0] if last - first > 8 else np.nan
        omega = np.polyfit(at, phase[first:last], 1)[0] if last - first > 8 else np.nan
        values.append((omega / (2.0 * np.pi), rate / omega))
    return Peak((values[0][0], values[1][0]), (values[0][1], values[1][1]),
                float(np.abs(own[top])))


def table(path: Path) -> list[str]:
    """Peaks beside the nearest predicted mode."""
    data = import_module("scipy.io").loadmat(path, simplify_cells=True)["HIdata"]
    predicted = generate(BeamParameters()).modes(6)[0]
    found = peaks(np.asarray(data["time"]), np.array([data[name] for name in CHANNELS]))
    lines = ["| peak, large motion [Hz] | small motion [Hz] | damping [1e-3], large | small | "
             "largest acceleration [m/s^2] | nearest predicted mode | prediction over peak |",
             "|---|---|---|---|---|---|---|"]
    for one in found:
        k = int(np.abs(np.log(predicted / one.frequency[1])).argmin())
        lines.append(
            f"| {one.frequency[0]:.1f} | {one.frequency[1]:.1f} | {1e3 * one.damping[0]:.2f} | "
            f"{1e3 * one.damping[1]:.2f} | {one.acceleration:.0f} | {k + 1}: {predicted[k]:.1f} Hz "
            f"| {100 * (predicted[k] / one.frequency[1] - 1.0):+.1f} % |")
    return ["", *lines, ""]


def main() -> int:
    """Read, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("record", type=Path, help="HammerImpact.mat")
    parser.add_argument("--document", type=Path)
    options = parser.parse_args()
    lines = table(options.record)
    print("\n".join(lines))
    if options.document is not None:
        sys.path.insert(0, str(ROOT / "test" / "support"))
        from sections import write_section
        write_section("hammer", lines, options.document)
    return 0


if __name__ == "__main__":
    sys.exit(main())
