"""Gaussians to 64-byte records and depth keys, sixteen at a time. Decides which rows can be drawn."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types

from engine.backends.cpu.raster import record as rec
from engine.backends.cpu.raster.camera_row import CameraLanes
from engine.backends.cpu.raster.projection_math import Projection, cholesky, covariance, project_lanes
from engine.conventions import ALPHA_MIN
from engine.kernels.jobs import Floats1, Floats2, SmallInts2, Workers, read
from engine.kernels.lanes import INTS, N_LANES, VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic
from engine.kernels.launch import kernel
from engine.raster.limits import EXTENT_MAX_PX, QUAT_NORM_SQUARED_MAX, QUAT_NORM_SQUARED_MIN, VALUE_MAX

_ZERO = rec.f4(0.0)


def gather_rows(build: LaneBuilder, base: Any, rows: Any, n_columns: int) -> tuple[Lanes, ...]:
    """The columns of sixteen rows of a contiguous [N, n_columns] float32 array."""
    return tuple(build.gather(base, rows, n_columns, column) for column in range(n_columns))


@kernel_intrinsic
def _project_sixteen(
    typing_context, first, n_rows, means, quats, scales, opacities, colors, camera, record_address, key_address
):
    """Rows first..first+15 to records and keys; rows past the end repeat the last one."""
    signature = types.void(*[types.int64] * 10)

    def generate(context, builder, signature, arguments):
        first, n_rows, means, quats, scales, opacities, colors, camera, records, keys = arguments
        build = LaneBuilder(builder)
        rows = _clamped_rows(build, first, n_rows)
        lanes = CameraLanes(build, camera)
        mean, quat, scale = (
            gather_rows(build, *spec) for spec in ((means, rows, 3), (quats, rows, 4), (scales, rows, 3))
        )
        opacity = build.gather(opacities, rows, 1, 0)
        color = gather_rows(build, colors, rows, 3)
        projection = project_lanes(lanes, mean, quat, scale)
        fields, depth_keys = _record_fields(build, lanes, projection, opacity, color)
        for lane, record in enumerate(build.transpose(fields)):
            build.store(record, records, lane * VECTOR_BYTES)
        build.store(depth_keys, keys, align=4)

    return signature, generate


def _clamped_rows(build: LaneBuilder, first: Any, n_rows: Any) -> Any:
    """first + lane, at most n_rows - 1, as int32."""
    builder = build.ir

    def splat(value: Any) -> Any:
        narrow = builder.trunc(value, ir.IntType(32))
        undefined = ir.Constant(INTS, ir.Undefined)
        vector = builder.insert_element(undefined, narrow, ir.Constant(ir.IntType(32), 0))
        return builder.shuffle_vector(vector, undefined, ir.Constant(INTS, [0] * N_LANES))

    rows = builder.add(splat(first), ir.Constant(INTS, list(range(N_LANES))))
    last = splat(builder.sub(n_rows, build.int64(1)))
    return builder.select(builder.icmp_signed("<", rows, last), rows, last)


def _record_fields(
    build: LaneBuilder, camera: CameraLanes, projection: Projection, opacity: Lanes, color: tuple[Lanes, ...]
) -> tuple[list[Lanes], Lanes]:
    """Sixteen record columns, and depth where the row can be drawn, else -1."""
    p = projection
    center_x = camera.fx * p.raw_slope_x + camera.cx
    center_y = camera.fy * p.raw_slope_y + camera.cy
    cov = covariance(p)
    precision_u, precision_y, slope = cholesky(cov)
    root_major = (precision_u * rec.EIGHTH_LOG).sqrt()
    tilt = cov.xy / cov.xx
    log_opacity = opacity.log2() * 0.125
    reach = log_opacity - rec.LOG_ALPHA_MIN
    distance_squared = reach * (1.0 / rec.EIGHTH_LOG)  # squared Mahalanobis distance at which alpha is ALPHA_MIN
    half_width, half_height = (distance_squared * cov.xx).sqrt(), (distance_squared * cov.yy).sqrt()

    # first and last pixel whose centre lies in the bounding box, cut to the image; NaN becomes a border
    first_x = (center_x - half_width - 0.5).ceil().max(0.0)
    last_x = (center_x + half_width - 0.5).floor().min(camera.width - 1.0)
    first_y = (center_y - half_height - 0.5).ceil().max(0.0)
    last_y = (center_y + half_height - 0.5).floor().min(camera.height - 1.0)

    norm_squared = p.norm_squared
    can_be_drawn = build.all_of(
        [
            p.z.compare(">", camera.near_plane),
            p.z.compare("<", VALUE_MAX),
            opacity.compare(">", ALPHA_MIN),
            opacity.compare("<", VALUE_MAX),
            norm_squared.compare(">", QUAT_NORM_SQUARED_MIN),
            norm_squared.compare("<", QUAT_NORM_SQUARED_MAX),
            half_width.compare("<", EXTENT_MAX_PX),
            half_height.compare("<", EXTENT_MAX_PX),
            center_x.abs().compare("<", VALUE_MAX),
            center_y.abs().compare("<", VALUE_MAX),
            precision_u.compare(">", 0.0),
            precision_u.compare("<", VALUE_MAX),
            slope.abs().compare("<", VALUE_MAX),
            first_x.compare("<=", last_x),
            first_y.compare("<=", last_y),
            *(channel.abs().compare("<", VALUE_MAX) for channel in color),
        ]
    )
    columns = [
        center_x,
        center_y,
        root_major,
        slope,
        (precision_y * rec.EIGHTH_LOG).sqrt(),
        log_opacity,
        *color,
        reach,
        tilt,
        half_width,
        half_height,
        1.0 / root_major,
        _packed_tiles(build, first_x, last_x, camera.width),
        _packed_tiles(build, first_y, last_y, camera.height),
    ]
    return columns, p.z.where(can_be_drawn, -1.0)


def _packed_tiles(build: LaneBuilder, first: Lanes, last: Lanes, size: Lanes) -> Lanes:
    """Tiles of the first and last pixel as first | last << 16, int32 bits. Always inside the image."""
    ends = [pixel.max(0.0).min(size - 1.0) * (1.0 / rec.TILE) for pixel in (first, last)]
    low, high = (end.floor().to_ints() for end in ends)
    packed = build.ir.or_(low, build.ir.shl(high, ir.Constant(INTS, [16] * N_LANES)))
    return Lanes(build, build.ir.bitcast(packed, build.constant(0.0).value.type))


@njit(inline="always")
def _touches_wanted_tile(packed, row, mask_sums):
    """Whether any tile under the bounding box of a record is wanted."""
    columns, rows = packed[row, rec.TILE_COLUMNS], packed[row, rec.TILE_ROWS]
    left, right = columns & 0xFFFF, (columns >> 16) + 1
    top, bottom = rows & 0xFFFF, (rows >> 16) + 1
    return mask_sums[bottom, right] - mask_sums[top, right] - mask_sums[bottom, left] + mask_sums[top, left] > 0


class ProjectJob(NamedTuple):
    """Arguments of `project`, which fills records and keys: camera depth, or a number <= 0 for rows not to be drawn.

    Attributes:
        mask_sums: [tile rows + 1, tile columns + 1], see `binning.mask_sums`; empty where all tiles are wanted.
        records: [>= N rounded up to 16, 16]
        packed: The same memory as int32.
        keys: [>= N rounded up to 16]
        centers: Centres of the rows that can be drawn, 0 of others, pixels, written unless empty. [N, 2]
    """

    means: Floats2
    quats: Floats2
    scales: Floats2
    opacities: Floats1
    colors: Floats2
    camera: Floats1
    mask_sums: SmallInts2
    records: Floats2
    packed: SmallInts2
    keys: Floats1
    centers: Floats2
    n_workers: Workers = None


@kernel(ProjectJob, fastmath=rec.FASTMATH)
def project(worker, arguments):
    """See ProjectJob."""
    job = read(ProjectJob, arguments)
    keys, records, packed, centers, mask_sums = job.keys, job.records, job.packed, job.centers, job.mask_sums
    n_rows = len(job.means)
    n_groups = (n_rows + 15) // 16
    for group in range(n_groups * worker // job.n_workers, n_groups * (worker + 1) // job.n_workers):
        first = 16 * group
        _project_sixteen(
            first,
            n_rows,
            np.int64(job.means.ctypes.data),
            np.int64(job.quats.ctypes.data),
            np.int64(job.scales.ctypes.data),
            np.int64(job.opacities.ctypes.data),
            np.int64(job.colors.ctypes.data),
            np.int64(job.camera.ctypes.data),
            np.int64(records.ctypes.data) + first * 64,
            np.int64(keys.ctypes.data) + first * 4,
        )
        if len(centers) > 0:
            for row in range(first, min(first + 16, n_rows)):
                is_drawn = keys[row] > _ZERO
                centers[row, 0] = records[row, rec.CENTER_X] if is_drawn else _ZERO
                centers[row, 1] = records[row, rec.CENTER_Y] if is_drawn else _ZERO
        if len(mask_sums) > 0:
            for row in range(first, min(first + 16, n_rows)):
                if keys[row] > _ZERO and not _touches_wanted_tile(packed, row, mask_sums):
                    keys[row] = _ZERO
