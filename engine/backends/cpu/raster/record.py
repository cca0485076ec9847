"""The 64-byte record of one projected Gaussian, and the numbers all kernels agree on.

A record is one cache line of sixteen 4-byte fields, so that blending a Gaussian into a tile costs one memory access.
The footprint is stored as a Cholesky form that cannot cancel: with dx, dy from the centre,

    log2(alpha) / 8 = log_opacity - (u^2 + v^2),   u = root_major * (dx + slope * dy),   v = root_minor * dy

which stays exact for needles, where the textbook conic a dx^2 + 2 b dx dy + c dy^2 loses every digit. The eighth of a
binary logarithm is the argument of `exp2_eighth`: a polynomial on a unit interval, squared three times.
"""

from __future__ import annotations

import math

import numpy as np

from engine.conventions import ALPHA_MIN
from engine.kernels.fast_math import fast_math
from engine.raster.pinhole_view import TILE_PX

CENTER_X, CENTER_Y, ROOT_MAJOR, SLOPE, ROOT_MINOR, LOG_OPACITY, RED = range(7)
GREEN, BLUE, REACH, TILT, HALF_WIDTH, HALF_HEIGHT, INVERSE_ROOT = range(7, 14)
"""Columns of a record. Centre and half extents in pixels; REACH = log_opacity - LOG_ALPHA_MIN is the value of the
quadratic form at the rim; TILT = cov_xy / cov_xx gives the height at which the ellipse is widest; INVERSE_ROOT is
1 / ROOT_MAJOR."""
TILE_COLUMNS, TILE_ROWS = 14, 15
"""int32 columns: first and last tile column (row) the bounding box touches, first | last << 16."""
RECORD_FLOATS = 16
RECORD_BYTES = 64

TILE = TILE_PX
"""Edge of a tile, pixels. Large tiles win because blocks inside them are culled."""
BLOCK = 4
"""Edge of a block, pixels: one block is one vector."""
BLOCKS_PER_ROW = TILE // BLOCK
BLOCKS = BLOCKS_PER_ROW * BLOCKS_PER_ROW
"""64, so that the blocks of a tile fit the bits of one integer."""

EIGHTH_LOG = 0.5 / math.log(2.0) / 8.0
"""Turns a squared Mahalanobis distance into an eighth of a binary logarithm."""
LOG_ALPHA_MIN = math.log2(ALPHA_MIN) / 8.0

EXP2_EIGHTH = (0.9999999251, 0.6931422525, 0.2401721884, 0.05527972023, 0.009188609153, 0.0009387873374)
"""Minimax polynomial of 2^x on [-1, 0], constant term first; to the 8th power the relative error is 6e-7."""

PAIR_FLOATS = 9
"""Floats of a row of the pair buffer, one per sum. Rows are read sixteen floats wide, so the buffer has a row more."""

FASTMATH = fast_math("nsz", "contract", "arcp", "afn", "reassoc")
"""NaN and infinity must keep their meaning: rows are dropped by comparisons that NaN fails."""
KERNEL_OPTIONS = {
    "fastmath": FASTMATH,
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
}
"""Options of every kernel that is not a routine."""

f4 = np.float32
