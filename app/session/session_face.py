"""SessionFace: the reading half of a session: the open project, files of its clips, pictures and arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.background.jobs import Jobs
from app.background.log_reader import LogLine, LogView
from app.playback.modes.arrays import AnchorArrays, GaussianArrays, Picture, PointArrays
from app.playback.modes.coverage import CoveredSpace
from app.playback.modes.trails import Trails
from app.playback.modes.view_modes import MODES, ShownAs
from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.playback.views.bookmarks import Bookmarks
from app.playback.views.orbit_view import OrbitView
from app.playback.views.views import Views
from app.project.disk.use import DiskUse
from app.project.opening.opened_project import OpenedProject
from app.project.project import Project
from app.residuals.anchor_heat import AnchorHeat
from app.residuals.heat_map import HeatMap
from app.residuals.residuals import Residuals
from app.session.captures.capture_doctor import CaptureDoctor
from app.session.captures.doctor_status import DoctorStatus
from app.session.captures.recording_follower import RecordingFollower
from app.session.clips.clip_work import ClipWork
from app.session.editing.kept_document import KeptDocument
from app.session.editing.selecting import ProjectSelecting
from app.session.projects.projects import Projects
from app.session.projects.recent_projects import RecentProjects
from app.session.questions import Asked, Question
from app.session.showing.other_project import OtherProject
from app.session.showing.showing import Showing
from app.session.training.clip_versions import Versions
from app.session.training.live_training import LiveTraining
from app.status import (
    PROJECT,
    DependencyStatus,
    JobStatus,
    OtherStatus,
    Overlays,
    RecordingStatus,
    ResidualStatus,
    TrainingStatus,
    VersionStatus,
    WantedFrame,
    version_number,
)
from app.training.service import ShownState
from engine.camera.rig import NO_CAMERAS, CameraRig
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.capture.exclusions import NOTHING_EXCLUDED, Exclusions
from engine.editing.edit import Picked
from engine.editing.selection.ranges import ValueSpread
from engine.editing.selection.seen_from import SeenFrom


class SessionFace:
    """The reading half of a Session, see there."""

    projects: Projects
    showing: Showing
    other: OtherProject
    training: TrainingStatus
    document: KeptDocument
    doctor: CaptureDoctor
    live_training: LiveTraining
    versions: Versions
    clip_work: ClipWork
    selecting: ProjectSelecting
    recording: RecordingFollower
    log: LogView
    asked: Asked
    _jobs: Jobs

    # ---------------------------------------------------------------- the open project

    @property
    def opened(self) -> OpenedProject | None:
        """The open project; None before."""
        return self.projects.opened

    @property
    def capture(self) -> Capture | None:
        """The open capture."""
        return None if self.opened is None else self.opened.capture

    @property
    def project(self) -> Project | None:
        """Its project."""
        return None if self.opened is None else self.opened.project

    @property
    def rig(self) -> CameraRig:
        """Cameras of the open capture; without one, none."""
        return NO_CAMERAS if self.opened is None else self.opened.rig

    @property
    def clips(self) -> tuple[Clip, ...]:
        """Clips of the open capture."""
        return () if self.opened is None else self.opened.clips

    @property
    def holdout(self) -> tuple[int, ...]:
        """Camera indices that training never sees."""
        return () if self.opened is None else self.opened.holdout

    @property
    def reference_index(self) -> int:
        """The clip that the others inherit from."""
        return 0 if self.opened is None else self.opened.reference_index

    @property
    def recent(self) -> RecentProjects:
        """Projects opened lately."""
        return self.projects.recent

    @property
    def recording_status(self) -> RecordingStatus:
        """Whether the recording of the open capture is followed."""
        return self.recording.status()

    @property
    def question(self) -> Question | None:
        """The question to the user; None while there is none."""
        return self.asked.question

    # ---------------------------------------------------------------- the shown picture

    @property
    def timeline(self) -> Timeline:
        """Which frame; the window may change it directly, and so with views and bookmarks."""
        return self.showing.timeline

    @property
    def views(self) -> Views:
        """From where."""
        return self.showing.views

    @property
    def bookmarks(self) -> Bookmarks:
        """Places to go back to."""
        return self.showing.bookmarks

    @property
    def view(self) -> OrbitView:
        """From where the current view looks."""
        return self.showing.view

    @property
    def overlays(self) -> Overlays:
        """Overlays of the current view."""
        return self.showing.overlays

    @property
    def other_project(self) -> OtherStatus | None:
        """The project that the open one can be compared with; None where none is chosen."""
        return self.other.status

    @property
    def playback(self) -> Playback:
        """Prepares the shown pictures."""
        return self.showing.playback

    @property
    def residuals(self) -> Residuals:
        """Compares with the captured pictures."""
        return self.showing.residuals

    @property
    def exclusions(self) -> Exclusions:
        """Parts of the open capture that training never sees."""
        content = self.document.content
        return NOTHING_EXCLUDED if content is None else content.exclusions

    @property
    def residual_status(self) -> ResidualStatus:
        """Measurements of every picture."""
        return self.residuals.status

    @property
    def doctor_status(self) -> DoctorStatus:
        """Findings of the capture doctor, or how far it is."""
        return self.doctor.status

    @property
    def jobs(self) -> list[JobStatus]:
        """Short jobs that run."""
        return self._jobs.statuses

    # ---------------------------------------------------------------- trainings and their files

    def clip_curves(self, clip_index: int) -> tuple[Sequence[tuple[int, float]], Sequence[tuple[int, float]]] | None:
        """(step, value) of a clip's loss and of its held-out PSNR in dB; None until they were read."""
        curves = self.live_training.curves(clip_index)
        return None if curves is None else (curves.loss, curves.psnr)

    def clip_versions(self, clip_index: int) -> tuple[VersionStatus, ...]:
        """Earlier versions of a clip, newest first; none until they were read."""
        return self.versions.statuses(clip_index)

    def clip_dependencies(self, clip_index: int) -> DependencyStatus:
        """The clips that a clip depends on, and those that depend on it."""
        return self.clip_work.dependencies(clip_index)

    def disk_use(self) -> DiskUse | None:
        """The project's use of the disk; None until that was looked up."""
        return self.clip_work.disk_use()

    def version_state(self, clip_index: int, version: int) -> ShownState | None:
        """An earlier version of a clip as a file to show; None until it was read, and where it cannot be shown."""
        return self.versions.state(clip_index, version)

    def log_lines(self, clip_index: int | None = None) -> Sequence[LogLine]:
        """Lines of the program and of the training of a clip, in the order of time.

        Args:
            clip_index: When None, the clip at the playhead if it trains, else the one that leads the training, else the
                one at the playhead.
        """
        clip, project = self.timeline.clip, self.project
        if clip_index is None and clip is not None:
            clip_index = clip.clip_index
            if self.training.state not in ("idle", "failed") and self.training.of_clip(clip_index) is None:
                clip_index = self.training.clip_index
        if project is None or clip_index is None:
            return self.log.lines(None, None)
        return self.log.lines(clip_index, project.log_path(clip_index))

    # ---------------------------------------------------------------- pictures and arrays

    def wanted_frame(self) -> WantedFrame | None:
        """The frame that ought to be on screen; None without a capture. The shown one states its source."""
        return self.playback.wanted(self.timeline, self.view, self.showing.shown_as, view_id=self.views.current_index)

    def shown_gaussians(self) -> GaussianArrays | None:
        """Gaussians of the shown frame; the newest ones there are until those are decoded; None where nothing is
        trained."""
        shown = self.playback.frame(self.timeline, self.showing.shown_as)
        return None if shown is None else shown.gaussians

    def selected(self, gaussians: GaussianArrays) -> np.ndarray:
        """Which Gaussians of a frame are selected. [N] bool"""
        return self.selecting.mask(gaussians)

    def selected_share(self, gaussians: GaussianArrays, view: SeenFrom) -> np.ndarray | None:
        """Where selected Gaussians are seen; see Selecting.share."""
        return self.selecting.share(gaussians, view, self.views.current_index)

    def object_share(self, object_id: int, gaussians: GaussianArrays, view: SeenFrom) -> np.ndarray | None:
        """Where an object is seen in the frame at the playhead, as `selected_share` has it; None without it."""
        content = self.document.content
        objects = () if content is None else content.objects
        one = next((one for one in objects if one.object_id == object_id), None)
        picked = Picked(()) if one is None else one.picked(self.timeline.frame_index)
        return self.selecting.share_of(picked, gaussians, view, (self.views.current_index, object_id))

    def attribute_spread(self, attribute: str) -> ValueSpread | None:
        """How an attribute is spread over the shown frame; see Selecting.spread."""
        return self.selecting.spread(attribute)

    def shown_anchors(self) -> AnchorArrays | None:
        """Anchors that exist at the shown frame; those of the newest frame there is until it was decoded."""
        shown = self.playback.frame(self.timeline, self.showing.shown_as)
        return None if shown is None else shown.anchors

    def shown_coverage(self) -> CoveredSpace | None:
        """The space covered by inherited anchors; see Playback.coverage."""
        return self.playback.coverage(self.timeline)

    def shown_trails(self) -> Trails | None:
        """The ways of moving Gaussians; see Playback.trails."""
        return self.playback.trails(self.timeline)

    def shown_points(self) -> PointArrays | None:
        """A cloud for frames that are not trained; see Playback.cloud."""
        return self.playback.cloud(self.view)

    def request_render(self, width: int, height: int, *, full_size: tuple[int, int] | None = None) -> Picture | None:
        """The rasterizer's picture of the frame and view; see Playback.render."""
        view_id = self.views.current_index
        return self.playback.render(
            self.timeline,
            self.view,
            width,
            height,
            full_size=full_size,
            shown_as=self.showing.shown_as,
            view_id=view_id,
        )

    def request_other(self, width: int, height: int, *, full_size: tuple[int, int] | None = None) -> Picture | None:
        """The rasterizer's picture that the rendered one is compared with; None where that is a captured one."""
        other, state_of = self.overlays.compare_with, None
        view_id = ("other", self.views.current_index)
        if other == PROJECT:
            shown_as = self.showing.shown_as
            return self.other.picture(width, height, full_size=full_size, shown_as=shown_as, view_id=view_id)
        version = version_number(other)
        if version is not None:
            other, state_of = self.overlays.mode, lambda clip_index: self.version_state(clip_index, version)
        if other not in MODES:
            return None
        shown_as = ShownAs(other, self.overlays.content)
        return self.playback.render(
            self.timeline,
            self.view,
            width,
            height,
            full_size=full_size,
            shown_as=shown_as,
            view_id=view_id,
            state_of=state_of,
        )

    @property
    def loading(self) -> tuple[int, int] | None:
        """Frames around a seam that are ready, and all of them, while playing waits for that; None else."""
        return self.playback.loading

    def cached_frames(self) -> list[tuple[int, int]]:
        """Frames that can be shown at once: first and stop of each run, in order."""
        return self.playback.cached_frames()

    def ground_truth(self, camera_index: int, frame_index: int, max_width: int) -> Picture | None:
        """The captured picture, at most `max_width` pixels wide; None until it was decoded."""
        return self.playback.captured_picture(camera_index, frame_index, max_width)

    def compared_picture(self, camera_index: int, max_width: int) -> Picture | None:
        """A camera's picture at the playhead, to compare with the render; see Playback.compared_picture."""
        return self.playback.compared_picture(self.timeline, camera_index, max_width)

    def anchor_heat(self, column: str) -> AnchorHeat | None:
        """The residual of each anchor at the playhead; see Residuals.anchor_heat."""
        return self.residuals.anchor_heat(self.timeline, column)

    def heat(self, kind: str) -> HeatMap | None:
        """The residual heat map of the playhead and the camera looked through; see Residuals.heat."""
        camera_index = self.view.look_through
        return None if camera_index is None else self.residuals.heat(self.timeline, camera_index, kind)
