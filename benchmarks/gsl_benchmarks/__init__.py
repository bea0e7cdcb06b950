"""What gsl costs, and what a coarser engine changes."""
