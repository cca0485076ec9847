"""What others ask of the holder of a claim: PROJECT/claims/ask-0003.json, read and removed by the holder."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import Literal, get_args

from app.project.claims.claim_files import CLAIMS
from app.project.clips.clip_names import PROGRAM_NAME
from engine.storage.files import atomic_path, disk_error
from engine.storage.json_files import JsonError, json_text, read_json_object

Ask = Literal["pause", "resume", "stop", "look"]
"""Hold the training, resume it, end it and keep progress; or show it, for somebody looks at its clip now."""
_ASKS: dict[str, Ask] = {ask: ask for ask in get_args(Ask)}
_NAME = re.compile(r"ask-(?P<key>[\d-]{4,19})\.json")
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


def take_asks(folder: Path, names: list[str], held: set[str]) -> list[tuple[str, Ask]]:
    """What is asked of the holder of these clips; each request is given once.

    Args:
        folder: Of the project.
        names: Of all files in its folder of claims.
        held: Keys of the clips.
    """
    asked: list[tuple[str, Ask]] = []
    for name in names:
        match = _NAME.fullmatch(name)
        if match is None or match["key"] not in held or not PROGRAM_NAME.fullmatch(match["key"]):
            continue
        path = folder / CLAIMS / name
        with suppress(OSError, JsonError):
            ask = _ASKS.get(str(read_json_object(path, max_bytes=_MAX_BYTES).get("do")))
            if ask is not None:
                asked.append((match["key"], ask))
        with suppress(OSError):
            path.unlink(missing_ok=True)
    return asked


def drop_ask(folder: Path, key: str) -> None:
    """Forget what was asked of whoever trained a clip. Never fails."""
    with suppress(OSError):
        (folder / CLAIMS / f"ask-{key}.json").unlink(missing_ok=True)
