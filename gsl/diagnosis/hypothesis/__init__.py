"""Sets of effects, fitted together with a calibration on one part of a log and scored on the other."""
