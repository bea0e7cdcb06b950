"""What a simulator with other effects and another calibration answers to the commands of a log."""
