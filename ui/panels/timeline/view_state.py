"""The part of time that a window shows, and its unit. State of widgets; the playhead is in app.playback.timeline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from app.playback.timeline import Timeline
from app.status import ClipStatus, ResidualStatus, SeamStatus
from engine.capture.clip import Clip
from ui.panels.timeline.rows.columns import ClipColumns, clip_columns, frame_psnr, seam_ratios
from ui.panels.timeline.rows.rows import LANES
from ui.panels.timeline.time_range import TimeRange, range_around, whole_range
from ui.panels.timeline.units import FRAMES, UNITS

ZOOM_STEP = 1.25
"""By how much one tick of the wheel or one press of a key zooms."""
PAN_SHARE = 0.15
"""Share of the shown part by which one tick of the wheel or one press of a key moves."""


@dataclass
class TimelineView:
    """Zoom, unit and folded lanes of one timeline.

    Attributes:
        shown: The frames that are shown; None for all of them, however many there are.
        unit: Of the ruler.
        folded: Lanes that are folded away.
        pressed_seam: First frame of the clip whose boundary the pointer was pressed on; None else.
        is_panning: Whether the middle button drags the view.
        overview_grip: Where in its window the overview is held, in frames from its start; None while it is not.
        is_jump_wanted, is_marker_wanted, is_menu_wanted: A key has asked for the box or the menu.
        menu_frame: The frame whose clip the menu is of.
        jump_text, jump_words: In the box that takes a time.
        marker_frame, marker_name: The marker whose name is being written.
        pressed_marker: Frame of the marker that is held with the pointer; None while none is.
        marker_from: Where it was pressed, units of the screen; None once that has become a drag.
        segment: Number of the chosen segment of the take; None without one.
        is_segment_pressed: Whether the pointer was pressed on a segment.
        gesture: Number of what is done to markers; see app.session.editing.edit_commands.
    """

    shown: TimeRange | None = None
    unit: str = FRAMES
    folded: set[str] = field(default_factory=set)
    pressed_seam: int | None = None
    is_panning: bool = False
    overview_grip: float | None = None
    is_jump_wanted: bool = False
    is_marker_wanted: bool = False
    is_menu_wanted: bool = False
    menu_frame: int = 0
    jump_text: str = ""
    jump_words: str = ""
    marker_frame: int = 0
    marker_name: str = ""
    pressed_marker: int | None = None
    marker_from: float | None = None
    segment: int | None = None
    is_segment_pressed: bool = False
    gesture: int = 0
    _of: object = None
    _seen_frame: int = 0
    _columns: tuple[tuple[ClipStatus, ...], ClipColumns] | None = field(default=None, repr=False)
    _ratios: tuple[tuple[SeamStatus, ...], int, np.ndarray] | None = field(default=None, repr=False)
    _frame_psnr: tuple[tuple[int, int], np.ndarray] | None = field(default=None, repr=False)

    def take_up(self, capture: object, timeline: Timeline) -> None:
        """Once per frame: all of a capture that was just opened, and the page with a playhead that has moved on."""
        if self._of is not capture:
            self._of, self.shown, self._seen_frame = capture, None, timeline.frame_index
        if self.shown is not None:
            self.shown = self.shown.within(timeline.n_frames)
            if timeline.frame_index != self._seen_frame:
                self.shown = self.shown.showing(timeline.frame_index, timeline.n_frames)
        self._seen_frame = timeline.frame_index

    def begin_gesture(self) -> int:
        """Start something that is taken back at once. Returns its number."""
        self.gesture += 1
        return self.gesture

    def range_of(self, n_frames: int) -> TimeRange:
        """The shown range of so many frames."""
        return whole_range(n_frames) if self.shown is None else self.shown

    @property
    def is_zoomed(self) -> bool:
        """Whether there is more than is shown."""
        return self.shown is not None

    def show(self, shown: TimeRange, n_frames: int) -> None:
        """Show other frames; all of them is the same as no zoom."""
        self.shown = None if shown.covers(n_frames) else shown

    def show_all(self) -> None:
        """Show the whole capture."""
        self.shown = None

    def zoom(self, n_steps: float, at: float, n_frames: int) -> None:
        """Closer, or farther where negative; the position `at` stays where it is."""
        self.show(self.range_of(n_frames).zoomed(ZOOM_STEP**n_steps, at, n_frames), n_frames)

    def zoom_at_playhead(self, n_steps: float, timeline: Timeline) -> None:
        """Closer or farther about the playhead, or about the middle where it is out of sight."""
        shown = self.range_of(timeline.n_frames)
        at = timeline.frame_index + 0.5
        is_seen = shown.start <= at <= shown.stop
        self.zoom(n_steps, at if is_seen else (shown.start + shown.stop) / 2, timeline.n_frames)

    def pan(self, n_steps: float, n_frames: int) -> None:
        """Later by a share of the shown part, or earlier where negative."""
        self.pan_by(n_steps * PAN_SHARE * self.range_of(n_frames).length, n_frames)

    def pan_by(self, n_moved: float, n_frames: int) -> None:
        """Later by some frames, or earlier where negative."""
        if self.shown is not None:
            self.shown = self.shown.panned(n_moved, n_frames)

    def show_clip(self, clip: Clip, n_frames: int) -> None:
        """One clip, as large as it gets."""
        self.show(range_around(clip.start, clip.stop, n_frames), n_frames)

    def toggle_fit(self, timeline: Timeline) -> None:
        """The whole capture; where that is shown already, the clip under the playhead."""
        if self.is_zoomed or timeline.clip is None:
            self.show_all()
        else:
            self.show_clip(timeline.clip, timeline.n_frames)

    def next_unit(self) -> None:
        """Count in the next unit."""
        self.unit = UNITS[(UNITS.index(self.unit) + 1) % len(UNITS)]

    def toggle_lane(self, name: str) -> None:
        """Fold a lane away, or out again."""
        self.folded ^= {name}

    def restore(self, unit: str, folded: Sequence[str]) -> None:
        """Take up the kept state, as far as it is valid."""
        self.unit = unit if unit in UNITS else FRAMES
        self.folded = {*folded} & {*LANES}

    # ---------------------------------------------------------------- columns, made anew when something has changed

    def columns(self, clip_states: Sequence[ClipStatus]) -> ClipColumns:
        """All clips as columns."""
        key = tuple(clip_states)
        if self._columns is None or self._columns[0] != key:
            self._columns = key, clip_columns(key)
        return self._columns[1]

    def ratios(self, seams: Sequence[SeamStatus], n_clips: int) -> np.ndarray:
        """All seams as a column."""
        key = tuple(seams)
        if self._ratios is None or self._ratios[1] != n_clips or self._ratios[0] != key:
            self._ratios = key, n_clips, seam_ratios(key, n_clips)
        return self._ratios[2]

    def frame_psnr(self, status: ResidualStatus) -> np.ndarray:
        """All frames as a column."""
        cells = status.cells.get("psnr")
        key = (status.revision, id(cells))
        if self._frame_psnr is None or self._frame_psnr[0] != key:
            self._frame_psnr = key, frame_psnr(status)
        return self._frame_psnr[1]
