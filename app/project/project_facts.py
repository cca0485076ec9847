"""Facts of a project from its files, without its capture: settings, trained clips, their durations and sizes."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.background.kernels import COMPILING
from app.document.project_settings import ProjectSettings
from app.document.storing.document_file import PROJECT_FILE
from app.project.clips.clip_bytes import storage_of
from app.project.opening.project_access import open_project
from app.project.project import Project
from engine.clip_files.clip_header import ClipHeader, Coverage
from engine.clip_files.clip_state import DamagedClip, look_at_clip
from engine.errors import ProjectError

SEARCH_DEPTH = 3
"""Levels of folders below a given one in which projects are looked for."""


@dataclass(frozen=True, slots=True)
class ClipFacts:
    """One trained clip.

    Attributes:
        start, n_frames: Its frames in the capture.
        role: "reference" or "source".
        n_steps: Optimiser steps.
        fingerprint: Of its arrays.
        storage: Bytes per component, see app.project.clips.clip_bytes.
        stages_s: Wall seconds per stage, see app.training.worker.stage_watch; empty when not recorded.
        preparation_s, training_s: Together all of it; None when not recorded.
        coverage: Of a clip that inherits: moving things and how much of them has an anchor near it, see
            engine.clip_files.clip_header.Coverage; None when not recorded.
        memory_mb: Most that the process held which prepared and trained it, 10^6 bytes; None when not recorded.
        is_imported: Whether another program made it.
    """

    clip_index: int
    start: int
    n_frames: int
    role: str
    n_steps: int
    fingerprint: str
    storage: dict[str, int]
    stages_s: dict[str, float]
    preparation_s: float | None
    training_s: float | None
    coverage: Coverage | None = None
    memory_mb: float | None = None
    is_imported: bool = False

    @property
    def wall_s(self) -> float | None:
        """Preparation and training, without the kernels that a machine compiles once; None when not recorded."""
        if self.preparation_s is None or self.training_s is None:
            return None
        return self.preparation_s + self.training_s - self.compiling_s

    @property
    def compiling_s(self) -> float:
        """Of the preparation, what went into kernels that a machine compiles once."""
        return self.stages_s.get(COMPILING, 0.0)


@dataclass(frozen=True, slots=True)
class ProjectFacts:
    """One project. `name` is unique on the page; `clips` are the trained ones, at least one; `damaged`
    are files of trained clips that cannot be read."""

    name: str
    project: Project
    clips: list[ClipFacts]
    damaged: tuple[DamagedClip, ...] = ()

    @property
    def settings(self) -> ProjectSettings:
        """Of the project."""
        return self.project.settings

    @property
    def wall_s(self) -> float | None:
        """Of all trained clips; None when one of them has no record."""
        times = [clip.wall_s for clip in self.clips]
        return None if None in times else sum(time for time in times if time is not None)

    @property
    def n_bytes(self) -> int:
        """Of all clip files."""
        return sum(sum(clip.storage.values()) for clip in self.clips)


def read_facts(folder: Path, name: str, *, leave_out_damaged: bool = False) -> ProjectFacts:
    """Look at a project's files.

    Args:
        name: Of the result.
        leave_out_damaged: List unreadable files of clips apart from the others, as long as there are others.

    Raises:
        ProjectError: It is not a project, nothing is trained yet, or a clip cannot be read.
    """
    project = open_project(folder, is_writable=False)
    found = [_read_clip(path, index) for index, path in project.finished_clips()]
    clips = [clip for clip in found if isinstance(clip, ClipFacts)]
    damaged = tuple(clip for clip in found if isinstance(clip, DamagedClip))
    if damaged and not (clips and leave_out_damaged):
        raise damaged[0].error()
    if not clips:
        raise ProjectError(
            "Nothing is trained in this project yet.", hint="Run `clipgstream train` first.", path=folder
        )
    return ProjectFacts(name, project, sorted(clips, key=lambda clip: clip.clip_index), damaged)


def _read_clip(path: Path, clip_index: int) -> ClipFacts | DamagedClip | None:
    header = look_at_clip(path)
    if not isinstance(header, ClipHeader):
        return header
    try:
        return ClipFacts(
            clip_index=clip_index,
            start=header.start,
            n_frames=header.n_frames,
            role=header.role,
            n_steps=header.step,
            fingerprint=header.fingerprint,
            storage=storage_of(path),
            stages_s=header.figures.stages_s,
            preparation_s=header.figures.preparation_s,
            training_s=header.figures.training_s,
            coverage=header.coverage,
            memory_mb=header.figures.memory_mb,
            is_imported=header.holds == "gaussians",
        )
    except ProjectError as error:  # removed or replaced since
        return DamagedClip(path, error.message)


# ---------------------------------------------------------------- which projects


def find_projects(given: Sequence[Path], *, besides: Path) -> list[tuple[Path, bool]]:
    """Project folders among the given ones and below them, each once, without `besides`.

    Returns:
        Folders in the given order, those below one sorted; with each, whether it was named itself.
    Raises:
        ProjectError: A folder does not exist or holds no project.
    """
    found: dict[Path, tuple[Path, bool]] = {}
    for folder in given:
        if not folder.is_dir():
            raise ProjectError("There is no such folder to compare with.", hint="Check --compare.", path=folder)
        is_project = (folder / PROJECT_FILE).is_file()
        inside = [folder] if is_project else list(_below(folder, SEARCH_DEPTH))
        if not inside:
            raise ProjectError(
                f"This folder is not a project and holds none: no {PROJECT_FILE} in it or below.",
                hint="Give --compare a project folder, or a folder of projects.",
                path=folder,
            )
        for path in inside:
            key = path.resolve()
            if key != besides.resolve():
                found.setdefault(key, (path, is_project))
    return list(found.values())


def _below(folder: Path, depth: int) -> Iterator[Path]:
    for child in sorted(entry.path for entry in os.scandir(folder) if entry.is_dir()):
        path = Path(child)
        if (path / PROJECT_FILE).is_file():
            yield path
        elif depth > 1:
            yield from _below(path, depth - 1)


def short_names(folders: Sequence[Path]) -> list[str]:
    """Names that distinguish folders: the last part of each, and as many parts before it as that needs."""
    parts = [folder.resolve().parts for folder in folders]
    n_parts = [1] * len(parts)

    def name(i: int) -> str:
        kept = parts[i][-n_parts[i] :]
        return "/".join(part.strip("/\\") for part in kept).encode("utf-8", "replace").decode("utf-8")

    while True:
        names = [name(i) for i in range(len(parts))]
        doubled = [i for i in range(len(parts)) if names.count(names[i]) > 1 and n_parts[i] < len(parts[i])]
        if not doubled:
            return names
        for i in doubled:
            n_parts[i] += 1
