"""Capture: synchronised videos of calibrated cameras, opened lazily. Knows the rig and how to fetch a frame.

Opening reads cameras and the frame index only; pixels are decoded when asked for. Nothing is ever written.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.cameras.camera_optics import CameraOptics
from engine.capture.cameras.rig_checks import check_rig, rig_extent, rig_warnings
from engine.capture.exclusions import NOTHING_EXCLUDED, Exclusions
from engine.capture.formats.imported import raise_no_pictures
from engine.capture.formats.table import read_layout
from engine.capture.frames import FrameStore, IndexedFrames
from engine.capture.growing.mode import reading
from engine.capture.growing.reading import stretched
from engine.capture.layout.format_checks import raise_problems
from engine.capture.layout.format_result import Layout
from engine.capture.pixels.excluded_pixels import ExcludedPixels
from engine.capture.pixels.undistortion import Undistortion
from engine.errors import CaptureError

logger = logging.getLogger(__name__)

DEFAULT_CACHE_BYTES = 512 << 20
"""Decoded frames kept in memory."""
ONE_PASS_CACHE_BYTES = 32 << 20
"""The same for those who look at each picture once."""


@dataclass(frozen=True, eq=False)
class Capture:
    """An opened capture. Owns the frame cache; everything else is fixed numbers.

    Attributes:
        path: The folder.
        format: Name of the reader that understood it.
        rig: Pinhole cameras at the working size, so that `rig.Ks` fits what `frame` returns.
        n_frames: Frames of every camera that are worked on.
        fps: Frames per second.
        scale: Requested working size divided by stored size.
        native_rig: The same at the size of the stored frames.
        default_holdout: Names of cameras that the capture sets aside for evaluation. May be empty.
        warnings: Plain sentences about what was odd but usable.
        fingerprint: Short hash of format, cameras, sizes and length; the same wherever the folder lies and whatever
            the scale.
        follow_links: Whether the user allowed its files to lie outside of the folder.
        first_frame: Where those frames begin in the whole capture. Everywhere else frames are counted from there.
        exclusions: The parts that training does not see; see `without`.
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
    layout: Layout = field(repr=False)
    follow_links: bool = False
    first_frame: int = 0
    exclusions: Exclusions = NOTHING_EXCLUDED
    _excluded: ExcludedPixels | None = field(default=None, repr=False)

    def without(self, exclusions: Exclusions) -> Capture:
        """The same capture as training sees it: without what is excluded. Files and decoded frames are shared.

        An excluded camera is none of the cameras that are trained on, and an excluded picture or pixel is not usable
        (`is_usable`, `valid_in`); in its place `frame` shows that of another frame of the camera.

        Args:
            exclusions: In place of those it has. Frames are counted as everywhere.
        """
        if exclusions == self.exclusions:
            return self
        excluded = None
        if exclusions != NOTHING_EXCLUDED:
            excluded = ExcludedPixels(exclusions, self.rig.names, self.n_frames, self.picture_size)
        return replace(self, exclusions=exclusions, _excluded=excluded)

    @property
    def frames(self) -> tuple[int, int] | None:
        """First frame of the whole capture that is worked on, and the one after the last; None where that is all."""
        chosen = self.first_frame, self.first_frame + self.n_frames
        return None if chosen == (0, self.layout.n_frames) and not self.is_growing else chosen

    @property
    def is_growing(self) -> bool:
        """Whether it may still be recorded; see `open_capture`."""
        return self.layout.is_growing

    @property
    def has_pictures(self) -> bool:
        """Whether its cameras took pictures; those of an imported scene are views only."""
        return self.layout.has_pictures

    def check_pictures(self) -> None:
        """Refuse work that needs pictures where there are none. Raises CaptureError."""
        if not self.has_pictures:
            raise_no_pictures(self.path)

    def grown(self, n_frames: int) -> Capture:
        """The same capture with more frames, which have come since it was read. Files are not read again.

        Raises:
            CaptureError: It is not one that grows.
        """
        if not self.is_growing:
            raise CaptureError("The capture was opened as complete, so that it cannot grow.", path=self.path)
        stop = max(self.first_frame + n_frames, self.layout.n_frames)
        cameras = tuple(replace(camera, source=stretched(camera.source, stop)) for camera in self.layout.cameras)
        layout = replace(self.layout, cameras=cameras, n_frames=stop)
        frames = (self.first_frame, self.first_frame + n_frames)
        cache_bytes = self.store.cache.max_bytes
        return _make_capture(layout, self.path, self.scale, frames, cache_bytes, follow_links=self.follow_links)

    @property
    def start_key(self) -> str:
        """The fingerprint, and which frame is the first where that is not the capture's: a key of whatever depends on
        frames that are counted, however many there are."""
        return self.fingerprint if self.first_frame == 0 else f"{self.fingerprint}:{self.first_frame}:"

    @property
    def part_key(self) -> str:
        """The fingerprint, and which frames are worked on where these are not all."""
        return self.fingerprint if self.frames is None else f"{self.fingerprint}:{self.frames[0]}:{self.frames[1]}"

    def resized(self, scale: float, frames: tuple[int, int] | None = None) -> Capture:
        """The same capture at another working size, and other frames of it, without reading its files again.

        Args:
            scale: See `open_capture`.
            frames: Likewise.
        Raises:
            CaptureError: A scale or frames that are not possible.
        """
        cache_bytes = self.store.cache.max_bytes
        return _make_capture(self.layout, self.path, scale, frames, cache_bytes, follow_links=self.follow_links)

    def frame(self, camera_index: int, frame_index: int) -> np.ndarray:
        """One picture at the working size. Cached; safe to call from several threads.

        Returns:
            [H, W, 3] uint8 RGB, read-only.
        Raises:
            CaptureError: The file is damaged or not of the calibrated size.
            IndexError: No such camera or frame.
        """
        self._check(camera_index, (frame_index,))
        return self._picture(camera_index, frame_index)

    def _stored(self, camera_index: int, frame_index: int) -> np.ndarray:
        return next(iter(self.store.frames(camera_index, (self.first_frame + frame_index,))))

    def _picture(self, camera_index: int, frame_index: int) -> np.ndarray:
        """A picture without what is excluded of it. One that is excluded altogether is not read: it may be missing.
        [H, W, 3] uint8, read-only"""
        is_excluded = None if self._excluded is None else self._excluded.of(camera_index, frame_index)
        if self._excluded is None or is_excluded is None:
            return self._stored(camera_index, frame_index)
        if is_excluded.all():
            filled = np.zeros((*is_excluded.shape, 3), np.uint8)
        else:
            filled = self._stored(camera_index, frame_index).copy()
        sources, left = self._excluded.fills(camera_index, frame_index)
        for frame, pixels in sources:
            filled[pixels] = self._stored(camera_index, frame)[pixels]
        if left is not None:
            filled[left] = 0
        filled.flags.writeable = False
        return filled

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
        for row, frame_index in enumerate(frame_indices):
            frames[row] = self._picture(camera_index, frame_index)
        return frames

    def is_usable(self, camera_index: int, frame_index: int) -> bool:
        """Whether anything of a picture is left to be trained on and measured.

        Raises:
            IndexError: No such camera or frame.
        """
        self._check(camera_index, (frame_index,))
        is_excluded = None if self._excluded is None else self._excluded.of(camera_index, frame_index)
        return is_excluded is None or not is_excluded.all()

    def valid_in(self, camera_index: int, frame_index: int) -> np.ndarray | None:
        """Pixels of one picture that count: those that the camera sees and that are not excluded.

        Returns:
            [H, W] bool, read-only; None where all count.
        Raises:
            IndexError: No such camera or frame.
        """
        self._check(camera_index, (frame_index,))
        valid = self.store.valid(camera_index)
        is_excluded = None if self._excluded is None else self._excluded.of(camera_index, frame_index)
        if is_excluded is None:
            return valid
        return ~is_excluded if valid is None else valid & ~is_excluded

    def valid(self, camera_index: int) -> np.ndarray | None:
        """Pixels that a camera sees and that are not excluded in all of its frames; the others are black.

        Returns:
            [H, W] bool, read-only; None where it sees all.
        Raises:
            IndexError: No such camera.
        """
        self._check(camera_index, ())
        valid = self.store.valid(camera_index)
        is_excluded = None if self._excluded is None else self._excluded.always(camera_index)
        if is_excluded is None:
            return valid
        return ~is_excluded if valid is None else valid & ~is_excluded

    def valid_of(self, camera_indices: Sequence[int]) -> np.ndarray | None:
        """`valid` of several cameras. [C, H, W] bool, or None where all of them see all."""
        found = [self.valid(camera) for camera in camera_indices]
        if all(valid is None for valid in found):
            return None
        width, height = self.picture_size
        return np.stack([np.ones((height, width), bool) if valid is None else valid for valid in found])

    def moving_mask(self, camera_index: int, frame_index: int) -> np.ndarray | None:
        """The moving pixels of a picture according to masks that came with the capture. Decoded anew at every call.

        Returns:
            [H, W] bool at the working size, undistorted as the picture is; None where the camera has no masks.
        Raises:
            CaptureError: The mask cannot be decoded.
            IndexError: No such camera or frame.
        """
        self._check(camera_index, (frame_index,))
        return self.store.moving_mask(camera_index, self.first_frame + frame_index)

    @property
    def has_masks(self) -> tuple[bool, ...]:
        """Which cameras have masks of what moves."""
        return tuple(camera.masks is not None for camera in self.layout.cameras)

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of every picture."""
        width, height = self.rig.image_sizes[0]
        return int(width), int(height)

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
        """Rows of the rig that are trained on: all but the held-out ones and the excluded ones, in order."""
        left_out = {*holdout, *self.excluded_cameras}
        return [camera for camera in range(len(self.rig)) if camera not in left_out]

    @property
    def excluded_cameras(self) -> list[int]:
        """Rows of the rig that are excluded altogether, in order."""
        return [row for row, name in enumerate(self.rig.names) if name in self.exclusions.cameras]

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
    path: Path | str,
    *,
    scale: float = 1.0,
    frames: tuple[int, int] | None = None,
    cache_bytes: int = DEFAULT_CACHE_BYTES,
    follow_links: bool = False,
    is_shape_asked: bool = False,
    is_growing: bool = False,
) -> Capture:
    """Open a capture folder of any known layout.

    Args:
        path: The capture folder.
        scale: Working size divided by stored size, in (0, 1]; frames are area-filtered, K scales by the actual
            ratio of the rounded sizes.
        frames: First frame to work on and the one after the last; None for all. The capture then looks as if there were
            no others.
        cache_bytes: Bound on decoded frames kept in memory.
        follow_links: Whether files that the capture names may lie outside of its folder. Only where the user said so.
        is_shape_asked: Whether frames of quite another shape than their calibration are taken as scaled instead of
            refused: for those who ask the user what became of them.
        is_growing: Whether it may still be recorded: it then has the frames of its farthest camera, of which others may
            lack some, images count by the numbers in their names, and its length does not count in its fingerprint.
    Raises:
        CaptureError: The folder does not hold a capture, or one that cannot be used; lists every problem found.
    """
    folder = Path(path)
    _check_scale(scale, folder)
    try:
        with reading(is_growing=is_growing):
            layout = read_layout(folder, follow_links=follow_links)
        if is_growing and not layout.is_growing:
            raise CaptureError(
                f"Captures of this layout ({layout.format}) are only read once they are complete.",
                hint="Wait for the end of the recording, then use clipgstream train.",
                path=folder,
            )
        if not is_shape_asked:
            raise_problems(check_shapes(layout), folder)
    except OSError as error:  # rights, a drive that went away, a path too long
        raise CaptureError(
            f"The capture cannot be read ({error.strerror or error}).",
            hint="Check the path, and that you may read all its files.",
            path=error.filename or folder,
        ) from error
    return _make_capture(layout, folder, scale, frames, cache_bytes, follow_links=follow_links)


def _make_capture(
    layout: Layout,
    folder: Path,
    scale: float,
    frames: tuple[int, int] | None,
    cache_bytes: int,
    *,
    follow_links: bool,
) -> Capture:
    _check_scale(scale, folder)
    first, stop = (0, layout.n_frames) if frames is None else frames
    if not 0 <= first < stop <= layout.n_frames:
        raise CaptureError(
            f"Frames {first}:{stop} are not all in the capture.",
            hint=f"It has frames 0 to {layout.n_frames - 1}; write 0:{layout.n_frames} for all of them.",
            path=folder,
        )
    native_rig = layout.rig()
    extent = rig_extent(native_rig)
    raise_problems(check_rig(native_rig, extent, folder), folder)
    rig, optics = _working_rig(layout, native_rig, scale, folder)
    store = FrameStore(
        [camera.source for camera in layout.cameras],
        optics,
        masks=[camera.masks for camera in layout.cameras],
        cache_bytes=cache_bytes,
    )
    logger.info("opened %s: %d cameras, %d frames (%s)", folder, len(rig), stop - first, layout.format)
    return Capture(
        path=folder,
        format=layout.format,
        rig=rig,
        n_frames=stop - first,
        fps=layout.fps,
        scale=scale,
        native_rig=native_rig,
        default_holdout=layout.default_holdout,
        warnings=(*layout.warnings, *rig_warnings(native_rig, extent)),
        fingerprint=fingerprint(layout),
        store=store,
        layout=layout,
        follow_links=follow_links,
        first_frame=first,
    )


def _check_scale(scale: float, folder: Path) -> None:
    if not 0.0 < scale <= 1.0:
        raise CaptureError(f"The scale is {scale:g}.", hint="Give a number above 0 and up to 1.", path=folder)


def _working_rig(
    layout: Layout, native_rig: CameraRig, scale: float, folder: Path
) -> tuple[CameraRig, list[CameraOptics]]:
    """The cameras at the working size, all of one size, and how the pictures of each get there.

    Where frames differ in size, each camera's longer side is brought to that of the smallest, and what is then still
    missing at the right and lower border is not valid.
    """
    longest = native_rig.image_sizes.max(axis=1)
    inner_sizes = working_sizes(native_rig.image_sizes, scale * longest.min() / longest, folder)
    inner = native_rig.resized(inner_sizes)
    picture_size = (int(inner_sizes[:, 0].max()), int(inner_sizes[:, 1].max()))
    optics = []
    for row, entry in enumerate(layout.cameras):
        inner_size = (int(inner_sizes[row, 0]), int(inner_sizes[row, 1]))
        undistortion = None
        if not entry.lens.is_pinhole:
            undistortion = Undistortion(entry.lens, entry.K, entry.image_size, inner.Ks[row], inner_size)
        optics.append(CameraOptics(entry.image_size, inner_size, picture_size, undistortion, entry.color_matrix))
    return replace(inner, image_sizes=np.tile(np.array(picture_size, np.int64), (len(inner), 1))), optics


def working_sizes(native_sizes: np.ndarray, scales: np.ndarray, path: Path | None = None) -> np.ndarray:
    """Whole-pixel sizes for scales. native_sizes and result are [C, 2] width and height, scales [C].

    Raises:
        CaptureError: A scale leaves an image without pixels.
    """
    sizes = np.floor(np.asarray(native_sizes) * np.asarray(scales)[:, None] + 0.5).astype(np.int64)
    if (sizes < 1).any():
        scale = f"{np.max(scales):g}"
        raise CaptureError(f"A scale of {scale} leaves no pixels.", hint="Give a larger scale.", path=path)
    return sizes


def fingerprint(layout: Layout) -> str:
    """16 hex digits that change with format, cameras, calibration, sizes, rate or length. While a capture may still be
    recorded, rate and length do not count: a video grows into its rate."""
    rig = layout.rig()
    digest = hashlib.sha256()
    length = ("growing",) if layout.is_growing else (layout.n_frames, round(layout.fps, 6))
    curve = () if layout.curve is None else (layout.curve,)
    header = (layout.format, *length, rig.names, *curve)
    digest.update(repr(header).encode())
    for array in (rig.world_to_camera, rig.Ks, rig.image_sizes):
        digest.update(np.ascontiguousarray(array).tobytes())
    for camera in layout.cameras:  # nothing of ordinary cameras, whose fingerprint is as it was before these were read
        if not camera.lens.is_pinhole:
            digest.update(repr((camera.name, camera.lens, camera.K.tolist())).encode())
        if camera.color_matrix is not None:
            digest.update(repr((camera.name, camera.color_matrix.tolist())).encode())
        if isinstance(camera.source, IndexedFrames):
            n_known = 1 if layout.is_growing else None
            digest.update(camera.source.frame_indices[:n_known].tobytes())
    return digest.hexdigest()[:16]


def check_shapes(layout: Layout) -> list[CaptureError]:
    """Cameras whose frames are of quite another shape than their calibration, where nothing says why."""
    problems = []
    for entry in layout.far_off:
        assert entry.calibrated is not None
        sizes = [f"{width}x{height}" for width, height in (entry.image_size, entry.calibrated.size)]
        problems.append(
            CaptureError(
                f'Camera "{entry.name}" has {sizes[0]} frames, its calibration is for {sizes[1]}.',
                hint="Choose whether they were scaled or cropped when opening the folder, or with clipgstream inspect "
                "--fit. Or export the calibration for this size.",
                path=entry.source.path,
            )
        )
    return problems
