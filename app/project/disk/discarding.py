"""Results that other settings make worthless: all that is trained, or the progress of stopped trainings. Their names,
the time they took, and their removal.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.project.claims.left_over import check_unclaimed
from app.project.clips.clip_names import PROGRAM_NAME
from app.project.disk.room import Room, make_room
from app.project.disk.use import files_of
from app.project.project import Project
from engine.text import duration_text, size_text
from engine.training.preparation.stages import all_stage_files

MAX_LISTED = 3
"""Clips whose progress is stated with its step."""


_NO_ROOM = Room()


@dataclass(frozen=True, slots=True)
class Discarded:
    """Training that goes when settings change.

    Attributes:
        room: The files and their size.
        n_clips: Finished clips, damaged ones and those of other cuts of the capture included.
        n_versions: Earlier results of clips that were trained again.
        seconds: Duration of training the finished clips; None where nothing was recorded.
        progress: Of each training that was stopped: the name of its clip, the step and all steps; 0 and 0 where its
            checkpoint cannot be read.
    """

    room: Room = _NO_ROOM
    n_clips: int = 0
    n_versions: int = 0
    seconds: float | None = None
    progress: tuple[tuple[str, int, int], ...] = ()

    @property
    def words(self) -> str:
        """As part of a sentence: "2 trained clips (4:10 of training) and 1 earlier version, 3.1 MB"; empty for
        nothing."""
        parts = []
        if self.n_clips:
            took = "" if self.seconds is None else f" ({duration_text(self.seconds)} of training)"
            parts.append(f"{_counted(self.n_clips, 'trained clip')}{took}")
        if self.n_versions:
            parts.append(_counted(self.n_versions, "earlier version"))
        if self.progress:
            parts.append(self.progress_words)
        if not parts:
            return ""
        return f"{' and '.join(filter(None, (', '.join(parts[:-1]), parts[-1])))}, {size_text(self.room.n_bytes / 1e6)}"

    @property
    def progress_words(self) -> str:
        """Likewise of the trainings that were stopped alone: "the progress of clip 0 (step 331 of 720)"."""
        if len(self.progress) > MAX_LISTED:
            return f"the progress of {len(self.progress)} clips"
        told = [
            f"clip {name.lstrip('0') or '0'}" + (f" (step {step:,} of {n_steps:,})" if n_steps else "")
            for name, step, n_steps in self.progress
        ]
        return f"the progress of {' and '.join(filter(None, (', '.join(told[:-1]), told[-1])))}" if told else ""


def progress_of(project: Project) -> Discarded:
    """The trainings that were stopped. Reads headers of checkpoints only."""
    headers = [(path.stem, project.headers.read(path)) for path in _named(project.folder / "checkpoints")]
    known = [(name, found.header) for name, found in headers if found is not None]
    progress = tuple((name, header.step, header.n_steps) if header else (name, 0, 0) for name, header in known)
    stopped = [*_named(project.folder / "checkpoints"), *_named(project.folder / "metrics", ".unfinished.jsonl")]
    return Discarded(_room(stopped), progress=progress)


def training_of(project: Project) -> Discarded:
    """Everything that is trained, with versions, progress and records of mending. What clips share, such as
    backgrounds, stays: it says itself what it depends on."""
    clips = _named(project.folder / "clips")
    versions = [path for path, _ in files_of(project.folder / "versions", set()) if _is_version(path)]
    curves = _named(project.folder / "metrics", ".jsonl")
    records = [path for path, _ in files_of(project.folder / "mends", set()) if path.suffix == ".json"]
    stopped = progress_of(project)
    paths = [*stopped.room.paths, *all_stage_files(project.prep_dir), *records, *versions, *curves]
    # those that others inherit from last: whatever is left after a crash is still whole
    reference = project.reference_path
    paths += sorted(clips, key=lambda path: path == reference)
    known = [found.header for path in clips if (found := project.headers.read(path)) is not None]
    times = [header.figures.seconds for header in known if header and header.figures.seconds is not None]
    return Discarded(
        _room(dict.fromkeys(paths)),
        n_clips=len(clips),
        n_versions=sum(path.suffix == ".safetensors" for path in versions),
        seconds=sum(times) if times else None,
        progress=stopped.progress,
    )


def discard(project: Project, discarded: Discarded) -> None:
    """Delete it for good.

    Raises:
        ProjectError: The project is read-only, or somebody trains a clip of it.
        DiskError: The disk refused; what was not deleted by then is still there, and fits together.
    """
    check_unclaimed(project.folder)
    make_room(project, discarded.room)


def _named(folder: Path, ending: str = ".safetensors") -> list[Path]:
    """Files in a folder whose names the program gives."""
    found = [path for path, _ in files_of(folder, set()) if path.parent == folder and path.name.endswith(ending)]
    return [path for path in found if PROGRAM_NAME.fullmatch(path.name.partition(".")[0])]


def _is_version(path: Path) -> bool:
    return path.suffix in (".safetensors", ".jsonl") and PROGRAM_NAME.fullmatch(path.parent.name) is not None


def _room(paths: list[Path] | dict[Path, None]) -> Room:
    there = [path for path in paths if path.is_file()]
    n_clips = sum(path.suffix == ".safetensors" for path in there)
    return Room(tuple(there), sum(path.stat().st_size for path in there), n_clips)


def _counted(n: int, thing: str) -> str:
    return f"{n} {thing}{'' if n == 1 else 's'}"
