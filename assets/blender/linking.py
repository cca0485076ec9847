# SPDX-License-Identifier: MIT
"""The objects of a sequence: an empty in Blender's world, and on it a mesh per part and the cameras."""

import bpy
from mathutils import Vector

from . import cameras, look
from .sidecar import PARTS, Sequence

PART, CAMERA = "clipgstream_part", "clipgstream_camera"
"""Properties of objects: the part of the scene that a mesh shows; the name of a camera in the capture. A collection
with the latter holds the cameras."""

_NEAR = 0.01
N_BOUNCES = 256
"""Gaussians that a ray of Cycles passes through at most."""


def make(scene: bpy.types.Scene, sequence: Sequence) -> bpy.types.Object:
    """Make collection and empty of a sequence, turned so that z is up, in metres where the project says how long its
    unit is."""
    collection = bpy.data.collections.new(sequence.name)
    scene.collection.children.link(collection)
    root = bpy.data.objects.new(sequence.name, None)
    root.empty_display_size = 0.25
    collection.objects.link(root)
    place(root, sequence)
    return root


def place(root: bpy.types.Object, sequence: Sequence) -> None:
    """Stand the scene upright, in metres."""
    root.rotation_mode = "QUATERNION"
    root.rotation_quaternion = Vector(sequence.up).rotation_difference(Vector((0.0, 0.0, 1.0)))
    root.scale = (sequence.meters_per_unit or 1.0,) * 3


def link(root: bpy.types.Object, sequence: Sequence) -> None:
    """Make the objects on the empty those of the sequence. Objects that are there already stay the same ones, with
    whatever was done to them."""
    collection = root.users_collection[0]
    parts = objects_of(root)
    for part in PARTS:
        if part in sequence.files and part not in parts:
            _add_part(root, collection, sequence.name, part)
        elif part not in sequence.files and part in parts:
            _remove(parts[part])
    there = {child[CAMERA]: child for child in root.children if CAMERA in child}
    near_m = (sequence.near_plane or _NEAR) * (sequence.meters_per_unit or 1.0)
    for row in sequence.cameras:
        camera = there.pop(row.name, None) or _add_camera(root, collection, row.name)
        cameras.set_camera(camera, row, near_m=near_m)
    for camera in there.values():
        _remove(camera)


def objects_of(root: bpy.types.Object) -> dict[str, bpy.types.Object]:
    """The meshes on an empty by the part that they show."""
    return {child[PART]: child for child in root.children if PART in child}


def set_scene(scene: bpy.types.Scene, root: bpy.types.Object, sequence: Sequence) -> None:
    """Give the scene range, frame rate and view transform of the sequence, and its first camera."""
    render = scene.render
    render.fps = max(1, round(sequence.fps))
    render.fps_base = render.fps / sequence.fps
    scene.frame_start, scene.frame_end = sequence.first_frame, sequence.last_frame
    scene.frame_set(sequence.first_frame)
    scene.view_settings.view_transform = "Standard"
    if hasattr(scene, "cycles"):
        # rays pass through many Gaussians: without the second they would give up at random, which is noise
        scene.cycles.transparent_max_bounces = max(scene.cycles.transparent_max_bounces, N_BOUNCES)
        scene.cycles.min_transparent_bounces = max(scene.cycles.min_transparent_bounces, N_BOUNCES)
    if sequence.cameras:
        first = next(child for child in root.children if child.get(CAMERA) == sequence.cameras[0].name)
        cameras.look_through(scene, first)


def remove(root: bpy.types.Object) -> None:
    """Remove a sequence with all its objects and collections."""
    collection = root.users_collection[0]
    for child in root.children:
        _remove(child)
    for one in (*collection.children, collection):
        bpy.data.collections.remove(one)
    bpy.data.objects.remove(root)


def _add_part(root: bpy.types.Object, collection: bpy.types.Collection, name: str, part: str) -> None:
    title = name if part == "all" else f"{name} {part}"
    made = bpy.data.objects.new(title, bpy.data.meshes.new(title))
    made[PART] = part
    made.parent = root
    made.visible_shadow = False
    made.modifiers.new(look.NAME, "NODES").node_group = look.geometry()
    collection.objects.link(made)


def _add_camera(root: bpy.types.Object, collection: bpy.types.Collection, name: str) -> bpy.types.Object:
    shelf = next((child for child in collection.children if CAMERA in child), None)
    if shelf is None:
        shelf = bpy.data.collections.new(f"{root.name} cameras")
        shelf[CAMERA] = True
        collection.children.link(shelf)
    made = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    made[CAMERA] = name
    made.parent = root
    shelf.objects.link(made)
    return made


def _remove(made: bpy.types.Object) -> None:
    data = made.data
    bpy.data.objects.remove(made)
    if data.users == 0:
        bpy.data.batch_remove([data])
