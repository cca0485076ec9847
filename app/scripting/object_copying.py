"""ObjectCopying: the methods of a ScriptedProject that show objects once more."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from app.document.changes.copy_changes import copy_with
from app.document.changes.object_changes import object_named
from app.document.project_document import ProjectDocument
from app.session.duplicating.copy_commands import (
    ChangeCopy,
    CopyCommand,
    DuplicateObject,
    MakeCrowd,
    RemoveCopies,
    SwitchCopies,
)
from engine.editing.actions import ORIGIN, Quat, Transform, Vector
from engine.editing.copies.object_copy import Copies, ObjectCopy, OnObject, OnPath, Outside, span_of
from engine.editing.edit import EVERYWHERE, Scope
from engine.editing.effects import EditStack
from engine.editing.scene_object import SceneObject
from engine.errors import ProjectError
from engine.text import one_line, shown

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject


class ObjectCopying:
    """For a ScriptedProject, which has the rest."""

    @property
    def document(self) -> ProjectDocument:
        """See ScriptedProject."""
        raise NotImplementedError

    def open_trained(self) -> TrainedProject:
        """See ScriptedProject."""
        raise NotImplementedError

    def _carry_out(self, command: CopyCommand) -> None:
        raise NotImplementedError

    @property
    def copies(self) -> Copies:
        """Copies of objects, in the order in which they were made."""
        return self.document.copies

    def duplicate_object(self, name: str, *, n_times: int = 1, **values: Any) -> Copies:
        """Show an object once more, or several times, each farther by the same step.

        Args:
            name: Of the object, or its number as text.
            n_times: How many copies.
            values: See `object_copy`.
        Returns:
            The copies with their numbers.
        Raises:
            ProjectError: There is no such object, a value is out of range, or what `change` raises.
        """
        n_before = len(self.copies)
        self._carry_out(DuplicateObject(self.object_copy(name, **values), n_times))
        return self.copies[n_before:]

    def make_crowd(
        self,
        name: str,
        n_across: int,
        n_along: int,
        *,
        across: Vector,
        along: Vector,
        step_frames: float = 0.0,
        **values: Any,
    ) -> Copies:
        """Fill rows with copies of an object, which itself stands at the corner.

        Args:
            name: Of the object, or its number as text.
            n_across, n_along: How many stand in each direction, the object counted.
            across, along: From one to the next, scene units.
            step_frames: So much later is each than the one before.
            values: See `object_copy`.
        Returns:
            The copies with their numbers; they are one group.
        Raises:
            ProjectError: As `duplicate_object`.
        """
        n_before = len(self.copies)
        copy = self.object_copy(name, **values)
        self._carry_out(MakeCrowd(copy, n_across, n_along, across, along, step_frames))
        return self.copies[n_before:]

    def object_copy(
        self,
        name: str,
        *,
        by: Vector = ORIGIN,
        quat: Quat = (1.0, 0.0, 0.0, 0.0),
        scale: float = 1.0,
        pivot: Vector | None = None,
        shift_frames: float = 0.0,
        speed: float = 1.0,
        anchor_frame: float | None = None,
        outside: Outside = "hold",
        is_in_place: bool = False,
        on_path: str = "",
        on_object: str = "",
        scope: Scope = EVERYWHERE,
        copy_name: str = "",
        group: str = "",
    ) -> ObjectCopy:
        """A copy as a value, which is not in the document yet.

        Args:
            name: Of the object, or its number as text.
            by: How far off it is, scene units.
            quat, scale: How it is turned, wxyz, and its size.
            pivot: What it is turned and scaled about; None for the middle of the object at the anchor frame.
            shift_frames: So much later than the object it does everything.
            speed: How many frames of the object pass in a frame.
            anchor_frame: See ObjectCopy; None for the first frame of scope and object.
            outside: What it does when its object does not exist.
            is_in_place: Whether it takes the place of the object.
            on_path, on_object: Name of the camera path or the other object that carries it.
            scope: Frames in which it is there.
            copy_name: For people; an empty one is filled in.
            group: Name of the copies that it belongs to.
        Raises:
            ProjectError: There is no such object, or a value is out of range.
        """
        found = object_named(self.document, name)
        if on_path and on_object:
            raise ProjectError("A copy cannot be carried by a path and by an object.", hint="Leave one of them out.")
        carried_by = OnPath(on_path) if on_path else None
        if on_object:
            carried_by = OnObject(object_named(self.document, on_object).object_id)
        first, _ = span_of(found) or (0, 1)
        anchor = float(max(scope.first, first)) if anchor_frame is None else anchor_frame
        if pivot is None:
            is_plain = scale == 1.0 and abs(quat[0]) == 1.0
            pivot = ORIGIN if is_plain else self._middle(found, anchor)
        try:
            return ObjectCopy(
                0,
                copy_name,
                found.object_id,
                Transform(by, quat, scale, pivot),
                shift_frames,
                speed,
                anchor,
                outside,
                is_in_place,
                carried_by,
                scope.first,
                scope.stop,
                group,
            )
        except ValueError as error:
            raise ProjectError(f"The copy is not valid ({error}).") from error

    def replace_copy(self, copy: ObjectCopy) -> None:
        """Put a copy in the place of the one with its number. Raises ProjectError."""
        if copy_with(self.document, copy.copy_id) != copy:
            self._carry_out(ChangeCopy(copy))

    def switch_copies(self, which: str | Sequence[int], *, is_on: bool) -> None:
        """Let copies count or not. which: A name of a copy or of a group, or numbers. Raises ProjectError."""
        chosen = self._chosen(which)
        if any(copy_with(self.document, copy_id).is_on != is_on for copy_id in chosen):
            self._carry_out(SwitchCopies(chosen, is_on))

    def remove_copies(self, which: str | Sequence[int]) -> None:
        """Remove copies. which: A name of a copy or of a group, or numbers. Raises ProjectError."""
        self._carry_out(RemoveCopies(self._chosen(which)))

    def _chosen(self, which: str | Sequence[int]) -> tuple[int, ...]:
        if not isinstance(which, str):
            return tuple(which)
        found = tuple(copy.copy_id for copy in self.copies if which in (copy.group, copy.name))
        if not which or not found:
            names = list(dict.fromkeys(copy.group or copy.name for copy in self.copies))
            more = "..." if len(names) > 8 else ""
            hint = f"There are {', '.join(map(one_line, names[:8]))}{more}." if names else "The project has no copies."
            raise ProjectError(f"There is no copy and no group of copies called {shown(which)}.", hint=hint)
        return found

    def _middle(self, found: SceneObject, frame: float) -> Vector:
        """The middle of an object at a moment, as edits leave it; needs its clip. Scene units"""
        from app.export.scene_frames import SceneFrames
        from engine.editing.copies.copied import middle_of

        alone = (ObjectCopy(0, found.name, found.object_id),)
        scene = SceneFrames(self.open_trained(), edits=EditStack(self.document.edits, self.document.objects, alone))
        gaussians = scene.copied(frame)
        middle = None if gaussians is None else middle_of(gaussians)
        if middle is None:
            raise ProjectError(
                f"{shown(found.name)} is not there at frame {frame:g}, so that its middle is not known.",
                hint="Give the pivot, or another anchor frame.",
            )
        x, y, z = (float(value) for value in middle)
        return x, y, z
