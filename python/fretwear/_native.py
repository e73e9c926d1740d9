"""The compiled part: sessions of the Fortran driver, and its texts and statuses."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import FretwearError, InputError, NotBuiltError, OutputError

if TYPE_CHECKING:
    from .user_law import BoundLaw

__all__ = ["NOT_CONVERGED", "STOPPED", "Session", "functions", "join_texts", "library_version",
           "namelist_values", "raise_status", "routines", "unread_parts"]

OK, USAGE, INPUT, NOT_CONVERGED, IO, STOPPED = 0, 2, 3, 4, 5, 6


def routines() -> Any:
    """The routines of the extension that work on sessions.

    Raises
    ------
    NotBuiltError
        The package stands in a source tree whose extension has not been built.
    """
    try:
        from ._core import fw_python
    except ImportError as error:
        raise NotBuiltError("the compiled part of fretwear cannot be loaded: install the package "
                            "with `pip install .`, or build it and put <build>/python on "
                            f"PYTHONPATH ({error})") from error
    return fw_python


def functions() -> Any:
    """The routines of the extension that are functions of arrays; raises as `routines` does."""
    routines()
    from ._core import fw_python_functions

    return fw_python_functions


def library_version() -> str:
    """Version of the compiled part."""
    return str(routines().library_version().decode().strip())


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


def namelist_values(text: str) -> dict[str, list[str]]:
    """Values by "group%key" as they stand in a namelist, read by the reader of the library.

    Parameters
    ----------
    text : str
        A namelist, such as the one that a result carries; whether it is a case that could run now
        is not asked.

    Raises
    ------
    InputError
        It is no namelist.
    """
    words = _words(routines().parse_namelist, text)
    found: dict[str, list[str]] = {}
    k = 0
    while k < len(words):
        key, n = words[k], int(words[k + 1])
        found[key] = words[k + 2:k + 2 + n]
        k += 2 + n
    return found


def tolerance_of(values: dict[str, list[str]]) -> float:
    """`solver%tolerance` of the values of a namelist, which may have Fortran's exponent `d`."""
    return float(values.get("solver%tolerance", ["1e-8"])[0].lower().replace("d", "e"))


def unread_parts(path: str) -> list[str]:
    """What stands in a model file and nothing reads; raises InputError as a run does."""
    return _words(routines().unread_parts, path)


def _words(ask: Any, text: str) -> list[str]:
    """The words that a routine answers a text with: first how long they are, then the words."""
    given = _bytes(text)
    n, status = ask(given, np.zeros(0, dtype=np.int8))
    buffer = np.zeros(n, dtype=np.int8)
    ask(given, buffer)
    words = buffer.tobytes().decode(errors="surrogateescape").split("\0")[:-1]
    raise_status(status, "".join(words))
    return words


class Session:
    """One case in the library, from reading to running. To be used in a `with` block."""

    def __init__(self, other: Session | None = None) -> None:
        """Empty, or with the case of another session, which is not read again."""
        self._core = routines()
        self._laws: list[BoundLaw] = [] if other is None else list(other._laws)
        self._handle: int | None = (self._core.open_session() if other is None
                                    else self._core.copy_session(other._handle))

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

    def _checked(self, status: int) -> None:
        self.raise_of_laws()
        raise_status(status, self.text("message"))

    # ------------------------------------------------------------------ what it is told

    def new_model(self, n_dof: int, n_pairs: int) -> None:
        """Begin a model in memory, with its parts to follow."""
        self._checked(self._core.new_model(self._handle, n_dof, n_pairs))

    def put(self, name: str, values: NDArray[Any]) -> None:
        """Give real numbers or dof numbers of the model, by their names in a model file.

        No copy is made of arrays whose elements lie in one piece. Matrices are symmetric, so that
        their order does not matter; of the others the last index runs fastest.
        """
        rows_matter = name.startswith(("contact/", "nodal_diameter/", "aero/")) or (
            name in ("coriolis", "circulatory", "stiffness_unsymmetric", "damping_unsymmetric"))
        flat = values.ravel(order="C" if rows_matter else "K")
        put = self._core.put_integers if flat.dtype.kind == "i" else self._core.put_reals
        self._checked(put(self._handle, name, flat))

    def put_texts(self, name: str, texts: Iterable[str]) -> None:
        """Give "title", "unit_system" or "contact/patch"."""
        self._checked(self._core.put_texts(self._handle, name, join_texts(texts)))

    def add_law(self, law: BoundLaw) -> None:
        """Give an element whose forces a function gives; what it raises is raised by the call."""
        self._laws.append(law)
        self._checked(self._core.add_law(self._handle, law.name, law.side_1, law.side_2,
                                         law.parameters, law.start, law.flags,
                                         law.address))

    def raise_of_laws(self) -> None:
        """Raise what a law raised while the library was at work."""
        for law in self._laws:
            if law.raised is not None:
                error, law.raised = law.raised, None
                raise error

    def observe(self, names: Iterable[str], columns: NDArray[np.float64]) -> None:
        """Give observed quantities: names, and a column of factors (n_dof, n_observed)."""
        self._checked(self._core.observe(self._handle, join_texts(names), columns))

    def read(self, text: str, path: str, settings: Iterable[tuple[str, str]]) -> None:
        """Read and validate a namelist with keys set on top; raises what is wrong with it."""
        self._checked(self._core.give_case(
            self._handle, _bytes(text), _bytes(path),
            join_texts(word for setting in settings for word in setting)))
        self._checked(self._core.prepare(self._handle))

    # ------------------------------------------------------------------ what it does

    def check(self) -> None:
        """Raise whatever else would refuse the case before it is computed."""
        self._checked(self._core.check_case(self._handle))

    def run(self, control: NDArray[np.int64], *, in_memory: bool = False) -> int:
        """Run the case. The interpreter lock is released meanwhile.

        Parameters
        ----------
        control : (8,) int64
            Set the first to stop, the last to end a sweep after so many points; the run counts its
            points in the second, of those in the third (0: not known); the others are the bits of
            reals, see `fretwear._progress`.
        in_memory : bool
            Write no result file; `image` has its bytes.

        Returns
        -------
        int
            Status of the library; `text("message")` explains it where the run has failed.
        """
        return int(self._core.run_case(self._handle, control, int(in_memory)))

    def run_piece(self, points: tuple[int, int], lead: int, solved: int,
                  control: NDArray[np.int64]) -> int:
        """Run some points of a sweep in memory and in one thread; see `run`.

        Parameters
        ----------
        points : (int, int)
            First and last, counted from 1.
        lead : int
            Points on the way to the first one.
        solved : int
            The last one that this session has solved, from which it goes on; 0 goes on from the
            start of the sweep.
        control : (8,) int64
            As in `run`.

        Returns
        -------
        int
            Status of the library.
        """
        return int(self._core.run_piece(self._handle, [*points, lead, solved], control))

    def start(self) -> None:
        """Prepare for steps from frequency to frequency."""
        self._checked(self._core.start(self._handle))

    def solve(self, omega: float, control: NDArray[np.int64]) -> None:
        """One step at a frequency [rad/s], from the solutions before it."""
        self._checked(self._core.solve(self._handle, omega, control))

    def frequencies(self) -> NDArray[np.float64]:
        """Frequencies of the sweep [rad/s]."""
        omega = np.zeros(self._core.count_frequencies(self._handle))
        self._checked(self._core.frequencies(self._handle, omega))
        return omega

    # ------------------------------------------------------------------ what it knows

    def text(self, name: str) -> str:
        """'message', 'summary', 'remarks', 'namelist', 'output', 'inputs', 'observed', ..."""
        return self._bytes_of(name).tobytes().decode(errors="surrogateescape")

    def image(self) -> bytes:
        """The result file of the last run in memory; empty where it has not come to a point."""
        return self._bytes_of("image").tobytes()

    def _bytes_of(self, name: str) -> NDArray[np.int8]:
        n = self._core.count_bytes(self._handle, name)
        if n < 0:
            raise KeyError(name)  # a mistake in this package
        buffer = np.zeros(n, dtype=np.int8)
        self._core.get_bytes(self._handle, name, buffer)
        return buffer

    def point(self, name: str) -> NDArray[np.float64]:
        """Numbers of the last step by the name of their dataset, flattened."""
        return self._values("point", name)

    def part(self, name: str) -> NDArray[np.float64]:
        """A part of the effective case, flattened, matrices column by column: "mass",
        "stiffness", "damping" and "load/..." with all that the namelist adds, "contact/side_1",
        "contact/side_2", "contact/gap", "contact/depth", "contact/mu", "observe/matrix",
        "n_springs", "solver_tolerance".
        """
        return self._values("case", name)

    def _values(self, what: str, name: str) -> NDArray[np.float64]:
        n, status = self._core.count_values(self._handle, what, name)
        self._checked(status)
        values = np.zeros(n)
        self._checked(self._core.get_values(self._handle, what, name, values))
        return values
