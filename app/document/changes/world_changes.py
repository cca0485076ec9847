"""Changes to the up direction and scale of a document: functions from one document to another. Three points give the
direction, two points the scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from msgspec import structs

from app.document.project_document import ProjectDocument
from engine.errors import ProjectError

MIN_SINE = 1e-3
"""Points on a line do not define a plane."""


def set_up(document: ProjectDocument, direction: Sequence[float] | None) -> ProjectDocument:
    """Set the up direction.

    Args:
        direction: In scene axes, of any length; None for the one that the cameras suggest.
    Raises:
        ProjectError: It is not a direction.
    """
    up = None
    if direction is not None:
        values = np.asarray(direction, dtype=np.float64)
        length = float(np.linalg.norm(values)) if values.shape == (3,) else 0.0
        if not (np.isfinite(length) and length > 0.0):
            raise ProjectError("This is not a direction: up takes three numbers that are not all zero.")
        x, y, z = (values / length).tolist()
        up = (x, y, z)
    return replace(document, world=structs.replace(document.world, up=up))


def set_scale(document: ProjectDocument, meters_per_unit: float | None) -> ProjectDocument:
    """Set the length of a scene unit. meters_per_unit: m; None removes it.

    Raises:
        ProjectError: The length is out of range.
    """
    try:  # the constructor checks
        world = type(document.world)(document.world.up, meters_per_unit)
    except ValueError as error:
        raise ProjectError(f"The scale cannot be set: {error}.") from error
    return replace(document, world=world)


def up_of_ground(points: Sequence[Sequence[float]], toward: Sequence[float]) -> tuple[float, float, float]:
    """The direction that stands upright on the ground.

    Args:
        points: Three points of the ground, scene units.
        toward: A point above the ground, such as where the cameras stand.
    Raises:
        ProjectError: The points lie on a line, or the other one on the ground.
    """
    a, b, c = (np.asarray(point, dtype=np.float64) for point in points)
    normal = np.cross(b - a, c - a)
    length = float(np.linalg.norm(normal))
    sides = float(np.linalg.norm(b - a) * np.linalg.norm(c - a))
    if not (np.isfinite(sides) and length > MIN_SINE * sides > 0.0):
        raise ProjectError("The three points lie on a line.", hint="Choose points that are farther apart.")
    height = float(normal @ (np.asarray(toward, dtype=np.float64) - a))
    if height == 0.0 or not np.isfinite(height):
        raise ProjectError("The cameras stand on the ground that the points give.", hint="Choose other points.")
    x, y, z = (normal * (np.sign(height) / length)).tolist()
    return x, y, z


def scale_of_length(a: Sequence[float], b: Sequence[float], length_m: float) -> float:
    """The length of a scene unit, m, from two points at a known distance. a, b: Scene units.

    Raises:
        ProjectError: The points are the same, or the length is not one.
    """
    distance = float(np.linalg.norm(np.asarray(b, dtype=np.float64) - np.asarray(a, dtype=np.float64)))
    if not (np.isfinite(distance) and distance > 0.0):
        raise ProjectError("The two points are the same.", hint="Choose points that are farther apart.")
    if not (np.isfinite(length_m) and length_m > 0.0):
        raise ProjectError("The length between the points is not a positive number.")
    return length_m / distance
