"""The document and its history on disk: every step is kept, and all of them come back byte for byte."""

import os
import random
import shutil
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.history import Changed, DocumentHistory, Event, Placed, Redone, Undone
from app.document.project_document import Marker
from app.document.storing import document_store, journal_file, replay
from app.document.storing.document_store import DocumentStore
from app.document.storing.journal_file import read_journal
from app.document.storing.kept_json import KeptText
from app.document.storing.replay import journal_path, journal_steps
from engine.errors import DiskError, ProjectError
from tests.app.document.documents import EMPTY, as_bytes, random_events


@pytest.fixture(autouse=True)
def fast_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test here waits until the disk has flushed thousands of lines."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


def marked(history: DocumentHistory, frame: int, merge: object = None) -> Changed:
    """A small change."""
    document = replace(history.present, markers=(*history.present.markers, Marker(frame, "x"))[-3:])
    return Changed(f"mark {frame}", document, merge)


def same(one: DocumentHistory, other: DocumentHistory) -> None:
    """Both have the same document, and the same steps either way."""
    assert as_bytes(one.present) == as_bytes(other.present)
    for ours, theirs in ((one.past, other.past), (one.future, other.future)):
        assert [(step.name, as_bytes(step.document)) for step in ours] == [
            (step.name, as_bytes(step.document)) for step in theirs
        ]


def made(folder: Path) -> tuple[DocumentStore, DocumentHistory]:
    folder.mkdir(exist_ok=True)
    store = DocumentStore(folder)
    store.create(EMPTY)
    return store, DocumentHistory(EMPTY)


def happen(store: DocumentStore, history: DocumentHistory, *events: Event) -> DocumentHistory:
    for event in events:
        history = history.after(event)
        store.write([event], history)
    return history


@pytest.mark.slow
def test_every_event_is_there_again_whenever_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document_store, "MAX_EVENTS", 17)
    store, _ = made(tmp_path)
    rng = random.Random(3)
    for number, (event, history) in enumerate(random_events(rng, 120)):
        store.write([event], history)
        if number % 7 == 0:
            same(DocumentStore(tmp_path).read(), history)
        if number % 31 == 0:  # as after a kill
            store = DocumentStore(tmp_path)
            history = store.read()
        if number % 29 == 0:  # as after closing
            store.compact()
    assert DocumentStore(tmp_path).notes == ()
    assert 1 <= len(journal_steps(tmp_path)) <= 2


def test_500_steps_back_and_forth_give_the_same_bytes_also_after_closing_in_the_middle(tmp_path: Path) -> None:
    store, history = made(tmp_path)
    documents = [as_bytes(history.present)]
    for frame in range(500):
        history = history.after(marked(history, frame))
        store.write([Changed(f"mark {frame}", history.present)], history)
        documents.append(as_bytes(history.present))
    for index in range(499, -1, -1):
        history = happen(store, history, Undone())
        assert as_bytes(history.present) == documents[index]
        if index == 250:
            store.compact()
            store = DocumentStore(tmp_path)
            history = store.read()
            assert (len(history.past), len(history.future)) == (250, 250)
    assert not history.past
    store = DocumentStore(tmp_path)  # as after a kill
    history = store.read()
    for index in range(1, 501):
        history = happen(store, history, Redone())
        assert as_bytes(history.present) == documents[index]
    same(DocumentStore(tmp_path).read(), history)


def test_changes_of_one_drag_are_one_step_and_those_of_two_sessions_two(tmp_path: Path) -> None:
    store, history = made(tmp_path)
    history = happen(store, history, marked(history, 1, "drag 1"))
    history = happen(store, history, marked(history, 2, "drag 1"))
    store = DocumentStore(tmp_path)
    history = store.read()
    assert len(history.past) == 1
    history = happen(store, history, marked(history, 3, "drag 1"))
    assert len(history.past) == 2
    assert len(DocumentStore(tmp_path).read().past) == 2


def test_changes_that_wait_are_written_as_one(tmp_path: Path) -> None:
    store, history = made(tmp_path)
    events = []
    for frame in range(30):
        events.append(marked(history, frame, "drag"))
        history = history.after(events[-1])
    store.write(events, history)
    assert len(read_journal(journal_path(tmp_path, 0))[0].rows) == 1
    same(DocumentStore(tmp_path).read(), history)


def test_the_place_of_the_capture_is_relative_where_both_lie_together(tmp_path: Path) -> None:
    home = tmp_path / "home"
    capture, project = home / "capture", home / "project"
    project.mkdir(parents=True)
    store = DocumentStore(project)
    document = replace(EMPTY, settings=replace(EMPTY.settings, capture=str(capture)))
    store.create(document)
    history = happen(store, DocumentHistory(document), marked(DocumentHistory(document), 5))
    store.compact()
    history = happen(store, history, marked(history, 6))
    assert b'"../capture"' in (project / "project.json").read_bytes()
    home.rename(tmp_path / "moved")
    read = DocumentStore(tmp_path / "moved" / "project").read()
    assert read.present.settings.capture == str(tmp_path / "moved" / "capture")
    assert read.past[0].document.settings.capture == str(tmp_path / "moved" / "capture")
    elsewhere = replace(read.present.settings, capture="/somewhere/else")
    store = DocumentStore(tmp_path / "moved" / "project")
    store.read()
    history = happen(store, read, Placed(elsewhere))
    again = DocumentStore(tmp_path / "moved" / "project").read()
    assert again.present.settings.capture == "/somewhere/else"
    assert len(again.past) == 2
    same(again, history)


def test_a_project_json_that_was_never_really_renamed_loses_nothing(tmp_path: Path) -> None:
    store, history = made(tmp_path)
    history = happen(store, history, marked(history, 1))
    store.compact()
    history = happen(store, history, marked(history, 2))
    old = (tmp_path / "project.json").read_bytes()
    store.compact()
    history = happen(store, history, marked(history, 3))
    (tmp_path / "project.json").write_bytes(old)
    store = DocumentStore(tmp_path)
    same(store.read(), history)
    assert store.n_replayed == 2
    history = happen(store, history, marked(history, 4))
    same(DocumentStore(tmp_path).read(), history)


@pytest.mark.parametrize("lost", ["project.json", "history.json", "both"])
def test_going_back_beyond_the_last_project_json_needs_no_history(tmp_path: Path, lost: str) -> None:
    store, history = made(tmp_path)
    for frame in range(4):
        history = happen(store, history, marked(history, frame, f"drag {frame // 2}"))
    store.compact()
    old = {name: (tmp_path / name).read_bytes() for name in ("project.json", "history.json")}
    history = happen(store, history, marked(history, 4, "drag 1"), Undone(), Undone(), Redone(), Undone())
    history = happen(store, history, Redone(), marked(history, 5), Undone(), Undone())
    store.compact()
    history = happen(store, history, Redone(), Redone())
    for name in old if lost == "both" else [lost]:
        (tmp_path / name).write_bytes(old[name])
    store = DocumentStore(tmp_path)
    found = store.read()
    assert as_bytes(found.present) == as_bytes(history.present)
    if lost == "history.json":
        assert "cannot be undone" in store.notes[0]
    else:
        same(found, history)
    history = happen(store, found, Undone(), marked(found, 6))
    same(DocumentStore(tmp_path).read(), history)


def test_a_journal_that_breaks_off_costs_the_last_step_and_says_so(tmp_path: Path) -> None:
    store, history = made(tmp_path / "p")
    states = [history]
    for frame in range(4):
        history = happen(store, history, marked(history, frame))
        states.append(history)
    path = journal_path(tmp_path / "p", 0)
    data = path.read_bytes()
    known = read_journal(path)[0]
    cuts = {*range(known.ends[0], len(data), 5), *(end + off for end in known.ends for off in (-2, -1, 0, 1))}
    for cut in sorted(cut for cut in cuts if known.ends[0] <= cut < len(data)):
        path.write_bytes(data[:cut])
        store = DocumentStore(tmp_path / "p")
        n_whole = sum(end <= cut for end in known.ends) - 1
        same(store.read(), states[n_whole])
        n_missing = len(states) - 1 - n_whole
        said = f"{n_missing} later steps are" if n_missing > 1 else "1 later step is" if n_missing else "not written"
        assert store.notes[0].startswith(f"The journal breaks off after step {n_whole}: ")
        assert said in store.notes[0]
    assert len(states) == 5
    history = happen(store, store.read(), marked(states[4], 77))
    again = DocumentStore(tmp_path / "p")
    same(again.read(), history)
    assert again.notes == ()


def test_any_other_damage_of_the_journal_is_named_with_its_line(tmp_path: Path) -> None:
    store, history = made(tmp_path)
    for frame in range(4):
        history = happen(store, history, marked(history, frame))
    path = journal_path(tmp_path, 0)
    lines = path.read_bytes().splitlines(keepends=True)
    for broken, number in (
        ([*lines[:3], *lines[4:]], 4),
        ([*lines[:3], lines[3].replace(b"mark", b"mork"), *lines[4:]], 4),
        ([*lines[:3], lines[4], lines[3], *lines[5:]], 4),
        ([*lines, lines[2]], 8),
        ([b"", *lines[1:]], 1),
    ):
        path.write_bytes(b"".join(broken))
        with pytest.raises(ProjectError, match=f"Line {number} is damaged") as caught:
            DocumentStore(tmp_path).read()
        assert "clipgstream repair" in caught.value.hint
        assert caught.value.path == path


def test_no_step_waits_while_the_document_is_written_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document_store, "MAX_EVENTS", 3)
    is_writing, may_write = threading.Event(), threading.Event()
    write = document_store.write_document_text

    def slowly(folder: Path, text: KeptText, **options: bool) -> None:
        is_writing.set()
        assert may_write.wait(60.0)
        write(folder, text, **options)

    store, history = made(tmp_path / "p")
    monkeypatch.setattr(document_store, "write_document_text", slowly)
    try:
        for frame in range(8):  # the disk is still at work on the document of step 3
            history = happen(store, history, marked(history, frame))
            kept = DocumentStore(tmp_path / "p")
            same(kept.read(), history)
            assert (kept.notes, kept.n_replayed) == ((), frame + 1)
        assert is_writing.wait(60.0)  # history.json is there, so that nothing moves below the copy
        shutil.copytree(tmp_path / "p", tmp_path / "killed")
    finally:
        may_write.set()
    store.compact()
    again = DocumentStore(tmp_path / "p")
    same(again.read(), history)
    assert (again.notes, again.n_replayed) == ((), 0)
    killed = DocumentStore(tmp_path / "killed")
    history = happen(killed, killed.read(), marked(history, 99))
    killed.compact()
    again = DocumentStore(tmp_path / "killed")
    same(again.read(), history)
    assert (again.notes, again.n_replayed) == ((), 0)


def test_a_document_that_cannot_be_written_anew_stays_in_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(document_store, "MAX_EVENTS", 3)
    store, history = made(tmp_path)

    def refuse(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(document_store, "write_document_text", refuse)
    for frame in range(6):
        history = happen(store, history, marked(history, frame))
    same(DocumentStore(tmp_path).read(), history)
    monkeypatch.undo()
    store.compact()  # no step has come since the last file of the journal began
    again = DocumentStore(tmp_path)
    same(again.read(), history)
    assert (again.notes, again.n_replayed) == ((), 0)
    history = happen(again, history, marked(history, 7))
    same(DocumentStore(tmp_path).read(), history)


def test_a_journal_of_an_earlier_version_goes_on_and_counts_nothing(tmp_path: Path) -> None:
    store, history = made(tmp_path / "p")
    path = journal_path(tmp_path / "p", 0)
    known = read_journal(path)[0]
    first, link = journal_file._line({"journal": 1, "step": 0, "document": known.document, "after": ""})
    path.write_bytes(first + journal_file._last(0, link))
    store = DocumentStore(tmp_path / "p")
    history = store.read()
    for frame in range(3):
        history = happen(store, history, marked(history, frame))
    lines = path.read_bytes().splitlines(keepends=True)
    assert len(lines) == 5
    again = DocumentStore(tmp_path / "p")
    same(again.read(), history)
    assert again.notes == ()
    path.write_bytes(b"".join(lines[:2]))
    again.read()
    assert "breaks off after step 1" in again.notes[0]
    assert "how many is unknown" in again.notes[0]


def test_a_damaged_count_costs_nothing(tmp_path: Path) -> None:
    store, history = made(tmp_path / "p")
    history = happen(store, history, marked(history, 1))
    path = journal_path(tmp_path / "p", 0)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([lines[0], b"{}\n", *lines[2:]]))
    again = DocumentStore(tmp_path / "p")
    same(again.read(), history)
    assert again.notes == ()
    history = happen(again, history, marked(history, 2))  # into a new file
    same(DocumentStore(tmp_path / "p").read(), history)
    assert path.exists() is False


def test_a_missing_file_of_the_journal_is_noticed(tmp_path: Path) -> None:
    store, history = made(tmp_path / "p")
    history = happen(store, history, marked(history, 1))
    store.compact()
    history = happen(store, history, marked(history, 2))
    shutil.copytree(tmp_path / "p", tmp_path / "q")
    journal_path(tmp_path / "p", 1).unlink()
    with pytest.raises(ProjectError, match="missing"):
        DocumentStore(tmp_path / "p").read()
    older = journal_path(tmp_path / "p", 0)
    older.write_bytes(older.read_bytes()[: read_journal(older)[0].ends[0]])
    with pytest.raises(ProjectError, match="ends with step 0, before step 1"):
        DocumentStore(tmp_path / "p").read()
    shutil.rmtree(tmp_path / "q" / "journal")
    store = DocumentStore(tmp_path / "q")
    assert store.read().present.markers == (Marker(1, "x"),)
    assert "journal is missing" in store.notes[0]
    history = happen(store, store.read(), marked(history, 3))
    again = DocumentStore(tmp_path / "q")
    same(again.read(), history)
    assert again.notes == ()


def test_a_damaged_history_costs_the_way_back_and_says_so(tmp_path: Path) -> None:
    store, history = made(tmp_path)
    history = happen(store, history, marked(history, 1))
    store.compact()
    history = happen(store, history, marked(history, 2))
    (tmp_path / "history.json").write_text("{")
    store = DocumentStore(tmp_path)
    read = store.read()
    assert as_bytes(read.present) == as_bytes(history.present)
    assert len(read.past) == 1
    assert "cannot be undone" in store.notes[0]


def test_a_project_json_edited_by_hand_is_taken_where_nothing_waits(tmp_path: Path) -> None:
    store, history = made(tmp_path)
    history = happen(store, history, marked(history, 1))
    store.compact()
    path = tmp_path / "project.json"
    edited = path.read_text().replace('"text": "x"', '"text": "y"')
    path.write_text(
        "".join(line for line in edited.splitlines(True) if "checksum" not in line).replace("},\n}", "}\n}")
    )
    store = DocumentStore(tmp_path)
    history = store.read()
    assert history.present.markers == (Marker(1, "y"),)
    history = happen(store, history, marked(history, 2))
    again = DocumentStore(tmp_path)
    same(again.read(), history)


def test_a_disk_that_refuses_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, history = made(tmp_path)
    history = happen(store, history, marked(history, 1))
    write = os.write
    room = [40]

    def refuse(handle: int, data: bytes) -> int:
        if room[0] <= 0:
            room[0] = 1 << 30
            raise OSError(28, "No space left on device")
        n = write(handle, bytes(data)[: room[0]])
        room[0] -= n
        return n

    monkeypatch.setattr(os, "write", refuse)
    with pytest.raises(DiskError, match="No space left"):
        happen(store, history, marked(history, 2))
    monkeypatch.undo()
    again = DocumentStore(tmp_path)
    same(again.read(), history)
    assert again.notes == ()
    history = happen(store, history, marked(history, 3))
    same(DocumentStore(tmp_path).read(), history)


def test_a_damaged_project_file_names_the_command_that_says_what_is_left(tmp_path: Path) -> None:
    made(tmp_path / "p")
    (tmp_path / "p" / "project.json").write_text("{")
    with pytest.raises(ProjectError) as caught:
        DocumentStore(tmp_path / "p").read()
    assert caught.value.hint == f'"clipgstream repair {tmp_path / "p"}" shows what can be kept.'


def test_who_reads_while_a_file_of_the_journal_begins_sees_no_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, history = made(tmp_path)
    read = replay.read_journal

    def refuse(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    def late(path: Path) -> object:
        nonlocal history
        while len(journal_steps(tmp_path)) == 1:  # files are listed by now; the first one is left for another
            history = happen(store, history, marked(history, len(history.past)))
        return read(path)

    monkeypatch.setattr(document_store, "MAX_EVENTS", 3)
    monkeypatch.setattr(document_store, "write_document_text", refuse)  # project.json stays as it is
    monkeypatch.setattr(replay, "read_journal", late)
    again = DocumentStore(tmp_path)
    same(again.read(), history)
    assert again.notes == ()


def test_who_reads_while_events_are_written_sees_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "00000000.jsonl"
    journal, is_over = journal_file.create_journal(path, 0, document="", after=""), threading.Event()
    problems: list[str] = []

    def read() -> None:
        while not is_over.is_set():
            known, damage = read_journal(path)
            if damage is not None or not known.is_whole:
                problems.append(str(damage))

    readers = [threading.Thread(target=read) for _ in range(2)]
    for reader in readers:
        reader.start()
    try:
        for step in range(1, 300):
            journal = journal_file.append_rows(journal, [{"step": step, "do": "change", "name": "a" * 300}])
    finally:
        is_over.set()
        for reader in readers:
            reader.join()
    assert problems == []
    assert read_journal(path) == (journal, None)
