"""DiskReader: the open project's use of the disk, read on a thread when somebody looks."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.background.latest import LatestWorker
from app.project.disk.use import DiskUse, disk_use
from app.project.project import Project


@dataclass(frozen=True, slots=True)
class DiskRequest:
    """The project's folder as it is now. basis: Differs whenever something in it may have changed."""

    basis: tuple[int, ...]
    n_clips: int
    project: Project = field(compare=False)


class DiskReader:
    """For one thread, and nothing here waits."""

    def __init__(self) -> None:
        self.worker: LatestWorker[DiskRequest, DiskUse] = LatestWorker("disk use", _look)
        self._n_changes = 0

    def use(self, project: Project, n_clips: int, basis: tuple[int, ...]) -> DiskUse | None:
        """The use; the earlier one while it is looked up anew, None before the first.

        Args:
            basis: Generation of the project, and the revision of its catalog.
        """
        request = DiskRequest((*basis, self._n_changes), n_clips, project)
        newest = self.worker.newest
        if newest is None or newest[0] != request:
            self.worker.request(request)
        if newest is None or newest[0].project is not project or newest[0].n_clips != n_clips:
            return None
        return newest[1]

    def note_change(self) -> None:
        """Files were removed: look again."""
        self._n_changes += 1

    def close(self) -> None:
        """End the thread."""
        self.worker.close(timeout_s=0.2)


def _look(request: DiskRequest) -> DiskUse:
    return disk_use(request.project, request.n_clips)
