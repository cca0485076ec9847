"""Changes to the copies of a document: functions from one document to another, shared by the window, the command line
and scripts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np
from msgspec import ValidationError, structs, to_builtins

from app.document.checked_text import checked_text
from app.document.project_document import ProjectDocument
from engine.camera.rotations import quats_of_turns, turns_of_quats
from engine.editing.actions import Transform, Vector
from engine.editing.copies.object_copy import MAX_COPIES, ObjectCopy, OnObject, OnPath
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError, to_type
from engine.text import shown


def copy_with(document: ProjectDocument, copy_id: int) -> ObjectCopy:
    """The copy of that number.

    Raises:
        ProjectError: There is none.
    """
    found = next((copy for copy in document.copies if copy.copy_id == copy_id), None)
    if found is None:
        known = [str(copy.copy_id) for copy in document.copies]
        more = "..." if len(known) > 12 else ""
        hint = f"Copies are {', '.join(known[:12])}{more}." if known else "The project has no copies."
        raise ProjectError(f"There is no copy {copy_id}.", hint=hint)
    return found


def add_copies(document: ProjectDocument, copies: Iterable[ObjectCopy]) -> ProjectDocument:
    """Add copies as the last ones, with numbers that no others have, whatever numbers they bring; those without a name
    get that of their object and a number.

    Raises:
        ProjectError: A value is out of range, something that is copied or carries a copy is missing, or there are too
            many.
    """
    copies = list(copies)
    if len(document.copies) + len(copies) > MAX_COPIES:
        raise ProjectError(
            f"The project has {len(document.copies)} copies; with {len(copies)} more there are more than {MAX_COPIES}.",
            hint="Make fewer, or remove some first.",
        )
    first = max((copy.copy_id for copy in document.copies), default=0) + 1
    names = {one.object_id: one.name for one in document.objects}
    added = []
    for number, copy in enumerate(copies, first):
        name = copy.name.strip() or f"{names.get(copy.object_id, 'object')} copy {number}"
        added.append(_checked(document, structs.replace(copy, copy_id=number, name=name)))
    return replace(document, copies=(*document.copies, *added))


def change_copy(document: ProjectDocument, copy: ObjectCopy) -> ProjectDocument:
    """Put a copy in the place of the one that has its number.

    Raises:
        ProjectError: There is none, or as `add_copies`.
    """
    old = copy_with(document, copy.copy_id)
    new = _checked(document, copy)
    return replace(document, copies=tuple(new if one is old else one for one in document.copies))


def remove_copies(document: ProjectDocument, copy_ids: Collection[int]) -> ProjectDocument:
    """Remove copies. Raises ProjectError where there is none of a number."""
    for copy_id in copy_ids:
        copy_with(document, copy_id)
    return replace(document, copies=tuple(copy for copy in document.copies if copy.copy_id not in copy_ids))


def switch_copies(document: ProjectDocument, copy_ids: Collection[int], *, is_on: bool) -> ProjectDocument:
    """Let copies count or not. Raises ProjectError where there is none of a number."""
    for copy_id in copy_ids:
        copy_with(document, copy_id)
    switched = (
        structs.replace(copy, is_on=is_on) if copy.copy_id in copy_ids and copy.is_on != is_on else copy
        for copy in document.copies
    )
    return replace(document, copies=tuple(switched))


def stepped(copy: ObjectCopy, n: int, group: str = "") -> list[ObjectCopy]:
    """Copies one after another, each farther by the step of the first one: in place, rotation, size and time.

    Args:
        copy: The first one.
        n: How many.
        group: Their name together.
    Raises:
        ProjectError: A value gets out of range.
    """
    if not 1 <= n <= MAX_COPIES:
        raise ProjectError(f"{n} copies cannot be made.", hint=f"Make 1 to {MAX_COPIES}.")
    turn = turns_of_quats(_unit(copy.transform.quat))
    found = []
    for k in range(1, n + 1):
        step = {
            "translation": tuple(k * value for value in copy.transform.translation),
            "quat": tuple(map(float, quats_of_turns(k * turn))) if k > 1 else copy.transform.quat,
            "scale": copy.transform.scale**k,
        }
        found.append(_with(copy, step, shift_frames=k * copy.shift_frames, group=group if n > 1 else copy.group))
    return found


def crowd(
    copy: ObjectCopy, n_across: int, n_along: int, across: Vector, along: Vector, shift_frames: float, group: str
) -> list[ObjectCopy]:
    """Copies in rows, with the object itself at the corner.

    Args:
        copy: What all of them share.
        n_across, n_along: How many stand in each direction, the object counted.
        across, along: From one to the next, scene units.
        shift_frames: So much later is each than the one before.
        group: Their name together.
    Raises:
        ProjectError: There are none, or a value gets out of range.
    """
    if n_across < 1 or n_along < 1 or not 2 <= n_across * n_along <= MAX_COPIES + 1:
        raise ProjectError(
            f"A crowd of {n_across} x {n_along} cannot be made.", hint=f"It has 1 to {MAX_COPIES} copies."
        )
    found = []
    for number in range(1, n_across * n_along):
        i, j = number % n_across, number // n_across
        step = zip(copy.transform.translation, across, along, strict=True)
        place = {"translation": tuple(own + i * a + j * b for own, a, b in step)}
        found.append(_with(copy, place, shift_frames=copy.shift_frames + number * shift_frames, group=group))
    return found


def group_name(document: ProjectDocument, name: str) -> str:
    """A name for copies that are made together, which no other group has. name: Of what is copied."""
    taken = {copy.group for copy in document.copies}
    numbered = (f"{name} group {number}" for number in range(1, len(taken) + 2))
    return next(one for one in numbered if one not in taken)


# ---------------------------------------------------------------- pieces


def _unit(quat: tuple[float, ...]) -> np.ndarray:
    values = np.asarray(quat, np.float64)
    return values / np.linalg.norm(values)


def _with(copy: ObjectCopy, moved: Mapping[str, object], **values: object) -> ObjectCopy:
    """A copy with other values, read anew so that they are checked."""
    try:
        transform = to_type(to_builtins(copy.transform) | moved, Transform)
        return structs.replace(copy, transform=transform, **values)
    except (EntryError, ValidationError, ValueError, OverflowError) as error:
        raise ProjectError(f"The copy is not valid ({error}).") from error


def _checked(document: ProjectDocument, copy: ObjectCopy) -> ObjectCopy:
    """The copy as it will be read again; values that a file cannot hold are refused now."""
    for text in (copy.name, copy.group):
        checked_text(text)
    try:
        to_type(to_builtins(copy), ObjectCopy)
    except (EntryError, ValueError) as error:
        raise ProjectError(f"The copy is not valid ({error}).") from error
    known = {one.object_id for one in document.objects}
    if copy.object_id not in known:
        raise ProjectError(f"There is no object {copy.object_id} to copy.", hint="Choose one of the project's objects.")
    match copy.carried_by:
        case OnObject(object_id=object_id) if object_id not in known or object_id == copy.object_id:
            why = "itself" if object_id == copy.object_id else f"object {object_id}, which does not exist"
            raise ProjectError(f"A copy cannot be carried by {why}.", hint="Choose another object.")
        case OnPath(name=name) if name not in {path.name for path in document.camera_paths}:
            raise ProjectError(f"There is no camera path called {shown(name)} to carry a copy.")
        case _:
            return copy
