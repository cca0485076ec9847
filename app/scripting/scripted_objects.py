"""ScriptedObjects: the part of a ScriptedProject that makes, corrects and finds objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from msgspec import structs

from app.document.changes import object_changes
from app.document.changes.edit_changes import edit_with
from app.document.changes.object_changes import object_named
from app.document.history import Event, ObjectFound
from app.document.project_document import ProjectDocument
from app.session.editing.edit_commands import ChangeEdit
from app.session.editing.edits import changed as edit_change
from app.session.objects.object_commands import (
    ObjectCommand,
    RecolourObject,
    RemoveObject,
    RenameObject,
    SetObjectSpan,
    SetObjectTrained,
)
from app.session.objects.objects import changed
from engine.editing.actions import Vector
from engine.editing.edit import Edit, ObjectTarget, Picked
from engine.editing.scene_object import ObjectSeed, SceneObject
from engine.errors import ProjectError

if TYPE_CHECKING:
    from app.project.project import Project
    from engine.capture.capture import Capture
    from engine.capture.clip import Clip

TellSearch = Callable[[float], None]
"""Receives the share that is searched, 0..1; its exceptions end the search."""


class ScriptedObjects:
    """Methods about objects, which are named by their names or numbers."""

    _project: Project

    # ---------------------------------------------------------------- what the rest of a ScriptedProject has

    @property
    def document(self) -> ProjectDocument:
        raise NotImplementedError

    @property
    def capture(self) -> Capture:
        raise NotImplementedError

    @property
    def clips(self) -> list[Clip]:
        raise NotImplementedError

    def change(self, document: ProjectDocument, name: str) -> None:
        raise NotImplementedError

    def _happen(self, event: Event) -> None:
        raise NotImplementedError

    # ---------------------------------------------------------------- objects

    @property
    def objects(self) -> tuple[SceneObject, ...]:
        """People and things with a name: where they are, and for which reason that is uncertain."""
        return self.document.objects

    def object(self, name: str | int) -> ObjectTarget:
        """An object as the target of an edit. Raises ProjectError where there is none, and lists those there are."""
        return ObjectTarget(self._named(name).object_id)

    def make_object(
        self,
        name: str,
        picked: Picked,
        frame_index: int,
        *,
        color: Vector | None = None,
        on_progress: TellSearch | None = None,
    ) -> SceneObject:
        """Make an object of Gaussians of one frame, and look for it in all clips: one step.

        Args:
            name: An empty one is replaced by the first free "object N".
            picked: Its Gaussians in that frame, as `select` gives them.
            frame_index: The frame.
            color: RGB in 0..1; None for one that is free.
            on_progress: See TellSearch; where it ends the search, nothing has changed.
        Raises:
            ProjectError: The name is taken, a clip is damaged, or what `change` raises.
        """
        seed = ObjectSeed(frame_index, picked.sets)
        made = object_changes.add_object(
            self.document, seed, name=name, color=color, within=self._frames_around(frame_index)
        )
        one = made.objects[-1]
        self.change(self._searched(made, one.object_id, on_progress), f"make {one.name}")
        return self.document.objects[-1]

    def correct_object(
        self,
        name: str | int,
        frame_index: int,
        *,
        added: Picked | None = None,
        removed: Picked | None = None,
        on_progress: TellSearch | None = None,
    ) -> SceneObject:
        """Say what else belongs to an object in one frame, or does not, and look for it again: one step.

        Args:
            added, removed: Gaussians of that frame, as `select` gives them.
            on_progress: See `make_object`.
        Raises:
            ProjectError: There is no such object, nothing is given, or what `change` raises.
        """
        one = self._named(name)
        seed = ObjectSeed(frame_index, () if added is None else added.sets, () if removed is None else removed.sets)
        made = object_changes.correct_object(
            self.document, one.object_id, seed, within=self._frames_around(frame_index)
        )
        what = (
            f"add to {one.name}" if removed is None else f"{'remove from' if added is None else 'correct'} {one.name}"
        )
        self.change(self._searched(made, one.object_id, on_progress), what)
        return self._named(one.object_id)

    def find_object(self, name: str | int, *, on_progress: TellSearch | None = None) -> SceneObject:
        """Look for an object in all clips again, as after training some anew. Not a step of the history.

        Args:
            on_progress: See `make_object`.
        Raises:
            ProjectError: There is no such object, a clip is damaged, or what `change` raises.
        """
        one = self._named(name)
        self._project.check_writable()
        searched = self._searched(self.document, one.object_id, on_progress)
        clips = object_changes.object_with(searched, one.object_id).clips
        self._happen(ObjectFound(one.object_id, one.seeds, clips))
        return self._named(one.object_id)

    def measure_object(
        self,
        name: str | int,
        *,
        clip_indices: Sequence[int] | None = None,
        on_progress: Callable[[int, int], None] | None = None,
    ) -> dict[str, Any]:
        """PSNR over the pixels of an object alone, by clip; see app.objects.object_figures.

        Args:
            clip_indices: All that are trained when None.
            on_progress: Told how many pictures are done, of how many; its exceptions end the work.
        Raises:
            ProjectError: There is no such object, or a clip is not trained.
        """
        from app.evaluation.headless import open_trained
        from app.objects.object_figures import object_figures

        one, opened = self._named(name), open_trained(self._project, self.capture)
        chosen = opened.trained if clip_indices is None else list(clip_indices)
        tell = (lambda n_done, n_all: None) if on_progress is None else on_progress
        return object_figures(opened, one, chosen, tell)

    def rename_object(self, name: str | int, new_name: str) -> None:
        """Give an object another name. Raises ProjectError."""
        self._change_object(RenameObject(self._named(name).object_id, new_name))

    def recolour_object(self, name: str | int, color: Vector) -> None:
        """Give an object another colour, RGB in 0..1. Raises ProjectError."""
        self._change_object(RecolourObject(self._named(name).object_id, color))

    def set_object_span(self, name: str | int, first: int = 0, stop: int | None = None) -> None:
        """Let an object exist in some frames only; `stop` is not one of them. Raises ProjectError."""
        self._change_object(SetObjectSpan(self._named(name).object_id, first, stop))

    def set_object_trained(self, name: str | int, *, is_trained: bool, on_progress: TellSearch | None = None) -> None:
        """Say whether clips that are trained from now on see an object. Where they do not, it is masked in the pictures
        of the clips in which it was found; in others nobody knows where it is.

        Args:
            on_progress: See `make_object`.
        Raises:
            ProjectError: There is no such object, it was found nowhere, or what `change` raises.
        """
        from app.evaluation.headless import open_trained
        from app.objects.object_masks import object_masks

        one = self._named(name)
        if is_trained:
            self._change_object(SetObjectTrained(one.object_id, is_trained=True))
            return
        self._project.check_writable()
        masks = object_masks(open_trained(self._project, self.capture), one, _share_told(on_progress))
        made = object_changes.set_trained(self.document, one.object_id, is_trained=False, masks=masks)
        self.change(made, f"train without {one.name}")

    def remove_object(self, name: str | int) -> None:
        """Remove an object, and the edits that act on it. Raises ProjectError."""
        self._change_object(RemoveObject(self._named(name).object_id))

    def follow_object(self, name: str | int, edit_id: int, *, on_progress: TellSearch | None = None) -> Edit:
        """Let an edit act on a volume that goes along with an object: of the kind it has, else a box. One step.

        Args:
            on_progress: Receives the share of frames that were looked at; its exceptions end it, and nothing changes.
        Returns:
            The edit, with a KeyedVolume as its target.
        Raises:
            ProjectError: There is no such object or edit, the object was found nowhere, or what `change` raises.
        """
        from app.objects.following import follow_in_project

        def report(n_done: int, n_all: int) -> None:
            if on_progress is not None:
                on_progress(n_done / max(n_all, 1))

        one, edit = self._named(name), edit_with(self.document, edit_id)
        keyed = follow_in_project(self._project, self.capture, one, edit.target, report)
        command = ChangeEdit(structs.replace(edit, target=keyed), verb=f"follow {one.name}")
        change = edit_change(self.document, command)
        self.change(change.document, change.name)
        return edit_with(self.document, edit_id)

    # ---------------------------------------------------------------- pieces

    def _named(self, name: str | int) -> SceneObject:
        if isinstance(name, int):
            return object_changes.object_with(self.document, name)
        return object_named(self.document, name)

    def _change_object(self, command: ObjectCommand) -> None:
        change = changed(self.document, command)
        if change.document != self.document:
            self.change(change.document, change.name)

    def _frames_around(self, frame_index: int) -> tuple[int, int]:
        clip = next((clip for clip in self.clips if clip.start <= frame_index < clip.stop), None)
        if clip is None:
            raise ProjectError(f"There is no frame {frame_index}; the last one is {self.clips[-1].stop - 1}.")
        return clip.start, clip.stop

    def _searched(self, document: ProjectDocument, object_id: int, on_progress: TellSearch | None) -> ProjectDocument:
        from app.objects.searching import find_in_project

        one = object_changes.object_with(document, object_id)
        clips = find_in_project(self._project, self.capture, one, _share_told(on_progress))
        return object_changes.with_found(document, object_id, clips)


def _share_told(on_progress: TellSearch | None) -> Callable[[float, float], None]:
    def report(done: float, total: float) -> None:
        if on_progress is not None:
            on_progress(done / max(total, 1))

    return report
