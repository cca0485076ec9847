"""Coverage: the space that inherited anchors answer for, and how far a clip's own anchors lie from it. On one thread.

A point of a source clip becomes a residual anchor where it lies outside all spheres around the anchors of the reference
clip that can change: those that move there, or with gate=off all of them (engine.cloud.motion.dedup). The points that
did not become anchors are not kept.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field

import numpy as np

from app.background.latest import LatestWorker
from app.playback.modes.arrays import AnchorArrays
from engine.clip_files.roles import ROLES

N_NEIGHBORS = 3
"""A sphere's radius is the mean distance to this many neighbours, as in the preparation of a clip."""
RANGE_RADII = 10.0
"""Distances are shown up to this many usual radii."""


@dataclass(frozen=True, slots=True, eq=False)
class CoveredSpace:
    """Spheres of the anchors that a source clip inherits, and its residual anchors.

    Attributes:
        centers, radii: Of the spheres, scene units. [S, 3], [S] float32
        points: Residual anchors. [P, 3] float32
        distances: From each of them to the union of the spheres, negative inside, scene units. [P] float32
        key: Changes when the content does.
    """

    centers: np.ndarray
    radii: np.ndarray
    points: np.ndarray
    distances: np.ndarray
    key: Hashable

    @property
    def range(self) -> float:
        """Distances up to this differ in colour, scene units, to two digits; 1 where no sphere has a size."""
        usual = float(np.median(self.radii)) if len(self.radii) else 0.0
        return float(f"{RANGE_RADII * usual:.1e}") if usual > 0.0 else 1.0


@dataclass(frozen=True, slots=True)
class CoverageRequest:
    """All anchors of a clip. Equal keys are equal anchors."""

    key: Hashable
    anchors: AnchorArrays = field(compare=False)


class CoverageFinder:
    """Coverage on demand; the newest request wins. Methods are for one thread, not the one it owns."""

    def __init__(self) -> None:
        self.worker: LatestWorker[CoverageRequest, CoveredSpace] = LatestWorker("coverage", coverage_of)

    def find(self, anchors: AnchorArrays) -> CoveredSpace | None:
        """Of all anchors of a clip; None until it is measured."""
        request = CoverageRequest(anchors.key, anchors)
        newest = self.worker.newest
        if newest is not None and newest[0] == request:
            return newest[1]
        self.worker.request(request)
        return None

    def clear(self) -> None:
        """Forget the measurements."""
        self.worker.forget()

    def close(self) -> None:
        """End the thread."""
        self.worker.close()


def coverage_of(request: CoverageRequest) -> CoveredSpace:
    """Measure. There are no spheres where a clip inherits no anchor that can change, as in the reference clip."""
    from engine.cloud.motion.dedup import mean_neighbor_distance, union_distance

    anchors = request.anchors
    is_inherited = len(anchors.inherited_positions) > 0
    centers = anchors.inherited_positions
    if not anchors.has_changing_static:
        centers = _of_role(centers, anchors.inherited_roles, "moving")
    adapted = _of_role(anchors.own_positions, anchors.own_roles, "adapted")  # took the place of inherited ones
    centers = np.concatenate([centers, adapted]) if is_inherited else centers[:0]
    points = _of_role(anchors.own_positions, anchors.own_roles, "residual")
    radii = mean_neighbor_distance(centers, k=N_NEIGHBORS)
    distances = union_distance(points, centers, radii)
    return CoveredSpace(centers, radii.astype(np.float32), points, distances.astype(np.float32), request.key)


def _of_role(positions: np.ndarray, roles: np.ndarray | None, role: str) -> np.ndarray:
    """Positions of one role; none where roles are unknown. [n, 3]"""
    return positions[:0] if roles is None else positions[roles == ROLES.index(role)]
