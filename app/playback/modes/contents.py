"""Contents of a loaded clip beyond its frames: a part of it alone, where each Gaussian comes from, and how far it
has changed since the reference clip. For the thread that decodes; everything is made once, when it is first needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from app.playback.modes.view_modes import ALL
from engine.capture.clip import Clip
from engine.editing.fills.fill import FILLED, GUESSED
from engine.editing.gaussian_rows import COPIED, GaussianRows

if TYPE_CHECKING:
    from engine.clip_files.clip_state import ClipState
    from engine.editing.edited_clip import EditedClip, EditedGaussians
    from engine.model.clip_model import ClipModel
    from engine.raster.gaussians import Gaussians

OF_REFERENCE, LEARNED_ON, BORN_HERE, OF_FILL, OF_GUESS = range(5)
"""Births: from the reference clip as it was; from it, but trained further in this clip; new in this clip; of the fill
of an edit, seen by some camera; of such a fill, a guess."""
_SAME_PLACE_SHARE = 1e-2
"""Anchors nearer to each other than this share of their spacing are the same anchor, stored twice."""


def part_of(model: ClipModel, content: str) -> ClipModel:
    """A clip of which only a part is decoded, see CONTENTS of view_modes. Shares everything with the model.

    Not for training; its caches are its own, so it may be decoded on another thread than the model.
    """
    from engine.metrics.clips.features_apart import with_features

    match content:
        case "f_s":
            return with_features(model, "static")
        case "f_d":
            return with_features(model, "dynamic")
        case "static" | "dynamic":
            wants_dynamic = content == "dynamic"
            return model.part([role for role in model.roles() if model.anchor_set(role).is_dynamic == wants_dynamic])
        case _:
            return model


class EditedParts:
    """Parts of one loaded clip with the edits that hold, and facts about their Gaussians.

    Args:
        model: The clip.
        clip: Its frames.
        state: The state that it was loaded from.
        reference: The state that it inherits from; None for a clip that inherits nothing.
    """

    def __init__(self, model: ClipModel, clip: Clip, state: ClipState, reference: ClipState | None) -> None:
        from engine.editing.clip_rows import named_sets

        self._model, self._clip, self._state, self._reference = model, clip, state, reference
        reference_index = 0 if reference is None else reference.header.clip_index
        header = replace(state.header, clip_index=clip.clip_index)  # others were split or merged since, perhaps
        self.named = named_sets(model, header, reference_index)
        self._parts: dict[str, EditedClip] = {}
        self._base: Gaussians | None = None
        self._base_rows: dict[str, np.ndarray] = {}

    def part(self, content: str) -> EditedClip:
        """The clip of which only this part is decoded."""
        from engine.editing.edited_clip import EditedClip

        if content not in self._parts:
            self._parts[content] = EditedClip(part_of(self._model, content), self._clip, self.named)
        return self._parts[content]

    def apart(self, content: str) -> EditedClip:
        """A part with separate caches, to be decoded on another thread; not of the whole clip."""
        from engine.editing.edited_clip import EditedClip

        return EditedClip(part_of(self._model, content), self._clip, self.named)

    def has_left(self, edited: EditedGaussians, content: str) -> tuple[np.ndarray, np.ndarray]:
        """Which of all anchors of ClipModel.anchors have a Gaussian that edits have left, inherited and own ones.

        Args:
            edited: Of a part of the clip; nothing is left of its other anchors.
        Returns:
            [A0], [A] bool
        """
        rows, part = self.part(ALL).rows, self.part(content).model
        inherited, own = [np.zeros(0, bool)], [np.zeros(0, bool)]
        for role in self._model.roles():
            is_left = np.zeros(len(self._model.anchor_set(role)), bool)
            if role in part.roles():
                is_left = rows.anchors_among(edited.rows, role)
            (own if self._model.anchor_set(role).is_trainable else inherited).append(is_left)
        return np.concatenate(inherited), np.concatenate(own)

    def births(self, rows: GaussianRows) -> np.ndarray:
        """Where each Gaussian comes from, one of the codes above. [N] uint8"""
        return np.array([self._birth(row_set.role) for row_set in rows.sets], np.uint8)[rows.set_index]

    def _birth(self, role: str) -> int:
        if role in (FILLED, GUESSED):
            return OF_FILL if role == FILLED else OF_GUESS
        if role == COPIED.role:
            return BORN_HERE
        if self._reference is None or not self._model.anchor_set(role).is_trainable:
            return OF_REFERENCE
        return LEARNED_ON if role in ("adapted", "replacing") else BORN_HERE

    def changes(self, gaussians: Gaussians, rows: GaussianRows) -> np.ndarray:
        """How far each Gaussian is from its counterpart in the reference clip without time, edits included.

        The largest of three: of the differences of its colour's channels, that of its opacity, and the way between its
        centres in spacings of static anchors.

        Args:
            gaussians: Of a part.
            rows: Which they are.
        Returns:
            NaN where the reference clip has no such anchor. [N] float32
        """
        from engine.model.host_array import host_array

        base, whole = self._base_gaussians(), self.part(ALL).rows
        k, row = self._model.decoder.gaussians_per_anchor, np.full(len(rows), -1, np.int64)
        for place, row_set in enumerate(rows.sets):
            if row_set.role in (FILLED, GUESSED, COPIED.role):
                continue
            is_of_set = rows.set_index == place
            anchors, among_k = np.divmod(rows.number[is_of_set].astype(np.int64), k)
            found = self._base_rows[row_set.role][whole.rows_of_anchors(row_set.role, anchors)]
            row[is_of_set] = np.where(found < 0, -1, found * k + among_k)
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

        from engine.model.host_array import host_array
        from engine.model.reading import load_clip_model
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
