"""What we want of a body: reward, end of the episode."""
