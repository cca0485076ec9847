"""Reads the dump format of xwd (X11/XWDFile.h, version 7) as far as true-colour screens need it."""

from __future__ import annotations

import struct

import numpy as np

_N_HEADER_FIELDS = 25


def read_xwd(data: bytes) -> np.ndarray:
    """The picture of a dump. [H, W, 3] uint8

    Raises:
        ValueError: Not a dump of version 7 with 24 or 32 bits per pixel.
    """
    header = struct.unpack(f">{_N_HEADER_FIELDS}I", data[: 4 * _N_HEADER_FIELDS])
    header_size, version, width, height = header[0], header[1], header[4], header[5]
    is_little_endian, bits_per_pixel, bytes_per_line, n_colors = header[7] == 0, header[11], header[12], header[19]
    if version != 7 or bits_per_pixel not in (24, 32):
        raise ValueError(f"expected xwd version 7 with 24 or 32 bits per pixel, got {version} with {bits_per_pixel}")
    n_bytes = bits_per_pixel // 8
    rows = np.frombuffer(data, dtype=np.uint8, count=bytes_per_line * height, offset=header_size + 12 * n_colors)
    pixels = rows.reshape(height, bytes_per_line)[:, : n_bytes * width].reshape(height, width, n_bytes)
    channels = pixels[..., 2::-1] if is_little_endian else pixels[..., n_bytes - 3 :]
    return np.ascontiguousarray(channels)
