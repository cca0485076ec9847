"""Measuring: figures of every picture of the open project, read where they were measured before and measured in the
background where not; forgotten and measured anew when a clip was trained again. While others measure, as
`clipgstream eval` on many computers, it reads what they find.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from app.evaluation.kept_figures import EVALUATIONS
from app.playback.timeline import Timeline
from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject
from app.residuals.figures import ClipMeasurements, Figures
from app.residuals.kept_reader import KeptReader
from app.residuals.measuring_messages import LookAt, MeasureJob, MeasuringEnded, PictureMeasured, SetShare, Trouble
from app.residuals.measuring_order import MeasuringFocus
from app.residuals.measuring_process import LaunchMeasuring, Measurer, MeasuringProcess
from app.status import CELL_COLUMNS, ResidualStatus
from app.training.rate import SmoothedRate
from engine.parallel import n_cores

if TYPE_CHECKING:
    from app.residuals.kept_reading import Stamp  # brings torch

SHARE_WHILE_BUSY = 0.05
"""Share of one core's time, while a clip trains on every core: training takes at most that much longer under any
scheduler, and the order of measuring shows seams long before everything is measured."""
N_CORES_ENOUGH = 3
"""With so many cores a training leaves one to the window, which uses little of it."""
START_AFTER_S = 2.0
"""Quiet before the process is started: not while a project opens, nor between two clips of a queue."""
READ_AGAIN_S = 10.0
"""Between two looks for figures of others. While they bring any, nothing is measured here."""
STATUS_EVERY_S = 0.25
"""Figures come more often than the status is needed."""
RATE_TIME_CONSTANT_S = 300.0
"""Items begin slowly, with the background of a camera: a forecast by the last half minute jumps by twice its value."""
FORECAST_AFTER_S = 60.0
"""Time at full speed before the rest can be forecast."""


class BackgroundMeasuring:
    """Figures of the open project. For one thread, and nothing here waits.

    Args:
        launch: Starts a process; tests bring their own.
        clock: Seconds.
    """

    def __init__(
        self, *, launch: LaunchMeasuring = MeasuringProcess, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._launch, self._clock = launch, clock
        self._opened: OpenedProject | None = None
        self._catalog: ClipCatalog | None = None
        self._seen: tuple[int, int] | None = None
        self._revisions: tuple[str, ...] = ()
        self._figures = Figures((), 0)
        self._reader: KeptReader | None = None
        self._stamps: dict[int, Stamp] = {}
        self._is_reading_again = False
        self._read_s = clock()
        self._written: set[int] = set()
        self._process: Measurer | None = None
        self._look: MeasuringFocus | None = None
        self._told: tuple[MeasuringFocus, float] | None = None
        self._is_busy = False
        self._is_given_up = False
        self._changed_s = self._status_s = 0.0
        self._rate = SmoothedRate(RATE_TIME_CONSTANT_S)
        self._messages: list[str] = []
        self._status_key: tuple[object, ...] = ()
        self.status = ResidualStatus()

    def open(self, opened: OpenedProject, catalog: ClipCatalog) -> None:
        """Take up a project, or the same one with other settings."""
        self._end()
        self._opened, self._catalog = opened, catalog
        self._seen, self._revisions = None, ("",) * len(opened.clips)
        self._stamps, self._written = {}, set()
        usable = opened.project.document.exclusions.usable(opened.rig.names, opened.capture.n_frames)
        self._figures = Figures(opened.clips, len(opened.rig), usable)
        self._look, self._messages = None, []
        self._take_catalog()
        self._remake()

    def look_at(self, timeline: Timeline, camera_index: int | None) -> None:
        """Set what the user looks at, which is measured first. Nothing is measured before the first call."""
        clip = timeline.clip
        if clip is not None:
            self._look = MeasuringFocus(clip.clip_index, camera_index)

    def poll(self, *, is_busy: bool) -> bool:
        """Take in figures, and start missing work. Returns whether the status has changed.

        Args:
            is_busy: Whether a clip trains now, or the user looks around: cores are needed for that.
        """
        if self._opened is None:
            return False
        self._is_busy = is_busy
        self._take_catalog()
        self._take_measured()
        self._read_again()
        self._take_kept()
        if self._figures.has_stale_seams:
            self._figures.score_seams()
        self._start()
        self._tell()
        now_s = self._clock()
        key = (self._figures.revision, self._process is None, len(self._messages), self._is_held_back)
        is_reading = self._reader is not None
        if key == self._status_key or (now_s < self._status_s + STATUS_EVERY_S and not is_reading):
            return False
        self._status_key, self._status_s = key, now_s
        self._remake()
        return True

    def close(self) -> None:
        """End thread and process at once; measured figures are kept."""
        self._end()
        self._opened = None

    def _end(self) -> None:
        if self._reader is not None:
            self._reader.cancel()
        if self._process is not None:
            self._process.end()
        self._reader = self._process = self._told = None
        self._rate = SmoothedRate(RATE_TIME_CONSTANT_S)

    # ---------------------------------------------------------------- incoming

    def _take_catalog(self) -> None:
        """See which clips are trained, and were trained again."""
        catalog, opened = self._catalog, self._opened
        assert catalog is not None
        assert opened is not None
        seen = (id(catalog), catalog.revision)
        if seen == self._seen:
            return
        self._seen = seen
        records = [catalog[index] for index in range(len(opened.clips))]
        revisions = tuple(record.revision if record.state == "trained" else "" for record in records)
        if revisions == self._revisions:
            return
        changed = [index for index, known in enumerate(self._revisions) if known != revisions[index]]
        if opened.project.settings.config().field == "continue":  # all are seen with the field of the last one
            changed = list(range(len(revisions)))
        self._revisions = revisions
        for clip_index in changed:
            self._figures.forget(clip_index)
            self._stamps.pop(clip_index, None)
        trained = [index for index, revision in enumerate(revisions) if revision]
        self._figures.set_trained(trained)
        self._end()
        self._is_given_up, self._changed_s = False, self._clock()
        behind = [index + 1 for index in changed if index + 1 < len(revisions)]
        to_read = sorted({*changed, *behind} & {*trained})  # the pair at a boundary belongs to the clip behind it
        if to_read and (opened.project.folder / EVALUATIONS).is_dir():
            self._reader, self._is_reading_again = KeptReader(opened, trained, to_read), False

    def _read_again(self) -> None:
        """See what others have measured meanwhile."""
        opened, now_s = self._opened, self._clock()
        if opened is None or self._reader is not None or now_s < self._read_s + READ_AGAIN_S:
            return
        self._read_s = now_s
        clips = [index for index in self._figures.incomplete if index not in self._written]
        self._written = set()
        if clips and (opened.project.folder / EVALUATIONS).is_dir():
            trained = [index for index, revision in enumerate(self._revisions) if revision]
            self._reader, self._is_reading_again = KeptReader(opened, trained, clips, self._stamps), True

    def _take_kept(self) -> None:
        reader, is_news = self._reader, False
        if reader is None:
            return
        for found in reader.poll():
            if isinstance(found, str):
                if not self._is_reading_again:  # a line that is being written just now is not damaged
                    self._say(found)
                continue
            self._stamps[found.clip_index] = reader.stamps[found.clip_index]
            is_news = is_news or self._figures.lacks(found)
            self._figures.take(found)
        if reader.is_done:
            self._reader = None
        if is_news and self._is_reading_again:
            self._changed_s = self._clock() + READ_AGAIN_S
            if self._process is not None:
                self._process.end()
                self._process = self._told = None

    def _take_measured(self) -> None:
        process = self._process
        if process is None:
            return
        n_new = 0
        for event in process.poll():
            match event:
                case PictureMeasured(clip_index=clip_index, row=row, pair=pair):
                    self._written.add(clip_index)
                    n_new += row is not None
                    rows, pairs = () if row is None else (row,), () if pair is None else (pair,)
                    self._figures.take(ClipMeasurements(clip_index, rows, pairs))
                case Trouble(message=message):
                    self._say(message)
                case MeasuringEnded():
                    process.end()
                    self._process, self._is_given_up = None, True
        if n_new:
            if self._is_held_back:
                self._rate.pause()  # that speed does not hold for the rest
            self._rate.update(self._figures.n_done, self._clock())

    def _say(self, message: str) -> None:
        if message not in self._messages:
            self._messages.append(message)

    # ---------------------------------------------------------------- outgoing

    def _start(self) -> None:
        """Start measuring where something is missing and nothing stands in the way."""
        opened, look = self._opened, self._look
        if opened is None or look is None or self._process is not None or self._reader is not None:
            return
        if self._is_given_up or self._clock() < self._changed_s + START_AFTER_S:
            return
        rows, pairs = self._figures.unknown_rows, self._figures.unknown_pairs
        self._is_given_up = True
        if not (rows | pairs).any():
            return
        self._is_given_up = False
        capture = opened.capture
        job = MeasureJob(
            project=str(opened.project.folder),
            capture=str(capture.path),
            scale=capture.scale,
            frames=capture.frames,
            follow_links=capture.follow_links,
            trained=tuple(index for index, revision in enumerate(self._revisions) if revision),
            rows=rows,
            pairs=pairs,
            is_kept=opened.project.is_writable,
            look=look,
            share=self._share,
        )
        self._told = (look, self._share)
        self._rate.update(self._figures.n_done, self._clock())
        self._process = self._launch(job)

    def _tell(self) -> None:
        """Send the process the changes since the last message."""
        if self._process is None or self._told is None or self._look is None:
            return
        look, share = self._told
        if look != self._look:
            self._process.send(LookAt(self._look))
        if share != self._share:
            self._process.send(SetShare(self._share))
        self._told = (self._look, self._share)

    @property
    def _share(self) -> float:
        return SHARE_WHILE_BUSY if self._is_busy and n_cores() < N_CORES_ENOUGH else 1.0

    @property
    def _is_held_back(self) -> bool:
        return self._process is not None and self._share < 1.0

    def _remake(self) -> None:
        figures, opened = self._figures, self._opened
        holdout: Sequence[int] = () if opened is None else opened.holdout
        if self._catalog is not None:
            self._catalog.note_evaluated(figures.held_out_psnr(holdout))
        cells = {column: figures.cells[column].astype(np.float32) for column in CELL_COLUMNS}
        for values in cells.values():
            values.flags.writeable = False
        n_done, n_all = figures.n_done, figures.n_all
        is_measuring = self._process is not None
        is_known = is_measuring and self._rate.seconds >= FORECAST_AFTER_S
        self.status = ResidualStatus(
            seams=tuple(figures.seams),
            cells=cells,
            is_held_out=tuple(camera in holdout for camera in range(figures.n_cameras)),
            measured=figures.measured,
            n_done=n_done,
            n_all=n_all,
            is_measuring=is_measuring,
            is_held_back=self._is_held_back,
            rate=self._rate.per_s if is_measuring else 0.0,
            eta_s=self._rate.eta_s(n_all - n_done) if is_known else None,
            message=" ".join(self._messages),
            revision=figures.revision,
        )
