"""Anchor heat: mean error and mean E of the pixels that each anchor covers, for views without a camera.

The maps of one camera after another are spread over the anchors by the weights with which its picture was blended
(engine.metrics.clips.anchor_shares), so that hidden anchors do not count. Cameras are ordered so that the first few
stand around the whole scene; each further one refines the result. Made on a thread; the newest request wins.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from app.background.kernels import prepare_drawing
from app.background.latest import LatestWorker
from app.playback.frame_decoder import FrameRequest
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.project.opening.opened_project import OpenedProject
from app.residuals.clip_pictures import ClipPictures, captured
from app.residuals.heat import sentence
from app.residuals.heat_map import LEVELS
from engine.byte_cache import ByteCache
from engine.camera.rig import CameraRig
from engine.capture.capture import Capture

if TYPE_CHECKING:
    from engine.metrics.clips.anchor_shares import AnchorShares

ANCHOR_COLUMNS = ("error", "E")
"""The figures: mean over channels of |render - captured picture|, and excess flicker; see HEAT_KINDS."""
N_CAMERAS = 12
"""Pictures used for one frame; all cameras where there are fewer. About a second each at most."""
MIN_PIXELS = 0.5
"""An anchor that covers less, in all cameras together, was not seen."""
CACHE_BYTES = 64 << 20


@dataclass(frozen=True, slots=True, eq=False)
class AnchorHeat:
    """A figure for every anchor that exists at a frame.

    Attributes:
        positions: Scene units. [A, 3] float32
        values: Mean over the pixels it covers, in 1/255; NaN where no camera sees it. [A] float32
        column: Of ANCHOR_COLUMNS.
        key: Changes when the content does.
        clip_index, frame_index: The moment.
        n_cameras, n_cameras_all: Cameras used so far, and in the end.
        is_stale: It is of another frame than the playhead's.
        note: Why there are no values, in a sentence; empty otherwise.
    """

    positions: np.ndarray
    values: np.ndarray
    column: str
    key: Hashable
    clip_index: int
    frame_index: int
    n_cameras: int = 0
    n_cameras_all: int = 0
    is_stale: bool = False
    note: str = ""


@dataclass(frozen=True, slots=True)
class _Moment:
    """A frame of a state of a clip, and the frame before where there is one to compare with."""

    generation: int
    main: FrameRequest
    before: FrameRequest | None
    capture: Capture = field(compare=False)
    cameras: tuple[int, ...] = field(compare=False)


@dataclass(frozen=True, slots=True)
class AnchorRequest:
    """The maps of the first so many cameras."""

    moment: _Moment
    n_cameras: int

    @property
    def states(self) -> tuple[FrameRequest | None, ...]:
        """States of clips that it is made of."""
        return self.moment.main, self.moment.before


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """The heat of a moment so far. rows: of the anchors that exist then, in the sums [A] int64."""

    n_cameras: int
    rows: np.ndarray
    positions: np.ndarray
    shares: AnchorShares

    @property
    def n_bytes(self) -> int:
        arrays = (self.rows, self.positions, self.shares.sums, self.shares.weights)
        return sum(array.nbytes for array in arrays)


class AnchorHeats:
    """Anchor heat on demand. Methods are for one thread, not the one it owns, and never wait.

    Args:
        playback: Says which state of a clip is to be shown.
        pictures: Shared with others.
        why_none: Why there is nothing to show of a clip: "clip 2 is not trained".
    """

    def __init__(self, playback: Playback, pictures: ClipPictures, why_none: Callable[[int], str]) -> None:
        self._playback, self._pictures, self._why_none = playback, pictures, why_none
        self._reasons: dict[_Moment, str] = {}
        self._cache: ByteCache[_Moment, _Sums] = ByteCache(CACHE_BYTES)
        self._order: tuple[int, tuple[int, ...]] | None = None
        self._last: dict[str, AnchorHeat] = {}
        self.worker: LatestWorker[AnchorRequest, _Sums] = LatestWorker(
            "anchor heat", self._compute, prepare=prepare_drawing
        )

    def anchor_heat(self, opened: OpenedProject, timeline: Timeline, column: str) -> AnchorHeat | None:
        """The heat so far at the playhead; each call may ask for one more camera. Before the first, the last heat of
        this column as stale, or None.

        Raises:
            ValueError: There is no such column.
        """
        if column not in ANCHOR_COLUMNS:
            raise ValueError(f"columns of anchors are {', '.join(ANCHOR_COLUMNS)}, not {column!r}")
        clip = timeline.clip
        if clip is None:
            return None
        frame_index = timeline.frame_index
        main = self._playback.request(clip, frame_index)
        if main is None:
            return _nothing(column, clip.clip_index, frame_index, sentence(self._why_none(clip.clip_index)))
        neighbour = timeline.clip_of(frame_index - 1)
        before = None if neighbour is None else self._playback.request(neighbour, frame_index - 1)
        if column == "E" and neighbour is None:
            return _nothing(column, clip.clip_index, frame_index, "Frame 0 has no previous frame.")
        if column == "E" and before is None:
            assert neighbour is not None
            note = f"The previous frame is not rendered: {self._why_none(neighbour.clip_index)}."
            return _nothing(column, clip.clip_index, frame_index, note)
        moment = _Moment(opened.generation, main, before, opened.capture, self._cameras(opened))
        known = self._cache.get(moment)
        n_known = 0 if known is None else known.n_cameras
        if n_known < len(moment.cameras):
            self.worker.request(AnchorRequest(moment, n_known + 1))
        if known is None and moment in self._reasons:
            return _nothing(column, clip.clip_index, frame_index, self._reasons[moment])
        if known is None:
            last = self._last.get(column)
            return None if last is None else replace(last, is_stale=True)
        last = self._last.get(column)
        if last is None or last.key != (moment, n_known):
            last = _heat(known, column, moment)
            self._last[column] = last
        return last

    def note_failure(self, request: AnchorRequest, reason: str) -> None:
        """Record that a picture failed; from now on the reason is given where there is nothing else."""
        self._reasons[request.moment] = reason

    def clear(self) -> None:
        """Forget everything, as when another project is opened."""
        self.worker.forget()
        self._reasons.clear()
        self._cache.clear()
        self._last.clear()
        self._order = None

    def close(self) -> None:
        """End the thread."""
        self.worker.close()

    def _cameras(self, opened: OpenedProject) -> tuple[int, ...]:
        if self._order is None or self._order[0] != opened.generation:
            self._order = (opened.generation, cameras_around(opened.rig, N_CAMERAS))
        return self._order[1]

    # ---------------------------------------------------------------- on the thread

    def _compute(self, request: AnchorRequest) -> _Sums:
        from engine.metrics.clips.anchor_shares import anchor_shares, anchors_at

        moment = request.moment
        known = self._cache.get(moment)
        n_known = 0 if known is None else known.n_cameras
        trained = self._pictures.trained(moment.main)
        clip_time = moment.main.clip.clip_time(moment.main.frame_index)
        camera = moment.cameras[n_known]
        maps, is_valid = self._maps(moment, camera), moment.capture.valid(camera)
        shares = anchor_shares(trained, moment.capture.rig, camera, clip_time, maps, is_valid)
        if known is None:
            rows, positions = anchors_at(trained, clip_time)
        else:
            rows, positions, shares = known.rows, known.positions, known.shares + shares
        sums = _Sums(n_known + 1, rows, positions, shares)
        if self.worker.is_still_wanted:
            self._cache.put(moment, sums, sums.n_bytes)
        return sums

    def _maps(self, moment: _Moment, camera: int) -> np.ndarray:
        """Error and E of a camera's picture, in 1/255; E is 0 where there is no frame before. [H, W, 2] float32"""
        from engine.metrics.clips.seams import change_of, excess_of

        capture, frame = moment.capture, moment.main.frame_index
        image, truth = self._pictures.frame(capture, moment.main, camera), captured(capture, camera, frame)
        maps = np.zeros((*truth.shape[:2], 2), np.float32)
        maps[..., 0] = LEVELS * change_of(image, truth)
        if moment.before is not None:
            change = change_of(image, self._pictures.frame(capture, moment.before, camera))
            maps[..., 1] = LEVELS * excess_of(change, change_of(truth, captured(capture, camera, frame - 1)))
        return maps


def _heat(known: _Sums, column: str, moment: _Moment) -> AnchorHeat:
    sums = known.shares.sums[known.rows, ANCHOR_COLUMNS.index(column)]
    weights = known.shares.weights[known.rows]
    is_seen = weights >= MIN_PIXELS
    values = np.full(len(weights), np.nan, np.float32)
    values[is_seen] = sums[is_seen] / weights[is_seen]
    return AnchorHeat(
        known.positions,
        values,
        column,
        (moment, known.n_cameras),
        moment.main.clip_index,
        moment.main.frame_index,
        known.n_cameras,
        len(moment.cameras),
    )


def _nothing(column: str, clip_index: int, frame_index: int, note: str) -> AnchorHeat:
    empty = np.zeros((0, 3), np.float32)
    return AnchorHeat(empty, empty[:, 0], column, note, clip_index, frame_index, note=note)


def cameras_around(rig: CameraRig, n_cameras: int) -> tuple[int, ...]:
    """Camera indices, each one as far from all before it as can be; the first is camera 0."""
    poses = rig.world_to_camera.astype(np.float64)
    centers = -np.einsum("cji,cj->ci", poses[:, :3, :3], poses[:, :3, 3])
    chosen = [0][: len(rig)]
    while len(chosen) < min(n_cameras, len(rig)):
        distances = np.linalg.norm(centers[:, None] - centers[None, chosen], axis=2).min(1)
        distances[chosen] = -1.0
        chosen.append(int(distances.argmax()))
    return tuple(chosen)
