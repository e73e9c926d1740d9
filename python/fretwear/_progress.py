"""How far a run or a reduction is: by tqdm in a terminal or a notebook, in one line without it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CONTROL", "WANTED", "Bar", "State", "read_state", "stages"]

#: Numbers that a run and this package share: stop, points done, points to come, of the last point
#: omega [rad/s], largest amplitude, cycles and depth of wear, and how many points are enough (0:
#: all).
CONTROL, WANTED = 8, 7


@dataclass(frozen=True)
class State:
    """Where a run is.

    Attributes
    ----------
    done, total : int
        Points done and points to come (0: not known).
    omega, amplitude, cycles, depth : float
        Of the last point; -1 where there is none.
    """

    done: int
    total: int
    omega: float
    amplitude: float
    cycles: float
    depth: float

    def text(self, *, in_hertz: bool) -> str:
        """Frequency in the unit that was typed, and amplitude; of wear cycles and depth."""
        words = []
        if self.depth >= 0.0 and (self.done or self.cycles > 0.0):
            words = [f"{self.cycles:.4g} cycles", f"depth {self.depth:.4g}"]
        elif self.done:
            words = [f"{self.omega / (2.0 * np.pi):.6g} Hz" if in_hertz
                     else f"{self.omega:.6g} rad/s"]
        if self.amplitude >= 0.0 and self.done:
            words.append(f"amplitude {self.amplitude:.4g}")
        return ", ".join(words)


def read_state(control: NDArray[np.int64]) -> State:
    """The state in the shared numbers."""
    return State(int(control[1]), int(control[2]), *control[3:WANTED].view(np.float64).tolist())


class Bar:
    """Progress on the standard error, or below the cell of a notebook.

    Parameters
    ----------
    in_hertz : bool
        Whether the frequencies of the case are typed in Hz.
    """

    def __init__(self, *, in_hertz: bool) -> None:
        self._in_hertz = in_hertz
        self._bar: Any = None
        self._line: _Line | None = None
        try:
            from tqdm.auto import tqdm
        except ImportError:
            self._line = _Line()
        else:
            self._bar = tqdm(unit=" points", dynamic_ncols=True, leave=True)

    def show(self, state: State) -> None:
        """Show how far the run is, and how long the rest may take."""
        text = state.text(in_hertz=self._in_hertz)
        if self._line is not None:
            self._line.show(state, text)
            return
        self._bar.total = state.total or None
        self._bar.set_postfix_str(text, refresh=False)
        self._bar.update(state.done - self._bar.n)
        self._bar.refresh()

    def end(self) -> None:
        """Leave the last state as it is."""
        if self._line is not None:
            print(file=sys.stderr, flush=True)
        else:
            self._bar.close()


def stages(*, quiet: bool) -> Callable[[str, int, int], None] | None:
    """What tells how far each stage of some work is: None where nobody looks."""
    if quiet or not sys.stderr.isatty():
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return lambda name, done, total: print(
            f"\r{name} {done} of {total}".ljust(40), file=sys.stderr,
            end="\n" if done == total else "", flush=True)
    bars: dict[str, Any] = {}

    def show(name: str, done: int, total: int) -> None:
        if name not in bars:
            for other in list(bars):
                bars.pop(other).close()
            bars[name] = tqdm(desc=name, total=total, dynamic_ncols=True, leave=False, bar_format=(
                "{desc}: {n_fmt} of {total_fmt} |{bar}| {elapsed}<{remaining}"))
        bars[name].update(done - bars[name].n)
        if done == total:
            bars.pop(name).close()

    return show


class _Line:
    """Points done, in one line of the standard error that changes."""

    def __init__(self) -> None:
        self._started, self._width = time.monotonic(), 0

    def show(self, state: State, about: str) -> None:
        passed = time.monotonic() - self._started
        done, total = state.done, state.total
        words = [f"{done} of {total} points" if total else f"{done} points", about,
                 f"{passed:.0f} s"]
        if 0 < done < total:
            words.append(f"{passed / done * (total - done):.0f} s to go")
        text = ", ".join(word for word in words if word)
        print("\r" + text.ljust(self._width), end="", file=sys.stderr, flush=True)
        self._width = len(text)
