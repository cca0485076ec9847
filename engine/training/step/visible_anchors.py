"""The anchors of a clip that each training camera can see, so that a step decodes no others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from engine.camera.rig import CameraRig
from engine.model.clip_model import ClipModel
from engine.model.clip_view import View, reaches_of
from engine.model.motion import AnchorMotion


def camera_views(rig: CameraRig, *, near_plane: float) -> list[View]:
    """Views of all cameras of a rig whose pictures have one size. near_plane: nearest depth drawn, scene units"""
    width, height = (int(side) for side in rig.image_sizes[0])
    return [
        View.from_arrays(pose, K, width=width, height=height, near_plane=near_plane)
        for pose, K in zip(rig.world_to_camera, rig.Ks, strict=True)
    ]


_MOTION = ("velocities", "accelerations")
MAX_BYTES = 256 << 20
"""Memory for rows of moving anchors, of each camera and frame; rows that do not fit are found at every step."""


class Sight:
    """Rows to decode, view by view. Visible anchors that stay in place are found once.

    Args:
        model: Its sets must stay as they are; another one is needed where anchors come, go or become dynamic.
        views: Of the training cameras, or of windows of their pictures.
        reach: How far beyond its anchor a Gaussian may lie, scene units; farther where anchors are larger.
        reaches: The same anchor by anchor, where that was decided before: sizes are learned, and the visible anchors
            stay those at the beginning of a phase. By role, [A] each; those that do not fit the model are decided anew.
            With them, for the same reason, the motion of sets that travel, [A, 3] each.
    """

    def __init__(
        self,
        model: ClipModel,
        views: Sequence[View],
        *,
        reach: float,
        reaches: Mapping[str, Tensor] | None = None,
    ) -> None:
        self._model, self._views = model, list(views)
        self.reaches: dict[str, Tensor] = {}
        for role in model.roles():
            anchors, known = model.anchor_set(role), (reaches or {}).get(role)
            if known is None or known.shape != (len(anchors),):
                known = reaches_of(anchors, reach)
            self.reaches[role] = known
            for kind in _MOTION if anchors.travels else ():
                first, now = (reaches or {}).get(f"{role}.{kind}"), getattr(anchors, kind).detach()
                self.reaches[f"{role}.{kind}"] = now.clone() if first is None or first.shape != now.shape else first
        self._seen: dict[tuple[str, int], Tensor] = {}  # rows of static sets, flags of dynamic ones
        self._present: dict[str, Tensor] = {}  # of dynamic sets, a row a frame; [M, A]
        self._rows: dict[tuple[str, int, float], Tensor] = {}  # of dynamic sets
        self._n_bytes = 0

    def rows(self, view_row: int, clip_time: float) -> dict[str, Tensor]:
        """Rows of every set that a camera can see and that exist at this time. [n] int64 each"""
        rows = {}
        for role in self._model.roles():
            key, anchors = (role, view_row), self._model.anchor_set(role)
            if anchors.travels:
                rows[role] = self._travelling_rows(role, view_row, clip_time)
                continue
            if key not in self._seen or anchors.positions.requires_grad:
                is_seen = self._views[view_row].sees(anchors.positions, reach=self.reaches[role])
                self._seen[key] = is_seen if anchors.is_dynamic else is_seen.nonzero()[:, 0]
            rows[role] = self._seen[key]
            if anchors.presence is not None:
                rows[role] = self._present_rows(role, view_row, clip_time, is_kept=not anchors.positions.requires_grad)
        return rows

    def _present_rows(self, role: str, view_row: int, clip_time: float, *, is_kept: bool) -> Tensor:
        """Rows of a dynamic set that the camera can see and that exist at this time, found once where they are kept."""
        known = self._rows.get((role, view_row, clip_time))
        if known is not None:
            return known
        rows = (self._is_present(role, clip_time) & self._seen[role, view_row]).nonzero()[:, 0]
        if is_kept:
            self._remember(role, view_row, clip_time, rows)
        return rows

    def _travelling_rows(self, role: str, view_row: int, clip_time: float) -> Tensor:
        """The same of a set whose anchors travel: found once, as they travelled at first."""
        known = self._rows.get((role, view_row, clip_time))
        if known is None:
            anchors, first = self._model.anchor_set(role), (self.reaches[f"{role}.{kind}"] for kind in _MOTION)
            motion = AnchorMotion(anchors.birth_frames, *first)
            positions = anchors.positions.detach() + motion.away(clip_time * self._model.clip_length)
            is_seen = self._views[view_row].sees(positions, reach=self.reaches[role])
            known = (self._is_present(role, clip_time) & is_seen).nonzero()[:, 0]
            self._remember(role, view_row, clip_time, known)
        return known

    def _is_present(self, role: str, clip_time: float) -> Tensor:
        if role not in self._present:
            presence = self._model.anchor_set(role).presence
            assert presence is not None
            self._present[role] = presence.T.contiguous()
        frames = [self._present[role][knot] for knot, _ in self._model.knots(clip_time)]
        return frames[0] if len(frames) == 1 else torch.logical_or(*frames)

    def _remember(self, role: str, view_row: int, clip_time: float, rows: Tensor) -> None:
        if self._n_bytes < MAX_BYTES:
            self._n_bytes += rows.nbytes
            self._rows[role, view_row, clip_time] = rows
