"""Ahead: decodes and draws frames before they are asked for, and knows which are ready to be shown at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass

from app.playback.frame_decoder import FrameDecoder, FrameKey, FrameRequest
from app.playback.modes.view_modes import PLAIN, ShownAs, decoded_as
from app.playback.prefetch_order import Course
from app.playback.render import PictureKey, Renderer, RenderRequest, RenderView
from engine.capture.files.frame_runs import runs_of

PLAYING_S = 1.5
"""Playing time that is made ready ahead while it plays."""
MAX_PLAYING, STANDING = 64, 8
"""Most frames ahead while it plays, and while the playhead stands."""
SETTLED_S = 0.3
"""The view, and the playhead unless it plays, have to rest for this long: until then cores are for the shown frame."""
MOST_UNASKED = 30
"""After this many turns of the loop without a request for a picture, none are drawn ahead."""
SPARE = 2
"""Frames that memory holds in addition to those that come: the one shown, and the newest."""

RequestOf = Callable[[int, ShownAs], FrameRequest | None]
"""The request for a frame and how it is shown; None where nothing is trained."""
StateOf = Callable[[int], Hashable]
"""A value that distinguishes states of a clip."""


@dataclass(frozen=True, slots=True)
class AskedLook:
    """How a place on screen shows frames.

    Attributes:
        look: The look that was asked for.
        full: The same at full size.
    """

    look: RenderView
    full: RenderView

    @property
    def sizes(self) -> tuple[RenderView, ...]:
        """Each size once, the one that was asked for first."""
        return (self.look,) if self.look == self.full else (self.look, self.full)


class Ahead:
    """Plans the work of a decoder and a renderer. For one thread; costs next to nothing while nothing changes.

    Args:
        settled_s: See SETTLED_S.
    """

    def __init__(self, decoder: FrameDecoder, renderer: Renderer, *, settled_s: float = SETTLED_S) -> None:
        self._decoder, self._renderer, self._settled_s = decoder, renderer, settled_s
        self._looks: dict[Hashable, AskedLook] = {}
        self._asked: dict[Hashable, AskedLook] = {}
        self._unasked: dict[Hashable, int] = {}
        self._still: object = None
        self._still_since_s = 0.0
        self._planned_of: object = None
        self._runs_of: object = None
        self._runs: list[tuple[int, int]] = []

    def note(self, view_id: Hashable, asked: AskedLook) -> None:
        """A place on screen shows rasterized pictures in this way. It repeats the call for as long as it does."""
        self._asked[view_id] = asked

    def clear(self) -> None:
        """Another project was opened."""
        self._looks, self._asked, self._unasked = {}, {}, {}
        self._planned_of, self._runs_of, self._runs = None, None, []

    # ---------------------------------------------------------------- planning

    def plan(self, course: Course, request_of: RequestOf, *, is_busy: bool = False) -> None:
        """Plan anew if the playhead or anything else has changed.

        Args:
            is_busy: Whether something else, such as a training, needs the cores while the playhead stands.
        """
        self._take_looks()
        n = STANDING
        if not self._is_settled(course) or (is_busy and not course.is_playing):
            n = 0
        elif course.is_playing:
            n = n_ahead(course)
        parts = dict.fromkeys(decoded_as(asked.look.shown_as) for asked in self._looks.values()) or (PLAIN,)
        requests = [request_of(frame, part) for frame in course.ahead(n) for part in parts]
        # A snapshot of a running training is replaced before long: not worth the cores while nothing plays.
        coming = [one for one in requests if one is not None and (course.is_playing or not one.is_live)]
        identity = (course, coming, tuple(self._looks.items()), self._decoder.revision)
        if identity == self._planned_of:
            return
        self._planned_of = identity
        kept = coming[: max(self._decoder.n_that_fit - SPARE, 0)]
        missing = [request for request in kept if not self._is_ready(request.key)]
        look_keys = {asked.full.key for asked in self._looks.values()}
        self._decoder.plan(missing, lambda key: course.distance(key[-1]))
        self._renderer.plan(list(self._drawable(coming)), lambda key: _picture_distance(key, course, look_keys))

    def loaded(self, course: Course, request_of: RequestOf) -> tuple[int, int]:
        """Of the frames that are played, or as many as memory holds: how many can be shown at once, and how many there
        are. A frame that is not trained, still trains or cannot be decoded counts as ready: nothing better comes."""
        parts = dict.fromkeys(decoded_as(asked.look.shown_as) for asked in self._looks.values()) or (PLAIN,)
        n_that_fit = [self._decoder.n_that_fit // len(parts)]
        n_that_fit += [self._renderer.n_that_fit(asked.full) // len(self._looks) for asked in self._looks.values()]
        n_ready = 0
        frames = [course.frame_index, *course.ahead(max(min(n_that_fit) - SPARE, 0))]
        for frame in frames:
            requests = [one for part in parts if (one := request_of(frame, part)) is not None and not one.is_live]
            n_ready += all(self._is_ready(one.key) or not self._decoder.comes_ahead(one) for one in requests)
        return n_ready, len(frames)

    def _take_looks(self) -> None:
        """Take the looks shown now; a place that has not asked for some turns of the loop is gone."""
        self._unasked = {view_id: 0 if view_id in self._asked else n + 1 for view_id, n in self._unasked.items()}
        self._unasked |= dict.fromkeys(self._asked, 0)
        looks = self._looks | self._asked
        self._looks = {view_id: look for view_id, look in looks.items() if self._unasked[view_id] <= MOST_UNASKED}
        self._unasked = {view_id: self._unasked[view_id] for view_id in self._looks}
        self._asked = {}

    def _is_settled(self, course: Course) -> bool:
        views = tuple((view_id, asked.full) for view_id, asked in self._looks.items())
        still = (views, None if course.is_playing else course.frame_index)
        now_s = time.perf_counter()
        if still != self._still:
            self._still, self._still_since_s = still, now_s
        return now_s - self._still_since_s >= self._settled_s

    def _drawable(self, coming: list[FrameRequest]) -> Iterator[RenderRequest]:
        """Pictures of frames that are decoded: as they are asked for, and after those in full size."""
        for place in range(2):
            for asked in self._looks.values():
                if place >= len(asked.sizes):
                    continue
                of_look = [one for one in coming if one.shown_as == decoded_as(asked.look.shown_as)]
                n_that_fit = self._renderer.n_that_fit(asked.full) // len(self._looks) - SPARE
                for request in of_look[: max(n_that_fit, 0)]:
                    shown = self._decoder.known(request.key)
                    if shown is not None and not (place == 0 and self._renderer.is_ready(request.key, asked.full)):
                        yield RenderRequest(request.key, asked.sizes[place], shown)

    # ---------------------------------------------------------------- ready frames

    def _is_ready(self, key: FrameKey) -> bool:
        """Whether a frame can be shown at once, as it is looked at now."""
        if not self._looks:
            return self._decoder.is_ready(key)
        return all(
            any(self._renderer.is_ready((*key[:-2], decoded_as(look.shown_as), key[-1]), look) for look in asked.sizes)
            for asked in self._looks.values()
        )

    def runs(self, state_of: StateOf, is_current: Callable[[FrameKey], bool]) -> list[tuple[int, int]]:
        """Frames that can be shown at once as they are looked at now: first and stop of each run, in order.

        Args:
            is_current: Whether a key is of the state of its clip that is shown.
        """
        keys = self._renderer.ready_keys() if self._looks else self._decoder.ready_keys()
        states = tuple((clip_index, state_of(clip_index)) for clip_index in sorted({key[2] for key in keys}))
        identity = (states, self._decoder.revision, self._renderer.revision, tuple(self._looks.items()))
        if identity != self._runs_of:
            frames = sorted({key[-1] for key in keys if is_current(key) and self._is_ready(key)})
            self._runs_of, self._runs = identity, [(run.start, run.stop) for run in runs_of(frames)]
        return self._runs


def n_ahead(course: Course) -> int:
    """Number of frames made ready during playback."""
    if course.is_loaded_first:
        return course.n_frames
    return min(round(PLAYING_S * course.frames_per_s), MAX_PLAYING)


def _picture_distance(key: PictureKey, course: Course, look_keys: set[Hashable]) -> float:
    """Pictures in looks that are not shown come last."""
    gaussians_key, look = key
    return course.distance(gaussians_key[-1]) if look.key in look_keys else float("inf")
