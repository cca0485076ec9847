"""find_fill on a small clip."""

from __future__ import annotations

import numpy as np
import pytest

from engine.backends.table import backend_called
from engine.editing.actions import Delete, Expose
from engine.editing.edit import Edit, Scope, Sphere
from engine.editing.effects import EditStack
from engine.editing.fills.fill import fill_key, unpacked_fill
from engine.editing.selection.seen_from import SeenFrom
from engine.errors import ProjectError
from engine.filling.finding import FilledClip, find_fill
from tests.engine.editing.edited_clips import CLIP, edited, make_clip

CLIPS = [FilledClip(CLIP, lambda: edited(make_clip()), 0.1)]
UP = np.array([0.0, 0.0, 2.0])


def views() -> list[SeenFrom]:
    pose = np.eye(4)
    pose[:3, 3] = (-0.5, -0.5, 2.0)
    return [SeenFrom(pose, np.array([[40.0, 0.0, 16.0], [0.0, 40.0, 12.0], [0.0, 0.0, 1.0]]), 32, 24)]


def found(edit: Edit, report=lambda done, total: None):
    return find_fill(edit, EditStack((edit,)), CLIPS, views(), up=UP, backend=backend_called("cpu"), report=report)


def test_it_fits_the_edit_and_its_figures_say_what_is_in_it():
    edit, told = Edit(1, "", Sphere((0.5, 0.5, 0.5), 0.5), Delete()), []
    fill, figures = found(edit, lambda done, total: told.append((done, total)))
    assert fill.made_for == fill_key(edit)
    assert len(unpacked_fill(fill.gaussians)) == figures.n_gaussians >= figures.n_guessed
    assert figures.n_pixels > 0
    assert figures.n_open >= figures.n_left
    assert told[0][0] == 0
    assert told[-1][0] == told[-1][1]
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert found(edit) == (fill, figures), "the same again"


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (Edit(1, "", Sphere((0.5, 0.5, 0.5), 0.5), Expose(1.0)), "Edit 1 takes nothing away. Choose an edit that"),
        (Edit(1, "", Sphere((0.5, 0.5, 0.5), 0.5), Delete(), Scope(90)), "acts in no frame that is trained"),
        (Edit(1, "", Sphere((9.5, 0.5, 0.5), 0.1), Delete()), "takes nothing away in any trained frame"),
    ],
)
def test_what_cannot_be_filled(edit: Edit, message: str):
    with pytest.raises(ProjectError, match=message):
        found(edit)


def test_it_ends_when_it_is_not_wanted():
    def stop(done: int, total: int) -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        found(Edit(1, "", Sphere((0.5, 0.5, 0.5), 0.5), Delete()), stop)
