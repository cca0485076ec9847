"""Evaluation of trained clips: one row per frame and camera, held-out cameras marked, nothing left out.

Raw figures use the scene's mean colours for held-out cameras, because their white balance was never seen; training
cameras use their own gains. Fitted figures allow a least-squares gain and offset per channel and are named so.
Pictures are compared as they are rendered: at most two frames of one camera are held at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.cloud.background import estimate_background
from engine.cloud.masks import motion_mask
from engine.metrics.colors import Precision, as_shown
from engine.metrics.picture import Choice, measure_picture
from engine.metrics.seams import PairRow, SeamMaps, change_of, part_means, seam_maps
from engine.metrics.summary import EvalRow
from engine.model.clip_model import ClipModel
from engine.model.clip_state import ClipState
from engine.model.view import REACH_SPACINGS, View, render_model
from engine.training.preparation import spread_frames

_BACKGROUND_FRAMES = 50


def camera_gain(reference: ClipState, camera_name: str) -> np.ndarray:
    """Colour gain of a training camera, ones for a held-out one. [3] float32"""
    names = list(reference.header["camera_names"])
    if camera_name in names:
        return reference.arrays["gains"][names.index(camera_name)]
    return np.ones(3, np.float32)


@dataclass(frozen=True, slots=True)
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
        reference: The project's reference clip: gains, near plane, spacing.
        cameras: Camera indices to evaluate.
        holdout: Which of them were held out.
        metrics: Which columns, see engine.metrics.picture.measure_picture.
        precision: Renders as they are, or rounded to 8 bit; of rows and of seams.
    """

    def __init__(
        self,
        capture: Capture,
        *,
        reference: ClipState,
        cameras: Sequence[int],
        holdout: Sequence[int],
        metrics: Choice = "all",
        precision: Precision = "float",
    ) -> None:
        self.capture, self.reference = capture, reference
        self.cameras, self.holdout = list(cameras), frozenset(holdout)
        self.metrics: Choice = metrics
        self.precision: Precision = precision
        self._backgrounds: dict[int, np.ndarray] = {}

    def measure(
        self,
        clip: Clip,
        model: ClipModel,
        *,
        before: tuple[Clip, ClipModel] | None = None,
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
        chosen = list(clip.frame_indices() if frames is None else frames)
        has_boundary = before is not None and before[0].stop == clip.start and clip.start in chosen
        rows = []
        for camera in self.cameras:
            name, is_held_out = self.capture.rig.names[camera], camera in self.holdout
            last: _Shot | None = None
            for frame in chosen:
                shot = self._shot(clip, model, camera, frame)
                measured = measure_picture(
                    shot.image, shot.pixels, shot.is_moving, metrics=self.metrics, precision=self.precision
                )
                row = EvalRow(clip.clip_index, frame, name, is_held_out, measured.figures, measured.missing)
                rows.append(row)
                if on_row is not None:
                    on_row(row)
                if on_pair is not None:
                    if frame == clip.start and before is not None and has_boundary:
                        on_pair(self._boundary(clip, shot, before, camera)[0])
                    elif last is not None and last.frame_index == frame - 1:
                        on_pair(_pair_row(self._maps(shot, last), clip, frame, name, is_held_out, is_boundary=False))
                last = shot
        return rows

    def boundary_maps(self, before: tuple[Clip, ClipModel], after: tuple[Clip, ClipModel], camera: int) -> SeamMaps:
        """R, G and E of one camera at the boundary between two neighbouring clips, for a picture.

        Raises:
            ValueError: The clips are not neighbours.
        """
        if before[0].stop != after[0].start:
            raise ValueError(f"clips {before[0].clip_index} and {after[0].clip_index} are not neighbours")
        clip, model = after
        return self._boundary(clip, self._shot(clip, model, camera, clip.start), before, camera)[1]

    def _boundary(
        self, clip: Clip, shot: _Shot, before: tuple[Clip, ClipModel], camera: int
    ) -> tuple[PairRow, SeamMaps]:
        clip_before, model_before = before
        last = self._shot(clip_before, model_before, camera, clip.start - 1)
        maps = self._maps(shot, last)
        # the same instant by the clip before: its field may end with its last frame, and the picture with it
        beyond = clip_before.n_frames / clip_before.clip_length
        is_held = model_before.knots(beyond) == model_before.knots(clip_before.clip_time(clip.start - 1))
        image = last.image if is_held else self._render(model_before, camera, beyond)
        two_clips = part_means(change_of(shot.image, image), maps.is_static)
        row = _pair_row(
            maps,
            clip,
            clip.start,
            self.capture.rig.names[camera],
            camera in self.holdout,
            is_boundary=True,
            two_clips=two_clips,
            is_held=is_held,
        )
        return row, maps

    def _shot(self, clip: Clip, model: ClipModel, camera: int, frame: int) -> _Shot:
        pixels = self.capture.frame(camera, frame)
        image = self._render(model, camera, clip.clip_time(frame))
        return _Shot(frame, image, pixels, motion_mask(pixels, self._background(camera)))

    def _render(self, model: ClipModel, camera: int, clip_time: float) -> np.ndarray:
        """Picture in the camera's colours, as it is compared. [H, W, 3] float32"""
        rig, header = self.capture.rig, self.reference.header
        width, height = (int(v) for v in rig.image_sizes[camera])
        view = View.from_arrays(
            rig.world_to_camera[camera], rig.Ks[camera], width=width, height=height, near_plane=header["near_plane"]
        )
        image = render_model(model, view, clip_time, reach=REACH_SPACINGS * header["spacing"]).numpy()
        return as_shown(image * camera_gain(self.reference, rig.names[camera]), self.precision)

    def _background(self, camera: int) -> np.ndarray:
        if camera not in self._backgrounds:
            spread = spread_frames(self.capture.n_frames, _BACKGROUND_FRAMES)
            self._backgrounds[camera] = estimate_background(self.capture.frames_of(camera, spread)).image
        return self._backgrounds[camera]

    def _maps(self, shot: _Shot, last: _Shot) -> SeamMaps:
        truth, last_truth = (s.pixels.astype(np.float32) / np.float32(255.0) for s in (shot, last))
        return seam_maps(shot.image, last.image, truth, last_truth, shot.is_moving | last.is_moving)


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
        part_means(values, maps.is_static) for values in (maps.change, maps.truth_change, maps.excess)
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
        static_share=float(maps.is_static.mean()),
        two_clips_static=two_clips[0],
        two_clips_moving=two_clips[1],
        is_extrapolated=is_boundary,
        is_held=is_held,
    )


def evaluate_clip(
    capture: Capture,
    clip: Clip,
    model: ClipModel,
    *,
    reference: ClipState,
    cameras: Sequence[int],
    holdout: Sequence[int],
    frames: Sequence[int] | None = None,
    metrics: Choice = "all",
    precision: Precision = "float",
    on_row: Callable[[EvalRow], None] | None = None,
) -> list[EvalRow]:
    """One clip by itself; arguments as in Evaluation and its `measure`."""
    evaluation = Evaluation(
        capture, reference=reference, cameras=cameras, holdout=holdout, metrics=metrics, precision=precision
    )
    return evaluation.measure(clip, model, frames=frames, on_row=on_row)
