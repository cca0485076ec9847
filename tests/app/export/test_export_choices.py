"""Choices as values: they survive being kept, and name the frames they stand for."""

from __future__ import annotations

import msgspec
import pytest

from app.export.export_choices import ExportChoices, ExportContext
from app.export.jobs.answers import Answers
from app.export.picked_frames import PickedFrames
from engine.children.messages import decoded, encoded

CONTEXT = ExportContext(
    name="p",
    n_frames=10,
    clips=((0, 4), (4, 8), (8, 10)),
    trained=(0, 2),
    frame_index=5,
    in_frame=2,
    out_frame=6,
    cameras=("a",),
    picture_size=(32, 24),
    fps=30.0,
)


def test_answers_belong_to_a_kind_and_survive_a_file():
    choices = ExportChoices(kind="video").with_answer("format", "webm").changed(kind="metrics")
    assert choices.answer("format", "csv") == "csv"
    assert choices.changed(kind="video").answer("format") == "webm"
    kept = msgspec.json.decode(msgspec.json.encode(choices), type=ExportChoices)
    assert kept == choices
    assert hash(kept) == hash(choices)


def test_frames_that_are_left_out_belong_to_a_kind_too():
    choices = ExportChoices(kind="gaussians").with_step(5)
    assert (choices.step, choices.changed(kind="player").step) == (5, 1)
    assert [choices.with_step(step).step for step in (0, 7, 10**9)] == [1, 7, 100_000]
    assert choices.with_answer("step", "many").step == 1


@pytest.mark.parametrize(
    ("choice", "step", "frames"),
    [
        ("all", 1, [0, 1, 2, 3, 8, 9]),
        ("all", 4, [0, 8]),
        ("all", 3, [0, 3, 9]),
        ("range", 1, [2, 3, 4, 5, 6]),
        ("range", 3, [2, 5]),
        ("clip", 1, [4, 5, 6, 7]),
        ("frame", 1, [5]),
    ],
)
def test_frames_of_a_choice(choice, step, frames):
    found = CONTEXT.frames(choice, step)
    assert list(found) == frames
    assert decoded(encoded(found), PickedFrames) == found
    assert (len(found), found.step, [frame for frame in range(12) if frame in found]) == (len(frames), step, frames)


def test_frames_without_gaps_are_written_as_a_range():
    assert repr(msgspec.structs.replace(CONTEXT, trained=(0, 1)).frames("all", 3)) == "range(0, 8, 3)"
    assert repr(msgspec.structs.replace(CONTEXT, trained=(1,)).frames("all", 1)) == "range(4, 8)"
    assert isinstance(hash(CONTEXT.frames("all", 1)), int)


def test_untrained_runs():
    assert CONTEXT.untrained(range(10)) == [(4, 7)]
    assert CONTEXT.untrained(range(0, 4)) == []
    assert CONTEXT.untrained(range(0, 10, 8)) == []
    nothing = msgspec.structs.replace(CONTEXT, trained=())
    assert nothing.untrained(range(10)) == [(0, 9)]
    assert list(nothing.frames("all", 1)) == []


def test_where_cameras_lie_is_asked_for_usd_only():
    placed = {"up", "scale", "scene_up"}
    for format_, is_asked in (("colmap", False), ("usd", True)):
        choices = ExportChoices("cameras").with_answer("format", format_)
        asked = {question.name for question in Answers(CONTEXT, choices).questions}
        assert asked & placed == (placed if is_asked else set())
