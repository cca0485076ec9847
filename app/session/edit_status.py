"""Edits as the window shows them: values only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.document.project_document import AS_CAPTURED, World
from engine.camera.camera_path import CameraKey, CameraPath
from engine.editing.copies.object_copy import NO_COPIES, Copies
from engine.editing.edit import Edit
from engine.editing.lost_picks import LostPicks
from engine.editing.reach import UNKNOWN, ClipAnchors, Reach
from engine.editing.scene_object import NO_OBJECTS, Objects, SceneObject
from engine.timing.segment import Segment


@dataclass(frozen=True, slots=True)
class HistoryStatus:
    """Steps that can be undone and redone.

    Attributes:
        undo, redo: Name of the step, a word or two; empty without one.
        past: Names of the steps that led here, the oldest first.
        future: Names of the steps that were taken back, the one that would be done again next first.
    """

    undo: str = ""
    redo: str = ""
    past: tuple[str, ...] = ()
    future: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class EditsStatus:
    """Edits of the open project, and the user's names, up direction and scale.

    Attributes:
        edits: The stack, bottom first.
        labels: The user's own names of clips and cameras, by kind and name; see app.document.project_document.Label.
        world: Up and scale.
        timing: Segments of the take; none for the take as captured.
        objects: Those that have a name, in the user's order.
        copies: Objects that are shown once more, in the user's order.
        lost: Those that have lost their picks because a clip was trained anew.
        clips: Which anchors each clip has; none while that is not known.
        reaches: Where each edit acts, by its number.
        can_edit: Whether anything can be changed now.
        why_not: Cause and remedy if not.
    """

    edits: tuple[Edit, ...] = ()
    labels: Mapping[tuple[str, str], str] = field(default_factory=dict)
    world: World = AS_CAPTURED
    timing: tuple[Segment, ...] = ()
    objects: Objects = NO_OBJECTS
    copies: Copies = NO_COPIES
    lost: tuple[LostPicks, ...] = ()
    clips: tuple[ClipAnchors, ...] = ()
    reaches: Mapping[int, Reach] = field(default_factory=dict)
    can_edit: bool = False
    why_not: str = ""

    def edit(self, edit_id: int | None) -> Edit | None:
        """The edit of that number; None without one."""
        return next((edit for edit in self.edits if edit.edit_id == edit_id), None)

    def object(self, object_id: int | None) -> SceneObject | None:
        """The object of that number; None without one."""
        return next((one for one in self.objects if one.object_id == object_id), None)

    def reach(self, edit_id: int) -> Reach:
        """Where an edit acts; one that knows nothing where that is not known."""
        return self.reaches.get(edit_id, UNKNOWN)

    def label(self, kind: str, name: str) -> str:
        """The user's own name for a clip or a camera; empty without one."""
        return self.labels.get((kind, name), "")


@dataclass(frozen=True, slots=True)
class PathsStatus:
    """Camera paths of the open project.

    Attributes:
        paths: In the user's order.
        chosen: Row of the path that is shown and edited; None without paths.
        chosen_key: Number of the key of that path that stands out; None without one.
        along: Index of the view that follows the chosen path with the playhead; None while none does.
        can_edit: Whether paths can be changed now.
        why_not: Cause and remedy if they cannot.
    """

    paths: tuple[CameraPath, ...] = ()
    chosen: int | None = None
    chosen_key: int | None = None
    along: int | None = None
    can_edit: bool = False
    why_not: str = ""

    @property
    def is_along(self) -> bool:
        """Whether a view follows the path."""
        return self.along is not None

    @property
    def path(self) -> CameraPath | None:
        """The chosen path."""
        return None if self.chosen is None else self.paths[self.chosen]

    @property
    def key(self) -> CameraKey | None:
        """The chosen key."""
        path = self.path
        return None if path is None or self.chosen_key is None else path.keys[self.chosen_key]
