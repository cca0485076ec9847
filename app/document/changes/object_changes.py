"""Changes to the objects of a document: functions from one document to another, shared by the window, the command line
and scripts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from msgspec import structs, to_builtins

from app.document.changes.exclusion_changes import MAX_POINTS
from app.document.checked_text import checked_text
from app.document.project_document import ProjectDocument
from app.document.storing.stored_document import check_objects
from engine.capture.exclusions import PaintedMask
from engine.editing.actions import Vector
from engine.editing.edit import ObjectTarget, PickedRows
from engine.editing.picks import pack_rows, unpack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError, to_type
from engine.text import one_line, shown

MAX_OBJECTS = 200
PALETTE: tuple[Vector, ...] = (
    (0.902, 0.624, 0.0),
    (0.337, 0.706, 0.914),
    (0.0, 0.62, 0.451),
    (0.8, 0.475, 0.655),
    (0.941, 0.894, 0.259),
    (0.835, 0.369, 0.0),
    (0.0, 0.447, 0.698),
)
"""Okabe and Ito's colours, which people with any colour vision can distinguish."""
Frames = tuple[int, int]
"""The first frame, and the one after the last."""


def object_with(document: ProjectDocument, object_id: int) -> SceneObject:
    """The object of that number.

    Raises:
        ProjectError: There is none; names those that there are.
    """
    found = next((one for one in document.objects if one.object_id == object_id), None)
    if found is None:
        raise ProjectError(f"There is no object {object_id}.", hint=_known(document))
    return found


def object_named(document: ProjectDocument, name: str) -> SceneObject:
    """The object of that name, in capitals or not, or else of that number.

    Raises:
        ProjectError: There is none; names those that there are.
    """
    wanted = name.strip()
    for one in document.objects:
        if one.name.casefold() == wanted.casefold():
            return one
    for one in document.objects:
        if str(one.object_id) == wanted:
            return one
    raise ProjectError(f"There is no object called {shown(wanted)}.", hint=_known(document))


def add_object(
    document: ProjectDocument,
    seed: ObjectSeed,
    *,
    name: str = "",
    color: Vector | None = None,
    within: Frames | None = None,
) -> ProjectDocument:
    """Make an object of what somebody has selected; it is the last one of the document.

    Args:
        name: An empty one is replaced by the first free "object N".
        color: None for the first one of the palette that no other object has.
        within: Frames of the clip in which the seed was selected: there the object is the selection until it is
            searched. None where that is not wanted.
    Raises:
        ProjectError: The name is taken or too long, the seed holds nothing, or there are too many objects.
    """
    if len(document.objects) >= MAX_OBJECTS:
        raise ProjectError(f"The project has {MAX_OBJECTS} objects, which is the limit.", hint="Remove some.")
    _check_seed(seed, "added")
    object_id = max((one.object_id for one in document.objects), default=0) + 1
    # a number that a removed object had is not used again while edits or steps of the history may mean that
    used = [edit.target.object_id for edit in document.edits if isinstance(edit.target, ObjectTarget)]
    object_id = max([object_id, *(number + 1 for number in used)])
    _check_free(document, name.strip(), None)
    made = SceneObject(object_id, name.strip() or _free_name(document), color or _free_color(document), (seed,))
    return _with(document, (*document.objects, _checked(_shown_at_once(made, seed, within))))


def correct_object(
    document: ProjectDocument, object_id: int, seed: ObjectSeed, *, within: Frames | None = None
) -> ProjectDocument:
    """Add a correction to an object; corrections add up in their order. All clips have to be searched again; until
    then the object stays where it was found.

    Args:
        within: Frames of the clip in which the seed was selected, which shows the correction at once.
    Raises:
        ProjectError: There is no such object, or the seed holds nothing.
    """
    _check_seed(seed, "added", "removed")
    one = object_with(document, object_id)
    clips = tuple(structs.replace(clip, origin="") for clip in one.clips)
    other = structs.replace(one, seeds=(*one.seeds, seed), clips=clips)
    return _replaced(document, _shown_at_once(other, seed, within))


def with_found(document: ProjectDocument, object_id: int, clips: Iterable[ObjectInClip]) -> ProjectDocument:
    """Say where an object is; replaces what was known. Raises ProjectError where there is no such object."""
    return _replaced(document, structs.replace(object_with(document, object_id), clips=tuple(clips)))


def rename_object(document: ProjectDocument, object_id: int, name: str) -> ProjectDocument:
    """Give an object another name.

    Raises:
        ProjectError: There is no such object, or the name is empty, too long or taken.
    """
    if not name.strip():
        raise ProjectError("An object needs a name.")
    one = object_with(document, object_id)
    _check_free(document, name.strip(), object_id)
    return _replaced(document, structs.replace(one, name=name.strip()))


def recolour_object(document: ProjectDocument, object_id: int, color: Vector) -> ProjectDocument:
    """Give an object another colour, RGB in 0..1.

    Raises:
        ProjectError: There is no such object, or the colour is out of range.
    """
    if not all(0.0 <= part <= 1.0 for part in color):
        raise ProjectError(f"The colour {color} is not valid: red, green and blue are 0 to 1.")
    return _replaced(document, structs.replace(object_with(document, object_id), color=color))


def set_span(document: ProjectDocument, object_id: int, first: int, stop: int | None) -> ProjectDocument:
    """Let an object exist in some frames only.

    Args:
        first: The first of them.
        stop: One after the last; None for all that follow.
    Raises:
        ProjectError: There is no such object, or no such frames.
    """
    one = object_with(document, object_id)
    try:
        return _replaced(document, structs.replace(one, first=first, stop=stop))
    except ValueError as error:
        raise ProjectError(f"The frames are not valid ({error}).") from error


def set_trained(
    document: ProjectDocument, object_id: int, *, is_trained: bool, masks: tuple[PaintedMask, ...] = ()
) -> ProjectDocument:
    """Say whether clips that are trained from now on see an object.

    Args:
        masks: What they do not see then, instead of earlier masks of this object; none where they see it.
    Raises:
        ProjectError: There is no such object, or the masks are too large.
    """
    others = _without_masks(document, object_id).exclusions.masks
    n_points = sum(len(stroke.points) for mask in (*others, *masks) for stroke in mask.strokes)
    if n_points > MAX_POINTS:
        raise ProjectError(
            f"The masks have {n_points:,} points, more than the {MAX_POINTS:,} that a project can hold.",
            hint="Let the object exist in fewer frames.",
        )
    changed = replace(document, exclusions=structs.replace(document.exclusions, masks=(*others, *masks)))
    return _replaced(changed, structs.replace(object_with(document, object_id), is_trained=is_trained))


def remove_object(document: ProjectDocument, object_id: int) -> tuple[ProjectDocument, int]:
    """Remove an object, the edits that act on it, and what is left out of training because of it.

    Returns:
        The document, and how many edits went.
    Raises:
        ProjectError: There is no such object.
    """
    gone = object_with(document, object_id)
    edits = tuple(edit for edit in document.edits if edit.target != ObjectTarget(object_id))
    objects = tuple(one for one in document.objects if one is not gone)
    left = _without_masks(document, object_id)
    return replace(left, objects=objects, edits=edits), len(document.edits) - len(edits)


# ---------------------------------------------------------------- pieces


def _with(document: ProjectDocument, objects: tuple[SceneObject, ...]) -> ProjectDocument:
    check_objects(objects)
    return replace(document, objects=objects)


def _without_masks(document: ProjectDocument, object_id: int) -> ProjectDocument:
    masks = tuple(mask for mask in document.exclusions.masks if mask.object_id != object_id)
    if len(masks) == len(document.exclusions.masks):
        return document
    return replace(document, exclusions=structs.replace(document.exclusions, masks=masks))


def _replaced(document: ProjectDocument, one: SceneObject) -> ProjectDocument:
    checked = _checked(one)
    return _with(document, tuple(checked if it.object_id == one.object_id else it for it in document.objects))


def _checked(one: SceneObject) -> SceneObject:
    """The object as it will be read again; values that a file cannot hold are refused now."""
    checked_text(one.name)
    try:
        to_type(to_builtins(one), SceneObject)
    except (EntryError, ValueError) as error:
        raise ProjectError(f"The object is not valid ({error}).") from error
    return one


def _check_seed(seed: ObjectSeed, *parts: str) -> None:
    if not any(getattr(seed, part) for part in parts):
        raise ProjectError("Nothing is selected.", hint="Select Gaussians of the object first.")


def _shown_at_once(one: SceneObject, seed: ObjectSeed, within: Frames | None) -> SceneObject:
    """The object with a seed put into its clip as it is."""
    if within is None:
        return one
    start, stop = within
    known = next((clip for clip in one.clips if (clip.start, clip.stop) == within), None)
    sets = _corrected(() if known is None else known.sets, seed)
    seen = ((start, stop),) if known is None or not known.seen else known.seen
    clip = ObjectInClip(start, stop, sets, seen if sets else ())
    others = [other for other in one.clips if other.stop <= start or other.start >= stop]
    return structs.replace(one, clips=tuple(sorted([*others, clip], key=lambda clip: clip.start)))


def _corrected(sets: tuple[PickedRows, ...], seed: ObjectSeed) -> tuple[PickedRows, ...]:
    """Picked Gaussians with those that a seed adds, without those that it removes."""
    found: dict[tuple[str, str], PickedRows] = {(part.origin, part.role): part for part in sets}
    for part in seed.added:
        key = part.origin, part.role
        numbers = unpack_rows(part.rows)
        if key in found:
            numbers = np.union1d(unpack_rows(found[key].rows), numbers)
        found[key] = structs.replace(part, rows=pack_rows(numbers))
    for part in seed.removed:
        if (key := (part.origin, part.role)) in found:
            numbers = np.setdiff1d(unpack_rows(found[key].rows), unpack_rows(part.rows))
            found[key] = structs.replace(found[key], rows=pack_rows(numbers))
            if not len(numbers):
                del found[key]
    return tuple(found.values())


def _check_free(document: ProjectDocument, name: str, object_id: int | None) -> None:
    """Check that no object has a name but that of a number."""
    if any(one.name.casefold() == name.casefold() and one.object_id != object_id for one in document.objects):
        raise ProjectError(f"Another object is called {shown(name)}.", hint="Choose another name.")


def _free_name(document: ProjectDocument) -> str:
    taken = {one.name.casefold() for one in document.objects}
    return next(name for n in range(1, MAX_OBJECTS + 2) if (name := f"object {n}") not in taken)


def _free_color(document: ProjectDocument) -> Vector:
    taken = {one.color for one in document.objects}
    free = [color for color in PALETTE if color not in taken]
    return free[0] if free else PALETTE[len(document.objects) % len(PALETTE)]


def _known(document: ProjectDocument) -> str:
    names = [one_line(one.name) for one in document.objects[:20]] + (["..."] if len(document.objects) > 20 else [])
    return f"Objects are {', '.join(names)}." if names else "The project has no objects."
