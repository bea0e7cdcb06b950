"""Which set of effects explains a log."""
