"""Clouds: shown where nothing is trained. The still part of the reference clip; before that a rough first
cloud; before that pictures placed in space. Read or made on one thread; the newest request wins.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.background.latest import LatestWorker
from app.playback.modes.arrays import PointArrays
from app.playback.point_spacing import point_spacing
from app.playback.preview import CloudJob, make_cloud, picture_hint, read_cloud
from app.project.opening.opened_project import OpenedProject
from app.training.clip_run import ShownState
from engine.capture.capture import Capture
from engine.clip_files.clip_state import read_clip_state
from engine.clip_files.stored_gaussians import read_stored
from engine.errors import ProjectError

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class CloudRequest:
    """A cloud: of a state of the reference clip, of the file of a first cloud, or the hint made of pictures.

    Attributes:
        revision: Names the state; empty for the other two.
        path: File of the state or of the first cloud; None for the hint.
        is_live: Whether the file is a snapshot of a running training.
    """

    generation: int
    revision: str = ""
    path: Path | None = None
    capture: Capture | None = field(default=None, compare=False)
    is_live: bool = field(default=False, compare=False)


class Clouds:
    """Clouds of the open project. Methods are for one thread, not the one it owns."""

    def __init__(self) -> None:
        self.worker: LatestWorker[CloudRequest, PointArrays] = LatestWorker("points", _compute)
        self._first: BackgroundJob | None = None

    def cloud(self, opened: OpenedProject, reference: ShownState | None) -> PointArrays | None:
        """The best cloud there is; until it is made, the one before; None before the first.

        Args:
            reference: State of the reference clip; None where it has none.
        """
        generation = opened.generation
        if reference is not None:
            request = CloudRequest(generation, reference.revision, reference.file, is_live=reference.is_live)
        elif opened.project.first_cloud_path.is_file():
            request = CloudRequest(generation, path=opened.project.first_cloud_path)
        else:
            request = CloudRequest(generation, capture=opened.capture)
        newest = self.worker.newest
        if newest is None or newest[0] != request:
            self.worker.request(request)
        return None if newest is None else newest[1]

    def build_first(self, opened: OpenedProject, jobs: Jobs) -> None:
        """Make something of the scene to look at until the first training has built the real cloud."""
        path = opened.project.first_cloud_path
        if path.is_file() or not (opened.project.is_writable and opened.capture.has_pictures):
            return
        capture = opened.capture

        job = CloudJob(capture.path, opened.holdout, path, capture.frames, capture.follow_links, capture.is_growing)

        def work(context: JobContext) -> Path:
            return make_cloud(job, context)

        def failed(error: Exception) -> None:  # the hint stays; training will say what is wrong
            logger.warning("no first cloud: %s", error)

        self._first = jobs.start("Building a first cloud", work, lambda _: None, failed, can_cancel=True)

    def clear(self) -> None:
        """Another project was opened."""
        self.worker.forget()
        if self._first is not None:
            self._first.context.cancel()
            self._first = None

    def close(self) -> None:
        """End the thread."""
        self.worker.close()


def static_points(path: Path, revision: str) -> PointArrays:
    """The still part of a reference clip as a coloured cloud.

    Raises:
        ProjectError: The file is missing or damaged, or not of a reference clip.
    """
    state = read_clip_state(path)
    record = state.anchors.get("static")
    if state.header.holds == "gaussians":
        stored = read_stored(state.arrays, state.header.n_frames).at_first()
        points, colors = stored["means"], np.clip(stored["colors"], 0.0, 1.0)
    elif record is None or record.own is None:
        raise ProjectError("The clip file holds no static anchors.", hint="Train the clip again.", path=path)
    else:
        points = record.own.positions.astype(np.float32, copy=False)
        logits = record.own.color_logits.astype(np.float32, copy=False)
        colors = 1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0)))
    spacing = point_spacing(points)
    key = ("cloud", str(path), revision)
    return PointArrays(np.ascontiguousarray(points), colors.astype(np.float32), key, spacing=spacing)


def _compute(request: CloudRequest) -> PointArrays:
    if request.path is None:
        assert request.capture is not None
        return picture_hint(request.capture, 0)
    return static_points(request.path, request.revision) if request.revision else read_cloud(request.path)
