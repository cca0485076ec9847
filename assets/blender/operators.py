# SPDX-License-Identifier: MIT
"""What users do with sequences: import one, relink it, look through its cameras."""

from pathlib import Path
from typing import ClassVar

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from . import cameras, linking, playback
from .problem import SequenceProblem
from .sidecar import SUFFIX, read_sequence


def root_of(context: bpy.types.Context) -> bpy.types.Object | None:
    """The empty of the sequence that the active object belongs to."""
    active = context.object
    for one in (active, active.parent if active is not None else None):
        if one is not None and one.clipgstream.path:
            return one
    return None


class ImportSequence(bpy.types.Operator, ImportHelper):
    """Open moving Gaussians that ClipGStream Studio exported"""

    bl_idname = "import_scene.clipgstream"
    bl_label = "Import ClipGStream sequence"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}
    filename_ext = ".json"
    filter_glob: StringProperty(default=f"*{SUFFIX}", options={"HIDDEN"})
    is_setting_scene: BoolProperty(
        name="Set up scene",
        description="Give the scene range, frame rate, colours and first camera of the sequence",
        default=True,
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Import; a problem is reported and leaves nothing behind."""
        scene, path = context.scene, Path(self.filepath)
        try:
            sequence = read_sequence(path)
            root = linking.make(scene, sequence)
        except SequenceProblem as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        root.clipgstream.start = sequence.first_frame if self.is_setting_scene else scene.frame_start
        root.clipgstream.path = str(path)  # makes the objects and shows the present frame
        if root.clipgstream.problem:
            self.report({"ERROR"}, root.clipgstream.problem)
            linking.remove(root)
            return {"CANCELLED"}
        if self.is_setting_scene:
            linking.set_scene(scene, root, sequence)
        for one in context.selected_objects:
            one.select_set(False)
        root.select_set(True)
        context.view_layer.objects.active = root
        return {"FINISHED"}


class _OnSequence:
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where an object of a sequence is active."""
        return root_of(context) is not None


class ReloadSequence(_OnSequence, bpy.types.Operator):
    """Read the sequence again, with its timing and cameras"""

    bl_idname = "clipgstream.reload"
    bl_label = "Reload"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Reload; where that fails, what is shown stays."""
        root = root_of(context)
        try:
            playback.relink(root, context.scene)
        except SequenceProblem as problem:
            root.clipgstream.problem = str(problem)
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        return {"FINISHED"}


class RelinkSequence(_OnSequence, bpy.types.Operator, ImportHelper):
    """Show another export of the sequence, or the same one where it lies now"""

    bl_idname = "clipgstream.relink"
    bl_label = "Relink"
    filename_ext = ".json"
    filter_glob: StringProperty(default=f"*{SUFFIX}", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Relink; where the file cannot be used, everything stays."""
        root = root_of(context)
        try:
            read_sequence(Path(self.filepath))
        except SequenceProblem as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        root.clipgstream.path = self.filepath
        if root.clipgstream.problem:
            self.report({"ERROR"}, root.clipgstream.problem)
        return {"FINISHED"}


class LookThroughCamera(bpy.types.Operator):
    """Render through this camera, in the size of its captured picture"""

    bl_idname = "clipgstream.look_through"
    bl_label = "Render through this camera"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only for cameras of a sequence."""
        return context.object is not None and context.object.type == "CAMERA" and cameras.SIZE in context.object.data

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make it the camera of the scene."""
        cameras.look_through(context.scene, context.object)
        return {"FINISHED"}


_CLASSES = (ImportSequence, ReloadSequence, RelinkSequence, LookThroughCamera)


def _draw_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    menu.layout.operator(ImportSequence.bl_idname, text=f"ClipGStream sequence ({SUFFIX.removeprefix('_')})")


def register() -> None:
    """Add the operators, and the entry of File > Import."""
    for one in _CLASSES:
        bpy.utils.register_class(one)
    bpy.types.TOPBAR_MT_file_import.append(_draw_menu)


def unregister() -> None:
    """Undo `register`."""
    bpy.types.TOPBAR_MT_file_import.remove(_draw_menu)
    for one in reversed(_CLASSES):
        bpy.utils.unregister_class(one)
