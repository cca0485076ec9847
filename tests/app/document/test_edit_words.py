"""Edits in words."""

from __future__ import annotations

import re

import numpy as np
import pytest

from app.document.changes.edit_words import edit_title, scope_text, what_text
from engine.capture.clip import split_clips
from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import Box, Edit, Everything, Picked, PickedRows, Scope, Sphere
from engine.editing.picks import pack_rows

BOX, SPHERE = Box((0.0, 0.0, 0.0), (0.4, 0.25, 0.6)), Sphere((1.0, 0.0, 0.0), 0.5)


def _picked(*clips_and_counts: tuple[int, int]) -> Picked:
    return Picked(
        tuple(PickedRows(clip, f"origin {clip}", "residual", pack_rows(np.arange(n))) for clip, n in clips_and_counts)
    )


def test_what_differs_reads_differently() -> None:
    edits = (
        (Delete(), _picked((2, 1240)), False),
        (Delete(), _picked((2, 1)), False),
        (Hide(), _picked((0, 3), (4, 5)), True),
        (Hide(), BOX, True),
        (Delete(), BOX, True),
        (Delete(), BOX, False),
        (Hide(), SPHERE, False),
        (Transform((0.0, 1.0, 0.0)), SPHERE, False),
        (Transform((0.0, 1.0, 0.0), (0.0, 1.0, 0.0, 0.0), 2.0), SPHERE, False),
        (Transform(), Everything(), False),
        (Recolor(opacity=0.5), Everything(), False),
        (Recolor(opacity=0.5, saturation=0.0), Everything(), False),
        (Expose(-0.5), Everything(), False),
        (Hold(12), SPHERE, False),
        (Smooth(1.5), Everything(), False),
    )
    texts = [what_text(action, target, is_inverted=is_inverted) for action, target, is_inverted in edits]
    assert len(set(texts)) == len(edits)
    assert "1,240" in texts[0]
    assert "8" in texts[2]


@pytest.mark.parametrize(
    ("scope", "numbers"),
    [
        (Scope(), []),
        (Scope(20), [20]),
        (Scope(12, 13), [12]),
        (Scope(10, 20), [10, 19, 1]),
        (Scope(10, 15), [10, 14]),
        (Scope(0, None, True), []),
        (Scope(5, 6, True), [5]),
    ],
)
def test_where_it_holds_by_first_and_last_frame_and_clip(scope: Scope, numbers: list[int]) -> None:
    assert [int(digits) for digits in re.findall(r"\d+", scope_text(scope, split_clips(30, 10)))] == numbers


def test_a_name_of_the_user_stands_for_the_edit() -> None:
    assert edit_title(Edit(1, "50 %", BOX, Hide())) == "50 %"
    assert edit_title(Edit(1, "", BOX, Hide())) == what_text(Hide(), BOX, is_inverted=False)
