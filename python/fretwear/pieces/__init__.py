"""A natural sweep by many workers: cut into overlapping pieces, solved at once, joined."""

from .running import run_in_pieces

__all__ = ["run_in_pieces"]
