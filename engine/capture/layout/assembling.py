"""From described cameras to a Layout: the checks that every layout needs, whatever file its numbers come from.

A reader only has to say of each camera where its numbers and its frames are. All problems of a capture are reported
together.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera, SeenFiles, mask_source, seen_files
from engine.capture.files.duplicates import CameraFiles, check_duplicates
from engine.capture.frames import IndexedFrames
from engine.capture.growing.mode import is_growing
from engine.capture.growing.reading import as_long_as_the_longest, check_can_grow, numbered
from engine.capture.layout.format_checks import (
    check_K,
    check_names,
    check_pose,
    raise_problems,
    shortened,
)
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.capture.pixels.frame_fit import FIT_WORDS, FrameFit, OtherSize
from engine.capture.pixels.transfer_curves import CURVES, CurveName
from engine.capture.times.timed_frames import at_common_moments, own_times
from engine.errors import CaptureError
from engine.text import rate_text

THREADS = 4
"""Videos and images looked at side by side: FFmpeg works, or waits for the disk, without the interpreter."""
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
    fit: FrameFit | None = None,
    curve: CurveName | None = None,
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
        fit: The fit of frames that have another shape than their calibration; None where nothing says so.
        curve: Transfer curve of all frames, which their cameras have, too; None keeps values as they are.
        problems: Problems the reader found already; they are reported with the others.
        warnings: The reader's warnings: odd but usable.
        said_in: The file that the cameras come from, for messages.
    Raises:
        CaptureError: Listing every problem found.
    """
    found, said = list(problems), list(warnings)
    said_in = said_in or (cameras[0].said_in if cameras else folder)
    if cameras or not found:
        found += check_names([camera.name for camera in cameras], said_in)
    may_grow = is_growing()
    if may_grow:
        cameras, problems = numbered(cameras, folder)
        found += [*problems, *check_can_grow(cameras, folder)]
    looks: list[Future[SeenFiles]] = []
    looked: dict[tuple[Path, tuple[int, int] | None], Future[SeenFiles]] = {}  # a file of many cameras only once
    with ThreadPoolExecutor(THREADS) as pool:
        for camera in cameras:
            key = (camera.files, camera.calibrated_size) if isinstance(camera.files, Path) else None
            if key is None or camera.frame_indices is not None:
                looks.append(pool.submit(seen_files, camera, is_growing=may_grow))
                continue
            if key not in looked:
                looked[key] = pool.submit(seen_files, camera, is_growing=may_grow)
            looks.append(looked[key])
    entries: list[CameraEntry] = []
    files: dict[str, SeenFiles] = {}
    scaled: list[str] = []
    misfits: list[str] = []
    for camera, look in zip(cameras, looks, strict=True):
        try:
            seen = look.result()
        except CaptureError as error:
            found.append(error.said_of(f'Camera "{camera.name}"'))
            found += _check_numbers(camera, camera.calibrated_size or (0, 0)) if camera.calibrated_size else []
            continue
        files[camera.name] = seen
        wrong = _check_numbers(camera, camera.calibrated_size or seen.size)
        K, calibrated = camera.K, None
        if not wrong and camera.calibrated_size is not None and camera.calibrated_size != seen.size:
            calibrated = OtherSize(camera.K, camera.calibrated_size)
            K = calibrated.fitted_K(seen.size, fit or "scaled")
            sizes = [f"{width}x{height}" for width, height in (seen.size, camera.calibrated_size)]
            said_of = f"{camera.name} {sizes[0]}, calibrated at {sizes[1]}"
            (misfits if any(calibrated.cut_px(seen.size)) else scaled).append(said_of)
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
                    masks=None if camera.masks is None else mask_source(camera.masks, camera.frame_indices),
                    color_matrix=camera.color_matrix,
                    calibrated=calibrated,
                )
            )
    if not found:
        found += check_duplicates({name: CameraFiles(seen.paths, seen.n_bytes) for name, seen in files.items()})
    unknown = [name for name in default_holdout if name not in {camera.name for camera in cameras}]
    if unknown:
        text = f"Held out is {shortened(unknown)}, which the capture does not have."
        found.append(CaptureError(text, hint="Use its camera names.", path=said_in))
    raise_problems(found, folder)
    if may_grow:
        entries = as_long_as_the_longest(entries)
    if scaled:
        said.append(f"Frames have another size than their calibration, which is scaled to them: {shortened(scaled)}.")
    if misfits and fit is None:
        most_px = max(entry.misfit_px for entry in entries)
        said.append(
            f"Frames have another shape than their calibration: {shortened(misfits)}. Unless you choose "
            f"otherwise when opening or with clipgstream inspect --fit, they count as scaled; if they were cropped, "
            f"that is wrong by up to {most_px:.3g} px at the border."
        )
    elif misfits:
        said.append(
            f"Frames have another shape than their calibration, {FIT_WORDS[fit or 'scaled']}: {shortened(misfits)}."
        )
    lying = [name for name, seen in files.items() if seen.is_lying]
    if lying:
        said.append(
            f"Not rotated for display as their files ask, because only the stored orientation fits: {shortened(lying)}."
        )
    stated: set[CurveName] = {seen.stated_curve for seen in files.values() if seen.stated_curve is not None}
    if stated and curve is None:
        titles = " and ".join(sorted(CURVES[name].title for name in stated))
        said.append(
            f"Videos state that they are in {titles}, and are shown as recorded, which is flat or dark. clipgstream "
            f"inspect --curve {min(stated)} converts them."
        )
    offsets = [camera.offset_frames for camera in cameras]
    frame_times_s: Sequence[np.ndarray | None] | None = [camera.frame_times_s for camera in cameras]
    if may_grow:  # one by one: how even they are can only be told at the end
        frame_times_s = None
    elif all(times_s is None for times_s in frame_times_s):
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
        fit=fit,
        curve=curve,
        is_growing=may_grow,
    )


def _check_numbers(camera: DescribedCamera, size: tuple[int, int]) -> list[CaptureError]:
    found = check_K(camera.name, camera.K, size, camera.said_in)
    found += check_pose(camera.name, camera.world_to_camera, camera.said_in)
    if not np.isfinite(camera.lens.params).all():
        hint = "Export the calibration again."
        text = f'Camera "{camera.name}" has NaN or infinity in the parameters of its lens.'
        found.append(CaptureError(text, hint=hint, path=camera.said_in))
    elif np.abs(camera.lens.params).max(initial=0.0) > MAX_LENS or camera.lens.max_radius() < MIN_LENS_RADIUS:
        text = f'The lens of camera "{camera.name}" folds back on itself.'
        found.append(CaptureError(text, hint="Calibrate again, with fewer parameters.", path=camera.said_in))
    if camera.color_matrix is not None and not np.isfinite(camera.color_matrix).all():
        text = f'Camera "{camera.name}" has NaN or infinity in its colour matrix.'
        found.append(CaptureError(text, hint="Correct it or take it out.", path=camera.said_in))
    return found


def _rate(fps: float | None, files: dict[str, SeenFiles], said: list[str]) -> float:
    """Frames per second; adds what is odd about them."""
    rates = {name: seen.rate for name, seen in files.items() if seen.rate > 0}
    if fps is None:
        if not rates:
            said.append(f"The capture states no frame rate; {DEFAULT_FPS:g} per second is assumed.")
            return DEFAULT_FPS
        fps = float(np.median(list(rates.values())))
    others = [f"{name} {rate:g}" for name, rate in rates.items() if abs(rate - fps) > RATE_TOLERANCE * fps]
    if others:
        said.append(
            f"The capture has {rate_text(fps)} frames per second, but these videos state another rate: "
            f"{shortened(others)}. Frames are taken one by one."
        )
    return fps


def _evenness(files: dict[str, SeenFiles]) -> list[bool]:
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
        text = "No frame is common to all cameras."
        raise CaptureError(text, hint="Check the offsets and lengths of the cameras.", path=folder)
    if len(set(counts.tolist())) > 1:
        listed = shortened([f"{entry.name} {count}" for entry, count in zip(entries, counts, strict=True)])
        said.append(f"Cameras differ in length ({listed} frames); the {stop - start} frames they share are used.")
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
