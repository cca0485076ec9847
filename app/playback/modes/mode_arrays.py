"""Modes that give Gaussians other colours, or put something else in their place, before they are drawn. numpy only."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from app.playback.modes import hues
from app.playback.modes.arrays import AnchorArrays, GaussianArrays
from app.playback.modes.color_maps import mapped
from app.playback.modes.view_modes import BIRTH_HUES, MODES, ShownAs, range_of
from engine.clip_files.roles import ROLES

if TYPE_CHECKING:
    from app.playback.frame_decoder import ShownFrame

BALL_SHARE = 0.25
"""Standard deviation of the ball in an anchor's place, in spacings of anchors."""
BALL_OPACITY = 0.95
MAX_KEPT = 8
"""Frames in a mode that are kept: those of all views, and some that were shown before."""


def drawn_arrays(shown: ShownFrame, mode: str) -> GaussianArrays:
    """The Gaussians drawn of a frame in a mode, which they state.

    Those of the frame where they are the same, and where the mode needs values that were not decoded with them.
    """
    gaussians = shown.gaussians
    if mode not in _MADE or (mode == "changed" and gaussians.changes is None):
        return gaussians
    shown_as = ShownAs(mode, gaussians.source.shown_as.content)
    return replace(_MADE[mode](shown), key=(gaussians.key, mode), source=replace(gaussians.source, shown_as=shown_as))


class ModeArrays:
    """Keeps the newest frames in a mode, so that drawing them again takes the same arrays."""

    def __init__(self) -> None:
        self._kept: OrderedDict[object, GaussianArrays] = OrderedDict()

    def of(self, shown: ShownFrame, mode: str) -> GaussianArrays:
        """See `drawn_arrays`."""
        if mode not in _MADE:
            return shown.gaussians
        key = (shown.gaussians.key, mode)
        known = self._kept.pop(key, None)
        self._kept[key] = made = drawn_arrays(shown, mode) if known is None else known
        while len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)
        return made

    def clear(self) -> None:
        """Forget everything."""
        self._kept.clear()


def _by_birth(shown: ShownFrame) -> GaussianArrays:
    births = shown.gaussians.births
    assert births is not None  # the decoder always gives them
    return replace(shown.gaussians, colors=np.array(BIRTH_HUES, np.float32)[births])


def _by_change(shown: ShownFrame) -> GaussianArrays:
    gaussians = shown.gaussians
    assert gaussians.changes is not None
    colors = mapped(gaussians.changes, MODES["changed"].map_name, *range_of("changed", None), nothing=hues.SKY)
    return replace(gaussians, colors=colors.astype(np.float32) / np.float32(255.0))


def _anchors_alone(shown: ShownFrame) -> GaussianArrays:
    """A ball in place of every anchor of the part of the clip that is shown."""
    positions, colors = anchor_balls(shown.anchors, shown.gaussians.source.shown_as.content)
    n = len(positions)
    return replace(
        shown.gaussians,
        means=positions,
        quats=np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (n, 1)),
        scales=np.full((n, 3), BALL_SHARE * shown.anchors.spacing, np.float32),
        opacities=np.full(n, BALL_OPACITY, np.float32),
        colors=colors,
        births=None,
        changes=None,
        rows=None,
        n_still=0,
        still_key=None,
    )


def anchor_balls(anchors: AnchorArrays, content: str) -> tuple[np.ndarray, np.ndarray]:
    """Places and colours of the anchors of a part of the clip. [A, 3] float32 each"""
    positions = np.concatenate([anchors.inherited_positions, anchors.own_positions])
    if anchors.inherited_roles is None or anchors.own_roles is None:
        return positions, np.full_like(positions, 0.8)
    roles = np.concatenate([anchors.inherited_roles, anchors.own_roles])
    is_static = roles == ROLES.index("static")
    is_chosen = {"static": is_static, "dynamic": ~is_static}.get(content, np.ones(len(roles), bool))
    hue_of_role = np.array([hues.ROLE_HUES[role] for role in ROLES], np.float32)
    return positions[is_chosen], hue_of_role[roles[is_chosen]]


_MADE = {"birth": _by_birth, "changed": _by_change, "anchors": _anchors_alone}
