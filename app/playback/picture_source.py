"""PictureSource: the source of something on screen. It travels from the decoder to the words over the picture."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

from app.playback.modes.view_modes import PLAIN, ShownAs


@dataclass(frozen=True, slots=True)
class PictureSource:
    """A frame, the state of the clip it was made from, and where it is seen from. None and "" where unknown, or
    where it has no meaning: a captured picture belongs to no state of a clip.

    Attributes:
        clip_index, frame_index: The frame.
        revision: Names the state of the clip.
        step: Training steps behind that state.
        is_still: Whether that state holds nothing that changes over time, as a reference clip before its motion is
            learned.
        camera_index: The capture camera that took it, or that it is looked at through; None for a free view.
        look: Viewpoint and lens, regardless of size; see OrbitView.look_key.
        has_scene_colors: Whether a captured picture was brought into the scene's colours.
        shown_as: The meaning of its colours, and which part of the clip it shows.
    """

    clip_index: int | None = None
    frame_index: int | None = None
    revision: str = ""
    step: int | None = None
    is_still: bool = False
    camera_index: int | None = None
    look: Hashable = None
    has_scene_colors: bool = False
    shown_as: ShownAs = PLAIN


UNKNOWN = PictureSource()
"""The source of contents that belong to no frame."""
