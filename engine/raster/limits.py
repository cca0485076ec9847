"""The limits of a Gaussian that can be drawn. Both back ends read these, so that they drop the same rows.

A row outside these limits is not drawn and gets a zero gradient; it never touches another row. NaN fails every one
of the comparisons, so none of them needs a test of its own.
"""

VALUE_MAX = 1e30
"""Depth, colour, opacity and entries of the projected covariance stay below this in magnitude."""
EXTENT_MAX_PX = 1e7
"""Half width and half height, in pixels, of the region where a Gaussian's alpha reaches ALPHA_MIN."""
QUAT_NORM_SQUARED_MIN = 1e-24
"""A quaternion shorter than this has no direction. float32 squares of denormals vanish, hence the square."""
QUAT_NORM_SQUARED_MAX = 1e30
"""Beyond this the normalisation would overflow in float32."""
