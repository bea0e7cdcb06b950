"""A benchmark of the diagnosis with sealed labels: robots of known causes, and marks for what is said of them."""
