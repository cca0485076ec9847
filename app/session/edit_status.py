"""What the window shows of edits: values only."""

from __future__ import annotations

from dataclasses import dataclass

from engine.camera.camera_path import CameraKey, CameraPath


@dataclass(frozen=True, slots=True)
class HistoryStatus:
    """What can be taken back and done again.

    Attributes:
        undo, redo: What that would be, as a word or two; empty where there is nothing.
    """

    undo: str = ""
    redo: str = ""


@dataclass(frozen=True, slots=True)
class PathsStatus:
    """Camera paths of the open project.

    Attributes:
        paths: In the user's order.
        chosen: Row of the path that is shown and edited; None without paths.
        chosen_key: Number of the key of that path that stands out; None without one.
        along: Index of the view that goes along the chosen path with the playhead; None while none does.
        can_edit: Whether paths can be changed now.
        why_not: The reason if they cannot, and what to do.
    """

    paths: tuple[CameraPath, ...] = ()
    chosen: int | None = None
    chosen_key: int | None = None
    along: int | None = None
    can_edit: bool = False
    why_not: str = ""

    @property
    def is_along(self) -> bool:
        """Whether a view goes along the path."""
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
