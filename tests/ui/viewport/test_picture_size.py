"""How large a picture is asked for while the view moves."""

from __future__ import annotations

import pytest

from ui.viewport.picture_size import MOVING_MS, MOVING_SHARES, moving_share, picture_size


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
