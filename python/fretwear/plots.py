"""Pictures of result files (format "fretwear-result").

    python -m fretwear.plots result.h5 -o out.png [--linear stuck.h5] [--observe NAME]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

__all__ = ["Response", "friction_damping", "half_power_damping", "main", "plot_response",
           "read_response"]

Floats = NDArray[np.float64]
_STATES = (("stick", "#4c78a8"), ("slip", "#f58518"), ("open", "#b8b8b8"))


@dataclass(frozen=True)
class Response:
    """Frequency response of one observed quantity.

    Attributes
    ----------
    name : str
        Observed quantity.
    frequency : (n_points,)
        [Hz]
    amplitude : (n_points,)
        Largest absolute value over the period, in the units of the model.
    converged : (n_points,) bool
        Points that did not converge carry no valid amplitude.
    fraction : (n_points, 3) or None
        Stick, slip and open fractions averaged over the pairs.
    dissipation : (n_points,) or None
        Friction loss per cycle summed over the pairs.
    """

    name: str
    frequency: Floats
    amplitude: Floats
    converged: NDArray[np.bool_]
    fraction: Floats | None = None
    dissipation: Floats | None = None

    @property
    def peak(self) -> int:
        """Number (from 0) of the converged point of largest amplitude."""
        valid = self.converged & np.isfinite(self.amplitude)
        if not valid.any():
            raise ValueError(f"no converged point observes '{self.name}'")
        return int(np.argmax(np.where(valid, self.amplitude, -np.inf)))


def read_response(path: str | Path, observe: str | None = None) -> Response:
    """Read the response of one observed quantity from a result file.

    Parameters
    ----------
    path : str or Path
        Result file.
    observe : str, optional
        Name of the quantity; the first one without it.
    """
    with h5py.File(path, "r") as file:
        kind = file.attrs.get("format", b"")
        kind = kind.decode() if isinstance(kind, bytes) else str(kind)
        if kind.strip() != "fretwear-result":
            raise ValueError(f"{path}: format is '{kind}', expected 'fretwear-result'")
        for name in ("omega", "amplitude", "converged", "observed/name"):
            if name not in file:
                raise ValueError(f"{path}: dataset /{name} is missing (only sweeps can be plotted)")
        names = [text.decode().strip() for text in file["observed/name"][()]]
        wanted = names[0] if observe is None else observe
        if wanted not in names:
            raise ValueError(f"{path}: '{wanted}' is not observed; available: {', '.join(names)}")
        fraction = file["contact/fraction"][()] if "contact/fraction" in file else None
        loss = file["contact/dissipation"][()] if "contact/dissipation" in file else None
        return Response(
            wanted, file["omega"][()] / (2.0 * np.pi), file["amplitude"][:, names.index(wanted)],
            file["converged"][()].astype(bool),
            None if fraction is None else fraction.mean(axis=1),
            None if loss is None else loss.sum(axis=1))


def half_power_damping(response: Response) -> float:
    """Damping ratio (f2 - f1) / (2 f_peak) from the width of the peak at 1/sqrt(2) of its height.

    Exact for a lightly damped linear mode; for a friction peak it is the viscous damping that
    gives a peak of the same width. The flanks are interpolated linearly between converged points,
    so the sweep must resolve the peak. NaN where it does not reach the level on both sides.
    """
    keep = response.converged & np.isfinite(response.amplitude)
    order = np.argsort(response.frequency[keep], kind="stable")
    f, a = response.frequency[keep][order], response.amplitude[keep][order]
    top = int(np.argmax(a))
    level = a[top] / np.sqrt(2.0)
    below = np.flatnonzero(a < level)
    left, right = below[below < top], below[below > top]
    if not (left.size and right.size):
        return float("nan")
    i, j = left[-1], right[0]
    lower = f[i] + (level - a[i]) / (a[i + 1] - a[i]) * (f[i + 1] - f[i])
    upper = f[j - 1] + (level - a[j - 1]) / (a[j] - a[j - 1]) * (f[j] - f[j - 1])
    return float((upper - lower) / (2.0 * f[top]))


def friction_damping(response: Response, linear: Response | None = None, *,
                     modal_mass: float | None = None) -> float | None:
    """Equivalent damping ratio of friction at the peak.

    With a modal mass m (of the mode, scaled to 1 at the observed quantity), it is
    ``D / (4 pi E)`` where D is the sum of /contact/dissipation over the pairs at the peak and
    ``E = m (omega A)^2 / 2`` the energy of the motion of amplitude A.

    Otherwise, with the stuck (linear) result under the same force: a mode at its peak obeys
    ``force = 2 zeta m omega^2 A``, so the total damping ratio is
    ``zeta_linear (omega_linear^2 A_linear) / (omega^2 A)``, and friction gives what exceeds
    zeta_linear, the half-power damping of the stuck peak.

    Parameters
    ----------
    response, linear : Response
        Response with friction and with every pair stuck.
    modal_mass : float, optional
        Modal mass in the units of the model.

    Returns
    -------
    float or None
        Damping ratio [-]; None where neither definition can be evaluated.
    """
    peak = response.peak
    omega, amplitude = 2.0 * np.pi * response.frequency[peak], response.amplitude[peak]
    if modal_mass is not None and response.dissipation is not None:
        energy = 0.5 * modal_mass * (omega * amplitude) ** 2
        return float(response.dissipation[peak] / (4.0 * np.pi * energy))
    if linear is None:
        return None
    stuck, at = half_power_damping(linear), linear.peak
    ratio = linear.frequency[at] / response.frequency[peak]
    extra = stuck * (ratio**2 * linear.amplitude[at] / amplitude - 1.0)
    return float(extra) if np.isfinite(extra) else None


def plot_response(result_path: str | Path, out_png: str | Path, linear: str | Path | None = None,
                  *, observe: str | None = None, modal_mass: float | None = None) -> None:
    """Plot amplitude and contact states against frequency.

    The upper panel shows the amplitude with the peak annotated: its shift from the stuck peak and
    the equivalent damping ratio of friction as ``friction_damping`` defines it (half-power damping
    of the whole peak where that cannot be evaluated). Points that did not converge are crosses.
    The lower panel shows stick, slip and open fractions, averaged over the pairs.

    Parameters
    ----------
    result_path : str or Path
        Result file of a sweep.
    out_png : str or Path
        Picture to write; the suffix decides on the format.
    linear : str or Path, optional
        Result file of the same sweep with every pair stuck, drawn dashed.
    observe : str, optional
        Observed quantity; the first of the file without it.
    modal_mass : float, optional
        See ``friction_damping``.
    """
    response = read_response(result_path, observe)
    stuck = None if linear is None else read_response(linear, response.name)
    figure = Figure(figsize=(8.0, 6.4 if response.fraction is not None else 4.4), dpi=130,
                    layout="constrained")
    if response.fraction is None:
        upper = lower = figure.subplots()
    else:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
        _draw_states(lower, response)
    _draw_amplitude(upper, response, stuck)
    _annotate_peak(upper, response, stuck, modal_mass)
    lower.set_xlabel("frequency [Hz]")
    figure.savefig(out_png)


def _draw_amplitude(axes: Axes, response: Response, stuck: Response | None) -> None:
    """Curves in the order computed, so that a fold of the branch shows as one."""
    if stuck is not None:
        axes.plot(stuck.frequency, np.where(stuck.converged, stuck.amplitude, np.nan), "--",
                  color="0.45", linewidth=1.3, label="stuck (linear)")
    good = np.where(response.converged, response.amplitude, np.nan)
    axes.plot(response.frequency, good, "-", marker=".", markersize=3.5, color="#1f4e79",
              linewidth=1.6, label="friction contact")
    bad = ~response.converged
    if bad.any():
        height = np.where(np.isfinite(response.amplitude), response.amplitude, 0.0)
        # A failed point may hold anything: kept inside the picture of the valid ones.
        height = np.clip(height, 0.0, np.nanmax(good, initial=0.0))
        axes.plot(response.frequency[bad], height[bad], "x", color="#c0392b", markersize=6,
                  label=f"not converged ({bad.sum()})")
    axes.set_ylabel(f"amplitude of {response.name}")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, loc="upper left")


def _annotate_peak(axes: Axes, response: Response, stuck: Response | None,
                   modal_mass: float | None) -> None:
    peak = response.peak
    f, a = response.frequency[peak], response.amplitude[peak]
    lines = [f"peak {a:.4g} at {f:.2f} Hz"]
    if stuck is not None:
        shift = 100.0 * (f / stuck.frequency[stuck.peak] - 1.0)
        lines.append(f"shift {shift:+.3f} %")
    damping = friction_damping(response, stuck, modal_mass=modal_mass)
    if damping is not None:
        lines.append(f"friction damping {100.0 * damping:.4f} %")
    elif np.isfinite(width := half_power_damping(response)):
        lines.append(f"half-power damping {100.0 * width:.4f} %")
    axes.plot(f, a, "o", color="#1f4e79", markersize=6)
    axes.text(0.985, 0.97, "\n".join(lines), transform=axes.transAxes, ha="right", va="top",
              bbox={"boxstyle": "round", "facecolor": "white", "edgecolor": "0.8"})


def _draw_states(axes: Axes, response: Response) -> None:
    assert response.fraction is not None  # the caller made room for this panel
    # A stack needs ascending abscissae; failed points leave no state to show.
    keep = np.flatnonzero(response.converged)
    keep = keep[np.argsort(response.frequency[keep], kind="stable")]
    axes.stackplot(response.frequency[keep], response.fraction[keep].T,
                   labels=[name for name, _ in _STATES], colors=[colour for _, colour in _STATES],
                   alpha=0.9)
    axes.set(ylim=(0.0, 1.0), ylabel="fraction of pairs\nand period")
    axes.margins(x=0.0)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def main(arguments: list[str] | None = None) -> int:
    """Command line; exit status 0 done, 2 usage, 3 file not accepted, 5 input or output failed."""
    parser = argparse.ArgumentParser(prog="python -m fretwear.plots", allow_abbrev=False,
                                     description="Plot the frequency response of a result file.")
    parser.add_argument("result", help="result file of a sweep")
    parser.add_argument("-o", "--output", required=True, metavar="PNG", help="picture to write")
    parser.add_argument("--linear", metavar="FILE", help="stuck result, drawn dashed")
    parser.add_argument("--observe", metavar="NAME", help="observed quantity (default: the first)")
    parser.add_argument("--modal-mass", type=float, metavar="M",
                        help="modal mass at the observed quantity: damping from the dissipation")
    options = parser.parse_args(arguments)
    try:
        plot_response(options.result, options.output, options.linear, observe=options.observe,
                      modal_mass=options.modal_mass)
    except ValueError as error:
        print(f"fretwear.plots: {error}", file=sys.stderr)
        return 3
    except OSError as error:
        print(f"fretwear.plots: {error}", file=sys.stderr)
        return 5
    return 0


if __name__ == "__main__":
    sys.exit(main())
