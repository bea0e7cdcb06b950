"""Data sets of LeRobot as they lie on disk (versions 2.0, 2.1 and 3), read by their format and without its package."""
