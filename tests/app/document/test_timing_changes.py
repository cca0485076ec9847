"""The timing as a part of the document: changed, written, replayed, undone, damaged; and projects that have none."""

import json
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from app.document.changes.timing_changes import (
    ChangeSegment,
    ChangeSpeed,
    Freeze,
    Loop,
    Order,
    ResetTime,
    Reverse,
    Split,
    TimeEdit,
    Trim,
    segment_words,
    time_edit_called,
    timing_changed,
)
from app.document.history import Changed, DocumentHistory, Redone, Undone
from app.document.storing.document_file import read_document, write_document
from app.document.storing.document_patch import document_difference, document_with
from app.document.storing.document_store import DocumentStore
from app.document.storing.stored_document import document_of, plain_document
from app.project.opening.project_access import open_project
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError
from engine.timing.segment import Segment
from tests.app.document.documents import EMPTY, as_bytes
from tests.app.stored_project import STORED, copy_stored

N_FRAMES = 60
STEPS: tuple[TimeEdit, ...] = (
    Trim((5, 55)),
    Split(30),
    ChangeSpeed((30, 40), 0.5, 2.0, "smooth"),
    Reverse((10, 20)),
    Freeze(8, 15),
    Loop((10, 20), 3, 4),
    Order((2, 0, 1, 3, 4, 5)),
    ChangeSegment(0, Segment(1, 3, 0.1)),
)


def edited(*steps: TimeEdit):
    document = EMPTY
    for step in steps:
        document = timing_changed(document, step, N_FRAMES)
    return document


def test_every_step_is_written_replayed_and_undone_exactly(tmp_path: Path) -> None:
    write_document(tmp_path, EMPTY)
    store = DocumentStore(tmp_path)
    history = store.read()
    for step in STEPS:
        event = Changed(step.title, timing_changed(history.present, step, N_FRAMES))
        before, history = history, history.after(event)
        store.write([event], history)
        assert as_bytes(DocumentStore(tmp_path).read().present) == as_bytes(history.present)
        assert as_bytes(history.after(Undone()).present) == as_bytes(before.present)
        assert as_bytes(history.after(Undone()).after(Redone()).present) == as_bytes(history.present)
        for old, new in ((before.present, history.present), (history.present, before.present)):
            patch = json.loads(json.dumps(document_difference(old, new)))
            assert as_bytes(document_with(old, patch)) == as_bytes(new)
    assert [step.name for step in history.past] == [step.title for step in STEPS]
    write_document(tmp_path, history.present)
    assert read_document(tmp_path).timing == history.present.timing
    assert timing_changed(history.present, ResetTime(), N_FRAMES) == EMPTY
    assert isinstance(history, DocumentHistory)


def test_projects_that_earlier_versions_wrote_play_as_captured(tmp_path: Path) -> None:
    assert "timing" not in json.loads((STORED / "project.json").read_text())
    project = open_project(copy_stored(tmp_path / "p"))
    assert project.document.timing == ()
    project.change(timing_changed(project.document, Trim((1, 4)), 30), "trim")
    project.close()
    assert open_project(tmp_path / "p", is_writable=False).document.timing == (Segment(1, 4),)


def test_what_is_read_is_checked() -> None:
    """Fifty documents with one entry of a segment spoilt: each is read as something that can be played, or refused."""
    plain = plain_document(edited(*STEPS))
    rng, n_refused = random.Random(3), 0
    spoilt: tuple[Any, ...] = (-1, 0, 2**40, 1e300, "x", None, [], {}, True, 0.5, -0.0)
    for _ in range(50):
        content = json.loads(json.dumps(plain))
        entry = rng.choice(content["timing"])
        name = rng.choice([*entry, "unknown"])
        if rng.random() < 0.15:
            del entry[rng.choice(("first", "stop"))]
        else:
            entry[name] = rng.choice(spoilt)
        try:
            document = document_of(content)
        except (EntryError, ProjectError):
            n_refused += 1
            continue
        assert all(segment_words(one) for one in document.timing)
    assert n_refused > 30


def test_a_take_is_never_too_long() -> None:
    with pytest.raises(ProjectError, match="1,000,000"):
        edited(*[Loop((10, 20), 1000)], ChangeSegment(1, Segment(10, 20, 0.01, 0.01, repeats=1000)))
    long = replace(EMPTY, timing=(Segment(0, 2**30),))
    with pytest.raises(ProjectError, match="1,000,000"):
        document_of(plain_document(long))
    with pytest.raises(ProjectError, match="1,000,000"):
        document_difference(EMPTY, long)


@pytest.mark.parametrize(
    ("verb", "entries", "word"),
    [
        ("bogus", {}, "bogus"),
        ("trim", {}, "--frames"),
        ("trim", {"frames": (50, 90)}, "0 to 59"),
        ("trim", {"frames": (9, 3)}, "not in the capture"),
        ("trim", {"frames": "10:20"}, "frames is"),
        ("split", {"at": 0}, "frame 0"),
        ("split", {"at": 1.5}, "whole number"),
        ("speed", {"by": 0.0}, "0.01"),
        ("speed", {"by": float("nan")}, "nan"),
        ("speed", {"ease": "odd"}, "odd"),
        ("speed", {"faster": 1}, "faster"),
        ("freeze", {"at": 60}, "not in the capture"),
        ("freeze", {"at": 3, "n_output": 0}, "1"),
        ("loop", {"frames": (10, 14), "crossfade": 3}, "cross-fade"),
        ("loop", {"times": 1, "crossfade": 3}, "repeats"),
        ("order", {"places": (1,)}, "segment 1"),
        ("order", {"places": ()}, "No segment"),
    ],
)
def test_what_cannot_be_is_refused_with_its_cause(verb: str, entries: dict[str, Any], word: str) -> None:
    with pytest.raises(ProjectError, match=word):
        timing_changed(EMPTY, time_edit_called(verb, entries), N_FRAMES)


def test_a_segment_in_words() -> None:
    assert segment_words(Segment(3, 9)) == "frames 3 to 8"
    one = Segment(3, 9, 0.5, 2.0, "smooth", is_reversed=True, repeats=3, crossfade_frames=2)
    assert segment_words(one) == ("frames 3 to 8, reversed, speed 0.5 to 2, smooth, 3 times, cross-fade of 2 frames")
    assert segment_words(structs.replace(Segment(3, 4), n_frozen=9)) == "frame 3 frozen for 9 frames"
