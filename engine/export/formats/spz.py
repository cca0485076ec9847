"""The .spz of Niantic, version 3: about 20 bytes per Gaussian before zipping, which most programs read.

Nothing in a file says how its axes lie. Niantic's own tools take x right, y up, z back; SuperSplat and most viewers
take what is stored as they take a .ply. `engine.export.world` turns the scene for the former.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from typing import BinaryIO

import numpy as np

from engine.errors import ProjectError
from engine.export.formats.damaged import damaged
from engine.export.packing import as_levels, quats_of_smaller_three, smaller_three
from engine.export.splats import Splats, colors_of

MAGIC = 0x5053474E
VERSION, _OLDER = 3, 2
_HEAD = struct.Struct("<IIIBBBB")
_USUAL_BITS = 12
_MOST_BITS = 20
_LARGEST = 2**23 - 1
_STEPS_PER_SCALE = 16.0
_COLOR_SCALE = 0.15
_QUAT_TOP = 511
_LEAST_BYTES = 20
_MAX_BYTES = 1 << 30
"""Limit of an unzipped file that is read."""
_MANY = 0.01
"""Share of the sides of Gaussians that are too thin from which on it is worth a word."""
LN_SCALES = (-10.0, 255.0 / 16.0 - 10.0)
"""Logarithms of scales that can be stored."""


def write(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """Whole numbers in planes, then gzip. Returns what could not be stored as usual.

    Raises:
        ProjectError: Positions are so large that whole scene units do not fit.
    """
    bits = fractional_bits(splats)
    positions = np.clip(np.round(splats.means.astype(np.float64) * 2.0**bits), -_LARGEST, _LARGEST).astype("<i4")
    ln_scales = np.log(splats.scales.astype(np.float64))
    largest, three = smaller_three(splats.quats[:, [1, 2, 3, 0]])
    magnitudes = np.minimum(np.floor(np.abs(three) * (np.sqrt(2.0) * _QUAT_TOP) + 0.5), _QUAT_TOP).astype("<u4")
    parts = magnitudes | ((three < 0.0).astype("<u4") << 9)
    planes = (
        positions.view(np.uint8).reshape(-1, 3, 4)[:, :, :3],
        as_levels(splats.opacities),
        as_levels((splats.f_dc * _COLOR_SCALE) + 0.5),
        np.clip(np.round((ln_scales - LN_SCALES[0]) * 16.0), 0, 255),
    )
    rotations = (largest.astype("<u4") << 30) | (parts[:, 0] << 20) | (parts[:, 1] << 10) | parts[:, 2]
    zipper = zlib.compressobj(6, zlib.DEFLATED, 31)  # gzip without a time, so that equal scenes are equal files
    file.write(zipper.compress(_HEAD.pack(MAGIC, VERSION, len(splats), 0, bits, 0, 0)))
    for plane in planes:
        file.write(zipper.compress(plane.astype(np.uint8).tobytes()))
    file.write(zipper.compress(rotations.astype("<u4").tobytes()))
    file.write(zipper.flush())
    return _notes(bits, ln_scales) if len(splats) else ()


def read(file: BinaryIO) -> Splats:
    """Read a file of `write`, or one of version 2 or with colours of higher degrees, which are left out; axes as
    stored. Raises ProjectError where it is something else."""
    try:
        with gzip.GzipFile(fileobj=file, mode="rb") as unzipped:
            head = unzipped.read(_HEAD.size)
            if len(head) < _HEAD.size:
                raise damaged("it ends too early")
            magic, version, n, degree, bits, _, _ = _HEAD.unpack(head)
            if magic != MAGIC or version not in (_OLDER, VERSION) or degree > 4 or bits > _MOST_BITS:
                raise damaged(f"it is not an SPZ file of version {VERSION} or {_OLDER}")
            n_bytes = n * (_LEAST_BYTES if version == VERSION else _LEAST_BYTES - 1)
            if n_bytes > _MAX_BYTES:
                raise damaged(f"it announces {n:,} Gaussians")
            data = unzipped.read(n_bytes)
    except (OSError, EOFError, zlib.error) as error:
        raise damaged(f"unzipping failed ({error})") from error
    if len(data) != n_bytes:
        raise damaged("it ends too early")
    values = np.frombuffer(data, np.uint8)
    position_bytes, alphas, colors, scales, rotation_bytes = np.split(values, np.cumsum([9, 1, 3, 3]) * n)
    wide = np.zeros((n, 3, 4), np.uint8)
    wide[:, :, 1:] = position_bytes.reshape(n, 3, 3)  # in the upper bytes, where the sign is; shifted down below
    xyzw = _quats(rotation_bytes) if version == VERSION else _older_quats(rotation_bytes)
    return Splats(
        means=((wide.view("<i4")[:, :, 0] >> 8) / 2.0**bits).astype(np.float32),
        quats=xyzw[:, [3, 0, 1, 2]],
        scales=np.exp(scales.reshape(n, 3) / 16.0 + LN_SCALES[0]).astype(np.float32),
        opacities=alphas.astype(np.float32) / 255.0,
        colors=colors_of((colors.reshape(n, 3) / 255.0 - 0.5) / _COLOR_SCALE),
        sh_degree=degree,
    )


def _quats(data: np.ndarray) -> np.ndarray:
    """Of version 3: the three smaller numbers, and which is the largest. [N, 4] xyzw"""
    rotations = data.view("<u4")
    parts = np.stack([(rotations >> shift) & 1023 for shift in (20, 10, 0)], axis=1)
    three = (parts & _QUAT_TOP) * (np.sqrt(0.5) / _QUAT_TOP) * np.where(parts >> 9, -1.0, 1.0)
    return quats_of_smaller_three((rotations >> 30).astype(np.int64), three)


def _older_quats(data: np.ndarray) -> np.ndarray:
    """Of version 2: x, y and z of a rotation whose w is not negative. [N, 4] xyzw"""
    xyz = data.reshape(-1, 3) / 127.5 - 1.0
    w = np.sqrt(np.maximum(1.0 - (xyz**2).sum(1), 0.0))
    return np.concatenate([xyz, w[:, None]], axis=1).astype(np.float32)


def fractional_bits(splats: Splats) -> int:
    """Bits behind the point of positions: 12 as everywhere, more in a scene that is small in its units, fewer in a
    large one.

    Raises:
        ProjectError: Not even whole units fit.
    """
    reach = float(np.abs(splats.means).max(initial=0.0))
    if reach > _LARGEST:
        raise ProjectError(
            f"Positions reach {reach:.3g} scene units, and SPZ stores at most {_LARGEST}.",
            hint="Give a --scale below 1, or choose another format.",
        )
    size = float(np.median(splats.scales)) if len(splats) else 1.0
    wanted = max(_USUAL_BITS, int(np.ceil(np.log2(_STEPS_PER_SCALE / size))))
    fitting = int(np.floor(np.log2(_LARGEST / max(reach, 1e-9))))
    return max(0, min(wanted, fitting, _MOST_BITS))


def _notes(bits: int, ln_scales: np.ndarray) -> tuple[str, ...]:
    notes = []
    if bits < _USUAL_BITS:
        notes.append(
            f"Positions reach beyond what SPZ stores in steps of 1/4096 units; they are stored in steps of 1/{2**bits}."
        )
    low, high = np.exp(LN_SCALES)
    if (ln_scales > LN_SCALES[1]).any():
        notes.append(
            f"Some Gaussians are larger than {high:.0f} units, the largest that SPZ stores; they are stored at that "
            "size."
        )
    if (ln_scales < LN_SCALES[0]).mean() > _MANY:
        notes.append(
            f"Many Gaussians are thinner than {low:.2g} units, the least that SPZ stores; they are stored at that size."
        )
    return tuple(notes)
