"""Edit: one change to a trained scene: its target, its action, and its frames. Plain values that travel as
JSON; nothing here touches Gaussians.

Edits form a stack. Each acts on what those before it have left, in the frames of its scope, and on nothing outside of
them; clips themselves stay as they were trained.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated

from msgspec import Meta, Struct

from engine.editing.actions import FAR, Action, Quat, Vector, check_quat

MAX_NAME_CHARACTERS = 200
MAX_CORNERS, MAX_KEYS = 256, 10_000
"""Of the outline of a prism, and of a volume that moves."""
MIN_SPACING_FRAMES, MAX_FRAME = 1e-3, 1e9
"""Keys are at least this far apart in time, and no farther than that from frame 0."""
_Count = Annotated[int, Meta(ge=0, lt=2**31)]
_Name = Annotated[str, Meta(max_length=MAX_NAME_CHARACTERS)]


class Scope(Struct, frozen=True, forbid_unknown_fields=True):
    """The frames in which an edit holds.

    Attributes:
        first: The first one.
        stop: One after the last; None for all that follow.
        is_reference_only: Whether it acts only on what comes from the reference clip; what clips have added, or have
            learned on, stays.

    Raises:
        ValueError: There is no frame in it.
    """

    first: _Count = 0
    stop: _Count | None = None
    is_reference_only: bool = False

    def __post_init__(self) -> None:
        if self.stop is not None and self.stop <= self.first:
            raise ValueError(f"a scope from frame {self.first} up to {self.stop} holds no frame")

    def holds_at(self, frame: float) -> bool:
        """Whether a moment belongs to it: that between two frames belongs to the one before."""
        return self.first <= math.floor(frame) and (self.stop is None or math.floor(frame) < self.stop)

    def touches(self, first: int, stop: int) -> bool:
        """Whether any of the frames [first, stop) belongs to it."""
        return self.first < stop and (self.stop is None or first < self.stop)


EVERYWHERE = Scope()

# ---------------------------------------------------------------- targets


class Everything(Struct, frozen=True, forbid_unknown_fields=True, tag="everything"):
    """All Gaussians."""


class Box(Struct, frozen=True, forbid_unknown_fields=True, tag="box"):
    """Gaussians whose centres lie in a box; the border belongs to it.

    Attributes:
        center: Scene units.
        half_sizes: Half its lengths along its own axes, scene units.
        quat: Turns its axes into those of the scene, wxyz, of unit length.

    Raises:
        ValueError: A number is not finite, not positive, or the quaternion is not a rotation.
    """

    center: Vector
    half_sizes: Vector
    quat: Quat = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _check_finite("a box", *self.center, *self.half_sizes)
        if min(self.half_sizes) <= 0.0:
            raise ValueError(f"a box with half sizes {self.half_sizes} is empty")
        check_quat(self.quat)


class Sphere(Struct, frozen=True, forbid_unknown_fields=True, tag="sphere"):
    """Gaussians whose centres lie in a sphere; the border belongs to it. Scene units.

    Raises:
        ValueError: A number is not finite, or the radius not positive.
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        _check_finite("a sphere", *self.center, self.radius)
        if self.radius <= 0.0:
            raise ValueError(f"a sphere with the radius {self.radius} is empty")


class Prism(Struct, frozen=True, forbid_unknown_fields=True, tag="prism"):
    """Gaussians whose centres lie in a prism, or in a part of a pyramid: an outline that runs along its own z axis.

    Its ends belong to it. What the outline goes around twice is inside, as with a lasso.

    Attributes:
        center: Scene units.
        half_sizes: What 1 stands for along its own axes, scene units: in the outline, and from the middle to its ends.
        outline: Corners in its own x and y, from -1 to 1, the last one joined to the first; those of the cut through
            its middle.
        quat: Turns its axes into those of the scene, wxyz, of unit length.
        apex: How far from the middle, against its own z axis, all its sides meet, in half depths; a lasso has the eye
            there. None where the sides are parallel.

    Raises:
        ValueError: A number is not finite or out of range, or the quaternion is not a rotation.
    """

    center: Vector
    half_sizes: Vector
    outline: tuple[tuple[float, float], ...]
    quat: Quat = (1.0, 0.0, 0.0, 0.0)
    apex: float | None = None

    def __post_init__(self) -> None:
        _check_finite("a prism", *self.center, *self.half_sizes)
        if min(self.half_sizes) <= 0.0:
            raise ValueError(f"a prism with half sizes {self.half_sizes} is empty")
        if not 3 <= len(self.outline) <= MAX_CORNERS:
            raise ValueError(f"the outline of a prism has {len(self.outline)} corners, not 3 to {MAX_CORNERS}")
        if not all(abs(number) <= 1.0 for corner in self.outline for number in corner):  # NaN is not
            raise ValueError("the outline of a prism has a corner that is not between -1 and 1")
        if self.apex is not None and not 1.0 < self.apex <= FAR:
            raise ValueError(f"the sides of a prism meet {self.apex:g} half depths away, not more than 1")
        check_quat(self.quat)


Volume = Box | Sphere | Prism


class VolumeKey(Struct, frozen=True, forbid_unknown_fields=True):
    """A volume at one time.

    Attributes:
        frame: When, in frames of the capture; may lie between two frames.
        volume: Where it is then, how large, and how it is turned.

    Raises:
        ValueError: The frame is not finite, or too far away.
    """

    frame: float
    volume: Volume

    def __post_init__(self) -> None:
        if not abs(self.frame) <= MAX_FRAME:  # NaN is not
            raise ValueError(f"the frame of a key is {self.frame!r}")


class KeyedVolume(Struct, frozen=True, forbid_unknown_fields=True, tag="keyed"):
    """A volume that moves, grows and turns from key to key; see engine.editing.volumes.keyed_volume.

    Before its first key it rests as it is there, after its last key as there.

    Attributes:
        keys: By frame, at least MIN_SPACING_FRAMES apart: all boxes, all spheres, or all prisms of the same outline.

    Raises:
        ValueError: There are no keys or too many, they are not in order, or not of one kind.
    """

    keys: tuple[VolumeKey, ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.keys) <= MAX_KEYS:
            raise ValueError(f"a keyed volume has {len(self.keys)} keys, not 1 to {MAX_KEYS}")
        for before, after in pairwise(self.keys):
            if after.frame - before.frame < MIN_SPACING_FRAMES:
                raise ValueError(
                    f"keys of a volume are not in order or too close: frames {before.frame:g} and {after.frame:g}"
                )
            if not is_same_shape(before.volume, after.volume):
                raise ValueError(f"the volumes at frames {before.frame:g} and {after.frame:g} are not of one shape")


def is_same_shape(a: Volume, b: Volume) -> bool:
    """Whether two volumes differ only in place, sizes and turn, so that one can become the other."""
    if isinstance(a, Prism) and isinstance(b, Prism):
        return a.outline == b.outline and (a.apex is None) == (b.apex is None)
    return type(a) is type(b)


class PickedRows(Struct, frozen=True, forbid_unknown_fields=True):
    """Gaussians of one anchor set, by number. See engine.editing.picks, which packs and unpacks them.

    Attributes:
        clip_index: The clip that trained the anchors, in words for people; what counts is the origin.
        origin: Fingerprint of that clip's file. Anchors that a clip inherits keep the origin of the reference clip, so
            that they are the same in all clips.
        role: Of the anchors, see engine.clip_files.roles.
        rows: Numbers of Gaussians, anchor * K + k, rising; packed.
    """

    clip_index: _Count
    origin: str
    role: str
    rows: bytes


class Picked(Struct, frozen=True, forbid_unknown_fields=True, tag="picked"):
    """Gaussians that somebody has selected, whatever they do over time."""

    sets: tuple[PickedRows, ...]


class ObjectTarget(Struct, frozen=True, forbid_unknown_fields=True, tag="object"):
    """A named object, see engine.editing.scene_object: what it consists of is known in each clip.

    Attributes:
        object_id: Of the object in the same document; one that was removed stands for nothing.
    """

    object_id: _Count


TargetOfMoment = Everything | Box | Sphere | Prism | Picked
"""Those that can be looked up in one clip at one moment; see engine.editing.effects.at_moment."""
Target = TargetOfMoment | ObjectTarget | KeyedVolume

# ---------------------------------------------------------------- the edit


class Fill(Struct, frozen=True, forbid_unknown_fields=True):
    """What shows in the place of something that an edit takes away, see engine.editing.fills.fill.

    Attributes:
        made_for: `fill_key` of the edit when it was made; with another target or effect it does not fit any more.
        traces: Still Gaussians that the edit takes away, too.
        gaussians: New ones, packed, see `packed_fill`.
    """

    made_for: str
    traces: tuple[PickedRows, ...] = ()
    gaussians: bytes = b""


class Edit(Struct, frozen=True, forbid_unknown_fields=True):
    """One change to the scene.

    Attributes:
        edit_id: Names it for good; no two edits of a document have the same.
        name: For people.
        target: The Gaussians it acts on, ...
        is_inverted: ... or everything but that, as for cropping and isolating.
        action: The action to apply.
        scope: In which frames.
        is_on: Whether it counts now.
        fill: What shows in the place of what it takes away; None for what is behind, as it was trained.
    """

    edit_id: _Count
    name: _Name
    target: Target
    action: Action
    scope: Scope = EVERYWHERE
    is_inverted: bool = False
    is_on: bool = True
    fill: Fill | None = None


def edits_at(edits: tuple[Edit, ...], frame: float) -> tuple[Edit, ...]:
    """The edits that count at a moment, in the order of the stack."""
    return tuple(edit for edit in edits if edit.is_on and edit.scope.holds_at(frame))


def _check_finite(what: str, *numbers: float) -> None:
    if not all(math.isfinite(number) and abs(number) <= 1e12 for number in numbers):
        raise ValueError(f"{what} has a number that is not finite or too large")
