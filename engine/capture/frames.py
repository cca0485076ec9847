"""Pixels on demand: frame sources (image files, video files) behind a cache bounded in bytes.

Nothing here knows about calibration. A source decodes full-size frames of one camera; the FrameStore resizes them to
the working size, keeps the most recently used ones and may be called from several threads.
"""

from __future__ import annotations

import threading
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from av import CodecContext, Packet
from av.video.reformatter import VideoReformatter
from PIL import Image

from engine.byte_cache import ByteCache
from engine.capture.cameras.camera_optics import CameraOptics
from engine.capture.cameras.orientation import UPRIGHT, Turn, turn_of_frame
from engine.capture.files.media import (
    IMAGE_FAULTS,
    IMAGE_KINDS,
    VIDEO_FAULTS,
    VideoHeader,
    open_video,
    opened_video,
    set_pixel_limit,
    shown_pts,
)
from engine.capture.growing.numbered_files import NumberedFiles
from engine.capture.layout.limits import MAX_PIXELS
from engine.capture.pixels.transfer_curves import CurveName, display_levels
from engine.capture.pixels.video_colors import rgb_picture
from engine.errors import CaptureError
from engine.storage.files import open_regular

_DEEP_CODECS = {"PNG": "png", "TIFF": "tiff"}
MAX_DECODER_BYTES = 384 << 20
"""Limit of the decoded frames that all open videos of a capture hold because others refer to them."""
DECODER_BYTES_PER_PIXEL = 24
"""Sixteen frames of one and a half bytes: what H.264 may refer to."""
MAX_FORWARD_DECODE = 64
"""Frames decoded forward before a seek is considered cheaper even inside one group of pictures."""


class FrameSource(Protocol):
    """The frames of one camera at their native size. Implementations are safe to call from several threads."""

    @property
    def path(self) -> Path:
        """File or folder the frames come from."""
        ...

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        ...

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """Decode frames in the order given, each [H, W, 3] uint8 RGB. Raises CaptureError for unreadable data."""
        ...

    def close(self) -> None:
        """Let go of open files; the next read opens them again."""
        ...


class ImageFrames:
    """One image file per frame. Owns paths only. curve: See `rgb_picture`."""

    def __init__(self, folder: Path, files: Sequence[Path], *, curve: CurveName | None = None) -> None:
        self.path = folder
        self.curve: CurveName | None = curve
        self.files = files if isinstance(files, NumberedFiles) else tuple(files)

    @property
    def n_frames(self) -> int:
        """Number of files."""
        return len(self.files)

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """Decode these files, each [H, W, 3] uint8 RGB.

        Raises:
            CaptureError: A file is missing, truncated or no image.
        """
        for frame_index in frame_indices:
            yield read_image(self.files[frame_index], curve=self.curve)

    def close(self) -> None:
        """Nothing is held open between reads."""


def read_image(path: Path, *, curve: CurveName | None = None) -> np.ndarray:
    """Decode one image file, of 8 or 16 bits, to [H, W, 3] uint8 RGB. curve: See `rgb_picture`.

    Raises:
        CaptureError: The file is missing, truncated or no image.
    """
    again = "Copy or export this file again."
    try:
        with open_regular(path) as file, Image.open(file, formats=IMAGE_KINDS) as image:
            if image.width * image.height > MAX_PIXELS:
                raise CaptureError(f"The image is {image.width}x{image.height}.", hint=again, path=path)
            if curve is None and not image.mode.startswith("I;16"):
                return np.asarray(image.convert("RGB"))
            levels = _deep_levels(image, file)
            return display_levels(curve, is_stretched=False)[levels] if curve else (levels >> 8).astype(np.uint8)
    except FileNotFoundError:
        raise CaptureError("The image is missing.", hint="Put the file back or export it again.", path=path) from None
    except IMAGE_FAULTS as error:
        raise CaptureError(
            f"The image cannot be decoded ({error}), so it is truncated or damaged.", hint=again, path=path
        ) from error


def _deep_levels(image: Image.Image, file: BinaryIO) -> np.ndarray:
    """An opened image with 16 bits a channel. [H, W, 3] uint16

    Pillow reads grey ones so, but keeps only 8 bits of colours; those of PNG and TIFF are decoded by FFmpeg.
    """
    if image.mode.startswith("I;16"):
        return np.repeat(np.asarray(image).astype(np.uint16)[..., None], 3, axis=2)
    codec = _DEEP_CODECS.get(image.format or "")
    if codec is None or not any("16" in str(tile[3]) for tile in getattr(image, "tile", ())):
        return np.asarray(image.convert("RGB")).astype(np.uint16) * 257
    file.seek(0)
    decoder: Any = CodecContext.create(codec, "r")
    frames = decoder.decode(Packet(file.read()))
    if not frames:
        raise ValueError("no picture in it")
    return frames[0].to_ndarray(format="rgb48le")


class VideoFrames:
    """One video file, decoded forward from the nearest key frame. Owns one open container and its position.

    Args:
        path: The file.
        n_frames: Number of frames, as its header says.
        is_turned: Whether pictures are turned as the file says; otherwise they come as they are stored.
        is_growing: The file may still be written, so that it need not have so many frames, or may have more.
        curve: See `rgb_picture`.
    """

    def __init__(
        self,
        path: Path,
        n_frames: int,
        *,
        is_turned: bool = True,
        is_growing: bool = False,
        curve: CurveName | None = None,
    ) -> None:
        self.path, self.is_turned, self.is_growing = path, is_turned, is_growing
        self.curve: CurveName | None = curve
        self._n_frames = n_frames
        self._turn: Turn | None = None if is_turned else UPRIGHT  # as its first frame says; None before that
        self._reformatter = VideoReformatter()
        self._lock = threading.Lock()
        self._container: Any = None
        self._decoder: Iterator[Any] = iter(())
        self._pts: list[int] = []  # presentation times of all frames, sorted: position in it = frame index
        self._key_indices: list[int] = []  # frame indices at which decoding can start
        self._next_index = 0  # frame index that the decoder delivers next
        self._has_sought = self._has_overshot = False  # since it was opened; in the last read

    @property
    def n_frames(self) -> int:
        """Number of frames according to the container."""
        return self._n_frames

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """Decode these frames, each [H, W, 3] uint8 RGB; rising indices decode without seeking.

        Raises:
            CaptureError: The video ends early or its data is damaged.
        """
        for frame_index in frame_indices:
            with self._lock:
                picture = self._read_one(frame_index)
            yield picture

    def close(self) -> None:
        """Close the container."""
        with self._lock:
            self._close()

    def _close(self) -> None:
        if self._container is not None:
            self._container.close()
        self._container, self._decoder, self._next_index = None, iter(()), 0

    def _read_one(self, frame_index: int) -> np.ndarray:
        try:
            if self._container is None:
                self._open()
            if frame_index >= len(self._pts):
                raise self._damaged(frame_index, f"it has only {len(self._pts)} so far")
            if self._must_seek(frame_index):
                self._seek(self._key_before(frame_index))
            frame = self._decoded(frame_index)
            n_back = MAX_FORWARD_DECODE
            while frame is None and self._has_overshot:  # seeking in a stream without an index is a guess
                self._seek(frame_index - n_back)
                frame = self._decoded(frame_index)
                n_back *= 4
            if frame is not None:
                if self._turn is None:  # asked once: PyAV never lets go of a frame that was asked
                    self._turn = turn_of_frame(frame)
                return self._turn.upright(rgb_picture(frame, self._reformatter, self.curve))
        except (*VIDEO_FAULTS, OSError, ValueError) as error:  # ValueError: a pixel format that cannot be converted
            self._close()
            raise self._damaged(frame_index, getattr(error, "strerror", None) or "damaged") from error
        self._close()
        raise self._damaged(frame_index, "its data ends or is damaged there")

    def _decoded(self, frame_index: int) -> Any:
        """Decode forward to a frame; None where it does not come. `_has_overshot`: as decoding began behind it."""
        self._has_overshot = False
        is_first = self._has_sought
        for frame in self._decoder:
            index = bisect_left(self._pts, frame.pts) if frame.pts is not None else self._next_index
            self._next_index = index + 1
            if index < frame_index:
                is_first = False
                continue
            self._has_overshot = index > frame_index and is_first
            return None if index > frame_index or frame.is_corrupt else frame
        self._has_overshot = is_first
        return None

    def _damaged(self, frame_index: int, reason: str) -> CaptureError:
        return CaptureError(
            f"Frame {frame_index} of {self._n_frames} cannot be decoded ({reason}).",
            hint="Copy or export this video again.",
            path=self.path,
        )

    def _open(self) -> None:
        if not self._pts:
            self._read_index()
        self._container = open_video(self.path)
        stream = self._container.streams.video[0]
        set_pixel_limit(stream)
        self._decoder = self._container.decode(stream)
        self._next_index, self._has_sought = 0, False

    def _read_index(self) -> None:
        """Collect frame times; packets are read, not decoded. Needed because frame times need not be even."""
        packets: list[tuple[int, bool]] = []
        with opened_video(self.path) as container, suppress(*(VIDEO_FAULTS if self.is_growing else ())):
            for packet in container.demux(container.streams.video[0]):
                if (pts := shown_pts(packet)) is not None:
                    packets.append((pts, packet.is_keyframe))
        times = sorted(pts for pts, _ in packets)
        if len(times) != self._n_frames and not self.is_growing:
            raise CaptureError(
                f"The container announces {self._n_frames} frames but holds {len(times)}.",
                hint="Copy or export this video again, for example as H.264 in mp4.",
                path=self.path,
            )
        self._key_indices = sorted({0, *(bisect_left(times, pts) for pts, is_key in packets if is_key)})
        self._pts = times

    def _must_seek(self, frame_index: int) -> bool:
        ahead = frame_index - self._next_index
        return ahead < 0 or self._key_before(frame_index) > self._next_index or ahead > MAX_FORWARD_DECODE

    def _key_before(self, frame_index: int) -> int:
        """Frame index of the last key frame up to here."""
        return self._key_indices[max(bisect_left(self._key_indices, frame_index + 1) - 1, 0)]

    def _seek(self, frame_index: int) -> None:
        """Go on decoding at this frame or before it; from the beginning where there is nothing to seek by."""
        if frame_index <= 0:
            self._close()
            self._open()
            return
        stream = self._container.streams.video[0]
        self._container.seek(self._pts[frame_index], stream=stream, backward=True)
        self._decoder = self._container.decode(stream)
        self._has_sought = True


def is_turned_as_calibrated(header: VideoHeader, calibrated: tuple[int, int]) -> bool:
    """Whether pictures of a video are to be turned as it says: unless only as stored they are of calibrated shape."""

    def fits(size: tuple[int, int]) -> bool:
        return abs(size[0] * calibrated[1] - size[1] * calibrated[0]) <= 0.01 * size[0] * calibrated[1]

    return fits(header.size) or not fits(header.stored_size)


class IndexedFrames:
    """Frames of another source under other numbers: some of them, some twice. Owns nothing but the numbers."""

    def __init__(self, source: FrameSource, frame_indices: Sequence[int] | np.ndarray) -> None:
        indices = np.asarray(frame_indices, dtype=np.int64)
        is_numbered = isinstance(source, IndexedFrames)
        self.source: FrameSource = source.source if is_numbered else source
        self.path = source.path
        self.frame_indices = source.frame_indices[indices] if is_numbered else indices  # of the source, by number here

    @property
    def n_frames(self) -> int:
        """How many numbers there are."""
        return len(self.frame_indices)

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """Decode these frames, each [H, W, 3] uint8 RGB. Raises CaptureError for unreadable data."""
        return self.source.read([int(self.frame_indices[frame_index]) for frame_index in frame_indices])

    def close(self) -> None:
        """Let go of the source's open files."""
        self.source.close()


class FrameStore:
    """Sources of all cameras, how their pictures are brought to the working size, and the cache.

    What Capture.frame asks.

    Args:
        sources: One per camera.
        optics: Of each camera, from a stored frame to a picture.
        masks: Of each camera, masks of what moves or None; none at all by default.
        cache_bytes: Bound on pictures kept.
    """

    def __init__(
        self,
        sources: Sequence[FrameSource],
        optics: Sequence[CameraOptics],
        *,
        masks: Sequence[FrameSource | None] = (),
        cache_bytes: int,
    ) -> None:
        self.sources = tuple(sources)
        self.masks = tuple(masks) or (None,) * len(self.sources)
        self.optics = tuple(optics)
        self.cache: ByteCache[tuple[int, int], np.ndarray] = ByteCache(cache_bytes)
        self._valid: dict[int, np.ndarray | None] = {}
        self._open: OrderedDict[int, int] = OrderedDict()  # bytes that decoders hold by camera, used longest ago first
        self._open_lock = threading.Lock()

    def valid(self, camera_index: int) -> np.ndarray | None:
        """Pixels that a camera sees. [H, W] bool, read-only, or None where it sees all."""
        if camera_index not in self._valid:
            valid = self.optics[camera_index].valid()
            if valid is not None:
                valid.flags.writeable = False
            self._valid[camera_index] = valid
        return self._valid[camera_index]

    def moving_mask(self, camera_index: int, frame_index: int) -> np.ndarray | None:
        """The moving pixels of a picture. [H, W] bool, or None where the camera has no masks. Raises CaptureError."""
        masks = self.masks[camera_index]
        return None if masks is None else self.optics[camera_index].mask(next(iter(masks.read([frame_index]))))

    def frames(self, camera_index: int, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """Frames of one camera at the working size, each a read-only [H, W, 3] uint8.

        Raises:
            CaptureError: A frame cannot be decoded or is not of the calibrated size.
        """
        for frame_index in frame_indices:
            key = (camera_index, frame_index)
            frame = self.cache.get(key)
            if frame is None:
                frame = self._decode(camera_index, frame_index)
                self.cache.put(key, frame, frame.nbytes)
            yield frame

    def close(self) -> None:
        """Close files and forget cached frames."""
        for source in (*self.sources, *(masks for masks in self.masks if masks is not None)):
            source.close()
        with self._open_lock:
            self._open.clear()
        self.cache.clear()

    def _close_others(self, camera_index: int) -> None:
        """Close files that were used longest ago where decoders would hold too much: all cameras are often asked."""
        width, height = self.optics[camera_index].stored_size
        with self._open_lock:
            self._open[camera_index] = width * height * DECODER_BYTES_PER_PIXEL
            self._open.move_to_end(camera_index)
            closing = []
            while len(self._open) > 1 and sum(self._open.values()) > MAX_DECODER_BYTES:
                closing.append(self._open.popitem(last=False)[0])
        for other in closing:
            self.sources[other].close()

    def _decode(self, camera_index: int, frame_index: int) -> np.ndarray:
        source, optics = self.sources[camera_index], self.optics[camera_index]
        stored = next(iter(source.read([frame_index])))
        self._close_others(camera_index)
        width, height = optics.stored_size
        if stored.shape[:2] != (height, width):
            raise CaptureError(
                f"Frame {frame_index} is {stored.shape[1]}x{stored.shape[0]}, the calibration says {width}x{height}.",
                hint="Export all frames at the calibrated size.",
                path=source.path,
            )
        frame = optics.picture(stored)
        frame.flags.writeable = False  # shared between all callers through the cache
        return frame
