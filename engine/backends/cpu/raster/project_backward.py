"""Sums per (Gaussian, tile) to gradients of the Gaussian's parameters, sixteen Gaussians at a time.

The chain runs moments -> gradient of centre and covariance -> `half` -> scales, rotation, Jacobian -> quaternion and
mean, in the notation of `projection_math`. Every Gaussian is handled by one lane of one thread: no atomics, and sums
are taken in the same order in every run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.core import cgutils

from engine.backends.cpu.raster import record as rec
from engine.backends.cpu.raster.camera_row import CameraLanes
from engine.backends.cpu.raster.project import gather_rows
from engine.backends.cpu.raster.projection_math import Projection, Row, cholesky, covariance, dot, project_lanes
from engine.kernels.jobs import Floats1, Floats2, SmallInts1, read
from engine.kernels.lanes import N_LANES, VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic
from engine.kernels.launch import kernel

_PAIR_BYTES = 4 * rec.PAIR_FLOATS
_ZERO = rec.f4(0.0)


@kernel_intrinsic
def _sum_pairs(typing_context, pair_sums, n_pairs, destination):
    """Add up n_pairs consecutive rows of the buffer into sixteen floats (the last seven mean nothing)."""
    signature = types.void(*[types.int64] * 3)

    def generate(context, builder, signature, arguments):
        pair_sums, n_pairs, destination = arguments
        build = LaneBuilder(builder)
        total = cgutils.alloca_once_value(builder, build.constant(0.0).value)
        with cgutils.for_range(builder, n_pairs) as loop:
            row = build.load(pair_sums, builder.mul(loop.index, build.int64(_PAIR_BYTES)), align=4)
            builder.store((Lanes(build, builder.load(total)) + row).value, total)
        build.store(Lanes(build, builder.load(total)), destination)

    return signature, generate


@kernel_intrinsic
def _backward_sixteen(typing_context, sums, rows, means, quats, scales, opacities, camera):
    """Gradients of sixteen Gaussians.

    `sums` addresses sixteen vectors of `_sum_pairs` and is overwritten by sixteen gradient rows: mean 3, quat 4,
    scale 3, opacity 1, color 3, centre 2. `rows` [16] int32 are the Gaussians.
    """
    signature = types.void(*[types.int64] * 7)

    def generate(context, builder, signature, arguments):
        sums, rows, means, quats, scales, opacities, camera = arguments
        build = LaneBuilder(builder)
        row_indices = build.load_ints(rows)
        mean, quat, scale, opacity = (
            gather_rows(build, base, row_indices, n)
            for base, n in ((means, 3), (quats, 4), (scales, 3), (opacities, 1))
        )
        camera_lanes = CameraLanes(build, camera)
        projection = project_lanes(camera_lanes, mean, quat, scale)
        moments = build.transpose([build.load(sums, lane * VECTOR_BYTES) for lane in range(N_LANES)])
        gradients = _gradients(camera_lanes, projection, scale, opacity[0], moments)
        for lane, gradient in enumerate(build.transpose(gradients)):
            build.store(gradient, sums, lane * VECTOR_BYTES)

    return signature, generate


def _gradients(camera: CameraLanes, p: Projection, scale: Row, opacity: Lanes, moments: list[Lanes]) -> list[Lanes]:
    """The sixteen gradient columns from the projection and summed moments."""
    v, vu, vy, vuu, vuy, vyy, *rest = moments
    grad_color = rest[:3]
    precision_u, precision_y, slope = cholesky(covariance(p))
    # moments are of u and v as in `record`
    weight_u, weight_y = ((precision * (1.0 / rec.EIGHTH_LOG)).sqrt() for precision in (precision_u, precision_y))
    grad_center_x = weight_u * vu
    grad_center_y = slope * grad_center_x + weight_y * vy
    uu = weight_u * weight_u * vuu
    uy = weight_u * weight_y * vuy
    twice_xx = uu  # gradient of cov_xx, times two
    grad_xy = slope * uu + uy
    twice_yy = slope * slope * uu + 2.0 * slope * uy + weight_y * weight_y * vyy

    grad_half_x = _combine(twice_xx, p.half_x, grad_xy, p.half_y)
    grad_half_y = _combine(twice_yy, p.half_y, grad_xy, p.half_x)
    grad_scale = [grad_half_x[k] * p.unit_x[k] + grad_half_y[k] * p.unit_y[k] for k in range(3)]
    grad_unit_x = tuple(grad_half_x[k] * scale[k] for k in range(3))
    grad_unit_y = tuple(grad_half_y[k] * scale[k] for k in range(3))
    grad_quat = _quat_gradient(p, grad_unit_x, grad_unit_y)
    grad_mean = _mean_gradient(camera, p, grad_unit_x, grad_unit_y, grad_center_x, grad_center_y)
    grad_opacity = v / opacity
    return [*grad_mean, *grad_quat, *grad_scale, grad_opacity, *grad_color, grad_center_x, grad_center_y]


def _combine(weight_a: Lanes, a: Row, weight_b: Lanes, b: Row) -> Row:
    return tuple(weight_a * a[k] + weight_b * b[k] for k in range(3))


def _quat_gradient(p: Projection, grad_unit_x: Row, grad_unit_y: Row) -> list[Lanes]:
    """Through the rotation matrix and the normalisation of the quaternion."""
    g = [
        [p.image_x[row] * grad_unit_x[column] + p.image_y[row] * grad_unit_y[column] for column in range(3)]
        for row in range(3)
    ]  # dL/d rotation[row][column]
    w, x, y, z = p.w, p.qx, p.qy, p.qz
    skew_x, skew_y, skew_z = g[2][1] - g[1][2], g[0][2] - g[2][0], g[1][0] - g[0][1]
    even_xy, even_xz, even_yz = g[0][1] + g[1][0], g[0][2] + g[2][0], g[1][2] + g[2][1]
    unit = [
        2.0 * (x * skew_x + y * skew_y + z * skew_z),
        2.0 * (y * even_xy + z * even_xz + w * skew_x - 2.0 * x * (g[1][1] + g[2][2])),
        2.0 * (x * even_xy + z * even_yz + w * skew_y - 2.0 * y * (g[0][0] + g[2][2])),
        2.0 * (x * even_xz + y * even_yz + w * skew_z - 2.0 * z * (g[0][0] + g[1][1])),
    ]
    along = unit[0] * w + unit[1] * x + unit[2] * y + unit[3] * z
    return [(grad - along * q) * p.inverse_norm for grad, q in zip(unit, (w, x, y, z), strict=True)]


def _mean_gradient(
    camera: CameraLanes,
    p: Projection,
    grad_unit_x: Row,
    grad_unit_y: Row,
    grad_center_x: Lanes,
    grad_center_y: Lanes,
) -> list[Lanes]:
    """Through the centre and through the Jacobian; a clamped slope passes nothing on."""
    grad_image_x = [dot(p.rotation[row], grad_unit_x) for row in range(3)]
    grad_image_y = [dot(p.rotation[row], grad_unit_y) for row in range(3)]
    row_x = (camera.r00, camera.r01, camera.r02)
    row_y = (camera.r10, camera.r11, camera.r12)
    row_z = (camera.r20, camera.r21, camera.r22)
    grad_jacobian_x = dot((grad_image_x[0], grad_image_x[1], grad_image_x[2]), row_x)
    grad_bend_x = dot((grad_image_x[0], grad_image_x[1], grad_image_x[2]), row_z)
    grad_jacobian_y = dot((grad_image_y[0], grad_image_y[1], grad_image_y[2]), row_y)
    grad_bend_y = dot((grad_image_y[0], grad_image_y[1], grad_image_y[2]), row_z)

    build = p.x.build
    free_x = build.all_of(
        [p.raw_slope_x.compare(">=", camera.slope_x_min), p.raw_slope_x.compare("<=", camera.slope_x_max)]
    )
    free_y = build.all_of(
        [p.raw_slope_y.compare(">=", camera.slope_y_min), p.raw_slope_y.compare("<=", camera.slope_y_max)]
    )
    grad_slope_x = grad_center_x * camera.fx - (grad_bend_x * p.jacobian_x).where(free_x)
    grad_slope_y = grad_center_y * camera.fy - (grad_bend_y * p.jacobian_y).where(free_y)
    grad_inverse_z = (
        camera.fx * (grad_jacobian_x - grad_bend_x * p.slope_x)
        + camera.fy * (grad_jacobian_y - grad_bend_y * p.slope_y)
        + grad_slope_x * p.x
        + grad_slope_y * p.y
    )
    grad_camera = (
        grad_slope_x * p.inverse_z,
        grad_slope_y * p.inverse_z,
        -(grad_inverse_z * p.inverse_z * p.inverse_z),
    )
    return [row_x[k] * grad_camera[0] + row_y[k] * grad_camera[1] + row_z[k] * grad_camera[2] for k in range(3)]


class BackwardJob(NamedTuple):
    """Arguments of `project_backward`, which writes all gradients; those of rows that are not in `trained` are zero.

    Attributes:
        trained, pairs_of_row, row_slots: Of `place_slots`.
        pair_sums: Of `replay_tiles`.
        scratch: One row per worker of at least 272 floats, 64-byte aligned.
        grad_centers: Gradient of the centres in pixels. [N, 2]
        Others: As in the forward kernels.
    """

    trained: SmallInts1
    n_trained: int
    pairs_of_row: SmallInts1
    row_slots: SmallInts1
    pair_sums: Floats2
    means: Floats2
    quats: Floats2
    scales: Floats2
    opacities: Floats1
    camera: Floats1
    scratch: Floats2
    grad_means: Floats2
    grad_quats: Floats2
    grad_scales: Floats2
    grad_opacities: Floats1
    grad_colors: Floats2
    grad_centers: Floats2


@kernel(BackwardJob, fastmath=rec.FASTMATH)
def project_backward(worker, arguments):
    """See BackwardJob."""
    job = read(BackwardJob, arguments)
    trained, n_trained, pairs_of_row, row_slots = job.trained, job.n_trained, job.pairs_of_row, job.row_slots
    pair_sums, means, quats, scales = job.pair_sums, job.means, job.quats, job.scales
    opacities, camera, scratch = job.opacities, job.camera, job.scratch
    grad_means, grad_quats, grad_scales = job.grad_means, job.grad_quats, job.grad_scales
    grad_opacities, grad_colors, grad_centers = job.grad_opacities, job.grad_colors, job.grad_centers
    n_workers = len(scratch)
    n_rows = len(means)
    n_groups = (n_trained + 15) // 16
    sums = scratch[worker]
    rows = sums[256:272].view(np.int32)
    sums_address = np.int64(sums.ctypes.data)
    pair_sums_address = np.int64(pair_sums.ctypes.data)
    first_group, end_group = n_groups * worker // n_workers, n_groups * (worker + 1) // n_workers
    next_row = 0 if first_group == 0 else trained[first_group * 16 - 1] + 1
    for group in range(first_group, end_group):
        first = group * 16
        n_valid = min(16, n_trained - first)
        for lane in range(16):
            row = trained[first + min(lane, n_valid - 1)]
            rows[lane] = row
            _sum_pairs(
                pair_sums_address + np.int64(row_slots[row]) * _PAIR_BYTES,
                np.int64(pairs_of_row[row]),
                sums_address + np.int64(lane) * 64,
            )
        _backward_sixteen(
            sums_address,
            np.int64(rows.ctypes.data),
            np.int64(means.ctypes.data),
            np.int64(quats.ctypes.data),
            np.int64(scales.ctypes.data),
            np.int64(opacities.ctypes.data),
            np.int64(camera.ctypes.data),
        )
        for lane in range(n_valid):
            row = rows[lane]
            for gap in range(next_row, row):
                _clear(gap, grad_means, grad_quats, grad_scales, grad_opacities, grad_colors, grad_centers)
            next_row = row + 1
            source = lane * 16
            for column in range(3):
                grad_means[row, column] = sums[source + column]
                grad_scales[row, column] = sums[source + 7 + column]
                grad_colors[row, column] = sums[source + 11 + column]
            for column in range(4):
                grad_quats[row, column] = sums[source + 3 + column]
            grad_opacities[row] = sums[source + 10]
            grad_centers[row, 0] = sums[source + 14]
            grad_centers[row, 1] = sums[source + 15]
    if worker == n_workers - 1:
        for gap in range(next_row, n_rows):
            _clear(gap, grad_means, grad_quats, grad_scales, grad_opacities, grad_colors, grad_centers)


@njit(inline="always")
def _clear(row, grad_means, grad_quats, grad_scales, grad_opacities, grad_colors, grad_centers):
    for column in range(3):
        grad_means[row, column] = _ZERO
        grad_scales[row, column] = _ZERO
        grad_colors[row, column] = _ZERO
    for column in range(4):
        grad_quats[row, column] = _ZERO
    grad_opacities[row] = _ZERO
    grad_centers[row, 0] = _ZERO
    grad_centers[row, 1] = _ZERO
