"""Changes to the objects of a document, their place in its history and in its files."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from app.document.changes import edit_changes
from app.document.changes import object_changes as change
from app.document.history import Changed, DocumentHistory, Event, ObjectFound, Redone, Undone
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.document_store import DocumentStore
from app.document.storing.stored_document import document_of, plain_document
from engine.capture.exclusions import Exclusions, PaintedMask, Stroke
from engine.editing.actions import Delete, Expose
from engine.editing.edit import ObjectTarget, PickedRows
from engine.editing.picks import pack_rows, unpack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed
from engine.errors import ProjectError
from engine.storage.json_files import JsonError, parse_json
from engine.storage.typed_json import EntryError
from tests.faults.mutate import damaged_json

EMPTY = ProjectDocument(ProjectSettings("capture", "fingerprint"))


def _rows(*numbers: int, origin: str = "abc", role: str = "moving") -> PickedRows:
    return PickedRows(0, origin, role, pack_rows(np.array(numbers)))


SEED = ObjectSeed(12, added=(_rows(1, 2, 3),))
OTHER = ObjectSeed(15, added=(_rows(9),), removed=(_rows(2),))


def _two() -> ProjectDocument:
    document = change.add_object(EMPTY, SEED, name="left player", within=(10, 20))
    return change.add_object(document, SEED)


def test_objects_have_names_numbers_and_colours_of_their_own() -> None:
    document = _two()
    assert [(one.object_id, one.name) for one in document.objects] == [(1, "left player"), (2, "object 1")]
    assert [one.color for one in document.objects] == list(change.PALETTE[:2])
    assert change.object_named(document, " LEFT player ").object_id == 1
    assert change.object_named(document, "2").object_id == 2
    for _ in range(9):
        document = change.add_object(document, SEED)
    assert len({one.name for one in document.objects}) == len(document.objects) == 11


def test_a_new_object_is_seen_at_once_in_its_clip_and_waits_to_be_searched() -> None:
    first, second = _two().objects
    (clip,) = first.clips
    assert (clip.start, clip.stop, clip.seen, clip.origin) == (10, 20, ((10, 20),), "")
    assert unpack_rows(clip.sets[0].rows).tolist() == [1, 2, 3]
    assert second.clips == ()


def test_corrections_add_up_and_are_seen_at_once() -> None:
    searched = change.with_found(
        _two(), 1, [ObjectInClip(10, 20, (_rows(1, 2, 3, 4),), ((11, 20),), 0.9, "touching", "abc")]
    )
    document = change.correct_object(searched, 1, OTHER, within=(10, 20))
    document = change.correct_object(document, 1, OTHER, within=(20, 30))
    one = document.objects[0]
    assert one.seeds == (SEED, OTHER, OTHER)
    assert unpack_rows(one.clips[0].sets[0].rows).tolist() == [1, 3, 4, 9]
    assert one.clips[0].seen == ((11, 20),)
    assert [clip.origin for clip in one.clips] == ["", ""], "both have to be searched again"
    gone = change.correct_object(searched, 1, ObjectSeed(12, removed=(_rows(1, 2, 3, 4),)), within=(10, 20))
    assert gone.objects[0].clips[0].sets == () == gone.objects[0].clips[0].seen


def test_removing_an_object_takes_its_edits_along() -> None:
    document = edit_changes.add_edit(_two(), Delete(), ObjectTarget(1))
    document = edit_changes.add_edit(document, Expose(1.0), ObjectTarget(2))
    document, n_edits = change.remove_object(document, 1)
    assert n_edits == 1
    assert [one.object_id for one in document.objects] == [2]
    assert [edit.target for edit in document.edits] == [ObjectTarget(2)]


def test_other_values() -> None:
    document = change.rename_object(_two(), 1, " right player ")
    document = change.recolour_object(document, 1, (0.0, 0.5, 1.0))
    mask, painted = (PaintedMask("a", 0, 9, (Stroke(((0.5, 0.5),), 0.1),), owner) for owner in (1, None))
    document = replace(document, exclusions=Exclusions(masks=(painted,)))
    document = change.set_trained(change.set_span(document, 1, 5, 9), 1, is_trained=False, masks=(mask,))
    assert document.exclusions.masks == (painted, mask)
    assert change.set_trained(document, 1, is_trained=False, masks=(mask,)) == document
    assert change.set_trained(document, 1, is_trained=True).exclusions.masks == (painted,)
    assert change.remove_object(document, 1)[0].exclusions.masks == (painted,)
    with pytest.raises(ProjectError, match="points"):
        change.set_trained(document, 1, is_trained=False, masks=(mask,) * 500_001)
    one = document.objects[0]
    assert (one.name, one.color, one.first, one.stop, one.is_trained) == (
        "right player",
        (0.0, 0.5, 1.0),
        5,
        9,
        False,
    )
    assert document_of(json.loads(json.dumps(plain_document(document)))) == document


@pytest.mark.parametrize(
    "wrong",
    [
        lambda document: change.add_object(document, SEED, name="LEFT PLAYER"),
        lambda document: change.add_object(document, ObjectSeed(1)),
        lambda document: change.add_object(document, ObjectSeed(1, removed=(_rows(1),))),
        lambda document: change.add_object(document, SEED, name="x" * 300),
        lambda document: change.correct_object(document, 1, ObjectSeed(1)),
        lambda document: change.correct_object(document, 7, OTHER),
        lambda document: change.rename_object(document, 1, " "),
        lambda document: change.rename_object(document, 1, "object 1"),
        lambda document: change.recolour_object(document, 1, (0.0, float("nan"), 1.0)),
        lambda document: change.set_span(document, 1, 5, 5),
        lambda document: change.set_span(document, 1, -1, 5),
        lambda document: change.remove_object(document, 7),
        lambda document: change.set_trained(document, 7, is_trained=True),
    ],
)
def test_what_cannot_be_is_refused(wrong) -> None:
    with pytest.raises(ProjectError):
        wrong(_two())


def test_the_names_are_listed_where_there_is_no_such_object() -> None:
    for ask in (
        lambda: change.object_named(_two(), "ball"),
        lambda: change.object_with(_two(), 7),
    ):
        with pytest.raises(ProjectError) as caught:
            ask()
        assert caught.value.hint == "Objects are left player, object 1."
    with pytest.raises(ProjectError) as caught:
        change.object_named(EMPTY, "ball")
    assert caught.value.hint == "The project has no objects."


# ---------------------------------------------------------------- history


FOUND = (ObjectInClip(0, 10, (), (), 1.0, "gone", "aaa"), ObjectInClip(10, 20, (_rows(1, 2),), ((10, 20),), 1.0))


def _history() -> tuple[DocumentHistory, list[Event]]:
    """An object is made, an edit as well, then the object is found, corrected, and found again."""
    history, events = DocumentHistory(EMPTY), []

    def happen(event: Event) -> None:
        nonlocal history
        events.append(event)
        history = history.after(event)

    happen(Changed("make object", change.add_object(EMPTY, SEED, within=(10, 20))))
    happen(Changed("expose", edit_changes.add_edit(history.present, Expose(1.0))))
    happen(ObjectFound(1, (SEED,), FOUND))
    happen(Changed("correct", change.correct_object(history.present, 1, OTHER)))
    happen(ObjectFound(1, (SEED, OTHER), FOUND[:1]))
    return history, events


def test_what_was_found_belongs_to_the_step_that_made_the_object() -> None:
    history, _ = _history()
    assert [step.name for step in history.past] == ["make object", "expose", "correct"]
    assert history.present.objects[0].clips == FOUND[:1]
    history = history.after(Undone())
    assert history.present.objects[0].clips == FOUND
    history = history.after(Undone())
    assert history.present.objects[0].clips == FOUND
    assert history.present.objects[0] is history.future[-1].document.objects[0], "documents share their objects"
    history = history.after(Undone())
    assert history.present == EMPTY
    for _ in range(3):
        history = history.after(Redone())
    assert history == _history()[0] or history.present == _history()[0].present


def test_what_was_found_for_other_seeds_is_of_no_account() -> None:
    history, _ = _history()
    assert history.after(ObjectFound(1, (OTHER,), ())).present == history.present
    assert history.after(ObjectFound(2, (SEED, OTHER), ())).present == history.present


@pytest.mark.parametrize("is_compacted", [False, True])
def test_the_files_lead_to_the_same_history(tmp_path: Path, *, is_compacted: bool) -> None:
    store = DocumentStore(tmp_path)
    store.create(EMPTY)
    history = DocumentHistory(EMPTY)
    for number, event in enumerate((*_history()[1], Undone(), Undone())):
        history = history.after(event)
        store.write([event], history)
        if is_compacted and number == 2:
            store.compact()
    read = DocumentStore(tmp_path).read()
    assert read.present == history.present
    assert [step.document for step in read.past] == [step.document for step in history.past]
    assert [step.document for step in read.future] == [step.document for step in history.future]


def test_damaged_objects_are_refused_or_read_as_something_valid() -> None:
    document = change.with_found(_two(), 1, FOUND)
    text = json.dumps({"objects": plain_document(document)["objects"]}).encode()
    rng, n_refused = random.Random(3), 0
    for _ in range(200):
        _, damaged = damaged_json(text, rng)
        try:
            content = parse_json(damaged.decode("utf-8", "replace"))
            if isinstance(content, dict):
                plain_document(document_of(plain_document(EMPTY) | content))
        except (JsonError, EntryError, ProjectError):
            n_refused += 1
    assert n_refused > 50


def test_objects_of_another_time_are_not_shared_wrongly() -> None:
    one = change.add_object(EMPTY, SEED).objects[0]
    later = replace(EMPTY, objects=(structs.replace(one, name="b"),))
    history = DocumentHistory(later, DocumentHistory(EMPTY).after(Changed("a", replace(EMPTY, objects=(one,)))).past)
    found = history.after(ObjectFound(1, (SEED,), FOUND))
    assert found.present.objects[0].name == "b"
    assert found.present.objects[0].clips == FOUND
