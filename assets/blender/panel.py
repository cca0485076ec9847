# SPDX-License-Identifier: MIT
"""The panel ClipGStream in the sidebar of the 3D viewport."""

import bpy

from .operators import LookThroughCamera, RelinkSequence, ReloadSequence, root_of


class SequencePanel(bpy.types.Panel):
    """Settings of the sequence that the active object belongs to."""

    bl_idname = "VIEW3D_PT_clipgstream"
    bl_label = "Sequence"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "ClipGStream"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw settings and buttons."""
        layout, root = self.layout, root_of(context)
        layout.use_property_split = True
        if root is None:
            layout.label(text="Import a sequence, or select one of its objects")
            return
        settings = root.clipgstream
        layout.prop(settings, "path")
        row = layout.row(align=True)
        row.operator(ReloadSequence.bl_idname, icon="FILE_REFRESH")
        row.operator(RelinkSequence.bl_idname, icon="LINKED")
        if settings.problem:
            box = layout.box()
            for n, line in enumerate(settings.problem.split(". ")):
                box.label(text=line, icon="NONE" if n else "ERROR")
        for name in ("start", "speed", "outside", "part", "size", "limit", "colors"):
            layout.prop(settings, name)
        if LookThroughCamera.poll(context):
            layout.operator(LookThroughCamera.bl_idname, icon="VIEW_CAMERA")


def register() -> None:
    """Add the panel."""
    bpy.utils.register_class(SequencePanel)


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_class(SequencePanel)
