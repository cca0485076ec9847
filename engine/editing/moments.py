"""Moments: what a target stands for at one time."""

from __future__ import annotations

from engine.editing.edit import KeyedVolume, ObjectTarget, Picked, Target, TargetOfMoment
from engine.editing.keyed_volume import volume_at
from engine.editing.scene_object import Objects, object_of


def at_moment(target: Target, frame: float, objects: Objects) -> TargetOfMoment:
    """A target as something that can be looked up in the clip of a moment: Gaussians, a volume in its place then.

    Args:
        frame: In frames of the capture, between frames too.
        objects: Of the document.
    """
    match target:
        case ObjectTarget():
            found = object_of(target, objects)
            return Picked(()) if found is None else found.picked(frame)
        case KeyedVolume():
            return volume_at(target, frame)
        case _:
            return target
