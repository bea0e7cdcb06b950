"""What acts: parameters and a pure step from observation to action."""
