"""Playback: prepares everything that is shown of the open project. Frames of clips as arrays, clouds where nothing
is trained, captured pictures, and pictures drawn on the processor.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any

from app.background.jobs import Jobs
from app.background.latest import LatestWorker
from app.playback.ahead import Ahead, AskedLook, RequestOf, n_ahead
from app.playback.capture_pictures import CapturedPictures, PictureRequest
from app.playback.clip_requests import ClipRequests, StateOf
from app.playback.clouds import CloudRequest, Clouds
from app.playback.frame_decoder import FrameDecoder, FrameKey, FrameRequest, ShownFrame
from app.playback.modes.arrays import AnchorArrays, Picture, PointArrays
from app.playback.modes.coverage import CoverageFinder, CoveredSpace
from app.playback.modes.mode_arrays import ModeArrays
from app.playback.modes.trails import TrailMaker, TrailRequest, Trails, trail_frames
from app.playback.modes.view_modes import PLAIN, ShownAs
from app.playback.prefetch_order import Course
from app.playback.render import Renderer, RenderView
from app.playback.timeline import Timeline
from app.playback.views.orbit_view import OrbitView
from app.project.opening.opened_project import OpenedProject
from app.status import WantedFrame
from app.training.clip_run import ShownState
from engine.camera.rig import CameraRig
from engine.capture.clip import Clip
from engine.images.rendition import Rendition


@dataclass(frozen=True, slots=True)
class Failure:
    """Something that could not be shown.

    Attributes:
        title: The message to the user.
        is_of_clip: Whether the file of a clip caused it.
        is_live: Whether that file is a snapshot of a running training: it may be gone before it is read, and another
            one follows.
    """

    title: str
    error: Exception
    is_of_clip: bool = False
    is_live: bool = False


class Playback:
    """The pictures of the open project at a playhead and from a view. For one thread. Nothing here waits:
    a missing picture is asked for, and comes at a later call.

    Args:
        state_of: Of the clips of the open project.
    """

    def __init__(self, state_of: StateOf) -> None:
        self.decoder, self.renderer = FrameDecoder(), Renderer()
        self.captured, self.clouds = CapturedPictures(), Clouds()
        self.ahead = Ahead(self.decoder, self.renderer)
        self._modes, self._coverage, self._trails = ModeArrays(), CoverageFinder(), TrailMaker()
        self._opened: OpenedProject | None = None
        self._requests = ClipRequests(state_of)
        self._state_of = state_of
        self._n_ahead_seen = 0
        self._compared: dict[tuple[int, int], bool] = {}  # camera and width, asked for since the last turn
        self._planned_compared: object = None
        self._rig: tuple[object, CameraRig] | None = None
        self._loaded: tuple[int, int] | None = None
        self.loading: tuple[int, int] | None = None
        """Before no frame is left out around a seam: how many frames are ready, of how many; None once it may play."""

    def start(self) -> None:
        """Start the threads now rather than with the first request, and load what they need."""
        for worker in self.workers:
            worker.start()

    def show(self, opened: OpenedProject) -> None:
        """Take up the open project. Contents of another project are forgotten."""
        if self._opened is not None and self._opened.generation != opened.generation:
            for store in (*self._stores, self.ahead, self._modes):
                store.clear()
        self._opened = opened
        self._requests.take_up(opened)

    def build_first_cloud(self, jobs: Jobs) -> None:
        """Make something to look at until the reference clip has a state, unless there is one."""
        if self._opened is not None and self._state_of(self._opened.reference_index) is None:
            self.clouds.build_first(self._opened, jobs)

    # ---------------------------------------------------------------- frames of clips

    def frame(self, timeline: Timeline, shown_as: ShownAs = PLAIN) -> ShownFrame | None:
        """The drawn contents of the frame under the playhead, or the newest there is until that was decoded; None where
        nothing is trained. The frame states its source."""
        request = self._request(timeline, shown_as)
        shown = None if request is None else self.decoder.frame(request)
        return None if shown is None else replace(shown, gaussians=self._modes.of(shown, shown_as.mode))

    def live_anchors(self, timeline: Timeline) -> AnchorArrays | None:
        """All anchors of the clip under the playhead while it trains; None before a state of it was loaded."""
        request = self._request(timeline)
        return None if request is None or not request.is_live else self.decoder.anchors(request)

    def gaussians_per_anchor(self, timeline: Timeline) -> int | None:
        """K of the clip under the playhead, as of all clips of its project; None until it is loaded."""
        request = self._request(timeline)
        model = None if request is None else self.decoder.model(request)
        return None if model is None else model.decoder.gaussians_per_anchor

    def coverage(self, timeline: Timeline) -> CoveredSpace | None:
        """The space covered by inherited anchors in the clip under the playhead; None until it was measured."""
        request = self._request(timeline)
        anchors = None if request is None else self.decoder.anchors(request)
        return None if anchors is None else self._coverage.find(anchors)

    def trails(self, timeline: Timeline) -> Trails | None:
        """Trails that end at the playhead, or the newest ones of its clip until those are made."""
        request = self._request(timeline)
        loaded = None if request is None else self.decoder.loaded(request)
        if request is None or loaded is None:
            return None
        effects = tuple(map(self._requests.edits().at, trail_frames(request.clip, request.frame_index)))
        return self._trails.trails(TrailRequest(request.model_key, request.frame_index, effects, loaded.parts))

    def is_loaded(self, timeline: Timeline) -> bool:
        """Whether the file of the clip under the playhead is no longer needed. Asks for a missing one."""
        request = self._request(timeline)
        if request is None:
            return False
        self.decoder.frame(request)
        return self.decoder.is_loaded(request)

    def wanted(
        self, timeline: Timeline, view: OrbitView, shown_as: ShownAs = PLAIN, *, view_id: Hashable = 0
    ) -> WantedFrame | None:
        """The frame that ought to be on screen in a place; None without a project."""
        clip, request = timeline.clip, self._request(timeline, shown_as)
        if clip is None:
            return None
        wanted = WantedFrame(
            clip.clip_index,
            timeline.frame_index,
            camera_index=view.look_through,
            look=view.look_key,
            shown_as=shown_as.label,
        )
        if request is None:
            return wanted
        return replace(
            wanted,
            revision=request.revision,
            is_loaded=self.decoder.is_loaded(request),
            has_failed=self.decoder.has_failed(request) or self.renderer.has_failed(view_id),
        )

    def render(
        self,
        timeline: Timeline,
        view: OrbitView,
        width: int,
        height: int,
        *,
        full_size: tuple[int, int] | None = None,
        shown_as: ShownAs = PLAIN,
        view_id: Hashable = 0,
        state_of: StateOf | None = None,
    ) -> Picture | None:
        """The rasterizer's picture of the frame and view; None where nothing is trained or ready.

        Stale where it is of another frame, view, size or state of the clip; it states its source.

        Args:
            width, height: Its size, px.
            full_size: If it is there already in this size, that is given instead.
            shown_as: The meaning of its colours, and the part of the clip.
            view_id: Of the place where it is shown.
            state_of: Other states of clips than those of the project, for instance earlier versions.
        """
        request = self._request_at(timeline, timeline.frame_index, shown_as, state_of)
        if request is None:
            return None
        look = RenderView.of(view, width, height, shown_as=shown_as)
        full = look if full_size is None else look.in_size(view, *full_size)
        if state_of is None:  # playing does not show others next
            self.ahead.note(view_id, AskedLook(look, full))
        return self.draw(request, (full, look), view_id=view_id, is_other=state_of is not None)

    def draw(
        self, request: FrameRequest, looks: tuple[RenderView, RenderView], *, view_id: Hashable, is_other: bool = True
    ) -> Picture | None:
        """The rasterizer's picture of a request; None before the first.

        Args:
            looks: At it: in full size, and as it is to be drawn.
            view_id: Of the place where it is shown.
            is_other: Whether the frame is of another state or project than the one at the playhead.
        """
        look = looks[1]
        shown: ShownFrame | None = None
        picture = self._known_picture(request.key, looks, view_id)
        if picture is None:
            shown = self.decoder.frame(request)
        if shown is None:
            return picture
        key = shown.gaussians.key
        if key == request.key:
            return self.renderer.picture(request.key, shown, look, view_id=view_id)
        # Until the frame was decoded, the newest one there is, drawn from the view as it is now.
        assert isinstance(key, tuple)
        is_of_another = key[-2] != request.shown_as or (is_other and key[1] != str(request.path))
        if is_of_another:  # of another view, which shows another part or another state
            return self.renderer.newest(view_id)
        picture = self._known_picture(key, looks, view_id)
        if picture is None:
            picture = self.renderer.picture(key, shown, look, view_id=view_id)
        return None if picture is None else replace(picture, is_stale=True)

    def _known_picture(self, key: FrameKey, looks: tuple[RenderView, ...], view_id: Hashable) -> Picture | None:
        """The first of these that is there."""
        for look in looks:
            picture = self.renderer.known(key, look, view_id=view_id)
            if picture is not None:
                return picture
        return None

    def favour(self, view_id: Hashable) -> None:
        """Draw this place's request first."""
        self.renderer.worker.active_lane = view_id

    def work_ahead(self, timeline: Timeline, *, is_busy: bool = False) -> None:
        """Prepare the next frames while nothing is asked for. Called in every turn of the loop.

        Args:
            is_busy: Whether a training needs the cores while nothing plays.
        """
        course = Course.of(timeline)

        def request_of(frame: int, shown_as: ShownAs) -> FrameRequest | None:
            return self._request_at(timeline, frame, shown_as)

        self.ahead.plan(course, request_of, is_busy=is_busy)
        self._plan_compared(timeline, course)
        self._follow_loading(timeline, course, request_of)

    def _follow_loading(self, timeline: Timeline, course: Course, request_of: RequestOf) -> None:
        """Load the frames that are played around a seam once; another view later on does not hold them up again."""
        self.loading = None
        if timeline.around != self._loaded:
            self._loaded = None
        if course.is_loaded_first and self._loaded is None:
            n_ready, n_frames = self.ahead.loaded(course, request_of)
            if n_ready < n_frames:
                self.loading = n_ready, n_frames
            else:
                self._loaded = timeline.around

    def _plan_compared(self, timeline: Timeline, course: Course) -> None:
        """Captured pictures that are compared with the render come ahead of the playhead, too."""
        compared, self._compared = tuple(self._compared), {}
        wanted = (course, compared, self.decoder.revision) if course.is_playing and compared else None
        if wanted == self._planned_compared or self._opened is None:
            return
        self._planned_compared = wanted
        opened, requests = self._opened, []
        for frame in course.ahead(n_ahead(course)) if wanted is not None else ():
            for camera, max_width in compared:
                rendition = self._rendition(opened, timeline, frame, camera)
                capture = opened.capture
                key = (opened.generation, capture.fingerprint, camera, frame, max_width, capture, rendition)
                requests.append(PictureRequest(*key))
        self.captured.plan(requests)

    def cached_frames(self) -> list[tuple[int, int]]:
        """Frames that can be shown at once, as they are looked at now: first and stop of each run, in order."""
        requests, edits = self._requests, self._requests.edits()
        states = self._states() if edits.copies else ()
        return self.ahead.runs(lambda clip_index: (self._state_of(clip_index), edits, states), requests.is_current)

    def _states(self) -> tuple[ShownState | None, ...]:
        """Of all clips: copies may come from any of them."""
        clips = () if self._opened is None else self._opened.clips
        return tuple(self._state_of(clip.clip_index) for clip in clips)

    def _request(self, timeline: Timeline, shown_as: ShownAs = PLAIN) -> FrameRequest | None:
        """The request for the playhead; None where nothing is trained."""
        return self._request_at(timeline, timeline.frame_index, shown_as)

    def _request_at(
        self, timeline: Timeline, frame_index: int, shown_as: ShownAs = PLAIN, state_of: StateOf | None = None
    ) -> FrameRequest | None:
        clip = timeline.clip_of(frame_index)
        return None if clip is None else self._requests.request(clip, frame_index, shown_as, state_of)

    def request(self, clip: Clip, frame_index: int, shown_as: ShownAs = PLAIN) -> FrameRequest | None:
        """The file and frame to load and decode for a frame of a clip; None where the clip has no state."""
        return self._requests.request(clip, frame_index, shown_as)

    # ---------------------------------------------------------------- other contents

    def cloud(self, view: OrbitView) -> PointArrays | None:
        """A cloud for frames that are not trained; None until it is made, and through a capture camera while there is
        only the hint: the captured picture itself shows more there."""
        opened = self._opened
        if opened is None:
            return None
        cloud = self.clouds.cloud(opened, self._state_of(opened.reference_index))
        return None if cloud is None or (cloud.is_hint and view.look_through is not None) else cloud

    def rig(self, timeline: Timeline) -> CameraRig | None:
        """The cameras as the clip at the playhead was trained with them; None until that is loaded."""
        opened, request = self._opened, self._request(timeline)
        loaded = None if request is None else self.decoder.loaded(request)
        if opened is None or request is None or loaded is None or loaded.trained is None:
            return None
        key = opened.generation, request.model_key
        if self._rig is None or self._rig[0] != key:
            self._rig = key, loaded.trained.rig(opened.rig)
        return self._rig[1]

    def captured_picture(self, camera_index: int, frame_index: int, max_width: int) -> Picture | None:
        """The captured picture, at most `max_width` pixels wide; None until it was decoded."""
        opened = self._opened
        if opened is None:
            return None
        return self.captured.picture(opened.capture, opened.generation, camera_index, frame_index, max_width)

    def compared_picture(self, timeline: Timeline, camera_index: int, max_width: int) -> Picture | None:
        """A camera's picture at the playhead, to compare with the render: in the scene's colours where the frame is
        trained and loaded, otherwise as it was taken. The picture states which. None until it was decoded."""
        opened = self._opened
        if opened is None:
            return None
        self._compared[camera_index, max_width] = True
        rendition = self._rendition(opened, timeline, timeline.frame_index, camera_index)
        return self.captured.picture(
            opened.capture, opened.generation, camera_index, timeline.frame_index, max_width, rendition
        )

    def _rendition(
        self, opened: OpenedProject, timeline: Timeline, frame_index: int, camera_index: int
    ) -> Rendition | None:
        """What a camera makes of the scene's colours at a frame; None where that is unknown, or no difference."""
        request = self._request_at(timeline, frame_index, PLAIN)
        colors = None if request is None else self.decoder.colors(request)
        if request is None or colors is None:
            return None
        rendition = colors.rendition(opened.rig, camera_index, request.clip.clip_time(request.frame_index))
        return None if rendition.is_plain else rendition

    # ---------------------------------------------------------------- threads

    @property
    def workers(self) -> tuple[LatestWorker[Any, Any], ...]:
        """Every thread of it."""
        return (
            self.captured.viewing,
            self.captured.thumbnails,
            self.clouds.worker,
            self.renderer.worker,
            self.decoder.worker,
            self._coverage.worker,
            self._trails.worker,
        )

    @property
    def finished(self) -> tuple[object, ...]:
        """Identities of the newest results. Another value means that there is something new to see."""
        results = tuple(None if worker.newest is None else worker.newest[0] for worker in self.workers)
        return *results, self._n_ahead()

    def _n_ahead(self) -> int:
        """Results made ahead up to the last pause: a single one is not worth drawing the window anew."""
        workers = (self.decoder.worker, self.renderer.worker)
        if all(worker.is_idle for worker in workers):
            self._n_ahead_seen = sum(worker.n_ahead for worker in workers)
        return self._n_ahead_seen

    def take_failures(self) -> list[Failure]:
        """Failures since the last call."""
        found = []
        for worker, title in zip(self.workers, _TITLES, strict=True):
            failure = worker.take_error()
            if failure is not None:
                request, error = failure
                is_of_clip = isinstance(request, FrameRequest | CloudRequest) and self._is_own(request)
                found.append(Failure(title, error, is_of_clip, is_of_clip and request.is_live))
        return found

    def _is_own(self, request: FrameRequest | CloudRequest) -> bool:
        """Whether it is of the open project, not of one that it is compared with."""
        return self._opened is not None and request.generation == self._opened.generation

    def close(self) -> None:
        """End the threads."""
        for store in self._stores:
            store.close()

    @property
    def _stores(self) -> tuple[FrameDecoder | Renderer | CapturedPictures | Clouds | CoverageFinder | TrailMaker, ...]:
        """Everything that has a thread."""
        return self.decoder, self.renderer, self.captured, self.clouds, self._coverage, self._trails


_TITLES = (
    "A captured picture cannot be shown",
    "A captured picture cannot be shown",
    "The cloud cannot be shown",
    "The picture could not be drawn",
    "The clip cannot be shown",
    "The covered space cannot be shown",
    "The trails cannot be shown",
)
"""In the order of the workers."""
