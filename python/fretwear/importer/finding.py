"""What a check has found."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Finding"]


@dataclass(frozen=True)
class Finding:
    """One thing found.

    Attributes
    ----------
    kind : {'error', 'warning', 'note'}
    where : str
        Matrix, entry, or line of a table.
    text : str
        What is there and what to do.
    """

    kind: str
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.where}: {self.text}"
