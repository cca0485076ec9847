"""The frame that selecting commands act on: the one that the session shows, its anchors and their residuals."""

from __future__ import annotations

import numpy as np

from app.playback.frame_decoder import ShownFrame
from app.playback.modes.arrays import GaussianArrays
from app.playback.modes.view_modes import decoded_as
from app.session.editing.attributes import AnchorValues
from app.session.showing.showing import Showing


class ShownToSelect:
    """Looks it up when it is needed. For one thread. showing: Of the session."""

    def __init__(self, showing: Showing) -> None:
        self._showing = showing
        self._per_anchor = 1

    def _shown(self) -> ShownFrame | None:
        showing = self._showing
        return showing.playback.frame(showing.timeline, decoded_as(showing.shown_as))

    def selectable(self) -> GaussianArrays | None:
        """Gaussians of the shown frame in their own colours; None where nothing is trained."""
        shown = self._shown()
        return None if shown is None else shown.gaussians

    def anchor_values(self, column: str) -> AnchorValues | None:
        """Anchors of that frame; with a column, their residuals. None while those are not known."""
        if column:
            heat = self._showing.residuals.anchor_heat(self._showing.timeline, column)
            return None if heat is None or heat.is_stale or heat.note else AnchorValues(heat.positions, heat.values)
        shown = self._shown()
        if shown is None:
            return None
        positions = np.concatenate([shown.anchors.inherited_positions, shown.anchors.own_positions])
        return AnchorValues(positions, np.full(len(positions), np.nan, np.float32))

    def gaussians_per_anchor(self) -> int:
        """K of the open project; 1 while that is not known."""
        showing = self._showing
        self._per_anchor = showing.playback.gaussians_per_anchor(showing.timeline) or self._per_anchor
        return self._per_anchor
