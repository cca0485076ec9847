"""The same as functions, which take an open project or the folder of one that is opened just for them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.document.project_document import ProjectDocument
from app.export.export_progress import ExportResult
from app.scripting.scripted_project import ScriptedProject, open_scripted
from engine.editing.actions import Action
from engine.editing.edit import Edit, Target

if TYPE_CHECKING:
    from app.evaluation.headless import ClipOutcome

Source = ScriptedProject | Path | str
"""An open project, or the folder of one."""


def open_project(folder: Path | str, *, read_only: bool = False) -> ScriptedProject:
    """Open a project folder; close it, or use it in a `with` block.

    Args:
        read_only: Only look at it, render and export: then others may write to it at the same time.
    Raises:
        ProjectError: The folder is not a project, is damaged, or another program writes to it.
    """
    return open_scripted(folder, read_only=read_only)


def train_clip(project: Source, clip_index: int, **options: Any) -> ClipOutcome:
    """Train a clip and wait for it; see ScriptedProject.train_clip."""
    with _opened(project) as opened:
        return opened.train_clip(clip_index, **options)


def apply_edit(project: Source, action: Action | str, target: Target | None = None, **options: Any) -> Edit:
    """Put an edit on top of the stack; see ScriptedProject.apply_edit."""
    with _opened(project) as opened:
        return opened.apply_edit(action, target, **options)


def change(project: Source, document: ProjectDocument, name: str) -> None:
    """Replace the document; see ScriptedProject.change."""
    with _opened(project) as opened:
        opened.change(document, name)


def undo(project: Source) -> str:
    """Take back the last step; see ScriptedProject.undo."""
    with _opened(project) as opened:
        return opened.undo()


def redo(project: Source) -> str:
    """Redo the last undone step; see ScriptedProject.redo."""
    with _opened(project) as opened:
        return opened.redo()


def render(project: Source, out: Path | str, **options: Any) -> ExportResult:
    """Write a video or pictures; see ScriptedProject.render."""
    with _opened(project, read_only=True) as opened:
        return opened.render(out, **options)


def export(project: Source, out: Path | str, **options: Any) -> ExportResult:
    """Write files for other programs; see ScriptedProject.export."""
    with _opened(project, read_only=True) as opened:
        return opened.export(out, **options)


@contextmanager
def _opened(project: Source, *, read_only: bool = False) -> Iterator[ScriptedProject]:
    if isinstance(project, ScriptedProject):
        yield project
        return
    with open_scripted(project, read_only=read_only) as opened:
        yield opened
