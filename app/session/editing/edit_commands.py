"""Commands that change the edits, markers, labels and the world of a project, as frozen dataclasses in the imperative.

A gesture is the number of a drag, or of presses of a key that belong together: changes with the same one are taken
back at once. 0 stands for a separate change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from engine.editing.actions import Action, Vector
from engine.editing.edit import EVERYWHERE, Edit, Scope, Target


@dataclass(frozen=True, slots=True)
class AddEdit:
    """Put a new edit on top of the stack."""

    action: Action
    target: Target | None = None
    """None for the selection, which is cleared where it disappears."""
    scope: Scope = EVERYWHERE
    is_inverted: bool = False
    """Whether it acts on everything but the target."""
    name: str = ""


@dataclass(frozen=True, slots=True)
class ChangeEdit:
    """Put an edit in the place of the one that has its number."""

    edit: Edit
    gesture: int = 0
    verb: str = "change"
    """Begins the name of the step in the history."""


@dataclass(frozen=True, slots=True)
class FillBehind:
    """Fill what was behind something that an edit deletes or hides; takes a while."""

    edit_id: int


@dataclass(frozen=True, slots=True)
class RemoveEdit:
    """Take an edit out of the stack."""

    edit_id: int


@dataclass(frozen=True, slots=True)
class DuplicateEdit:
    """Put a copy of an edit right above it."""

    edit_id: int


@dataclass(frozen=True, slots=True)
class MoveEdit:
    """Bring an edit to another position of the stack, counted from 0 at the bottom."""

    edit_id: int
    position: int


@dataclass(frozen=True, slots=True)
class ToggleEdit:
    """Let an edit count, or not."""

    edit_id: int


@dataclass(frozen=True, slots=True)
class RenameEdit:
    """Give an edit another name; an empty one stands for its effect."""

    edit_id: int
    name: str


@dataclass(frozen=True, slots=True)
class PutMarker:
    """Mark a frame, or give its marker another name."""

    frame_index: int
    text: str = ""
    gesture: int = 0


@dataclass(frozen=True, slots=True)
class RemoveMarker:
    """Forget the marker of a frame."""

    frame_index: int


@dataclass(frozen=True, slots=True)
class MoveMarker:
    """Bring the marker of a frame to another one."""

    frame_index: int
    to_frame: int
    gesture: int = 0


@dataclass(frozen=True, slots=True)
class SetLabel:
    """Give a clip or a camera a name of the user's own; see app.document.project_document.Label."""

    kind: Literal["clip", "camera"]
    name: str
    text: str
    gesture: int = 0


@dataclass(frozen=True, slots=True)
class SetUp:
    """Set the direction of the scene that is up; None for the one that the cameras suggest."""

    direction: Vector | None


@dataclass(frozen=True, slots=True)
class SetUpByGround:
    """Set the up direction upright on the ground. points: Three of the ground, scene units."""

    points: tuple[Vector, Vector, Vector]
    toward: Vector
    """A point above the ground, such as where the cameras stand."""


@dataclass(frozen=True, slots=True)
class SetScaleByLength:
    """Two points are known to be so far apart. a, b: Scene units."""

    a: Vector
    b: Vector
    length_m: float


@dataclass(frozen=True, slots=True)
class SetScale:
    """Set the length of a scene unit, m; None removes it."""

    meters_per_unit: float | None


@dataclass(frozen=True, slots=True)
class Undo:
    """Take back the last change of the project's content since it was opened: of regions or of camera paths."""

    @property
    def n_steps(self) -> int:
        """As of GoToStep."""
        return -1


@dataclass(frozen=True, slots=True)
class Redo:
    """Do the last undone step again; another change ends that."""

    @property
    def n_steps(self) -> int:
        """As of GoToStep."""
        return 1


@dataclass(frozen=True, slots=True)
class GoToStep:
    """Undo steps of the history, or redo them where the number is positive."""

    n_steps: int


EditCommand = (
    AddEdit
    | ChangeEdit
    | RemoveEdit
    | DuplicateEdit
    | MoveEdit
    | ToggleEdit
    | RenameEdit
    | PutMarker
    | RemoveMarker
    | MoveMarker
    | SetLabel
    | SetUp
    | SetUpByGround
    | SetScale
    | SetScaleByLength
)
"""Commands that change edits, markers, labels and the world, and can be taken back."""

HistoryCommand = Undo | Redo | GoToStep
"""Commands that move in the history."""
