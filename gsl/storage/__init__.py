"""Files: trajectories, checkpoints, policies, manifests."""
