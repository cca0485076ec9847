"""A small scene as decoded arrays, for the modes that show it: a ball before a wall, with anchors of both kinds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.playback.frame_decoder import ShownFrame
from app.playback.modes.arrays import AnchorArrays, GaussianArrays
from app.playback.modes.view_modes import ALL, ShownAs
from app.playback.picture_source import PictureSource
from app.playback.render import RenderRequest, RenderView
from app.playback.views.orbit_view import OrbitView
from engine.clip_files.roles import ROLES
from engine.raster.pinhole_view import PinholeView
from tests.ui.fake_session import make_rig

SIZE = (120, 90)
DISTANCE = 3.0
AHEAD = 0.0
"""Yaw of a view along -z, at the ball and the wall behind it."""


def scene() -> ShownFrame:
    """A ball of radius 0.6 at the origin, which is new in this clip, before a wall one unit behind it."""
    random = np.random.default_rng(3)
    on_ball = random.normal(size=(1500, 3))
    on_ball *= 0.6 / np.linalg.norm(on_ball, axis=1, keepdims=True)
    y, x = np.mgrid[-1.3:1.3:40j, -1.3:1.3:40j]
    wall = np.stack([x, y, -np.ones_like(x)], -1).reshape(-1, 3)
    means = np.concatenate([on_ball, wall]).astype(np.float32)
    n_ball, n = len(on_ball), len(on_ball) + len(wall)
    colors = 0.5 + 0.5 * np.sin(6.0 * means + np.array([0.0, 2.0, 4.0]))
    colors[n_ball:] *= 0.5
    births = np.where(np.arange(n) < n_ball, 2, (means[:, 0] > 0.9).astype(int)).astype(np.uint8)
    changes = np.where(births == 2, np.nan, 0.25 * (means[:, 1] + 1.3) / 1.3).astype(np.float32)
    gaussians = GaussianArrays(
        means,
        np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (n, 1)),
        np.full((n, 3), 0.05, np.float32),
        np.full(n, 0.9, np.float32),
        colors.astype(np.float32),
        key="scene",
        source=PictureSource(1, 4, "a state", shown_as=ShownAs(content=ALL)),
        births=births,
        changes=changes,
    )
    anchors = AnchorArrays(
        wall[::7].astype(np.float32),
        on_ball[::10].astype(np.float32),
        "anchors",
        inherited_roles=np.full(len(wall[::7]), ROLES.index("static"), np.uint8),
        own_roles=np.full(len(on_ball[::10]), ROLES.index("residual"), np.uint8),
        spacing=0.15,
    )
    return ShownFrame(gaussians, anchors)


def only(shown: ShownFrame, rows: np.ndarray | slice) -> ShownFrame:
    """Some of its Gaussians."""
    old = shown.gaussians
    names = ("means", "quats", "scales", "opacities", "colors", "births", "changes")
    return replace(shown, gaussians=replace(old, **{name: getattr(old, name)[rows] for name in names}))


def view() -> OrbitView:
    """Looks at the ball from before it, a little from the side and from above."""
    made = OrbitView(make_rig())
    made.pivot, made.distance, made.yaw, made.pitch = np.zeros(3), DISTANCE, AHEAD + 0.35, 0.25
    return made


def request(shown: ShownFrame, mode: str, *, view_: OrbitView | None = None) -> RenderRequest:
    """What draws it in a mode."""
    look = RenderView.of(view() if view_ is None else view_, *SIZE, shown_as=ShownAs(mode))
    return RenderRequest((1, "path", 1, "a state", "", ShownAs(), 4), look, shown)


def pinhole(made: OrbitView) -> PinholeView:
    """The same view as back ends see it."""
    pose, K = made.world_to_camera(), made.K(*SIZE)
    return PinholeView(pose[:3, :3], pose[:3, 3], K[0, 0], K[1, 1], K[0, 2], K[1, 2], *SIZE, 0.01)
