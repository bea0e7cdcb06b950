"""Wiring before physics: what is wrong between robot, log and simulator that no effect of physics could do."""
