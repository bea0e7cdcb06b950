"""Pure numpy: the mathematics and the data types that every other room uses."""
