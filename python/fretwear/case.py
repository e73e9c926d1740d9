"""A case: a model and the settings of its groups, or a namelist."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from ._namelist import by_columns, literal
from ._native import Session
from ._words import where_it_belongs
from .errors import InputError, OutputError
from .model import Model

if TYPE_CHECKING:
    import sys

    from .settings import Groups

    if sys.version_info >= (3, 11):
        from typing import Unpack
    else:
        from typing_extensions import Unpack

__all__ = ["Case"]

#: What a model may be given as: itself, or the path of a model file.
ModelLike = Union[Model, str, "os.PathLike[str]"]


class Case:
    """Everything that one run needs.

    Parameters
    ----------
    model : Model, str or Path
        The structure, or the path of a model file.
    **groups
        Settings by group, such as ``harmonics={"n_harmonics": 5}, contact={"law": "dlft"}``; names
        and meaning as in the namelist (`fretwear.settings`, user guide), the group &model is
        called `structure` here. Texts, numbers, truth values and arrays are taken.

    Notes
    -----
    A case does not change: `replace` makes another one. It is read and checked by the library, when
    `namelist`, `check` or `fretwear.run` is called, and by nothing else.

    Examples
    --------
    >>> case = Case("sector.h5", structure={"modal_damping": 1e-3}, load={"harmonic_scale": 0.5},
    ...             sweep={"start": 1017, "end": 1029, "n_points": 121, "unit": "Hz"})
    >>> finer = case.replace(harmonics={"n_harmonics": 7})
    """

    def __init__(self, model: ModelLike, **groups: Unpack[Groups]) -> None:
        self._text, self._path = "", Path("case")  # for messages: there is no namelist
        self._model: Model | None = None
        self._overrides: tuple[tuple[str, str], ...] = ()
        if isinstance(model, Model):
            self._model = model
        elif isinstance(model, (str, os.PathLike)):
            source: Groups = {"structure": {
                "source": "hdf5", "file": os.path.abspath(os.fspath(model))}}
            self._overrides = tuple(_settings(source))
        else:
            raise InputError(f"model: is a {type(model).__name__}, must be a Model or the path of "
                             "a model file")
        self._overrides += tuple(_settings(groups))

    @classmethod
    def from_text(cls, text: str, path: str | Path = "case.nml", **groups: Unpack[Groups]) -> Case:
        """A case from the text of a namelist.

        Parameters
        ----------
        text : str
            The namelist.
        path : str or Path, optional
            Where it comes from: for messages, for relative paths in it, and for the default name of
            the result file. It need not exist.
        **groups
            Settings that replace those of the namelist.
        """
        if not isinstance(text, str):
            raise InputError(f"text: is a {type(text).__name__}, must be the text of a namelist")
        case = cls.__new__(cls)
        case._text, case._path = text, Path(os.path.abspath(path))
        case._model, case._overrides = None, tuple(_settings(groups))
        return case

    @classmethod
    def from_file(cls, path: str | Path, **groups: Unpack[Groups]) -> Case:
        """A case from a namelist file.

        Parameters
        ----------
        path : str or Path
            The namelist.
        **groups
            Settings that replace those of the namelist.

        Raises
        ------
        OutputError
            The file cannot be read.
        """
        try:
            text = Path(path).read_bytes().decode(errors="surrogateescape")
        except OSError as error:
            raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
        return cls.from_text(text, path, **groups)

    def replace(self, **groups: Unpack[Groups]) -> Case:
        """The same case with other settings."""
        case = type(self).__new__(type(self))
        case._text, case._path, case._model = self._text, self._path, self._model
        case._overrides = self._overrides + tuple(_settings(groups))
        return case

    def overridden(self, texts: Iterable[str]) -> Case:
        """The same case with keys set as `fw_run --set` sets them.

        Parameters
        ----------
        texts : iterable of str
            Such as "sweep%n_points=20".
        """
        case = self.replace()
        for text in texts:
            key, equals, value = text.partition("=")
            if not equals or "%" not in key:
                raise InputError(f"{text!r}: must be group%key=value")
            case._overrides += ((key.strip(), value.strip()),)
        return case

    @property
    def model(self) -> Model | None:
        """The model; None where the case names a file, or is a namelist."""
        return self._model

    @property
    def path(self) -> Path:
        """Where its namelist comes from; it need not exist."""
        return Path(os.path.abspath(self._path))

    @property
    def names_output(self) -> bool:
        """Whether the result file has a place: one that was set, or one beside a namelist."""
        return bool(self._text) or any(key == "output%file" for key, _ in self._overrides)

    def __repr__(self) -> str:
        what = repr(str(self._path)) if self._text else repr(self._model)
        settings = (f"{key}={value}" for key, value in self._overrides)
        return " ".join(["<Case", what, *settings]) + ">"

    def open(self) -> Session:
        """A session with this case, read and validated.

        Raises
        ------
        InputError
            What the library does not accept; the message names group, key and value.
        OutputError
            A file that the case names cannot be read.
        """
        session = Session()
        try:
            settings = () if self._model is None else self._model.give_to(session)
            settings = (*settings, *self._overrides)
            session.read(self._text, os.fspath(self._path), settings)
        except BaseException:
            session.close()
            raise
        return session

    def namelist(self) -> str:
        """The effective input: every key with its value and what it accepts.

        Raises
        ------
        InputError, OutputError
            See `open`.
        """
        with self.open() as session:
            return session.text("namelist")

    def check(self) -> None:
        """Refuse what a run would refuse before it computes; nothing is written.

        Raises
        ------
        InputError, OutputError
            See `open`.
        """
        with self.open() as session:
            session.check()


def _settings(groups: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Settings as the library takes them: group%key, and a value as a namelist has it."""
    for group, keys in groups.items():
        if not isinstance(keys, Mapping):
            raise InputError(f"{group}: " + (where_it_belongs(group) or (
                f"is a {type(keys).__name__}, must be a dictionary of the keys of the group, such "
                f"as {group}={{'key': value}}")))
        name = "model" if group == "structure" else group
        for key, value in keys.items():
            yield f"{name}%{key}", literal(by_columns(key, value), f"{group}[{key!r}]")

