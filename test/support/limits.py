"""Limits of time of the tests, by the clock: what takes longer hangs."""
import os

#: How many times longer than an optimised build the build under test may take.
SLOWER = float(os.environ.get("FW_SLOWER", "1"))


def limit(seconds):
    """Seconds that an optimised build may take, for the build under test."""
    return SLOWER * seconds
