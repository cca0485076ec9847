"""What the timeline reads of a session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from app.playback.timeline import Timeline
from app.session.edit_status import EditsStatus, PathsStatus
from app.status import ClipStatus, ResidualStatus, TrainingStatus
from engine.capture.clip import Clip
from ui.panels.training.clip_training_menu import ClipMenuNeeds


class TimelineNeeds(ClipMenuNeeds, Protocol):
    """What this panel reads."""

    @property
    def capture(self) -> object | None: ...

    @property
    def timeline(self) -> Timeline: ...

    @property
    def edits(self) -> EditsStatus: ...

    @property
    def paths(self) -> PathsStatus: ...

    @property
    def clips(self) -> Sequence[Clip]: ...

    @property
    def clip_states(self) -> Sequence[ClipStatus]: ...

    @property
    def residual_status(self) -> ResidualStatus: ...

    @property
    def training(self) -> TrainingStatus: ...

    @property
    def reference_index(self) -> int: ...

    def cached_frames(self) -> Sequence[tuple[int, int]]: ...
