"""Making room: which files of a project can go, what that frees, and what is lost by it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.project.clips.clip_versions import list_versions, version_path
from app.project.disk.use import unused_files
from app.project.project import Project
from engine.errors import ProjectError
from engine.storage.files import disk_error
from engine.training.preparation.stages import stage_files

WHAT = {
    "oldest": "the oldest version of every clip",
    "versions": "all earlier versions",
    "checkpoints": "progress of stopped trainings",
    "unused": "clips of other cuts, and damaged files that were put aside",
}
"""Kinds of files that can be freed, in words."""


@dataclass(frozen=True, slots=True)
class Room:
    """Files that can be deleted.

    Attributes:
        paths: The files.
        n_bytes: Their size.
        n_clips: Number of files that hold a clip or the progress of one.
    """

    paths: tuple[Path, ...] = ()
    n_bytes: int = 0
    n_clips: int = 0


def room_of(project: Project, n_clips: int, what: str, clip_index: int | None = None) -> Room:
    """The files that would be deleted.

    Args:
        project: May be read-only.
        n_clips: Of the capture.
        what: A name of WHAT.
        clip_index: Only files of this clip; None for all. "unused" belongs to none.
    Raises:
        ValueError: There is no such name.
        ProjectError: There is no such clip.
    """
    if what not in WHAT:
        raise ValueError(f"what can be freed is {', '.join(WHAT)}, not {what!r}")
    if clip_index is not None and not 0 <= clip_index < n_clips:
        raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {n_clips - 1}.")
    chosen = range(n_clips) if clip_index is None else (clip_index,)
    if what == "unused":
        paths = [] if clip_index is not None else unused_files(project, n_clips)
    elif what == "checkpoints":
        paths = [path for index in chosen for path in _unfinished(project, index)]
    else:
        paths = []
        for index in chosen:
            numbers = [version.number for version in list_versions(project, index)]
            for number in numbers[-1:] if what == "oldest" else numbers:
                path = version_path(project, index, number)
                paths += [path.with_suffix(".jsonl"), path]
    sizes: list[int] = []
    there: list[Path] = []
    for path in paths:
        with suppress(OSError):
            sizes.append(path.stat().st_size)
            there.append(path)
    return Room(tuple(there), sum(sizes), sum(path.suffix == ".safetensors" for path in there))


def make_room(project: Project, room: Room) -> int:
    """Delete it for good. Returns the bytes that are free now; what is gone already counts nothing.

    Raises:
        ProjectError: The project is read-only.
        DiskError: The disk refused; what was not deleted by then is still there.
    """
    project.check_writable()
    freed = 0
    for path in room.paths:
        try:
            n_bytes = path.stat().st_size
            path.unlink()
            freed += n_bytes
        except FileNotFoundError:
            continue
        except OSError as error:
            raise disk_error(error, what="The removal of a file", path=path) from error
        with suppress(OSError):  # others are left
            if path.parent.parent.name == "versions":
                path.parent.rmdir()
    return freed


def _unfinished(project: Project, clip_index: int) -> list[Path]:
    stages = stage_files(project.prep_dir, clip_index)
    return [project.checkpoint_path(clip_index), project.unfinished_metrics_path(clip_index), *stages]
