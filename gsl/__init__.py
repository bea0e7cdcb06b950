"""gsl: grounded simulation learning, from a few real trajectories to a policy that works on the robot."""

__version__ = "0.1.0"
