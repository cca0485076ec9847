"""Edits in words: target, effect and frames."""

from __future__ import annotations

from collections.abc import Sequence

from engine.capture.clip import Clip
from engine.editing.actions import Action
from engine.editing.edit import Box, Edit, Everything, KeyedVolume, ObjectTarget, Picked, Prism, Scope, Sphere, Target
from engine.editing.picks import n_rows
from engine.editing.scene_object import NO_OBJECTS, Objects, object_of
from engine.text import one_line


def target_text(target: Target, objects: Objects = NO_OBJECTS, *, is_inverted: bool = False) -> str:
    """The target of an edit: "1,240 Gaussians of clip 2", "box 0.8 x 0.5 x 1.2". objects: Of the document."""
    text = _shape_text(target, objects)
    return f"all but {text}" if is_inverted else text


def scope_text(scope: Scope, clips: Sequence[Clip] = ()) -> str:
    """In which frames an edit holds: "frame 12", "frames 10-19 (clip 1)", "from 20 on", "everywhere".

    Args:
        clips: Of the project, so that frames that are a clip's are called so.
    """
    text = _frames_text(scope, clips)
    if not scope.is_reference_only:
        return text
    return "the reference" if text == "everywhere" else f"the reference, {text}"


def edit_title(edit: Edit, objects: Objects = NO_OBJECTS) -> str:
    """The user's name for an edit, else its effect and target. objects: Of the document."""
    return edit.name or what_text(edit.action, edit.target, objects, is_inverted=edit.is_inverted)


def what_text(action: Action, target: Target, objects: Objects = NO_OBJECTS, *, is_inverted: bool = False) -> str:
    """Effect and target, as they can follow "Undo": "delete 1,240 Gaussians of clip 2", "crop to box 1 x 1 x 1"."""
    if is_inverted and action.opposite:
        is_of_gaussians = isinstance(target, Picked | ObjectTarget)
        return f"{action.opposite if is_of_gaussians else 'crop to'} {target_text(target, objects)}"
    before, after = action.words
    return f"{before} {target_text(target, objects, is_inverted=is_inverted)} {after}".rstrip()


def n_picked(picked: Picked) -> int:
    """How many Gaussians were picked."""
    return sum(n_rows(rows.rows) for rows in picked.sets)


# ---------------------------------------------------------------- pieces


def _shape_text(target: Target, objects: Objects) -> str:
    match target:
        case Everything():
            return "everything"
        case Box(half_sizes=half_sizes):
            return "box " + " × ".join(f"{2 * half:.3g}" for half in half_sizes)
        case Sphere(radius=radius):
            return f"sphere of radius {radius:.3g}"
        case Prism(half_sizes=half_sizes):
            return "prism " + " × ".join(f"{2 * half:.3g}" for half in half_sizes)
        case KeyedVolume(keys=keys):
            return f"{_shape_text(keys[0].volume, objects)} with {len(keys)} key{'' if len(keys) == 1 else 's'}"
        case ObjectTarget():
            found = object_of(target, objects)
            return f"object {target.object_id}, which was removed" if found is None else one_line(found.name)
        case Picked(sets=sets):
            clips = sorted({rows.clip_index for rows in sets})
            of_clips = f"clip {clips[0]}" if len(clips) == 1 else f"{len(clips)} clips"
            n = n_picked(target)
            return f"{n:,} Gaussian{'' if n == 1 else 's'}" + (f" of {of_clips}" if clips else "")


def _frames_text(scope: Scope, clips: Sequence[Clip]) -> str:
    first, stop = scope.first, scope.stop
    if stop is None:
        return f"from {first} on" if first else "everywhere"
    if stop == first + 1:
        return f"frame {first}"
    of_clip = next((clip for clip in clips if (clip.start, clip.stop) == (first, stop)), None)
    return f"frames {first}-{stop - 1}" + (f" (clip {of_clip.clip_index})" if of_clip is not None else "")
