"""From pixels to clouds: the inputs needed before a clip can be trained.

Reference clip: backgrounds of the training cameras and a dense static cloud first; once the static part has been
trained, its renders correct the backgrounds, and pixels that differ from them are moving. Source clip: the reference's
corrected backgrounds are reused, only the clip's own motion is looked at.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.came_along import came_along
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.capture.exclusions import NOTHING_EXCLUDED, exclusion_key
from engine.capture.layout.format_result import Layout
from engine.capture.points import points_of
from engine.cloud.background.background import estimate_background
from engine.cloud.background.exposure import Exposure
from engine.cloud.background.masks import motion_mask
from engine.cloud.background.motion_masks import MotionMasks
from engine.cloud.background.recheck import recheck_background
from engine.cloud.kept_results import Arrays, Keep, do_now
from engine.cloud.motion.moving_cloud import MovingCloud, build_moving_cloud, motion_bounds
from engine.cloud.stereo.frames_cloud import FramesCloud, build_frames_cloud
from engine.cloud.stereo.given_points import true_points
from engine.cloud.stereo.sparse import triangulate
from engine.cloud.stereo.static_cloud import StaticCloud, build_static_cloud
from engine.errors import CaptureError
from engine.images.rendition import Rendition
from engine.parallel import map_ordered
from engine.progress import Progress, ReportProgress
from engine.storage.array_files import ArraysError, read_arrays, write_arrays
from engine.training.config import TrainConfig
from engine.training.preparation.training_pictures import TrainingPictures

logger = logging.getLogger(__name__)

BACKGROUNDS_FILE = "backgrounds.safetensors"


@dataclass(frozen=True, slots=True)
class Backgrounds:
    """The background of each training camera: its picture when nothing moves.

    Attributes:
        images: [C, H, W, 3] uint8
        is_stable: Pixels whose background is trusted. [C, H, W] bool
    """

    images: np.ndarray
    is_stable: np.ndarray

    @classmethod
    def none(cls) -> Backgrounds:
        """Backgrounds of no camera: for a clip that continues without them."""
        return cls(np.zeros((0, 0, 0, 3), np.uint8), np.zeros((0, 0, 0), bool))

    def equals(self, other: Backgrounds) -> bool:
        """Whether both are the same in every pixel."""
        return np.array_equal(self.images, other.images) and np.array_equal(self.is_stable, other.is_stable)


def blank(pictures: TrainingPictures) -> Backgrounds:
    """Black ones, of which no pixel is trusted: where nothing is compared with them."""
    images = np.zeros((pictures.n_cameras, *pictures.picture(0, 0).shape), np.uint8)
    return Backgrounds(images, np.zeros(images.shape[:3], bool))


def spread_frames(n_frames: int, at_most: int) -> list[int]:
    """Frame indices spread evenly over a capture."""
    count = min(n_frames, at_most)
    return sorted({round(i * (n_frames - 1) / max(count - 1, 1)) for i in range(count)})


def estimate_backgrounds(
    capture: Capture,
    clip: Clip,
    camera_indices: Sequence[int],
    exposures: Sequence[Exposure] | None,
    config: TrainConfig,
    report: ReportProgress,
    keep: Keep = do_now,
) -> Backgrounds:
    """Backgrounds from frames spread over the whole capture, or over the clip with backgrounds=clip.

    Args:
        clip: The clip to prepare.
        exposures: Of each camera, the one that its background comes in; None leaves frames as they are.
    """
    start, stop = _background_range(capture, clip, config)
    frames = [start + frame for frame in spread_frames(stop - start, config.background_frames)]

    def estimate(camera: int, exposure: Exposure | None) -> Arrays:
        pictures = capture.frames_of(camera, frames)
        pictures = pictures if exposure is None else exposure.applied_to(pictures)
        background = estimate_background(pictures, capture.valid(camera))
        masks = [mask for frame in frames if (mask := capture.moving_mask(camera, frame)) is not None]
        if masks:  # a person who stands still for most of the time looks like background, but a mask shows it
            background.is_stable[2 * np.sum(masks, axis=0) > len(masks)] = False
        return {"image": background.image, "is_stable": np.packbits(background.is_stable, axis=-1)}

    images, stable = [], []
    for row, camera in enumerate(camera_indices):
        kept = keep(f"background {row}", partial(estimate, camera, None if exposures is None else exposures[row]))
        images.append(kept["image"])
        stable.append(np.unpackbits(kept["is_stable"], axis=-1, count=kept["image"].shape[1]).astype(bool))
        report(Progress("Looking for what stands still", (row + 1) / len(camera_indices)))
    is_stable = np.stack(stable)
    share = 100 * is_stable.mean()
    report(
        Progress(
            "Looking for what stands still",
            1.0,
            f"{len(frames)} frames each, {share:.0f} % of pixels stable",
        )
    )
    return Backgrounds(np.stack(images), is_stable)


def static_cloud(
    backgrounds: Backgrounds,
    rig: CameraRig,
    is_valid: np.ndarray | None,
    config: TrainConfig,
    report: ReportProgress,
    keep: Keep = do_now,
    layout: Layout | None = None,
) -> StaticCloud:
    """Dense points of still parts, with white balance gains.

    Args:
        is_valid: Pixels that the cameras see; None for all. [C, H, W] bool
        layout: Of the capture, whose own point cloud is used where it is true.
    """

    def build() -> Arrays:
        cloud = _build_static_cloud(backgrounds, rig, is_valid, config, report, keep, layout)
        return {name: np.asarray(getattr(cloud, name)) for name in StaticCloud.__slots__}

    arrays = keep("static cloud", build)
    return StaticCloud(**{**arrays, "spacing": float(arrays["spacing"])})


def _build_static_cloud(
    backgrounds: Backgrounds,
    rig: CameraRig,
    is_valid: np.ndarray | None,
    config: TrainConfig,
    report: ReportProgress,
    keep: Keep,
    layout: Layout | None,
) -> StaticCloud:

    def say(line: str) -> None:
        report(Progress("Building the static cloud", 0.5, line))

    def find_sparse() -> Arrays:
        def alive() -> None:  # a request to stop is noticed here
            report(Progress("Building the static cloud", 0.5))

        return {"points": triangulate(backgrounds.images, rig, is_valid=is_valid, report=say, alive=alive).points}

    sparse_points = keep("sparse points", find_sparse)["points"]
    if layout is not None and layout.points is not None:
        given = keep("given points", lambda: {"points": _given_points(layout, backgrounds, rig, say)})["points"]
        sparse_points = np.concatenate([sparse_points, given])
    return build_static_cloud(
        backgrounds.images,
        backgrounds.is_stable,
        rig,
        is_valid=is_valid,
        max_points=config.max_static_points,
        sparse_points=sparse_points if len(sparse_points) else None,
        color=config.color,
        report=say,
        keep=keep,
    )


def _given_points(layout: Layout, backgrounds: Backgrounds, rig: CameraRig, say: Callable[[str], None]) -> np.ndarray:
    """The points of the cloud that came with a capture in which its cameras agree; none where they do not. [P, 3]"""
    try:
        cloud = points_of(layout)
    except CaptureError as error:
        say(f"The capture's point cloud is not used. {error}")
        return np.zeros((0, 3))
    if cloud is None:
        return np.zeros((0, 3))
    found = true_points(cloud.points, backgrounds.images, backgrounds.is_stable, rig)
    numbers = f"neighbouring cameras agree in {100 * found.share:.0f} % of its {found.n_seen} points that they see"
    say(f"The capture's point cloud is {'used' if found.is_used else 'not used'}: {numbers}")
    return found.points


def without_vignetting(backgrounds: Backgrounds, vignetting: np.ndarray, rig: CameraRig) -> Backgrounds:
    """Backgrounds as lenses would show them that lose nothing towards the rim.

    Args:
        vignetting: See engine.images.rendition. [C, 2]
        rig: Of the training cameras.
    """
    plain = np.ones(3)

    def correct(row: int) -> np.ndarray:
        seen = Rendition.of(plain, vignetting[row], rig.Ks[row], rig.image_sizes[row])
        return seen.to_scene(backgrounds.images[row])

    return Backgrounds(np.stack(map_ordered(correct, range(len(rig)))), backgrounds.is_stable)


def correct_backgrounds(
    backgrounds: Backgrounds,
    pictures: TrainingPictures,
    render_static: Callable[[int], np.ndarray],
    report: ReportProgress,
    keep: Keep = do_now,
) -> Backgrounds:
    """Backgrounds corrected by the trained static part, which knows what other cameras saw behind a person.

    Args:
        render_static: Camera row to the static render in that camera's colours. [H, W, 3] float
    """
    corrected = backgrounds.images.copy()

    def correct(row: int) -> Arrays:
        image = recheck_background(
            backgrounds.images[row],
            backgrounds.is_stable[row],
            render_static(row),
            pictures.of_camera(row),
            pictures.valid(row),
        )
        return {"image": image}

    for row in range(len(corrected)):
        corrected[row] = keep(f"corrected background {row}", partial(correct, row))["image"]
        report(Progress("Checking backgrounds", (row + 1) / len(corrected)))
    changed = 100 * (corrected != backgrounds.images).any(-1).mean()
    report(
        Progress(
            "Checking backgrounds",
            1.0,
            f"{changed:.1f} % of pixels taken from the static render",
        )
    )
    return Backgrounds(corrected, backgrounds.is_stable)


def motion_masks(
    pictures: TrainingPictures,
    backgrounds: Backgrounds,
    brightness: Callable[[int, int], np.ndarray] | None,
    report: ReportProgress,
    keep: Keep = do_now,
) -> MotionMasks:
    """The pixels that differ from the background, per frame and camera.

    Args:
        brightness: (camera row, frame in clip) -> factor by which light changes the background [H, W, 1]; None where it
            does not.
    """
    n_frames, n_cameras = pictures.clip.n_frames, len(pictures.camera_indices)
    masks = MotionMasks(n_frames, *backgrounds.is_stable.shape)

    def find(row: int) -> Arrays:
        background = backgrounds.images[row]
        found = [
            moving_pixels(
                pictures.picture(row, frame),
                background if brightness is None else background * brightness(row, frame),
                pictures.capture,
                pictures.camera_indices[row],
                pictures.clip.start + frame,
            )
            for frame in range(n_frames)
        ]
        return {"masks": np.packbits(np.stack(found), axis=-1)}

    for row in range(n_cameras):
        masks.put_camera(row, keep(f"motion masks {row}", partial(find, row))["masks"])
        report(Progress("Finding what moves", (row + 1) / n_cameras))
    report(Progress("Finding what moves", 1.0, f"{100 * masks.share:.1f} % of pixels move"))
    return masks


def moving_pixels(
    picture: np.ndarray, background: np.ndarray, capture: Capture, camera_index: int, frame_index: int
) -> np.ndarray:
    """The moving pixels of one picture: those that differ from the background or lie in a capture's mask. [H, W] bool

    Both together: masks are mostly of people and things, without the shadows that go with them.

    Args:
        picture: In the exposure of the background. [H, W, 3] uint8
        background: [H, W, 3] uint8 or float 0..255
        camera_index, frame_index: Of the picture, in the numbering of the capture.
    """
    found = motion_mask(picture, background, is_valid=capture.valid_in(camera_index, frame_index))
    masked = capture.moving_mask(camera_index, frame_index)
    if masked is None:
        return found
    valid = capture.valid_in(camera_index, frame_index) if capture.exclusions != NOTHING_EXCLUDED else None
    return found | (masked if valid is None else masked & valid)


def stable_in_clip(backgrounds: Backgrounds, pictures: TrainingPictures, masks: MotionMasks) -> Backgrounds:
    """Backgrounds in the light of a clip: where a camera sees something stand still in most frames, their mean.

    Args:
        masks: The moving pixels of the same pictures.
    Returns:
        Trusted are the pixels that were seen so; the others are as they were.
    """
    n_frames, n_cameras, _, _ = masks.shape

    def seen(row: int) -> tuple[np.ndarray, np.ndarray]:
        is_still = ~masks.of_camera(row)
        for frame in range(n_frames):
            valid = pictures.valid_in(row, frame)
            if valid is not None:
                is_still[frame] &= valid
        sums = np.zeros(backgrounds.images[row].shape, np.int32)
        for frame in range(n_frames):
            sums += np.where(is_still[frame, ..., None], pictures.picture(row, frame), np.uint8(0))
        n_still = is_still.sum(0)[..., None]
        means = np.floor(sums / np.maximum(n_still, 1) + 0.5).astype(np.uint8)
        is_seen = 2 * n_still > n_frames
        valid = pictures.valid(row)
        if valid is not None:
            is_seen &= valid[..., None]
        return np.where(is_seen, means, backgrounds.images[row]), is_seen[..., 0]

    images, is_seen = zip(*map_ordered(seen, range(n_cameras)), strict=True)
    return Backgrounds(np.stack(images), np.stack(is_seen))


def filled_from_render(
    backgrounds: Backgrounds, render_static: Callable[[int], np.ndarray], is_valid: np.ndarray | None
) -> Backgrounds:
    """Backgrounds of a trained clip: where nothing was seen to stand still, the render of its static anchors.

    There a person stood, or a shadow lay, and the anchors may have taken on its darkness: clips that inherit them have
    to compare with that.

    Args:
        render_static: Camera row to the static render in that camera's colours. [H, W, 3] float
        is_valid: Pixels that the cameras see, None for all; the others stay black. [C, H, W] bool
    """
    images = backgrounds.images.copy()
    for row, is_seen in enumerate(backgrounds.is_stable):
        render = render_static(row)
        is_shown = ~is_seen & np.asarray(np.isfinite(render).all(-1))
        if is_valid is not None:
            is_shown &= is_valid[row]
        images[row][is_shown] = np.floor(np.clip(render[is_shown], 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
    return Backgrounds(images, backgrounds.is_stable)


def frames_cloud(
    pictures: TrainingPictures,
    rig: CameraRig,
    config: TrainConfig,
    report: ReportProgress,
    *,
    spacing: float | None = None,
    gains: np.ndarray | None = None,
    keep: Keep = do_now,
) -> FramesCloud:
    """Dense points of everything in a clip, frame by frame, with cloud=frames.

    Args:
        spacing: The reference clip's for a source clip; None derives it from the pixel footprint.
        gains: White balance gains where they are known; None measures them as `config.color` says. [C, 3]
    """

    def say(line: str) -> None:
        report(Progress("Building the cloud", 0.5, line))

    def sparse_points(images: np.ndarray, is_valid: np.ndarray | None) -> np.ndarray:
        def alive() -> None:  # a request to stop is noticed here
            report(Progress("Building the cloud", 0.5))

        return triangulate(images, rig, is_valid=is_valid, report=say, alive=alive).points

    return build_frames_cloud(
        pictures.picture,
        pictures.clip.n_frames,
        rig,
        valid_in=pictures.valid_in_frame,
        max_points=config.max_static_points + config.max_moving_points,
        spacing=spacing,
        find_sparse=sparse_points,
        gains=gains,
        color=config.color,
        report=say,
        keep=keep,
    )


def moving_cloud(
    pictures: TrainingPictures,
    masks: MotionMasks,
    rig: CameraRig,
    gains: np.ndarray,
    static_points: np.ndarray,
    config: TrainConfig,
    report: ReportProgress,
    *,
    voxel_size: float | None,
    keep: Keep = do_now,
) -> MovingCloud:
    """Surface points of moving parts over the frames of the clip, with the frames each exists in.

    Args:
        voxel_size: The reference clip's for a source clip, so that the same place gives the same anchors; None
            derives it from the pixel footprint.
    """

    def say(line: str) -> None:
        report(Progress("Carving what moves", 0.5, line))

    lower, upper = motion_bounds(static_points, rig)
    return build_moving_cloud(
        pictures.picture,
        masks,
        rig,
        gains,
        bounds_min=lower,
        bounds_max=upper,
        valid_in=pictures.valid_in_frame,
        max_points=config.max_moving_points,
        voxel_size=voxel_size,
        travels=config.anchors_travel,
        report=say,
        keep=keep,
    )


def _background_range(capture: Capture, clip: Clip, config: TrainConfig) -> tuple[int, int]:
    return (clip.start, clip.stop) if config.backgrounds == "clip" else (0, capture.n_frames)


def key_of_corrected(capture: Capture, clip: Clip, camera_indices: Sequence[int], config: TrainConfig) -> dict:
    """The key of corrected backgrounds, as `write_backgrounds` keeps it next to them.

    Args:
        clip: The clip they were estimated for.
    """
    rig = capture.rig.subset(list(camera_indices))
    excluded = exclusion_key(capture.exclusions, _background_range(capture, clip, config))
    return came_along(capture.layout) | {
        "capture": capture.start_key if config.backgrounds == "clip" else capture.part_key,
        "cameras": list(rig.names),
        "size": [int(side) for side in rig.image_sizes[0]],
        "frames": config.background_frames,
        "is_corrected": True,
        "is_without_vignetting": True,
        **({"excluded": excluded} if excluded else {}),
        **({"of": [clip.start, clip.stop]} if config.backgrounds == "clip" else {}),
    }


def write_backgrounds(prep_dir: Path, backgrounds: Backgrounds, key: dict) -> None:
    """Keep backgrounds for source clips and resumed trainings, atomically. `key` says what they belong to.

    Raises:
        DiskError: The disk refused.
    """
    arrays = {
        "images": backgrounds.images,
        "is_stable": np.packbits(backgrounds.is_stable, axis=-1),
    }
    metadata = {"key": json.dumps(key, sort_keys=True)}
    write_arrays(prep_dir / BACKGROUNDS_FILE, arrays, metadata, what="The backgrounds")


def read_backgrounds(prep_dir: Path, key: dict) -> Backgrounds | None:
    """Backgrounds kept earlier, or None when there are none for this key, or the file is damaged or does not fit it."""
    path = prep_dir / BACKGROUNDS_FILE
    try:
        arrays, metadata = read_arrays(path, ("key",))
        images, packed = arrays["images"], arrays["is_stable"]
    except FileNotFoundError:
        return None
    except (OSError, ArraysError, KeyError) as error:
        logger.warning("the stored backgrounds cannot be read (%s) and are rebuilt - %s", error, path)
        return None  # a cache: estimated again by the caller
    if metadata.get("key") != json.dumps(key, sort_keys=True):
        return None
    (width, height), n_cameras = key["size"], len(key["cameras"])
    shapes = [(n_cameras, height, width, 3), (n_cameras, height, (width + 7) // 8)]
    if [images.shape, packed.shape] != shapes or {images.dtype, packed.dtype} != {np.dtype(np.uint8)}:
        logger.warning("the stored backgrounds do not match the cameras and are rebuilt - %s", path)
        return None
    return Backgrounds(images, np.unpackbits(packed, axis=-1, count=width).astype(bool))
