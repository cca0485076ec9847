"""How large a picture is asked for while the view moves."""

from __future__ import annotations

import pytest

from ui.viewport.picture_size import HURRY_S, MOVING_MS, MOVING_SHARES, MovingSize, moving_share, picture_size


@pytest.mark.parametrize(
    ("drawn_share", "took_ms", "expected"),
    [
        (1.0, MOVING_MS, 1.0),
        (1.0, 4 * MOVING_MS, 0.5),  # time goes with the pixels, so half the width
        (0.5, MOVING_MS / 4, 1.0),
        (1.0, 1e4, MOVING_SHARES[0]),
        (1.0, 0.0, MOVING_SHARES[1]),
        (1.0, 1.3 * MOVING_MS, 0.875),  # in eighths, rounded down
    ],
)
def test_a_moving_picture_is_as_large_as_time_allows(drawn_share: float, took_ms: float, expected: float) -> None:
    assert moving_share(drawn_share, took_ms) == expected


def test_a_picture_is_never_too_small_to_be_drawn() -> None:
    assert picture_size(900, 600, 0.5) == (450, 300)
    assert picture_size(20, 20, 0.25) == (16, 16)


def test_the_size_changes_only_when_pictures_take_clearly_too_long_or_short() -> None:
    size = MovingSize()
    size.note_picture(1.0, 4 * MOVING_MS)
    assert size.share == 0.5
    for took in (1.3, 0.6, 1.1):
        size.note_picture(0.5, took * MOVING_MS)
        assert size.share == 0.5
    size.note_picture(1.0, 4.5 * MOVING_MS)
    assert size.share == 0.5, "a picture in full says the same of this size"
    size.note_picture(0.5, 1.5 * MOVING_MS)
    assert size.share == 0.375
    size.note_picture(0.375, 0.2 * MOVING_MS)
    assert size.share == 0.75


def test_a_frame_that_changed_a_moment_ago_is_wanted_quickly() -> None:
    size = MovingSize()
    assert not size.is_hurried(3, 10.0, is_playing=False), "the first one may take its time"
    assert not size.is_hurried(3, 10.1, is_playing=False)
    assert size.is_hurried(4, 10.2, is_playing=False)
    assert size.is_hurried(4, 10.2 + 0.9 * HURRY_S, is_playing=False)
    assert not size.is_hurried(4, 10.2 + 1.1 * HURRY_S, is_playing=False)
    assert size.is_hurried(4, 99.0, is_playing=True)
    assert not size.is_hurried(5, 99.1, is_playing=True, is_loaded_first=True), (
        "around a seam pictures are of full size"
    )
