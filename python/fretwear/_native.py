"""The compiled part: sessions of the Fortran driver, and its texts and statuses."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import FretwearError, InputError, OutputError

__all__ = ["NOT_CONVERGED", "STOPPED", "Session", "join_texts", "raise_status", "routines"]

OK, USAGE, INPUT, NOT_CONVERGED, IO, STOPPED = 0, 2, 3, 4, 5, 6

#: What messages put before a setting that was given as an argument.
_ORIGIN = b"argument"


def routines() -> Any:
    """The routines of the extension.

    Raises
    ------
    ImportError
        The package stands in a source tree whose extension has not been built.
    """
    try:
        from ._core import fw_python
    except ImportError as error:
        raise ImportError("the compiled part of fretwear cannot be loaded: install the package "
                          "with `pip install .`, or build it and put <build>/python on "
                          f"PYTHONPATH ({error})") from error
    return fw_python


def raise_status(status: int, message: str) -> None:
    """Raise what a status of the library stands for; nothing for success."""
    if status in (USAGE, INPUT):
        raise InputError(message)
    if status == IO:
        raise OutputError(message)
    if status != OK:
        raise FretwearError(message)


def join_texts(texts: Iterable[str]) -> NDArray[np.int8]:
    """A list of texts as the extension takes it, every text ended by a null byte."""
    return _bytes("".join(text + "\0" for text in texts))


def _bytes(text: str) -> NDArray[np.int8]:
    return np.frombuffer(text.encode(errors="surrogateescape"), dtype=np.int8)


class Session:
    """One case in the library, from reading to running. To be used in a `with` block."""

    def __init__(self) -> None:
        self._core = routines()
        self._handle: int | None = self._core.open_session()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Free what the library holds."""
        if self._handle is not None:
            self._core.close_session(self._handle)
            self._handle = None

    def text(self, name: str) -> str:
        """'message', 'summary', 'remarks', 'namelist' or 'output'."""
        buffer = np.zeros(self._core.text_length(self._handle, name), dtype=np.int8)
        self._core.fetch_text(self._handle, name, buffer)
        return buffer.tobytes().decode(errors="surrogateescape")

    def give_matrix(self, name: str, values: NDArray[np.float64]) -> None:
        """Hand over a Fortran-ordered matrix of the model."""
        self._core.give_matrix(self._handle, name, values)

    def give_vector(self, name: str, values: NDArray[np.float64]) -> None:
        """Hand over values per pair or dof."""
        self._core.give_vector(self._handle, name, values)

    def give_sides(self, side_1: NDArray[np.int32], side_2: NDArray[np.int32]) -> None:
        """Hand over the contact pairs, C-ordered (n_pairs, 3)."""
        self._core.give_sides(self._handle, side_1.T, side_2.T)

    def give_text(self, name: str, text: str) -> None:
        """Hand over the title."""
        self._core.give_text(self._handle, name, _bytes(text))

    def give_texts(self, name: str, texts: Iterable[str]) -> None:
        """Hand over a list of names."""
        self._core.give_text(self._handle, name, join_texts(texts))

    def read(self, text: str, path: str, overrides: Iterable[str]) -> None:
        """Read and validate a case; raises what is wrong with it."""
        status = self._core.read_case(self._handle, _bytes(text), _bytes(path),
                                      join_texts(overrides), _ORIGIN)
        raise_status(status, self.text("message"))

    def check(self) -> None:
        """Raise whatever else would refuse the case before it is computed."""
        raise_status(self._core.check_case(self._handle), self.text("message"))

    def run(self, control: NDArray[np.int64]) -> int:
        """Run the case. The interpreter lock is released meanwhile.

        Parameters
        ----------
        control : (3,) int64
            Set the first to stop after the present point; the run counts its points in the
            second, of those in the third (0: not known).

        Returns
        -------
        int
            Status of the library; `text("message")` explains it where the run has failed.
        """
        return int(self._core.run_case(self._handle, control))
