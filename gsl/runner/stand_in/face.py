"""gsl beside a robot: its names for Python are left out."""
