"""clipgstream edit PROJECT duplicate, crowd and copies: objects shown once more, listed, switched and removed."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args

from msgspec import to_builtins

from app.cli.arguments import PlainParser, add_backend, parse_range
from app.scripting.scripted_project import ScriptedProject, open_scripted
from app.training.service import Launch
from engine.editing.actions import Quat, Transform
from engine.editing.copies.object_copy import ObjectCopy, OnObject, OnPath, Outside
from engine.editing.edit import EVERYWHERE, Scope
from engine.errors import ProjectError
from engine.storage.json_files import json_text
from engine.text import one_line

COPIES_SCHEMA = 1


@dataclass(frozen=True, slots=True)
class CopyVerb:
    """A word after the project.

    Attributes:
        help: What it does.
        add_arguments: Declares its options.
        run: Carries it out.
        changes: Whether it changes the project, with given options.
    """

    help: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, ScriptedProject], None]
    changes: Callable[[argparse.Namespace], bool] = lambda options: True


def add_copy_verbs(command: argparse.ArgumentParser) -> None:
    """Declare the words. command: `clipgstream edit`."""
    assert isinstance(command, PlainParser)
    for name, verb in COPY_VERBS.items():
        description = f"{verb.help[0].upper()}{verb.help[1:]}."
        own = command.verbs[name] = PlainParser(prog=f"{command.prog} PROJECT {name}", description=description)
        verb.add_arguments(own)
        own.add_argument("--json", action="store_true", help="print all copies as JSON")
        add_backend(own)


def run_copy_verb(options: argparse.Namespace, launch: Launch) -> str:
    """Carry out a word. Returns the list of all copies, to be printed."""
    verb = COPY_VERBS[options.verb]
    with open_scripted(options.project, read_only=not verb.changes(options), launch=launch) as project:
        verb.run(options, project)
        found, lines = describe_copies(project), copy_lines(project)
    return json_text(found, indent=1) if options.json else "\n".join(lines)


# ---------------------------------------------------------------- what is made


def _add(command: argparse._ActionsContainer, option: str, **values: Any) -> None:
    """An option whose value is not taken for one of an edit, which may have the same name."""
    command.add_argument(option, dest=f"copy_{option.removeprefix('--').replace('-', '_')}", **values)


def _add_copy_arguments(command: argparse.ArgumentParser) -> None:
    _add(command, "--object", required=True, metavar="NAME", help="the object")
    _add(
        command,
        "--by",
        nargs=3,
        type=float,
        metavar=("X", "Y", "Z"),
        default=(0.0, 0.0, 0.0),
        help="so far off, scene units",
    )
    _add(
        command,
        "--rotate",
        nargs=4,
        type=float,
        metavar=("X", "Y", "Z", "DEG"),
        help="rotated about this axis, in degrees",
    )
    _add(command, "--scale", type=float, default=1.0, metavar="S", help="factor of the size")
    _add(
        command,
        "--pivot",
        nargs=3,
        type=float,
        metavar=("X", "Y", "Z"),
        help="rotate and scale about this (default: the middle of the object)",
    )
    _add(command, "--shift", type=float, default=0.0, metavar="FRAMES", help="so many frames later; negative: earlier")
    _add(command, "--speed", type=float, default=1.0, metavar="S", help="at this speed; negative: backward")
    _add(
        command,
        "--anchor",
        type=float,
        metavar="FRAME",
        help="from this frame at that speed (default: the object's first one)",
    )
    _add(
        command,
        "--outside",
        choices=get_args(Outside),
        default="hold",
        help="when the object does not exist: hold its nearest frame (default), loop, or gone",
    )
    _add(command, "--in-place", action="store_true", help="in the place of the object, which is hidden")
    carried = command.add_mutually_exclusive_group()
    _add(carried, "--attach-path", metavar="NAME", default="", help="carried by the camera of this path")
    _add(carried, "--attach-object", metavar="NAME", default="", help="carried along by this object")
    _add(command, "--frames", metavar="A:B", help="there from frame A to B, B not included (default: always)")
    _add(command, "--name", default="", metavar="NAME", help="a name for the copy")
    _add(command, "--group", default="", metavar="NAME", help="a name for copies that belong together")


def _add_duplicate(command: argparse.ArgumentParser) -> None:
    _add_copy_arguments(command)
    _add(command, "--times", type=int, default=1, metavar="N", help="N copies, each farther by the same step")


def _add_crowd(command: argparse.ArgumentParser) -> None:
    _add_copy_arguments(command)
    _add(command, "--size", nargs=2, type=int, required=True, metavar=("ROWS", "COLUMNS"), help="how many stand")
    for name, default, words in (("across", (1.0, 0.0, 0.0), "in a row"), ("along", (0.0, 0.0, 1.0), "of rows")):
        _add(
            command,
            f"--{name}",
            nargs=3,
            type=float,
            default=default,
            metavar=("X", "Y", "Z"),
            help=f"from one to the next {words}, scene units",
        )
    _add(command, "--step", type=float, default=0.0, metavar="FRAMES", help="each so much later than the last")


def _values(options: argparse.Namespace, project: ScriptedProject) -> dict[str, Any]:
    """Arguments of ScriptedProject.object_copy."""
    for option in ("by", "scale", "shift", "speed"):
        numbers = getattr(options, f"copy_{option}")
        if not all(abs(number) <= 1e12 for number in (numbers if isinstance(numbers, list | tuple) else [numbers])):
            raise ProjectError(f"--{option} has a number that is not finite or too large.")
    quat = (1.0, 0.0, 0.0, 0.0)
    if options.copy_rotate is not None:
        quat = _rotation(options.copy_rotate)
    return {
        "by": tuple(options.copy_by),
        "quat": quat,
        "scale": options.copy_scale,
        "pivot": None if options.copy_pivot is None else tuple(options.copy_pivot),
        "shift_frames": options.copy_shift,
        "speed": options.copy_speed,
        "anchor_frame": options.copy_anchor,
        "outside": options.copy_outside,
        "is_in_place": options.copy_in_place,
        "on_path": options.copy_attach_path,
        "on_object": options.copy_attach_object,
        "scope": _scope(options, project),
        "copy_name": options.copy_name,
        "group": options.copy_group,
    }


def _rotation(numbers: list[float]) -> Quat:
    flag, _ = Transform.flags()["--rotate"]
    assert flag.read is not None
    try:
        return flag.read(tuple(numbers))
    except ValueError as error:
        raise ProjectError(f"--rotate is not valid ({error}).") from error


def _scope(options: argparse.Namespace, project: ScriptedProject) -> Scope:
    if options.copy_frames is None:
        return EVERYWHERE
    frames = parse_range(options.copy_frames, project.n_frames, option="--frames", what="frames")
    return Scope(frames.start, frames.stop)


def _duplicate(options: argparse.Namespace, project: ScriptedProject) -> None:
    project.duplicate_object(options.copy_object, n_times=options.copy_times, **_values(options, project))


def _crowd(options: argparse.Namespace, project: ScriptedProject) -> None:
    rows, columns = options.copy_size
    across, along = tuple(options.copy_across), tuple(options.copy_along)
    values = _values(options, project)
    project.make_crowd(
        options.copy_object, columns, rows, across=across, along=along, step_frames=options.copy_step, **values
    )


# ---------------------------------------------------------------- what there is


def _add_copies(command: argparse.ArgumentParser) -> None:
    one = command.add_mutually_exclusive_group()
    for name, words in (("on", "switch on"), ("off", "switch off"), ("remove", "remove")):
        _add(one, f"--{name}", metavar="WHICH", help=f"{words} a copy or a group: its name or number")


def _change_copies(options: argparse.Namespace, project: ScriptedProject) -> None:
    def chosen(which: str) -> str | tuple[int, ...]:
        return (int(which),) if which.isdecimal() and len(which) < 10 else which

    if options.copy_remove is not None:
        project.remove_copies(chosen(options.copy_remove))
    elif options.copy_on is not None:
        project.switch_copies(chosen(options.copy_on), is_on=True)
    elif options.copy_off is not None:
        project.switch_copies(chosen(options.copy_off), is_on=False)


def _changes_copies(options: argparse.Namespace) -> bool:
    return any(getattr(options, f"copy_{name}") is not None for name in ("on", "off", "remove"))


def describe_copies(project: ScriptedProject) -> dict[str, Any]:
    """All copies as plain data: schema; path; copies, as project.json holds them; undo and redo."""
    return {
        "schema": COPIES_SCHEMA,
        "path": str(project.folder),
        "copies": [to_builtins(copy) for copy in project.copies],
        "undo": project.history.undo_name,
        "redo": project.history.redo_name,
    }


def copy_lines(project: ScriptedProject) -> list[str]:
    """The same as text."""
    copies, names = project.copies, {one.object_id: one.name for one in project.document.objects}
    lines = [f"{project.folder}: {len(copies)} {'copy' if len(copies) == 1 else 'copies'}"]
    for copy in copies:
        words = [f"of {names.get(copy.object_id, 'an object that was removed')}", *_words(copy, names)]
        lines.append(f"{copy.copy_id:>5}  {one_line(copy.name)}: {one_line(', '.join(words))}")
    return lines


def _words(copy: ObjectCopy, names: dict[int, str]) -> list[str]:
    words = [] if copy.transform == Transform() else [copy.transform.words[0]]
    if copy.shift_frames:
        words.append(f"{abs(copy.shift_frames):g} frames {'later' if copy.shift_frames > 0 else 'earlier'}")
    if copy.speed != 1.0:
        words.append(f"speed {copy.speed:g} from frame {copy.anchor_frame:g}")
    if copy.is_in_place:
        words.append("in its place")
    match copy.carried_by:
        case OnPath(name=name):
            words.append(f"on the path {name}")
        case OnObject(object_id=object_id):
            words.append(f"with {names.get(object_id, 'an object that was removed')}")
        case None:
            pass
    if copy.group:
        words.append(f"in {copy.group}")
    return words if copy.is_on else [*words, "off"]


COPY_VERBS = {
    "duplicate": CopyVerb("show an object once more, elsewhere or at another time", _add_duplicate, _duplicate),
    "crowd": CopyVerb("fill rows with copies of an object", _add_crowd, _crowd),
    "copies": CopyVerb("list copies of objects, switch and remove them", _add_copies, _change_copies, _changes_copies),
}
"""Words after the project, which take the place of the options of an edit."""
