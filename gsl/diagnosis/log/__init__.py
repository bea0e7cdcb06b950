"""Trajectories cut into windows, their noise floor, and residuals in units of it."""
