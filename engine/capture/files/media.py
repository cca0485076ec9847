"""The facts in the headers of images and videos. No pixel is decoded; nothing but regular files is opened.

Decoding libraries are given the kinds of files that they may open: other kinds can name further files, or start
programs, when they are opened.
"""

from __future__ import annotations

import os
import struct
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import av.error
import numpy as np
from PIL import Image

from engine.capture.cameras.orientation import UPRIGHT, Turn, may_be_turned, turn_of_frame
from engine.capture.layout.limits import MAX_PIXELS
from engine.capture.pixels.transfer_curves import STATED, CurveName
from engine.errors import CaptureError
from engine.storage.files import check_regular, open_regular

END_BYTES = 64
"""Bytes at the end of an image file searched for its end marker; some writers pad behind it."""
IMAGE_KINDS = ("JPEG", "PNG", "BMP", "TIFF", "WEBP", "PPM")
VIDEO_KINDS = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mxf,h264,hevc,ivf"
IMAGE_FAULTS = (
    *(OSError, SyntaxError, ValueError, TypeError, EOFError, LookupError, ArithmeticError, struct.error, zlib.error),
    *(Image.DecompressionBombError, Image.DecompressionBombWarning, MemoryError),
)
"""Pillow's errors for damaged images."""
VIDEO_FAULTS = (av.error.FFmpegError, UnicodeError, ArithmeticError, MemoryError)
"""PyAV's errors for damaged videos. It also raises a kind of ValueError for a file without streams."""
_ORIENTATION = 0x0112
"""The EXIF entry that says how to turn a picture for display; 1 is upright."""


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """The facts in an image file's header.

    Attributes:
        size: Width and height as stored.
        n_bytes: Size of the file.
        orientation: EXIF orientation; 1 is upright, 3 upside down, 5 to 8 lie on their side.
    """

    size: tuple[int, int]
    n_bytes: int
    orientation: int


def read_image_header(path: Path) -> ImageHeader:
    """Width, height and orientation of an image file that is whole as far as its ends tell.

    Only JPEG and PNG carry an end marker; for other formats an empty file is all that shows here.

    Raises:
        CaptureError: It is missing, not a regular file, empty, truncated, too large or of another kind.
    """
    hint = "Copy or export this file again."
    try:
        with open_regular(path) as file:
            head = file.read(8)
            n_bytes = file.seek(0, os.SEEK_END)
            file.seek(max(n_bytes - END_BYTES, 0))
            fault = _fault_of_ends(path, head, file.read(END_BYTES), n_bytes)
            if fault is not None:
                raise CaptureError(f"The image {fault}.", hint=hint, path=path)
            file.seek(0)
            with warnings.catch_warnings():
                warnings.simplefilter("error", Image.DecompressionBombWarning)
                image = Image.open(file, formats=IMAGE_KINDS)
            exif = image.getexif() if "exif" in image.info else {}
            orientation = exif.get(_ORIENTATION, 1)
            return ImageHeader(image.size, n_bytes, orientation if orientation in range(1, 9) else 1)
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise CaptureError(f"The image claims more than {MAX_PIXELS:,} pixels.", hint=hint, path=path) from error
    except OSError as error:
        if error.errno is None:  # Pillow's own, which has no system error behind it
            raise CaptureError("The file is not a readable image.", hint=hint, path=path) from error
        raise unreadable(error, "The image", path) from error
    except IMAGE_FAULTS as error:
        raise CaptureError("The file is not a readable image.", hint=hint, path=path) from error


def unreadable(error: OSError, what: str, path: Path) -> CaptureError:
    """The error to raise when the system refuses a file of a capture. what: "The image"."""
    if isinstance(error, FileNotFoundError):
        return CaptureError(f"{what} is missing.", hint="Put the file back or export it again.", path=path)
    return CaptureError(
        f"{what} cannot be read ({error.strerror}).",
        hint="Check that you may read it.",
        path=path,
    )


def _fault_of_ends(path: Path, head: bytes, tail: bytes, n_bytes: int) -> str | None:
    if n_bytes == 0:
        return "is empty"
    if path.suffix.lower() in (".jpg", ".jpeg"):
        is_kind, is_complete, kind = head[:2] == b"\xff\xd8", b"\xff\xd9" in tail, "JPEG"
    elif path.suffix.lower() == ".png":
        is_kind, is_complete, kind = head == b"\x89PNG\r\n\x1a\n", b"IEND" in tail, "PNG"
    else:
        return None
    if not is_kind:
        return f"is not a {kind}"
    return None if is_complete else f"is truncated: the {kind} ends after {n_bytes} bytes without its end marker"


# ---------------------------------------------------------------- videos


@contextmanager
def opened_video(path: Path) -> Iterator[Any]:
    """A video's container, opened as one of VIDEO_KINDS and closed at the end. May raise VIDEO_FAULTS and OSError."""
    container = open_video(path)
    try:
        yield container
    finally:
        container.close()


def open_video(path: Path) -> Any:
    """Likewise, for the caller to close."""
    check_regular(path)
    # "file:" because a name with a colon is a protocol to FFmpeg; metadata is not used, so its errors do not matter
    return av.open(f"file:{path}", options={"format_whitelist": VIDEO_KINDS}, metadata_errors="ignore")


def set_pixel_limit(stream: Any) -> None:
    """Keep a damaged stream from claiming gigabytes for one frame; before its first frame is decoded."""
    if stream.codec_context is not None:
        stream.codec_context.options = {"max_pixels": str(MAX_PIXELS)}


@dataclass(frozen=True, slots=True)
class VideoHeader:
    """The facts in a video's container.

    Attributes:
        n_frames: Frames shown.
        stored_size: Width and height as stored.
        rate: Frames per second; 0 when the container does not say.
        n_bytes: Size of the file.
        turn: How its pictures are to be turned for display.
        curve: The transfer curve that it states, where that is not one of displays.
        is_even: Whether its frames have the same distance in time, as far as its index tells.
    """

    n_frames: int
    stored_size: tuple[int, int]
    rate: float
    n_bytes: int
    turn: Turn = UPRIGHT
    is_even: bool = True
    curve: CurveName | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures turned upright."""
        return self.turn.size(self.stored_size)


def read_video_header(path: Path, *, is_growing: bool = False) -> VideoHeader:
    """Number of frames, size and rate of a video from its container.

    Args:
        is_growing: It may still be written: as many frames as there are count, and its end may be cut off.
    Raises:
        CaptureError: The file is missing, not a video, or ends before the frames that its index lists.
    """
    again = "Copy or export it again."
    try:
        n_bytes = check_regular(path)
        if n_bytes == 0:
            raise CaptureError("The video is empty (0 bytes).", hint=again, path=path)
        with opened_video(path) as container:
            if not container.streams.video:
                raise CaptureError(
                    "The file has no video stream, so it is truncated or not a video.", hint=again, path=path
                )
            stream = container.streams.video[0]
            if stream.codec_context is None:
                raise CaptureError("The video has an unknown format.", hint=again, path=path)
            size = (stream.codec_context.width, stream.codec_context.height)
            rate = float(stream.average_rate or 0)
            turn = _read_turn(path, container.format.name)
            curve = STATED.get(stream.codec_context.color_trc)
            if is_growing:
                pts, _ = times_so_far(container, stream)
                return VideoHeader(len(pts), size, rate, n_bytes, turn, curve=curve)
            entries = [entry for entry in stream.index_entries if not entry.is_discard]
            if len(entries) != stream.frames or not entries:  # the index lists key frames only, or frames not shown
                pts = [pts for packet in container.demux(stream) if (pts := shown_pts(packet)) is not None]
                return VideoHeader(len(pts), size, rate, n_bytes, turn, _is_even(pts), curve)
            is_even = _is_even([entry.timestamp for entry in entries])
            n_whole = sum(entry.pos + entry.size <= n_bytes for entry in entries)
    except FileNotFoundError as error:
        raise CaptureError(
            "The video is missing.", hint="Put the file back or remove its camera.", path=path
        ) from error
    except VIDEO_FAULTS as error:
        reason = getattr(error, "strerror", None) or "damaged"
        raise CaptureError(
            f"The video cannot be opened ({reason}), so it is truncated or of an unknown kind.",
            hint="Copy or export it again, for example as H.264 in mp4.",
            path=path,
        ) from error
    except OSError as error:
        raise unreadable(error, "The video", path) from error
    if n_whole < len(entries):
        raise CaptureError(
            f"The video is truncated: its index lists {len(entries)} frames, "
            f"only {n_whole} lie within its {n_bytes} bytes.",
            hint=again,
            path=path,
        )
    return VideoHeader(len(entries), size, rate, n_bytes, turn, is_even, curve)


def times_so_far(container: Any, stream: Any) -> tuple[list[int], int]:
    """What has been written of a video that grows.

    Returns:
        When its frames are shown, in any order; and how many of them are complete for sure: those shown before the last
        key frame, behind which nothing refers to them.
    """
    times: list[int] = []
    last_key: int | None = None
    with suppress(*VIDEO_FAULTS):  # its end is being written
        for packet in container.demux(stream):
            pts = shown_pts(packet)
            if pts is not None:
                times.append(pts)
                last_key = pts if packet.is_keyframe else last_key
    return times, 0 if last_key is None else sum(pts < last_key for pts in times)


def _is_even(times: Sequence[int]) -> bool:
    """Whether times, in any order and unit, are evenly spaced to a quarter of their distance."""
    if len(times) < 3:
        return True
    rising = np.sort(np.array(times, dtype=np.float64))
    step = (rising[-1] - rising[0]) / (len(rising) - 1)
    return bool(np.abs(rising - rising[0] - step * np.arange(len(rising))).max() <= 0.25 * step)


def _read_turn(path: Path, container_kind: str) -> Turn:
    """How a video is to be turned. Only where its container may say so is a picture decoded, which is what tells."""
    is_mp4 = "mp4" in container_kind
    if not (is_mp4 and may_be_turned(path)) and "matroska" not in container_kind:
        return UPRIGHT
    try:
        with opened_video(path) as container:
            stream = container.streams.video[0]
            set_pixel_limit(stream)
            frame = next(container.decode(stream), None)
            return UPRIGHT if frame is None else turn_of_frame(frame)
    except VIDEO_FAULTS:  # said where the frame is asked for
        return UPRIGHT


def read_frame_times(path: Path) -> np.ndarray:
    """When each frame of a video is shown, in seconds of its container, rising. Reads through the file. [T] float64

    Raises:
        CaptureError: The file is missing or not a video, or frames have no times of their own.
    """
    try:
        with opened_video(path) as container:
            stream = container.streams.video[0]
            found = [pts for packet in container.demux(stream) if (pts := shown_pts(packet)) is not None]
            seconds = float(stream.time_base or 0)
    except FileNotFoundError as error:
        raise unreadable(error, "The video", path) from error
    except (*VIDEO_FAULTS, IndexError) as error:
        reason = getattr(error, "strerror", None) or "damaged"
        raise CaptureError(
            f"The video cannot be read ({reason}).", hint="Copy or export it again.", path=path
        ) from error
    except OSError as error:
        raise unreadable(error, "The video", path) from error
    times_s = np.sort(np.array(found, dtype=np.float64)) * seconds
    if len(times_s) == 0 or (np.diff(times_s) <= 0).any():
        raise CaptureError(
            "The frames of the video have no timestamps.",
            hint="Copy it into an mp4 file, or give the times of its frames.",
            path=path,
        )
    return times_s


def shown_pts(packet: Any) -> int | None:
    """Presentation time of a demuxed packet; None for the flush packet and for what an edit list discards."""
    return None if packet.size == 0 or packet.is_discard else packet.pts
