"""What commands that select act on: the frame that the session shows, its anchors and their residuals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from app.playback.modes.view_modes import ShownAs, decoded_as
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.residuals.residuals import Residuals
from app.session.editing.attributes import AnchorValues


class ShownToSelect:
    """Looks it up when it is needed. For one thread.

    Args:
        timeline: Of the session, now.
        shown_as: In which mode and which part of clips.
    """

    def __init__(
        self,
        playback: Playback,
        residuals: Residuals,
        timeline: Callable[[], Timeline],
        shown_as: Callable[[], ShownAs],
    ) -> None:
        self._playback, self._residuals, self._timeline, self._shown_as = playback, residuals, timeline, shown_as
        self._per_anchor = 1

    def selectable(self) -> GaussianArrays | None:
        """Gaussians of the shown frame in their own colours; None where nothing is trained."""
        shown = self._playback.frame(self._timeline(), decoded_as(self._shown_as()))
        return None if shown is None else shown.gaussians

    def anchor_values(self, column: str) -> AnchorValues | None:
        """Anchors of that frame; with a column, their residuals. None while those are not known."""
        if column:
            heat = self._residuals.anchor_heat(self._timeline(), column)
            return None if heat is None or heat.is_stale or heat.note else AnchorValues(heat.positions, heat.values)
        shown = self._playback.frame(self._timeline(), decoded_as(self._shown_as()))
        if shown is None:
            return None
        positions = np.concatenate([shown.anchors.inherited_positions, shown.anchors.own_positions])
        return AnchorValues(positions, np.full(len(positions), np.nan, np.float32))

    def gaussians_per_anchor(self) -> int:
        """K of the open project; 1 while that is not known."""
        self._per_anchor = self._playback.gaussians_per_anchor(self._timeline()) or self._per_anchor
        return self._per_anchor
