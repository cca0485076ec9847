# SPDX-License-Identifier: MIT
"""Settings of a sequence, kept with the empty that all its objects hang on."""

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import playback


def _show(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    playback.show_again(settings.id_data, context.scene)


def _recolor(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    context.scene.view_settings.view_transform = "Standard" if settings.colors == "LINEAR" else "Raw"
    _show(settings, context)


def _relink(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    playback.relink_or_note(settings.id_data, context.scene)


class SequenceSettings(bpy.types.PropertyGroup):
    """See the descriptions of the fields. `problem` is why nothing new is shown; empty where all is well."""

    path: StringProperty(
        name="File", description="NAME_export.json of the exported sequence", subtype="FILE_PATH", update=_relink
    )
    start: FloatProperty(name="Start", description="Frame of the scene at which the sequence begins", update=_show)
    speed: FloatProperty(
        name="Speed",
        description="1 is as captured, at any frame rate of the scene; 0.5 is half as fast",
        default=1.0,
        min=0.001,
        max=1000.0,
        update=_show,
    )
    outside: EnumProperty(
        name="Outside",
        description="What is shown before the first frame and after the last one",
        items=(("HOLD", "Hold", "The first or last frame"), ("HIDE", "Hide", "Nothing")),
        update=_show,
    )
    part: EnumProperty(
        name="Part",
        description="What is shown of a sequence that was exported with --part split",
        items=(
            ("ALL", "All", "The whole scene"),
            ("STATIC", "Static", "What stands still"),
            ("MOVING", "Moving", "What moves"),
        ),
        update=_show,
    )
    size: FloatProperty(
        name="Size",
        description="Scales each Gaussian around its centre; 1 is as trained",
        default=1.0,
        min=0.01,
        max=10.0,
        update=_show,
    )
    limit: IntProperty(
        name="Limit",
        description="Shows only so many Gaussians of each part, those that cover most; 0 shows all",
        default=0,
        min=0,
        update=_show,
    )
    colors: EnumProperty(
        name="Colours",
        description="How colours blend where Gaussians are transparent; sets the view transform of the scene",
        items=(
            ("LINEAR", "Scene", "Linear, to go with other objects; view transform Standard"),
            ("DISPLAY", "As trained", "Display-encoded, blended as ClipGStream Studio does; view transform Raw"),
        ),
        update=_recolor,
    )
    problem: StringProperty()


def register() -> None:
    """Add the settings to objects."""
    bpy.utils.register_class(SequenceSettings)
    bpy.types.Object.clipgstream = PointerProperty(type=SequenceSettings)


def unregister() -> None:
    """Undo `register`."""
    del bpy.types.Object.clipgstream
    bpy.utils.unregister_class(SequenceSettings)
