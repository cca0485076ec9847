"""Pictures that explain what a rasterizer does: how many Gaussians blend in a pixel, and Gaussians as solid bodies."""
