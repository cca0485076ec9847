"""A Session stand-in with the surface the window uses: a small made-up capture, no files, no threads, no worker.

Every command is recorded in `commands`; those that only change what is shown are carried out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from app.background.log_reader import LogLine
from app.document.changes.object_changes import add_object
from app.document.changes.timing_changes import TimeEdit, timing_changed
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.export.export_choices import ExportChoices
from app.export.export_plan import ExportPlan
from app.export.queue.export_status import ExportStatus
from app.playback.markers import Markers
from app.playback.modes.arrays import AnchorArrays, GaussianArrays, Picture, PointArrays
from app.playback.modes.coverage import CoveredSpace
from app.playback.modes.trails import Trails
from app.playback.modes.view_modes import MODES, ShownAs
from app.playback.picture_source import PictureSource
from app.playback.timeline import Timeline
from app.playback.views.bookmarks import Bookmarks
from app.playback.views.orbit_view import OrbitView
from app.playback.views.views import Views
from app.project.disk.use import DiskUse
from app.project.opening.capture_report import RefusedFolder
from app.project.opening.opening_answers import OpeningAnswers
from app.project.recents import RecentProject
from app.residuals.anchor_heat import AnchorHeat
from app.residuals.heat_map import HEAT_KINDS, HeatMap
from app.session.captures.calibration_page import CalibrationPage
from app.session.captures.capture_commands import LookAtVideos
from app.session.captures.doctor_status import DoctorStatus
from app.session.captures.synchronisation_page import SynchronisationPage
from app.session.commands import CloseQuestion, Command, DismissNotice
from app.session.copying.command_texts import CommandTexts
from app.session.edit_status import EditsStatus, HistoryStatus, PathsStatus
from app.session.editing.edit_commands import EditCommand
from app.session.editing.edits import Change, changed, edits_status
from app.session.editing.mark_commands import MarkRegion, RemoveRegion
from app.session.editing.selection_status import SelectionStatus
from app.session.exporting import ExportPage
from app.session.marking import after_marking
from app.session.mending.mend_page import MendPage
from app.session.notices import Notices
from app.session.objects import objects
from app.session.objects.object_commands import CorrectObject, FindObject, MakeObject, ObjectCommand, SelectObject
from app.session.paths import path_commands
from app.session.paths.path_edits import edited
from app.session.projects.project_commands import OpenCapture, OpenProject
from app.session.questions import OpeningPage, Question, RetrainQuestion
from app.session.showing.look_commands import (
    ActivateView,
    FollowTraining,
    HomeView,
    LookThrough,
    SetCompare,
    SetCompareWith,
    SetContent,
    SetFrame,
    SetMode,
    ShowHeat,
    ShowViews,
    ToggleOverlay,
    TogglePlay,
)
from app.session.training.train_commands import TrainClip
from app.status import (
    CELL_RANGES,
    PROJECT,
    ClipStatus,
    DependencyStatus,
    JobStatus,
    OpeningForecast,
    OtherStatus,
    Overlays,
    PlanStatus,
    ProjectStatus,
    QueueStatus,
    RecordingStatus,
    RegionsStatus,
    ResidualStatus,
    SeamStatus,
    SettingStatus,
    TrainingStatus,
    UsageStatus,
    VersionStatus,
    WantedFrame,
)
from engine.camera.rig import NO_CAMERAS, CameraRig
from engine.capture.clip import Clip, split_clips
from engine.capture.exclusions import NOTHING_EXCLUDED
from engine.doctor.finding import Finding
from engine.editing.edit import PickedRows
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectSeed
from engine.editing.selection.ranges import ValueSpread, spread_of
from engine.editing.selection.seen_from import SeenFrom
from engine.gate.regions import GateRegion, sphere_region
from engine.timing.timing import TakeTiming


def make_rig(n_cameras: int = 8, width: int = 320, height: int = 240) -> CameraRig:
    """Cameras on a ring of radius 3, slightly above, all looking at the origin; y points down."""
    maps, Ks = [], []
    for angle in np.linspace(0, 2 * np.pi, n_cameras, endpoint=False):
        center = np.array([3 * np.cos(angle), -0.8, 3 * np.sin(angle)])
        forward = -center / np.linalg.norm(center)
        right = np.cross(np.array([0.0, 1.0, 0.0]), forward)
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ center
        maps.append(matrix)
        Ks.append(np.array([[width * 0.9, 0, width / 2], [0, width * 0.9, height / 2], [0, 0, 1.0]]))
    return CameraRig(
        names=tuple(f"cam{i:02d}" for i in range(n_cameras)),
        world_to_camera=np.stack(maps),
        Ks=np.stack(Ks),
        image_sizes=np.tile(np.array([[width, height]]), (n_cameras, 1)),
    )


@dataclass(frozen=True)
class FakeCapture:
    """What the panels read of a Capture."""

    rig: CameraRig
    path: Path = Path("/captures/juggling_room")
    format: str = "sample"
    n_frames: int = 30
    fps: float = 30.0
    has_pictures: bool = True


@dataclass
class FakePictures:
    """What the panels read of ProjectPictures."""

    found: dict[Path, Picture] = field(default_factory=dict)


@dataclass
class FakeRecent:
    """What the panels read of RecentProjects."""

    entries: list[RecentProject]
    missing: frozenset[Path]
    pictures: FakePictures = field(default_factory=FakePictures)


@dataclass
class FakeOpening:
    """What the dialog reads of CaptureOpening; `asked` are the answers that a forecast was wanted for."""

    page: OpeningPage | None = None
    refused: RefusedFolder | None = None
    pictures: dict[int, Picture] = field(default_factory=dict)
    findings: tuple[Finding, ...] | None = None
    found: OpeningForecast | None = None
    asked: list[OpeningAnswers] = field(default_factory=list)

    def forecast(self, answers: OpeningAnswers) -> tuple[OpeningForecast | None, bool]:
        """What was made up."""
        self.asked.append(answers)
        return self.found, True

    def problem(self, answers: OpeningAnswers) -> str:
        """As the real one has it."""
        assert self.page is not None
        n_left = len(self.page.report.cameras) - len(answers.holdout)
        if self.page.report.needs_fit and answers.fit is None:
            return "Say whether frames were scaled or cropped."
        return "Fewer than two cameras are left for training." if n_left < 2 else ""


@dataclass
class FakeCalibrating:
    """What the dialog reads of Calibrating."""

    page: CalibrationPage | None = None
    progress: JobStatus | None = None


@dataclass
class FakeSynchronising:
    """What the dialog reads of Synchronising."""

    page: SynchronisationPage | None = None
    progress: JobStatus | None = None


@dataclass
class FakeMending:
    """What the window of mending reads."""

    page: MendPage | None = None
    progress: JobStatus | None = None


@dataclass
class FakeExporting:
    """What the window reads of Exporting; `asked` are the choices that a plan was wanted for.

    While `is_looking` no name was found yet.
    """

    page: ExportPage | None = None
    statuses: tuple[ExportStatus, ...] = ()
    found: ExportPlan | None = None
    asked: list[ExportChoices] = field(default_factory=list)
    is_looking: bool = False

    def plan(self, choices: ExportChoices) -> ExportPlan | None:
        """What was made up."""
        self.asked.append(choices)
        return self.found

    def suggest(self, choices: ExportChoices) -> str | None:
        """A name that tells what it was made of; none while `is_looking`."""
        return None if self.is_looking else f"/out/{choices.kind}"


@dataclass
class FakeJoining:
    """A cluster that is joined, or can be."""

    can_join: bool = False
    address: str = ""


class FakeSession:
    """See the module docstring. `has_capture=False` starts empty."""

    def __init__(self, *, has_capture: bool = True, seed: int = 0) -> None:
        self.commands: list[Command] = []
        self.notices = Notices()
        self.jobs: list[JobStatus] = []
        self.recent = FakeRecent(
            entries=[
                RecentProject("/projects/kitchen-toy", "/captures/kitchen", "kitchen-toy", 2, 3),
                RecentProject("/projects/gone", "/captures/dance_floor", "gone", 1, 70),
                RecentProject("", "/captures/dance_floor", "dance_floor"),
            ],
            missing=frozenset({Path("/projects/gone")}),
        )
        self.project_status: ProjectStatus | None = None
        self.question: Question | None = None
        self.opening = FakeOpening()
        self.calibrating = FakeCalibrating()
        self.synchronising = FakeSynchronising()
        self.exporting = FakeExporting()
        self.joining = FakeJoining()
        self.mending = FakeMending()
        self.queue = QueueStatus()
        self.usage = UsageStatus(window_mb=412.0, window_cores=0.1, n_cores=2)
        self.disk: DiskUse | None = None
        self.exclusions = NOTHING_EXCLUDED
        self.versions: dict[int, tuple[VersionStatus, ...]] = {}
        self.curves: dict[int, tuple[list[tuple[int, float]], list[tuple[int, float]]]] = {}
        self.lines: tuple[LogLine, ...] = ()
        self.log_clip: int | None = None
        self.training = TrainingStatus(can_train_next=True, next_clip_index=0)
        self.plan: PlanStatus | None = PlanStatus(
            clip_index=0,
            summary="4,140 steps, about 1:20, 0.8 GB of memory, 1.2 MB stored",
            lines=(("pictures", "180"), ("training", "64 s")),
            presets=("toy", "small"),
            preset="small",
            settings=(SettingStatus("joint_steps", "Joint steps", 3600),),
            can_edit=True,
        )
        self.holdout: tuple[int, ...] = (0, 3)
        self.reference_index = 0
        self.is_closed = False
        self.n_renders = 0
        random = np.random.default_rng(seed)
        self._points = random.normal(0, 0.6, (6000, 3)).astype(np.float32)
        self._colors = (0.5 + 0.5 * np.sin(self._points * 3 + np.array([0, 2, 4]))).astype(np.float32)
        inherited_roles = np.repeat(np.arange(3, dtype=np.uint8), 500)  # static, moving, promoted
        self._anchors = AnchorArrays(
            self._points[:1500],
            self._points[1500:1800] * 0.4,
            key=("anchors", 0),
            inherited_roles=inherited_roles,
            own_roles=np.full(300, 3, np.uint8),
            inherited_reasons=np.where(inherited_roles == 2, 2, 255).astype(np.uint8),
            own_reasons=np.full(300, 255, np.uint8),
        )
        self.selection = SelectionStatus()
        self.command_texts = CommandTexts(lambda: None, lambda clip_index: False)
        self.regions = RegionsStatus(why_not="Open a capture first.")
        self.paths, self.history = PathsStatus(why_not="Open a capture first."), HistoryStatus()
        self.edits, self.content = (
            EditsStatus(why_not="Open a capture first."),
            ProjectDocument(ProjectSettings("", "")),
        )
        self.capture: FakeCapture | None = None
        self.rig: CameraRig = NO_CAMERAS
        self.clips: list[Clip] = []
        self.clip_states: list[ClipStatus] = []
        self.measured: ResidualStatus | None = None  # in place of what residual_status makes up
        self.cached: list[tuple[int, int]] = []  # what cached_frames answers
        self.project = None
        self.doctor_status = DoctorStatus()
        self.recording_status = RecordingStatus()
        self.timeline, self.views = Timeline(), Views()
        self.bookmarks = Bookmarks()
        self.other_project: OtherStatus | None = None
        if has_capture:
            self._open(FakeCapture(make_rig()))

    @property
    def view(self) -> OrbitView:
        return self.views.current.view

    @property
    def overlays(self) -> Overlays:
        return self.views.current.overlays

    @property
    def residual_status(self) -> ResidualStatus:
        """Two cameras are not measured; frame 12 of camera 5 and the seam at frame 20 are bad."""
        if self.measured is not None:
            return self.measured
        n_frames, n_cameras = self.timeline.n_frames, len(self.rig)
        cells = {}
        for column, (low, high) in CELL_RANGES.items():
            values = np.full(
                (n_frames, n_cameras), 0.3 * low + 0.7 * high if column == "psnr" else 0.3 * high, np.float32
            )
            values[:, 6:] = np.nan
            values[12, 5] = low if column == "psnr" else high
            cells[column] = values
        seams = tuple(
            SeamStatus(clip.clip_index, clip.start, score, 1.0 + score / 2, n_cameras - 2, n_cameras - 2, 5)
            for clip, score in zip(self.clips[1:], (0.4, 2.6), strict=False)
        )
        held_out = tuple(index in self.holdout for index in range(n_cameras))
        n_done, n_all = n_frames * (n_cameras - 2), n_frames * n_cameras
        measured = dict.fromkeys(cells, (n_done, n_all))
        return ResidualStatus(seams, cells, held_out, measured=measured, n_done=n_done, n_all=n_all, revision=1)

    def anchor_heat(self, column: str) -> AnchorHeat | None:
        """Rises with the anchors' number; some were not seen."""
        positions = self._points[:1500]
        values = np.linspace(0.0, 25.0, len(positions), dtype=np.float32)
        values[::10] = np.nan
        frame_index = self.timeline.frame_index
        return AnchorHeat(
            positions, values, column, (column, frame_index), 0, frame_index, n_cameras=8, n_cameras_all=8
        )

    def selected(self, gaussians: GaussianArrays) -> np.ndarray:
        """Nothing."""
        return np.zeros(len(gaussians), np.bool_)

    def selected_share(self, gaussians: GaussianArrays, view: SeenFrom) -> np.ndarray | None:
        """Nothing."""
        return None

    def object_share(self, object_id: int, gaussians: GaussianArrays, view: SeenFrom) -> np.ndarray | None:
        """The middle of the picture."""
        share = np.zeros((48, 64), np.float32)
        share[16:32, 16:48] = 1.0
        return share

    def attribute_spread(self, attribute: str) -> ValueSpread | None:
        """Rises evenly from 0 to 1; residuals are not known."""
        return None if attribute in ("error", "flicker") else spread_of(np.linspace(0.0, 1.0, 1000))

    @property
    def loading(self) -> tuple[int, int] | None:
        """Nothing is waited for."""
        return None

    def cached_frames(self) -> list[tuple[int, int]]:
        """Runs of frames in memory."""
        return self.cached

    def heat(self, kind: str) -> HeatMap | None:
        """Grows from left to right over the range of its kind, differs between frames, and frame 0 has no E."""
        frame_index, camera_index = self.timeline.frame_index, self.view.look_through
        assert camera_index is not None
        clip_index = 0 if self.timeline.clip is None else self.timeline.clip.clip_index
        if kind in ("R", "G", "E", "clips") and frame_index == 0:
            return HeatMap(None, kind, None, 0, 0, camera_index, note="Frame 0 has no previous frame.")
        width, height = (int(side) for side in self.rig.image_sizes[camera_index])
        low, high = HEAT_KINDS[kind].value_range
        values = np.tile(np.linspace(low, high, width, dtype=np.float32), (height, 1))
        values[: frame_index % height] = low
        key = (kind, frame_index, camera_index)
        return HeatMap(values, kind, key, clip_index, frame_index, camera_index, mean=float(values.mean()))

    def _open(self, capture: FakeCapture) -> None:
        self.capture, self.rig = capture, capture.rig
        self.clips = split_clips(capture.n_frames, 10)
        self.clip_states = [ClipStatus() for _ in self.clips]
        self.project_status = ProjectStatus("juggling", Path("/projects/juggling"), 1, len(self.clips))
        self.timeline = Timeline(self.clips, fps=capture.fps)
        self.views.look_at(capture.rig)
        self.paths, self.history = PathsStatus(can_edit=True), HistoryStatus()
        self.edits = EditsStatus(can_edit=True)
        self.regions = RegionsStatus(can_mark=True, effect="Marks apply to clips trained from now on.")

    def dispatch(self, command: Command) -> None:
        """Record the command; carry out what needs no worker."""
        self.commands.append(command)
        match command:
            case OpenCapture(path=path):
                self.question = self.opening.page = self.opening.refused = None
                self.calibrating.page = self.synchronising.page = None
                self._open(replace(FakeCapture(make_rig()), path=Path(path)))
            case SetFrame():
                self.timeline.seek(command.frame_index)
            case TogglePlay():
                self.timeline.toggle_play()
            case FollowTraining(is_on=is_on):
                self.timeline.is_following = is_on
            case LookThrough():
                self.view.look(command.camera_index)
            case SetCompare(mode=mode):
                self.overlays.compare = mode
            case ToggleOverlay(name=name):
                setattr(self.overlays, name, not getattr(self.overlays, name))
            case SetCompareWith(other=other):
                self.overlays.compare_with = other
            case SetMode(mode=mode):
                self.overlays.mode = mode
            case SetContent(content=content):
                self.overlays.content = content
            case ShowHeat(kind=kind):
                self.overlays.heat = kind
            case HomeView():
                self.view.home()
            case ShowViews(n=n):
                self.views.show(n)
            case ActivateView(index=index):
                self.views.activate(index)
            case MarkRegion():
                sphere = sphere_region(command.treat, command.center, command.radius)
                self._set_regions(after_marking(self.regions.regions, [sphere]))
            case RemoveRegion(index=index):
                self._set_regions((*self.regions.regions[:index], *self.regions.regions[index + 1 :]))
            case path_commands.ChooseCameraKey(index=index):
                self.paths = replace(self.paths, chosen_key=index)
            case path_commands.ChooseCameraPath(row=row):
                self.paths = replace(self.paths, chosen=row, chosen_key=None)
            case path_commands.LookAlongPath(is_on=is_on):
                self.paths = replace(self.paths, along=self.views.current_index if is_on else None)
            case _ if isinstance(command, path_commands.PathEdit):
                result = edited(self.paths, command, self.view, self.timeline)
                self.paths = PathsStatus(result.paths, result.chosen, result.chosen_key, can_edit=True)
                self.history = HistoryStatus(undo=result.name)
            case _ if isinstance(command, TimeEdit):
                self.content = timing_changed(self.content, command, self.timeline.n_frames)
                self.edits = edits_status(self.content)
                self.history = HistoryStatus(undo=command.title, past=(*self.history.past, command.title))
                segments = self.content.timing
                self.timeline.timing = TakeTiming(segments, self.timeline.n_frames) if segments else None
            case _ if isinstance(command, EditCommand):
                change = changed(self.content, command)
                self.content, self.edits = change.document, edits_status(change.document)
                self.history = HistoryStatus(undo=change.name, past=(*self.history.past, change.name))
                self.timeline.markers = Markers(change.document.markers)
            case _ if isinstance(command, ObjectCommand):
                self._change_object(command)
            case TrainClip(clip_index=clip_index, is_confirmed=False):
                if self.clip_states[clip_index].state == "trained":
                    self.question = RetrainQuestion(clip_index, False, "", 29.7, (), None, True, None, None)
            case CloseQuestion() | OpenProject() | TrainClip(is_confirmed=True):
                self.question = self.opening.page = self.opening.refused = None
                self.calibrating.page = self.synchronising.page = None
            case LookAtVideos():
                self.opening.page = self.opening.refused = None
            case DismissNotice():
                self.notices.dismiss(command.index)

    def _change_object(self, command: ObjectCommand) -> None:
        """Of what is selected, nothing is known here."""
        if isinstance(command, MakeObject):
            rows = PickedRows(0, "a", "moving", pack_rows(np.arange(9)))
            frame_index = self.timeline.frame_index
            made = add_object(self.content, ObjectSeed(frame_index, (rows,)), name=command.name)
            change = Change(made, f"make {made.objects[-1].name}")
        elif isinstance(command, CorrectObject | FindObject | SelectObject):
            return
        else:
            change = objects.changed(self.content, command)
        self.content, self.edits = change.document, edits_status(change.document)
        self.history = HistoryStatus(undo=change.name, past=(*self.history.past, change.name))

    def _set_regions(self, regions: tuple[GateRegion, ...]) -> None:
        self.regions = replace(self.regions, regions=regions)
        self.history = HistoryStatus(undo="mark a region")

    def poll(self) -> bool:
        """Nothing happens by itself here."""
        return False

    def lead_view(self) -> bool:
        """The view goes nowhere by itself here."""
        return False

    def wake_by(self, wake: Callable[[], None]) -> None:
        """Pictures are there at once."""

    def close(self) -> None:
        """Remember that the window asked."""
        self.is_closed = True

    # ---- trainings and their files ---------------------------------------------------------------------------

    def clip_curves(self, clip_index: int) -> tuple[Sequence[tuple[int, float]], Sequence[tuple[int, float]]]:
        """What a test put there; for the clip of the status its histories."""
        if clip_index == self.training.curve_clip_index:
            return self.training.loss_history, self.training.psnr_history
        return self.curves.get(clip_index, ([], []))

    def clip_versions(self, clip_index: int) -> tuple[VersionStatus, ...]:
        """What a test put there."""
        return self.versions.get(clip_index, ())

    def clip_dependencies(self, clip_index: int) -> DependencyStatus:
        """The reference is needed by all others."""
        n = len(self.clips)
        if clip_index == self.reference_index:
            return DependencyStatus(needed_by=tuple(i for i in range(n) if i != clip_index))
        return DependencyStatus(needs=(self.reference_index,))

    def disk_use(self) -> DiskUse | None:
        """What a test put there."""
        return self.disk

    def log_lines(self, clip_index: int | None = None) -> tuple[LogLine, ...]:
        """What a test put there."""
        self.log_clip = clip_index
        return self.lines

    # ---- pictures --------------------------------------------------------------------------------------------

    def _is_trained(self) -> bool:
        clip = self.timeline.clip_of(self.timeline.frame_index)
        return clip is not None and self.clip_states[clip.clip_index].state == "trained"

    def wanted_frame(self) -> WantedFrame | None:
        """What is under the playhead; trained clips are there at once."""
        clip = self.timeline.clip
        if clip is None:
            return None
        is_trained = self._is_trained()
        return WantedFrame(
            clip.clip_index,
            self.timeline.frame_index,
            revision="trained" if is_trained else "",
            camera_index=self.view.look_through,
            look=self.view.look_key,
            shown_as=ShownAs(self.overlays.mode, self.overlays.content).label,
            is_loaded=is_trained,
        )

    def request_render(self, width: int, height: int, *, full_size: tuple[int, int] | None = None) -> Picture | None:
        """A gradient, for trained clips; where colours stand for numbers, those grow from 0 at the left to 1."""
        if not self._is_trained():
            return None
        self.n_renders += 1
        x = np.linspace(40, 200, width, dtype=np.float32)[None, :, None]
        y = np.linspace(60, 160, height, dtype=np.float32)[:, None, None]
        tint = np.array([1.0, 0.8, 0.6], dtype=np.float32)
        image = ((x * 0.5 + y * 0.5) * tint).astype(np.uint8)
        matrix = np.asarray(self.view.world_to_camera())
        frame_index = self.timeline.frame_index
        clip = self.timeline.clip_of(frame_index)
        assert clip is not None
        shown_as = ShownAs(self.overlays.mode, self.overlays.content)
        has_values = bool(MODES[shown_as.mode].map_name)
        return Picture(
            image,
            key=(frame_index, width, height, matrix.tobytes(), shown_as),
            values=np.tile(np.linspace(0, 1, width, dtype=np.float32), (height, 1)) if has_values else None,
            source=PictureSource(
                clip.clip_index,
                frame_index,
                "trained",
                camera_index=self.view.look_through,
                look=self.view.look_key,
                shown_as=shown_as,
            ),
        )

    def request_other(self, width: int, height: int, *, full_size: tuple[int, int] | None = None) -> Picture | None:
        """The same in green, in the mode that is compared with, or of the other project; None for a captured one."""
        other, project = self.overlays.compare_with, self.other_project
        picture = self.request_render(width, height, full_size=full_size)
        if picture is None or other not in (PROJECT, *MODES):
            return None
        source = replace(picture.source, shown_as=ShownAs(other if other in MODES else self.overlays.mode))
        if other == PROJECT and project is not None:
            if project.missing:
                return None
            source = replace(source, frame_index=min(self.timeline.frame_index, project.n_frames - 1))
        return replace(
            picture, image=picture.image * np.array([0, 1, 0], np.uint8), key=("other", picture.key), source=source
        )

    def shown_gaussians(self) -> None:
        """No Gaussians here."""
        return

    def shown_anchors(self) -> AnchorArrays | None:
        """Anchors of trained clips."""
        return self._anchors if self._is_trained() else None

    def shown_coverage(self) -> CoveredSpace | None:
        """Nothing is measured here."""
        return None

    def shown_trails(self) -> Trails | None:
        """Nothing moves here."""
        return None

    def shown_points(self) -> PointArrays:
        """A coloured ball of points."""
        return PointArrays(self._points, self._colors, ("points", 0))

    def compared_picture(self, camera_index: int, max_width: int) -> Picture:
        """Of the frame under the playhead."""
        return self.ground_truth(camera_index, self.timeline.frame_index, max_width)

    def ground_truth(self, camera_index: int, frame_index: int, max_width: int) -> Picture:
        """Stripes that differ per camera."""
        height = max_width * 3 // 4
        x = np.arange(max_width)[None, :, None] * 255 // max_width
        image = np.broadcast_to(x, (height, max_width, 3)).astype(np.uint8).copy()
        image[:, :, camera_index % 3] = (camera_index * 37) % 255
        key = (camera_index, frame_index, max_width)
        return Picture(image, key=key, source=PictureSource(frame_index=frame_index, camera_index=camera_index))
