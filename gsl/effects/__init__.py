"""What a simulator leaves out: one effect, one file."""
