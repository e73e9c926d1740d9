"""A natural sweep by many workers: cut into overlapping pieces, solved at once or one by one, and
joined."""

from .files import Share, join_files, run_share
from .running import run_in_pieces

__all__ = ["Share", "join_files", "run_in_pieces", "run_share"]
