"""Commands on camera paths, as frozen dataclasses in the imperative. See app.session.commands.

They act on the chosen path, and its keys are numbered from 0. All but the last three can be taken back. Changes with
the same `gesture` above 0 in a row, such as the stretches of one drag, are taken back together.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class NewCameraPath:
    """Begin a path with a key at the playhead, from where the current view looks, and choose it."""

    name: str = ""
    """Empty for the next free one."""


@dataclass(frozen=True, slots=True)
class RenameCameraPath:
    """Give the chosen path another name."""

    name: str


@dataclass(frozen=True, slots=True)
class DeleteCameraPath:
    """Delete the chosen path."""


@dataclass(frozen=True, slots=True)
class SetCameraKey:
    """Put a key at the playhead from where the current view looks; one that is there already takes that view. Without
    a path one is begun."""


@dataclass(frozen=True, slots=True)
class DeleteCameraKey:
    """Delete a key."""

    index: int


@dataclass(frozen=True, slots=True)
class TimeCameraKey:
    """Move a key in time, held between its neighbours."""

    index: int
    frame: float
    gesture: int = 0
    is_whole: bool = True
    """Whether only to whole frames of the capture."""


@dataclass(frozen=True, slots=True)
class PlaceCameraKey:
    """Move a key in space; it stays turned as it is."""

    index: int
    center: tuple[float, float, float]
    """Scene units."""
    gesture: int = 0


@dataclass(frozen=True, slots=True)
class AimCameraKey:
    """Let a key take the place, the direction and the lens of the current view, at its own time."""

    index: int


@dataclass(frozen=True, slots=True)
class SetCameraKeyFov:
    """Give a key another lens."""

    index: int
    fov_y_rad: float
    gesture: int = 0


@dataclass(frozen=True, slots=True)
class CloseCameraPath:
    """Let the chosen path be a loop, or end at its last key."""

    is_closed: bool


@dataclass(frozen=True, slots=True)
class MakeTurntable:
    """Begin a path that circles the pivot of the current view, from where it stands, while the played frames go by."""

    n_turns: float = 1.0
    """Seen from above, positive ones go counterclockwise."""


@dataclass(frozen=True, slots=True)
class MakeFlyThrough:
    """Begin a path that goes from camera to camera of the capture while the played frames go by."""


@dataclass(frozen=True, slots=True)
class ChooseCameraPath:
    """Show and edit the path in this row."""

    row: int


@dataclass(frozen=True, slots=True)
class ChooseCameraKey:
    """Let a key stand out, or none. `is_going` also moves the playhead and the view there."""

    index: int | None
    is_going: bool = False


@dataclass(frozen=True, slots=True)
class LookAlongPath:
    """Let the view follow the chosen path with the playhead, until the user moves it; or stop that."""

    is_on: bool = True


PathEdit = (
    NewCameraPath
    | RenameCameraPath
    | DeleteCameraPath
    | SetCameraKey
    | DeleteCameraKey
    | TimeCameraKey
    | PlaceCameraKey
    | AimCameraKey
    | SetCameraKeyFov
    | CloseCameraPath
    | MakeTurntable
    | MakeFlyThrough
)
"""Commands that change camera paths."""

PathCommand = PathEdit | ChooseCameraPath | ChooseCameraKey | LookAlongPath
"""Commands on camera paths."""
