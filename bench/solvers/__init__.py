"""Every solver from many starts, and from point to point."""
