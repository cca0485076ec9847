"""From described cameras to a Layout: the checks that every layout needs, whatever file its numbers come from.

A reader only has to say of each camera where its numbers and its frames are. All problems of a capture are reported
together.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from engine.camera.lens import PINHOLE, Lens
from engine.capture.duplicates import CameraFiles, check_duplicates
from engine.capture.format_checks import (
    check_image_size,
    check_K,
    check_names,
    check_pose,
    raise_problems,
    shortened,
)
from engine.capture.format_result import CameraEntry, Layout
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames, VideoFrames, is_turned_as_calibrated
from engine.capture.media import read_image_header, read_video_header
from engine.capture.timed_frames import at_common_moments, own_times
from engine.errors import CaptureError

THREADS = 4
"""Videos and images looked at side by side: FFmpeg works, or waits for the disk, without the interpreter."""
ASPECT_TOLERANCE = 0.01
"""Share by which the sides of frames and calibration may differ in proportion where one is a smaller copy."""
MAX_LENS = 1e6
"""Largest parameter of a lens; those of the worst calibrations are in the hundreds."""
MIN_LENS_RADIUS = 0.01
"""Half a degree off the axis: a lens that folds back before shows nothing."""
DEFAULT_FPS = 30.0
"""Where nothing says how fast a capture was recorded, as with images."""
CLOCK_TOLERANCE = 0.02
"""Share by which rates of cameras may differ and their frames still be taken one by one."""
RATE_TOLERANCE = 0.01
"""Share by which the rate of a video may differ from that of the capture, as 29.97 does from 30."""


@dataclass(frozen=True, eq=False)
class DescribedCamera:
    """One camera as a layout describes it, not yet checked.

    Attributes:
        name: As the capture calls it.
        K: Intrinsics at the calibrated size, pixel centres at +0.5. [3, 3]
        world_to_camera: OpenCV axes. [4, 4]
        files: Its video, or one image per frame. Places are checked already (`place_in`).
        said_in: The file that its numbers come from, for messages.
        calibrated_size: Width and height that K belongs to; None takes the size of the frames.
        lens: How its lens bends rays.
        masks: A video or one image per frame, bright where something moves; None without.
        color_matrix: New RGB = matrix @ old, on display-encoded values. [3, 3]
        offset_frames: Its own frame is the capture's frame plus this.
        frame_times_s: When each of its frames was taken, in seconds of a clock that all cameras share, rising; None
            where nothing says so. Either all cameras have them or none. [T]
        frame_indices: Numbers of its own frames that the capture shows, in order; None shows all. [T]
    """

    name: str
    K: np.ndarray
    world_to_camera: np.ndarray
    files: Path | Sequence[Path]
    said_in: Path
    calibrated_size: tuple[int, int] | None = None
    lens: Lens = PINHOLE
    masks: Path | Sequence[Path] | None = None
    color_matrix: np.ndarray | None = None
    offset_frames: float = 0.0
    frame_times_s: np.ndarray | None = None
    frame_indices: Sequence[int] | None = None


@dataclass(frozen=True, eq=False)
class _Files:
    """The frames of one camera as their headers tell."""

    source: FrameSource
    size: tuple[int, int]
    rate: float
    paths: Sequence[Path]
    n_bytes: Sequence[int]
    is_even: bool = True
    is_lying: bool = False


def assemble(
    folder: Path,
    format_name: str,
    cameras: Sequence[DescribedCamera],
    *,
    fps: float | None = None,
    default_holdout: Sequence[str] = (),
    points: Path | None = None,
    points_to_world: np.ndarray | None = None,
    fisheye_fov_deg: float | None = None,
    problems: Sequence[CaptureError] = (),
    warnings: Sequence[str] = (),
    said_in: Path | None = None,
) -> Layout:
    """Check described cameras against their files and each other.

    Args:
        folder: The capture folder.
        format_name: Of the reader.
        cameras: In the order in which the capture shall have them.
        fps: Frames per second; None takes that of the videos.
        default_holdout: Names of cameras that the capture sets aside; unknown ones are a problem.
        points, points_to_world: See `Layout`.
        fisheye_fov_deg: See `Layout`.
        problems: What the reader found already; they are reported with the others.
        warnings: What the reader found odd but usable.
        said_in: The file that the cameras come from, for messages.
    Raises:
        CaptureError: Listing every problem found.
    """
    found, said = list(problems), list(warnings)
    said_in = said_in or (cameras[0].said_in if cameras else folder)
    if cameras or not found:
        found += check_names([camera.name for camera in cameras], said_in)
    with ThreadPoolExecutor(THREADS) as pool:
        looks = [pool.submit(_shown, camera) for camera in cameras]
    entries: list[CameraEntry] = []
    files: dict[str, _Files] = {}
    scaled: list[str] = []
    for camera, look in zip(cameras, looks, strict=True):
        try:
            seen = look.result()
        except CaptureError as error:
            found.append(error.said_of(f'Camera "{camera.name}"'))
            found += _check_numbers(camera, camera.calibrated_size or (0, 0)) if camera.calibrated_size else []
            continue
        files[camera.name] = seen
        wrong = _check_numbers(camera, camera.calibrated_size or seen.size)
        K = camera.K
        if not wrong and camera.calibrated_size not in (None, seen.size):
            ratios = np.array(seen.size) / np.array(camera.calibrated_size)
            if abs(ratios[0] / ratios[1] - 1.0) > ASPECT_TOLERANCE:
                wrong += check_image_size(camera.name, seen.size, camera.calibrated_size or seen.size, seen.paths[0])
            else:
                K = K * np.array([[ratios[0]], [ratios[1]], [1.0]])
                scaled.append(f"{camera.name} {seen.size[0]}x{seen.size[1]}, calibrated at {camera.calibrated_size}")
        found += wrong
        if not wrong:
            entries.append(
                CameraEntry(
                    name=camera.name,
                    K=K,
                    world_to_camera=camera.world_to_camera,
                    image_size=seen.size,
                    source=seen.source,
                    lens=camera.lens,
                    masks=None if camera.masks is None else _mask_source(camera.masks, camera.frame_indices),
                    color_matrix=camera.color_matrix,
                )
            )
    if not found:
        found += check_duplicates({name: CameraFiles(seen.paths, seen.n_bytes) for name, seen in files.items()})
    unknown = [name for name in default_holdout if name not in {camera.name for camera in cameras}]
    if unknown:
        text = f"Held out is {shortened(unknown)}, which the capture does not have."
        found.append(CaptureError(text, hint="Use names of its cameras.", path=said_in))
    raise_problems(found, folder)
    if scaled:
        said.append(f"Frames have another size than their calibration, which is scaled to them: {shortened(scaled)}.")
    lying = [name for name, seen in files.items() if seen.is_lying]
    if lying:
        said.append(f"Not turned for display as they ask, because only as stored they fit: {shortened(lying)}.")
    offsets = [camera.offset_frames for camera in cameras]
    frame_times_s: Sequence[np.ndarray | None] | None = [camera.frame_times_s for camera in cameras]
    if all(times_s is None for times_s in frame_times_s):
        frame_times_s = own_times([entry.source for entry in entries], _evenness(files), fps or DEFAULT_FPS)
    if frame_times_s is not None:
        entries, n_frames, rate, note = at_common_moments(entries, frame_times_s, fps, offsets)
        said.append(note)
    else:
        rate = _rate(fps, files, said)
        entries, n_frames = _on_one_clock(entries, offsets, rate, said, folder)
    return Layout(
        format=format_name,
        cameras=tuple(entries),
        n_frames=n_frames,
        fps=rate,
        default_holdout=tuple(dict.fromkeys(default_holdout)),
        warnings=tuple(said),
        points=points,
        points_to_world=points_to_world,
        fisheye_fov_deg=fisheye_fov_deg,
    )


def _check_numbers(camera: DescribedCamera, size: tuple[int, int]) -> list[CaptureError]:
    found = check_K(camera.name, camera.K, size, camera.said_in)
    found += check_pose(camera.name, camera.world_to_camera, camera.said_in)
    if not np.isfinite(camera.lens.params).all():
        hint = "Export the calibration again."
        text = f'Camera "{camera.name}" has NaN or infinity in the parameters of its lens.'
        found.append(CaptureError(text, hint=hint, path=camera.said_in))
    elif np.abs(camera.lens.params).max(initial=0.0) > MAX_LENS or camera.lens.max_radius() < MIN_LENS_RADIUS:
        text = f'The lens of camera "{camera.name}" bends all rays back on themselves.'
        found.append(CaptureError(text, hint="Calibrate again, with fewer parameters.", path=camera.said_in))
    if camera.color_matrix is not None and not np.isfinite(camera.color_matrix).all():
        text = f'Camera "{camera.name}" has NaN or infinity in its colour matrix.'
        found.append(CaptureError(text, hint="Correct it or take it out.", path=camera.said_in))
    return found


def _shown(camera: DescribedCamera) -> _Files:
    """The frames that the capture shows, which then count as evenly recorded."""
    files = _look_at(camera)
    if camera.frame_indices is None:
        return files
    n_frames = files.source.n_frames
    if not camera.frame_indices or not 0 <= min(camera.frame_indices) <= max(camera.frame_indices) < n_frames:
        text = f"The numbers of its frames go beyond the {n_frames} that it has."
        raise CaptureError(text, hint="Correct the list, or take it out.", path=camera.said_in)
    return replace(files, source=IndexedFrames(files.source, camera.frame_indices), rate=0.0, is_even=True)


def _look_at(camera: DescribedCamera) -> _Files:
    """Headers of a video, or of the first, middle and last image: others are looked at when they are decoded."""
    if isinstance(camera.files, Path):
        header = read_video_header(camera.files)
        is_turned = camera.calibrated_size is None or is_turned_as_calibrated(header, camera.calibrated_size)
        size = header.size if is_turned else header.stored_size
        source = VideoFrames(camera.files, header.n_frames, is_turned=is_turned)
        return _Files(source, size, header.rate, [camera.files], [header.n_bytes], header.is_even, not is_turned)
    paths = list(camera.files)
    if not paths:
        raise CaptureError("There are no frames.", hint="Add its frames or take the camera out.", path=camera.said_in)
    rows = sorted({0, len(paths) // 2, len(paths) - 1})
    headers = [read_image_header(paths[row]) for row in rows]
    for row, header in zip(rows, headers, strict=True):
        if header.size != headers[0].size:
            first = f"{headers[0].size[0]}x{headers[0].size[1]}"
            text = f"Its frame {row} is {header.size[0]}x{header.size[1]}, its first one {first}."
            raise CaptureError(text, hint="Export all frames of a camera at one size.", path=paths[row])
    source = ImageFrames(paths[0].parent, paths)
    return _Files(source, headers[0].size, 0.0, paths, [header.n_bytes for header in headers])


def _mask_source(files: Path | Sequence[Path], frame_indices: Sequence[int] | None) -> FrameSource:
    source: FrameSource
    if isinstance(files, Path):
        source = VideoFrames(files, read_video_header(files).n_frames)
    else:
        source = ImageFrames(files[0].parent, files)
    return source if frame_indices is None else IndexedFrames(source, frame_indices)


def _rate(fps: float | None, files: dict[str, _Files], said: list[str]) -> float:
    """Frames per second; adds what is odd about them."""
    rates = {name: seen.rate for name, seen in files.items() if seen.rate > 0}
    if fps is None:
        if not rates:
            said.append(f"Nothing says how many frames per second there are; {DEFAULT_FPS:g} are taken.")
            return DEFAULT_FPS
        fps = float(np.median(list(rates.values())))
    others = [f"{name} {rate:g}" for name, rate in rates.items() if abs(rate - fps) > RATE_TOLERANCE * fps]
    if others:
        said.append(
            f"The capture has {fps:g} frames per second, but these videos state another rate: {shortened(others)}. "
            "Frames are taken one by one."
        )
    return fps


def _evenness(files: dict[str, _Files]) -> list[bool]:
    """Whether frames of each camera may be taken one by one: evenly recorded, at the rate of most cameras."""
    rates = [seen.rate for seen in files.values() if seen.rate > 0]
    usual = float(np.median(rates)) if rates else 0.0
    return [
        seen.is_even and (seen.rate <= 0 or abs(seen.rate - usual) <= CLOCK_TOLERANCE * usual)
        for seen in files.values()
    ]


def _on_one_clock(
    entries: list[CameraEntry], offsets: Sequence[float], fps: float, said: list[str], folder: Path
) -> tuple[list[CameraEntry], int]:
    """The frames that all cameras have, each camera's own moved by its offset, and how many they are."""
    own = np.round(offsets).astype(np.int64)  # a frame between two does not exist
    counts = np.array([entry.source.n_frames for entry in entries])
    start, stop = int(max(0, (-own).max())), int((counts - own).min())
    if stop <= start:
        text = "No frame is left that all cameras have."
        raise CaptureError(text, hint="Check the offsets and lengths of the cameras.", path=folder)
    if len(set(counts.tolist())) > 1:
        listed = shortened([f"{entry.name} {count}" for entry, count in zip(entries, counts, strict=True)])
        said.append(f"Cameras differ in length ({listed} frames); the {stop - start} frames that all have are used.")
    missed_s = np.abs(own - offsets) / fps
    if missed_s.max(initial=0.0) * fps > 0.01:
        said.append(
            f"Offsets in time are taken to the nearest frame: off by {missed_s.mean() * 1000:.1f} ms on average and "
            f"{missed_s.max() * 1000:.1f} ms at worst."
        )
    if not own.any() and start == 0 and (counts == stop).all():
        return entries, stop
    moved = []
    for entry, first in zip(entries, own + start, strict=True):
        indices = np.arange(first, first + stop - start)
        masks = None if entry.masks is None else IndexedFrames(entry.masks, indices)
        moved.append(replace(entry, source=IndexedFrames(entry.source, indices), masks=masks))
    return moved, stop - start
