"""The projection of sixteen Gaussians, in lanes: the part that the forward and the backward pass both evaluate.

EWA splatting (Zwicker et al. 2001): covariance2d = half half^T + EPS2D, half = J R_camera R_gaussian diag(scales),
with J the Jacobian of the perspective map at a slope held inside the slope limits of the view.
"""

from __future__ import annotations

from dataclasses import dataclass

from engine.backends.cpu.raster.camera_row import CameraLanes
from engine.conventions import EPS2D_PX2
from engine.kernels.lanes import Lanes

Row = tuple[Lanes, ...]
"""Three values, a row of a matrix or a vector."""


@dataclass(slots=True)
class Projection:
    """Intermediate values of one projection.

    Attributes:
        x, y, z: Centre in the camera; inverse_z = 1 / z.
        raw_slope_x, raw_slope_y: x/z and y/z.
        slope_x, slope_y: The same within the limits.
        jacobian_x, jacobian_y: fx / z and fy / z; the third columns are -jacobian_x * slope_x, -jacobian_y * slope_y.
        image_x, image_y: Rows of J R_camera.
        w, qx, qy, qz: Unit quaternion; inverse_norm of the given one; norm_squared of it.
        rotation: Its matrix, by rows.
        unit_x, unit_y: Rows of J R_camera R_gaussian, before the scales.
        half_x, half_y: Rows of `half`, pixels.
    """

    x: Lanes
    y: Lanes
    z: Lanes
    inverse_z: Lanes
    raw_slope_x: Lanes
    raw_slope_y: Lanes
    slope_x: Lanes
    slope_y: Lanes
    jacobian_x: Lanes
    jacobian_y: Lanes
    image_x: Row
    image_y: Row
    w: Lanes
    qx: Lanes
    qy: Lanes
    qz: Lanes
    norm_squared: Lanes
    inverse_norm: Lanes
    rotation: tuple[Row, ...]
    unit_x: Row
    unit_y: Row
    half_x: Row
    half_y: Row


def dot(left: Row, right: Row) -> Lanes:
    """Sum of three products."""
    return left[0] * right[0] + left[1] * right[1] + left[2] * right[2]


def project_lanes(camera: CameraLanes, mean: Row, quat: tuple[Lanes, ...], scale: Row) -> Projection:
    """Project sixteen Gaussians. NaN and infinities pass through lane by lane."""
    x = dot((camera.r00, camera.r01, camera.r02), mean) + camera.t0
    y = dot((camera.r10, camera.r11, camera.r12), mean) + camera.t1
    z = dot((camera.r20, camera.r21, camera.r22), mean) + camera.t2
    inverse_z = 1.0 / z
    raw_slope_x, raw_slope_y = x * inverse_z, y * inverse_z
    slope_x = raw_slope_x.max(camera.slope_x_min).min(camera.slope_x_max)
    slope_y = raw_slope_y.max(camera.slope_y_min).min(camera.slope_y_max)
    jacobian_x, jacobian_y = camera.fx * inverse_z, camera.fy * inverse_z
    bend_x, bend_y = -(jacobian_x * slope_x), -(jacobian_y * slope_y)
    image_x = (
        jacobian_x * camera.r00 + bend_x * camera.r20,
        jacobian_x * camera.r01 + bend_x * camera.r21,
        jacobian_x * camera.r02 + bend_x * camera.r22,
    )
    image_y = (
        jacobian_y * camera.r10 + bend_y * camera.r20,
        jacobian_y * camera.r11 + bend_y * camera.r21,
        jacobian_y * camera.r12 + bend_y * camera.r22,
    )
    norm_squared = quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3]
    inverse_norm = 1.0 / norm_squared.sqrt()
    w, qx, qy, qz = (component * inverse_norm for component in quat)
    rotation = (
        (1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy - w * qz), 2.0 * (qx * qz + w * qy)),
        (2.0 * (qx * qy + w * qz), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz - w * qx)),
        (2.0 * (qx * qz - w * qy), 2.0 * (qy * qz + w * qx), 1.0 - 2.0 * (qx * qx + qy * qy)),
    )
    columns = tuple(zip(*rotation, strict=True))
    unit_x = (dot(image_x, columns[0]), dot(image_x, columns[1]), dot(image_x, columns[2]))
    unit_y = (dot(image_y, columns[0]), dot(image_y, columns[1]), dot(image_y, columns[2]))
    return Projection(
        x=x,
        y=y,
        z=z,
        inverse_z=inverse_z,
        raw_slope_x=raw_slope_x,
        raw_slope_y=raw_slope_y,
        slope_x=slope_x,
        slope_y=slope_y,
        jacobian_x=jacobian_x,
        jacobian_y=jacobian_y,
        image_x=image_x,
        image_y=image_y,
        w=w,
        qx=qx,
        qy=qy,
        qz=qz,
        norm_squared=norm_squared,
        inverse_norm=inverse_norm,
        rotation=rotation,
        unit_x=unit_x,
        unit_y=unit_y,
        half_x=(unit_x[0] * scale[0], unit_x[1] * scale[1], unit_x[2] * scale[2]),
        half_y=(unit_y[0] * scale[0], unit_y[1] * scale[1], unit_y[2] * scale[2]),
    )


@dataclass(slots=True)
class Covariance:
    """Covariance of the footprint with the low-pass added, pixels squared, and its determinant."""

    xx: Lanes
    xy: Lanes
    yy: Lanes
    determinant: Lanes


def covariance(projection: Projection) -> Covariance:
    """half half^T + EPS2D.

    The determinant of half half^T is the sum of squared 2x2 minors (Cauchy-Binet): no difference of large numbers.
    """
    a, b = projection.half_x, projection.half_y
    bare_xx, bare_yy = dot(a, a), dot(b, b)
    minors = (a[0] * b[1] - a[1] * b[0], a[0] * b[2] - a[2] * b[0], a[1] * b[2] - a[2] * b[1])
    determinant = dot(minors, minors) + EPS2D_PX2 * (bare_xx + bare_yy) + EPS2D_PX2**2
    return Covariance(bare_xx + EPS2D_PX2, dot(a, b), bare_yy + EPS2D_PX2, determinant)


def cholesky(covariance: Covariance) -> tuple[Lanes, Lanes, Lanes]:
    """Precision of u = dx + slope dy, precision of dy given u, and the slope: `record` explains the form."""
    precision_y = 1.0 / covariance.yy
    return covariance.yy / covariance.determinant, precision_y, -(covariance.xy * precision_y)
