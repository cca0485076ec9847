"""ProjectDocument: everything that a user decides about a project, as one immutable value."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta, Struct

from app.document.project_settings import ProjectSettings
from engine.camera.camera_path import CameraPath
from engine.capture.exclusions import NOTHING_EXCLUDED, Exclusions
from engine.editing.actions import Vector
from engine.editing.copies.object_copy import NO_COPIES, Copies
from engine.editing.edit import Edit
from engine.editing.effects import EditStack
from engine.editing.scene_object import NO_OBJECTS, Objects
from engine.gate.regions import GateRegion
from engine.timing.segment import Segment

MAX_TEXT_CHARACTERS = 200
_Count = Annotated[int, Meta(ge=0, lt=2**31)]
_Text = Annotated[str, Meta(max_length=MAX_TEXT_CHARACTERS)]


class Marker(Struct, frozen=True, forbid_unknown_fields=True):
    """A named moment on the timeline."""

    frame_index: _Count
    text: _Text


class Label(Struct, frozen=True, forbid_unknown_fields=True):
    """The user's own name for a clip or a camera.

    Attributes:
        kind: "clip" or "camera".
        name: First frame of the clip as text, or the name of the camera in the capture.
        text: Shown next to it.
    """

    kind: Annotated[str, Meta(pattern=r"\A(clip|camera)\Z")]
    name: _Text
    text: _Text


class World(Struct, frozen=True, forbid_unknown_fields=True):
    """How the scene lies in the world.

    Attributes:
        up: Direction that is up, in scene axes, of unit length; None for the one that the cameras suggest.
        meters_per_unit: Length of a scene unit, m; None where unknown.

    Raises:
        ValueError: The direction is not of unit length, or the length not positive.
    """

    up: Vector | None = None
    meters_per_unit: float | None = None

    def __post_init__(self) -> None:
        if self.up is not None and not abs(math.sqrt(sum(x * x for x in self.up)) - 1.0) <= 1e-3:
            raise ValueError(f"the direction {self.up} is not of unit length")
        if self.meters_per_unit is not None and not 1e-9 <= self.meters_per_unit <= 1e9:
            raise ValueError(f"a scene unit of {self.meters_per_unit} m is out of range")


AS_CAPTURED = World()


@dataclass(frozen=True, slots=True)
class ProjectDocument:
    """Everything that a user decides about a project. Change it with dataclasses.replace.

    Attributes:
        settings: Shared by all clips.
        regions: Where the user overrules the gate; later ones overrule earlier ones.
        camera_paths: In the user's order.
        edits: The stack, bottom first.
        markers: On the timeline, by frame.
        labels: The user's own names.
        exclusions: Cameras, pictures and painted parts that training never sees.
        world: Up and scale.
        timing: Segments of the take in the order in which they play; none for the take as captured.
        objects: People and things that were given a name, in the user's order.
        copies: Objects that are shown once more, in the user's order.
    """

    settings: ProjectSettings
    regions: tuple[GateRegion, ...] = ()
    camera_paths: tuple[CameraPath, ...] = ()
    edits: tuple[Edit, ...] = ()
    markers: tuple[Marker, ...] = ()
    labels: tuple[Label, ...] = ()
    exclusions: Exclusions = NOTHING_EXCLUDED
    world: World = AS_CAPTURED
    timing: tuple[Segment, ...] = ()
    objects: Objects = NO_OBJECTS
    copies: Copies = NO_COPIES

    def stack(self) -> EditStack:
        """Its edits, to be asked moment by moment, and what copies are made of."""
        return EditStack(self.edits, self.objects, self.copies, self.camera_paths)
