"""A damaged document: what is left is said, and nothing is thrown away."""

import random
from pathlib import Path

import pytest

from app.cli.cli import main
from app.document.history import DocumentHistory
from app.document.storing.document_store import DocumentStore
from app.document.storing.journal_file import read_journal
from app.document.storing.recovery import look_for_recovery, plain_history, recover
from app.document.storing.replay import journal_path, journal_steps
from app.project.opening.project_access import create_project, open_project, repair_project
from engine.errors import ProjectError
from tests.app.document.documents import EMPTY, SETTINGS, as_bytes, random_events


def edited(folder: Path) -> list[DocumentHistory]:
    """A project with 30 steps, the last ten of them in the journal; the history after each."""
    folder.mkdir(exist_ok=True)
    store = DocumentStore(folder)
    store.create(EMPTY)
    found = [DocumentHistory(EMPTY)]
    for number, (event, history) in enumerate(random_events(random.Random(8), 30), start=1):
        store.write([event], history)
        found.append(history)
        if number in (10, 20):
            store.compact()
    return found


def test_nothing_is_to_be_recovered_of_a_whole_project(tmp_path: Path) -> None:
    edited(tmp_path)
    assert look_for_recovery(tmp_path) is None


def test_a_line_in_the_middle_costs_what_follows_it(tmp_path: Path) -> None:
    states = edited(tmp_path)
    path = journal_path(tmp_path, 20)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:6], lines[6].replace(b'"', b"'", 1), *lines[7:]]))
    found = look_for_recovery(tmp_path)
    assert found is not None
    assert (found.step, found.n_replayed, found.plain_step, found.is_from_backup) == (24, 4, 20, False)
    assert found.step_name == states[24].past[-1].name
    assert as_bytes(plain_history(tmp_path).present) == as_bytes(states[20].present)
    damaged = path.read_bytes()
    aside = recover(tmp_path)
    assert (aside / "journal" / path.name).read_bytes() == damaged
    store = DocumentStore(tmp_path)
    history = store.read()
    assert as_bytes(history.present) == as_bytes(states[24].present)
    assert [step.name for step in history.past] == [step.name for step in states[24].past]
    assert (store.notes, store.n_replayed) == ((), 0)
    assert len(journal_steps(tmp_path)) == 1


@pytest.mark.parametrize("damage", [b"", b"{", b"\0" * 500])
def test_a_project_file_that_is_gone_bad_costs_nothing(tmp_path: Path, damage: bytes) -> None:
    states = edited(tmp_path)
    (tmp_path / "project.json").write_bytes(damage)
    found = look_for_recovery(tmp_path)
    assert found is not None
    assert (found.step, found.is_from_backup, found.plain_step) == (30, True, 10)
    recover(tmp_path)
    history = DocumentStore(tmp_path).read()
    assert as_bytes(history.present) == as_bytes(states[30].present)
    assert [step.name for step in history.past] == [step.name for step in states[30].past]


def test_a_repair_that_does_not_end_can_be_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    states = edited(tmp_path)
    (tmp_path / "project.json").write_bytes(b"{")

    def refuse(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    for name in ("write_history", "write_document_text", "create_journal"):
        monkeypatch.setattr(f"app.document.storing.document_store.{name}", refuse)
        with pytest.raises(ProjectError, match="No space left"):
            recover(tmp_path)
        monkeypatch.undo()
    if look_for_recovery(tmp_path) is not None:
        recover(tmp_path)
    assert as_bytes(DocumentStore(tmp_path).read().present) == as_bytes(states[30].present)


def test_where_nothing_can_be_read_nothing_is_touched(tmp_path: Path) -> None:
    edited(tmp_path)
    for name in ("project.json", "project.backup.json"):
        (tmp_path / name).write_text("[]")
    before = sorted(path.name for path in tmp_path.iterdir())
    found = look_for_recovery(tmp_path)
    assert found is not None
    assert (found.step, found.plain_step) == (None, None)
    with pytest.raises(ProjectError, match="the document is lost"):
        recover(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_a_project_that_is_open_for_writing_is_not_repaired(tmp_path: Path) -> None:
    project = create_project(tmp_path / "p", SETTINGS)
    with pytest.raises(ProjectError, match="open for writing"):
        repair_project(tmp_path / "p")
    project.close()


def test_the_command_line_says_what_is_left_and_repairs_on_request(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    states = edited(tmp_path)
    assert main(["repair", str(tmp_path)]) == 0
    path = journal_path(tmp_path, 20)
    data = bytearray(path.read_bytes())
    data[read_journal(path)[0].ends[3] + 20] ^= 1
    path.write_bytes(data)
    assert main(["gate", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "Line 6 is damaged" in said
    assert f"clipgstream repair {tmp_path}" in said
    assert main(["repair", str(tmp_path)]) == 2
    assert "up to step 23" in capsys.readouterr().out
    assert main(["repair", str(tmp_path), "--keep-good-steps", "--json"]) == 0
    assert '"step": 23' in capsys.readouterr().out
    project = open_project(tmp_path)
    assert as_bytes(project.document) == as_bytes(states[23].present)
    project.close()
    assert main(["repair", str(tmp_path / "nowhere")]) == 2


@pytest.mark.parametrize("command", ["repair", "gate"])
def test_a_journal_that_was_cut_off_is_said_by_every_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    edited(tmp_path)
    path = journal_path(tmp_path, 20)
    n_steps = len(read_journal(path)[0].rows)
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:4]))
    assert main([command, str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert f"breaks off after step 22: {n_steps - 2} later steps are missing" in said.out + said.err
    assert "whole" not in said.out


def test_a_damaged_history_is_said_on_the_command_line_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edited(tmp_path)
    (tmp_path / "history.json").write_text("{")
    assert main(["gate", str(tmp_path), "--forget"]) == 0
    said = capsys.readouterr().err
    assert said.count("cannot be undone") == 1
