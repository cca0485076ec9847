"""What a loaded clip can be asked beyond its frames: a part of it alone, where each Gaussian comes from, and how far it
has changed since the reference clip. For the thread that decodes; everything is made once, when it is first needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.playback.view_modes import ALL
from engine.editing.gaussian_rows import GaussianRows, RowSet

if TYPE_CHECKING:
    from engine.clip_files.clip_state import ClipState
    from engine.model.clip_model import ClipModel
    from engine.raster.gaussians import Gaussians

OF_REFERENCE, LEARNED_ON, BORN_HERE = 0, 1, 2
"""Births: from the reference clip as it was; from it, but learned on in this clip; new in this clip."""
_SAME_PLACE_SHARE = 1e-2
"""Anchors nearer to each other than this share of their spacing are the same anchor, stored twice."""


def part_of(model: ClipModel, content: str) -> ClipModel:
    """A clip of which only a part is decoded, see app.playback.view_modes.CONTENTS. Shares everything with the model.

    Not for training; its caches are its own, so it may be decoded on another thread than the model.
    """
    from engine.metrics.clips.features_apart import with_features
    from engine.model.clip_model import ClipModel

    match content:
        case "f_s":
            return with_features(model, "static")
        case "f_d":
            return with_features(model, "dynamic")
        case "static" | "dynamic":
            wants_dynamic = content == "dynamic"
            roles = [role for role in model.roles() if model.anchor_set(role).is_dynamic == wants_dynamic]
            return ClipModel(
                sets={role: model.anchor_set(role) for role in roles},
                decoder=model.decoder,
                field=model.field,
                clip_length=model.clip_length,
                n_frames=model.n_frames,
                backend=model.backend,
                light=None if wants_dynamic else model.light,
                hidden=model.hidden,
            )
        case _:
            return model


class ClipParts:
    """Parts of one loaded clip, and what is known of their Gaussians.

    Args:
        model: The clip.
        state: What it was loaded from.
        reference: What it inherits from; None for a clip that inherits nothing.
    """

    def __init__(self, model: ClipModel, state: ClipState, reference: ClipState | None) -> None:
        self._model, self._state, self._reference = model, state, reference
        self._parts: dict[str, ClipModel] = {ALL: model}
        self._base: Gaussians | None = None
        self._base_rows: dict[str, np.ndarray] = {}

    def part(self, content: str) -> ClipModel:
        """The clip of which only this part is decoded."""
        if content not in self._parts:
            self._parts[content] = part_of(self._model, content)
        return self._parts[content]

    def decode(self, content: str, clip_time: float) -> Gaussians:
        """Gaussians of a part at a time of the clip; none where it has no anchors."""
        import torch

        from engine.raster.gaussians import Gaussians

        part = self.part(content)
        if not part.roles():
            empty = (torch.zeros(0, *width) for width in ((3,), (4,), (3,), (), (3,)))
            return Gaussians(*empty)
        with torch.no_grad():
            return part.decode(clip_time)

    def births(self, content: str, clip_time: float) -> np.ndarray:
        """Where each Gaussian of `decode` comes from, one of the codes above. [N] uint8"""
        part, births = self.part(content), [np.zeros(0, np.uint8)]
        for role in part.roles():
            n_gaussians = len(part.alive(role, clip_time)) * part.decoder.gaussians_per_anchor
            births.append(np.full(n_gaussians, self._birth(role), np.uint8))
        return np.concatenate(births)

    def rows(self, content: str, clip_time: float) -> GaussianRows:
        """Which anchor set each Gaussian of `decode` comes from, and its number there."""
        from engine.model.host_array import host_array

        part, k, sets = self.part(content), self._model.decoder.gaussians_per_anchor, []
        places, numbers = [np.zeros(0, np.uint8)], [np.zeros(0, np.int32)]
        for role in part.roles():
            is_own = self._reference is None or self._model.anchor_set(role).is_trainable
            header = self._state.header if self._reference is None or is_own else self._reference.header
            anchors, is_hidden = host_array(part.alive(role, clip_time)), part.hidden.get(role)
            if is_hidden is not None:
                anchors = np.flatnonzero(~host_array(is_hidden))[anchors]
            places.append(np.full(k * len(anchors), len(sets), np.uint8))
            numbers.append((anchors[:, None] * k + np.arange(k)).reshape(-1).astype(np.int32))
            sets.append(RowSet(header.fingerprint, header.clip_index, role))
        return GaussianRows(tuple(sets), np.concatenate(places), np.concatenate(numbers))

    def _birth(self, role: str) -> int:
        if self._reference is None or not self._model.anchor_set(role).is_trainable:
            return OF_REFERENCE
        return LEARNED_ON if role in ("adapted", "replacing") else BORN_HERE

    def changes(self, content: str, clip_time: float, gaussians: Gaussians) -> np.ndarray:
        """How far each Gaussian is from what its anchor holds without time in the reference clip.

        The largest of three: of the differences of its colour's channels, that of its opacity, and the way between its
        centres in spacings of static anchors.

        Args:
            gaussians: Of `decode`.
        Returns:
            NaN where the reference clip has no such anchor. [N] float32
        """
        from engine.model.host_array import host_array

        base, part = self._base_gaussians(), self.part(content)
        k, rows = part.decoder.gaussians_per_anchor, [np.zeros(0, np.int64)]
        for role in part.roles():
            anchors = self._base_rows[role][host_array(part.alive(role, clip_time))]
            found = np.where(anchors[:, None] < 0, -1, anchors[:, None] * k + np.arange(k))
            rows.append(found.reshape(-1))
        row = np.concatenate(rows)
        is_known = row >= 0
        changes = np.full(len(row), np.nan, np.float32)
        if not is_known.any():
            return changes
        now, before = is_known.nonzero()[0], row[is_known]
        colors = np.abs(host_array(gaussians.colors)[now] - host_array(base.colors)[before]).max(axis=1)
        opacities = np.abs(host_array(gaussians.opacities)[now] - host_array(base.opacities)[before])
        ways = np.linalg.norm(host_array(gaussians.means)[now] - host_array(base.means)[before], axis=1)
        changes[now] = np.maximum(np.maximum(colors, opacities), ways / self._state.header.spacing)
        return changes

    def _base_gaussians(self) -> Gaussians:
        """All of the reference clip's Gaussians without time, and in `_base_rows` its anchor for each of this clip's,
        -1 where it has none."""
        if self._base is not None:
            return self._base
        from scipy.spatial import KDTree

        from engine.model.clip_model import load_clip_model
        from engine.model.host_array import host_array
        from engine.raster.gaussians import Gaussians

        base = self._model
        if self._reference is not None:
            base = load_clip_model(self._reference, None, backend=self._model.backend)
        known = np.concatenate([host_array(base.anchor_set(role).positions) for role in base.roles()])
        tree, reach = KDTree(known), _SAME_PLACE_SHARE * self._state.header.spacing
        for role in self._model.roles():
            positions = host_array(self._model.anchor_set(role).positions)
            away, nearest = tree.query(positions) if len(known) else (np.full(len(positions), np.inf), 0)
            self._base_rows[role] = np.where(away <= reach, nearest, -1)
        self._base = Gaussians.concatenate([base.static_gaussians(role) for role in base.roles()])
        return self._base
