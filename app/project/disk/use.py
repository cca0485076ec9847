"""A project's disk use: of each clip, its versions and checkpoint, and what all clips share."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.project.clips.clip_names import PROGRAM_NAME
from app.project.clips.clip_versions import DAMAGED
from app.project.project import Project


@dataclass(frozen=True, slots=True)
class ClipUse:
    """Bytes of one clip.

    Attributes:
        clip: The finished clip with its curves.
        versions: Its earlier results, with curves.
        n_versions: Number of versions.
        checkpoint: Its unfinished training, with curves and the pieces of its preparation.
    """

    clip: int = 0
    versions: int = 0
    n_versions: int = 0
    checkpoint: int = 0

    @property
    def total(self) -> int:
        """All of it."""
        return self.clip + self.versions + self.checkpoint


@dataclass(frozen=True, slots=True)
class DiskUse:
    """Bytes of a project's folder.

    Attributes:
        clips: One per clip of the project, in order.
        unused: Clips, versions and checkpoints under names that no clip has now: those of other cuts of the capture,
            and damaged files that were put aside.
        n_unused: Files among them that hold a clip.
        preparation: Files that clips share, such as backgrounds.
        other: Settings, logs, figures and whatever else lies in the folder.
    """

    clips: tuple[ClipUse, ...] = ()
    unused: int = 0
    n_unused: int = 0
    preparation: int = 0
    other: int = 0

    @property
    def versions(self) -> int:
        """Of all clips."""
        return sum(clip.versions for clip in self.clips)

    @property
    def n_versions(self) -> int:
        """Of all clips."""
        return sum(clip.n_versions for clip in self.clips)

    @property
    def total(self) -> int:
        """All of it."""
        return sum(clip.total for clip in self.clips) + self.unused + self.preparation + self.other


def disk_use(project: Project, n_clips: int) -> DiskUse:
    """Look at every file of the project's folder. What cannot be looked at counts nothing; a file under two names
    counts once, where the finished clip is.

    Args:
        project: May be read-only.
        n_clips: Number of clips of the capture.
    """
    names = {project.clip_name(index): index for index in range(n_clips)}
    unused = set(unused_files(project, n_clips))
    parts: dict[str, list[int]] = {"clips": [0] * n_clips, "versions": [0] * n_clips, "checkpoints": [0] * n_clips}
    n_versions = [0] * n_clips
    n_unused_bytes = n_unused = preparation = other = 0
    for path, n_bytes in files_of(project.folder, set()):
        place = path.relative_to(project.folder).parts
        part, index = _owner(place, names)
        is_clip = path.suffix == ".safetensors"
        if path in unused:
            n_unused_bytes += n_bytes
            n_unused += is_clip
        elif index is not None and index < n_clips:
            parts[part][index] += n_bytes
            n_versions[index] += part == "versions" and is_clip
        elif place[0] == "prep":
            preparation += n_bytes
        else:
            other += n_bytes
    rows = zip(parts["clips"], parts["versions"], n_versions, parts["checkpoints"], strict=True)
    return DiskUse(tuple(ClipUse(*row) for row in rows), n_unused_bytes, n_unused, preparation, other)


def _owner(place: Sequence[str], names: dict[str, int]) -> tuple[str, int | None]:
    """Which part of which clip a file is, if of any. place: Names of folders and of the file inside the project."""
    top, last = place[0], place[len(place) - 1]
    name = last.partition(".")[0]
    if top == "prep" and name.startswith("clip-"):  # pieces of a preparation are kept by the index of the clip
        number = name.removeprefix("clip-").partition("-")[0]
        return "checkpoints", int(number) if number.isdecimal() else None
    if top == "versions" and len(place) > 2:
        return "versions", names.get(place[1])
    if top == "checkpoints" or (top == "metrics" and last.endswith(".unfinished.jsonl")):
        return "checkpoints", names.get(name)
    return "clips", names.get(name) if top in ("clips", "metrics") else None


def unused_files(project: Project, n_clips: int) -> list[Path]:
    """Files of clips that are not in use: of other cuts of the capture, and damaged ones that were put aside. Only what
    has a name that this program gives: what somebody else put there is nobody's business.

    Args:
        project: May be read-only.
        n_clips: Number of clips of the capture.
    """
    names = {project.clip_name(index) for index in range(n_clips)}
    found = [path for path, _ in files_of(project.folder / DAMAGED, set()) if path.suffix == ".safetensors"]
    for folder in ("clips", "checkpoints", "metrics", "versions"):
        for path, _ in files_of(project.folder / folder, set()):
            name = path.parent.name if folder == "versions" else path.name.partition(".")[0]
            if name not in names and PROGRAM_NAME.fullmatch(name):
                found.append(path)
    return sorted(found)


def files_of(folder: Path, seen: set[tuple[int, int]]) -> Iterator[tuple[Path, int]]:
    """Regular files under a folder with their sizes, bytes; links are not followed.

    Args:
        folder: The folder to search.
        seen: Device and number of files that were counted already; those found are added.
    """
    entries: list[os.DirEntry[str]] = []
    with suppress(OSError), os.scandir(folder) as found:
        entries = sorted(found, key=lambda entry: entry.name)
    for entry in entries:
        with suppress(OSError):
            if entry.is_dir(follow_symlinks=False):
                yield from files_of(Path(entry.path), seen)
            elif entry.is_file(follow_symlinks=False):
                known = entry.stat(follow_symlinks=False)
                if (known.st_dev, known.st_ino) not in seen:
                    seen.add((known.st_dev, known.st_ino))
                    yield Path(entry.path), known.st_size
