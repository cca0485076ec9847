"""The process that measures: one camera of one clip after another, in the order of measuring_order, with one thread and
only spare computing time. Nothing imported here may draw anything.

While a clip trains it also keeps to a share of one core's time, by resting after each picture: it can slow the training
down for that share of the time at most.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from app.background.kernels import use_threads
from app.background.logs import start_logging
from app.evaluation.evaluation import EvaluationScope, kept_figures
from app.evaluation.headless import TrainedProject, open_trained
from app.evaluation.kept_figures import KeptFigures
from app.project.opening.project_access import open_project
from app.residuals.figures import pair_figures, row_figures
from app.residuals.kept_reading import WINDOW_METRICS
from app.residuals.measuring_messages import (
    Event,
    LookAt,
    MeasureJob,
    PictureMeasured,
    SetShare,
    Trouble,
)
from app.residuals.measuring_order import Item, MeasuringFocus, first_item
from engine.backends.table import choose_backend
from engine.capture.capture import open_capture
from engine.children.child import Parent
from engine.errors import EngineError
from engine.kernels.cache import use_kernel_cache
from engine.metrics.clips.summary import EvalRow

if TYPE_CHECKING:
    from engine.metrics.clips.evaluate import Evaluation
    from engine.metrics.clips.seams import PairRow
    from engine.metrics.clips.trained_clip import TrainedClip

MAX_CLIPS = 3
"""Clips and their kept figures in memory."""
CAPTURE_CACHE_BYTES = 64 << 20
"""Pictures of one camera and clip are needed again and again, those of others are not."""


def main(job: MeasureJob, parent: Parent[Event]) -> None:
    """Runs in the child until everything is measured."""
    start_logging()
    use_kernel_cache()  # before kernels are imported
    use_threads(1)
    choose_backend(job.backend)
    talk = Talk(job, parent)
    try:
        measure(job, talk)
    except EngineError as error:
        talk.say(str(error))


class Talking(Protocol):
    """The process's messages in both directions, and its rests."""

    @property
    def look(self) -> MeasuringFocus:
        """The clip and camera that the user looks at."""
        ...

    def send(self, event: Event) -> None:
        """Report to the window's process. Raises Unwanted."""
        ...

    def say(self, message: str) -> None:
        """Report to the user, once. Raises Unwanted."""
        ...

    def rest(self) -> None:
        """Take in commands, and leave time to others. Raises Unwanted."""
        ...


class Talk:
    """`Talking` with the process that has started this one."""

    def __init__(self, job: MeasureJob, parent: Parent[Event]) -> None:
        self._parent = parent
        self._look, self._share = job.look, job.share
        self._said: set[str] = set()
        self._cpu_s = 0.0  # computing before it began counts too

    @property
    def look(self) -> MeasuringFocus:
        """See `Talking`."""
        return self._look

    def send(self, event: Event) -> None:
        """See `Talking`."""
        self._parent.report(event)

    def say(self, message: str) -> None:
        """See `Talking`."""
        if message not in self._said:
            self._said.add(message)
            self.send(Trouble(message))

    def rest(self) -> None:
        """Take in commands, and rest as long as the share demands for the computing since the last call. Raises
        Unwanted."""
        spent_s = time.process_time() - self._cpu_s
        began_s = time.monotonic()
        while True:  # the share may change while it waits
            left_s = began_s + spent_s * (1.0 / self._share - 1.0) - time.monotonic()
            if not self._receive(max(left_s, 0.0)) and left_s <= 0:
                break
        self._cpu_s = time.process_time()

    def _receive(self, wait_s: float) -> bool:
        command = self._parent.receive(wait_s)
        if isinstance(command, LookAt):
            self._look = command.look
        elif isinstance(command, SetShare):
            self._share = command.share
        return command is not None


class _TrainedAgain(Exception):
    """A clip was trained again meanwhile: the loaded version is not the one on disk."""


class _Clips:
    """Clips and their kept figures, those used last. Figures of one version never come under the name of another."""

    def __init__(self, opened: TrainedProject, job: MeasureJob, talk: Talking) -> None:
        self._opened, self._talk = opened, talk
        self._scope = EvaluationScope(job.trained, range(len(opened.capture.rig)), WINDOW_METRICS, "float")
        self._is_kept = job.is_kept
        self._loaded: OrderedDict[int, TrainedClip] = OrderedDict()
        self._figures: OrderedDict[int, KeptFigures] = OrderedDict()
        self._fingerprints: dict[int, str] = {}

    def _check_version(self, clip_index: int) -> None:
        """Raises _TrainedAgain where the file of a clip is not the one it was at first."""
        found = self._opened.header(clip_index).fingerprint
        if self._fingerprints.setdefault(clip_index, found) != found:
            raise _TrainedAgain

    def load(self, clip_index: int) -> TrainedClip:
        if clip_index not in self._loaded:
            while len(self._loaded) >= MAX_CLIPS:
                self._loaded.popitem(last=False)
            self._check_version(clip_index)
            loaded = self._opened.load(clip_index)
            self._check_version(clip_index)
            self._loaded[clip_index] = loaded
        self._loaded.move_to_end(clip_index)
        return self._loaded[clip_index]

    def figures(self, clip_index: int) -> KeptFigures | None:
        """Kept figures of a clip; None where none are kept."""
        if not self._is_kept:
            return None
        if clip_index not in self._figures:
            while len(self._figures) >= MAX_CLIPS:
                self._figures.popitem(last=False)
            figures = kept_figures(self._opened, self._scope, clip_index, self._talk.say)
            before = self._scope.before(clip_index)
            for index in (clip_index, *(() if before is None else (before,))):
                self._check_version(index)
            self._figures[clip_index] = figures
        return self._figures[clip_index]


def measure(job: MeasureJob, talk: Talking) -> None:
    """Measure the job's figures, most wanted first. Clips that cannot be read are reported and left out.

    Raises:
        CaptureError, ProjectError: The capture or the project cannot be opened.
        Unwanted: Nobody listens any more.
    """
    project = open_project(Path(job.project), is_writable=False)
    capture = open_capture(
        job.capture,
        scale=job.scale,
        frames=job.frames,
        cache_bytes=CAPTURE_CACHE_BYTES,
        follow_links=job.follow_links,
        is_growing=project.settings.is_growing,
    )
    capture = capture.without(project.document.exclusions)
    opened = open_trained(project, capture)
    from engine.metrics.clips.evaluate import Evaluation

    holdout = capture.camera_indices(project.settings.holdout)
    cameras = range(len(capture.rig))
    evaluation = Evaluation(capture, cameras=cameras, holdout=holdout, metrics=WINDOW_METRICS)
    clips = _Clips(opened, job, talk)
    rows, pairs = job.rows.copy(), job.pairs.copy()
    left = _items(opened, job.trained, rows | pairs)
    while (item := first_item(left, talk.look, holdout)) is not None:
        try:
            is_done = _measure_item(item, evaluation, clips, rows, pairs, talk)
        except EngineError as error:
            talk.say(str(error))
            is_done = True  # as far as it can be
        except _TrainedAgain:
            is_done = True  # the window forgets its figures, and starts another process
        if is_done:
            left.discard(item)


def _items(opened: TrainedProject, trained: tuple[int, ...], wanted: np.ndarray) -> set[Item]:
    found = set()
    for clip_index in trained:
        clip = opened.clips[clip_index]
        cameras = np.flatnonzero(wanted[clip.start : clip.stop].any(0))
        found |= {(clip_index, int(camera)) for camera in cameras}
    return found


def _measure_item(
    item: Item, evaluation: Evaluation, clips: _Clips, rows: np.ndarray, pairs: np.ndarray, talk: Talking
) -> bool:
    """Measure one camera of one clip; measured items leave rows and pairs. False where the user looked at something
    else before the end."""
    clip_index, camera = item
    trained = clips.load(clip_index)
    clip, look = trained.clip, talk.look
    frames = [frame for frame in clip.frame_indices() if rows[frame, camera]]
    later = [frame for frame in clip.frame_indices() if pairs[frame, camera]]
    before = clips.load(clip_index - 1) if clip.start in later else None
    figures = clips.figures(clip_index)
    talk.rest()
    for found in evaluation.of_camera(trained, camera, before=before, frames=frames, pairs=later):
        _take(found, clip_index, camera, rows, pairs, talk)
        if figures is not None:
            with figures.writing():
                figures.add(found)
        talk.rest()
        if talk.look != look:
            return False
    return True


def _take(
    found: EvalRow | PairRow, clip_index: int, camera: int, rows: np.ndarray, pairs: np.ndarray, talk: Talking
) -> None:
    if isinstance(found, EvalRow):
        rows[found.frame_index, camera] = False
        talk.send(PictureMeasured(clip_index, row=row_figures(found, camera)))
    else:
        pairs[found.frame_index, camera] = False
        talk.send(PictureMeasured(clip_index, pair=pair_figures(found, camera)))
