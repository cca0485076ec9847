"""Selecting without a window: Gaussians of a frame by where they are and by their attributes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from app.playback.frame_decoder import ClipFiles, FrameRequest, decode_frame
from app.session.editing.attributes import ATTRIBUTES
from app.session.editing.finding import Ground, found_by, selection_after
from app.session.editing.selection import NOTHING_SELECTED, Selection
from app.session.editing.selection_commands import How, SelectAll, SelectByAttribute, SelectionCommand, SelectVolume
from engine.backends.table import process_backend
from engine.editing.edit import Picked, Volume
from engine.editing.effects import EditStack
from engine.errors import ProjectError
from engine.text import shown

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject

_CONDITION = re.compile(r"\s*([a-z]+)\s*(<=|>=|<|>|=)\s*([^\s<>=]+)\s*")
_MEASURED = tuple(name for name, attribute in ATTRIBUTES.items() if attribute.column)
"""Attributes that only the window knows."""


def select(
    opened: TrainedProject,
    edits: EditStack,
    frame_index: int,
    *,
    volume: Volume | None = None,
    where: str = "",
    is_inverted: bool = False,
) -> Picked:
    """Pick Gaussians of a frame, as they are once edited; see ScriptedProject.select."""
    clip = next((clip for clip in opened.clips if clip.start <= frame_index < clip.stop), None)
    if clip is None:
        last = opened.clips[-1].stop - 1
        raise ProjectError(f"There is no frame {frame_index}; the capture has frames 0 to {last}.")
    header, project = opened.header(clip.clip_index), opened.project
    request = FrameRequest(
        clip_index=clip.clip_index,
        revision=header.fingerprint,
        frame_index=frame_index,
        path=project.clip_path(clip.clip_index),
        generation=0,
        reference_path=None if header.reference_fingerprint is None else project.reference_path,
        clip=clip,
        effects=edits.at(frame_index),
    )
    loaded = ClipFiles().read(request, process_backend())
    gaussians = decode_frame(loaded, request).gaussians
    if gaussians.rows is None:
        raise ProjectError(f"The Gaussians of clip {clip.clip_index} cannot be identified.", hint="Train it again.")
    wanted: list[SelectionCommand] = [SelectAll()]
    if volume is not None:
        wanted.append(SelectVolume(volume, How("intersect")))
    wanted += conditions(where)
    selection: Selection = NOTHING_SELECTED
    for command in wanted:
        ground = Ground(gaussians, selection.mask(gaussians.rows))
        selection = selection_after(selection, command, ground, found_by(command, ground))
    if is_inverted:
        is_left = ~selection.mask(gaussians.rows)
        selection = selection.with_mask(gaussians.rows, is_left, keeps_others=False)
    if not len(selection):
        raise ProjectError(
            f"Nothing is selected in frame {frame_index}.", hint="Widen the condition, or choose another frame."
        )
    return selection.target()


def conditions(text: str) -> Sequence[SelectByAttribute]:
    """Conditions joined by "and", such as "opacity<0.05 and size>=0.2", as commands that narrow a selection.

    Raises:
        ProjectError: One is not valid, or names something that is not known without a window.
    """
    return [_condition(part) for part in re.split(r"\band\b|,", text)] if text.strip() else []


def _condition(text: str) -> SelectByAttribute:
    known = ", ".join(name for name in ATTRIBUTES if name not in _MEASURED)
    found = _CONDITION.fullmatch(text)
    if found is None:
        raise ProjectError(
            f"The condition {shown(text.strip())} is not valid.", hint=f"Write opacity<0.05; attributes are {known}."
        )
    name, sign, said = found.groups()
    if name not in ATTRIBUTES or name in _MEASURED:
        raise ProjectError(f"There is no attribute {shown(name)} to select by.", hint=f"Attributes are {known}.")
    words = {word.split(" ")[0]: value for value, word in ATTRIBUTES[name].choices}
    try:
        number = float(words.get(said, said))
    except ValueError as error:
        hint = f"Write a number{' or one of ' + ', '.join(words) if words else ''}."
        raise ProjectError(f"{shown(said)} is not a value of {name}.", hint=hint) from error
    if np.isnan(number):
        raise ProjectError(f"{shown(said)} is not a value of {name}.", hint="Write a number.")
    value = np.float32(number)  # as attributes are
    infinite = np.float32(np.inf)
    low, high = {
        "<": (-infinite, np.nextafter(value, -infinite)),
        "<=": (-infinite, value),
        ">": (np.nextafter(value, infinite), infinite),
        ">=": (value, infinite),
        "=": (value, value),
    }[sign]
    return SelectByAttribute(name, float(low), float(high), How("intersect"))
