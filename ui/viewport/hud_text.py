"""Words of the viewport about its picture: its contents, the picture on its way, and missing parts. Plain text.

The label is always that of the picture on screen, never that of the playhead; where they differ it says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app.playback.picture_source import UNKNOWN, PictureSource
from app.status import WantedFrame
from engine.text import rate_text
from ui.style.numbers import format_count
from ui.viewport.picture_rate import ShownRate

RENDERED, CLOUD, FIRST_CLOUD, HINT, CAPTURED, MARKS = (
    "Rendered",
    "Point cloud",
    "First point cloud",
    "Captured pictures in space",
    "Captured picture",
    "Cameras only",
)
_STANDS_IN = {
    CLOUD: "point cloud of static parts",
    FIRST_CLOUD: "rough point cloud of frame 0",
    HINT: "captured pictures placed in space",
    CAPTURED: "captured picture",
    MARKS: "cameras only",
}
"""Stand-in pictures where there is no rendered picture."""
PARTS = "   "
"""Between parts of a label; each stays whole where lines break."""


@dataclass(frozen=True)
class ShownPicture:
    """Contents of the picture on screen.

    Attributes:
        kind: One of the words above.
        source: The frame and where it is seen from; of a cloud, which belongs to no frame, only the latter.
        size, full_size: Width and height it has, and will have when nothing moves, px.
        is_on_its_way: Whether a newer one is being made.
        is_cloud_chosen: Whether the cloud is shown because the user asked for it, although there is a trained picture.
    """

    kind: str = MARKS
    source: PictureSource = UNKNOWN
    size: tuple[int, int] = (0, 0)
    full_size: tuple[int, int] = (0, 0)
    is_on_its_way: bool = False
    is_cloud_chosen: bool = False

    def is_of(self, wanted: WantedFrame) -> bool:
        """Whether nothing better is to come for the frame under the playhead, at whatever size and from wherever."""
        if wanted.has_failed or self.is_cloud_chosen:
            return True
        if self.kind == RENDERED:
            return (self.source.clip_index, self.source.frame_index) == (wanted.clip_index, wanted.frame_index)
        return not wanted.revision and self.source.frame_index in (None, wanted.frame_index)


@dataclass(frozen=True)
class HudText:
    """Words over the picture, one plate each; empty ones are left out.

    Attributes:
        label: The picture on screen.
        pending: The picture on its way.
        failure: The picture that could not be made.
        note: Why it is not the trained result, or how far the training is.
        rate: Pictures per second while playing.
    """

    label: str
    pending: str = ""
    failure: str = ""
    note: str = ""
    rate: str = ""


def hud_text(
    shown: ShownPicture,
    wanted: WantedFrame,
    *,
    fps: float,
    state: str,
    state_words: str,
    camera_name: Callable[[int | None], str],
    rate: ShownRate | None = None,
    loading: tuple[int, int] | None = None,
) -> HudText:
    """Everything that the HUD says about the picture.

    Args:
        fps: Frames per second of the capture.
        state, state_words: Of the clip under the playhead, see ClipStatus; and as users read it.
        camera_name: Of an index; None is the free view.
        rate: While playing.
        loading: Frames that are ready, of how many, before playing begins.
    """
    pending = "" if wanted.has_failed else _pending_text(shown, wanted, camera_name, is_playing=rate is not None)
    failure = (
        f"frame {wanted.frame_index} could not be drawn" if wanted.has_failed and not _is_right(shown, wanted) else ""
    )
    return HudText(
        label=_label(shown, wanted, fps, camera_name, is_playing=rate is not None),
        pending=pending,
        failure=failure,
        note=_note(shown, wanted, state, state_words),
        rate=loading_text(*loading) if loading is not None else "" if rate is None else playing_text(rate),
    )


def loading_text(n_ready: int, n_frames: int) -> str:
    """Words while playback waits for frames."""
    return f"loading {n_ready} of {n_frames} frames"


def playing_text(rate: ShownRate) -> str:
    """How fast pictures really follow each other, and how many of the frames are among them."""
    words = f"{'–' if rate.per_s is None else f'{rate.per_s:.1f}'} of {rate_text(rate.wanted_per_s)} fps"
    if rate.is_every_frame:
        return f"{words}, every frame"
    if rate.every_nth > 1:
        is_teen = rate.every_nth % 100 in (11, 12, 13)
        ending = "th" if is_teen else {1: "st", 2: "nd", 3: "rd"}.get(rate.every_nth % 10, "th")
        return f"{words}, every {rate.every_nth}{ending} frame"
    return f"{words}, some frames skipped" if rate.has_skipped else words


def captured_words(has_scene_colors: bool) -> str:
    """Name of a captured picture next to the render. It states when both are in the same colours."""
    return "Captured, in the scene's colours" if has_scene_colors else "Captured"


def pane_text(kind: str, frame_index: int | None, other_frame_index: int | None) -> str:
    """The label of one of two pictures that are compared. It warns where they are not of the same frame."""
    if frame_index is None:
        return kind
    if other_frame_index is None or other_frame_index == frame_index:
        return f"{kind}, frame {frame_index}"
    return f"{kind}, frame {frame_index} (not the same frame)"


def count_text(n_alive: int, n_all: int, words: str, frame_index: int | None) -> str:
    """A number of anchors, which says whether it is that of a frame or that of the clip."""
    if n_all < n_alive:  # how many the clip has is not known
        where = "" if frame_index is None else f" in frame {frame_index}"
        return f"{format_count(n_alive)} {words}{where}"
    if n_alive == n_all:
        return f"{format_count(n_all)} {words}"
    return f"{format_count(n_alive)} of {format_count(n_all)} {words} alive in frame {frame_index}"


def _is_right(shown: ShownPicture, wanted: WantedFrame) -> bool:
    """Whether the picture is what it should be but for its size."""
    source = shown.source
    is_frame = (source.clip_index, source.frame_index, source.revision) == (
        wanted.clip_index,
        wanted.frame_index,
        wanted.revision,
    )
    return is_frame and source.look == wanted.look


def _label(
    shown: ShownPicture, wanted: WantedFrame, fps: float, camera_name: Callable[[int | None], str], *, is_playing: bool
) -> str:
    source = shown.source
    clip_index = wanted.clip_index if source.clip_index is None else source.clip_index
    frame_index = wanted.frame_index if source.frame_index is None else source.frame_index
    frame = f"frame {frame_index}"
    if is_playing and frame_index != wanted.frame_index:
        frame += f" (playhead {wanted.frame_index})"
    width, height = shown.size
    size = f"{width} x {height}"
    if width < shown.full_size[0]:
        size += f" of {shown.full_size[0]} x {shown.full_size[1]}"
    camera = camera_name(source.camera_index)
    words = [f"clip {clip_index}", frame, f"{frame_index / max(fps, 1e-6):.2f} s", camera, size]
    return PARTS.join(words + ([source.shown_as.label] if source.shown_as.label else []))


def _pending_text(
    shown: ShownPicture, wanted: WantedFrame, camera_name: Callable[[int | None], str], *, is_playing: bool
) -> str:
    source = shown.source
    if shown.is_cloud_chosen:
        return ""
    if shown.kind != RENDERED:
        return _pending_beside(shown, wanted)
    if not shown.is_on_its_way:
        return ""
    if source.clip_index != wanted.clip_index and not wanted.is_loaded:
        return (
            f"showing frame {source.frame_index} of clip {source.clip_index}, clip {wanted.clip_index} is being loaded"
        )
    if source.shown_as.label != wanted.shown_as:
        return f"{wanted.shown_as or 'the scene in its own colours'} is being drawn"
    if source.frame_index != wanted.frame_index:
        if is_playing:
            return ""  # the label names both, and changes with every picture
        return f"showing frame {source.frame_index}, frame {wanted.frame_index} is being drawn"
    if source.camera_index != wanted.camera_index:
        return f"showing {camera_name(source.camera_index)}, {camera_name(wanted.camera_index)} is being drawn"
    if source.look != wanted.look:
        return "being redrawn from here"
    if source.revision != wanted.revision:
        return f"a newer state of clip {wanted.clip_index} is being drawn"
    return "full resolution follows"


def _pending_beside(shown: ShownPicture, wanted: WantedFrame) -> str:
    """Pending work while no rendered picture is there."""
    if wanted.revision and not wanted.is_loaded:
        return f"loading clip {wanted.clip_index}"
    if wanted.revision:
        return f"frame {wanted.frame_index} is being drawn"
    if shown.kind == CAPTURED and shown.source.frame_index != wanted.frame_index:
        return f"showing frame {shown.source.frame_index}, frame {wanted.frame_index} is being read"
    return "the point cloud is being read" if shown.is_on_its_way else ""


def _note(shown: ShownPicture, wanted: WantedFrame, state: str, state_words: str) -> str:
    source = shown.source
    if shown.is_cloud_chosen:
        return "point cloud, not the trained result (4 switches)"
    if shown.kind == RENDERED:
        if state == "trained" or source.clip_index != wanted.clip_index:
            return ""
        step = "" if source.step is None else f", picture of step {format_count(source.step)}"
        still = ", moving objects are missing until they are learned" if source.is_still else ""
        return f"clip {wanted.clip_index} {state_words}{step}{still}"
    what = _STANDS_IN[shown.kind]
    if wanted.has_failed or wanted.revision:
        return f"{what}, not the trained result"
    if shown.kind == CLOUD:
        what += ", moving objects are missing"
    verb = "is " if state in ("untrained", "stale", "queued") else ""
    return f"{what}: clip {wanted.clip_index} {verb}{state_words}"
