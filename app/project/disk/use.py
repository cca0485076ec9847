"""What a project takes on the disk: of each clip, its versions and checkpoint, and what all clips share."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from app.project.project import Project


@dataclass(frozen=True, slots=True)
class ClipUse:
    """Bytes of one clip.

    Attributes:
        clip: The finished clip with its curves.
        versions: What it was before, with curves.
        n_versions: How many of these there are.
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
        preparation: What clips share, such as backgrounds.
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
        n_clips: How many clips the capture has.
    """
    names = {project.clip_name(index): index for index in range(n_clips)}
    clips, versions, n_versions, checkpoints = ([0] * n_clips for _ in range(4))
    sums = {"unused": 0, "n_unused": 0, "preparation": 0, "other": 0}
    seen: set[tuple[int, int]] = set()
    for path, n_bytes in sorted(files_of(project.folder, seen), key=lambda found: found[0]):
        place = path.relative_to(project.folder).parts
        top, name = place[0], path.name.partition(".")[0]
        if top == "clips" or (top == "metrics" and not path.name.endswith(".unfinished.jsonl")):
            kind, index = clips, names.get(name)
        elif top == "versions" and len(place) > 2:
            kind, index = versions, names.get(place[1])
            if index is not None:
                n_versions[index] += path.suffix == ".safetensors"
        elif top in ("checkpoints", "metrics"):
            kind, index = checkpoints, names.get(name)
        elif top == "prep" and name.startswith("clip-"):
            kind, index = checkpoints, names.get(name.removeprefix("clip-").rpartition("-")[0])
        else:
            sums["preparation" if top == "prep" else "other"] += n_bytes
            continue
        if index is None:
            sums["unused"] += n_bytes
            sums["n_unused"] += path.suffix == ".safetensors" and top in ("clips", "versions")
        else:
            kind[index] += n_bytes
    uses = zip(clips, versions, n_versions, checkpoints, strict=True)
    return DiskUse(tuple(ClipUse(*use) for use in uses), **sums)


def files_of(folder: Path, seen: set[tuple[int, int]]) -> Iterator[tuple[Path, int]]:
    """Regular files under a folder with their sizes, bytes; links are not followed.

    Args:
        folder: Where to look.
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
