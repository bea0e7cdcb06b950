"""What leaves gsl: simulators, learned servos and trajectories in the formats of other tools."""
