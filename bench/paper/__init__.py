"""The tables and figures of the paper on the sector."""
