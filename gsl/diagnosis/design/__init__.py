"""The motions that best separate what a log leaves open."""
