"""How large and how small the numbers of a capture may be. Wider than any real one; what lies beyond is a mistake."""

from __future__ import annotations

MAX_SIDE = 16_384
"""Width and height of a picture, pixels."""
MAX_PIXELS = 80_000_000
"""Pixels of one picture; 12K video has 79.6 million."""
FPS_RANGE = (1e-4, 1e4)
"""Frames per second: from one in some hours to the fastest cameras."""
FOCAL_RANGE = (0.01, 1000.0)
"""Focal length divided by the side of the picture: from 178 degrees of view to a twentieth of one."""
MAX_POSITION = 1e9
"""Distance of a camera from the origin, scene units; map coordinates in millimetres reach it."""
MAX_CAMERA_ID = 10**9
MAX_NAME_LENGTH = 100
"""Characters of a camera's name."""
MAX_META_BYTES = 256 << 20
"""Size of a file with calibration: Panoptic lists each camera anew for each frame, half a kilobyte at a time."""
MAX_META_VALUES = 6_000_000
"""Numbers and texts in such a file: each takes up to thirty bytes once it is read. Panoptic's 31 cameras reach it after
6,000 frames."""
