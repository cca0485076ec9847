"""Evaluation of trained clips: one row per frame and camera, held-out cameras marked, nothing left out.

Raw figures use the scene's mean colours for held-out cameras, because their white balance was never seen; training
cameras use their own gains. Fitted figures allow a least-squares gain and offset per channel and are named so.
Pictures are compared as they are rendered: at most two frames of one camera are held at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.cloud.background.background import estimate_background
from engine.cloud.background.exposure import Exposure
from engine.cloud.background.masks import motion_mask
from engine.metrics.clips.seams import PairRow, SeamMaps, change_of, seam_maps
from engine.metrics.clips.summary import EvalRow
from engine.metrics.clips.trained_clip import TrainedClip
from engine.metrics.pictures.colors import Precision, as_shown
from engine.metrics.pictures.picture import Choice, measure_picture
from engine.training.preparation.cloud_preparation import spread_frames

_BACKGROUND_FRAMES = 50


@dataclass(frozen=True)
class _Shot:
    """One frame of one camera: the render as compared [H, W, 3], the truth [H, W, 3] uint8, what moves [H, W] bool."""

    frame_index: int
    image: np.ndarray
    pixels: np.ndarray
    is_moving: np.ndarray


class Evaluation:
    """Measures clips of one capture, one after another; keeps only the cameras' backgrounds in between.

    Args:
        capture: Its pictures are the truth.
        cameras: Camera indices to evaluate.
        holdout: Which of them were held out.
        metrics: Which columns, see engine.metrics.pictures.picture.measure_picture.
        precision: Renders as they are, or rounded to 8 bit; of rows and of seams.
    """

    def __init__(
        self,
        capture: Capture,
        *,
        cameras: Sequence[int],
        holdout: Sequence[int],
        metrics: Choice = "all",
        precision: Precision = "float",
    ) -> None:
        self.capture, self.cameras, self.holdout = capture, list(cameras), frozenset(holdout)
        self.metrics: Choice = metrics
        self.precision: Precision = precision
        self._backgrounds: dict[int, tuple[np.ndarray, Exposure]] = {}

    def measure(
        self,
        trained: TrainedClip,
        *,
        before: TrainedClip | None = None,
        frames: Sequence[int] | None = None,
        on_row: Callable[[EvalRow], None] | None = None,
        on_pair: Callable[[PairRow], None] | None = None,
    ) -> list[EvalRow]:
        """Compare renders of a clip with the capture.

        Args:
            before: The clip that ends where this one starts, for the boundary between them.
            frames: Capture frame indices, rising; all of the clip when None.
            on_row: Called after each row, for progress.
            on_pair: Called for each two neighbouring frames, after the row of the later one; without it no seams are
                measured.
        """
        clip = trained.clip
        chosen = list(clip.frame_indices() if frames is None else frames)
        neighbour = before if before is not None and before.clip.stop == clip.start else None
        later = [frame for frame in chosen if frame - 1 in chosen or (frame == clip.start and neighbour is not None)]
        rows = []
        for camera in self.cameras:
            found = self.of_camera(
                trained, camera, before=neighbour, frames=chosen, pairs=() if on_pair is None else later
            )
            for item in found:
                if isinstance(item, PairRow):
                    assert on_pair is not None
                    on_pair(item)
                    continue
                rows.append(item)
                if on_row is not None:
                    on_row(item)
        return rows

    def of_camera(
        self,
        trained: TrainedClip,
        camera: int,
        *,
        before: TrainedClip | None = None,
        frames: Collection[int],
        pairs: Collection[int],
    ) -> Iterator[EvalRow | PairRow]:
        """One camera's measurements of a clip, frame by frame: the row, then the pair with the frame before.

        May be iterated for several cameras on several threads at a time.

        Args:
            before: The clip that ends where this one starts; where the pair at the first frame is wanted.
            frames: Capture frame indices of the rows that are wanted.
            pairs: Of the pairs that are wanted, by the later frame. Frames that only pairs need are rendered too.
                Pictures that are excluded from training are left out, with their pairs.
        """
        clip = trained.clip
        name, is_held_out = self.capture.rig.names[camera], camera in self.holdout
        last: _Shot | None = None
        for frame in clip.frame_indices():
            if (frame not in frames and frame not in pairs) or not self.capture.is_usable(camera, frame):
                continue
            shot = self._shot(trained, camera, frame)
            if frame in frames:
                measured = measure_picture(
                    shot.image,
                    shot.pixels,
                    shot.is_moving,
                    is_valid=self.capture.valid_in(camera, frame),
                    metrics=self.metrics,
                    precision=self.precision,
                )
                yield EvalRow(clip.clip_index, frame, name, is_held_out, measured.figures, measured.missing)
            has_pair = frame in pairs and frame > 0 and self.capture.is_usable(camera, frame - 1)
            if has_pair and frame == clip.start:
                assert before is not None, "the pair at a boundary needs the clip before it"
                yield self._boundary(clip, shot, before, camera)
            elif has_pair:
                if last is None or last.frame_index != frame - 1:
                    last = self._shot(trained, camera, frame - 1)
                maps = self._maps(camera, shot, last)
                yield _pair_row(maps, clip, frame, name, is_held_out, is_boundary=False)
            last = shot

    def boundary_maps(self, before: TrainedClip, after: TrainedClip, camera: int) -> SeamMaps:
        """R, G and E of one camera at the boundary between two neighbouring clips, for a picture.

        Raises:
            ValueError: The clips are not neighbours.
        """
        clip = after.clip
        if before.clip.stop != clip.start:
            raise ValueError(f"clips {before.clip.clip_index} and {clip.clip_index} are not neighbours")
        return self.change_maps(before, after, camera, clip.start)

    def change_maps(self, before: TrainedClip, after: TrainedClip, camera: int, frame: int) -> SeamMaps:
        """R, G and E of one camera from the frame before to a frame, for a picture.

        Args:
            before, after: The clips that show the two frames; one clip for both inside of it.
            frame: Capture frame index of the later one.
        """
        return self._maps(camera, self._shot(after, camera, frame), self._shot(before, camera, frame - 1))

    def _boundary(self, clip: Clip, shot: _Shot, before: TrainedClip, camera: int) -> PairRow:
        last = self._shot(before, camera, clip.start - 1)
        maps = self._maps(camera, shot, last)
        # the same instant by the clip before: its field may end with its last frame, and the picture with it
        is_held = before.is_held_beyond
        image = last.image if is_held else self._render(before, camera, before.beyond)
        two_clips = maps.means(change_of(shot.image, image))
        return _pair_row(
            maps,
            clip,
            clip.start,
            self.capture.rig.names[camera],
            camera in self.holdout,
            is_boundary=True,
            two_clips=two_clips,
            is_held=is_held,
        )

    def _shot(self, trained: TrainedClip, camera: int, frame: int) -> _Shot:
        pixels = self.capture.frame(camera, frame)
        image = self._render(trained, camera, trained.clip.clip_time(frame))
        return _Shot(frame, image, pixels, self._is_moving(camera, frame, pixels))

    def _render(self, trained: TrainedClip, camera: int, clip_time: float) -> np.ndarray:
        """Picture in the camera's colours, as it is compared: black where the camera sees nothing. [H, W, 3] float32"""
        image = as_shown(trained.picture(self.capture.rig, camera, clip_time), self.precision)
        valid = self.capture.valid(camera)
        return image if valid is None else np.where(valid[..., None], image, np.float32(0.0))

    def _is_moving(self, camera: int, frame: int, pixels: np.ndarray) -> np.ndarray:
        """Where a picture differs from the camera's background, whatever its exposure. [H, W] bool"""
        background, exposure = self._background(camera)
        return motion_mask(
            exposure.applied_to(pixels[None])[0], background, is_valid=self.capture.valid_in(camera, frame)
        )

    def _background(self, camera: int) -> tuple[np.ndarray, Exposure]:
        """A camera's picture when nothing moves, in its mean exposure, and that exposure."""
        if camera not in self._backgrounds:
            spread = spread_frames(self.capture.n_frames, _BACKGROUND_FRAMES)
            frames = self.capture.frames_of(camera, spread)
            lit = Exposure.of_frames(frames).applied_to(frames)
            background = estimate_background(lit, self.capture.valid(camera)).image
            self._backgrounds[camera] = (background, Exposure.of_background(background))
        return self._backgrounds[camera]

    def _maps(self, camera: int, shot: _Shot, last: _Shot) -> SeamMaps:
        truth, last_truth = (s.pixels.astype(np.float32) / np.float32(255.0) for s in (shot, last))
        is_moving, is_valid = shot.is_moving | last.is_moving, self.capture.valid_in(camera, shot.frame_index)
        is_last_valid = self.capture.valid_in(camera, last.frame_index)
        if is_valid is not None and is_last_valid is not None:
            is_valid = is_valid & is_last_valid
        elif is_last_valid is not None:
            is_valid = is_last_valid
        return seam_maps(shot.image, last.image, truth, last_truth, is_moving, is_valid)


def _pair_row(
    maps: SeamMaps,
    clip: Clip,
    frame: int,
    camera: str,
    is_held_out: bool,
    *,
    is_boundary: bool,
    two_clips: tuple[float | None, float | None] = (None, None),
    is_held: bool = False,
) -> PairRow:
    (r_static, r_moving), (g_static, g_moving), (e_static, e_moving) = (
        maps.means(values) for values in (maps.change, maps.truth_change, maps.excess)
    )
    return PairRow(
        frame_index=frame,
        clip_index=clip.clip_index,
        camera=camera,
        is_held_out=is_held_out,
        is_boundary=is_boundary,
        change_static=r_static,
        change_moving=r_moving,
        truth_change_static=g_static,
        truth_change_moving=g_moving,
        excess_static=e_static,
        excess_moving=e_moving,
        static_share=maps.static_share,
        two_clips_static=two_clips[0],
        two_clips_moving=two_clips[1],
        is_extrapolated=is_boundary,
        is_held=is_held,
    )
