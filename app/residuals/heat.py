"""Heat: the map of the picture that a camera has at the playhead, made on a thread; the newest request wins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from app.background.kernels import prepare_drawing
from app.background.latest import LatestWorker
from app.playback.frame_decoder import FrameRequest
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.project.opening.opened_project import OpenedProject
from app.residuals.clip_pictures import ClipPictures, captured
from app.residuals.heat_map import HEAT_KINDS, LEVELS, HeatMap
from engine.byte_cache import ByteCache
from engine.capture.capture import Capture
from engine.capture.clip import Clip

CACHE_BYTES = 96 << 20
"""About a hundred maps of 640 x 360, or one of every frame of the sample in several kinds."""


@dataclass(frozen=True, slots=True)
class HeatRequest:
    """A map. Equal requests give equal maps.

    Attributes:
        generation: Of the open project.
        kind: Name, see HEAT_KINDS.
        main: The frame at the playhead; None where no render is needed.
        other: The frame before for R and E; for "clips" the clip at the other side of the boundary, by the frame next
            to it.
    """

    generation: int
    kind: str
    clip_index: int
    frame_index: int
    camera_index: int
    main: FrameRequest | None
    other: FrameRequest | None
    capture: Capture = field(compare=False)

    @property
    def states(self) -> tuple[FrameRequest | None, ...]:
        """States of clips that it is made of."""
        return self.main, self.other


class Heat:
    """Maps on demand. Methods are for one thread, not the one it owns, and never wait.

    Args:
        playback: Says which state of a clip is to be shown.
        pictures: Shared with others.
        why_none: Why there is nothing to show of a clip: "clip 2 is not trained".
    """

    def __init__(self, playback: Playback, pictures: ClipPictures, why_none: Callable[[int], str]) -> None:
        self._playback, self._pictures, self._why_none = playback, pictures, why_none
        self._cache: ByteCache[HeatRequest, HeatMap] = ByteCache(CACHE_BYTES)
        self._last: dict[tuple[str, int], HeatMap] = {}
        self._reasons: dict[HeatRequest, str] = {}
        self.worker: LatestWorker[HeatRequest, HeatMap] = LatestWorker("heat maps", self._compute, prepare=_prepare)

    def heat(self, opened: OpenedProject, timeline: Timeline, camera_index: int, kind: str) -> HeatMap | None:
        """The map at the playhead. Until it is made, the last one of this kind and camera as stale, or None; without
        values and with a note where there can be none.

        Raises:
            KeyError: There is no such kind.
        """
        kind = HEAT_KINDS[kind].name
        clip = timeline.clip
        if clip is None:
            return None
        wanted = self._wanted(opened, timeline, clip, camera_index, kind)
        if isinstance(wanted, str):
            return HeatMap(None, kind, wanted, clip.clip_index, timeline.frame_index, camera_index, note=wanted)
        known = self._cache.get(wanted)
        if known is not None:
            self._last[kind, camera_index] = known
            return known
        if wanted in self._reasons:
            note = self._reasons[wanted]
            return HeatMap(None, kind, note, clip.clip_index, timeline.frame_index, camera_index, note=note)
        self.worker.request(wanted)
        last = self._last.get((kind, camera_index))
        return None if last is None else replace(last, is_stale=True)

    def note_failure(self, request: HeatRequest, reason: str) -> None:
        """Record that a map could not be made; from now on the reason is given."""
        self._reasons[request] = reason

    def clear(self) -> None:
        """Forget everything, as when another project is opened."""
        self.worker.forget()
        self._cache.clear()
        self._last.clear()
        self._reasons.clear()

    def close(self) -> None:
        """End the thread."""
        self.worker.close()

    # ---------------------------------------------------------------- requests

    def _wanted(
        self, opened: OpenedProject, timeline: Timeline, clip: Clip, camera_index: int, kind: str
    ) -> HeatRequest | str:
        """The request, or why there is none."""
        frame_index = timeline.frame_index
        needs_before = kind in ("R", "G", "E")
        if needs_before and frame_index == 0:
            return "Frame 0 has no previous frame."
        main = other = None
        if kind != "G":
            main = self._playback.request(clip, frame_index)
            if main is None:
                return sentence(self._why_none(clip.clip_index))
        other_frame = frame_index - 1
        if kind == "clips":
            side = _other_side(timeline, clip, frame_index)
            if isinstance(side, str):
                return side
            other_frame = side
        if kind in ("R", "E", "clips"):
            neighbour = timeline.clip_of(other_frame)
            assert neighbour is not None
            other = self._playback.request(neighbour, other_frame)
            if other is None:
                whose = "the neighbour's picture" if kind == "clips" else "the previous frame"
                return f"No render of {whose}: {self._why_none(neighbour.clip_index)}."
        return HeatRequest(
            opened.generation, kind, clip.clip_index, frame_index, camera_index, main, other, opened.capture
        )

    # ---------------------------------------------------------------- on the thread

    def _compute(self, request: HeatRequest) -> HeatMap:
        values, note, is_extrapolated = self._values(request)
        valid = request.capture.valid(request.camera_index)
        if valid is not None:
            values = np.where(valid, values, np.float32(np.nan))
        heat = HeatMap(
            np.ascontiguousarray(values, np.float32),
            request.kind,
            request,
            request.clip_index,
            request.frame_index,
            request.camera_index,
            mean=float((values if valid is None else values[valid]).mean(dtype=np.float64)),
            is_extrapolated=is_extrapolated,
            note=note,
        )
        if self.worker.is_still_wanted:
            self._cache.put(request, heat, values.nbytes)
        return heat

    def _values(self, request: HeatRequest) -> tuple[np.ndarray, str, bool]:
        """Values in the unit of the kind, note, and whether a clip was asked beyond its frames."""
        from engine.metrics.clips.seams import change_of, excess_of
        from engine.metrics.pictures.flip import flip_map
        from engine.metrics.pictures.luminance import luminance_difference

        capture, camera, frame, kind = request.capture, request.camera_index, request.frame_index, request.kind
        if kind == "clips":
            return self._two_clips(request)
        if kind == "G":
            return LEVELS * change_of(captured(capture, camera, frame), captured(capture, camera, frame - 1)), "", False
        assert request.main is not None
        image = self._pictures.frame(capture, request.main, camera)
        if kind in ("R", "E"):
            assert request.other is not None
            change = change_of(image, self._pictures.frame(capture, request.other, camera))
            if kind == "R":
                return LEVELS * change, "", False
            truth_change = change_of(captured(capture, camera, frame), captured(capture, camera, frame - 1))
            return LEVELS * excess_of(change, truth_change), "", False
        truth = captured(capture, camera, frame)
        if kind == "error":
            return LEVELS * change_of(image, truth), "", False
        if kind == "luminance":
            return LEVELS * luminance_difference(image, truth), "", False
        return flip_map(image, truth), "", False

    def _two_clips(self, request: HeatRequest) -> tuple[np.ndarray, str, bool]:
        """The clip at the playhead, less its neighbour asked for the same instant."""
        from engine.metrics.clips.seams import change_of

        main, other = request.main, request.other
        assert main is not None
        assert other is not None
        capture, camera = request.capture, request.camera_index
        neighbour = self._pictures.trained(other)
        is_before = other.clip_index < main.clip_index
        last = "last" if is_before else "first"
        if neighbour.is_held_beyond if is_before else neighbour.is_held_ahead:
            image = self._pictures.frame(capture, other, camera)
            own = "ends before" if is_before else "begins after"
            note = f"Clip {other.clip_index} {own} this frame; its {last} frame stands in, which shows no more than R"
        else:
            clip_time = neighbour.beyond if is_before else neighbour.ahead
            image = self._pictures.render(capture, other, camera, clip_time)
            note = f"Clip {other.clip_index} is extrapolated beyond its {last} frame"
        return LEVELS * change_of(self._pictures.frame(capture, main, camera), image), note, True


def _other_side(timeline: Timeline, clip: Clip, frame_index: int) -> int | str:
    """The frame next to this one in the neighbouring clip, or why there is none."""
    if frame_index == clip.start and clip.start > 0:
        return frame_index - 1
    if frame_index == clip.stop - 1 and clip.stop < timeline.n_frames:
        return frame_index + 1
    if frame_index in (clip.start, clip.stop - 1):
        return f"No other clip meets clip {clip.clip_index} at frame {frame_index}."
    return f"Frame {frame_index} lies inside clip {clip.clip_index}; two clips meet at its first and last frame only."


def sentence(clause: str) -> str:
    """A clause as a sentence."""
    return f"{clause[:1].upper()}{clause[1:]}."


def _prepare() -> None:
    prepare_drawing()
    from engine.metrics.pictures.flip import warm_up

    warm_up()
