"""Where the files of a capture may lie: inside its folder, unless the user has said that links may lead elsewhere."""

from __future__ import annotations

import os
from pathlib import Path

from engine.errors import CaptureError, OutsideError
from engine.text import shown

MAX_NAME_BYTES = 1024
"""Longest file name with its folders that a capture may use."""
_ALLOW = (
    "Copy the files into the folder. If you trust this capture, open it with `clipgstream PATH --follow-links`; "
    "inspect and train take that option too, and projects keep it."
)


def place_in(folder: Path, name: str, *, follow_links: bool, named_in: Path) -> Path:
    """Path of a file or folder that a capture names.

    Args:
        folder: The capture folder.
        name: As the capture has it, relative to the folder.
        follow_links: Whether it may lie outside of the folder.
        named_in: The file that has the name, for the message.
    Raises:
        CaptureError: The name is empty or no file name.
        OutsideError: It leads out of the folder.
    """
    hint = "Name a file inside the capture folder."
    if not name.strip():
        raise CaptureError("A file name is empty.", hint=hint, path=named_in)
    try:
        n_bytes = len(os.fsencode(name))
    except UnicodeEncodeError:
        n_bytes = 0
    if n_bytes == 0 or n_bytes > MAX_NAME_BYTES or "\0" in name:
        raise CaptureError(f"{shown(name)} is not a file name.", hint=hint, path=named_in)
    path = folder / name
    if follow_links:
        return path
    root, target = os.path.realpath(folder), os.path.realpath(path)
    if target == root or os.path.commonpath((root, target)) != root:
        direct = os.path.normpath(os.path.join(root, name))
        is_link = direct.startswith(os.path.join(root, ""))
        how = f"is a link that leads out of the capture folder, to {target}" if is_link else "is not inside its folder"
        raise OutsideError(f"{shown(name)} {how}.", hint=_ALLOW, path=path if is_link else named_in)
    return path
