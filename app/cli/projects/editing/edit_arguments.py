"""The arguments of `clipgstream edit` that describe an edit: its target, its action, and its frames."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from typing import Any, TypeVar

from msgspec import Struct

from app.scripting.scripted_project import ScriptedProject
from engine.editing.actions import ACTIONS, Action, Quat, vector_of
from engine.editing.edit import Box, Everything, KeyedVolume, ObjectTarget, Picked, Prism, Scope, Sphere, Target
from engine.editing.volumes.keyed_volume import volume_at
from engine.errors import ProjectError
from engine.storage.json_files import JsonError, parse_json
from engine.storage.typed_json import EntryError, to_type

Made = TypeVar("Made")

_TARGET_OPTIONS = ("everything", "box", "turned_box", "sphere", "object", "target", "where", "at", "inverted")


class _Given(Struct):
    """A tagged union is read as an entry of something."""

    target: Target


def add_edit_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments that describe an edit."""
    _add_targets(command.add_argument_group("what an edit acts on (default: everything)"))
    _add_actions(command.add_argument_group("what it does"))
    _add_scopes(command.add_argument_group("in which frames (default: everywhere)"))
    command.add_argument("--name", default=None, help="a name for the edit")


def _add_targets(group: argparse._ArgumentGroup) -> None:
    one = group.add_mutually_exclusive_group()
    one.add_argument("--everything", action="store_true", help="all Gaussians")
    one.add_argument("--object", metavar="NAME", help="an object of the project, by name or number")
    _add_volumes(one)
    one.add_argument("--target", metavar="JSON", help="in the form that --json prints; - reads standard input")
    _add_where(group)
    group.add_argument("--at", type=int, metavar="FRAME", help="frame in which --where looks (default: 0)")
    group.add_argument("--inverted", action="store_true", help="everything except the target")


def add_pick_arguments(group: argparse._ArgumentGroup) -> None:
    """Arguments that pick Gaussians of one frame, see `chosen_picks`."""
    _add_volumes(group.add_mutually_exclusive_group())
    _add_where(group)
    group.add_argument("--at", type=int, metavar="FRAME", help="the frame in which they are picked")


def _add_volumes(one: argparse._MutuallyExclusiveGroup) -> None:
    one.add_argument(
        "--box", nargs=6, type=float, metavar=("X0", "Y0", "Z0", "X1", "Y1", "Z1"), help="a box by two corners"
    )
    one.add_argument(
        "--turned-box",
        nargs=10,
        type=float,
        metavar=("X", "Y", "Z", "HX", "HY", "HZ", "QW", "QX", "QY", "QZ"),
        help="a box by its centre, half its lengths, and the quaternion that turns it",
    )
    one.add_argument("--sphere", nargs=4, type=float, metavar=("X", "Y", "Z", "R"), help="a sphere: centre and radius")


def _add_where(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--where",
        metavar="TEXT",
        help="only Gaussians with these attributes, as 'opacity<0.05 and motion=static'; opacity, size, clip, birth, "
        "motion",
    )


def _add_actions(group: argparse._ArgumentGroup) -> None:
    for kind in ACTIONS.values():
        for flag, values in kind.flags().values():
            if not values:
                group.add_argument(flag.name, action="store_true", help=_help(flag.meaning))
                continue
            like = tuple((flag.like or " ".join(one.like for one in values)).split())
            read = values[0].kind if values[0].kind in (int, str) else float
            usual = " (default: the middle of a box or sphere, otherwise the origin)"
            help_text = _help(flag.meaning or values[0].meaning) + (usual if kind.centered == values[0].name else "")
            choices = list(values[0].choices) or None
            group.add_argument(flag.name, nargs=len(like), type=read, metavar=like, choices=choices, help=help_text)
        if kind.opposite:
            group.add_argument(f"--{kind.opposite}", action="store_true", help=f"{kind.label.lower()} everything else")


def _help(meaning: str) -> str:
    return f"{meaning[0].lower()}{meaning[1:]}"


def _add_scopes(group: argparse._ArgumentGroup) -> None:
    one = group.add_mutually_exclusive_group()
    one.add_argument("--everywhere", action="store_true", help="in all frames")
    one.add_argument("--frame", type=int, metavar="N", help="in one frame")
    one.add_argument("--frames", metavar="A:B", help="from A to B, B not included")
    one.add_argument("--clip", type=int, metavar="N", help="in the frames of a clip")
    one.add_argument("--from", dest="first", type=int, metavar="N", help="from this frame on")
    group.add_argument("--reference", action="store_true", help="only what comes from the reference clip")


def has_action(options: argparse.Namespace) -> bool:
    """Whether an action was given."""
    return bool(_given_actions(options))


def has_target(options: argparse.Namespace) -> bool:
    """Whether a target was given."""
    return any(_is_given(options, name) for name in _TARGET_OPTIONS)


def has_scope(options: argparse.Namespace) -> bool:
    """Whether something was said of the frames of an edit."""
    return any(_is_given(options, name) for name in ("everywhere", "frame", "frames", "clip", "first", "reference"))


def _is_given(options: argparse.Namespace, name: str) -> bool:
    value = getattr(options, name)
    return value is not None and value is not False


def chosen_target(options: argparse.Namespace, project: ScriptedProject, read_text: Callable[[str], str]) -> Target:
    """The target of the edit.

    Args:
        project: Where Gaussians are looked for, if their attributes are given.
        read_text: Gives the text of an argument, from standard input where that is "-".
    Raises:
        ProjectError: It cannot be.
    """
    if options.object is not None:
        target: Target = project.object(options.object)
    else:
        target = _given_target(options, read_text) if options.target is not None else _volume(options)
    if options.where is None:
        if options.at is not None:
            raise ProjectError("--at is given without --where.", hint="Leave it out.")
        return target
    if isinstance(target, Picked | ObjectTarget):
        given = "--target" if options.object is None else "--object"
        raise ProjectError("--where goes with a box, a sphere, a prism or everything.", hint=f"Leave {given} out.")
    if isinstance(target, KeyedVolume):
        target = volume_at(target, options.at or 0)
    volume = None if isinstance(target, Everything) else target
    return project.select(options.where, frame_index=options.at or 0, volume=volume)


def chosen_picks(options: argparse.Namespace, project: ScriptedProject) -> tuple[int, Picked]:
    """A frame, and the Gaussians picked in it.

    Raises:
        ProjectError: Something is missing or not valid, or nothing is picked.
    """
    volume = _volume(options)
    if options.at is None:
        raise ProjectError("The frame is missing.", hint="Give the frame to select in, as --at 12.")
    if isinstance(volume, Everything) and options.where is None:
        raise ProjectError("Nothing is selected.", hint="Give --box, --sphere or --where.")
    where = options.where or ""
    volume = None if isinstance(volume, Everything) else volume
    return options.at, project.select(where, frame_index=options.at, volume=volume)


def _volume(options: argparse.Namespace) -> Everything | Box | Sphere:
    if options.box is not None:
        a, b = options.box[:3], options.box[3:]
        center = vector_of((x + y) / 2 for x, y in zip(a, b, strict=True))
        half_sizes = vector_of(abs(x - y) / 2 for x, y in zip(a, b, strict=True))
        return _made("--box", lambda: Box(center, half_sizes))
    if options.turned_box is not None:
        numbers = options.turned_box
        quat = _quat(numbers[6:])
        return _made("--turned-box", lambda: Box(vector_of(numbers[:3]), vector_of(numbers[3:6]), quat))
    if options.sphere is not None:
        return _made("--sphere", lambda: Sphere(vector_of(options.sphere[:3]), options.sphere[3]))
    return Everything()


def _given_target(options: argparse.Namespace, read_text: Callable[[str], str]) -> Target:
    try:
        return to_type({"target": parse_json(read_text(options.target))}, _Given).target
    except (JsonError, EntryError) as error:
        raise ProjectError(f"--target is not valid ({error}).") from error


def chosen_action(options: argparse.Namespace, target: Target) -> tuple[Action, bool]:
    """The action of the edit, and whether it acts on everything but its target.

    Raises:
        ProjectError: Nothing or several things are asked for, or a number is out of range.
    """
    found = _given_actions(options)
    if len(found) != 1:
        flags = [flag for _, given in found for flag in given]
        said = f"{' and '.join(flags)} are given together" if found else "No edit is given"
        raise ProjectError(f"{said}.", hint="An edit does one thing; give one of them.")
    ((kind, given),) = found
    said_as = getattr(options, "said_as", {})  # after a verb
    return _made(
        " with ".join(said_as.get(flag, flag) for flag in given), lambda: _action(kind, given, target)
    ), f"--{kind.opposite}" in given


def _given_actions(options: argparse.Namespace) -> list[tuple[type[Action], dict[str, list[Any]]]]:
    """Actions that are asked for, each with the options that were given and what follows them."""
    found: list[tuple[type[Action], dict[str, list[Any]]]] = []
    for kind in ACTIONS.values():
        said = {flag: getattr(options, flag[2:].replace("-", "_")) for flag in kind.flags()}
        found += [(kind, given)] if (given := {flag: value for flag, value in said.items() if value}) else []
        found += [(kind, {f"--{kind.opposite}": []})] if kind.opposite and getattr(options, kind.opposite) else []
    return found


def _action(kind: type[Action], given: dict[str, list[Any]], target: Target) -> Action:
    values: dict[str, Any] = {}
    if isinstance(target, KeyedVolume):
        target = target.keys[0].volume
    if kind.centered and isinstance(target, Box | Sphere | Prism):
        values[kind.centered] = target.center
    said: dict[str, str] = {}
    for name, words in given.items():
        flag, settings = kind.flags().get(name, (None, []))
        for one in settings:
            if one.name in said:
                raise ProjectError(f"{said[one.name]} and {name} are given together.", hint="Give one of them.")
            said[one.name] = name
            if flag is not None and flag.read is not None:
                values[one.name] = flag.read(tuple(words))
                continue
            n = len(one.like.split())
            part, words = tuple(words[:n]), words[n:]
            values[one.name] = part if one.kind is tuple else part[0]
    return kind(**values)


def chosen_scope(options: argparse.Namespace, project: ScriptedProject) -> Scope:
    """The frames of the edit.

    Raises:
        ProjectError: There are no such frames.
    """
    first, stop = 0, None
    if options.frame is not None:
        first = _count("--frame", options.frame)
        stop = first + 1
    elif options.first is not None:
        first = _count("--from", options.first)
    elif options.clip is not None:
        scope = project.scope_of_clip(options.clip)
        first, stop = scope.first, scope.stop
    elif options.frames is not None:
        found = re.fullmatch(r"\s*(\d{0,9})\s*:\s*(\d{0,9})\s*", options.frames)
        if found is None:
            raise ProjectError(f"--frames is '{options.frames}', which is not a range A:B.")
        first, stop = int(found[1] or 0), int(found[2]) if found[2] else None
    return _made("--frames", lambda: Scope(first, stop, options.reference))


def _count(option: str, number: int) -> int:
    if not 0 <= number < 2**31:
        raise ProjectError(f"{option} is {number}; frames are counted from 0.")
    return number


def _quat(numbers: list[float]) -> Quat:
    w, x, y, z = numbers
    return w, x, y, z


def _made(option: str, make: Callable[[], Made]) -> Made:
    """The value of a constructor; its ValueError becomes a ProjectError."""
    try:
        return make()
    except (TypeError, ValueError) as error:  # TypeError: a value is missing
        raise ProjectError(f"{option} is not valid: {error}.") from error
