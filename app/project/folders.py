"""The folders of a project, none of which is a link: what the program removes and replaces in them lies inside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from app.document.storing.replay import JOURNAL_FOLDER
from app.project.claims.claim_files import CLAIMS
from app.project.clips.clip_names import PROGRAM_NAME
from engine.errors import ProjectError
from engine.storage.files import check_folder

VERSIONS = "versions"
FOLDERS = (
    "clips",
    "mends",
    VERSIONS,
    "damaged",
    "checkpoints",
    "live",
    "prep",
    "metrics",
    "logs",
    "evaluations",
    "exchange",
    CLAIMS,
    JOURNAL_FOLDER,
)


def check_folders(folder: Path, doing: str = "written to") -> None:
    """Check that a project may be written to, or copied.

    Args:
        folder: Of the project, which may be a link itself.
        doing: The action to be taken, for the message.
    Raises:
        ProjectError: One of its folders is a symbolic link, or no folder at all.
    """
    for path in _folders(folder):
        try:
            check_folder(path)
        except NotADirectoryError as error:
            if path.name != JOURNAL_FOLDER:  # whose reader says so, and which can be repaired
                raise _refused(folder, path, error, doing) from error
        except OSError as error:
            raise _refused(folder, path, error, doing) from error


def _refused(folder: Path, path: Path, error: OSError, doing: str) -> ProjectError:
    return ProjectError(
        f'The project cannot be {doing}: its folder "{path.relative_to(folder)}" cannot be used '
        f"({error.strerror or error}).",
        hint="Put a folder in its place. To keep a project on another disk, link the whole project folder.",
        path=path,
    )


def _folders(folder: Path) -> Iterator[Path]:
    for name in FOLDERS:
        yield folder / name
    with suppress(OSError):
        yield from (path for path in (folder / VERSIONS).iterdir() if PROGRAM_NAME.fullmatch(path.name))
