"""Runs in a Python with bpy: installs the add-on, imports sequences, and writes down what Blender then holds.

Called by test_blender.py with the name of a function, a folder to work in, and the zip of the add-on.
"""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false, reportArgumentType=false

import json
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

FIELDS = {"position": "vector", "scale": "vector", "rotation": "value", "opacity": "value", "color": "color"}
WIDTHS = {"position": 3, "scale": 3, "rotation": 4, "opacity": 1, "color": 4}


def values(mesh_object: Any) -> dict[str, np.ndarray]:
    """Attributes of a mesh by their names; positions in the world."""
    mesh, found = mesh_object.data, {}
    for name, field in FIELDS.items():
        found[name] = np.empty(len(mesh.vertices) * WIDTHS[name], np.float32)
        mesh.attributes[name].data.foreach_get(field, found[name])
        found[name] = found[name].reshape(-1, WIDTHS[name])
    matrix = np.array(mesh_object.matrix_world)
    found["position"] = found["position"] @ matrix[:3, :3].T + matrix[:3, 3]
    return found


def meshes(root: Any) -> dict[str, Any]:
    """Its meshes by part."""
    return {child["clipgstream_part"]: child for child in root.children if child.type == "MESH"}


def counts(root: Any) -> dict[str, Any]:
    """By part the number of points, and None of a hidden one."""
    return {part: None if one.hide_render else len(one.data.vertices) for part, one in meshes(root).items()}


def refused(act: Any, **options: Any) -> str:
    """What an operator says that cannot do its work."""
    try:
        act(**options)
    except RuntimeError as error:
        return str(error)
    return ""


def pixels(scene: Any, camera: Any, points: np.ndarray) -> list[list[float]]:
    """Where points of the world are in a camera's picture, from its upper left corner."""
    with bpy.context.temp_override(object=camera):
        bpy.ops.clipgstream.look_through()
    width, height = scene.render.resolution_x, scene.render.resolution_y
    found = [world_to_camera_view(scene, camera, Vector(point)) for point in points]
    return [[at.x * width, (1.0 - at.y) * height] for at in found]


def check(folder: Path) -> dict[str, Any]:
    """A sequence in folder/split: import, frames, cameras, another speed, saving and loading, exporting again from
    folder/again, moving, and bad input from folder/bad."""
    scene = bpy.context.scene
    sidecar = folder / "split" / "p_export.json"
    bpy.ops.import_scene.clipgstream(filepath=str(sidecar))
    root = bpy.context.object
    said: dict[str, Any] = {
        "range": [scene.frame_start, scene.frame_end],
        "fps": scene.render.fps / scene.render.fps_base,
        "collection": root.users_collection[0].name,
        "cameras": [camera.name for camera in root.users_collection[0].children[0].objects],
        "camera": scene.camera.name,
        "problem": root.clipgstream.problem,
        "counts": {},
    }
    for frame in (1, 4):
        scene.frame_set(frame)
        for part, one in meshes(root).items():
            np.savez(folder / f"{part}_{frame}.npz", **values(one))
    points = values(meshes(root)["static"])["position"][::20]
    np.save(folder / "points.npy", points)
    said["pixels"] = {one.name: pixels(scene, one, points) for one in root.children if one.type == "CAMERA"}
    said["sizes"] = {one.name: list(one.data["clipgstream_size"]) for one in root.children if one.type == "CAMERA"}

    scene.render.fps, scene.render.fps_base = 15, 1.0
    scene.frame_set(2)
    said["counts"]["half the frame rate"] = counts(root)
    root.clipgstream.speed = 0.5
    scene.frame_set(3)
    said["counts"]["half the speed"] = counts(root)
    root.clipgstream.outside = "HIDE"
    scene.frame_set(99)
    said["counts"]["outside"] = counts(root)
    root.clipgstream.outside, root.clipgstream.part = "HOLD", "MOVING"
    said["counts"]["moving"] = counts(root)
    root.clipgstream.limit, root.clipgstream.size = 7, 2.0
    said["counts"]["limit"] = counts(root)
    root.clipgstream.limit, root.clipgstream.size, root.clipgstream.part = 0, 1.0, "ALL"

    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    scene.frame_set(99)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "scene.blend"))
    scene, root = bpy.context.scene, bpy.data.objects["p"]
    said["counts"]["loaded"] = counts(root)
    scene.frame_set(99)
    said["counts"]["after loading"] = counts(root)

    bpy.context.view_layer.objects.active = root
    (folder / "split").rename(folder / "elsewhere")
    scene.frame_set(1)
    said["moved"] = root.clipgstream.problem
    said["counts"]["moved"] = counts(root)
    bpy.ops.clipgstream.relink(filepath=str(folder / "elsewhere" / "p_export.json"))
    scene.frame_set(1)
    said["relinked"] = root.clipgstream.problem
    (folder / "elsewhere").rename(folder / "gone")
    (folder / "again").rename(folder / "elsewhere")
    bpy.ops.clipgstream.reload()
    said["counts"]["again"] = counts(root)
    np.savez(folder / "again.npz", **values(meshes(root)["all"]))
    said["camera again"] = scene.camera.name if scene.camera else None

    n_objects, bad = len(bpy.data.objects), sorted((folder / "bad").iterdir())
    said["refused"] = {
        one.name: refused(bpy.ops.import_scene.clipgstream, filepath=str(one / "p_export.json")) for one in bad
    }
    said["left over"] = len(bpy.data.objects) - n_objects
    path = root.clipgstream.path
    said["not relinked"] = refused(bpy.ops.clipgstream.relink, filepath=str(bad[0] / "p_export.json"))
    said["stays"] = root.clipgstream.path == path
    shown = meshes(root)["all"]
    shown.modifiers[0].node_group = bpy.data.node_groups.new("of the user", "GeometryNodeTree")
    scene.frame_set(3)
    shown.modifiers.clear()
    scene.frame_set(2)
    said["without our nodes"] = root.clipgstream.problem, len(shown.data.vertices)
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.clipgstream")
    scene.frame_set(2)
    return said


def render(folder: Path) -> dict[str, Any]:
    """A picture of folder/all at frame 4, through its first camera, in both kinds of colours."""
    for one in list(bpy.data.objects):
        bpy.data.objects.remove(one)
    bpy.ops.import_scene.clipgstream(filepath=str(folder / "all" / "p_export.json"))
    scene, root = bpy.context.scene, bpy.context.object
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.cycles.device, scene.cycles.samples, scene.cycles.seed = "CPU", 16, 0
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.frame_set(4)
    for colors in ("LINEAR", "DISPLAY"):
        root.clipgstream.colors = colors
        scene.render.filepath = str(folder / f"{colors}.png")
        bpy.ops.render.render(write_still=True)
    return {"camera": scene.camera.name}


if __name__ == "__main__":
    work, folder, addon = sys.argv[1], Path(sys.argv[2]), sys.argv[3]
    bpy.ops.extensions.package_install_files(filepath=addon, repo="user_default", enable_on_install=True)
    (folder / "said.json").write_text(json.dumps({"check": check, "render": render}[work](folder)))
