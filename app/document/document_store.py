"""DocumentStore: the document of a project folder and its history, on disk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from app.document.document_file import read_document, write_document
from app.document.history import DocumentHistory, Event


class DocumentStore:
    """For one thread at a time. folder: Of the project."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self) -> DocumentHistory:
        """What the project holds.

        Raises:
            ProjectError: It is missing or damaged.
        """
        return DocumentHistory(read_document(self.folder))

    def write(self, events: Sequence[Event], history: DocumentHistory) -> None:
        """Keep what has happened, for good.

        Args:
            events: What happened since the last call, in order.
            history: What has come of it.
        Raises:
            ProjectError: The document cannot be kept.
            DiskError: The disk refused; what was kept before stands.
        """
        if events:
            write_document(self.folder, history.present)
