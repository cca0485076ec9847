"""View modes: which values Gaussians and pictures show, and in which colours."""
