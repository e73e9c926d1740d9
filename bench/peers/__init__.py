"""Another program on the same problems."""
