"""What is excluded of a capture: pixels under strokes, what stands in their place, and cameras that are not there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.capture.capture import open_capture
from engine.capture.exclusions import ExcludedFrames, Exclusions, PaintedMask, Stroke
from engine.capture.pixels.excluded_pixels import ExcludedPixels, painted_pixels

LINE = Stroke(((0.25, 0.5), (0.75, 0.5)), 0.1)
EVERYTHING = Stroke(((-0.5, 0.5), (1.5, 0.5)), 1.0)


def test_a_stroke_covers_the_pixels_within_its_radius() -> None:
    found = painted_pixels([LINE], 40, 20)
    x, y = np.arange(40) + 0.5, np.arange(20)[:, None] + 0.5
    away = np.hypot(np.maximum(np.abs(x - 20) - 10, 0.0), y - 10)
    assert np.array_equal(found, away <= 4.0)
    hole = Stroke(((0.5, 0.5),), 0.05, is_erasing=True)
    assert np.array_equal(painted_pixels([LINE, hole], 40, 20), (away <= 4.0) & (np.hypot(x - 20, y - 10) > 2.0))
    assert np.array_equal(painted_pixels([hole, LINE], 40, 20), found), "in the order in which it was painted"
    assert painted_pixels([Stroke(((-0.9, 2.0),), 0.01)], 40, 20).sum() == 0
    assert painted_pixels([EVERYTHING], 40, 20).all()


def test_a_pixel_is_taken_from_the_nearest_frame_that_has_it() -> None:
    masks = (PaintedMask("a", 2, 8, (LINE,)),)
    pixels = ExcludedPixels(Exclusions(frames=(ExcludedFrames(None, 7, 9),), masks=masks), ("a", "b"), 12, (40, 20))
    line = painted_pixels([LINE], 40, 20)
    assert [(s.first, s.stop) for s in pixels.stretches(0)] == [(0, 2), (2, 7), (7, 8), (8, 9), (9, 12)]
    assert pixels.of(0, 1) is None
    assert np.array_equal(pixels.of(0, 5), line)  # type: ignore[arg-type]
    ((frame, taken),), left = pixels.fills(0, 3)
    assert (frame, left) == (1, None)
    assert np.array_equal(taken, line)
    sources, left = pixels.fills(0, 7)  # frame 6 has all but the line, frame 9 has that
    assert ([frame for frame, _ in sources], left) == ([6, 9], None)
    assert np.array_equal(sources[1][1], line)
    assert pixels.always(0) is None
    assert pixels.fills(1, 8)[0][0][0] == 9


def test_what_no_frame_has_is_told() -> None:
    pixels = ExcludedPixels(Exclusions(masks=(PaintedMask("a", 0, 5, (LINE,)),)), ("a",), 5, (40, 20))
    line = painted_pixels([LINE], 40, 20)
    assert np.array_equal(pixels.always(0), line)  # type: ignore[arg-type]
    sources, left = pixels.fills(0, 2)
    assert sources == []
    assert np.array_equal(left, line)  # type: ignore[arg-type]


def test_a_capture_without_what_is_excluded(make_sample: Callable[..., Path]) -> None:
    whole = open_capture(make_sample())
    name, n = whole.rig.names[1], whole.n_frames
    exclusions = Exclusions((whole.rig.names[2],), (ExcludedFrames(name, 0, 1),), (PaintedMask(name, 1, n, (LINE,)),))
    part = whole.without(exclusions)
    assert part.without(exclusions) is part
    assert np.array_equal(whole.frame(1, 0), whole.without(Exclusions()).frame(1, 0))
    width, height = whole.picture_size
    line = painted_pixels([LINE], width, height)
    assert part.training_cameras([0]) == [row for row in range(len(whole.rig)) if row not in (0, 2)]
    assert [part.is_usable(1, 0), part.is_usable(1, 1), part.is_usable(2, 1)] == [False, True, False]
    assert np.array_equal(part.valid_in(1, 1), ~line)  # type: ignore[arg-type]
    assert not part.valid_in(1, 0).any()  # type: ignore[union-attr]
    assert np.array_equal(part.frame(1, 1)[~line], whole.frame(1, 1)[~line])
    assert np.array_equal(part.frame(1, 1)[line], np.zeros_like(whole.frame(1, 1)[line])), "no usable frame has these"
    assert np.array_equal(part.frame(1, 0)[~line], whole.frame(1, 1)[~line]), "the nearest frame stands in its place"
    assert np.array_equal(part.frames_of(1, [0, 1])[0], part.frame(1, 0))
    assert np.array_equal(part.valid(1), ~line)  # type: ignore[arg-type]
    assert part.valid_in(0, 0) is None
    assert np.array_equal(part.frame(0, 0), whole.frame(0, 0))
    with pytest.raises(IndexError):
        part.is_usable(0, n)


def test_exclusions_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="empty range"):
        ExcludedFrames("a", 3, 3)
    with pytest.raises(ValueError, match="empty range"):
        PaintedMask("a", 4, 2, ())
    unknown = Exclusions(("nobody",), (ExcludedFrames("nobody", 0, 3),), (PaintedMask("nobody", 0, 3, (LINE,)),))
    assert ExcludedPixels(unknown, ("a",), 5, (4, 4)).of(0, 1) is None
    assert unknown.usable(("a",), 5).all()
