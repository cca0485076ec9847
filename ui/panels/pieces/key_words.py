"""Words for the keys of a camera path."""

from __future__ import annotations

from app.session.edit_status import PathsStatus


def frame_words(frame: float) -> str:
    """A frame, with as many digits as it needs: 12, 12.5."""
    return f"{frame:.2f}".rstrip("0").rstrip(".")


def key_words(status: PathsStatus, index: int) -> str:
    """Which key of the chosen path, and when; numbers as people count."""
    keys = () if status.path is None else status.path.keys
    if index >= len(keys):
        return ""
    return f"Camera key {index + 1} of {len(keys)}, frame {frame_words(keys[index].frame)}"
