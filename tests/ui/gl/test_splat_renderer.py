"""Splats drawn by GL equal those of the rasterizer, and broken or absent ones change nothing."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace

import moderngl
import numpy as np
import pytest

from app.background.latest import LatestWorker
from engine.conventions import ALPHA_MAX, ALPHA_MIN, EPS2D_PX2, TRANSMITTANCE_MIN
from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_color
from tests.ui.gl.scenes import (
    FIELDS,
    Camera,
    Splats,
    ball,
    centered_camera,
    joined,
    make_camera,
    make_splats,
    rasterized,
)
from ui.gl.camera import resized_K
from ui.gl.splat_renderer import SplatRenderer
from ui.gl.splat_rows import SPLATS_PER_ROW, pack_splats
from ui.gl.targets import Precision, Target

pytestmark = pytest.mark.gl

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
DEADLINE_S = 180.0


@dataclass(frozen=True)
class Held:
    """Keeps the sorter's thread busy."""

    go_on: threading.Event

    def answer(self) -> None:
        assert self.go_on.wait(DEADLINE_S)


def draw_until_sorted(renderer: SplatRenderer, target: Target, camera: Camera) -> None:
    """Draw again and again, as a window does, until the order belongs to the camera."""
    deadline = time.monotonic() + DEADLINE_S
    while True:
        target.clear()
        renderer.draw(target, *camera.arguments)
        if not renderer.is_order_stale:
            return
        assert time.monotonic() < deadline, "no order came"
        time.sleep(0.005)


def psnr_db(actual: np.ndarray, expected: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((actual - expected) ** 2) + 1e-30))


def drawn(
    ctx: moderngl.Context,
    keep: Keep,
    splats: Splats,
    camera: Camera,
    *,
    precision: Precision = "f4",
    near: float = 0.01,
) -> np.ndarray:
    """Premultiplied RGBA of a fresh renderer. [H, W, 4]"""
    target = keep(Target(ctx, (camera.width, camera.height), precision=precision))
    renderer = keep(SplatRenderer(ctx))
    renderer.upload(splats)
    renderer.draw(target, *camera.arguments, near)
    return read_color(target)


def needles(n: int) -> Splats:
    splats = make_splats(n, seed=4)
    return replace(splats, scales=splats.scales * np.array([20.0, 0.02, 0.5], dtype=np.float32))


SCENES = {
    "random": make_splats(300),
    "needles": needles(100),
    "larger than the picture": make_splats(12, seed=1, scale=6.0),
    "smaller than a pixel": make_splats(300, seed=2, scale=1e-4),
    "faint": replace(make_splats(400, seed=3), opacities=np.full(400, 0.02, dtype=np.float32)),
}


@pytest.mark.parametrize("name", list(SCENES))
@pytest.mark.parametrize("yaw_rad", [0.0, 2.5])
def test_equals_the_rasterizer(ctx: moderngl.Context, keep: Keep, name: str, yaw_rad: float) -> None:
    """32-bit target against the float64 reference.

    60 dB is where the picture is the same for every purpose: below 8-bit rounding, which is 59 dB. What remains is
    float32 (about 125 dB), a handful of pixels at the ALPHA_MIN edge that fall to the other side (each 1/255 in one
    of a thousand pixels: 80 dB), and the early stop at TRANSMITTANCE_MIN that blending cannot do (1e-4: 80 dB). A
    wrong convention is far below: low-pass 0.1 px^2 instead of 0.3 gives 41 dB, order by distance 44, no cut-off 56.
    """
    camera = make_camera(yaw_rad=yaw_rad, pitch_rad=0.3)
    actual = drawn(ctx, keep, SCENES[name], camera)
    expected = rasterized(SCENES[name], camera)
    assert expected[..., 3].max() > 0.05, "the scene must be seen"
    assert psnr_db(actual, expected) > 75.0
    # Pixels off by more than both causes allow; at most a few may sit exactly on a splat's edge.
    assert (np.abs(actual - expected).max(axis=2) > 2 * TRANSMITTANCE_MIN).sum() <= 5


def test_equals_the_rasterizer_near_the_camera(ctx: moderngl.Context, keep: Keep) -> None:
    """From inside the scene, with splats behind, beside and at the near plane: the slope clamp and the near cut."""
    splats, camera = make_splats(300, seed=6, scale=0.1), make_camera(distance=0.3, yaw_rad=0.4)
    near = 0.2
    actual, expected = drawn(ctx, keep, splats, camera, near=near), rasterized(splats, camera, near=near)
    depths = splats.means @ camera.world_to_camera[2, :3] + camera.world_to_camera[2, 3]
    assert (depths < 0).any()
    assert ((depths > 0) & (depths < near)).any()
    assert psnr_db(actual, expected) > 75.0


def test_half_floats_are_good_enough_to_look_at(ctx: moderngl.Context, keep: Keep) -> None:
    """50 dB is an average error of 0.8/255: what the 8 bits of a screen show. Measured 63 to 83 dB on llvmpipe."""
    camera = make_camera()
    actual = drawn(ctx, keep, SCENES["random"], camera, precision="f2")
    assert psnr_db(actual, rasterized(SCENES["random"], camera)) > 50.0


@pytest.mark.parametrize("is_swapped", [False, True])
@pytest.mark.parametrize(("yaw_rad", "front"), [(0.0, RED), (np.pi, BLUE)])
def test_nearer_splat_hides_farther_one(
    ctx: moderngl.Context, keep: Keep, is_swapped: bool, yaw_rad: float, front: tuple[float, float, float]
) -> None:
    near_and_far = joined(ball((0, 0, -0.8), RED), ball((0, 0, 0.8), BLUE))
    splats = near_and_far.rows(slice(None, None, -1)) if is_swapped else near_and_far
    camera = centered_camera()
    turned_about = camera.world_to_camera.copy()
    turned_about[0, 0] = turned_about[2, 2] = np.cos(yaw_rad)
    picture = drawn(ctx, keep, splats, replace(camera, world_to_camera=turned_about))
    # The front one lets 1 - ALPHA_MAX of the other through.
    np.testing.assert_allclose(picture[32, 32, :3], ALPHA_MAX * np.array(front), atol=1.5 * (1 - ALPHA_MAX))


def test_order_is_by_depth_and_not_by_distance(ctx: moderngl.Context, keep: Keep) -> None:
    """At the picture's edge, a splat can be nearer in depth and yet farther away."""
    camera = centered_camera(focal_px=16.0, distance=0.0)
    # Both project to x = 60.5, near the right border; red is nearer in depth, blue in distance to the viewer.
    red, blue = ball((3.5, 1.2, 2.0), RED, scale=2.0), ball((3.6, 0.0, 2.05), BLUE, scale=2.0)
    assert np.linalg.norm(red.means) > np.linalg.norm(blue.means)
    splats = joined(red, blue)
    picture, expected = drawn(ctx, keep, splats, camera), rasterized(splats, camera)
    assert expected[40, 60, 0] > 0.9
    assert psnr_db(picture, expected) > 75.0


@pytest.mark.parametrize("opacity", [0.05, 0.5, 1.0])
def test_alpha_ends_exactly_where_it_reaches_the_cutoff(ctx: moderngl.Context, keep: Keep, opacity: float) -> None:
    camera, scale = centered_camera(), 0.4
    alpha = drawn(ctx, keep, ball((0, 0, 0), (1, 1, 1), scale=scale, opacity=opacity), camera)[..., 3]
    sigma_px2 = (scale * camera.K[0, 0] / 4.0) ** 2 + EPS2D_PX2
    y, x = np.mgrid[0:64, 0:64] - 32.0
    distance_px2 = x**2 + y**2
    expected = np.minimum(opacity * np.exp(-0.5 * distance_px2 / sigma_px2), ALPHA_MAX)
    is_inside = expected >= ALPHA_MIN
    is_clear = np.abs(expected - ALPHA_MIN) > 1e-6  # float32 decides the pixels right on the edge
    assert is_inside.any()
    assert (~is_inside).any(), "the edge must lie within the picture"
    np.testing.assert_allclose(alpha[is_inside & is_clear], expected[is_inside & is_clear], atol=2e-6)
    assert (alpha[~is_inside & is_clear] == 0).all()


@pytest.mark.parametrize("opacity", [0.0, 0.5 * ALPHA_MIN, float(np.float32(ALPHA_MIN))])
def test_too_faint_splats_are_dropped(ctx: moderngl.Context, keep: Keep, opacity: float) -> None:
    renderer = keep(SplatRenderer(ctx))
    renderer.upload(joined(ball((0, 0, 0), RED, opacity=opacity), ball((0, 0, 0), RED)))
    assert (len(renderer), renderer.n_dropped) == (1, 1)


def test_opaque_splat_stops_at_alpha_max(ctx: moderngl.Context, keep: Keep) -> None:
    picture = drawn(ctx, keep, ball((0, 0, 0), (1, 1, 1), scale=1.0), centered_camera())
    assert picture[32, 32] == pytest.approx(ALPHA_MAX, abs=1e-6)


def test_empty_upload_draws_nothing_and_a_later_one_does(ctx: moderngl.Context, keep: Keep) -> None:
    target, renderer, camera = keep(Target(ctx, (64, 64))), keep(SplatRenderer(ctx)), centered_camera()
    renderer.draw(target, *camera.arguments)  # before any upload
    renderer.upload(make_splats(0))
    renderer.draw(target, *camera.arguments)
    assert len(renderer) == 0
    assert not read_color(target).any()
    renderer.upload(ball((0, 0, 0), RED))
    renderer.draw(target, *camera.arguments)
    assert read_color(target)[32, 32, 0] > 0.9
    renderer.upload(make_splats(0))
    target.clear()
    renderer.draw(target, *camera.arguments)
    assert not read_color(target).any()


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities", "colors"])
@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
def test_rows_that_are_not_finite_are_dropped_alone(
    ctx: moderngl.Context, keep: Keep, name: str, poison: float
) -> None:
    splats, camera = make_splats(50, seed=8), make_camera()
    spoiled_field = getattr(splats, name).copy()
    spoiled_field[[3, 20]] = poison
    spoiled = replace(splats, **{name: spoiled_field})
    healthy = splats.rows(np.delete(np.arange(50), [3, 20]))
    picture = drawn(ctx, keep, spoiled, camera)
    np.testing.assert_array_equal(picture, drawn(ctx, keep, healthy, camera))
    assert np.isfinite(picture).all()
    assert len(pack_splats(spoiled)) == 48


def test_splats_without_rotation_or_size_do_no_harm(ctx: moderngl.Context, keep: Keep) -> None:
    flat = replace(ball((0, 0, 0), RED), scales=np.zeros((1, 3), dtype=np.float32))
    no_rotation = replace(ball((0.3, 0, 0), BLUE), quats=np.zeros((1, 4), dtype=np.float32))
    splats, camera = joined(flat, no_rotation), centered_camera()
    picture, expected = drawn(ctx, keep, splats, camera), rasterized(splats, camera)
    assert expected[32, 32, 0] > 0.5, "a splat without size still has the low-pass"
    np.testing.assert_allclose(picture, expected, atol=1e-5)


def test_huge_and_overflowing_splats_leave_finite_pictures(ctx: moderngl.Context, keep: Keep) -> None:
    splats = joined(ball((0, 0, 0), RED, scale=1e25), ball((1e30, 0, 0), RED), ball((0, 0, 0), BLUE, scale=0.1))
    picture = drawn(ctx, keep, splats, centered_camera())
    assert np.isfinite(picture).all()
    assert picture[32, 32, 2] > 0.9


def test_quats_need_not_be_unit_length(ctx: moderngl.Context, keep: Keep) -> None:
    splats, camera = SCENES["needles"], make_camera()
    longer = replace(splats, quats=splats.quats * np.float32(7.5))
    np.testing.assert_allclose(
        drawn(ctx, keep, longer, camera), drawn(ctx, keep, splats, camera), atol=2e-2 * ALPHA_MIN + 1 / 255
    )
    assert psnr_db(drawn(ctx, keep, longer, camera), rasterized(splats, camera)) > 75.0


def test_rows_beyond_one_texture_row_are_read_right(ctx: moderngl.Context, keep: Keep) -> None:
    hidden = make_splats(2 * SPLATS_PER_ROW + 1, seed=9)
    hidden.means[:, 2] = -50.0  # behind the camera, so only the last rows are seen
    splats = joined(hidden, ball((-0.5, 0, 0), RED), ball((0.5, 0, 0), BLUE))
    camera = centered_camera()
    assert psnr_db(drawn(ctx, keep, splats, camera), rasterized(splats, camera)) > 75.0


def test_growing_and_shrinking_uploads_reuse_the_renderer(ctx: moderngl.Context, keep: Keep) -> None:
    target, renderer, camera = keep(Target(ctx, (96, 72), precision="f4")), keep(SplatRenderer(ctx)), make_camera()
    for n in (5, 3000, 40, 1, 1500):
        splats = make_splats(n, seed=n)
        renderer.upload(splats)
        target.clear()
        renderer.draw(target, *camera.arguments)
        np.testing.assert_array_equal(read_color(target), drawn(ctx, keep, splats, camera))


def test_same_key_uploads_once(ctx: moderngl.Context, keep: Keep) -> None:
    renderer = keep(SplatRenderer(ctx))
    assert renderer.upload(make_splats(5, key=("clip", 1)))
    assert not renderer.upload(make_splats(7, key=("clip", 1)))
    assert len(renderer) == 5
    assert renderer.upload(make_splats(7, key=("clip", 2)))
    assert renderer.key == ("clip", 2)
    assert renderer.upload(make_splats(3))
    assert renderer.upload(make_splats(3)), "without a key every upload counts"


def test_wrong_shapes_are_named(ctx: moderngl.Context, keep: Keep) -> None:
    splats = make_splats(4)
    with pytest.raises(ValueError, match=r"opacities must have shape \(4,\), got \(4, 1\)"):
        keep(SplatRenderer(ctx)).upload(replace(splats, opacities=splats.opacities[:, None]))


def test_float64_arrays_are_taken(ctx: moderngl.Context, keep: Keep) -> None:
    splats, camera = make_splats(20), make_camera()
    wide = replace(splats, **{name: getattr(splats, name).astype(np.float64) for name in FIELDS})
    np.testing.assert_array_equal(drawn(ctx, keep, wide, camera), drawn(ctx, keep, splats, camera))


def test_smaller_target_shows_the_same_view(ctx: moderngl.Context, keep: Keep) -> None:
    """While the view moves the target may be coarser than the size K belongs to."""
    splats, camera = SCENES["random"], make_camera()
    target, renderer = keep(Target(ctx, (48, 36), precision="f4")), keep(SplatRenderer(ctx))
    renderer.upload(splats)
    renderer.draw(target, *camera.arguments)
    small = Camera(camera.world_to_camera, resized_K(camera.K, (96, 72), (48, 36)), 48, 36)
    assert psnr_db(read_color(target), rasterized(splats, small)) > 75.0


def test_draws_over_what_is_there(ctx: moderngl.Context, keep: Keep) -> None:
    target, renderer, camera = keep(Target(ctx, (64, 64), precision="f4")), keep(SplatRenderer(ctx)), centered_camera()
    target.framebuffer.clear(0.0, 0.5, 0.0, 1.0)
    renderer.upload(ball((0, 0, 0), RED, opacity=0.5))
    renderer.draw(target, *camera.arguments)
    np.testing.assert_allclose(read_color(target)[32, 32], [0.5, 0.25, 0.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(read_color(target)[0, 0], [0.0, 0.5, 0.0, 1.0], atol=1e-6)


def test_state_left_by_others_changes_nothing(ctx: moderngl.Context, keep: Keep) -> None:
    """ImGui and the overlays leave their own blending, culling, depth test and viewport behind."""
    camera = make_camera()
    expected = drawn(ctx, keep, SCENES["random"], camera)
    ctx.enable_only(moderngl.CULL_FACE | moderngl.DEPTH_TEST)
    ctx.blend_func = moderngl.ZERO, moderngl.ONE
    ctx.blend_equation = moderngl.MAX, moderngl.MAX
    ctx.viewport = (0, 0, 5, 5)
    np.testing.assert_array_equal(drawn(ctx, keep, SCENES["random"], camera), expected)


# ---- the order on a thread -----------------------------------------------------------------------------------


def test_moved_camera_is_drawn_in_the_last_order_until_the_new_one_is_ready(ctx: moderngl.Context, keep: Keep) -> None:
    splats = joined(ball((0, 0, -0.8), RED), ball((0, 0, 0.8), BLUE))
    front, behind = centered_camera(), centered_camera()
    behind.world_to_camera[0, 0] = behind.world_to_camera[2, 2] = -1.0
    target = keep(Target(ctx, (64, 64), precision="f4"))
    renderer = keep(SplatRenderer(ctx, on_thread_above=1))
    renderer.upload(splats)

    renderer.draw(target, *front.arguments)
    assert not renderer.is_order_stale, "rows without any order are sorted at once"
    assert read_color(target)[32, 32, 0] > 0.9

    draw_until_sorted(renderer, target, behind)
    assert read_color(target)[32, 32, 2] > 0.9


def test_order_of_replaced_rows_is_never_used(
    ctx: moderngl.Context, keep: Keep, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An order made for other rows would leave out or repeat rows of these."""
    target, camera = keep(Target(ctx, (64, 64), precision="f4")), centered_camera()
    moved = centered_camera(distance=4.1)
    renderer = keep(SplatRenderer(ctx, on_thread_above=1))
    behind_viewer = ball((0, 0, -50), RED)
    renderer.upload(joined(behind_viewer, behind_viewer, ball((0, 0, 0), RED)))
    renderer.draw(target, *camera.arguments)
    draw_until_sorted(renderer, target, moved)  # leaves an order without the rows 0 and 1

    renderer.upload(joined(ball((0, 0, -0.8), RED), ball((0, 0, 0.8), BLUE)))
    monkeypatch.setattr(LatestWorker, "request", lambda *_, **__: None)  # a thread that is late
    for view, is_stale in ((camera, False), (moved, True)):
        target.clear()
        renderer.draw(target, *view.arguments)
        assert renderer.is_order_stale is is_stale
        assert read_color(target)[32, 32, 0] > 0.9


def test_other_gaussians_are_drawn_once_they_are_sorted_and_the_last_ones_until_then(
    ctx: moderngl.Context, keep: Keep
) -> None:
    target, camera = keep(Target(ctx, (64, 64), precision="f4")), centered_camera()
    renderer = keep(SplatRenderer(ctx, on_thread_above=1))
    red = replace(joined(ball((0, 0, -0.8), RED), ball((0, 0, 0.8), BLUE)), key="red")
    blue = replace(joined(ball((0, 0, 0.8), RED), ball((0, 0, -0.8), BLUE), ball((0, 0, 1.8), RED)), key="blue")
    assert renderer.upload(red)
    renderer.draw(target, *camera.arguments)
    go_on = threading.Event()
    renderer._sorter.request(Held(go_on), lane="held")  # pyright: ignore[reportArgumentType] - answers likewise
    assert renderer.upload(blue)
    assert not renderer.upload(blue)
    target.clear()
    renderer.draw(target, *camera.arguments)
    assert (renderer.key, renderer.drawn, renderer.is_order_stale, renderer.has_news) == ("blue", red, True, False)
    assert read_color(target)[32, 32, 0] > 0.9
    go_on.set()
    assert renderer._sorter.wait_idle(DEADLINE_S)
    assert renderer.has_news
    target.clear()
    renderer.draw(target, *camera.arguments)
    assert (renderer.drawn, renderer.is_order_stale, renderer.has_news) == (blue, False, False)
    assert read_color(target)[32, 32, 2] > 0.9


def test_what_must_not_be_seen_any_more_is_replaced_at_once(ctx: moderngl.Context, keep: Keep) -> None:
    target, camera = keep(Target(ctx, (64, 64), precision="f4")), centered_camera()
    renderer = keep(SplatRenderer(ctx, on_thread_above=0))
    renderer.upload(replace(ball((0, 0, 0), RED), key=1))
    renderer.draw(target, *camera.arguments)
    renderer.upload(replace(ball((0, 0, 0), BLUE), key=2), at_once=True)
    target.clear()
    renderer.draw(target, *camera.arguments)
    assert read_color(target)[32, 32, 2] > 0.9


def test_a_set_that_cannot_be_packed_on_the_thread_is_told(ctx: moderngl.Context, keep: Keep) -> None:
    target, camera = keep(Target(ctx, (64, 64))), centered_camera()
    renderer = keep(SplatRenderer(ctx, on_thread_above=0))
    renderer.upload(replace(ball((0, 0, 0), RED), key=1))
    renderer.draw(target, *camera.arguments)
    good = ball((0, 0, 0), BLUE)
    renderer.upload(replace(good, key=2, colors=good.colors[0]))
    assert renderer._sorter.wait_idle(DEADLINE_S)
    with pytest.raises(ValueError, match="colors must have shape"):
        renderer.draw(target, *camera.arguments)
    renderer.draw(target, *camera.arguments)  # the last good ones


# ---- what stands still -----------------------------------------------------------------------------------------


def clip_frame(n_still: int, frame: int, *, light: float = 1.0, n_moving: int = 700) -> Splats:
    """A frame of a clip: rows that stand still, in a light, and others that move."""
    still = make_splats(n_still, seed=1)
    moving = make_splats(n_moving + 40 * frame, seed=10 + frame)
    splats = joined(replace(still, colors=still.colors * np.float32(light)), moving)
    return replace(splats, key=("clip", frame), n_still=n_still, still_key="clip")


@pytest.mark.parametrize("n_still", [1, SPLATS_PER_ROW, 2 * SPLATS_PER_ROW + 300])
def test_what_stands_still_is_written_once_and_drawn_with_every_frame(
    ctx: moderngl.Context, keep: Keep, n_still: int
) -> None:
    target, camera = keep(Target(ctx, (96, 72), precision="f4")), make_camera()
    renderer = keep(SplatRenderer(ctx))
    written = []
    for frame, light in ((0, 1.0), (1, 1.0), (2, 0.5), (3, 0.5), (0, 1.0)):
        splats = clip_frame(n_still, frame, light=light)
        renderer.upload(splats)
        target.clear()
        renderer.draw(target, *camera.arguments)
        np.testing.assert_array_equal(read_color(target), drawn(ctx, keep, replace(splats, still_key=None), camera))
        n_moving = len(splats) - n_still
        textures = renderer.textures
        written.append((textures.n_geometry_written - n_moving, textures.n_colors_written - n_moving))
        assert len(renderer) == len(splats)
    assert written == [(n_still, n_still), (0, 0), (0, n_still), (0, 0), (0, n_still)]


def test_another_clip_or_a_larger_texture_writes_everything(ctx: moderngl.Context, keep: Keep) -> None:
    target, camera = keep(Target(ctx, (96, 72), precision="f4")), make_camera()
    renderer = keep(SplatRenderer(ctx))
    renderer.upload(clip_frame(50, 0))
    for splats in (
        replace(clip_frame(50, 1), still_key="other"),
        clip_frame(50, 2, n_moving=9 * SPLATS_PER_ROW),
        replace(clip_frame(50, 3), n_still=0, still_key=None),
        clip_frame(50, 4),
    ):
        renderer.upload(splats)
        assert renderer.textures.n_geometry_written == len(splats)
        target.clear()
        renderer.draw(target, *camera.arguments)
        np.testing.assert_array_equal(read_color(target), drawn(ctx, keep, replace(splats, still_key=None), camera))


def test_rows_that_are_left_out_may_stand_still(ctx: moderngl.Context, keep: Keep) -> None:
    """Too faint ones always; ones without a colour only in the frame in which they have none."""
    target, camera = keep(Target(ctx, (96, 72), precision="f4")), make_camera()
    renderer = keep(SplatRenderer(ctx))
    for frame, spoiled in ((0, False), (1, False), (2, True), (3, False)):
        splats = clip_frame(60, frame)
        splats.opacities[[2, 5]] = 0.0
        if spoiled:
            splats.colors[7] = np.nan
        renderer.upload(splats)
        assert renderer.n_dropped == 2 + spoiled
        target.clear()
        renderer.draw(target, *camera.arguments)
        np.testing.assert_array_equal(read_color(target), drawn(ctx, keep, replace(splats, still_key=None), camera))


def test_release_frees_and_can_be_repeated(ctx: moderngl.Context) -> None:
    renderer = SplatRenderer(ctx)
    renderer.upload(make_splats(10))
    program = renderer._program
    assert not isinstance(program.mglo, moderngl.InvalidObject)
    renderer.release()
    renderer.release()
    assert isinstance(program.mglo, moderngl.InvalidObject)
