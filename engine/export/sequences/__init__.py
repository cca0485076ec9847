"""Files that hold a whole sequence of Gaussians: one file over time."""
