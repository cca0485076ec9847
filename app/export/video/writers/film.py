"""Films: videos of every format that FORMATS has, with or without sound."""

from __future__ import annotations

from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import av
import numpy as np
from av.video.reformatter import ColorRange, Colorspace, Interpolation, VideoReformatter
from scipy import ndimage

from app.export.video.formats import FORMATS
from app.export.video.passes import PassPicture
from app.export.video.timed_sound import TimedSound
from engine.capture.files.sound import SoundReader

SOUND_RATE = 48_000
"""Samples per second; the only rate that Opus and all players of AAC share."""
SOUND_BITS_PER_S = 160_000
_BT709, _LIMITED = 1, 1
"""Numbers of ITU-T H.273 for primaries, transfer and matrix of HD video, and FFmpeg's for levels 16 to 235."""


class FilmWriter:
    """Writes one file. A context manager; the file is complete once the block has ended well.

    Args:
        path: The file to write.
        format_name: Of a video; see FORMATS.
        fps: Pictures per second.
        background: Behind the scene, levels 0 to 255.
        is_transparent: Keep the opacity.
        sound: The sound, opened; None for silence.
    Raises:
        FFmpegError: The disk or the encoder refused.
    """

    def __init__(
        self,
        path: Path,
        format_name: str,
        *,
        fps: float,
        background: tuple[int, int, int] = (0, 0, 0),
        is_transparent: bool = False,
        sound: SoundReader | TimedSound | None = None,
    ) -> None:
        kind = FORMATS[format_name]
        encoding = kind.transparent if is_transparent else kind.encoding
        assert encoding is not None
        self._path, self._kind, self._background, self._is_transparent = path, kind, background, is_transparent
        self._encoding = encoding
        self._rate = Fraction(fps).limit_denominator(1001)
        self._sound = sound
        self._n_pictures = self._n_samples = 0
        self._stack = ExitStack()
        self._reformatter = VideoReformatter()
        self._container: Any = None
        self._video: Any = None
        self._track: Any = None

    def __enter__(self) -> Self:
        muxer, options = self._kind.muxer
        # "file:" because a name with a colon is a protocol to FFmpeg
        self._container = av.open(f"file:{self._path}", "w", format=muxer, options=dict(options))
        self._stack.callback(self._container.close)
        self._video = self._container.add_stream(self._encoding.codec, rate=self._rate)
        self._video.options = dict(self._encoding.options)
        self._video.pix_fmt = self._encoding.pixels
        context = self._video.codec_context
        context.color_primaries = context.color_trc = context.colorspace = _BT709
        context.color_range = _LIMITED
        if self._sound is not None:
            assert self._kind.sound_codec is not None
            self._track = self._container.add_stream(self._kind.sound_codec, rate=SOUND_RATE, layout="stereo")
            if not self._kind.sound_codec.startswith("pcm"):  # which has no choice
                self._track.bit_rate = SOUND_BITS_PER_S
        return self

    def write(self, picture: PassPicture) -> None:
        """Add a picture; all have one size. See the class for errors."""
        frame = self._frame(picture)
        if self._n_pictures == 0:
            self._video.width, self._video.height = frame.width, frame.height
        frame.pts, frame.time_base = self._n_pictures, 1 / self._rate
        self._container.mux(self._video.encode(frame))
        self._n_pictures += 1
        self._write_sound()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._stack:  # closed in any case
            if kind is None:
                for stream in (self._video, self._track):
                    if stream is not None:
                        self._container.mux(stream.encode())

    def _frame(self, picture: PassPicture) -> av.VideoFrame:
        max_level = self._encoding.max_level
        if self._is_transparent:
            image = _spread(picture.straight(max_level))
        else:
            image = picture.over(self._background, max_level)
        if self._encoding.needs_even_sizes:
            image = np.pad(image, ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0)), mode="edge")
        names = {255: ("rgb24", "rgba"), 65_535: ("rgb48le", "rgba64le")}
        frame = av.VideoFrame.from_ndarray(image, format=names[max_level][self._is_transparent])
        converted = self._reformatter.reformat(
            frame,
            format=self._video.pix_fmt,
            src_color_range=ColorRange.JPEG,
            dst_colorspace=Colorspace.ITU709,
            dst_color_range=ColorRange.MPEG,
            interpolation=Interpolation.BICUBIC | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INP,
        )
        converted.color_primaries = converted.color_trc = converted.colorspace = _BT709
        converted.color_range = _LIMITED
        return converted

    def _write_sound(self) -> None:
        """As much as belongs to the pictures so far."""
        if self._sound is None:
            return
        due = round(self._n_pictures * SOUND_RATE / self._rate) - self._n_samples
        samples = self._sound.read(due)
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(samples.reshape(1, -1)), format="flt", layout="stereo")
        frame.sample_rate, frame.pts, frame.time_base = SOUND_RATE, self._n_samples, Fraction(1, SOUND_RATE)
        self._n_samples += due
        self._container.mux(self._track.encode(frame))


def _spread(rgba: np.ndarray) -> np.ndarray:
    """Colours where nothing is, from the nearest pixel with something: colours at half size mix them into the border.

    [H, W, 4] uint8 or uint16
    """
    is_empty = rgba[..., 3] < np.iinfo(rgba.dtype).max / 64
    if is_empty.all() or not is_empty.any():
        return rgba
    rows, columns = np.asarray(ndimage.distance_transform_edt(is_empty, return_distances=False, return_indices=True))
    rgba[..., :3] = rgba[rows, columns, :3]
    return rgba
