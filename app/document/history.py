"""DocumentHistory: a document with the way it has come and the way back, as one immutable value."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace

from msgspec import structs

from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject

MAX_STEPS = 500
"""Steps that can be taken back; the oldest go."""
MAX_NAME_CHARACTERS = 200


@dataclass(frozen=True, slots=True)
class Changed:
    """The document was changed.

    Attributes:
        name: Of the change, a word or two that can follow "Undo".
        document: After the change.
        merge: Changes in a row with the same one count as one step, such as those of a drag.
    """

    name: str
    document: ProjectDocument
    merge: Hashable = None


@dataclass(frozen=True, slots=True)
class Undone:
    """The last step was taken back."""


@dataclass(frozen=True, slots=True)
class Redone:
    """The step that was taken back last was done again."""


@dataclass(frozen=True, slots=True)
class Placed:
    """The capture lies in another place, may follow links now, or has grown. Not a step: undo does not take it back.

    Attributes:
        settings: Of the document, with the new place.
    """

    settings: ProjectSettings


@dataclass(frozen=True, slots=True)
class ObjectFound:
    """An object was found in clips. Not a step: it follows from what somebody has selected, so that it belongs to every
    document of the history that has the object with these seeds. Undoing the step that made the object takes it back.

    Attributes:
        object_id: Of the object.
        seeds: For which it was looked for.
        clips: Where it is.
    """

    object_id: int
    seeds: tuple[ObjectSeed, ...]
    clips: tuple[ObjectInClip, ...]


Event = Changed | Undone | Redone | Placed | ObjectFound


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the past or of the future.

    Attributes:
        name: See Changed.
        document: Of a past step: the document before it. Of a future step: the document after it.
        merge: See Changed; None where the step is over.
    """

    name: str
    document: ProjectDocument
    merge: Hashable = None


@dataclass(frozen=True, slots=True)
class DocumentHistory:
    """Everything that undo and redo need.

    Attributes:
        present: The document.
        past: Steps that led here, the oldest first.
        future: Steps that were taken back, the one that would be done again next last.
    """

    present: ProjectDocument
    past: tuple[Step, ...] = ()
    future: tuple[Step, ...] = ()

    @property
    def undo_name(self) -> str:
        """Name of the step to undo; empty without one."""
        return self.past[-1].name if self.past else ""

    @property
    def redo_name(self) -> str:
        """Name of the step to redo; empty without one."""
        return self.future[-1].name if self.future else ""

    def after(self, event: Event) -> DocumentHistory:
        """The history after something has happened. Where there is nothing to take back or do again, it stays."""
        match event:
            case Changed(name=name, document=document, merge=merge):
                last = self.past[-1] if self.past else None
                if last is not None and merge is not None and last.merge == merge and not self.future:
                    return replace(self, present=document)
                step = Step(name[:MAX_NAME_CHARACTERS], self.present, merge)
                return DocumentHistory(document, (*self.past, step)[-MAX_STEPS:])
            case Undone():
                return self._undone() if self.past else self
            case Redone():
                return self._redone() if self.future else self
            case Placed(settings=settings):
                return replace(self, present=replace(self.present, settings=settings))
            case ObjectFound():
                return self.each(_Finding(event).in_document)

    def each(self, change: Callable[[ProjectDocument], ProjectDocument]) -> DocumentHistory:
        """The history with every document changed alike."""
        past, future = (
            tuple(replace(step, document=change(step.document)) for step in steps) for steps in (self.past, self.future)
        )
        return DocumentHistory(change(self.present), past, future)

    def _undone(self) -> DocumentHistory:
        step = self.past[-1]
        back = Step(step.name, self.present)
        return DocumentHistory(self._in_place(step.document), _closed(self.past[:-1]), (*self.future, back))

    def _redone(self) -> DocumentHistory:
        step = self.future[-1]
        past = (*_closed(self.past), Step(step.name, self.present))
        return DocumentHistory(self._in_place(step.document), past, self.future[:-1])

    def _in_place(self, document: ProjectDocument) -> ProjectDocument:
        """A document of another time, with the capture where it is now."""
        settings = document.settings.placed_as(self.present.settings)
        return document if settings == document.settings else replace(document, settings=settings)


class _Finding:
    """Puts into documents what was found. Documents of a history share their objects, and do so afterwards."""

    def __init__(self, found: ObjectFound) -> None:
        self._found = found
        self._known: dict[int, tuple[SceneObject, SceneObject]] = {}

    def in_document(self, document: ProjectDocument) -> ProjectDocument:
        objects = tuple(self._object(one) for one in document.objects)
        is_same = all(a is b for a, b in zip(objects, document.objects, strict=True))
        return document if is_same else replace(document, objects=objects)

    def _object(self, one: SceneObject) -> SceneObject:
        found = self._found
        if one.object_id != found.object_id or one.seeds != found.seeds:
            return one
        if id(one) not in self._known:
            self._known[id(one)] = one, structs.replace(one, clips=found.clips)
        return self._known[id(one)][1]


def _closed(steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """The same steps, where the next change is a new step."""
    if not steps or steps[-1].merge is None:
        return steps
    return (*steps[:-1], replace(steps[-1], merge=None))


def coalesced(events: Sequence[Event]) -> list[Event]:
    """The same with fewer events: of changes in a row that count as one step, only the last one."""
    found: list[Event] = []
    for event in events:
        match found[-1:], event:
            case [Changed(name=name, merge=merge)], Changed() if merge is not None and event.merge == merge:
                found[-1] = replace(event, name=name)
            case _:
                found.append(event)
    return found
