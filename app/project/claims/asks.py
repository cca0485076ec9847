"""What others ask of the holder of a claim: PROJECT/claims/ask-0003.json, read and removed by the holder."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Literal, get_args

from app.project.claims.claim_files import CLAIMS
from engine.storage.files import atomic_path, disk_error
from engine.storage.json_files import JsonError, json_text, read_json_object

Ask = Literal["pause", "resume", "stop"]
"""Hold the training, resume it, or end it and keep progress."""
_ASKS: dict[str, Ask] = {ask: ask for ask in get_args(Ask)}
_MAX_BYTES = 1000


def ask_holder(folder: Path, key: str, ask: Ask) -> None:
    """Ask whoever trains a clip. A later request replaces an earlier one that was not read yet.

    Raises:
        DiskError: The disk refused.
    """
    path = folder / CLAIMS / f"ask-{key}.json"
    try:
        with atomic_path(path, makes_parents=False) as partial:
            partial.write_text(json_text({"do": ask}), encoding="utf-8")
    except OSError as error:
        raise disk_error(error, what="The request", path=path) from error


def take_ask(folder: Path, key: str) -> Ask | None:
    """What is asked of the holder of a clip; each request is given once. folder: Of the project."""
    path, ask = folder / CLAIMS / f"ask-{key}.json", None
    try:
        ask = _ASKS.get(str(read_json_object(path, max_bytes=_MAX_BYTES).get("do")))
    except FileNotFoundError:
        return None
    except (OSError, JsonError):
        pass
    drop_ask(folder, key)
    return ask


def drop_ask(folder: Path, key: str) -> None:
    """Forget what was asked of whoever trained a clip. Never fails."""
    with suppress(OSError):
        (folder / CLAIMS / f"ask-{key}.json").unlink(missing_ok=True)
