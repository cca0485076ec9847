"""fill_behind: what was behind something that an edit of a project takes away. Slow; for a thread or a command."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from engine.editing.edit import Edit
from engine.editing.effects import EditStack
from engine.editing.selection.seen_from import SeenFrom
from engine.errors import ProjectError

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject
    from engine.camera.rig import CameraRig
    from engine.filling.finding import FillFigures

MAX_VIEWS = 16
"""Training cameras that are looked through, spread over all of them."""
MAX_SIDE_PX = 320
"""Width and height of the pictures that are looked at."""


def fill_behind(
    opened: TrainedProject,
    stack: EditStack,
    edit_id: int,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Edit, FillFigures]:
    """An edit with its fill, and figures of it; changes nothing.

    Args:
        opened: Its finished clips.
        stack: The edits of its document.
        edit_id: Of the edit to fill.
        report: Told how many steps of how many are done; what it raises ends the work.
    Raises:
        ProjectError: There is no such edit, it takes nothing away, or a clip is damaged.
    """
    from msgspec.structs import replace

    from engine.filling.finding import FilledClip, find_fill

    edit = next((one for one in stack.edits if one.edit_id == edit_id), None)
    if edit is None:
        raise ProjectError(f"There is no edit {edit_id}.")
    spacing, near = 1.0, 0.01
    if opened.trained:
        base = opened.load(opened.trained[0]).base.header
        spacing, near = base.spacing, base.near_plane
    clips = [
        FilledClip(opened.clips[index], lambda index=index: opened.edited(opened.load(index)), spacing)
        for index in opened.trained
    ]
    views = views_of(opened.rig, set(opened.project.settings.holdout), near=near)
    fill, figures = find_fill(
        edit, stack, clips, views, up=np.asarray(opened.up, np.float64), backend=opened.backend, report=report
    )
    return replace(edit, fill=fill), figures


def views_of(rig: CameraRig, held_out: set[str], *, near: float) -> list[SeenFrom]:
    """Some of the training cameras, in pictures of at most MAX_SIDE_PX."""
    training = [row for row, name in enumerate(rig.names) if name not in held_out] or list(range(len(rig.names)))
    chosen = np.unique(np.linspace(0, len(training) - 1, min(MAX_VIEWS, len(training))).round().astype(int))
    found = []
    for row in (training[place] for place in chosen):
        size = np.array([int(side) for side in rig.image_sizes[row]])
        small = np.maximum((size * min(MAX_SIDE_PX / size.max(), 1.0)).round().astype(int), 1)
        K = rig.Ks[row].astype(np.float64)
        K[:2] *= (small / size)[:, None]
        found.append(SeenFrom(rig.world_to_camera[row].astype(np.float64), K, int(small[0]), int(small[1]), near))
    return found
