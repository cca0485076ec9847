"""Selecting: which Gaussians a shape, a volume, a range or a click means. Arrays in, one bool per Gaussian out; what is
not finite is never selected."""
