"""DocumentStore: the document of a project folder and its history, on disk.

Every event is added to the journal, for good, before it counts. Now and then a new file of the journal begins, and
project.json and history.json are written anew: on a thread, so that no event waits for it. The previous file
and project.json stay until the next time, so that nothing is lost where the system loses a write that it confirmed.
No clock is used.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from app.document.capture_place import found_place, stored_place, with_capture
from app.document.history import Changed, DocumentHistory, Event, Placed, coalesced
from app.document.project_document import ProjectDocument
from app.document.storing.document_file import RESTORE, DamagedDocument, document_text, write_document_text
from app.document.storing.history_file import write_history
from app.document.storing.journal_file import JournalDamage, append_rows, create_journal, leave_journal
from app.document.storing.replay import Replayed, journal_path, journal_steps, replayed, row_of
from engine.errors import EngineError
from engine.storage.files import disk_error

logger = logging.getLogger(__name__)

MAX_EVENTS, MAX_JOURNAL_BYTES = 200, 8 << 20
"""Of one file of the journal; then project.json is written anew."""
WRITING_S = 20.0
"""A disk that takes longer than this to write it is not waited for."""


class DocumentStore:
    """For any thread; one store of one process at a time may write.

    Args:
        folder: Of the project.
        place: Where that folder will lie; None where it lies there already.

    Attributes:
        n_replayed, notes: See Replayed; as of the last time that the files were read.
    """

    def __init__(self, folder: Path, *, place: Path | None = None) -> None:
        self.folder = folder
        self._place = place or folder
        self.n_replayed = 0
        self.notes: tuple[str, ...] = ()
        self._known: Replayed | None = None
        """Contents of the files; None where they have to be read first."""
        self._session: int | None = None
        self._stored_step = 0
        """Of project.json."""
        self._writing: threading.Thread | None = None
        """Writes project.json anew."""
        self._lock = threading.RLock()

    # ---------------------------------------------------------------- reading

    def read(self) -> DocumentHistory:
        """The contents of the project.

        Raises:
            JournalDamage, DamagedDocument: Something is damaged; see app.document.storing.recovery.
            ProjectError: The folder is not a project, or of a newer schema.
        """
        self._wait_for_writing()
        with self._lock:
            return self._read()

    def _read(self) -> DocumentHistory:
        self._known = self._session = None
        try:
            known = self._known = replayed(self.folder)
        except (JournalDamage, DamagedDocument) as error:
            if error.hint in ("", RESTORE):
                raise type(error)(error.message, hint=self._repair_hint, path=error.path) from error
            raise
        self.n_replayed, self.notes = known.n_replayed, known.notes
        self._stored_step = known.step - known.n_replayed
        for note in known.notes:
            logger.warning("%s: %s", self.folder, note)
        return known.history.each(self._found)

    @property
    def _repair_hint(self) -> str:
        return f'"clipgstream repair {self.folder}" shows what can be kept.'

    def _found(self, document: ProjectDocument) -> ProjectDocument:
        return with_capture(document, lambda capture: found_place(capture, self._place))

    def _stored(self, document: ProjectDocument) -> ProjectDocument:
        return with_capture(document, lambda capture: stored_place(capture, self._place))

    # ---------------------------------------------------------------- writing

    def create(self, document: ProjectDocument) -> None:
        """Make the files of a new project. Raises what `write` raises."""
        self.begin(DocumentHistory(document), step=0)

    def begin(self, history: DocumentHistory, *, step: int, is_backup_kept: bool = True) -> None:
        """Write everything anew, at a step that no file of the journal reaches. Raises what `write` raises.

        Args:
            is_backup_kept: Whether project.json is sound, so that it may become the backup.
        """
        self._wait_for_writing()
        with self._lock:
            self._begin(Replayed(history.each(self._stored), step), is_backup_kept=is_backup_kept)

    def write(self, events: Sequence[Event], history: DocumentHistory) -> None:
        """Keep events for good.

        Args:
            events: Since the last call, in order.
            history: After the events; the files lead to the same one by the same rules.
        Raises:
            ProjectError: The document cannot be kept.
            DiskError: The disk refused; events kept before stay.
        """
        if events:
            with self._lock:
                self._write(events)

    def _write(self, events: Sequence[Event]) -> None:
        if self._known is None:
            self._read()
        known = self._known
        assert known is not None
        if self._session is None:
            self._session = known.step
        self._known = None  # after any failure the files have to be read again
        kept, rows, step = known.history, [], known.step
        for event in map(self._to_store, coalesced(events)):
            step += 1
            rows.append(row_of(event, kept, step))
            kept = kept.after(event)
        if known.journal is None:  # of an earlier schema, or its journal is gone
            self._begin(replace(known, history=kept, step=step))
            return
        try:
            journal = append_rows(known.journal, rows)
        except OSError as error:
            raise disk_error(error, what="The project", path=known.journal.path) from error
        self._known = replace(known, history=kept, step=step, journal=journal)
        if len(journal.rows) >= MAX_EVENTS or journal.n_bytes > MAX_JOURNAL_BYTES:
            self._begin_beside()

    def compact(self) -> None:
        """Write project.json anew where the journal holds something. Where that fails, or somebody else is at work,
        the journal stays."""
        if self._wait_for_writing() and self._lock.acquire(blocking=False):
            try:
                self._compact()
            finally:
                self._lock.release()

    def _compact(self) -> None:
        known = self._known
        if known is None or known.journal is None or known.step == self._stored_step:
            return
        try:
            self._begin(known)
        except EngineError as error:
            logger.warning("the project file could not be rewritten: %s", error)
            self._known = known

    def _to_store(self, event: Event) -> Event:
        """An event with the capture as stored in the files, and with merge keys as text."""
        assert self._session is not None
        match event:
            case Changed(document=document, merge=merge):
                text = None if merge is None else f"{self._session}: {merge!r}"  # other sessions have the same keys
                return replace(event, document=self._stored(document), merge=text)
            case Placed(settings=settings):
                place = stored_place(settings.capture, self._place)
                return Placed(replace(settings, capture=place))
            case _:
                return event

    def _begin(self, known: Replayed, *, is_backup_kept: bool = True) -> None:
        """Write the document and its history, then begin a file of the journal; the files before stay."""
        folder, step = self.folder, known.step
        before = known.journal
        try:
            journal_path(folder, step).parent.mkdir(exist_ok=True)
            text = document_text(known.history.present, step)
            if step > 0:  # a new project has none
                write_history(folder, known.history, step=step, document=text.checksum)
            write_document_text(folder, text, is_backup_kept=is_backup_kept)
            journal = before
            if before is None or before.start != step:  # else it has begun already, see _begin_beside
                after = "" if before is None else before.links[-1]
                journal = create_journal(journal_path(folder, step), step, document=text.checksum, after=after)
        except OSError as error:
            raise disk_error(error, what="The project", path=folder) from error
        if before is not None and before is not journal:
            with suppress(OSError):
                leave_journal(before)
        self._known = replace(known, journal=journal, schema=2)
        self._forget_journals(step if before is None else self._stored_step)
        self._stored_step = step

    def _begin_beside(self) -> None:
        """Begin a file of the journal, and have a thread write the document and its history. Until that is done, or
        where it fails, the files of the journal lead from the project.json before to the same. Not while it still
        writes: then this file of the journal becomes longer."""
        known = self._known
        assert known is not None
        before = known.journal
        if before is None or self._is_writing:
            return
        folder, step = self.folder, known.step
        try:
            text = document_text(known.history.present, step)
            path = journal_path(folder, step)
            journal = create_journal(path, step, document=text.checksum, after=before.links[-1])
            with suppress(OSError):
                leave_journal(before)
        except (EngineError, OSError) as error:
            logger.warning("no file of the journal could be begun: %s", error)
            return
        self._known = replace(known, journal=journal, schema=2)

        def write_anew() -> None:
            try:
                write_history(folder, known.history, step=step, document=text.checksum)
                write_document_text(folder, text)
            except (EngineError, OSError) as error:
                logger.warning("the project file could not be rewritten: %s", error)
                return
            self._forget_journals(self._stored_step)
            self._stored_step = step

        self._writing = threading.Thread(target=write_anew, name="project file")
        self._writing.start()

    @property
    def _is_writing(self) -> bool:
        return self._writing is not None and self._writing.is_alive()

    def _wait_for_writing(self) -> bool:
        """Whether nothing writes project.json any more; a disk that takes longer than this is not waited for."""
        if self._writing is not None:
            self._writing.join(WRITING_S)
        return not self._is_writing

    def _forget_journals(self, backup_step: int) -> None:
        """Remove files of the journal that do not follow the backup of project.json, which is of this step."""
        steps = journal_steps(self.folder)
        first = max((step for step in steps if step <= backup_step), default=0)
        for old in steps:
            if old < first:
                with suppress(OSError):
                    journal_path(self.folder, old).unlink()
