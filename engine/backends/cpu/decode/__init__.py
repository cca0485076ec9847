"""The fused decode: from the grid to Gaussians in blocks of 64 anchors."""
