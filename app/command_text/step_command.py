"""A step of a document as a command, which turns one document into the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from msgspec import structs, to_builtins

from app.command_text.command_text import CommandText
from app.command_text.quoting import can_be_argument, number, option
from app.command_text.time_edit_between import time_edit_between
from app.document.changes import edit_changes
from app.document.project_document import ProjectDocument
from app.document.storing.stored_document import plain_document
from engine.editing.actions import Action
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
    Target,
    VolumeKey,
)
from engine.setting import settings_of
from engine.storage.json_files import json_text


def step_command(
    folder: Path, before: ProjectDocument, after: ProjectDocument, n_frames: int | None = None
) -> CommandText | None:
    """The command that turns a document into another one; None where they are the same.

    Args:
        folder: Of the project.
        n_frames: Of the capture; None where that is not known.
    """
    if before == after:
        return None
    folder = folder.absolute()
    is_only_edits = all(
        getattr(before, name) == getattr(after, name) for name in before.__dataclass_fields__ if name != "edits"
    )
    found = _of_edits(folder, before, after) if is_only_edits else None
    if n_frames is not None and replace(before, timing=after.timing) == after:
        found = _of_time(folder, before, after, n_frames)
    return found if found is not None and _fits(found) else _put(folder, before, after)


def edit_command(folder: Path, edit: Edit) -> CommandText:
    """The command that puts such an edit on top of the stack."""
    arguments, stdin = _edit_arguments(edit)
    values: list[Any] = [edit.action]
    said = [repr(edit.action)]
    if not isinstance(edit.target, Everything):
        said.append(repr(edit.target))
        values.append(edit.target)
    if edit.scope != EVERYWHERE:
        said.append(f"scope={edit.scope!r}")
        values.append(edit.scope)
    if edit.is_inverted:
        said.append("is_inverted=True")
    if edit.name:
        said.append(f"name={edit.name!r}")
    return CommandText(
        ("edit", str(folder), *arguments),
        f"project.apply_edit({', '.join(said)})",
        folder,
        _names(values),
        stdin,
    )


def _of_time(folder: Path, before: ProjectDocument, after: ProjectDocument, n_frames: int) -> CommandText | None:
    """The command for a single change of time; None where it takes more than one."""
    edit = time_edit_between(before.timing, after.timing, n_frames)
    if edit is None:
        return None
    values = {
        name: (one, value)
        for name, one in settings_of(type(edit)).items()
        if (value := getattr(edit, name)) != one.default
    }
    words = [
        word
        for name, (one, value) in values.items()
        for word in ((() if name == "places" else (one.flags[0].name,)) + (one.text(value),))
    ]
    said = "".join(f", {name}={value!r}" for name, (_, value) in values.items())
    return CommandText(("edit", str(folder), edit.verb, *words), f"project.time_edit({edit.verb!r}{said})", folder)


def _of_edits(folder: Path, before: ProjectDocument, after: ProjectDocument) -> CommandText | None:
    """The command for a single edit; None where it takes more than one."""
    old, new = {edit.edit_id: edit for edit in before.edits}, {edit.edit_id: edit for edit in after.edits}
    added, removed = [i for i in new if i not in old], [i for i in old if i not in new]
    if len(added) == 1 and not removed:
        edit = new[added[0]]
        made = edit_changes.add_edit(
            before, edit.action, edit.target, scope=edit.scope, is_inverted=edit.is_inverted, name=edit.name
        )
        return edit_command(folder, edit) if made == after else None
    if len(removed) == 1 and not added:
        made = edit_changes.remove_edit(before, removed[0])
        return _plain(folder, "remove", removed[0], f"project.remove_edit({removed[0]})") if made == after else None
    if added or removed:
        return None
    changed = [edit for edit in after.edits if edit != old[edit.edit_id]]
    if not changed:
        return _moved(folder, before, after)
    if len(changed) != 1 or edit_changes.change_edit(before, changed[0]) != after:
        return None
    return _changed(folder, old[changed[0].edit_id], changed[0])


def _moved(folder: Path, before: ProjectDocument, after: ProjectDocument) -> CommandText | None:
    for position, edit in enumerate(after.edits):
        if edit_changes.move_edit(before, edit.edit_id, position) == after:
            place = ("edit", str(folder), "--move-to", str(edit.edit_id), str(position))
            return CommandText(place, f"project.move_edit({edit.edit_id}, {position})", folder)
    return None


def _changed(folder: Path, old: Edit, new: Edit) -> CommandText | None:
    if structs.replace(old, is_on=new.is_on) == new:
        word = "on" if new.is_on else "off"
        return _plain(folder, word, new.edit_id, f"project.switch_edit({new.edit_id}, is_on={new.is_on})")
    statement = f"project.replace_edit({new!r})"
    names = _names([new, new.action, new.target, new.scope])
    if new.is_on != old.is_on or new.fill != old.fill:  # the options of an edit do not say that
        return None
    arguments, stdin = _edit_arguments(new, in_full=True)
    if structs.replace(old, name=new.name) == new:
        arguments, stdin = option("--name", new.name), ""
    return CommandText(
        ("edit", str(folder), "--replace", str(new.edit_id), *arguments), statement, folder, names, stdin
    )


def _plain(folder: Path, word: str, edit_id: int, statement: str) -> CommandText:
    return CommandText(("edit", str(folder), f"--{word}", str(edit_id)), statement, folder)


def _put(folder: Path, before: ProjectDocument, after: ProjectDocument) -> CommandText:
    """Any step: the entries that differ, in full."""
    old, new = plain_document(before), plain_document(after)
    entries = {name: value for name, value in new.items() if value != old[name]}
    arguments = ("edit", str(folder), "--put", "-")
    return CommandText(arguments, f"project.put({entries!r})", folder, stdin=json_text(entries))


def _fits(command: CommandText) -> bool:
    return all(can_be_argument(argument) for argument in command.arguments)


# ---------------------------------------------------------------- an edit as options


def _edit_arguments(edit: Edit, *, in_full: bool = False) -> tuple[tuple[str, ...], str]:
    """Options of `clipgstream edit`, and its standard input.

    Args:
        in_full: Also write defaults, because the edit may have other values.
    """
    target, stdin = _target_arguments(edit.target, in_full=in_full)
    arguments = [*_action_arguments(edit.action), *target]
    if edit.is_inverted:
        arguments.append("--inverted")
    arguments += _scope_arguments(edit.scope, in_full=in_full)
    if edit.name or in_full:
        arguments += option("--name", edit.name)
    return tuple(arguments), stdin


def _target_arguments(target: Target, *, in_full: bool) -> tuple[tuple[str, ...], str]:
    match target:
        case Everything():
            return (("--everything",) if in_full else ()), ""
        case Box(center=center, half_sizes=half_sizes, quat=quat):
            return ("--turned-box", *_numbers((*center, *half_sizes, *quat))), ""
        case Sphere(center=center, radius=radius):
            return ("--sphere", *_numbers((*center, radius))), ""
        case Picked() | ObjectTarget() | Prism() | KeyedVolume():
            return ("--target", "-"), json_text(to_builtins(target))


def _action_arguments(action: Action) -> list[str]:
    found: list[str] = []
    for flag, settings in action.flags().values():
        if flag.read is None:  # else another flag covers it
            found.append(flag.name)
            for one in settings:
                value = getattr(action, one.name)
                is_text = one.kind in (int, str)
                found += [str(value)] if is_text else _numbers(value if one.kind is tuple else (value,))
    return found


def _scope_arguments(scope: Scope, *, in_full: bool) -> list[str]:
    first, stop = scope.first, scope.stop
    if stop is not None:
        found = ["--frame", str(first)] if stop == first + 1 else ["--frames", f"{first}:{stop}"]
    elif first:
        found = ["--from", str(first)]
    else:
        found = ["--everywhere"] if in_full and not scope.is_reference_only else []
    return [*found, *(["--reference"] if scope.is_reference_only else [])]


def _numbers(values: Sequence[float]) -> tuple[str, ...]:
    return tuple(number(float(value)) for value in values)


def _names(values: Sequence[Any]) -> tuple[str, ...]:
    """Types that a statement names."""
    found = [type(value).__name__ for value in values]
    if any(isinstance(value, Picked) for value in values):
        found.append(PickedRows.__name__)
    for value in values:
        if isinstance(value, KeyedVolume):
            found += [VolumeKey.__name__, type(value.keys[0].volume).__name__]
        if isinstance(value, Edit) and value.fill is not None:
            found += [Fill.__name__, PickedRows.__name__]
    return tuple(found)
