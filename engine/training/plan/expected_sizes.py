"""Sizes of a clip before it is trained: counted where a trained clip of the project says so, else expected.

What nothing is known of is expected as it came out on the two captures of `engine.training.plan.cost`: clouds grow
with the pixels of a picture until they reach their limits. Good for a forecast, no promise. No torch.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.errors import PreparationError
from engine.model.field_sizes import derive_log2_entries
from engine.training.config import TrainConfig
from engine.training.plan.cost import ClipSizes, n_products
from engine.training.preparation.training_pictures import shared_image_size

_STATIC_PER_PIXEL, _STATIC_FILL = 0.19, 0.94
"""Static anchors per pixel of one picture, and how full a limit becomes: the voxel grows in steps."""
_ALIVE_PER_PIXEL, _NEW_PER_FRAME, _MOVING_FILL = 0.035, 0.29, 0.84
"""Moving anchors alive in one frame per pixel; share of them that each further frame adds; how full a limit becomes."""
_OWN_SHARE, _ALIVE_SHARE = 0.5, 1.2
"""Of a source clip against the reference clip's moving anchors: its own ones, and those alive in one frame."""
_INHERITED_ALIVE_SHARE = 0.6
"""Likewise of those alive, where it has none of its own."""
_ADAPTED_SHARE = 0.3
"""Of the reference clip's moving anchors, those that a source clip uses; with inherit=moving they are its own."""


@dataclass(frozen=True, slots=True)
class Footage:
    """What there is to train on.

    Attributes:
        width, height: Working size, pixels.
        n_cameras, n_held_out: Cameras to train on, and those left out.
        n_frames: Of the capture.
    """

    width: int
    height: int
    n_cameras: int
    n_held_out: int
    n_frames: int

    @property
    def n_pixels(self) -> int:
        """Of one picture."""
        return self.width * self.height


def footage_of(capture: Capture, holdout: Sequence[int]) -> Footage:
    """Numbers of a capture.

    Raises:
        PreparationError: Cameras differ in size, or fewer than two are left for training.
    """
    n_cameras = len(capture.rig) - len(set(holdout))
    if n_cameras < 2:
        raise PreparationError(
            f"Only {n_cameras} of {len(capture.rig)} cameras are left for training; two are needed.",
            hint="Hold out fewer cameras.",
            path=capture.path,
        )
    width, height = shared_image_size(capture)
    return Footage(width, height, n_cameras, len(set(holdout)), capture.n_frames)


@dataclass(frozen=True, slots=True)
class Counts:
    """Anchors of a trained clip.

    Attributes:
        n_static: Static ones, inherited ones too.
        n_moving: Moving ones of its own, over all of its frames.
        n_alive: Most moving ones in one frame, inherited ones too.
        n_table_values: Of its field.
    """

    n_static: int
    n_moving: int
    n_alive: int
    n_table_values: int


def counts_of(header: ClipHeader) -> Counts | None:
    """Counts in the header of a trained clip; None where it has none, as those of earlier versions."""
    if header.n_alive is None:
        return None
    anchors, field = header.n_anchors, header.field
    own = ("moving",) if header.role == "reference" else ("residual", "adapted")
    return Counts(
        n_static=anchors.get("static", 0),
        n_moving=sum(anchors.get(role, 0) for role in own),
        n_alive=header.n_alive,
        n_table_values=0 if field is None else field.n_table_values,
    )


def expected_counts(
    footage: Footage,
    clip: Clip,
    config: TrainConfig,
    *,
    reference: Counts | None,
    siblings: Sequence[Counts],
    is_source: bool,
) -> Counts:
    """Counts of a clip that is not trained yet.

    Args:
        footage, clip, config: What it is made of.
        reference: Of the clip that a source clip inherits from, where known.
        siblings: Of trained clips of the same kind.
        is_source: Whether the clip inherits.
    """
    growth = 1 + _NEW_PER_FRAME * (clip.n_frames - 1)
    if siblings:
        n_static, n_moving, n_alive = (
            round(statistics.median(getattr(known, name) for known in siblings))
            for name in ("n_static", "n_moving", "n_alive")
        )
    else:
        n_static = round(min(_STATIC_PER_PIXEL * footage.n_pixels, _STATIC_FILL * config.max_static_points))
        n_moving = round(min(_ALIVE_PER_PIXEL * footage.n_pixels * growth, _MOVING_FILL * config.max_moving_points))
        n_alive = round(n_moving / growth)
        if is_source:
            known = reference or Counts(n_static, n_moving, n_alive, 0)
            n_static = known.n_static if config.inherit != "off" else n_static
            share = {"dedup": _OWN_SHARE, "none": 0.0, "full": 1.0}[
                config.residual if config.inherit != "off" else "full"
            ]
            n_moving, n_alive = (
                round(known.n_moving * (share + (_ADAPTED_SHARE if config.inherit == "moving" else 0.0))),
                round(known.n_alive * (_ALIVE_SHARE if share else _INHERITED_ALIVE_SHARE)),
            )
    return Counts(n_static, n_moving, n_alive, _expected_table_values(clip, config, n_alive))


def _expected_table_values(clip: Clip, config: TrainConfig, n_alive: int) -> int:
    if not n_alive:
        return 0
    is_shared = config.field_tables == "shared"
    log2_entries = config.field_log2_entries or derive_log2_entries(
        n_alive, n_shared_knots=clip.n_frames if is_shared else 1
    )
    n_levels = config.field_levels or config.field_max_levels
    return (1 if is_shared else clip.n_frames) * n_levels * config.field_channels * 2**log2_entries


def clip_sizes(footage: Footage, clip: Clip, config: TrainConfig, counts: Counts, *, is_source: bool) -> ClipSizes:
    """What the cost of a clip follows from.

    Args:
        footage, clip, config: What it is made of.
        counts: Of a trained clip, or expected ones.
        is_source: Whether it inherits; its static anchors and heads are frozen then unless the settings say otherwise.
    """
    is_frozen = is_source and config.keeps_static
    has_gate = config.gate != "off"
    n_at_all_times = {"static": counts.n_moving, "off": counts.n_static + counts.n_moving}
    n_alive = n_at_all_times.get(config.gate, counts.n_alive)
    return ClipSizes(
        n_pixels=footage.n_pixels,
        n_cameras=footage.n_cameras,
        n_frames=clip.n_frames,
        n_background_frames=min(footage.n_frames, config.background_frames),
        n_static=counts.n_static,
        n_moving=counts.n_moving,
        n_alive=n_alive,
        n_table_values=counts.n_table_values,
        gaussians_per_anchor=config.gaussians_per_anchor,
        feature_dim=config.static_feature_dim,
        n_products=n_products(
            static_dim=config.static_feature_dim,
            dynamic_dim=config.dynamic_feature_dim,
            hidden=config.head_hidden,
            gaussians_per_anchor=config.gaussians_per_anchor,
        ),
        is_source=is_source,
        is_frozen=is_frozen,
        owns_static=not is_source or config.inherit in ("trainable", "off"),
        is_built=not is_source or config.inherit == "off",
        has_gate=has_gate,
        has_active_tiles=is_frozen and config.tiles == "active" and has_gate,
        coarse_share=config.coarse_share,
    )
