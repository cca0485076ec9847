"""Scripts: everything that the window does to a project, for programs. See docs/scripting.md.

    from app.scripting import Sphere, open_project

    with open_project("my-project") as project:
        project.train_clip(0, on_progress=lambda status: print(status.stage, status.progress))
        project.apply_edit("delete", Sphere((0.4, 0.1, 2.0), 0.3), scope=Scope(first=12, stop=40))
        project.render("turn.mp4", turntable=Turntable())
        project.export("frames", format="spz")

What cannot be done raises an EngineError that says why; nothing is half done. A script that trains needs the usual
`if __name__ == "__main__":`, because trainings run in processes of their own.
"""

from app.document.project_document import ProjectDocument
from app.export.jobs.video import Turntable
from app.export.picked_frames import PickedFrames
from app.scripting.functions import apply_edit, change, export, open_project, redo, render, train_clip, undo
from app.scripting.scripted_project import ScriptedProject
from engine.editing import actions
from engine.editing.actions import *  # noqa: F403 - every action
from engine.editing.edit import (
    EVERYWHERE,
    Box,
    Edit,
    Everything,
    Fill,
    KeyedVolume,
    ObjectTarget,
    Picked,
    PickedRows,
    Prism,
    Scope,
    Sphere,
    VolumeKey,
)
from engine.errors import CaptureError, DiskError, EngineError, PreparationError, ProjectError, TrainingError

__all__ = [
    "EVERYWHERE",
    "Box",
    "CaptureError",
    "DiskError",
    "Edit",
    "EngineError",
    "Everything",
    "Fill",
    "KeyedVolume",
    "ObjectTarget",
    "Picked",
    "PickedFrames",
    "PickedRows",
    "PreparationError",
    "Prism",
    "ProjectDocument",
    "ProjectError",
    "Scope",
    "ScriptedProject",
    "Sphere",
    "TrainingError",
    "Turntable",
    "VolumeKey",
    "apply_edit",
    "change",
    "export",
    "open_project",
    "redo",
    "render",
    "train_clip",
    "undo",
]
__all__ += actions.__all__
