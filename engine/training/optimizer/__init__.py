"""Learning rates, their schedule, and clipping of gradients."""
