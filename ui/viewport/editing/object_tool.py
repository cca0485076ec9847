"""Objects in the window: which one is chosen, and which ones are outlined. No ImGui, no GL."""

from __future__ import annotations

from dataclasses import dataclass

from engine.editing.scene_object import Objects, SceneObject


@dataclass(eq=False)
class ObjectTool:
    """State of the window.

    Attributes:
        chosen: Number of the object that new edits act on where nothing is selected or drawn; None without one.
        has_all_outlines: Whether all objects are outlined in the picture, not the chosen one alone.
        renamed: Number of the object whose name is being written; None while none is.
        text: That name.
        is_renaming_new: Whether the field of the name appears just now.
        first_row: The first object in the lane of the timeline.
    """

    chosen: int | None = None
    has_all_outlines: bool = False
    renamed: int | None = None
    text: str = ""
    is_renaming_new: bool = False
    first_row: int = 0

    def follow(self, objects: Objects) -> None:
        """Let go of an object that is gone."""
        if self.chosen is not None and all(one.object_id != self.chosen for one in objects):
            self.choose(None)

    def choose(self, object_id: int | None) -> None:
        """Let another object stand out."""
        self.chosen, self.renamed = object_id, None

    def choose_by(self, step: int, objects: Objects) -> None:
        """The next object of the list, or none after the last."""
        ids: list[int | None] = [None, *(one.object_id for one in objects)]
        present = ids.index(self.chosen) if self.chosen in ids else 0
        self.choose(ids[(present + step) % len(ids)])

    def rename(self, one: SceneObject) -> None:
        """Show a field for its name."""
        self.renamed, self.text, self.is_renaming_new = one.object_id, one.name, True

    def outlined(self, objects: Objects) -> Objects:
        """Those that are outlined in the picture."""
        return tuple(one for one in objects if self.has_all_outlines or one.object_id == self.chosen)
