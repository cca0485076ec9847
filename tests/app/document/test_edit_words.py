"""Edits in words."""

from __future__ import annotations

import numpy as np
import pytest

from app.document.changes.edit_words import edit_title, scope_text, what_text
from engine.capture.clip import split_clips
from engine.editing.actions import Action, Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import Box, Edit, Everything, Picked, PickedRows, Scope, Sphere, Target
from engine.editing.picks import pack_rows

BOX, SPHERE = Box((0.0, 0.0, 0.0), (0.4, 0.25, 0.6)), Sphere((1.0, 0.0, 0.0), 0.5)


def _picked(*clips_and_counts: tuple[int, int]) -> Picked:
    return Picked(
        tuple(PickedRows(clip, f"origin {clip}", "residual", pack_rows(np.arange(n))) for clip, n in clips_and_counts)
    )


@pytest.mark.parametrize(
    ("action", "target", "is_inverted", "text"),
    [
        (Delete(), _picked((2, 1240)), False, "delete 1,240 Gaussians of clip 2"),
        (Delete(), _picked((2, 1)), False, "delete 1 Gaussian of clip 2"),
        (Hide(), _picked((0, 3), (4, 5)), True, "isolate 8 Gaussians of 2 clips"),
        (Hide(), BOX, True, "crop to box 0.8 × 0.5 × 1.2"),
        (Delete(), BOX, True, "delete all but box 0.8 × 0.5 × 1.2"),
        (Hide(), SPHERE, False, "hide sphere of radius 0.5"),
        (Transform((0.0, 1.0, 0.0)), SPHERE, False, "move sphere of radius 0.5"),
        (
            Transform((0.0, 1.0, 0.0), (0.0, 1.0, 0.0, 0.0), 2.0),
            BOX,
            False,
            "move, rotate and scale box 0.8 × 0.5 × 1.2",
        ),
        (Transform(), Everything(), False, "move everything"),
        (Recolor(opacity=0.5), Everything(), False, "change opacity of everything"),
        (Recolor(opacity=0.5, saturation=0.0), Everything(), False, "recolour everything"),
        (Expose(-0.5), Everything(), False, "expose everything by -0.5 EV"),
        (Hold(12), SPHERE, False, "hold sphere of radius 0.5 as in frame 12"),
        (Smooth(1.5), Everything(), False, "smooth everything over 1.5 frames"),
    ],
)
def test_what_is_done_to_what(action: Action, target: Target, is_inverted: bool, text: str) -> None:
    assert what_text(action, target, is_inverted=is_inverted) == text


@pytest.mark.parametrize(
    ("scope", "text"),
    [
        (Scope(), "everywhere"),
        (Scope(20), "from 20 on"),
        (Scope(12, 13), "frame 12"),
        (Scope(10, 20), "frames 10-19 (clip 1)"),
        (Scope(10, 15), "frames 10-14"),
        (Scope(0, None, True), "the reference"),
        (Scope(5, 6, True), "the reference, frame 5"),
    ],
)
def test_where_it_holds(scope: Scope, text: str) -> None:
    assert scope_text(scope, split_clips(30, 10)) == text


def test_a_name_of_the_user_stands_for_the_edit() -> None:
    assert edit_title(Edit(1, "50 %", BOX, Hide())) == "50 %"
    assert edit_title(Edit(1, "", BOX, Hide())) == "hide box 0.8 × 0.5 × 1.2"
