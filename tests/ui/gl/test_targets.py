"""Targets: sizes, resolving, and pictures the right way up."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_color, read_resolved
from ui.gl.image import ImageTexture, PixelRect
from ui.gl.targets import Precision, Target

pytestmark = pytest.mark.gl


def test_new_target_is_empty(ctx: moderngl.Context, keep: Keep) -> None:
    target = keep(Target(ctx, (7, 5)))
    assert target.size == (7, 5)
    assert read_color(target).shape == (5, 7, 4)
    assert not read_color(target).any()
    assert target.texture.size == (7, 5)


def test_resize_tells_whether_anything_changed_and_clears(ctx: moderngl.Context, keep: Keep) -> None:
    target = keep(Target(ctx, (7, 5)))
    target.framebuffer.clear(1.0, 1.0, 1.0, 1.0)
    assert not target.resize(7, 5)
    assert read_color(target).all()
    assert target.resize(12, 9)
    assert not read_color(target).any()
    assert read_resolved(target).shape == (9, 12, 3)
    assert target.framebuffer.size == (12, 9)


@pytest.mark.parametrize("size", [(0, 5), (5, -1)])
def test_impossible_sizes_are_refused_and_change_nothing(
    ctx: moderngl.Context, keep: Keep, size: tuple[int, int]
) -> None:
    target = keep(Target(ctx, (7, 5)))
    with pytest.raises(ValueError, match="positive size"):
        target.resize(*size)
    assert target.size == (7, 5)


@pytest.mark.parametrize("precision", ["f2", "f4"])
def test_resolve_puts_premultiplied_colour_over_the_background(
    ctx: moderngl.Context, keep: Keep, precision: Precision
) -> None:
    target = keep(Target(ctx, (4, 4), precision=precision))
    target.framebuffer.clear(0.25, 0.0, 0.5, 0.5)
    target.resolve((0.0, 1.0, 0.5))
    # 0.25, 0.5 and 0.75 are exact in half floats; 255 times them is rounded to nearest.
    assert np.unique(read_resolved(target).reshape(-1, 3), axis=0).tolist() == [[64, 128, 191]]


def test_resolve_without_background_keeps_straight_alpha(ctx: moderngl.Context, keep: Keep) -> None:
    target = keep(Target(ctx, (4, 4)))
    target.framebuffer.clear(0.25, 0.0, 0.5, 0.5)
    texture = target.resolve(None)
    assert np.frombuffer(texture.read(), dtype=np.uint8).reshape(-1, 4)[0].tolist() == [128, 0, 255, 128]
    target.clear()
    assert not any(target.resolve(None).read())


def test_picture_is_drawn_upright(ctx: moderngl.Context, keep: Keep, rng: np.random.Generator) -> None:
    """Row 0 stays row 0, also with a width that is not a multiple of four bytes."""
    picture = rng.integers(0, 256, (9, 7, 3), dtype=np.uint8)
    image = keep(ImageTexture(ctx, is_smooth=False))
    image.set(picture)
    target = keep(Target(ctx, (7, 9), precision="f4"))
    target.draw_image(image)
    np.testing.assert_allclose(read_color(target)[..., :3], picture / 255, atol=1e-6)
    assert (read_color(target)[..., 3] == 1).all()
    target.resolve()
    np.testing.assert_array_equal(read_resolved(target), picture)


def test_picture_fills_only_its_rectangle(ctx: moderngl.Context, keep: Keep) -> None:
    image = keep(ImageTexture(ctx))
    image.set(np.full((2, 2, 3), 255, dtype=np.uint8))
    target = keep(Target(ctx, (20, 16)))
    target.draw_image(image, PixelRect(4, 2, 10, 12))
    expected = np.zeros((16, 20))
    expected[2:12, 4:10] = 1
    np.testing.assert_array_equal(read_color(target)[..., 3], expected)


def test_released_target_can_be_released_again_and_gives_nothing_out(ctx: moderngl.Context) -> None:
    target = Target(ctx, (4, 4))
    target.release()
    target.release()
    with pytest.raises(AssertionError, match="was released"):
        _ = target.framebuffer
    with pytest.raises(AssertionError, match="was released"):
        _ = target.texture
    assert ctx.error == "GL_NO_ERROR"


def test_a_direct_target_shows_marks_over_its_background(ctx: moderngl.Context, keep: Keep) -> None:
    target = keep(Target(ctx, (4, 2), precision="f1"))
    target.clear((0.2, 0.4, 0.6))
    target.use(moderngl.BLEND)
    assert target.resolve((1.0, 0.0, 0.0)) is target.texture  # nothing is left to do
    np.testing.assert_array_equal(read_resolved(target), np.broadcast_to(np.array([51, 102, 153], np.uint8), (2, 4, 3)))
