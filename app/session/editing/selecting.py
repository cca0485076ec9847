"""Selecting: the selection of the open project, and the thread that finds it. For one thread; nothing here waits.

Commands are carried out one after the other, each on the frame that was shown when it was given.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from app.background.latest import LatestWorker, nothing
from app.playback.modes.arrays import GaussianArrays
from app.project.opening.opened_project import OpenedProject
from app.session.editing.attributes import ATTRIBUTES, AnchorValues, values_of
from app.session.editing.finding import Ground, found_by, selection_after
from app.session.editing.selection import NOTHING_SELECTED, Selection, selection_words
from app.session.editing.selection_commands import (
    ClearSelection,
    InvertSelection,
    Reselect,
    SelectAll,
    SelectAnchor,
    SelectByAttribute,
    SelectInPicture,
    SelectionCommand,
)
from app.session.editing.selection_status import SelectionStatus
from app.session.part import SessionPart
from engine.editing.edit import Picked
from engine.editing.gaussian_rows import GaussianRows
from engine.editing.selection.ranges import ValueSpread, spread_of
from engine.editing.selection.seen_from import SeenFrom
from engine.errors import ProjectError

FIND, SPREAD, SHARE = "find", "spread", "share"
"""Lanes of the thread."""


class Shown(Protocol):
    """The shown frame, as a session knows it when a command comes."""

    def selectable(self) -> GaussianArrays | None:
        """Gaussians of the shown frame in their own colours; None where nothing is trained."""
        ...

    def anchor_values(self, column: str) -> AnchorValues | None:
        """Anchors of that frame; with a column, their residuals. None while those are not known."""
        ...

    def gaussians_per_anchor(self) -> int:
        """K of the open project; 1 while that is not known."""
        ...


@dataclass(frozen=True, slots=True)
class _Find:
    """Work for the thread: the Gaussians that a command finds."""

    number: int
    command: SelectionCommand = field(compare=False)
    ground: Ground = field(compare=False)

    def answer(self) -> np.ndarray:
        return found_by(self.command, self.ground)


@dataclass(frozen=True, slots=True)
class _SpreadWork:
    """Work for the thread: how an attribute is spread."""

    key: tuple[object, ...]
    attribute: str = field(compare=False)
    gaussians: GaussianArrays = field(compare=False)
    anchors: AnchorValues | None = field(compare=False)

    def answer(self) -> ValueSpread | None:
        values = values_of(self.attribute, self.gaussians, self.anchors)
        return spread_of(values, is_log=ATTRIBUTES[self.attribute].is_log)


@dataclass(frozen=True, slots=True)
class _ShareWork:
    """Work for the thread: where selected Gaussians are seen."""

    key: tuple[object, ...]
    view: SeenFrom = field(compare=False)
    gaussians: GaussianArrays = field(compare=False)
    selected: np.ndarray = field(compare=False)

    def answer(self) -> np.ndarray:
        from engine.editing.selection.projected import project_gaussians
        from engine.editing.selection.share import selected_share

        gaussians = self.gaussians
        view = replace(self.view, near=max(self.view.near, gaussians.near_plane))
        projected = project_gaussians(gaussians.means, gaussians.quats, gaussians.scales, view)
        return selected_share(projected, gaussians.opacities, self.selected)


class ProjectSelecting(SessionPart):
    """The selection of the open project.

    Args:
        shown: The frame that commands act on.

    Attributes:
        selection: Present one.
        on_found: Called on the thread when something was found, to wake somebody up.
    """

    def __init__(self, shown: Shown) -> None:
        self.selection = NOTHING_SELECTED
        self.on_found: Callable[[], None] = nothing
        self._shown = shown
        self._before: Selection | None = None
        self._seen_from: SeenFrom | None = None
        self._waiting: deque[tuple[SelectionCommand, GaussianArrays, AnchorValues | None]] = deque()
        self._running: _Find | None = None
        self._numbers = itertools.count(1)
        self._revision = 0
        self._mask: tuple[GaussianRows, int, np.ndarray] | None = None
        self._share_lanes: dict[Hashable, None] = {}
        self._masks: dict[Hashable, tuple[GaussianRows, Picked, np.ndarray]] = {}
        self._words: tuple[int, int, str] | None = None
        self._worker: LatestWorker[Any, Any] = LatestWorker(
            "selecting", lambda work: work.answer(), prepare=_prepare, on_done=lambda: self.on_found()
        )
        self._worker.active_lane = FIND

    def open(self, opened: OpenedProject) -> None:
        """Another project is open: the selection belonged to the one before."""
        self.forget()

    def forget(self) -> None:
        """Nothing is selected, and nothing was."""
        self._worker.forget()
        self._waiting.clear()
        self._running, self._mask, self._before = None, None, None
        self._masks.clear()
        self._take(NOTHING_SELECTED)
        self._before = None

    def close(self) -> None:
        """End the thread."""
        self._worker.close()

    # ---------------------------------------------------------------- commands

    def apply(self, command: SelectionCommand) -> None:
        """Carry out a command; a thread does long work, and `poll` takes up its result.

        Raises:
            ProjectError: There is nothing to select, or the command is not valid.
        """
        if isinstance(command, ClearSelection | Reselect) and not self._is_busy:
            self._change(command)
            return
        gaussians = self._shown.selectable()
        if gaussians is None or gaussians.rows is None:
            raise ProjectError("No Gaussians to select here.", hint="Go to a frame that is trained.")
        anchors = None
        if isinstance(command, SelectByAttribute):
            if command.attribute not in ATTRIBUTES:
                raise ProjectError(f"{command.attribute!r} is not an attribute.")
            anchors = self._residuals_of(command.attribute)
        elif isinstance(command, SelectAnchor):
            anchors = self._shown.anchor_values("")
        self._waiting.append((command, gaussians, anchors))
        self._go_on()

    def select(self, selection: Selection) -> None:
        """Select this and nothing else, for instance the target of an edit."""
        self._take(selection)

    @property
    def _is_busy(self) -> bool:
        return self._running is not None or bool(self._waiting)

    def _go_on(self) -> None:
        """Carry out waiting commands, up to the first that needs the thread."""
        while self._running is None and self._waiting:
            command, gaussians, anchors = self._waiting.popleft()
            if isinstance(command, ClearSelection | Reselect):
                self._change(command)
                continue
            ground = Ground(gaussians, self.mask(gaussians), anchors, self._shown.gaussians_per_anchor())
            work = _Find(next(self._numbers), command, ground)
            if isinstance(command, SelectAll | InvertSelection):  # found in no time
                self._take_found(work, work.answer())
            else:
                self._running = work
                self._worker.request(work, lane=FIND)

    def _change(self, command: ClearSelection | Reselect) -> None:
        if isinstance(command, ClearSelection):
            self._take(NOTHING_SELECTED)
        elif self._before is not None:
            self._take(self._before)

    def _take_found(self, work: _Find, found: np.ndarray) -> None:
        command, before = work.command, self._seen_from
        self._take(selection_after(self.selection, command, work.ground, found))
        if isinstance(command, SelectInPicture):
            is_same = before is not None and _is_same_view(command.view, before)
            self._seen_from = command.view if is_same or command.how.mode == "replace" else None

    @property
    def seen_from(self) -> SeenFrom | None:
        """The picture in which all of the selection was selected; None where it was not in one picture."""
        return self._seen_from

    def _take(self, selection: Selection) -> None:
        self._seen_from = None
        if selection != self.selection:
            self._before, self.selection = self.selection, selection
            self._revision += 1

    def poll(self) -> bool:
        """Take up results. Whether anything changed. Failures are kept for `take_error`."""
        running, newest = self._running, self._worker.newest_in(FIND)
        if running is None:
            return False
        if newest is not None and newest[0] == running:
            self._running = None
            self._take_found(running, newest[1])
        elif self._worker.has_failed(running):
            self._running = None
        else:
            return False
        self._go_on()
        return True

    def take_error(self) -> Exception | None:
        """Why something could not be looked for, once."""
        failure = self._worker.take_error()
        return None if failure is None else failure[1]

    def take_failures(self) -> Iterable[tuple[str, Exception]]:
        """See `take_error`."""
        error = self.take_error()
        return () if error is None else (("The selection cannot be made", error),)

    @property
    def finished(self) -> object:
        """Another value means that there is something new to see."""
        newest = [self._worker.newest_in(lane) for lane in (FIND, SPREAD, *self._share_lanes)]
        return (self._revision, *(None if found is None else found[0] for found in newest))

    # ---------------------------------------------------------------- for display

    @property
    def revision(self) -> int:
        """Another number whenever something else is selected."""
        return self._revision

    def mask(self, gaussians: GaussianArrays) -> np.ndarray:
        """Which Gaussians of a frame are selected. The newest answer is kept; do not change it. [N] bool"""
        rows, known = gaussians.rows, self._mask
        if rows is None:
            return np.zeros(len(gaussians), np.bool_)
        if known is None or known[0] is not rows or known[1] != self._revision:
            self._mask = known = (rows, self._revision, self.selection.mask(rows))
        return known[2]

    def status(self) -> SelectionStatus:
        """Everything as one value."""
        gaussians, k = self._shown.selectable(), self._shown.gaussians_per_anchor()
        if self._words is None or self._words[:2] != (self._revision, k):
            self._words = (self._revision, k, selection_words(self.selection, k))
        is_any = gaussians is not None and len(self.selection) > 0
        return SelectionStatus(
            self._words[2],
            len(self.selection),
            int(np.count_nonzero(self.mask(gaussians))) if is_any and gaussians is not None else 0,
            self._is_busy,
            self._before is not None,
            gaussians is not None and gaussians.rows is not None,
            self._revision,
            self.selection.counts,
        )

    def spread(self, attribute: str) -> ValueSpread | None:
        """How an attribute is spread over the shown frame; the last one until that is known, None before.

        Raises:
            ValueError: There is no such attribute.
        """
        if attribute not in ATTRIBUTES:
            raise ValueError(f"attributes are {', '.join(ATTRIBUTES)}, not {attribute!r}")
        gaussians = self._shown.selectable()
        if gaussians is None:
            return None
        anchors = self._residuals_of(attribute)
        n_known = 0 if anchors is None else int(np.isfinite(anchors.values).sum())
        work = _SpreadWork((gaussians.key, attribute, n_known), attribute, gaussians, anchors)
        newest = self._worker.newest_in(SPREAD)
        if newest is None or newest[0] != work:
            self._worker.request(work, lane=SPREAD)
        return newest[1] if newest is not None and newest[0].attribute == attribute else None

    def share(self, gaussians: GaussianArrays, view: SeenFrom, view_id: object) -> np.ndarray | None:
        """How much of each pixel of a view the selected Gaussians of a frame make up, see
        engine.editing.selection.share; None until that is known, and where none of them is selected. [h, w] float32

        Args:
            view_id: Of the place where it is shown: each has one newest request.
        """
        return self._share(self.mask(gaussians), self._revision, gaussians, view, (SHARE, view_id))

    def share_of(
        self, picked: Picked, gaussians: GaussianArrays, view: SeenFrom, place_id: Hashable
    ) -> np.ndarray | None:
        """The same of other Gaussians, such as those of an object. place_id: Of what it is asked for, and where."""
        known = self._masks.get(place_id)
        if gaussians.rows is None:
            return None
        if known is None or known[0] is not gaussians.rows or known[1] != picked:
            mask = Selection.of_target(picked).mask(gaussians.rows)
            self._masks[place_id] = known = (gaussians.rows, picked, mask)
        return self._share(known[2], picked, gaussians, view, (SHARE, place_id))

    def _share(
        self, selected: np.ndarray, of: Hashable, gaussians: GaussianArrays, view: SeenFrom, lane: Hashable
    ) -> np.ndarray | None:
        if gaussians.rows is None or not selected.any():
            return None
        matrices = (np.asarray(m, np.float64).tobytes() for m in (view.world_to_camera, view.K))
        work = _ShareWork((gaussians.key, of, *matrices, *view.size), view, gaussians, selected)
        self._share_lanes[lane] = None
        newest = self._worker.newest_in(lane)
        if newest is not None and newest[0] == work:
            return newest[1]
        self._worker.request(work, lane=lane)
        return None

    def _residuals_of(self, attribute: str) -> AnchorValues | None:
        column = ATTRIBUTES[attribute].column
        return self._shown.anchor_values(column) if column else None


def _is_same_view(a: SeenFrom, b: SeenFrom) -> bool:
    return a.size == b.size and np.array_equal(a.world_to_camera, b.world_to_camera) and np.array_equal(a.K, b.K)


def _prepare() -> None:
    from app.background.kernels import prepare_selecting

    prepare_selecting()
