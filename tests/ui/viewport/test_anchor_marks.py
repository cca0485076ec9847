"""Anchors as marks: colours by what they are, and what the pointer finds."""

import numpy as np
import pytest

from engine.clip_files.roles import ROLES
from engine.gate.reasons import NO_REASON, USER_DYNAMIC, USER_STATIC, reason_text
from engine.gate.regions import sphere_region
from ui.style.colors import ROLE_COLORS, SKY
from ui.viewport.layers.anchor_marks import REACH_PX, anchor_marks

POSITIONS = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 2.0], [0.0, 0.0, -1.0]], np.float32)
CODES = np.array([ROLES.index(role) for role in ("static", "promoted", "moving", "static")], np.uint8)
LIGHT = 2
"""A code that clips of earlier versions hold: a lamp or a shadow."""
REASONS = np.array([NO_REASON, LIGHT, NO_REASON, NO_REASON], np.uint8)
K = np.array([[100.0, 0.0, 50.0], [0.0, 100.0, 40.0], [0.0, 0.0, 1.0]])


def test_colours_and_counts_follow_the_roles():
    marks = anchor_marks(POSITIONS, CODES, REASONS, most=10, color=SKY)
    assert marks.counts == {"static": 2, "moving": 1, "promoted": 1}
    np.testing.assert_allclose(marks.colors[1], ROLE_COLORS["promoted"], atol=1e-6)
    np.testing.assert_allclose(marks.colors[2], ROLE_COLORS["moving"], atol=1e-6)
    assert set(ROLE_COLORS) == set(ROLES)


def test_few_marks_keep_their_own_colours_and_all_are_counted():
    codes = np.tile(CODES, 50)
    positions = np.repeat(np.arange(200.0), 3).reshape(200, 3)
    marks = anchor_marks(positions, codes, None, most=20, color=SKY)
    assert len(marks.positions) == len(marks.colors) == 20
    assert sum(marks.counts.values()) == 200
    rows = marks.positions[:, 0].astype(int)
    np.testing.assert_array_equal(marks.roles, codes[rows])


def test_where_nobody_says_what_they_are_all_look_alike():
    marks = anchor_marks(POSITIONS, None, None, most=10, color=SKY)
    np.testing.assert_allclose(marks.colors, np.tile(SKY, (4, 1)), atol=1e-6)
    assert marks.counts == {}
    assert marks.text(0) == ""


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [(50, 40, 1), (100, 40, 2), (100 + REACH_PX - 1, 40, 2), (100 + REACH_PX + 1, 40, None), (5, 5, None)],
)
def test_the_pointer_finds_the_nearest_mark_in_front_of_the_camera(x, y, expected):
    marks = anchor_marks(POSITIONS, CODES, REASONS, most=10, color=SKY)
    assert marks.at(np.eye(4), K, x, y, near=0.1) == expected


def test_a_mark_says_what_it_is_and_why():
    marks = anchor_marks(POSITIONS, CODES, REASONS, most=10, color=SKY)
    assert marks.text(1).startswith("promoted")
    assert "lamp or shadow" in marks.text(1)
    assert "\n" not in marks.text(0)


def test_no_anchors_at_all():
    nothing = np.zeros((0, 3), np.float32)
    marks = anchor_marks(nothing, np.zeros(0, np.uint8), np.zeros(0, np.uint8), most=10, color=SKY)
    assert marks.at(np.eye(4), K, 50, 40, near=0.1) is None
    assert marks.counts == {}


def test_an_anchor_in_a_region_says_so_until_its_clip_was_trained_with_it():
    regions = [sphere_region("static", (0.0, 0.0, 1.5), 1.0), sphere_region("dynamic", (0.0, 0.0, 2.0), 0.1)]
    marks = anchor_marks(POSITIONS, CODES, REASONS, most=10, color=SKY)
    first, second, third, _ = (marks.text(row, regions).splitlines() for row in range(4))
    assert first[1:] == ["in a region marked as moving, in effect from the next training on"]  # the later one
    assert second[1:] == [reason_text(LIGHT), "in a region marked as static, in effect from the next training on"]
    assert len(third) == 1
    heeded = np.array([USER_DYNAMIC, USER_STATIC, NO_REASON, NO_REASON], np.uint8)
    marks = anchor_marks(POSITIONS, CODES, heeded, most=10, color=SKY)
    assert [len(marks.text(row, regions).splitlines()) for row in range(4)] == [2, 2, 1, 1]
