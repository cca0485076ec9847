"""How much memory the doctor takes, reported before it begins."""

from __future__ import annotations

from engine.capture.capture import ONE_PASS_CACHE_BYTES, Capture
from engine.capture.frames import DECODER_BYTES_PER_PIXEL, MAX_DECODER_BYTES
from engine.doctor.picture_survey import BACKGROUND_ROWS, MATCH_WIDTH_PX, frames_to_look_at
from engine.features.matching import matching_bytes
from engine.parallel import n_cores

OWN_BYTES = 230 << 20
"""The program with its libraries and kernels, and what the allocator keeps."""
KEPT_BYTES = 60 << 20
"""Memory that decoding pictures leaves in the libraries that decode them."""
SMALL_BYTES = 200 << 10
"""Memory kept of each picture: small grey ones, and their moving pixels."""


def memory_bytes(capture: Capture) -> int:
    """The most that the process and its child hold at once, roughly: while pictures are read, or matched."""
    sizes = capture.rig.image_sizes
    pixels = sizes.prod(1)
    small = sizes // -(-sizes[:, :1] // MATCH_WIDTH_PX)
    backgrounds = 3 * small.prod(1)
    n_pictures = len(frames_to_look_at(capture.n_frames, len(pixels))[0]) * len(pixels)
    held = OWN_BYTES + 2 * int(backgrounds.sum()) + n_pictures * SMALL_BYTES
    reading = min(int(pixels.sum()) * DECODER_BYTES_PER_PIXEL, MAX_DECODER_BYTES)
    in_work = n_cores() * int(backgrounds.max()) * 2 * len(BACKGROUND_ROWS)
    matching = matching_bytes(len(small), int(small[0, 0]), int(small[0, 1]))
    return held + max(ONE_PASS_CACHE_BYTES + reading + in_work, KEPT_BYTES + matching)
