# SPDX-License-Identifier: MIT
"""Shows the files of the present frame, whenever the frame, a setting or a file changes."""

from dataclasses import dataclass, field
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from . import cameras, linking, look, points
from .clouds import CloudCache, Stamp, stamp_of
from .problem import SequenceProblem
from .sidecar import Sequence, read_sequence

_LOOK_EVERY_S = 2.0
_LINKED = "clipgstream_linked"
"""Property of an empty: the stamp of the description that its objects and cameras come from."""
_EPSILON = 1e-4


@dataclass
class _Shown:
    """What an empty shows: the sequence as of the stamp of its description, and by mesh what it was filled with."""

    path: Path
    stamp: Stamp
    sequence: Sequence
    filled: dict[int, tuple] = field(default_factory=dict)


_clouds = CloudCache()
_shown: dict[int, _Shown] = {}
"""By the session identifier of the empty."""


def roots(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The empties of all sequences of a scene."""
    return [one for one in scene.objects if one.type == "EMPTY" and one.clipgstream.path]


def path_of(root: bpy.types.Object) -> Path:
    """Where the description of its sequence is."""
    return Path(bpy.path.abspath(root.clipgstream.path, library=root.library))


def sequence_of(root: bpy.types.Object) -> Sequence:
    """Its sequence, read again where the file has changed. Raises SequenceProblem."""
    path = path_of(root)
    stamp = stamp_of(path)
    kept = _shown.get(root.session_uid)
    if kept is None or (kept.path, kept.stamp) != (path, stamp):
        kept = _shown[root.session_uid] = _Shown(path, stamp, read_sequence(path))
    return kept.sequence


def relink(root: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Read the sequence, make objects and cameras its own, and show the present frame. Raises SequenceProblem."""
    linking.link(root, sequence_of(root))
    root[_LINKED] = _text(_shown[root.session_uid].stamp)
    show(root, scene)
    root.clipgstream.problem = ""


def show(root: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Fill the meshes with the files of the present frame. Raises SequenceProblem."""
    settings, sequence = root.clipgstream, sequence_of(root)
    filled = _shown[root.session_uid].filled
    scene_fps = scene.render.fps / scene.render.fps_base
    seconds = (scene.frame_current + scene.frame_subframe - settings.start) / scene_fps
    frame = sequence.first_frame + seconds * settings.speed * sequence.fps + _EPSILON
    is_outside = not sequence.first_frame <= frame < sequence.last_frame + 1
    pixel = cameras.pixel_width(scene)
    for part, mesh_object in linking.objects_of(root).items():
        is_hidden = (is_outside and settings.outside == "HIDE") or (
            part != "all" and settings.part not in ("ALL", part.upper())
        )
        if mesh_object.hide_render != is_hidden:
            mesh_object.hide_render = mesh_object.hide_viewport = is_hidden
        if is_hidden or part not in sequence.files:
            continue
        look.set_pixel(mesh_object, pixel)
        path = sequence.file_at(part, min(max(frame, sequence.first_frame), sequence.last_frame + _EPSILON))
        stamp = stamp_of(path)
        wanted = (path, stamp, settings.size, settings.limit, settings.colors)
        if filled.get(mesh_object.data.session_uid) != wanted:
            cloud = _clouds.read(path, stamp).largest(settings.limit)
            points.fill(mesh_object.data, cloud, size=settings.size, is_linear=settings.colors == "LINEAR")
            filled[mesh_object.data.session_uid] = wanted


def show_again(root: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """As `show`; a problem is noted in the settings instead of raised."""
    if not root.clipgstream.path:
        return
    try:
        show(root, scene)
        said = ""
    except SequenceProblem as problem:
        said = str(problem)
    _note(root, said)


def relink_or_note(root: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """As `relink`; a problem is noted in the settings instead of raised."""
    if not (root.clipgstream.path and root.users_collection):
        return
    try:
        relink(root, scene)
    except SequenceProblem as problem:
        _note(root, str(problem))


def _note(root: bpy.types.Object, said: str) -> None:
    if root.clipgstream.problem != said:
        root.clipgstream.problem = said
        if said:
            print(f"ClipGStream, {root.name}: {said}")


@persistent
def _on_frame(scene: bpy.types.Scene, *_: object) -> None:
    for root in roots(scene):
        show_again(root, scene)


@persistent
def _on_load(*_: object) -> None:
    """Meshes may hold something else than they were filled with."""
    _shown.clear()
    _look_for_changes()
    for scene in bpy.data.scenes:
        _on_frame(scene)


def _look_for_changes() -> float:
    """Relink what was exported again. Cameras that were not are left alone: the user may have changed them."""
    for scene in bpy.data.scenes:
        for root in roots(scene):
            try:
                if root.get(_LINKED) != _text(stamp_of(path_of(root))):
                    relink(root, scene)
            except SequenceProblem as problem:
                _note(root, str(problem))
    return _LOOK_EVERY_S


def _text(stamp: Stamp) -> str:
    return " ".join(map(str, stamp))


_HANDLERS = (
    ("frame_change_pre", _on_frame),
    ("load_post", _on_load),
    ("undo_post", _on_load),
    ("redo_post", _on_load),
)


def register() -> None:
    """Follow frames, loaded files, and exports."""
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)
    if not bpy.app.background:
        bpy.app.timers.register(_look_for_changes, first_interval=_LOOK_EVERY_S, persistent=True)


def unregister() -> None:
    """Undo `register`."""
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    if bpy.app.timers.is_registered(_look_for_changes):
        bpy.app.timers.unregister(_look_for_changes)
    _shown.clear()
