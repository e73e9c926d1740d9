"""Figures of the shrouded disk."""
