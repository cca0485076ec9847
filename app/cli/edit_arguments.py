"""The arguments of `clipgstream edit` that describe an edit: what it acts on, what it does, and in which frames."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Iterable
from typing import TypeVar

from msgspec import Struct

from app.scripting.scripted_project import ScriptedProject
from engine.editing.edit import (
    Action,
    Box,
    Delete,
    Everything,
    Expose,
    Hide,
    Hold,
    Picked,
    Quat,
    Recolor,
    Scope,
    Smooth,
    Sphere,
    Target,
    Transform,
    Vector,
)
from engine.errors import ProjectError
from engine.storage.json_files import JsonError, parse_json
from engine.storage.typed_json import EntryError, to_type

Made = TypeVar("Made")

ACTION_OPTIONS = (
    *("delete", "hide", "isolate", "move", "rotate", "quat", "scale", "pivot"),
    *("recolour", "saturation", "gains", "opacity", "exposure", "hold", "smooth"),
)
"""Of which one or more say what an edit does."""
_TARGET_OPTIONS = ("everything", "box", "turned_box", "sphere", "target", "where", "at", "inverted")


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
    one.add_argument("--target", metavar="JSON", help="as --json prints it; - reads standard input")
    group.add_argument(
        "--where",
        metavar="TEXT",
        help="only Gaussians with these attributes, as 'opacity<0.05 and motion=static'; opacity, size, clip, birth, "
        "motion",
    )
    group.add_argument("--at", type=int, metavar="FRAME", help="frame in which --where looks (default: 0)")
    group.add_argument("--inverted", action="store_true", help="everything but that")


def _add_actions(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--delete", action="store_true", help="it is gone")
    group.add_argument("--hide", action="store_true", help="it is not drawn")
    group.add_argument("--isolate", action="store_true", help="everything else is not drawn")
    group.add_argument("--move", nargs=3, type=float, metavar=("X", "Y", "Z"), help="by so many scene units")
    group.add_argument(
        "--rotate", nargs=4, type=float, metavar=("X", "Y", "Z", "DEG"), help="about this axis, by so many degrees"
    )
    group.add_argument("--quat", nargs=4, type=float, metavar=("W", "X", "Y", "Z"), help="the same as a quaternion")
    group.add_argument("--scale", type=float, metavar="S", help="make it so many times as large")
    group.add_argument(
        "--pivot",
        nargs=3,
        type=float,
        metavar=("X", "Y", "Z"),
        help="what it is turned and scaled about (default: the middle of a box or sphere, otherwise the origin)",
    )
    group.add_argument(
        "--recolour",
        nargs=4,
        type=float,
        metavar=("R", "G", "B", "SHARE"),
        help="mix a colour in; red, green, blue and how much of it, 0 to 1",
    )
    group.add_argument("--saturation", type=float, metavar="S", help="0 is grey, 1 leaves colours alone")
    group.add_argument("--gains", nargs=3, type=float, metavar=("R", "G", "B"), help="factors of the three channels")
    group.add_argument("--opacity", type=float, metavar="S", help="factor of the opacity")
    group.add_argument("--exposure", type=float, metavar="STOPS", help="brighter or darker, 1 doubles the light")
    group.add_argument("--hold", type=int, metavar="FRAME", help="it stands still, as it is in this frame")
    group.add_argument("--smooth", type=float, metavar="FRAMES", help="it changes more slowly")


def _add_scopes(group: argparse._ArgumentGroup) -> None:
    one = group.add_mutually_exclusive_group()
    one.add_argument("--everywhere", action="store_true", help="in all frames")
    one.add_argument("--frame", type=int, metavar="N", help="in one frame")
    one.add_argument("--frames", metavar="A:B", help="from A to B, B not included")
    one.add_argument("--clip", type=int, metavar="N", help="in the frames of a clip")
    one.add_argument("--from", dest="first", type=int, metavar="N", help="from this frame on")
    group.add_argument("--reference", action="store_true", help="only what comes from the reference clip")


def has_action(options: argparse.Namespace) -> bool:
    """Whether something was said of what an edit does."""
    return any(_is_given(options, name) for name in ACTION_OPTIONS)


def has_target(options: argparse.Namespace) -> bool:
    """Whether something was said of what an edit acts on."""
    return any(_is_given(options, name) for name in _TARGET_OPTIONS)


def has_scope(options: argparse.Namespace) -> bool:
    """Whether something was said of the frames of an edit."""
    return any(_is_given(options, name) for name in ("everywhere", "frame", "frames", "clip", "first", "reference"))


def _is_given(options: argparse.Namespace, name: str) -> bool:
    value = getattr(options, name)
    return value is not None and value is not False


def chosen_target(options: argparse.Namespace, project: ScriptedProject, read_text: Callable[[str], str]) -> Target:
    """What the edit acts on.

    Args:
        project: Where Gaussians are looked for, if their attributes are given.
        read_text: Gives the text of an argument, from standard input where that is "-".
    Raises:
        ProjectError: It cannot be.
    """
    target = _shape(options, read_text)
    if options.where is None:
        if options.at is not None:
            raise ProjectError("--at is given without --where.", hint="Leave it out.")
        return target
    if isinstance(target, Picked):
        raise ProjectError("--where goes with a box, a sphere or everything.", hint="Leave --target out.")
    volume = None if isinstance(target, Everything) else target
    return project.select(options.where, frame_index=options.at or 0, volume=volume)


def _shape(options: argparse.Namespace, read_text: Callable[[str], str]) -> Target:
    if options.box is not None:
        a, b = options.box[:3], options.box[3:]
        center = _vector((x + y) / 2 for x, y in zip(a, b, strict=True))
        half_sizes = _vector(abs(x - y) / 2 for x, y in zip(a, b, strict=True))
        return _made("--box", lambda: Box(center, half_sizes))
    if options.turned_box is not None:
        numbers = options.turned_box
        quat = _quat(numbers[6:])
        return _made("--turned-box", lambda: Box(_vector(numbers[:3]), _vector(numbers[3:6]), quat))
    if options.sphere is not None:
        return _made("--sphere", lambda: Sphere(_vector(options.sphere[:3]), options.sphere[3]))
    if options.target is not None:
        try:
            return to_type({"target": parse_json(read_text(options.target))}, _Given).target
        except (JsonError, EntryError) as error:
            raise ProjectError(f"--target makes no sense ({error}).") from error
    return Everything()


def chosen_action(options: argparse.Namespace, target: Target) -> tuple[Action, bool]:
    """What the edit does, and whether it does that to everything but its target.

    Raises:
        ProjectError: Nothing or several things are asked for, or a number is out of range.
    """
    found: dict[str, Callable[[], Action]] = {}
    for name, action in (("delete", Delete()), ("hide", Hide()), ("isolate", Hide())):
        if getattr(options, name):
            found[f"--{name}"] = lambda action=action: action
    if any(_is_given(options, name) for name in ("move", "rotate", "quat", "scale", "pivot")):
        found["--move, --rotate or --scale"] = lambda: _transform(options, target)
    if any(_is_given(options, name) for name in ("recolour", "saturation", "gains", "opacity")):
        found["--recolour, --saturation, --gains or --opacity"] = lambda: _recolor(options)
    if options.exposure is not None:
        found["--exposure"] = lambda: Expose(options.exposure)
    if options.hold is not None:
        found["--hold"] = lambda: Hold(_count("--hold", options.hold))
    if options.smooth is not None:
        found["--smooth"] = lambda: Smooth(options.smooth)
    if len(found) != 1:
        said = f"{' and '.join(found)} are given together" if found else "Nothing says what the edit does"
        raise ProjectError(f"{said}.", hint="An edit does one thing: give one of them.")
    ((option, make),) = found.items()
    return _made(option, make), options.isolate


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


def _transform(options: argparse.Namespace, target: Target) -> Transform:
    if options.rotate is not None and options.quat is not None:
        raise ProjectError("--rotate and --quat are given together.", hint="Give one of them.")
    quat: Quat = (1.0, 0.0, 0.0, 0.0)
    if options.quat is not None:
        quat = _quat(options.quat)
    elif options.rotate is not None:
        quat = _turn(options.rotate)
    pivot = target.center if isinstance(target, Box | Sphere) else (0.0, 0.0, 0.0)
    return Transform(
        translation=(0.0, 0.0, 0.0) if options.move is None else _vector(options.move),
        quat=quat,
        scale=1.0 if options.scale is None else options.scale,
        pivot=pivot if options.pivot is None else _vector(options.pivot),
    )


def _turn(numbers: list[float]) -> Quat:
    *axis, degrees = numbers
    length = math.hypot(*axis)
    if not (math.isfinite(length) and math.isfinite(degrees) and length > 0.0):
        raise ProjectError("--rotate has no axis or angle to turn by.", hint="Write for instance --rotate 0 1 0 90.")
    half = math.radians(degrees) / 2
    x, y, z = (math.sin(half) * part / length for part in axis)
    return math.cos(half), x, y, z


def _recolor(options: argparse.Namespace) -> Recolor:
    recolour = options.recolour
    return Recolor(
        tint=(0.5, 0.5, 0.5) if recolour is None else _vector(recolour[:3]),
        tint_share=0.0 if recolour is None else recolour[3],
        saturation=1.0 if options.saturation is None else options.saturation,
        gains=(1.0, 1.0, 1.0) if options.gains is None else _vector(options.gains),
        opacity=1.0 if options.opacity is None else options.opacity,
    )


def _count(option: str, number: int) -> int:
    if not 0 <= number < 2**31:
        raise ProjectError(f"{option} is {number}; frames are counted from 0.")
    return number


def _vector(numbers: Iterable[float]) -> Vector:
    x, y, z = numbers
    return x, y, z


def _quat(numbers: list[float]) -> Quat:
    w, x, y, z = numbers
    return w, x, y, z


def _made(option: str, make: Callable[[], Made]) -> Made:
    """What a constructor makes; a ValueError of its own becomes a ProjectError."""
    try:
        return make()
    except ValueError as error:
        raise ProjectError(f"{option} makes no sense: {error}.") from error
