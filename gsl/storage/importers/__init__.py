"""Foreign logs: from files in other people's formats, columns and units to trajectories of the contract."""
