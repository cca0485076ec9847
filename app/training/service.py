"""TrainingService: clips that train, clips that wait, and the workers' last reports. Status is derived, never stored.

Owned by one thread. It knows no window and raises no notices: `poll` returns the events for the caller to report.
Files on disk are left to app.project.clips.clip_catalog; running trainings never hide them. Every clip is claimed while
it trains, so that other processes, also of other computers, can train others of the same project.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from itertools import count
from typing import NamedTuple

from app.background.in_turn import InTurn
from app.project.claims.asks import Ask
from app.project.claims.claims import Claims, ClipClaimed, Elsewhere
from app.project.claims.holder_record import ClipProgress
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.training.clip_run import ClipRun, HandedOver, ShownState
from app.training.curves import CurveReader
from app.training.due import check_needed, with_needed
from app.training.jobs import train_job
from app.training.messages import (
    ClipTrained,
    Event,
    SnapshotConsumed,
    SnapshotNow,
    TrainingFailed,
    TrainJob,
)
from app.training.own_settings import with_own
from app.training.process import ProcessWorker, Worker
from app.training.runs.looked_at import LookedAt
from app.training.train_queue import FINISHED, OwnSettings, TrainQueue, drop_hopeless, needed_clips
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import read_clip_header
from engine.errors import DiskError, ProjectError
from engine.portable import NATIVE, Processor
from engine.training.preparation.stages import remove_stages

Launch = Callable[[TrainJob, Project], Worker]
ClipEvent = tuple[int, Event]
"""A clip, and an event of its worker."""
CLOSE_TIMEOUT_S = 5.0
PATIENCE_S = 0.05
"""For so long a window waits for a claim, which a disk nearby gives at once."""


class Claimed(NamedTuple):
    """What the disk says of a clip that is claimed now.

    Attributes:
        handed_over: Header of the trained clip that an earlier process has left; None without one.
        n_holders: How many processes train clips of the project.
    """

    handed_over: ClipHeader | None
    n_holders: int


class TrainingService:
    """Queue and workers of one project.

    Args:
        project: Where clips go.
        clips: All clips of the capture.
        holdout: Camera indices never trained on.
        launch: Starts a worker; a process by default.
        is_window_open: Passed on to workers, which then leave room for it.
        catalog: The clips on disk; read here, which takes a while in a long project, when None.
        curves: Reads the curves of clips that are looked at; stays open when the service is closed.
        n_workers: How many clips may train side by side. They share the cores.
        claims: Of this process; made here when None.
        cpu: Passed on to workers, see TrainJob.

    Attributes:
        queue: Clips that wait.
        n_workers: How many clips may train side by side.
        runs: Clips that train, in the order in which they began.
        last: The run that ended last; None before one did.
        looked_at: The clips that somebody looks at, and how often their workers write snapshots.
        is_ending_after: Whether the queue is held when a clip that trains has ended.
    """

    def __init__(
        self,
        project: Project,
        clips: Sequence[Clip],
        *,
        holdout: Sequence[int],
        launch: Launch = ProcessWorker,
        is_window_open: bool = True,
        catalog: ClipCatalog | None = None,
        curves: CurveReader | None = None,
        n_workers: int = 1,
        claims: Claims | None = None,
        cpu: Processor = NATIVE,
    ) -> None:
        self.project, self.clips, self.holdout = project, list(clips), tuple(holdout)
        self._launch, self._is_window_open, self.n_workers = launch, is_window_open, n_workers
        self._cpu: Processor = cpu
        self.catalog = ClipCatalog(project, len(self.clips)) if catalog is None else catalog
        self.queue = TrainQueue()
        self.runs: dict[int, ClipRun] = {}
        self.last: ClipRun | None = None
        self.looked_at = LookedAt()
        self.is_ending_after = False
        self.curves = CurveReader() if curves is None else curves
        self._owns_curves = curves is None
        self._begun: dict[int, OwnSettings] = {}  # own settings with which unfinished clips were begun
        self._dropped: list[int] = []
        self._n_runs = 0
        self._next: int | None = None
        self._next_of: tuple[tuple[int, ...], object] = ((), None)
        self.claims = Claims(project.folder, describe=self._described) if claims is None else claims
        self._disk = InTurn("claims of clips", is_apart=is_window_open)
        self._claiming: tuple[int, int, Future[Claimed]] | None = None  # a clip, how many share the cores, its claim
        self._ended_elsewhere: list[ClipEvent] = []
        self._known_elsewhere: Mapping[str, Elsewhere] = self.claims.elsewhere
        self._elsewhere: tuple[Mapping[str, Elsewhere], dict[int, Elsewhere]] = ({}, {})

    @property
    def elsewhere(self) -> Mapping[int, Elsewhere]:
        """Clips that other processes train, by index, as far as clips are cut so here. Not to be changed."""
        known = self.claims.elsewhere
        if self._elsewhere[0] is not known:
            indices = {key: self.project.index_of(key) for key in known}
            n_clips = len(self.clips)
            found = {index: known[key] for key, index in indices.items() if index is not None and index < n_clips}
            self._elsewhere = (known, found)
        return self._elsewhere[1]

    @property
    def in_training(self) -> set[int]:
        """Clips that train, here or elsewhere."""
        return {*self.runs, *self.elsewhere}

    @property
    def progress(self) -> dict[int, ClipProgress]:
        """How far each of them is, as far as it is known."""
        own = {index: run.progress for index, run in self.runs.items()}
        return own | {index: other.progress or ClipProgress(index) for index, other in self.elsewhere.items()}

    def _described(self) -> dict[str, ClipProgress]:
        return {run.worker.job.key: run.progress for run in list(self.runs.values())}

    @property
    def is_busy(self) -> bool:
        """Whether a clip trains, or is about to."""
        return bool(self.runs) or self._claiming is not None

    @property
    def leading(self) -> ClipRun | None:
        """The clip in training that began first; None without one."""
        return next(iter(self.runs.values()), None)

    @property
    def shown_run(self) -> ClipRun | None:
        """The run to show: the leading one, else the one that ended last."""
        return self.leading or self.last

    @property
    def running_clip(self) -> int | None:
        """The clip of the leading run; None while nothing trains."""
        return next(iter(self.runs), None)

    @property
    def worker_pids(self) -> tuple[int, ...]:
        """Processes of the workers that have reported theirs."""
        return tuple(run.pid for run in self.runs.values() if run.pid is not None)

    @property
    def is_stopping(self) -> bool:
        """Whether a run was asked to end, and has not ended yet."""
        return any(run.is_stopping for run in self.runs.values())

    def is_finished(self, clip_index: int) -> bool:
        """Whether a finished clip would be replaced by training this one: it is trained, or damaged."""
        return 0 <= clip_index < len(self.clips) and self.catalog[clip_index].state in ("trained", "damaged")

    def shown_state(self, clip_index: int) -> ShownState | None:
        """The state of a clip to look at: the newest snapshot while it trains, else the one on disk, if any; None for
        a clip that no longer exists because clips are cut differently now."""
        if not 0 <= clip_index < len(self.clips):
            return None
        run = self.runs.get(clip_index)
        if run is not None and run.shown is not None:
            return run.shown
        record = self.catalog[clip_index]
        return None if record.file is None else ShownState(record.file, record.revision)

    def extend(self, clips: Sequence[Clip]) -> None:
        """The capture has grown: these are all clips now, the present ones first. Whatever trains or waits does not
        notice."""
        self.clips = list(clips)
        self.catalog.extend(len(self.clips))

    # ---------------------------------------------------------------- choosing clips

    @property
    def next_clip_index(self) -> int | None:
        """The first clip that is neither finished nor on its way; None when there is none.

        A damaged clip is not among them, nor one that cannot be trained without it: that is for the user to decide.
        Where the queue is held, it is the first of that.
        """
        if not self.runs and self.queue:
            return self.queue.first
        of, elsewhere = (self.catalog.revision, self.queue.revision, self._n_runs, len(self.runs)), self.elsewhere
        if of != self._next_of[0] or elsewhere is not self._next_of[1]:  # asked all the time
            left = self.catalog.due.difference(self.queue, self.runs, elsewhere)
            first = self.catalog.order[0]
            self._next_of, self._next = (of, elsewhere), first if first in left else min(left, default=None)
        return self._next

    @property
    def can_train_next(self) -> bool:
        """Whether training the next clip would start something."""
        return self.project.is_trainable and self.next_clip_index is not None and not self.is_stopping

    def enqueue(self, clip_index: int, own: OwnSettings | None = None) -> None:
        """Train a clip when its turn comes; at once when nothing else does. See `add`."""
        self.add(clip_index, own)
        self.go_on()

    def add(self, clip_index: int, own: OwnSettings | None = None) -> None:
        """Let a clip wait, without starting anything. The caller has confirmed training a finished one again.

        Args:
            own: Settings that differ from the project's; the training then begins afresh.
        Raises:
            ProjectError: The project is read-only, there is no such clip, a clip that it needs is missing or damaged,
                or a setting cannot differ between clips.
        """
        self.project.check_trainable()
        if not 0 <= clip_index < len(self.clips):
            raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {len(self.clips) - 1}.")
        if own:
            with_own(self.project, own)
        coming = {*self.queue, *self.runs}
        if clip_index in self.runs or (clip_index in coming and own is None):
            return
        check_needed(self.project, self.catalog, clip_index, coming.union(self.elsewhere))
        self._add(clip_index, own)

    def _add(self, clip_index: int, own: OwnSettings | None = None) -> None:
        if not self.runs and not self.queue:
            self.queue.forget_done()
        self.queue.add(clip_index, own)

    def enqueue_all(self, clip_indices: Sequence[int]) -> list[int]:
        """Train those of these clips that are not finished, in the order of training; clips they need come first.

        Returns:
            Clips left out because they or clips they need are damaged.
        Raises:
            ProjectError: The project is read-only.
        """
        self.project.check_trainable()
        coming = self.in_training.union(self.queue)
        order, left_out = with_needed(self.project, self.catalog, clip_indices, coming)
        for clip_index in order:
            self._add(clip_index)
        self.go_on()
        return left_out

    # ---------------------------------------------------------------- commands

    def go_on(self) -> None:
        """Train the clips of a queue that was held."""
        self.queue.is_held = False
        self._start_waiting()

    def stop_after_clip(self, is_wanted: bool) -> None:
        """Hold the queue when a clip that trains has ended, or not after all."""
        self.is_ending_after = is_wanted and self.is_busy

    def set_live_view(self, mode: str) -> None:
        """How often snapshots of clips that are looked at are written, from now on. See `LookedAt.set_mode`."""
        self.looked_at.set_mode(mode, self.runs.values())

    def set_workers(self, n: int) -> None:
        """Let this many clips train side by side. More begin at once; those that train continue."""
        self.n_workers = n
        if self.runs:  # clips that wait for the user still do
            self._start_waiting()

    def drop_hopeless(self) -> list[int]:
        """Take clips that can no longer be trained out of the queue. Returns them."""
        return drop_hopeless(self.queue, self.in_training, self.project, self.catalog)

    def take_dropped(self) -> list[int]:
        """Clips that left the queue because clips they need cannot come; each is given once."""
        dropped, self._dropped = self._dropped, []
        return dropped

    def _chosen(self, clip_index: int | None) -> list[ClipRun]:
        return [run for index, run in self.runs.items() if clip_index in (None, index)]

    def pause(self, clip_index: int | None = None) -> None:
        """Hold a clip after the current step; all that train when None."""
        for run in self._chosen(clip_index):
            run.pause()

    def resume(self, clip_index: int | None = None) -> None:
        """Resume a paused clip; all of them when None."""
        for run in self._chosen(clip_index):
            run.resume()

    def stop(self, clip_index: int | None = None, *, keep: bool = True) -> None:
        """End the training of a clip; of all when None, which also empties the queue."""
        if clip_index is None:
            self.queue.clear()
            self.is_ending_after = False
        for run in self._chosen(clip_index):
            run.stop(keep=keep)

    def snapshot_now(self, clip_index: int) -> None:
        """Ask for a fresh state, for instance because the user looks at this clip now."""
        for run in self._chosen(clip_index):
            run.worker.send(SnapshotNow())

    def snapshot_consumed(self, clip_index: int, revision: int) -> None:
        """The live state of this revision was read."""
        for run in self._chosen(clip_index):
            run.worker.send(SnapshotConsumed(revision))

    def close(self, *, timeout_s: float = CLOSE_TIMEOUT_S) -> None:
        """End the workers, keeping progress."""
        is_busy = self.is_busy
        self.queue.clear()
        for run in self.runs.values():
            run.stop()  # all of them at once
        for clip_index, run in self.runs.items():
            run.close(timeout_s=timeout_s)
            self.catalog.update(clip_index)
        self.runs = {}
        self._claiming = None
        self._disk.do(self.claims.close, wait_s=timeout_s if is_busy else PATIENCE_S)
        self._disk.close()
        if self._owns_curves:
            self.curves.close()

    # ---------------------------------------------------------------- starting and ending

    def _start_waiting(self) -> None:
        """Claim clips, and train those that are claimed here. On a slow disk a window goes on meanwhile, and `poll`
        takes up the claim."""
        if self._claiming is not None and self._claiming[2].done():
            (clip_index, n_beside, claim), self._claiming = self._claiming, None
            self._start(clip_index, claim, n_beside=n_beside)
        is_waiting = self._claiming is not None
        while not is_waiting and self.queue and not self.queue.is_held and len(self.runs) < self.n_workers:
            ready = self._ready()
            if not ready:
                return
            n_beside = min(len(self.runs) + len(ready), self.n_workers)
            claim = self._disk.do(partial(self._claim, ready[0]), wait_s=PATIENCE_S)
            if claim.done():
                self._start(ready[0], claim, n_beside=n_beside)
            else:
                self._claiming, is_waiting = (ready[0], n_beside, claim), True

    def _claim(self, clip_index: int) -> Claimed:
        """On the thread for the disk. Raises ClipClaimed, DiskError."""
        try:
            self.claims.take(self.project.clip_name(clip_index))
        except ClipClaimed:
            self.claims.watch()
            raise
        files = self.project.files(clip_index)
        for path in (files.clip, files.checkpoint):
            self.project.headers.read(path)  # which then knows them
        return Claimed(read_clip_header(files.handed_over), self.claims.n_holders)

    def _release(self, key: str) -> None:
        self._disk.do(partial(self.claims.release, key), wait_s=0.0)

    def _ready(self) -> list[int]:
        """Waiting clips that need none that trains or waits before them, as many as there is room for; but for those
        that another process trains."""
        room, ready = self.n_workers - len(self.runs), list[int]()
        coming, config = self.in_training, self.project.settings.config()
        for clip_index in self.queue:
            is_free = clip_index not in self.elsewhere
            if is_free and coming.isdisjoint(needed_clips(self.project, clip_index, config)):
                ready.append(clip_index)
            coming.add(clip_index)
            if len(ready) == room:
                break
        return ready

    def _start(self, clip_index: int, claim: Future[Claimed], *, n_beside: int) -> None:
        """Train a clip, or leave it to another process. n_beside: How many trainings share the cores."""
        refused: ProjectError | None = None
        claimed = Claimed(None, 1)
        try:
            claimed = claim.result()
        except ClipClaimed:
            return  # it is among those elsewhere now, and waits until they have finished it or given it up
        except DiskError as error:
            refused = error
        is_wanted = clip_index in self.queue and not self.queue.is_held
        if not is_wanted or self._is_finished_since(clip_index):
            self._release(self.project.clip_name(clip_index))
            return
        own = self.queue.take(clip_index)
        if own is not None:
            self._begin_afresh(clip_index, own)
        job = train_job(
            self.project,
            self.clips[clip_index],
            holdout=self.holdout,
            overrides=with_own(self.project, self._begun[clip_index]) if self._begun.get(clip_index) else None,
            is_window_open=self._is_window_open,
            live_view=self.looked_at.mode_of(clip_index),
            n_beside=n_beside,
            n_everywhere=max(self.n_workers, claimed.n_holders),
            claim=self.claims.token,
            cpu=self._cpu,
        )
        if refused is not None:
            worker = HandedOver(job, TrainingFailed(type(refused).__name__, *refused.parts()))
        elif claimed.handed_over is not None:
            header = claimed.handed_over
            worker = HandedOver(job, ClipTrained(header.step, header.figures.held_out_psnr))
        else:
            worker = self._launch(job, self.project)
        self._n_runs += 1
        check = partial(self.claims.check, job.key)
        run = self.runs[clip_index] = ClipRun(worker, self.project, self._n_runs, check, live_view=job.live_view)
        taken = {other.worker_number for other in self.runs.values() if other is not run}
        run.worker_number = next(number for number in count(1) if number not in taken)
        run.take_up(self.catalog[clip_index])

    def _begin_afresh(self, clip_index: int, own: OwnSettings) -> None:
        """Progress with other settings is not a start."""
        self._begun[clip_index] = own
        self.project.discard_progress(clip_index)
        remove_stages(self.project.prep_dir, clip_index)
        self.catalog.update(clip_index)

    def poll(self, *, budget_s: float = 0.002) -> list[ClipEvent]:
        """Take in the workers' events; start the next clip when one ended. Returns the events, oldest first of each."""
        until_s = time.monotonic() + budget_s
        taken: list[ClipEvent] = self._look_elsewhere()
        for clip_index, run in list(self.runs.items()):
            taken += [(clip_index, event) for event in run.poll(until_s)]
            if run.ending is not None:
                self._end(run)
        if self._claiming is not None:
            self._start_waiting()
        return taken

    def _look_elsewhere(self) -> list[ClipEvent]:
        """Take in what other processes did and ask for. Returns endings of clips: finished by them, or lost to them."""
        for key, ask in self.claims.take_asked():
            clip_index = self.project.index_of(key)
            if clip_index is not None:
                self._obey(clip_index, ask)
        for run in self.runs.values():
            if run.ending is None and self.claims.is_lost(run.worker.job.key):
                self._ended_elsewhere.append((run.clip_index, run.lose()))
        changed = {self.project.index_of(key) for key in self.claims.take_changed()}
        for clip_index in sorted(index for index in changed if index is not None and index < len(self.clips)):
            if clip_index not in self.runs:
                self._is_finished_since(clip_index)
        is_news = self.claims.elsewhere is not self._known_elsewhere
        self._known_elsewhere = self.claims.elsewhere
        if is_news and self.queue:
            self._dropped += self.drop_hopeless()
            self._start_waiting()
        ended, self._ended_elsewhere = self._ended_elsewhere, []
        return ended

    def _obey(self, clip_index: int, ask: Ask) -> None:
        match ask:
            case "pause":
                self.pause(clip_index)
            case "resume":
                self.resume(clip_index)
            case "stop":
                for run in self._chosen(clip_index):
                    run.stop()

    def _is_finished_since(self, clip_index: int) -> bool:
        """Read a clip's files again. Whether another process has finished it since they were read; it waits no more."""
        before = self.catalog[clip_index].revision
        self.catalog.update(clip_index)
        record = self.catalog[clip_index]
        if record.state != "trained" or record.revision == before:
            return False
        if clip_index in self.queue:
            self.queue.remove(clip_index)
            self._ended_elsewhere.append((clip_index, ClipTrained(record.step, record.held_out_psnr)))
        return True

    def _end(self, run: ClipRun) -> None:
        clip_index = run.clip_index
        run.worker.close(timeout_s=0.5)
        del self.runs[clip_index]
        self._release(run.worker.job.key)
        self.last = run
        self.catalog.update(clip_index)  # also finds clips that are out of date by it
        self.queue.note_end(run.n_steps)
        if isinstance(run.ending, ClipTrained):
            self._begun.pop(clip_index, None)
        if run.has_failed:
            self.queue.failed[clip_index] = run.message
        if self.is_ending_after and self.queue:
            self.queue.is_held = True
        self.is_ending_after = False
        if self.catalog[clip_index].state not in FINISHED:  # else nothing has become hopeless by it
            self._dropped += self.drop_hopeless()
        self._start_waiting()
