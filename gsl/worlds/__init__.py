"""Bodies to act on, as gymnasium environments."""
