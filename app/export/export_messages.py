"""Messages between the window's process and the one that exports: small typed values, sent as JSON."""

from __future__ import annotations

from pathlib import Path

import msgspec

from app.export.export_progress import ExportProgress, ExportResult


class ExportGoesOn(msgspec.Struct, frozen=True, tag=True):
    """How far it is."""

    progress: ExportProgress


class ExportDone(msgspec.Struct, frozen=True, tag=True):
    """Everything is written."""

    result: ExportResult


class ExportStopped(msgspec.Struct, frozen=True, tag=True):
    """It was cancelled; nothing is left of it."""


class ExportFailed(msgspec.Struct, frozen=True, tag=True):
    """It could not be done; nothing is left of it."""

    message: str
    hint: str = ""


Ending = ExportDone | ExportStopped | ExportFailed
Event = ExportGoesOn | Ending

CANCEL = b"cancel"
"""The only command there is."""

_EVENTS = msgspec.json.Decoder(Event, dec_hook=lambda kind, text: Path(text) if kind is Path else text)


def encode(event: Event) -> bytes:
    """One message as JSON."""
    return msgspec.json.encode(event, enc_hook=str)


def decode_event(data: bytes) -> Event:
    """Inverse of `encode`. Raises msgspec.DecodeError."""
    return _EVENTS.decode(data)
