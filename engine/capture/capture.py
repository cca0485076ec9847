"""Capture: synchronised videos of calibrated cameras, opened lazily. Knows the rig and how to fetch a frame.

Opening reads cameras and the frame index only; pixels are decoded when asked for. Nothing is ever written.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.folder_contents import MAX_LOOKED_AT, folder_contents
from engine.capture.format_checks import raise_problems
from engine.capture.format_result import Layout
from engine.capture.formats import panoptic, sample
from engine.capture.frames import FrameStore
from engine.capture.rig_checks import check_rig, rig_extent, rig_warnings
from engine.errors import CaptureError

logger = logging.getLogger(__name__)

FORMATS = (sample, panoptic)
"""Readers in the order they are tried. Each has FORMAT, LAYOUT, probe(folder) and read(folder, follow_links=...)."""
DEFAULT_CACHE_BYTES = 512 << 20
"""Decoded frames kept in memory."""


@dataclass(frozen=True, eq=False)
class Capture:
    """An opened capture. Owns the frame cache; everything else is fixed numbers.

    Attributes:
        path: The folder.
        format: Name of the reader that understood it.
        rig: Cameras at the working size, so that `rig.Ks` fits what `frame` returns.
        n_frames: Frames of every camera.
        fps: Frames per second.
        scale: Requested working size divided by stored size.
        native_rig: Cameras at the size of the stored frames.
        default_holdout: Names of cameras that the capture sets aside for evaluation. May be empty.
        warnings: Plain sentences about what was odd but usable.
        fingerprint: Short hash of format, cameras, sizes and length; the same wherever the folder lies and whatever
            the scale.
        follow_links: Whether the user allowed its files to lie outside of the folder.
    """

    path: Path
    format: str
    rig: CameraRig
    n_frames: int
    fps: float
    scale: float
    native_rig: CameraRig
    default_holdout: tuple[str, ...]
    warnings: tuple[str, ...]
    fingerprint: str
    store: FrameStore = field(repr=False)
    follow_links: bool = False

    def frame(self, camera_index: int, frame_index: int) -> np.ndarray:
        """One picture at the working size. Cached; safe to call from several threads.

        Returns:
            [H, W, 3] uint8 RGB, read-only.
        Raises:
            CaptureError: The file is damaged or not of the calibrated size.
            IndexError: No such camera or frame.
        """
        self._check(camera_index, (frame_index,))
        return next(iter(self.store.frames(camera_index, (frame_index,))))

    def frames_of(self, camera_index: int, frame_indices: Sequence[int]) -> np.ndarray:
        """Several pictures of one camera, decoded in the order given; rising indices are cheap for video.

        Returns:
            [T, H, W, 3] uint8 RGB, an own copy.
        Raises:
            CaptureError: A file is damaged or not of the calibrated size.
            IndexError: No such camera or frame.
        """
        self._check(camera_index, frame_indices)
        width, height = (int(value) for value in self.rig.image_sizes[camera_index])
        frames = np.empty((len(frame_indices), height, width, 3), dtype=np.uint8)
        for row, frame in enumerate(self.store.frames(camera_index, frame_indices)):
            frames[row] = frame
        return frames

    def camera_indices(self, names: Sequence[str]) -> list[int]:
        """Rows of the rig for these camera names, in the order given.

        Raises:
            CaptureError: Names that the capture does not have.
        """
        unknown = [name for name in names if name not in self.rig.names]
        if unknown:
            raise CaptureError(
                f"The capture has no camera called {', '.join(unknown)}.",
                hint=f"Its cameras are {', '.join(self.rig.names)}.",
                path=self.path,
            )
        return [self.rig.names.index(name) for name in names]

    def training_cameras(self, holdout: Collection[int]) -> list[int]:
        """Rows of the rig that are trained on: all but the held-out ones, in order."""
        return [camera for camera in range(len(self.rig)) if camera not in holdout]

    def close(self) -> None:
        """Let go of open files and cached frames. The capture can still be used; files are opened again."""
        self.store.close()

    def _check(self, camera_index: int, frame_indices: Sequence[int]) -> None:
        if not 0 <= camera_index < len(self.rig):
            raise IndexError(f"camera {camera_index} is outside 0..{len(self.rig) - 1}")
        for frame_index in frame_indices:
            if not 0 <= frame_index < self.n_frames:
                raise IndexError(f"frame {frame_index} is outside 0..{self.n_frames - 1}")


def open_capture(
    path: Path | str, *, scale: float = 1.0, cache_bytes: int = DEFAULT_CACHE_BYTES, follow_links: bool = False
) -> Capture:
    """Open a capture folder of any known layout.

    Args:
        path: The folder that holds cameras.json or train_meta.json.
        scale: Working size divided by stored size, in (0, 1]; frames are area-filtered, K scales by the actual
            ratio of the rounded sizes.
        cache_bytes: Bound on decoded frames kept in memory.
        follow_links: Whether files that the capture names may lie outside of its folder. Only where the user said so.
    Raises:
        CaptureError: The folder does not hold a capture, or one that cannot be used; lists every problem found.
    """
    folder = Path(path)
    try:
        layout = _read_layout(folder, follow_links=follow_links)
    except OSError as error:  # rights, a drive that went away, a path too long
        raise CaptureError(
            f"The capture cannot be read ({error.strerror or error}).",
            hint="Check the path, and that you may read all its files.",
            path=error.filename or folder,
        ) from error
    native_rig = layout.rig()
    extent = rig_extent(native_rig)
    raise_problems(check_rig(native_rig, extent, folder), folder)
    rig = native_rig.resized(working_sizes(native_rig.image_sizes, scale, folder))
    store = FrameStore(
        [camera.source for camera in layout.cameras],
        native_sizes=native_rig.image_sizes,
        working_sizes=rig.image_sizes,
        cache_bytes=cache_bytes,
    )
    logger.info("opened %s: %d cameras, %d frames (%s)", folder, len(rig), layout.n_frames, layout.format)
    return Capture(
        path=folder,
        format=layout.format,
        rig=rig,
        n_frames=layout.n_frames,
        fps=layout.fps,
        scale=scale,
        native_rig=native_rig,
        default_holdout=layout.default_holdout,
        warnings=(*layout.warnings, *rig_warnings(native_rig, extent)),
        fingerprint=fingerprint(layout),
        store=store,
        follow_links=follow_links,
    )


def working_sizes(native_sizes: np.ndarray, scale: float, path: Path | None = None) -> np.ndarray:
    """Whole-pixel sizes for a scale. native_sizes and result are [C, 2] width and height.

    Raises:
        CaptureError: scale is not in (0, 1] or leaves an image without pixels.
    """
    if not 0.0 < scale <= 1.0:
        raise CaptureError(f"The scale is {scale:g}.", hint="Give a number above 0 and up to 1.", path=path)
    sizes = np.floor(np.asarray(native_sizes) * scale + 0.5).astype(np.int64)
    if (sizes < 1).any():
        raise CaptureError(f"A scale of {scale:g} leaves no pixels.", hint="Give a larger scale.", path=path)
    return sizes


def fingerprint(layout: Layout) -> str:
    """16 hex digits that change with format, cameras, calibration, sizes, rate or length."""
    rig = layout.rig()
    digest = hashlib.sha256()
    header = (layout.format, layout.n_frames, round(layout.fps, 6), rig.names)
    digest.update(repr(header).encode())
    for array in (rig.world_to_camera, rig.Ks, rig.image_sizes):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def _read_layout(folder: Path, *, follow_links: bool) -> Layout:
    if not folder.exists():
        raise CaptureError("There is no such folder.", hint="Check the path.", path=folder)
    if not folder.is_dir():
        raise CaptureError(
            "This is a file; a capture is a folder.", hint=f"Open {folder.absolute().parent} instead.", path=folder
        )
    reasons = []
    for reader in FORMATS:
        reason = reader.probe(folder)
        if reason is None:
            return reader.read(folder, follow_links=follow_links)
        reasons.append(reason)
    raise _not_a_capture(folder, reasons)


def _not_a_capture(folder: Path, reasons: Sequence[str]) -> CaptureError:
    """What was seen in the folder, what can be read, and what to do."""
    with os.scandir(folder) as entries:
        inside = sorted(entry.name for entry in islice(entries, MAX_LOOKED_AT) if _is_capture(entry))
    if inside:
        hint = f"Open {inside[0]} inside it, which is one."
    else:
        layouts = ", or ".join(reader.LAYOUT for reader in FORMATS)
        hint = f"A capture holds {layouts}. For other recordings write cameras.json, see docs/capture_formats.md."
    return CaptureError(
        f"This folder is not a capture ({'; '.join(reasons)}). In it: {folder_contents(folder)}.",
        hint=hint,
        path=folder,
    )


def _is_capture(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir() and any(reader.probe(Path(entry.path)) is None for reader in FORMATS)
    except OSError:  # a link to itself, a folder that may not be looked into
        return False
