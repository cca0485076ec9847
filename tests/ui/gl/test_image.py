"""Pictures on the GPU, and where they fit."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ui.gl.keep import Keep
from tests.ui.gl.pixels import read_color
from ui.gl.image import ImageTexture, PixelRect, fit_rect
from ui.gl.targets import Target

sizes = st.tuples(st.integers(1, 4000), st.integers(1, 4000))


@given(image_size=sizes, target_size=sizes)
def test_fitted_rectangle_touches_two_borders_and_keeps_the_aspect(
    image_size: tuple[int, int], target_size: tuple[int, int]
) -> None:
    rect = fit_rect(image_size, target_size)
    assert rect.width * image_size[1] == pytest.approx(rect.height * image_size[0], rel=1e-9)
    assert rect.width == pytest.approx(target_size[0]) or rect.height == pytest.approx(target_size[1])
    assert rect.x0 >= -1e-9
    assert rect.y0 >= -1e-9
    assert rect.x0 + rect.x1 == pytest.approx(target_size[0])
    assert rect.y0 + rect.y1 == pytest.approx(target_size[1])


@pytest.mark.gl
class TestImageTexture:
    def test_new_one_is_empty_and_says_so(self, ctx: moderngl.Context, keep: Keep) -> None:
        image = keep(ImageTexture(ctx))
        assert image.is_empty
        assert image.size == (0, 0)
        with pytest.raises(RuntimeError, match="before set"):
            _ = image.texture

    def test_same_key_uploads_once(self, ctx: moderngl.Context, keep: Keep) -> None:
        image = keep(ImageTexture(ctx))
        black, white = np.zeros((2, 4, 3), np.uint8), np.full((2, 4, 3), 255, np.uint8)
        assert image.set(black, key=1)
        assert not image.set(white, key=1)
        assert not any(image.texture.read())
        assert image.set(white, key=2)
        assert image.set(black)
        assert image.set(black)

    def test_same_size_keeps_the_texture_and_another_replaces_it(self, ctx: moderngl.Context, keep: Keep) -> None:
        image = keep(ImageTexture(ctx))
        image.set(np.zeros((4, 6, 3), np.uint8))
        first = image.texture.glo
        image.set(np.ones((4, 6, 3), np.uint8))
        assert image.texture.glo == first
        image.set(np.zeros((5, 3, 3), np.uint8))
        assert image.size == (3, 5)

    def test_view_of_a_larger_array_is_taken(self, ctx: moderngl.Context, keep: Keep, rng: np.random.Generator) -> None:
        whole = rng.integers(0, 256, (8, 10, 3), dtype=np.uint8)
        image = keep(ImageTexture(ctx))
        image.set(whole[1:7:2, ::-3])
        stored = np.frombuffer(image.texture.read(alignment=1), dtype=np.uint8).reshape(3, 4, 3)
        np.testing.assert_array_equal(stored, whole[1:7:2, ::-3])

    @pytest.mark.parametrize(
        "wrong",
        [
            np.zeros((4, 4), np.uint8),
            np.zeros((4, 4, 4), np.uint8),
            np.zeros((4, 4, 3), np.float32),
            np.zeros((0, 4, 3), np.uint8),
        ],
    )
    def test_what_is_no_picture_is_refused(self, ctx: moderngl.Context, keep: Keep, wrong: np.ndarray) -> None:
        with pytest.raises(ValueError, match=r"\[H, W, 3\] uint8"):
            keep(ImageTexture(ctx)).set(wrong)


@pytest.mark.gl
def test_picture_fills_its_rectangle_and_nothing_else(ctx: moderngl.Context, keep: Keep) -> None:
    target, image = keep(Target(ctx, (40, 10), precision="f4")), keep(ImageTexture(ctx))
    image.set(np.full((6, 4, 3), 51, dtype=np.uint8))
    target.draw_image(image, PixelRect(10, 0, 30, 10))
    row = read_color(target)[5]
    np.testing.assert_allclose(row[10:30], np.tile([0.2, 0.2, 0.2, 1.0], (20, 1)), atol=1e-6)
    assert np.flatnonzero(row[:, 3] == 0).tolist() == [*range(10), *range(30, 40)]


def test_pixel_for_pixel_nothing_is_interpolated(ctx: moderngl.Context, keep: Keep) -> None:
    picture = keep(ImageTexture(ctx))
    picture.fit((5, 7))  # before there is one
    picture.set(np.zeros((7, 5, 3), np.uint8))
    smooth, sharp = (moderngl.LINEAR, moderngl.LINEAR), (moderngl.NEAREST, moderngl.NEAREST)
    assert picture.texture.filter == smooth
    picture.fit((5, 7))
    assert picture.texture.filter == sharp
    picture.fit((10, 14))
    assert picture.texture.filter == smooth
    squares = keep(ImageTexture(ctx, is_smooth=False))
    squares.set(np.zeros((7, 5, 3), np.uint8))
    squares.fit((10, 14))
    assert squares.texture.filter == sharp
