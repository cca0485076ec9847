"""Showing: the picture that the user looks at, and everything behind it: the timeline, views, frames and residuals."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from app.background.jobs import Jobs
from app.document.project_document import ProjectDocument
from app.playback.markers import Markers
from app.playback.modes.view_modes import ShownAs
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.playback.views.bookmarks import Bookmarks
from app.playback.views.orbit_view import OrbitView
from app.playback.views.views import Views
from app.project.opening.opened_project import OpenedProject
from app.residuals.residuals import Residuals
from app.session.part import SessionPart
from app.session.showing.follow_training import follow_training
from app.session.showing.look_commands import LookCommand
from app.session.showing.looking import look
from app.session.showing.recent_input import Attention
from app.session.training.live_training import LiveTraining
from app.status import Overlays
from engine.timing.timing import TakeTiming


class Showing(SessionPart):
    """For one thread, and nothing here waits.

    Attributes:
        timeline, views, bookmarks: The window may change them directly.
        playback, residuals: Prepare the shown picture.

    Args:
        live: Of the session; opened before this, as its files are shown.
        jobs: Of the session.
        is_training: Whether cores are for a training now.
        is_preloading: Whether to build a first cloud of a new capture and to measure pictures.
    """

    def __init__(
        self, live: LiveTraining, jobs: Jobs, *, is_training: Callable[[], bool], is_preloading: bool = True
    ) -> None:
        self.timeline, self.views, self.bookmarks = Timeline(), Views(), Bookmarks()
        self.playback = Playback(live.state_of)
        self.residuals = Residuals(self.playback)
        self._live, self._jobs, self._is_training, self._is_preloading = live, jobs, is_training, is_preloading
        self._attention = Attention()
        self._opened: OpenedProject | None = None

    @property
    def view(self) -> OrbitView:
        """From where the current view looks."""
        return self.views.current.view

    @property
    def overlays(self) -> Overlays:
        """Overlays of the current view."""
        return self.views.current.overlays

    @property
    def shown_as(self) -> ShownAs:
        """In which mode, and which part of clips."""
        return ShownAs(self.overlays.mode, self.overlays.content)

    def obey(self, command: LookCommand) -> None:
        """Look at something else, or otherwise."""
        look(command, self.timeline, self.views, self.playback)

    # ---------------------------------------------------------------- the open project

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""
        self._show(opened)
        self.views.look_at(opened.rig)
        self._show_notes(opened.project.document)
        self.bookmarks = Bookmarks()
        if self._is_preloading:
            self.playback.build_first_cloud(self._jobs)

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        before = self.timeline
        self._show(opened)
        self.timeline.take_over(before)

    def _show(self, opened: OpenedProject) -> None:
        self._opened = opened
        self.timeline = Timeline(opened.clips, fps=opened.capture.fps)
        self.playback.show(opened)
        self._open_residuals()

    def _open_residuals(self) -> None:
        if self._opened is not None and self._live.service is not None:
            self.residuals.open(self._opened, self._live.service.catalog)

    def follow_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """Show the document's markers, let views stand upright by it, and judge residuals by its exclusions."""
        if before.settings == after.settings and before.exclusions != after.exclusions:
            if self._live.service is not None:
                self._live.service.catalog.judge_anew()
            self._open_residuals()
        self._show_notes(after)

    def _show_notes(self, document: ProjectDocument) -> None:
        self.timeline.markers = Markers(document.markers)
        n_frames = self.timeline.n_frames
        self.timeline.timing = TakeTiming(document.timing, n_frames) if document.timing and n_frames else None
        self.views.set_scene_up(document.world.up)

    # ---------------------------------------------------------------- letting finished work in

    def poll(self) -> bool:
        """Take in prepared pictures, and prepare the next ones."""
        self._release_snapshot()
        if not self.timeline.is_playing:  # clips that fly by need no live states
            clip = self.timeline.clip
            self._live.look_at(None if clip is None else clip.clip_index, is_following=self.timeline.is_following)
        is_training = self._is_training()
        is_attended = self._attention.follow((self.view.look_key, self.timeline.frame_index))
        if self._is_preloading:
            self.residuals.look_at(self.timeline, self.view.look_through)
        has_changed = self.residuals.poll(is_busy=is_training or is_attended)
        self.playback.work_ahead(self.timeline, is_busy=self._live.is_busy)
        rig = self.playback.rig(self.timeline)
        if rig is not None and rig is not self.view.rig:  # a view that looks through a camera follows it
            self.views.correct(rig)
            has_changed = True
        return has_changed

    def _release_snapshot(self) -> None:
        """Give a snapshot back once it was read, or where nobody looks at its clip."""
        if not self._live.unread_clips:
            return
        clip = self.timeline.clip
        is_read = clip is None or self.playback.is_loaded(self.timeline)
        self._live.give_back_snapshots(but=None if is_read or clip is None else clip.clip_index)

    def follow_training(self) -> None:
        """Take the playhead along with the training, if the user wants that, and report loaded clips to it."""
        follow_training(self.timeline, self._live)
        if self.timeline.clip is not None:
            self._live.note_anchors(self.timeline.clip.clip_index, self.playback.live_anchors(self.timeline))

    @property
    def finished(self) -> object:
        """Differs whenever a frame or picture is there."""
        return self.playback.finished

    def take_failures(self) -> Iterable[tuple[str, Exception]]:
        """Failures of the shown picture. Those of a live state are left out: another state follows."""
        told = []
        for failure in [*self.playback.take_failures(), *self.residuals.take_failures()]:
            if failure.is_live:
                self._live.replace_snapshot(failure.error)
                continue
            if failure.is_of_clip:
                self._live.note_damage(failure.error)
            told.append((failure.title, failure.error))
        return told

    def close(self) -> None:
        """End threads and processes."""
        self.residuals.close()
        self.playback.close()
