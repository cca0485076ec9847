"""Versions: earlier versions of the open project's clips, listed, restored and removed.

Folders and headers are read on a thread when somebody looks; files are moved by short jobs.
"""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime

from app.background.jobs import JobContext, Jobs
from app.background.latest import LatestWorker
from app.project.clips import clip_versions
from app.project.clips.clip_versions import ClipVersion
from app.project.opening.opened_project import OpenedProject
from app.project.project import Project
from app.session.notices import Notices
from app.session.part import SessionPart
from app.status import VersionStatus
from app.training.clip_run import ShownState
from app.training.service import TrainingService
from engine.clip_files.clip_header import ClipHeader
from engine.errors import EngineError, ProjectError
from engine.setting import value_text
from engine.training.config import SETTINGS

MAX_KEPT = 64
"""Clips whose versions stay in memory."""


@dataclass(frozen=True, slots=True)
class VersionsRequest:
    """Versions of a clip as they are now: the folder's time and the catalog's revision show whether they were read. The
    name is that of its files: clips that were cut otherwise have other ones under the same index."""

    clip_index: int
    name: str
    generation: int
    stamp: tuple[int, int]
    project: Project = field(compare=False)


@dataclass(frozen=True, slots=True)
class FoundVersions:
    """Versions on disk, and their status values; of the same length."""

    found: tuple[ClipVersion, ...] = ()
    statuses: tuple[VersionStatus, ...] = ()


class Versions(SessionPart):
    """For one thread, and nothing here waits.

    Args:
        jobs, notices: Of the session.
        service: Gives the training of the open project, None without one.
    """

    def __init__(self, jobs: Jobs, notices: Notices, service: Callable[[], TrainingService | None]) -> None:
        self._jobs, self._notices, self._service = jobs, notices, service
        self._opened: OpenedProject | None = None
        self._kept: OrderedDict[VersionsRequest, FoundVersions] = OrderedDict()
        self._busy: set[int] = set()
        self.worker: LatestWorker[VersionsRequest, FoundVersions] = LatestWorker("versions", _look)

    def open(self, opened: OpenedProject) -> None:
        """Take up a project."""
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    def statuses(self, clip_index: int) -> tuple[VersionStatus, ...]:
        """Versions of a clip, the one set aside last first; none until they were read."""
        return self._found(clip_index).statuses

    def state(self, clip_index: int, number: int) -> ShownState | None:
        """The file of a version, to be shown; None until it was read, and where it cannot be shown."""
        found = next((one for one in self._found(clip_index).found if one.number == number), None)
        if found is None or found.header is None or self._opened is None:
            return None
        reference = None
        if found.header.role == "source":
            reference = clip_versions.reference_file(self._opened.project, clip_index, found.header)
            if reference is None:
                return None
        return ShownState(found.path, found.revision, reference_file=reference)

    def _found(self, clip_index: int) -> FoundVersions:
        service, opened = self._service(), self._opened
        if service is None or opened is None or not 0 <= clip_index < len(opened.clips):
            return FoundVersions()
        try:
            changed_ns = os.stat(clip_versions.versions_dir(opened.project, clip_index)).st_mtime_ns
        except OSError:
            return FoundVersions()
        name = opened.project.clip_name(clip_index)
        stamp = (changed_ns, service.catalog.revision)
        request = VersionsRequest(clip_index, name, opened.generation, stamp, opened.project)
        newest = self.worker.newest
        if newest is not None and newest[0] not in self._kept:
            self._kept[newest[0]] = newest[1]
            while len(self._kept) > MAX_KEPT:
                self._kept.popitem(last=False)
        known = self._kept.get(request)
        if known is None:
            self.worker.request(request)
            older = (self._kept[one] for one in reversed(self._kept) if _same_clip(one, request))
            return next(older, FoundVersions())
        return known

    # ---------------------------------------------------------------- commands

    def restore(self, clip_index: int, number: int) -> None:
        """Bring a version back on a thread; a notice says how it went.

        Raises:
            ProjectError: Something trains that would not fit any more.
        """
        service, opened = self._service(), self._opened
        if service is None or opened is None:
            return
        training, project = service.in_training, opened.project
        project.check_writable()
        if clip_index in training or (training and clip_index == project.settings.reference_clip):
            running = clip_index if clip_index in training else min(training)
            raise ProjectError(
                f"Clip {running} is training and would not match the restored version.",
                hint="Let training end, or stop it; progress is kept.",
            )

        def work(context: JobContext) -> None:
            clip_versions.restore_version(project, clip_index, number)

        self._start(clip_index, f"Restoring clip {clip_index}", work, f"Clip {clip_index} is restored")

    def remove(self, clip_index: int, number: int) -> None:
        """Delete a version on a thread."""
        opened = self._opened
        if opened is None:
            return
        project = opened.project
        project.check_writable()

        def work(context: JobContext) -> None:
            clip_versions.remove_version(project, clip_index, number)

        self._start(clip_index, f"Removing a version of clip {clip_index}", work, "")

    def _start(self, clip_index: int, name: str, work: Callable[[JobContext], None], told: str) -> None:
        if clip_index in self._busy:  # a second click
            return
        self._busy.add(clip_index)
        service = self._service()

        def done(_: None) -> None:
            self._busy.discard(clip_index)
            if service is not None:
                outdated = service.catalog.outdated_by(clip_index) if told else []
                service.catalog.update(clip_index)
                stale = [index for index in outdated if service.catalog[index].state == "stale"]
                if told:
                    self._notices.add("info", told, _stale_text(len(stale)))

        def failed(error: Exception) -> None:
            self._busy.discard(clip_index)
            title = f"The version of clip {clip_index} could not be " + ("restored" if told else "removed")
            if isinstance(error, EngineError):
                self._notices.add_error(title, error)
            else:
                self._notices.add_failure(title, error)

        self._jobs.start(name, work, done, failed)

    @property
    def finished(self) -> object:
        """Differs when versions were read."""
        return None if self.worker.newest is None else self.worker.newest[0]

    def close(self) -> None:
        """End the thread."""
        self.worker.close(timeout_s=0.2)


def _same_clip(one: VersionsRequest, other: VersionsRequest) -> bool:
    return (one.name, one.generation) == (other.name, other.generation)


def _stale_text(n: int) -> str:
    if not n:
        return ""
    return f"{n} {'clip was' if n == 1 else 'clips were'} trained on another version of it and are now out of date."


# ---------------------------------------------------------------- on the thread


def _look(request: VersionsRequest) -> FoundVersions:
    project = request.project
    found = tuple(clip_versions.list_versions(project, request.clip_index))
    current = project.headers.read(project.clip_path(request.clip_index))
    header = None if current is None else current.header
    return FoundVersions(found, tuple(_status(project, request.clip_index, one, header) for one in found))


def _status(project: Project, clip_index: int, version: ClipVersion, current: ClipHeader | None) -> VersionStatus:
    header = version.header
    trained = datetime.fromtimestamp(version.trained_s).strftime("%Y-%m-%d %H:%M")
    if header is None:
        return VersionStatus(version.number, trained, n_bytes=version.n_bytes, why_not=version.damage)
    return VersionStatus(
        version.number,
        trained,
        header.step,
        header.figures.held_out_psnr,
        version.n_bytes,
        () if current is None else _differences(header, current),
        clip_versions.why_not(project, clip_index, header),
        header.figures.held_out_whole,
    )


def _differences(header: ClipHeader, current: ClipHeader) -> tuple[tuple[str, str, str], ...]:
    """Settings that differ; those that no longer exist count as far as they were given."""
    names = dict.fromkeys((*header.config, *current.config))
    rows = []
    for name in names:
        default = SETTINGS[name].default if name in SETTINGS else ""
        value, now = header.config.get(name, default), current.config.get(name, default)
        if value != now:
            rows.append((name, value_text(value), value_text(now)))
    return tuple(rows)
