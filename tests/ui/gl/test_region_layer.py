"""Regions over a picture: where they are drawn, what tells them apart, and what is counted in a chosen sphere."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from app.playback.modes.arrays import AnchorArrays
from engine.clip_files.roles import ROLES
from engine.gate.regions import sphere_region
from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_color
from tests.ui.gl.scenes import Camera, centered_camera
from ui.gl.targets import Target
from ui.style.colors import CHOSEN, REGION_COLORS
from ui.viewport.layers.region_layer import RegionLayer, ShownRegions

pytestmark = pytest.mark.gl

SIZE = 128
STATIC, DYNAMIC = (sphere_region(treat, (0.0, 0.0, 0.0), 1.0) for treat in ("static", "dynamic"))


@pytest.fixture
def camera() -> Camera:
    return centered_camera(SIZE, focal_px=180.0, distance=4.0)


def anchors(positions: list[tuple[float, float, float]], roles: list[str] | None) -> AnchorArrays:
    codes = None if roles is None else np.array([ROLES.index(role) for role in roles], np.uint8)
    first = len(positions) // 2
    return AnchorArrays(
        np.array(positions[:first], np.float32).reshape(-1, 3),
        np.array(positions[first:], np.float32).reshape(-1, 3),
        key=(tuple(positions), tuple(roles or ())),
        inherited_roles=None if codes is None else codes[:first],
        own_roles=None if codes is None else codes[first:],
    )


def drawn(
    ctx: moderngl.Context, keep: Keep, camera: Camera, shown: ShownRegions, held: AnchorArrays | None = None
) -> tuple[np.ndarray, RegionLayer]:
    """The picture over black, [H, W, 3] in 0..1, and the layer."""
    target, layer = keep(Target(ctx, (SIZE, SIZE), precision="f4")), keep(RegionLayer(ctx))
    layer.take(shown, held, -camera.world_to_camera[:3, :3].T @ camera.world_to_camera[:3, 3])
    layer.draw(target, camera.arguments)
    return read_color(target)[:, :, :3], layer


def is_like(picture: np.ndarray, color: tuple[float, ...]) -> np.ndarray:
    """Pixels of a hue at half of its brightness or more. [H, W] bool"""
    hue = np.array(color[:3]) / np.linalg.norm(color[:3])
    length = np.linalg.norm(picture, axis=2)
    return (picture @ hue > 0.97 * length) & (length > 0.5 * np.linalg.norm(color[:3]))


def rim(picture: np.ndarray, color: tuple[float, ...]) -> float:
    """Share of the rim of a sphere of radius 1 around the origin that has the colour."""
    angles = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
    x = SIZE // 2 + 0.5 + 45.0 * np.cos(angles)  # 180 px x 1 / 4, the great circle across the view
    y = SIZE // 2 + 0.5 + 45.0 * np.sin(angles)
    return float(is_like(picture, color)[y.astype(int), x.astype(int)].mean())


def test_a_static_sphere_has_a_whole_rim_and_a_moving_one_a_dashed_one(
    ctx: moderngl.Context, keep: Keep, camera: Camera
) -> None:
    static, _ = drawn(ctx, keep, camera, ShownRegions(marked=(STATIC,)))
    dynamic, _ = drawn(ctx, keep, camera, ShownRegions(marked=(DYNAMIC,)))
    # a line of 1.5 px that lies between pixels is faint in both: a few of them do not count
    assert rim(static, REGION_COLORS["static"]) > 0.85
    assert 0.3 < rim(dynamic, REGION_COLORS["dynamic"]) < 0.75
    assert rim(dynamic, REGION_COLORS["static"]) == 0.0


def test_the_highlighted_one_is_drawn_wider(ctx: moderngl.Context, keep: Keep, camera: Camera) -> None:
    plain, _ = drawn(ctx, keep, camera, ShownRegions(marked=(STATIC,)))
    wide, _ = drawn(ctx, keep, camera, ShownRegions(marked=(STATIC,), highlighted=0))
    n_plain, n_wide = (int(is_like(picture, REGION_COLORS["static"]).sum()) for picture in (plain, wide))
    assert n_wide > 1.2 * n_plain


def test_what_is_gone_is_not_drawn_any_more(ctx: moderngl.Context, keep: Keep, camera: Camera) -> None:
    target, layer = keep(Target(ctx, (SIZE, SIZE), precision="f4")), keep(RegionLayer(ctx))
    eye = np.array([0.0, 0.0, -4.0])
    held = anchors([(0.0, 0.0, 0.0)] * 2, ["static", "moving"])
    first = layer.take(ShownRegions(marked=(STATIC,), sphere=DYNAMIC), held, eye)
    assert layer.counts
    assert layer.take(ShownRegions(marked=(STATIC,), sphere=DYNAMIC), held, eye) == first
    assert layer.take(ShownRegions(marked=(STATIC,), sphere=DYNAMIC), held, 2 * eye) != first
    assert layer.take(ShownRegions(), None, eye) != first
    layer.draw(target, camera.arguments)
    assert read_color(target).max() == 0.0
    assert layer.counts == {}


def test_anchors_in_the_chosen_sphere_are_counted_by_role_and_shown(
    ctx: moderngl.Context, keep: Keep, camera: Camera
) -> None:
    positions = [(0.0, 0.0, 0.0), (0.5, 0.5, 0.0), (2.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 1.01), (-0.4, 0.2, 0.0)]
    held = anchors(positions, ["static", "moving", "static", "residual", "residual", "residual"])
    picture, layer = drawn(ctx, keep, camera, ShownRegions(sphere=STATIC), held)
    assert layer.counts == {"static": 1, "moving": 1, "residual": 2}
    pixels = camera.project(np.array(positions)).astype(int)
    is_marked = is_like(picture, CHOSEN)
    assert is_marked[pixels[1, 1], pixels[1, 0]]
    assert is_marked[pixels[5, 1], pixels[5, 0]]
    _, layer = drawn(ctx, keep, camera, ShownRegions(sphere=STATIC), anchors(positions, None))
    assert layer.counts == {"anchor": 4}
    _, layer = drawn(ctx, keep, camera, ShownRegions(marked=(STATIC,)), held)
    assert layer.counts == {}, "only the sphere being chosen asks for anchors"
