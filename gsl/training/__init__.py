"""Fitting models to trajectories."""
