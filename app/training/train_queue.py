"""TrainQueue: the clips that wait to be trained, in their order, with their settings and failures. Knows no worker.

A clip waits only while it can still be trained: one that needs another clip leaves when that one can no longer come.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from engine.clip_files.clip_header import SettingValue
from engine.training.config import TrainConfig

OwnSettings = Mapping[str, SettingValue]
"""Training settings of one clip that differ from those of its project."""
FINISHED = ("trained", "stale")
"""States of a clip on which others can be trained."""


class TrainQueue:
    """Clips in the order in which they are to be trained, each at most once.

    Attributes:
        is_held: Whether the first of them waits until the user continues.
        failed: Why clips could not be trained, by clip; one that is tried again leaves.
        n_done, steps_done: Clips that ended since the queue was last empty, and the steps they had.
        revision: Grows with every change of the clips that wait.
    """

    def __init__(self) -> None:
        self._clips: dict[int, OwnSettings | None] = {}  # they may be thousands
        self.is_held = False
        self.failed: dict[int, str] = {}
        self.n_done = self.steps_done = self.revision = 0

    def __iter__(self) -> Iterator[int]:
        return iter(tuple(self._clips))

    def __len__(self) -> int:
        return len(self._clips)

    def __contains__(self, clip_index: object) -> bool:
        return clip_index in self._clips

    @property
    def first(self) -> int | None:
        """The clip that is next; None when none waits."""
        return next(iter(self._clips), None)

    def own_settings(self, clip_index: int) -> OwnSettings | None:
        """Settings that a waiting clip was given; None for those of its project."""
        return self._clips.get(clip_index)

    def add(self, clip_index: int, own: OwnSettings | None = None) -> None:
        """Let a clip wait behind the others. One that waits keeps its place and takes over the settings."""
        self._clips[clip_index] = self._clips.get(clip_index) if own is None else dict(own)
        self.revision += 1

    def take(self, clip_index: int) -> OwnSettings | None:
        """A waiting clip waits no more. Returns its settings."""
        own = self._clips.pop(clip_index)
        self.failed.pop(clip_index, None)
        self.revision += 1
        return own

    def move(self, clip_index: int, position: int) -> None:
        """Put a waiting clip at a position, counted from 0 without it; held inside the queue."""
        if clip_index in self._clips:
            order = [index for index in self._clips if index != clip_index]
            order.insert(min(max(position, 0), len(order)), clip_index)
            self._clips = {index: self._clips[index] for index in order}
            self.revision += 1

    def remove(self, clip_index: int) -> None:
        """Let a clip wait no more, if it does."""
        self._clips.pop(clip_index, None)
        self.revision += 1
        if not self._clips:
            self.is_held = False

    def clear(self) -> None:
        """Let none wait."""
        self._clips, self.is_held = {}, False
        self.revision += 1

    def note_end(self, n_steps: int) -> None:
        """A clip ended, in any way."""
        self.n_done += 1
        self.steps_done += n_steps

    def forget_done(self) -> None:
        """Clips added from now on are another sequence."""
        self.n_done = self.steps_done = 0


def needed_clips(project: Project, clip_index: int, config: TrainConfig | None = None) -> tuple[int, ...]:
    """Clips that have to be finished before this one can be trained.

    Args:
        config: Settings of the project, for callers that ask for many clips; taken from it when None.
    """
    settings = project.settings
    if clip_index == settings.reference_clip:
        return ()
    config = settings.config() if config is None else config
    inherited = () if config.independent else (settings.reference_clip,)
    before = (project.previous_index(clip_index),) if config.follows_previous else ()
    return tuple(dict.fromkeys((*inherited, *before)))


def drop_hopeless(queue: TrainQueue, running: Iterable[int], project: Project, catalog: ClipCatalog) -> list[int]:
    """Take out the clips that need one that is neither finished nor comes before them. Returns them.

    Args:
        running: Clips that train.
    """
    dropped: list[int] = []
    come = set(running)
    config = project.settings.config()
    for clip_index in queue:
        needed = needed_clips(project, clip_index, config)
        if any(other not in come and catalog[other].state not in FINISHED for other in needed):
            dropped.append(clip_index)
        else:
            come.add(clip_index)
    for clip_index in dropped:
        queue.remove(clip_index)
    return dropped
