"""Replay: the current document of a project, put together from project.json, its history and the journal.

project.json is the document at some step. Each file of the journal continues from the step in its name; those that are
needed are replayed one after the other. Nothing is written here, so that any process may read a project.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from app.document.history import Changed, DocumentHistory, Event, ObjectFound, Placed, Redone, Step, Undone
from app.document.project_document import ProjectDocument
from app.document.storing.document_file import PROJECT_FILE, StoredDocument, read_stored
from app.document.storing.document_patch import document_difference, document_with
from app.document.storing.history_file import StoredHistory, history_of, read_history
from app.document.storing.journal_file import JournalDamage, JournalFile, Row, read_journal
from app.document.storing.plain_patch import PatchError
from engine.errors import ProjectError

JOURNAL_FOLDER = "journal"
_SUFFIX = ".jsonl"


@dataclass(frozen=True, slots=True)
class Replayed:
    """The contents of a project.

    Attributes:
        history: The document and the way back; the capture as stored in the files.
        step: Number of the last step.
        n_replayed: Steps that were taken from the journal.
        journal: The file that the next event belongs into; None where a new one has to begin.
        schema: Of project.json.
        notes: Missing parts that do no more harm, as sentences.
        damage: In the rest; None without any.
    """

    history: DocumentHistory
    step: int
    n_replayed: int = 0
    journal: JournalFile | None = None
    schema: int = 2
    notes: tuple[str, ...] = ()
    damage: ProjectError | None = None


def journal_path(folder: Path, step: int) -> Path:
    """The file of the journal that continues from a step. folder: Of the project."""
    return folder / JOURNAL_FOLDER / f"{step:08d}{_SUFFIX}"


def journal_steps(folder: Path) -> list[int]:
    """Steps from which files of the journal continue, rising."""
    found = [path.name.removesuffix(_SUFFIX) for path in (folder / JOURNAL_FOLDER).glob(f"*{_SUFFIX}")]
    return sorted(int(name) for name in found if name.isascii() and name.isdecimal() and len(name) >= 8)


def replayed(folder: Path) -> Replayed:
    """The current document. Another process may be writing.

    Raises:
        ProjectError: Something is damaged or missing; nothing was changed.
    """
    while True:
        stored, steps = read_stored(folder), journal_steps(folder)
        found = replayed_from(folder, stored)
        if found.damage is None:
            return found
        if read_stored(folder).step == stored.step and journal_steps(folder) == steps:
            raise found.damage  # else files came or went while they were read


def replayed_from(folder: Path, stored: StoredDocument) -> Replayed:
    """Likewise, up to the first damage, from a document at some step. Raises nothing."""
    replay = _Replay(folder, stored)
    damage = None
    try:
        replay.run()
    except ProjectError as error:
        damage = error
    return Replayed(
        replay.history,
        replay.step,
        replay.step - stored.step,
        None if damage is not None else replay.journal,
        stored.schema,
        tuple(replay.notes),
        damage,
    )


class _Replay:
    def __init__(self, folder: Path, stored: StoredDocument) -> None:
        self.folder, self.stored = folder, stored
        self.notes: list[str] = []
        self.history, self.step = DocumentHistory(stored.document), stored.step
        self.journal: JournalFile | None = None
        self._is_edited = False
        self._kept = self._kept_history()
        self._take_history()

    # ---------------------------------------------------------------- history

    def _kept_history(self) -> StoredHistory | None:
        try:
            kept = read_history(self.folder)
        except ProjectError as error:
            self.notes.append(f"{error.message} Steps before step {self.step} cannot be undone.")
            return None
        is_missing = self.stored.step > 0 and (kept is None or kept.step < self.stored.step)
        if is_missing:
            self.notes.append(f"The file of the steps before step {self.step} is missing; they cannot be undone.")
        return None if is_missing else kept

    def _take_history(self) -> None:
        """The way back, where the file that holds it belongs to this step."""
        kept = self._kept
        if kept is None or kept.step != self.step:
            return
        self._kept = None
        is_same = kept.document == self.stored.checksum if self.step == self.stored.step else True
        try:
            if not is_same:
                raise ProjectError("The undo history belongs to another document.")
            self.history = history_of(self.history.present, kept)
        except ProjectError as error:
            self.notes.append(f"{error.message} Steps before step {self.step} cannot be undone.")

    # ---------------------------------------------------------------- journal

    def run(self) -> None:
        """Replay all that follows. Raises ProjectError at the first damage."""
        steps = journal_steps(self.folder)
        journal = self.folder / JOURNAL_FOLDER
        if os.path.lexists(journal) and not journal.is_dir():
            raise JournalDamage("The journal of the project is not a folder.", path=journal)
        if self.stored.schema == 1:
            if steps:
                raise self._damage("It was written by a version without a journal, but there is one")
            return
        before = [step for step in steps if step <= self.step]
        if not before:
            if steps:
                raise self._damage(f"It holds step {self.step}, and the journal begins with step {steps[0]}")
            self.notes.append(f"The journal is missing; if something was changed after step {self.step}, it is lost.")
            return
        files = self._files([before[-1], *(step for step in steps if step > self.step)])
        last: JournalFile | None = None
        for file, damage in files:
            if last is None:
                self._check_begin(file)
            elif file.start != self.step or file.after != last.links[-1]:
                raise JournalDamage(
                    f"The journal of the project has a gap: after step {self.step}, the next file continues from step "
                    f"{file.start}.",
                    path=file.path,
                )
            self._play(file)
            if damage is not None:
                raise damage
            last = file
        assert last is not None
        if last.is_left:
            raise JournalDamage(f"A file of the journal is missing, after step {self.step}.", path=last.path)
        if last.stop < self.stored.step:
            raise JournalDamage(
                f"The journal ends with step {last.stop}, before step {self.stored.step} of the project file.",
                path=last.path,
            )
        if not last.is_whole:
            self.notes.append(f"The journal breaks off after step {self.step}: {_missing(last.n_missing)}.")
        self.journal = None if self._is_edited or not last.can_go_on else last

    def _files(self, steps: list[int]) -> Iterator[tuple[JournalFile, JournalDamage | None]]:
        for step in steps:
            yield read_journal(journal_path(self.folder, step))

    def _check_begin(self, file: JournalFile) -> None:
        if file.start == self.stored.step and file.document != self.stored.checksum:
            if self.stored.checksum or file.rows:
                raise self._damage(f"It is not the document that the journal continues from at step {self.step}")
            self._is_edited = True  # by hand, and nothing has happened since it was written
        if file.start < self.stored.step and not self.stored.checksum:
            raise self._damage("It was edited by hand while the journal held steps that it does not have")

    def _damage(self, what: str) -> JournalDamage:
        return JournalDamage(f"The project file does not fit its journal. {what}.", path=self.folder / PROJECT_FILE)

    def _play(self, file: JournalFile) -> None:
        for number, row in enumerate(file.rows, start=file.n_head + 1):
            if row["step"] <= self.step:
                continue
            try:
                self.history = history_after(self.history, row)
            except (PatchError, ProjectError) as error:
                reason = error.message if isinstance(error, ProjectError) else str(error)
                raise JournalDamage(
                    f"The journal of the project is damaged. Line {number} does not fit ({reason}). "
                    f"Everything up to step {self.step} can be read.",
                    path=file.path,
                ) from error
            self.step = row["step"]
            self._take_history()


def _missing(n: int | None) -> str:
    match n:
        case None:
            return "the last steps are missing; how many is unknown"
        case 0:
            return "the last step was not written completely"
        case 1:
            return "1 later step is missing"
        case _:
            return f"{n} later steps are missing"


# ---------------------------------------------------------------- events


def row_of(event: Event, before: DocumentHistory, step: int) -> Row:
    """An event as a line of the journal. The results of undo and redo are written, too, so that the document never
    depends on the history file.

    Args:
        event: Its merge key is a text.
        before: The document before it.
        step: Its number.
    Raises:
        ProjectError: A changed value cannot be kept.
    """
    after = before.after(event).present
    match event:
        case Changed(name=name, merge=merge):
            row: Row = {"step": step, "do": "change", "name": name} | ({} if merge is None else {"merge": merge})
        case Undone():
            row = {"step": step, "do": "undo", "name": before.undo_name}
        case Redone():
            row = {"step": step, "do": "redo", "name": before.redo_name}
        case Placed(settings=settings):
            place: Row = {"capture": settings.capture, "follow_links": settings.follow_links}
            if settings.is_growing and settings.frames is not None:
                place["frames"] = list(settings.frames)
            return {"step": step, "do": "place", **place}
        case ObjectFound(object_id=object_id):
            row = {"step": step, "do": "find", "object": object_id}
    return {**row, "patch": document_difference(before.present, after)}


def history_after(history: DocumentHistory, row: Row) -> DocumentHistory:
    """The history after the event of a line.

    Raises:
        PatchError: The line holds something else.
        ProjectError: A value is not valid.
    """
    before = history.present
    known = {name: value for name, value in row.items() if name not in ("step", "do")}
    match row.get("do"), known:
        case "place", {"capture": str(capture), "follow_links": bool(follow_links), **rest} if not rest:
            return history.after(Placed(replace(before.settings, capture=capture, follow_links=follow_links)))
        case (
            "place",
            {"capture": str(capture), "follow_links": bool(follow_links), "frames": [int(first), int(stop)], **rest},
        ) if not rest and 0 <= first < stop:
            place = {"capture": capture, "follow_links": follow_links, "frames": (first, stop)}
            return history.after(Placed(replace(before.settings, **place)))
        case "change", {"name": str(name), "patch": patch, **rest} if rest.keys() <= {"merge"}:
            merge = rest.get("merge")
            if merge is not None and not isinstance(merge, str):
                raise PatchError("a merge key is not a text")
            return history.after(Changed(name, document_with(before, patch), merge))
        case "find", {"object": int(object_id), "patch": patch, **rest} if not rest:
            found = next((one for one in document_with(before, patch).objects if one.object_id == object_id), None)
            if found is None:
                raise PatchError("an object was found that is not there")
            return history.after(ObjectFound(object_id, found.seeds, found.clips))
        case "undo" | "redo" as do, {"name": str(name), "patch": patch, **rest} if not rest:
            return _gone_along(history, document_with(before, patch), name, is_undo=do == "undo")
    raise PatchError("it is not an event")


def _gone_along(history: DocumentHistory, present: ProjectDocument, name: str, *, is_undo: bool) -> DocumentHistory:
    """The history after an undo or redo that leads to a document. Where the way that it goes is not known, because the
    file that held it is damaged or of a later step, it is known from there on."""
    event = Undone() if is_undo else Redone()
    if history.past if is_undo else history.future:
        return replace(history.after(event), present=present)
    if present == history.present:
        return history
    step = Step(name, history.present)
    if is_undo:
        return DocumentHistory(present, (), (*history.future, step))
    return DocumentHistory(present, (*history.past, step), ())
