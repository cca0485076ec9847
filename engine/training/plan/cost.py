"""What a clip costs: milliseconds of a step, seconds of preparation, memory, bytes on disk, from the sizes of the clip.

A few coefficients, fitted by hand to trainings of two captures: the sample (320x240, 18 cameras) and the basketball
(640x360, 27 cameras), clips of ten frames, two shared cores of an AMD EPYC (Zen 5). Measured there: static step 12 and
18 ms, joint step 15 and 28 ms, source step with active tiles 17 to 18 ms on the basketball. Both captures lie within
a factor of 1.5 of every figure; sizes far beyond them are extrapolated. Another machine is slower or faster as a whole,
which is a factor on all times (`engine.training.plan.forecasting`). No torch, no clock.
"""

from __future__ import annotations

from dataclasses import dataclass

# a step
_STEP_MS = 1.5
"""What a step takes whatever its size: autograd, calls of kernels."""
_PIXEL_MS = 14e-6
"""Of a pixel: loss, and what the rasterizer does for every tile."""
_SEEN = 0.6
"""Share of the static anchors that a camera sees."""
_GAUSSIAN_MS = 115e-6
"""Of a Gaussian: projection, sorting, blending, and back."""
_DECODE_MS, _HEADS_MS, _FIELD_MS = 250e-6, 250e-6, 50e-6
"""Of an anchor: rows in and out; the heads at the default sizes; the field where there is one."""
_HEADS_PRODUCTS = 12_672
"""Multiply-adds of the heads of one anchor at the default sizes."""
_TABLE_VALUE_MS = 1e-6
"""Of a value of the field's tables: the optimiser touches every one."""
_FORWARD = 0.6
"""Share of an anchor's cost that remains when it is frozen."""
_ACTIVE = 0.55
"""Share of the frozen part of a picture that active tiles leave to be drawn."""

# preparation
_START_S = {True: 1.2, False: 2.0}
"""Imports, kernels loaded from the cache, by whether it is a source clip."""
_CARVE_S = 1.6
_CAMERA_S = 0.38
"""Of a camera where static anchors are built: features, depth sweep, fusion. They work at a size of their own."""
_BACKGROUND_FRAME_S, _BACKGROUND_PIXEL_S = 3.5e-3, 5e-9
_PICTURE_S = 3e-3
_PICTURE_PIXEL_S = {True: 13e-9, False: 45e-9}
"""Reading, masks; a reference clip also looks at its backgrounds again."""

# memory
_PROGRAM_MB = 630.0
"""Python, torch, numba and compiled kernels."""
CACHE_MB = 537.0
"""Decoded pictures that a capture keeps at most, see engine.capture.capture."""

# storage
_REFERENCE_VALUE_BYTES, _SOURCE_VALUE_BYTES = 1.6, 0.54
"""Of a stored value of an anchor, position, colour and presence included."""
_HEADS_BYTES = 2
"""Of a weight of the heads, where the clip has its own."""
_ANCHOR_VALUES = 9
"""Values of an anchor beside its feature."""
_FIELD_BYTES, _TABLE_VALUE_BYTES = 80e3, 0.2
"""Of a field: its network, header and presence of anchors; of a value of its tables, most of which nobody reads."""
_NOTHING_BYTES = 8e3
"""A clip that stores its header and the presence of inherited anchors alone."""


@dataclass(frozen=True, slots=True)
class ClipSizes:
    """What the cost of a clip follows from.

    Attributes:
        n_pixels: Of one picture.
        n_cameras: Training cameras.
        n_frames: Of the clip.
        n_background_frames: Per camera.
        n_static: Static anchors, inherited ones too.
        n_moving: Moving anchors of the clip's own, over all of its frames.
        n_alive: Most moving anchors in one frame, inherited ones too.
        n_table_values: Values in the tables of the field; 0 without one.
        gaussians_per_anchor: K.
        feature_dim: Width of the static feature.
        n_products: Multiply-adds of the heads of one anchor.
        is_source: Whether the clip inherits: there is one phase, and preparation is short.
        is_frozen: Whether static anchors and heads are kept as they are, as in a source clip.
        owns_static: Whether static anchors are the clip's own to store: in a reference clip, or where they learn on.
        is_built: Whether they are built from the clip's own depth maps.
        has_gate: Whether static anchors stay out of the field; else every anchor is alive at every time.
        has_active_tiles: Whether only active tiles are drawn.
    """

    n_pixels: int
    n_cameras: int
    n_frames: int
    n_background_frames: int
    n_static: int
    n_moving: int
    n_alive: int
    n_table_values: int
    gaussians_per_anchor: int
    feature_dim: int
    n_products: int
    is_source: bool
    is_frozen: bool
    owns_static: bool
    is_built: bool
    has_gate: bool
    has_active_tiles: bool

    @property
    def n_pictures(self) -> int:
        """Training pictures."""
        return self.n_cameras * self.n_frames

    @property
    def pictures_mb(self) -> float:
        """All training pictures of the clip, 3 bytes a pixel."""
        return self.n_pictures * self.n_pixels * 3 / 1e6


def n_products(*, static_dim: int, dynamic_dim: int, hidden: int, gaussians_per_anchor: int) -> int:
    """Multiply-adds of the four heads for one anchor."""
    return 4 * (static_dim + dynamic_dim) * hidden + hidden * gaussians_per_anchor * 14


def step_ms(phase: str, sizes: ClipSizes) -> float:
    """Milliseconds of one step, in the mean of a phase.

    Args:
        phase: "static", "joint" or "source".
        sizes: Of the clip.
    """
    gaussians = sizes.gaussians_per_anchor * _GAUSSIAN_MS
    heads = _DECODE_MS + _HEADS_MS * sizes.n_products / _HEADS_PRODUCTS
    n_still = sizes.n_static if sizes.has_gate or phase == "static" else 0
    still = n_still * _SEEN * (heads + gaussians) * (_FORWARD if sizes.is_frozen else 1.0)
    picture = sizes.n_pixels * _PIXEL_MS + still
    if phase == "static":
        return _STEP_MS + picture
    if sizes.has_active_tiles:
        picture *= _ACTIVE
    moving = sizes.n_alive * (heads + _FIELD_MS + gaussians)
    return _STEP_MS + picture + moving + sizes.n_table_values * _TABLE_VALUE_MS


def preparation_s(sizes: ClipSizes) -> float:
    """Seconds before the first step, and between the phases of a reference clip. Kernels are compiled."""
    is_source = sizes.is_source
    seconds = _START_S[is_source] + _CARVE_S
    seconds += sizes.n_pictures * (_PICTURE_S + sizes.n_pixels * _PICTURE_PIXEL_S[is_source])
    if sizes.is_built:
        seconds += sizes.n_cameras * _CAMERA_S
    if is_source:  # the backgrounds are there
        return seconds
    n_frames = sizes.n_cameras * sizes.n_background_frames
    return seconds + n_frames * (_BACKGROUND_FRAME_S + sizes.n_pixels * _BACKGROUND_PIXEL_S)


def memory_mb(sizes: ClipSizes) -> float:
    """Most memory that the training process holds, 10^6 bytes."""
    read_mb = sizes.pictures_mb
    if not sizes.is_source:  # backgrounds are estimated from frames of the whole capture
        read_mb = max(read_mb, sizes.n_cameras * sizes.n_background_frames * sizes.n_pixels * 3 / 1e6)
    tiles_mb = sizes.n_cameras * sizes.n_pixels * 16 / 1e6 if sizes.has_active_tiles else 0.0
    return _PROGRAM_MB + sizes.pictures_mb + min(read_mb, CACHE_MB) + tiles_mb + 2 * checkpoint_mb(sizes)


def checkpoint_mb(sizes: ClipSizes) -> float:
    """What a training keeps to go on from, 10^6 bytes: parameters with two moments each, and the backgrounds."""
    learning = sizes.n_moving + (sizes.n_static if sizes.owns_static else 0)
    n_values = learning * (sizes.feature_dim + 6) + sizes.n_table_values
    return (12 * n_values + 3.125 * sizes.n_cameras * sizes.n_pixels) / 1e6


def disk_mb(sizes: ClipSizes) -> float:
    """The finished clip as it is stored, 10^6 bytes."""
    n_values = (sizes.n_moving + (sizes.n_static if sizes.owns_static else 0)) * (sizes.feature_dim + _ANCHOR_VALUES)
    n_bytes = _NOTHING_BYTES + n_values * (_SOURCE_VALUE_BYTES if sizes.is_source else _REFERENCE_VALUE_BYTES)
    if not sizes.is_frozen:
        n_bytes += _HEADS_BYTES * sizes.n_products
    if sizes.n_table_values:
        n_bytes += _FIELD_BYTES + sizes.n_table_values * _TABLE_VALUE_BYTES
    return n_bytes / 1e6
