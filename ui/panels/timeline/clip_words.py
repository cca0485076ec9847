"""Words for a clip and its state, the same everywhere in the window."""

from __future__ import annotations

from app.session.session_view import SessionView
from app.status import ClipStatus
from engine.capture.formats.imported import finished_word
from ui.style.numbers import format_count

STATE_WORDS: dict[str, str] = {
    "untrained": "not trained",
    "queued": "waiting",
    "preparing": "preparing",
    "training": "training",
    "paused": "paused",
    "stopped": "stopped",
    "trained": "trained",
    "failed": "failed",
    "stale": "out of date",
    "damaged": "damaged",
}


def is_imported(session: SessionView) -> bool:
    """Is the open scene one of another program, which nothing was trained for?"""
    return session.capture is not None and not session.capture.has_pictures


def state_words(state: str, session: SessionView) -> str:
    """A state as the user reads it."""
    if state == "trained":
        return finished_word(has_pictures=not is_imported(session))
    return STATE_WORDS.get(state, state)


def state_note(status: ClipStatus) -> str:
    """Details of a clip's state beyond its word; empty where the word is enough."""
    texts = [status.reason]
    if status.resume_step is not None and status.state in ("trained", "stale", "damaged"):
        texts.append(f"Retraining stopped at step {format_count(status.resume_step)}.")
    elif status.resume_step is not None and status.state in ("stopped", "failed"):
        texts.append(f"Training resumes at step {format_count(status.resume_step)}.")
    return " ".join(text for text in texts if text)


def clip_title(clip_index: int, reference_index: int) -> str:
    """A clip by its number; the reference clip says so."""
    return f"Clip {clip_index}" + (", reference" if clip_index == reference_index else "")
