"""Verbs of `clipgstream edit` that change when the take plays what: `clipgstream edit PROJECT speed --by 0.5`. Their
options follow from the declarations in app.document.changes.timing_changes.
"""

from __future__ import annotations

import argparse
from typing import Any

from msgspec import NODEFAULT

from app.cli.arguments import parse_range
from app.document.changes.timing_changes import TIME_EDITS, segment_words
from app.scripting.scripted_project import ScriptedProject
from engine.errors import ProjectError
from engine.setting import Setting, settings_of
from engine.timing.timing import TakeTiming

_SHARED = ("frames", "at", "by")
"""Options that edits and their verbs have, too."""
_OWN = {one.name: one for kind in TIME_EDITS.values() for one in settings_of(kind).values() if one.name not in _SHARED}
_WORDS = ("places",)
"""Given without an option: `order 2,0,1`."""


def add_time_arguments(command: argparse.ArgumentParser) -> None:
    """Options of the verbs; --frames and --at are those of edits."""
    verbs = "; ".join(f"{verb}: {kind.meaning[0].lower()}{kind.meaning[1:]}" for verb, kind in TIME_EDITS.items())
    group = command.add_argument_group("time, after a verb", verbs)
    for name, one in _OWN.items():
        if name not in _WORDS:
            choices = list(one.choices) or None
            said: dict[str, Any] = {"metavar": None if choices else one.flags[0].name[2:].upper(), "choices": choices}
            read = str if choices else one.kind
            group.add_argument(one.flags[0].name, dest=f"time_{name}", type=read, help=_help(one), **said)


def _help(one: Setting) -> str:
    usual = "" if one.default is NODEFAULT else f" (default: {one.usual})"
    return f"{one.meaning[0].lower()}{one.meaning[1:]}{usual}"


def given_time_options(options: argparse.Namespace) -> list[str]:
    """Options of verbs that were given."""
    return [one.flags[0].name for name, one in _OWN.items() if getattr(options, f"time_{name}", None) is not None]


def change_time(options: argparse.Namespace, words: list[str], project: ScriptedProject) -> None:
    """Carry out a verb.

    Args:
        words: The verb, and what follows it without an option.
    Raises:
        ProjectError: It is not possible; says why.
    """
    verb, *rest = words
    declared = settings_of(TIME_EDITS[verb])
    given: dict[str, Any] = {name: getattr(options, name, None) for name in _SHARED}
    if given["by"] is not None:
        if len(given["by"]) != 1:
            raise ProjectError(f"--by has {len(given['by'])} values; {verb} takes 1.")
        given["by"] = given["by"][0]
    given |= {name: getattr(options, f"time_{name}", None) for name in _OWN}
    if "places" in declared and rest:
        given["places"] = declared["places"].parse(",".join(rest))
    elif "places" in declared:
        raise ProjectError(f"{verb} needs the numbers of segments.", hint=f"Write for example: {verb} 2,0,1.")
    elif rest:
        raise ProjectError(f"{verb} is followed by '{rest[0]}', which is not an option of it.")
    entries = {name: value for name, value in given.items() if value is not None}
    for name, value in entries.items():
        flag = _OWN[name].flags[0].name if name in _OWN and name not in _WORDS else f"--{name}"
        if name not in declared:
            raise ProjectError(f"{flag} does not apply to {verb}.", hint="Leave it out.")
        if name != "frames" and name not in _WORDS and not declared[name].is_within(value):
            raise ProjectError(f"{flag} is {value}; it has to be {declared[name].allowed}.")
    if "frames" in entries:
        chosen = parse_range(entries["frames"], project.n_frames, option="--frames", what="frames")
        entries["frames"] = (chosen.start, chosen.stop)
    project.time_edit(verb, **entries)


def take_lines(project: ScriptedProject) -> list[str]:
    """The segments of a take that is edited in time, as text; none where it is as captured."""
    segments = project.document.timing
    if not segments:
        return []
    timing, fps = TakeTiming(segments, project.n_frames), project.capture.fps
    lines = [f"The take has {timing.n_output} frames, {timing.duration_s(fps):.2f} s:"]
    return lines + [f"{place:>5}  {segment_words(one)}" for place, one in enumerate(segments)]
