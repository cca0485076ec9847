"""Every mode on a small scene: golden pictures, numbers under pixels, and scenes of which there is nothing to see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.playback.frame_decoder import ShownFrame
from app.playback.modes import hues
from app.playback.modes.arrays import BACKGROUND
from app.playback.modes.color_maps import COLOR_MAPS
from app.playback.modes.contents import OF_FILL, OF_GUESS
from app.playback.modes.mode_arrays import MAX_KEPT, ModeArrays, drawn_arrays
from app.playback.modes.mode_pictures import mode_picture, normals_of
from app.playback.modes.view_modes import BIRTH_HUES, CONTENTS, MODES, ShownAs, decoded_as, range_of
from app.playback.render import Picture, RenderRequest, _gaussians
from app.playback.render import render as render_by
from app.playback.views.orbit_view import OrbitView
from engine.backends.table import backend_called
from tests.app.playback.mode_scenes import AHEAD, SIZE, only, pinhole, request, scene, view
from tests.golden_images import assert_matches_golden
from tests.ui.fake_session import make_rig

NOTHING = np.round(np.array(BACKGROUND) * 255).astype(int)
CPU = backend_called("cpu")


def render(request: RenderRequest) -> Picture:
    return render_by(request, CPU)


@pytest.fixture(scope="module")
def shown() -> ShownFrame:
    return scene()


@pytest.mark.parametrize("mode", MODES)
def test_golden_modes(mode: str, shown: ShownFrame, update_golden: bool) -> None:
    assert_matches_golden(render(request(shown, mode)).image, f"mode_{mode}", update=update_golden)


def test_a_picture_says_what_its_colours_mean(shown: ShownFrame) -> None:
    picture = render(request(shown, "depth"))
    assert picture.source.shown_as == ShownAs("depth")
    assert picture.source.frame_index == 4
    assert picture.values is not None
    assert picture.values.shape == SIZE[::-1]
    assert render(request(shown, "color")).values is None


def test_depth_is_that_of_the_surface_and_nothing_has_no_depth(shown: ShownFrame) -> None:
    wall, ahead = only(shown, shown.gaussians.births != 2), view()
    ahead.yaw, ahead.pitch = AHEAD, 0.0
    depth = render(request(wall, "depth", view_=ahead)).values
    assert depth is not None
    is_seen = np.isfinite(depth)
    assert 0.2 < is_seen.mean() < 1.0
    points = _unprojected(depth, ahead)[is_seen]
    assert np.median(np.abs(points[:, 2] + 1.0)) < 0.02, "the wall stands at z = -1"
    picture = render(request(wall, "depth", view_=ahead)).image
    assert (picture[~is_seen] == NOTHING).all()


def _unprojected(depth: np.ndarray, made: OrbitView) -> np.ndarray:
    """World points of a picture of depths. [H, W, 3]"""
    camera = pinhole(made)
    y, x = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], -1)
    return (rays * depth[..., None] - camera.translation) @ camera.rotation


def test_normals_of_a_ball_point_away_from_its_middle() -> None:
    made = view()
    camera, center = pinhole(made), made.world_to_camera()[:3, 3]
    y, x = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], -1)
    along, squared = rays @ center, (rays * rays).sum(-1)
    inside = along**2 - squared * (center @ center - 0.6**2)
    with np.errstate(invalid="ignore"):
        depth = np.where(inside > 0, (along - np.sqrt(inside)) / squared, np.nan)
    expected = (rays * depth[..., None] - center) / 0.6
    normals = normals_of(depth, camera)
    is_inner = inside > 0.35 * np.nanmax(inside)
    cosines = (normals * expected).sum(-1)[is_inner]
    assert cosines.min() > 0.99
    assert np.isnan(normals[inside < 0]).all()


def test_the_edge_of_a_surface_has_the_normal_of_its_own_side() -> None:
    camera = pinhole(view())
    depth = np.full((camera.height, camera.width), 4.0)
    depth[:, : camera.width // 2] = 2.0  # two planes that face the camera, with a step between them
    normals = normals_of(depth, camera)
    np.testing.assert_allclose(normals, np.broadcast_to((0.0, 0.0, -1.0), normals.shape), atol=1e-5)


@pytest.mark.parametrize("mode", MODES)
def test_a_scene_without_gaussians_is_background(mode: str, shown: ShownFrame) -> None:
    empty = only(shown, slice(0))
    no_anchors = replace(
        empty.anchors,
        inherited_positions=empty.anchors.inherited_positions[:0],
        own_positions=empty.anchors.own_positions[:0],
        inherited_roles=np.zeros(0, np.uint8),
        own_roles=np.zeros(0, np.uint8),
    )
    _assert_nothing(render(request(replace(empty, anchors=no_anchors), mode)), mode)


@pytest.mark.parametrize("mode", MODES)
def test_a_scene_behind_the_camera_is_background(mode: str, shown: ShownFrame) -> None:
    away = view()
    away.pivot = away.pivot - 40.0 * away.forward
    away.yaw += np.pi
    _assert_nothing(render(request(shown, mode, view_=away)), mode)


def _assert_nothing(picture, mode: str) -> None:
    expected = np.zeros(3, int) if mode == "opacity" else NOTHING
    assert np.abs(picture.image.astype(int) - expected).max() <= 1
    if picture.values is not None:
        assert (picture.values == 0.0).all() if mode == "opacity" else np.isnan(picture.values).all()


@pytest.mark.parametrize("mode", [name for name in MODES if name != "anchors"])
def test_rows_that_are_not_finite_are_left_out(mode: str, shown: ShownFrame) -> None:
    old = shown.gaussians
    spoiled = {name: getattr(old, name).copy() for name in ("means", "quats", "scales", "opacities", "colors")}
    for row, name in enumerate(spoiled):
        spoiled[name][row * 7] = np.nan
        spoiled[name][row * 7 + 1] = np.inf
    if mode in ("birth", "changed"):
        del spoiled["colors"]  # replaced there
    mixed = replace(shown, gaussians=replace(old, **spoiled))
    is_good = np.all([np.isfinite(values).reshape(len(values), -1).all(axis=1) for values in spoiled.values()], axis=0)
    found, expected = render(request(mixed, mode)), render(request(only(shown, is_good), mode))
    np.testing.assert_array_equal(found.image, expected.image)


def test_colours_of_births_and_changes(shown: ShownFrame) -> None:
    assert shown.gaussians.births is not None
    births = shown.gaussians.births.copy()
    births[:2] = OF_FILL, OF_GUESS  # no edit of this scene has a fill
    shown = replace(shown, gaussians=replace(shown.gaussians, births=births))
    births, changes = drawn_arrays(shown, "birth"), drawn_arrays(shown, "changed")
    for birth, hue in enumerate(BIRTH_HUES):
        colors = births.colors[shown.gaussians.births == birth]
        assert len(colors)
        np.testing.assert_allclose(colors, np.broadcast_to(np.array(hue, np.float32), colors.shape), rtol=1e-6)
    assert shown.gaussians.changes is not None
    is_new = np.isnan(shown.gaussians.changes)
    np.testing.assert_allclose(
        changes.colors[is_new] * 255, np.tile(np.array(hues.SKY) * 255, (is_new.sum(), 1)), atol=0.6
    )
    top = drawn_arrays(
        replace(shown, gaussians=replace(shown.gaussians, changes=np.full_like(shown.gaussians.changes, 9.0))),
        "changed",
    )
    np.testing.assert_allclose(top.colors[0] * 255, COLOR_MAPS["inferno"][-1], atol=0.1)
    assert births.source.shown_as == ShownAs("birth")


def test_changes_that_were_not_decoded_leave_the_scene_as_it_is(shown: ShownFrame) -> None:
    plain = replace(shown, gaussians=replace(shown.gaussians, changes=None))
    assert drawn_arrays(plain, "changed") is plain.gaussians
    assert decoded_as(ShownAs("changed", "f_s")) == ShownAs("changed", "f_s")
    assert decoded_as(ShownAs("depth", "f_s")) == decoded_as(ShownAs("color", "f_s")) == ShownAs(content="f_s")


@pytest.mark.parametrize(("content", "n_kept"), [("all", 379), ("static", 229), ("dynamic", 150), ("f_s", 379)])
def test_anchors_alone_are_those_of_the_part_that_is_shown(content: str, n_kept: int, shown: ShownFrame) -> None:
    source = replace(shown.gaussians.source, shown_as=ShownAs(content=content))
    part = replace(shown, gaussians=replace(shown.gaussians, source=source))
    assert len(drawn_arrays(part, "anchors")) == n_kept


def test_a_frame_in_a_mode_is_made_once(shown: ShownFrame) -> None:
    modes = ModeArrays()
    made = modes.of(shown, "birth")
    assert modes.of(shown, "birth") is made
    assert modes.of(shown, "depth") is shown.gaussians
    for number in range(MAX_KEPT + 1):
        modes.of(replace(shown, gaussians=replace(shown.gaussians, key=number)), "birth")
    assert modes.of(shown, "birth") is not made


def test_ranges_follow_the_rig_and_nothing_else() -> None:
    rig = make_rig()
    low, high = range_of("depth", rig)
    assert low == 0.0
    assert high == pytest.approx(2.0 * np.hypot(3.0, 0.8), rel=0.06)
    assert range_of("depth", None) == (0.0, 2.0)
    for mode in MODES:
        low, high = range_of(mode, rig)
        assert low < high


def test_a_mode_that_is_no_picture_of_numbers_is_refused(shown: ShownFrame) -> None:
    with pytest.raises(ValueError, match="'birth' is not a mode"):
        mode_picture(
            "birth", _gaussians(shown.gaussians, request(shown, "color").look), pinhole(view()), (0.0, 1.0), backend=CPU
        )


def test_labels_name_everything_that_is_not_as_usual() -> None:
    assert ShownAs().label == ""
    assert ShownAs("depth", "f_d").label == "f_d only, Depth"
    assert {content.name for content in CONTENTS.values()} == {"all", "static", "dynamic", "f_s", "f_d"}
