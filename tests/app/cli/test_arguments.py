"""What arguments mean: ranges."""

import pytest

from app.cli.arguments import parse_range
from engine.errors import ProjectError


@pytest.mark.parametrize(
    ("text", "expected"),
    [(":", range(0, 7)), ("2:5", range(2, 5)), ("3", range(3, 4)), ("4:", range(4, 7)), (":2", range(2))],
)
def test_ranges(text, expected):
    assert parse_range(text, 7, option="--frames", what="frames") == expected


@pytest.mark.parametrize("text", ["", "a:b", "-1:3", "3:2", "0:8", "7", "1:2:3"])
def test_ranges_that_are_none(text):
    with pytest.raises(ProjectError, match="frames 0 to 6"):
        parse_range(text, 7, option="--frames", what="frames")
