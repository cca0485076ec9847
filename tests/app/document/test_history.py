"""The history of a document: named steps back and forth, drags merged, as a value."""

from dataclasses import replace

from app.document.history import MAX_STEPS, Changed, DocumentHistory, Placed, Redone, Undone
from app.document.project_document import Marker, ProjectDocument
from app.document.project_settings import ProjectSettings

EMPTY = ProjectDocument(ProjectSettings("here", "abc"))


def marked(n: int) -> ProjectDocument:
    return replace(EMPTY, markers=tuple(Marker(i, str(i)) for i in range(n)))


def after(history: DocumentHistory, *events) -> DocumentHistory:
    for event in events:
        history = history.after(event)
    return history


def test_five_hundred_steps_go_back_and_forth_to_the_same_documents():
    history, documents = DocumentHistory(EMPTY), [EMPTY]
    for n in range(1, MAX_STEPS + 1):
        documents.append(marked(n))
        history = history.after(Changed(f"step {n}", documents[-1]))
    for n in reversed(range(MAX_STEPS)):
        assert history.undo_name == f"step {n + 1}"
        history = history.after(Undone())
        assert history.present is documents[n]
    assert history.undo_name == ""
    assert history.after(Undone()) is history
    for n in range(1, MAX_STEPS + 1):
        assert history.redo_name == f"step {n}"
        history = history.after(Redone())
        assert history.present is documents[n]
    assert history.after(Redone()) is history


def test_the_oldest_step_goes_when_there_are_too_many():
    history = DocumentHistory(EMPTY)
    for n in range(MAX_STEPS + 3):
        history = history.after(Changed(str(n), marked(n)))
    assert len(history.past) == MAX_STEPS
    assert history.past[0].name == "3"


def test_a_drag_is_one_step_until_something_else_happens():
    drag = [Changed("drag", marked(n), merge=("drag", 1)) for n in (1, 2, 3)]
    history = after(DocumentHistory(EMPTY), *drag)
    assert (len(history.past), history.present) == (1, marked(3))
    assert history.after(Undone()).present is EMPTY
    history = after(history, Undone(), Redone(), Changed("drag", marked(4), merge=("drag", 1)))
    assert [step.name for step in history.past] == ["drag", "drag"], "what is done after undo is a step of its own"
    other = after(DocumentHistory(EMPTY), drag[0], Changed("drag", marked(2), merge=("drag", 2)))
    assert len(other.past) == 2


def test_a_new_step_forgets_what_was_taken_back():
    history = after(DocumentHistory(EMPTY), Changed("a", marked(1)), Undone(), Changed("b", marked(2)))
    assert history.redo_name == ""
    assert history.undo_name == "b"


def test_another_place_of_the_capture_stays_when_steps_are_taken_back():
    moved = replace(EMPTY.settings, capture="there", follow_links=True)
    history = after(DocumentHistory(EMPTY), Changed("a", marked(1)), Placed(moved))
    assert history.undo_name == "a"
    back = history.after(Undone())
    assert back.present.settings == moved
    assert back.present.markers == ()
    assert back.after(Redone()).present == replace(marked(1), settings=moved)
