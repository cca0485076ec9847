"""Several clip files exchanged at once: all of them, or none, whenever the program is killed.

PROJECT/exchange/ takes the new files under the names of the clips. Once all of them lie there, exchange.json next to
them says so, and from then on the exchange is carried out: now, or when the project is opened for writing next.
Without that file nothing has happened yet, and the folder is removed.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from app.document.storing.kept_json import kept_text, read_kept, write_kept
from app.project.clips.clip_names import is_clip_file
from engine.errors import ProjectError
from engine.storage.files import disk_error, replace_file

EXCHANGE = "exchange"
LIST_FILE = "exchange.json"
logger = logging.getLogger(__name__)


def begin_exchange(folder: Path) -> Path:
    """An empty folder for the new files. folder: Of the project.

    Raises:
        DiskError: The disk refused.
    """
    place = folder / EXCHANGE
    try:
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
    except OSError as error:
        raise disk_error(error, what="The new clips", path=place) from error
    return place


def give_up_exchange(folder: Path) -> None:
    """Forget new files that were not exchanged."""
    if not (folder / EXCHANGE / LIST_FILE).exists():
        shutil.rmtree(folder / EXCHANGE, ignore_errors=True)


def exchange(folder: Path, names: Sequence[str]) -> None:
    """Put the new files in the places of the clips.

    Args:
        folder: Of the project.
        names: Of the files in the folder of new files.
    Raises:
        DiskError: The disk refused. Where it did so after the exchange had begun, opening the project again ends it.
    """
    write_kept(folder / EXCHANGE / LIST_FILE, kept_text({"files": list(names)}))
    finish_exchange(folder)


def finish_exchange(folder: Path) -> None:
    """Carry out an exchange that was decided; forget one that was not.

    Raises:
        DiskError: The disk refused; nothing is lost.
        ProjectError: The list is damaged.
    """
    place = folder / EXCHANGE
    if not place.is_dir():
        return
    content = read_kept(place / LIST_FILE, "The list of exchanged clips", hint="Remove the folder 'exchange'.")
    names = [] if content is None else content.get("files")
    if not isinstance(names, list) or not all(isinstance(name, str) and is_clip_file(name) for name in names):
        raise ProjectError(
            "The list of exchanged clips is damaged.", hint="Remove the folder 'exchange'.", path=place / LIST_FILE
        )
    try:
        for name in names:
            if (place / name).is_file():
                replace_file(place / name, folder / "clips" / name, is_durable=True)
    except OSError as error:
        raise disk_error(error, what="The clip", path=folder / "clips") from error
    if names:
        logger.info("exchanged %d clips of %s", len(names), folder)
    remove_list(place)  # until then it can be done again
    shutil.rmtree(place, ignore_errors=True)


def remove_list(place: Path) -> None:
    """The exchange is done."""
    with suppress(OSError):
        (place / LIST_FILE).unlink(missing_ok=True)
