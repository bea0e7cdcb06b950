"""What stands between the agent's action and the simulator."""
