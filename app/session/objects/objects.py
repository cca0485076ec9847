"""Objects: makes and corrects the objects of the open project, and looks for them in its clips on a thread.

A search belongs to what somebody has selected: where that changes meanwhile, it begins anew, and its result never is a
step of its own. Where clips were trained since, objects are looked for again once nothing trains.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import structs

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.document.changes import object_changes
from app.document.changes.object_changes import object_with
from app.document.history import ObjectFound
from app.document.project_document import ProjectDocument
from app.evaluation.headless import open_trained
from app.objects.object_masks import object_masks
from app.objects.searching import find_in_project
from app.playback.timeline import Timeline
from app.project.opening.opened_project import OpenedProject
from app.session.editing.edit_reaches import EditReaches
from app.session.editing.edits import Change, Selects
from app.session.editing.kept_document import KeptDocument
from app.session.editing.selection import NOTHING_SELECTED, Selection
from app.session.notices import Notices
from app.session.objects.object_commands import (
    CorrectObject,
    FindObject,
    MakeObject,
    ObjectCommand,
    RecolourObject,
    RemoveObject,
    RenameObject,
    SelectObject,
    SetObjectSpan,
    SetObjectTrained,
)
from app.session.part import SessionPart
from engine.capture.exclusions import PaintedMask
from engine.editing.reach import ClipAnchors, unsearched
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject, SeedView
from engine.errors import ProjectError

Find = Callable[[OpenedProject, SceneObject, Callable[[float, float], None]], tuple[ObjectInClip, ...]]
Mask = Callable[[OpenedProject, SceneObject, Callable[[float, float], None]], tuple[PaintedMask, ...]]
Wanted = tuple[int, tuple[ObjectSeed, ...], object]
"""An object with its seeds, and the clips that have to be searched."""


class Objects(SessionPart):
    """For one thread, and nothing here waits.

    Args:
        document: Holds and keeps them.
        selecting: Its selection makes and corrects objects.
        timeline: Gives the playhead.
        reaches: Knows which anchors each clip has.
        jobs, notices: Of the session.
        is_training: Whether cores are for a training now; then nothing is looked for that nobody has asked for.
        find, mask: Look for an object in clips, and in pictures.
    """

    def __init__(
        self,
        document: KeptDocument,
        selecting: Selects,
        timeline: Callable[[], Timeline],
        reaches: EditReaches,
        jobs: Jobs,
        notices: Notices,
        *,
        is_training: Callable[[], bool],
        find: Find | None = None,
        mask: Mask | None = None,
    ) -> None:
        self._document, self._selecting, self._timeline, self._reaches = document, selecting, timeline, reaches
        self._jobs, self._notices, self._is_training = jobs, notices, is_training
        self.find: Find = _find if find is None else find
        self.mask: Mask = _mask if mask is None else mask
        self._opened: OpenedProject | None = None
        self._asked: list[int] = []
        """Objects that somebody wants to be looked for, the first one next."""
        self._job: BackgroundJob | None = None
        self._searched: SceneObject | None = None
        self._given_up: set[Wanted] = set()
        """Not to be looked for once more, unless somebody asks."""

    def open(self, opened: OpenedProject) -> None:
        """Another project is open."""
        self._stop()
        self._opened, self._asked, self._given_up = opened, [], set()

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self._stop()
        self._opened = opened

    def grow(self, opened: OpenedProject) -> None:
        """Its capture has grown: running work goes on."""
        self._opened = opened

    # ---------------------------------------------------------------- commands

    def apply(self, command: ObjectCommand) -> None:
        """Carry out a command.

        Raises:
            ProjectError: It cannot be done now, or is not valid.
        """
        if isinstance(command, SelectObject):
            self._select(command.object_id)
            return
        document = self._document.checked().document
        match command:
            case MakeObject(name=name):
                clip, seed = self._seed(adds=True)
                made = object_changes.add_object(document, seed, name=name, within=(clip.start, clip.stop))
                self._document.change(made, f"make {made.objects[-1].name}")
                self._look_for(made.objects[-1].object_id)
            case CorrectObject(object_id=object_id, adds=adds):
                one = object_with(document, object_id)
                clip, seed = self._seed(adds=adds)
                made = object_changes.correct_object(document, object_id, seed, within=(clip.start, clip.stop))
                self._document.change(made, f"{'add to' if adds else 'remove from'} {one.name}")
                self._look_for(object_id)
            case SetObjectTrained(object_id=object_id, is_trained=False):
                self._leave_out(object_with(document, object_id))
            case FindObject(object_id=object_id):
                object_with(document, object_id)
                self._asked.append(object_id)
            case _:
                change = changed(document, command)
                if change.document != document:
                    self._document.change(change.document, change.name, change.merge)

    def _select(self, object_id: int) -> None:
        content = self._document.content
        if content is None:
            raise ProjectError("No capture is open.")
        one, frame_index = object_with(content, object_id), self._timeline().frame_index
        picked = one.picked(frame_index)
        if not picked.sets:
            raise ProjectError(
                f"{one.name} is not in frame {frame_index}.", hint="The timeline shows in which frames it is."
            )
        self._selecting.select(Selection.of_target(picked))

    def _look_for(self, object_id: int) -> None:
        """The selection is in the object now, which takes its place."""
        self._asked.append(object_id)
        self._selecting.select(NOTHING_SELECTED)

    def _seed(self, *, adds: bool) -> tuple[ClipAnchors, ObjectSeed]:
        """The selection, as far as it is in the clip at the playhead."""
        timeline = self._timeline()
        frame_index = timeline.frame_index
        clip = next((clip for clip in self._reaches.clips() if clip.start <= frame_index < clip.stop), None)
        selection = self._selecting.selection
        if clip is None or not len(selection):
            raise ProjectError("Nothing is selected.", hint="Select Gaussians of the object in one frame first.")
        here = Selection(tuple(part for part in selection.parts if clip.holds(part[0])))
        if not len(here):
            raise ProjectError(
                f"Nothing of the selection exists in frame {frame_index}.",
                hint="Go to the frame in which it was selected, or select here.",
            )
        sets = here.target().sets
        view = self._selecting.seen_from
        seen = None if view is None else SeedView.of(view)
        return clip, ObjectSeed(frame_index, sets if adds else (), () if adds else sets, seen)

    def _leave_out(self, one: SceneObject) -> None:
        """Find out on a thread what training must not see; the step is made then."""
        opened, name = self._opened, f"Masking {one.name}"
        if opened is None or any(job.name == name for job in self._jobs.statuses):
            return

        def work(context: JobContext) -> tuple[PaintedMask, ...]:
            return self.mask(opened, one, lambda done, total: context.report(done / max(total, 1)))

        def done(masks: tuple[PaintedMask, ...]) -> None:
            if self._document.project is opened.project:
                document = self._document.checked().document
                after = object_changes.set_trained(document, one.object_id, is_trained=False, masks=masks)
                self._document.change(after, f"train without {one.name}")

        def failed(error: Exception) -> None:
            self._notices.add_failure(f"{one.name} cannot be left out of training", error)

        self._jobs.start(name, work, done, failed, can_cancel=True)

    # ---------------------------------------------------------------- searching

    def follow_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """A search for something that is not meant any more ends, and begins anew where it is still wanted."""
        searched = self._searched
        if searched is not None and before.objects is not after.objects and self._present(searched) is None:
            if any(one.object_id == searched.object_id for one in after.objects):
                self._asked.append(searched.object_id)
            self._stop()

    def poll(self) -> bool:
        """Begin the next search. Whether anything visible changed."""
        job = self._job
        if job is not None and job.context.is_cancelled and not job.is_running:  # the user has given it up
            self._give_up()
            return True
        if job is not None or self._opened is None or self._document.why_not():
            return False
        one = self._next()
        if one is None:
            return False
        self._begin(self._opened, one)
        return True

    @property
    def searched(self) -> int | None:
        """Number of the object that is looked for now; None where none is."""
        return None if self._searched is None else self._searched.object_id

    def close(self) -> None:
        """End the search."""
        self._stop()

    def _next(self) -> SceneObject | None:
        content = self._document.content
        if content is None or not any(clip.origin for clip in self._reaches.clips()):
            return None
        while self._asked:
            asked = self._asked.pop(0)
            one = next((one for one in content.objects if one.object_id == asked), None)
            if one is not None:
                self._asked = [other for other in self._asked if other != asked]
                return one
        if self._is_training():
            return None
        for one in content.objects:
            wanted = self._wanted(one)
            if wanted is not None and wanted not in self._given_up:
                return one
        return None

    def _wanted(self, one: SceneObject) -> Wanted | None:
        """What is missing of an object; None where nothing is."""
        missing = unsearched(one, self._reaches.clips())
        return (one.object_id, one.seeds, tuple((clip.start, clip.origin) for clip in missing)) if missing else None

    def _begin(self, opened: OpenedProject, one: SceneObject) -> None:
        def work(context: JobContext) -> tuple[ObjectInClip, ...]:
            return self.find(opened, one, lambda done, total: context.report(done / max(total, 1)))

        def done(clips: tuple[ObjectInClip, ...]) -> None:
            self._job = self._searched = None
            if self._document.project is opened.project and self._present(one) is not None:
                self._document.found(ObjectFound(one.object_id, one.seeds, clips))
                if (wanted := self._wanted(structs.replace(one, clips=clips))) is not None:
                    self._given_up.add(wanted)  # clips that cannot be searched, or are others by now

        self._searched = one
        self._job = self._jobs.start(f"Finding {one.name}", work, done, self._failed, can_cancel=True)

    def _failed(self, error: Exception) -> None:
        title = f"{'An object' if self._searched is None else self._searched.name} could not be found"
        self._give_up()
        self._notices.add_failure(title, error)

    def _give_up(self) -> None:
        if self._searched is not None and (wanted := self._wanted(self._searched)) is not None:
            self._given_up.add(wanted)
        self._job = self._searched = None

    def _stop(self) -> None:
        """End the search; its result is not wanted."""
        if self._job is not None:
            self._job.context.cancel()
        self._job = self._searched = None

    def _present(self, searched: SceneObject) -> SceneObject | None:
        """The object that is searched, as it is now; None where it is gone or consists of other things."""
        content = self._document.content
        objects = () if content is None else content.objects
        return next(
            (one for one in objects if one.object_id == searched.object_id and one.seeds == searched.seeds), None
        )


def changed(document: ProjectDocument, command: ObjectCommand) -> Change:
    """The change that a command makes to a document, for those that need no selection. Raises ProjectError where it is
    not valid."""
    match command:
        case RemoveObject(object_id=object_id):
            name = object_with(document, object_id).name
            after, n_edits = object_changes.remove_object(document, object_id)
            edits = f" and {n_edits} edit{'' if n_edits == 1 else 's'}" if n_edits else ""
            return Change(after, f"remove {name}{edits}")
        case RenameObject(object_id=object_id, name=name):
            old = object_with(document, object_id).name
            return Change(object_changes.rename_object(document, object_id, name), f"rename {old}")
        case RecolourObject(object_id=object_id, color=color, gesture=gesture):
            name = object_with(document, object_id).name
            merge = ("recolour object", object_id, gesture) if gesture else None
            after = object_changes.recolour_object(document, object_id, color)
            return Change(after, f"change the colour of {name}", merge)
        case SetObjectSpan(object_id=object_id, first=first, stop=stop):
            name = object_with(document, object_id).name
            return Change(object_changes.set_span(document, object_id, first, stop), f"change the frames of {name}")
        case SetObjectTrained(object_id=object_id, is_trained=True):
            name = object_with(document, object_id).name
            return Change(object_changes.set_trained(document, object_id, is_trained=True), f"train with {name}")
        case _:
            raise ProjectError("This needs a selection or pictures, or changes nothing.")


def _find(opened: OpenedProject, one: SceneObject, report: Any) -> tuple[ObjectInClip, ...]:
    return find_in_project(opened.project, opened.capture, one, report)


def _mask(opened: OpenedProject, one: SceneObject, report: Any) -> tuple[PaintedMask, ...]:
    return object_masks(open_trained(opened.project, opened.capture), one, report)
