"""What improves a policy's parameters."""
