"""The contents of pictures: colours, or numbers in the colours of a map on a range that never changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.export.jobs.video import PassName, VideoJob
from app.export.scene_frames import SceneFrames
from app.export.video.drawing import Drawn, draw
from app.export.video.moments import Moment
from app.export.video.views import ViewOf, ViewPoint
from app.playback.modes.color_maps import mapped
from app.playback.modes.view_modes import MODES, range_of
from app.residuals.clip_pictures import captured
from app.residuals.heat_map import HEAT_KINDS, LEVELS

HEAT_MAP = "inferno"
"""Colours of errors and changes, as in the window."""


@dataclass(frozen=True, slots=True, eq=False)
class PassPicture:
    """A picture before it is encoded.

    Attributes:
        color: Display-encoded, multiplied with `alpha`. [H, W, 3] float32 in 0..1
        alpha: [H, W] float32 in 0..1
        values: Numbers of the colours, in the unit of the pass, NaN where nothing is; of pictures in colour their
            depth. None of those side by side. [H, W] float32
    """

    color: np.ndarray
    alpha: np.ndarray
    values: np.ndarray | None

    def over(self, background: tuple[int, int, int], max_level: int = 255) -> np.ndarray:
        """In front of a background of levels 0 to 255. [H, W, 3] uint8, or uint16 where `max_level` is 65,535"""
        behind = np.array(background, np.float32) / np.float32(255.0)
        return _levels(self.color + (1.0 - self.alpha[..., None]) * behind, max_level)

    def straight(self, max_level: int = 255) -> np.ndarray:
        """Colours that are not multiplied with the opacity, and the opacity. [H, W, 4], of the type that `over` has"""
        color = self.color / np.maximum(self.alpha, 1e-4)[..., None]
        return _levels(np.concatenate([color, self.alpha[..., None]], axis=2), max_level)


def _levels(values: np.ndarray, max_level: int) -> np.ndarray:
    levels = np.clip(values, 0.0, 1.0) * np.float32(max_level) + np.float32(0.5)
    return levels.astype(np.uint8 if max_level == 255 else np.uint16)


class Painter:
    """Pictures of a job, one after another. Keeps the one before.

    Args:
        scene: Makes frames.
        job: States the contents of the pictures.
        moments: Of all pictures.
        view_of: From where each is taken.
        step: Frames from one picture to the next.
        is_take: Whether pictures are those of a take, which may jump from one to the next.
    """

    def __init__(
        self,
        scene: SceneFrames,
        job: VideoJob,
        moments: list[Moment],
        view_of: ViewOf,
        step: float,
        *,
        is_take: bool = False,
    ) -> None:
        self._scene, self._job, self._moments, self._view_of, self._step = scene, job, moments, view_of, step
        self._is_take = is_take
        self._last: tuple[Moment, ViewPoint, Drawn] | None = None

    def picture(self, number: int) -> PassPicture:
        """One picture.

        Raises:
            ProjectError, CaptureError: A clip or what a camera took cannot be read.
        """
        moment = self._moments[number]
        view = self._view_of(number, moment.view)
        shows: PassName = self._job.shows
        if shows == "change":
            return self._change(moment, self._before(number), view)
        drawn = self._draw(moment, view)
        match shows:
            case "color":
                return PassPicture(drawn.color, drawn.alpha, drawn.depth)
            case "depth":
                low, high = range_of("depth", self._scene.opened.capture.rig)
                colors = mapped(drawn.depth, MODES["depth"].map_name, low, high) / np.float32(255.0)
                alpha = np.where(np.isnan(drawn.depth), np.float32(0.0), drawn.alpha)
                return PassPicture(colors * alpha[..., None], alpha, drawn.depth)
            case "opacity":
                return _opaque(mapped(drawn.alpha, MODES["opacity"].map_name, 0.0, 1.0), drawn.alpha)
            case "compare":
                return self._compare(round(moment.scene), view, drawn)

    def _draw(self, moment: Moment, view: ViewPoint) -> Drawn:
        return draw(self._scene, moment.sources, view, supersampling=self._job.supersampling)

    def _change(self, moment: Moment, before: Moment, view: ViewPoint) -> PassPicture:
        """From the moment before to this one, from the same place, so that what the camera does is not a change. The
        first moment of the scene has none before it, and has not changed."""
        from engine.metrics.clips.seams import change_of

        earlier = self._known(before, view)
        now = earlier if before.sources == moment.sources else self._draw(moment, view)
        self._last = (moment, view, now)
        values = LEVELS * change_of(now.color, earlier.color)
        return _opaque(mapped(values, HEAT_MAP, *HEAT_KINDS["R"].value_range), values)

    def _before(self, number: int) -> Moment:
        """A step before a picture: of a take what it showed then, else of the capture."""
        moment = self._moments[number]
        if self._job.hold is not None or self._is_take:
            return self._moments[max(number - 1, 0)]
        before = moment.scene - self._step
        if before < 0 or self._scene.clip_at(before).clip_index not in self._scene.opened.trained:
            return moment
        return Moment(before, moment.view)

    def _known(self, moment: Moment, view: ViewPoint) -> Drawn:
        if self._last is not None:
            known_moment, known_view, drawn = self._last
            if _is_same(known_moment, moment) and known_view.is_same(view):
                return drawn
        return self._draw(moment, view)

    def _compare(self, frame_index: int, view: ViewPoint, drawn: Drawn) -> PassPicture:
        """Truth, render and error from left to right; black where the camera sees nothing."""
        from engine.metrics.clips.seams import change_of

        capture = self._scene.opened.capture
        assert view.camera_index is not None
        truth, render = captured(capture, view.camera_index, frame_index), drawn.color
        valid = capture.valid(view.camera_index)
        error = LEVELS * change_of(render, truth)
        if valid is not None:
            render = np.where(valid[..., None], render, np.float32(0.0))
            error = np.where(valid, error, np.float32(np.nan))
        heat = mapped(error, HEAT_MAP, *HEAT_KINDS["error"].value_range) / np.float32(255.0)
        beside = np.concatenate([truth, render, heat], axis=1)
        return PassPicture(beside, np.ones(beside.shape[:2], np.float32), None)


def _is_same(one: Moment, other: Moment) -> bool:
    return one.fading == other.fading and abs(one.scene - other.scene) < 1e-6


def _opaque(levels: np.ndarray, values: np.ndarray) -> PassPicture:
    return PassPicture(levels / np.float32(255.0), np.ones(levels.shape[:2], np.float32), values)
